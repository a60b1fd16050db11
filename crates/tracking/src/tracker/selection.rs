//! Selection of the probe's and the needle's records in a stream of several sensors. Live sessions and replays use the
//! same rules.

use super::Record;
use super::sensor::{NeedleSensor, ProbeSensor, SensorName, is_tool};

/// Largest number of sensors that are distinguished. Records of further sensors are left out.
pub(crate) const HEARD_LIMIT: usize = 64;

/// Rule that decides which records are the probe's, and which the needle's.
#[derive(Debug, Clone)]
pub(crate) struct Selection {
    /// Choice of the probe; `None` takes the first sensor received, as in recordings of earlier builds.
    wanted: Option<ProbeSensor>,
    /// Choice of the needle; `None` without a tracked needle.
    needle: Option<NeedleSensor>,
    /// Sensors received so far.
    heard: Vec<SensorName>,
    /// Index in `heard` of the sensor used last; `None` before its first record.
    used: Option<usize>,
    /// Index in `heard` of the needle's sensor; `None` before its first record.
    needle_at: Option<usize>,
}

/// Verdict on one record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The record is the probe's.
    Probe,
    /// The record is the needle's.
    Needle,
    /// The record is another sensor's.
    Other,
    /// Several sensors have been received besides the needle's, and none was chosen.
    Undecided,
}

impl Selection {
    /// A selection before the first record.
    pub(crate) fn new(wanted: Option<ProbeSensor>, needle: Option<NeedleSensor>) -> Self {
        Self { wanted, needle, heard: Vec::new(), used: None, needle_at: None }
    }

    /// Judges a record of the sensor `name`, and numbers named tools in the order of their first records.
    ///
    /// Returns the verdict, and the sensor's index in [`heard`](Self::heard); `None` beyond [`HEARD_LIMIT`].
    pub(crate) fn judge(&mut self, record: &mut Record, name: Option<&str>) -> (Verdict, Option<usize>) {
        let is_known = |known: &SensorName| match (&known.name, name) {
            (Some(known), Some(name)) => known == name,
            (None, None) => known.number == record.sensor,
            _ => false,
        };
        let at = match self.heard.iter().position(is_known) {
            Some(at) => at,
            None if self.heard.len() >= HEARD_LIMIT => return (Verdict::Other, None),
            None => {
                let number = if name.is_some() { self.heard.len() as u16 } else { record.sensor };
                self.heard.push(SensorName { number, name: name.map(str::to_owned) });
                self.heard.len() - 1
            }
        };
        record.sensor = self.heard[at].number;
        if self.needle.as_ref().is_some_and(|needle| needle.is(record.sensor, name)) {
            self.needle_at = Some(at);
            return (Verdict::Needle, Some(at));
        }
        let verdict = match &self.wanted {
            None if *self.used.get_or_insert(at) == at => Verdict::Probe,
            Some(ProbeSensor::Only) if self.others_heard() == 1 => Verdict::Probe,
            Some(ProbeSensor::Only) => Verdict::Undecided,
            Some(ProbeSensor::Number(number)) if *number == record.sensor => Verdict::Probe,
            Some(ProbeSensor::Tool(tool)) if name.is_some_and(|name| is_tool(tool, name)) => Verdict::Probe,
            _ => Verdict::Other,
        };
        match verdict {
            Verdict::Probe => self.used = Some(at),
            Verdict::Undecided => self.used = None,
            Verdict::Needle | Verdict::Other => {}
        }
        (verdict, Some(at))
    }

    /// Sensors received so far, in the order of their first records.
    pub(crate) fn heard(&self) -> &[SensorName] {
        &self.heard
    }

    /// Number of sensors received so far, without the needle's.
    fn others_heard(&self) -> usize {
        self.heard.len() - usize::from(self.needle_at.is_some())
    }

    /// The needle's sensor; `None` before its first record.
    pub(crate) fn needle(&self) -> Option<&SensorName> {
        self.heard.get(self.needle_at?)
    }

    /// Choice of the needle, if it was not received yet; `None` otherwise.
    #[cfg(feature = "live")]
    pub(crate) fn missing_needle(&self) -> Option<&NeedleSensor> {
        self.needle.as_ref().filter(|_| self.needle_at.is_none())
    }

    /// The sensor that is the probe. `None` before its first record, or if several sensors have been received and none
    /// was chosen.
    pub(crate) fn used(&self) -> Option<&SensorName> {
        self.heard.get(self.used?)
    }

