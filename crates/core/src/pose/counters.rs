//! Counters of a measurement stream.

macro_rules! counters {
    ($($(#[doc = $doc:literal])+ $name:ident,)*) => {
        /// Named event counters of an estimator.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
        pub struct Counters {
            $($(#[doc = $doc])+ pub $name: u64,)*
        }

        impl Counters {
            /// Names of all counters.
            pub const NAMES: [&'static str; [$(stringify!($name)),*].len()] = [$(stringify!($name)),*];

            /// All counters with their names.
            pub fn named(&self) -> impl Iterator<Item = (&'static str, u64)> {
                Self::NAMES.into_iter().zip([$(self.$name),*])
            }
        }
    };
}

counters! {
    /// Measurements received.
    measurements,
    /// Measurements converted to a pose.
    used,
    /// Refused: a non-finite component, a quaternion that is not a unit one, or a position out of range.
    invalid,
    /// Dropped: the device's counter and clock equal those of the previous measurement.
    duplicates,
    /// Dropped: measured before one that was already used.
    out_of_order,
    /// Missing by the device's counter: measured but not received.
    missing,
    /// Restarts of the device's counter or clock.
    device_restarts,
    /// Measurements whose device clock did not advance while the counter rose; host time is used.
    clock_stalls,
    /// Dropped: the host's time did not rise.
    time_not_rising,
    /// Dropped: host time and regressed time differ by more than 0.5 s.
    time_outliers,
    /// Jumps of the host's clock, forward or back, after which the new time was adopted.
    clock_jumps,
    /// Reports of the device that the sensor is out of view.
    out_of_view,
    /// Dropped: farther from the last pose than a hand can move.
    spikes,
    /// Displacements farther than a hand can move, accepted because a second measurement confirmed them.
    jumps,
    /// Number of times the sensor was stuck: readings stayed exactly equal for too long.
    stuck,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_match_their_values() {
        let counters = Counters { spikes: 3, ..Counters::default() };
        assert_eq!(counters.named().filter(|(_, n)| *n > 0).collect::<Vec<_>>(), [("spikes", 3)]);
        assert_eq!(Counters::NAMES.first(), Some(&"measurements"));
    }
}
