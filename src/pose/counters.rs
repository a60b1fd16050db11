//! What a stream of measurements went through.

macro_rules! counters {
    ($($(#[doc = $doc:literal])+ $name:ident,)*) => {
        /// Counted events of an estimator, each under its name.
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
    /// Measurements pushed.
    measurements,
    /// Measurements that became a pose.
    used,
    /// Refused: a number that is not finite, no unit quaternion, a position out of range.
    invalid,
    /// Dropped: the device's counter and clock are those of the measurement before.
    duplicates,
    /// Dropped: the device made it before one that was used.
    out_of_order,
    /// Passed over by the device's counter: made, but never arrived.
    missing,
    /// The device's counter or clock began anew.
    device_restarts,
    /// Measurements whose device clock stood still while the counter rose; the host's time is used.
    clock_stalls,
    /// Dropped: the host's time did not rise.
    time_not_rising,
    /// Dropped: host time and regressed time differ by more than 0.5 s.
    time_outliers,
    /// The host's clock jumped, forward or back, and the new time was taken over.
    clock_jumps,
    /// The device said that it did not see the sensor.
    out_of_view,
    /// Dropped: farther from the last pose than any hand moves.
    spikes,
    /// A distance that no hand moves was confirmed by a second measurement and taken over.
    jumps,
    /// Times that readings began to be exactly equal for long although the device's clock ran.
    stuck,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_with_their_values() {
        let counters = Counters { spikes: 3, ..Counters::default() };
        assert_eq!(counters.named().filter(|(_, n)| *n > 0).collect::<Vec<_>>(), [("spikes", 3)]);
        assert_eq!(Counters::NAMES.first(), Some(&"measurements"));
    }
}