    /// Choice of the probe; `None` takes the first sensor received.
    #[cfg(feature = "live")]
    pub(crate) fn wanted(&self) -> Option<&ProbeSensor> {
        self.wanted.as_ref()
    }

    /// Whether several sensors have been received and none was chosen.
    pub(crate) fn is_undecided(&self) -> bool {
        self.wanted == Some(ProbeSensor::Only) && self.others_heard() > 1
    }
}

#[cfg(test)]
mod tests {
    use insonify_core::pose::Reading;

    use super::*;

    fn verdicts(wanted: Option<ProbeSensor>, stream: &[(u16, Option<&str>)]) -> Vec<Verdict> {
        verdicts_with(wanted, None, stream)
    }

    fn verdicts_with(
        wanted: Option<ProbeSensor>,
        needle: Option<NeedleSensor>,
        stream: &[(u16, Option<&str>)],
    ) -> Vec<Verdict> {
        let mut selection = Selection::new(wanted, needle);
        stream.iter().map(|(n, name)| selection.judge(&mut Record::new(*n, Reading::OutOfView), *name).0).collect()
    }

    #[test]
    fn nothing_is_chosen_by_order_of_arrival_among_several() {
        use Verdict::{Other, Probe, Undecided};
        let tools = [(0, Some("Stylus")), (0, Some("Stylus")), (1, Some("Probe")), (0, Some("Stylus"))];
        assert_eq!(verdicts(Some(ProbeSensor::Only), &tools), [Probe, Probe, Undecided, Undecided]);
        assert_eq!(verdicts(Some(ProbeSensor::Only), &[(3, None), (3, None), (7, None)]), [Probe, Probe, Undecided]);
        assert_eq!(verdicts(Some(ProbeSensor::Tool("Probe".into())), &tools), [Other, Other, Probe, Other]);
        assert_eq!(verdicts(Some(ProbeSensor::Number(7)), &[(3, None), (7, None)]), [Other, Probe]);
        // Recordings of earlier builds have no choice.
        assert_eq!(verdicts(None, &tools), [Probe, Probe, Other, Probe]);
    }

    #[test]
    fn the_needles_sensor_is_never_the_probe_and_makes_no_choice_among_others_necessary() {
        use Verdict::{Needle, Other, Probe, Undecided};
        let needle = Some(NeedleSensor::Tool("Needle".into()));
        let tools = [(0, Some("Needle")), (1, Some("Probe")), (0, Some("Needle")), (1, Some("Probe"))];
        let only = Some(ProbeSensor::Only);
        assert_eq!(verdicts_with(only.clone(), needle.clone(), &tools), [Needle, Probe, Needle, Probe]);
        let backwards: Vec<_> = tools.iter().rev().copied().collect();
        assert_eq!(verdicts_with(only.clone(), needle.clone(), &backwards), [Probe, Needle, Probe, Needle]);
        let three = [(0, Some("Probe")), (1, Some("Needle")), (2, Some("Stylus")), (1, Some("Needle"))];
        assert_eq!(verdicts_with(only, needle.clone(), &three), [Probe, Needle, Undecided, Needle]);
        let probe = Some(ProbeSensor::Tool("Probe".into()));
        assert_eq!(verdicts_with(probe, needle, &three), [Probe, Needle, Other, Needle]);
        // Recordings of earlier builds have no choice: their first other sensor is the probe.
        let number = Some(NeedleSensor::Number(2));
        assert_eq!(verdicts_with(None, number, &[(2, None), (1, None), (3, None)]), [Needle, Probe, Other]);
    }

    #[test]
    fn a_reconnected_server_that_numbers_its_tools_anew_changes_nothing() {
        use Verdict::{Other, Probe};
        let stream = [(0, Some("Stylus")), (1, Some("Probe")), (0, Some("Probe")), (1, Some("Stylus"))];
        assert_eq!(verdicts(Some(ProbeSensor::Number(1)), &stream), [Other, Probe, Probe, Other]);
    }

    #[test]
    fn names_are_compared_as_far_as_the_wire_holds_them() {
        let long = "ProbeToReferenceOfTheTable";
        let found =
            verdicts(Some(ProbeSensor::Tool(long.into())), &[(0, Some(&long[..20])), (1, Some("ProbeToReference"))]);
        assert_eq!(found, [Verdict::Probe, Verdict::Other]);
    }
}
