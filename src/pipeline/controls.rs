//! What watchers ask for, applied to the settings of the session.

use tokio::sync::mpsc;

use crate::render::{Quality, RenderSettings};
use crate::sink::live::{Control, LiveSettings};
use crate::transducer::Probe;

/// Controls that may wait to be applied: watchers that send more have to wait, or to send again.
pub const CONTROLS_WAITING: usize = 64;

/// What changed by the controls that came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Changes {
    /// The renderer has to be told.
    pub(super) picture: bool,
    /// Anything a watcher sees.
    pub(super) any: bool,
    /// Somebody set the quality.
    pub(super) quality: bool,
    /// The session shall end.
    pub(super) quit: bool,
    /// Controls applied.
    pub(super) applied: u64,
    /// Controls refused.
    pub(super) refused: u64,
}

/// The settings of the session, and where controls come from.
#[derive(Debug)]
pub(super) struct Controls {
    receiver: mpsc::Receiver<Control>,
    /// The probe as it is set now.
    pub(super) probe: Probe,
    /// The renderer's settings now.
    pub(super) settings: RenderSettings,
    /// Whether the picture stands still.
    pub(super) frozen: bool,
    /// Whether the generator may run.
    pub(super) enhance: bool,
}

impl Controls {
    pub(super) fn new(
        receiver: mpsc::Receiver<Control>,
        probe: Probe,
        settings: RenderSettings,
        enhance: bool,
    ) -> Self {
        Self { receiver, probe, settings, frozen: false, enhance }
    }

    /// The settings as watchers see them.
    pub(super) fn live(&self) -> LiveSettings {
        live_settings(&self.probe, &self.settings, self.frozen, self.enhance)
    }

    /// Applies whatever came. `refuse` hears of values out of range.
    pub(super) fn apply_waiting(&mut self, mut refuse: impl FnMut(String)) -> Changes {
        let mut changes = Changes::default();
        let before = self.live();
        // No more than can wait: a flood of controls must not hold a frame up.
        for _ in 0..CONTROLS_WAITING {
            let Ok(control) = self.receiver.try_recv() else { break };
            if control == Control::Quit {
                changes.quit = true;
                changes.applied += 1;
                continue;
            }
            match self.changed(&control) {
                Ok(changed) => {
                    (self.probe, self.settings, self.frozen, self.enhance) = changed;
                    changes.applied += 1;
                    changes.quality |= matches!(control, Control::Quality { .. });
                }
                Err(reason) => {
                    changes.refused += 1;
                    refuse(format!("not set: {reason}"));
                }
            }
        }
        let after = self.live();
        changes.any = before != after;
        changes.picture = !super::deadline::same_picture(&before, &after);
        changes
    }

    /// The settings after a control, if they are in range.
    fn changed(&self, control: &Control) -> Result<(Probe, RenderSettings, bool, bool), String> {
        let Self { mut probe, mut settings, mut frozen, mut enhance, .. } = *self;
        let image = &mut settings.image;
        match *control {
            Control::Freeze(on) => frozen = on,
            Control::Enhance(on) => enhance = on,
            Control::GainDb(db) => image.gain_db = db,
            Control::DynamicRangeDb(db) => image.dynamic_range_db = db,
            Control::TgcDbPerCm(db) => image.tgc_db_per_cm = db,
            Control::TgcSlider { index, db } => match image.tgc_sliders_db.get_mut(index) {
                Some(slider) => *slider = db,
                None => return Err(format!("there is no TGC slider {index}; they are 0..=7")),
            },
            Control::DepthMm(mm) => probe.depth_mm = mm,
            Control::FocusMm(mm) => probe.focus_mm = mm,
            Control::Quality { rays, layers } => settings.quality = Quality { rays, layers, ..settings.quality },
            Control::Quit => {}
        }
        settings.validate().map_err(|e| e.to_string())?;
        probe.validate().map_err(|e| e.to_string())?;
        Ok((probe, settings, frozen, enhance))
    }
}

/// Settings as watchers see them.
pub(super) fn live_settings(probe: &Probe, settings: &RenderSettings, frozen: bool, enhance: bool) -> LiveSettings {
    LiveSettings {
        image: settings.image,
        depth_mm: probe.depth_mm,
        focus_mm: probe.focus_mm,
        rays: settings.quality.rays,
        layers: settings.quality.layers,
        frozen,
        enhance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(controls: &[Control]) -> (Controls, Changes, Vec<String>) {
        let (sender, receiver) = mpsc::channel(CONTROLS_WAITING);
        for control in controls {
            sender.try_send(control.clone()).unwrap();
        }
        let mut all = Controls::new(receiver, Probe::default(), RenderSettings::default(), true);
        let mut refused = Vec::new();
        let changes = all.apply_waiting(|text| refused.push(text));
        (all, changes, refused)
    }

    #[test]
    fn every_control_reaches_its_setting() {
        let (controls, changes, refused) = apply(&[
            Control::Freeze(true),
            Control::GainDb(3.0),
            Control::DynamicRangeDb(70.0),
            Control::TgcDbPerCm(5.0),
            Control::TgcSlider { index: 7, db: -6.0 },
            Control::DepthMm(90.0),
            Control::FocusMm(40.0),
            Control::Quality { rays: 4, layers: 3 },
            Control::Enhance(false),
            Control::Quit,
        ]);
        let live = controls.live();
        assert_eq!((live.image.gain_db, live.image.dynamic_range_db, live.image.tgc_db_per_cm), (3.0, 70.0, 5.0));
        assert_eq!((live.image.tgc_sliders_db[7], live.depth_mm, live.focus_mm), (-6.0, 90.0, 40.0));
        assert_eq!((live.rays, live.layers, live.frozen, live.enhance), (4, 3, true, false));
        assert_eq!(changes, Changes { picture: true, any: true, quality: true, quit: true, applied: 10, refused: 0 });
        assert!(refused.is_empty());
    }

    #[test]
    fn freezing_leaves_the_picture_alone() {
        let (_, changes, _) = apply(&[Control::Freeze(true)]);
        assert!(changes.any && !changes.picture);
        let (_, changes, _) = apply(&[Control::GainDb(3.0), Control::GainDb(0.0)]);
        assert!(!changes.any, "there and back is no change");
    }

    #[test]
    fn values_out_of_range_are_refused_and_change_nothing() {
        let (controls, changes, refused) = apply(&[
            Control::GainDb(f64::NAN),
            Control::DepthMm(0.0),
            Control::TgcSlider { index: 8, db: 0.0 },
            Control::Quality { rays: 0, layers: 1 },
        ]);
        assert_eq!(changes, Changes { refused: 4, ..Changes::default() });
        assert_eq!(controls.live(), apply(&[]).0.live());
        assert!(refused[1].contains("probe.depth_mm") && refused[2].contains("0..=7"), "{refused:?}");
    }
}
