//! Controls: requests of the session's viewers ("watchers"), applied to the settings of the session.

use tokio::sync::mpsc;

use crate::settings::{Control, LiveSettings, Quality, SettingsGroup as _};

/// Capacity of the queue of controls. When it is full, a watcher must wait or send again.
pub(crate) const CONTROLS_WAITING: usize = 64;

/// Changes made by the applied controls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Changes {
    /// The renderer must be reconfigured.
    pub(super) picture: bool,
    /// Any setting changed.
    pub(super) any: bool,
    /// A watcher set the number of rays or of elevational layers.
    pub(super) quality: bool,
    /// A watcher requested the end of the session.
    pub(super) quit: bool,
    /// Number of controls applied.
    pub(super) applied: u64,
    /// Number of controls refused.
    pub(super) refused: u64,
}

/// Live settings of the session and the queue of controls.
#[derive(Debug)]
pub(super) struct Controls {
    receiver: mpsc::Receiver<Control>,
    /// Settings for the next frame.
    pub(super) live: LiveSettings,
}

impl Controls {
    pub(super) fn new(receiver: mpsc::Receiver<Control>, live: LiveSettings) -> Self {
        Self { receiver, live }
    }

    /// Applies the queued controls. Calls `refuse` with a message for each value out of range, and `note` for each mark
    /// that is set or removed.
    pub(super) fn apply_waiting(&mut self, mut refuse: impl FnMut(String), mut note: impl FnMut(&Control)) -> Changes {
        let mut changes = Changes::default();
        let before = self.live;
        // At most one queue length: a flood of controls must not delay a frame.
        for _ in 0..CONTROLS_WAITING {
            let Ok(control) = self.receiver.try_recv() else { break };
            let Control::Set(assignments) = &control else {
                changes.applied += 1;
                match control {
                    Control::Quit => changes.quit = true,
                    control => note(&control),
                }
                continue;
            };
            match self.live.with(assignments) {
                Ok(changed) => {
                    self.live = changed;
                    changes.applied += 1;
                    let is_quality = |key: &str| Quality::settings().iter().any(|setting| setting.key == key);
                    changes.quality |= assignments.iter().any(|a| is_quality(&a.key) || a.key == "angles");
                }
                Err(reason) => {
                    changes.refused += 1;
                    refuse(format!("not set: {reason}"));
                }
            }
        }
        changes.any = before != self.live;
        changes.picture = !before.same_picture(&self.live);
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Assignment, live_settings};

    fn apply(controls: &[Control]) -> (Controls, Changes, Vec<String>) {
        let (sender, receiver) = mpsc::channel(CONTROLS_WAITING);
        for control in controls {
            sender.try_send(control.clone()).unwrap();
        }
        let mut all = Controls::new(receiver, LiveSettings::default());
        let mut refused = Vec::new();
        let changes = all.apply_waiting(|text| refused.push(text), |_| ());
        (all, changes, refused)
    }

    #[test]
    fn every_live_setting_can_be_set() {
        for setting in live_settings() {
            let stored = LiveSettings::default().stored(setting.key).unwrap().get(0);
            let other = if stored == setting.min { setting.max } else { setting.min };
            let assignment = Assignment { index: setting.count() - 1, ..Assignment::new(setting.key, other) };
            let (controls, changes, refused) = apply(&[Control::Set(vec![assignment.clone()])]);
            assert_eq!(controls.live.stored(setting.key).unwrap().get(assignment.index), other, "{}", setting.key);
            assert!(refused.is_empty());
            let quality = setting.table == "quality" || setting.key == "angles";
            let picture = setting.table != "session";
            assert_eq!(changes, Changes { picture, any: true, quality, quit: false, applied: 1, refused: 0 });
        }
        assert_eq!(apply(&[Control::Quit]).1, Changes { quit: true, applied: 1, ..Changes::default() });
    }

    #[test]
    fn marks_change_no_setting_and_are_noted_in_order() {
        let (sender, receiver) = mpsc::channel(CONTROLS_WAITING);
        let sent = [Control::Unmark(vec!["a".into()]), Control::Unmark(vec!["b".into()])];
        sent.iter().for_each(|control| sender.try_send(control.clone()).unwrap());
        let mut all = Controls::new(receiver, LiveSettings::default());
        let mut noted = Vec::new();
        let changes = all.apply_waiting(|text| panic!("{text}"), |control| noted.push(control.clone()));
        assert_eq!((changes, &noted[..]), (Changes { applied: 2, ..Changes::default() }, &sent[..]));
    }

    #[test]
    fn freezing_leaves_the_picture_alone() {
        let (_, changes, _) = apply(&[Control::set("frozen", true)]);
        assert!(changes.any && !changes.picture);
        let (_, changes, _) = apply(&[Control::set("gain_db", 3.0), Control::set("gain_db", 0.0)]);
        assert!(!changes.any, "there and back is no change");
    }

    #[test]
    fn values_out_of_range_are_refused_and_change_nothing() {
        let (controls, changes, refused) = apply(&[
            Control::set("gain_db", f64::NAN),
            Control::set("depth_mm", 0.0),
            Control::Set(vec![Assignment { index: 8, ..Assignment::new("tgc_sliders_db", 0.0) }]),
            Control::Set(vec![Assignment::new("layers", 3.0), Assignment::new("rays", 0.0)]),
        ]);
        assert_eq!(changes, Changes { refused: 4, ..Changes::default() });
        assert_eq!(controls.live, LiveSettings::default());
        assert!(refused[1].contains("probe.depth_mm") && refused[2].contains("0..=7"), "{refused:?}");
    }
}
