//! Operating points to be measured in a sweep.

use super::Knobs;

/// Rays and layers of the sweeps that vary another knob (quality setting).
const MIDDLE: (u32, u32) = (8, 3);
/// Rays and layers also measured with every effect.
const ALL_EFFECTS: [(u32, u32); 3] = [(1, 1), (8, 1), (32, 3)];

/// Numbers of steering angles of compounded points.
const ANGLES: [u32; 2] = [3, 9];
/// Rays and layers also measured as stills, compounded from all angles.
const STILLS: [(u32, u32); 4] = [(1, 1), (1, 3), (8, 3), (32, 3)];
/// Rays and layers also measured as live, compounded pictures of a moving probe.
const ROLLING: [(u32, u32); 6] = [(1, 1), (1, 3), (2, 3), (4, 3), (8, 3), (16, 3)];
/// Shares of paths that follow reflections, percent, measured at high quality: with few paths, all of them do.
const REFLECTING: [u32; 4] = [100, 75, 50, 25];
/// Rays and layers also measured without the effect `aperture`.
const LEAN: [(u32, u32); 3] = [(1, 1), (1, 3), (2, 3)];

/// An operating point to be measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Planned {
    /// Unique name.
    pub name: String,
    /// Name of the varied knob: `rays x layers`, `rolling angles`, `all effects`, `no aperture`, `generator`, or one of
    /// [`Knobs::values`].
    pub sweep: &'static str,
    /// Name of the neighbouring point with which the noise test compares this point.
    pub against: Option<String>,
    /// Knob values.
    pub knobs: Knobs,
    /// Index of the generator that translates the frames, if any.
    pub generator: Option<usize>,
}

/// Name of a knob, values to try, and accessor of the knob.
type Sweep = (&'static str, Vec<u32>, fn(&mut Knobs) -> &mut u32);

/// Operating points to be measured around the station's knobs `base`; fewer with `quick`.
///
/// - a grid of rays × layers with one steering angle,
/// - some of its points compounded, if `compounds`: the probe can steer,
/// - these also compounded while the probe moves, if `moves`,
/// - some points with every effect, and some without the effect `aperture`,
/// - other shares of paths that follow reflections, at 32 rays × 3 layers,
/// - each other knob alone, at 8 rays × 3 layers.
///
/// The station's own numbers of samples, scanlines and taps are the maxima.
pub fn planned_points(base: Knobs, compounds: bool, moves: bool, quick: bool) -> Vec<Planned> {
    let base = base.compounded(1, false);
    let mut points: Vec<Planned> = Vec::new();
    let (rays, layers): (&[u32], &[u32]) =
        if quick { (&[1, 8, 32], &[1, 3]) } else { (&[1, 2, 4, 8, 16, 32], &[1, 3, 5]) };
    for &layers in layers {
        let mut against = None;
        for &rays in rays {
            let name = format!("{rays}x{layers}");
            points.push(Planned {
                name: name.clone(),
                sweep: "rays x layers",
                against,
                knobs: base.with(rays, layers),
                generator: None,
            });
            against = Some(name);
        }
    }
    let mut variant = |sweep, (rays, layers): (u32, u32), words: String, knobs: Knobs| {
        let against = format!("{rays}x{layers}");
        // A quick plan lacks some of these neighbours.
        if points.iter().any(|point| point.name == against) {
            points.push(Planned {
                name: format!("{against} {words}"),
                sweep,
                against: Some(against),
                knobs,
                generator: None,
            });
        }
    };
    for angles in ANGLES.into_iter().filter(|_| compounds) {
        for still in STILLS {
            let knobs = base.with(still.0, still.1).compounded(angles, false);
            variant("angles", still, format!("{angles} angles"), knobs);
        }
        for live in ROLLING.into_iter().filter(|_| moves) {
            let knobs = base.with(live.0, live.1).compounded(angles, true);
            variant("rolling angles", live, format!("{angles} rolling angles"), knobs);
        }
    }
    for lean in LEAN.into_iter().filter(|_| base.aperture) {
        variant("no aperture", lean, "no aperture".to_owned(), base.with(lean.0, lean.1).without_aperture());
    }
    // A station that simulates every effect already has these points.
    for all in ALL_EFFECTS.into_iter().filter(|_| !base.all_effects) {
        variant("all effects", all, "all effects".to_owned(), base.with(all.0, all.1).with_all_effects());
    }
    let percents = if quick { &REFLECTING[..1] } else { &REFLECTING };
    for &percent in percents.iter().filter(|&&percent| percent != base.reflecting_percent) {
        let knobs = Knobs { reflecting_percent: percent, ..base.with(32, 3) };
        variant("reflecting_percent", (32, 3), format!("reflecting_percent {percent}"), knobs);
    }
    let middle = base.with(MIDDLE.0, MIDDLE.1);
    let middle_name = format!("{}x{}", MIDDLE.0, MIDDLE.1);
    let part = |whole: u32, of: &[u32]| {
        let mut values: Vec<u32> = of.iter().map(|n| (whole * n / 8).max(1)).collect();
        // With few scanlines or samples, several eighths round to the same number.
        values.dedup();
        values
    };
    let sweeps: [Sweep; 5] = [
        ("reflections_max", vec![0, 1, 2, 4], |k| &mut k.reflections_max),
        ("scanlines", part(base.scanlines, &[2, 4, 6]), |k| &mut k.scanlines),
        ("samples", part(base.samples, &[2, 4, 6]), |k| &mut k.samples),
        ("beam_taps_max", vec![3, 5, 9, 17], |k| &mut k.beam_taps_max),
        ("pulse_taps_max", vec![3, 5, 9, 17], |k| &mut k.pulse_taps_max),
    ];
    for (sweep, values, knob) in sweeps {
        let step = if quick { 2 } else { 1 };
        for value in values.into_iter().step_by(step) {
            let mut knobs = middle;
            let own = *knob(&mut knobs);
            // The station's own value is the middle point itself. A larger limit has no effect.
            if value >= own {
                continue;
            }
            *knob(&mut knobs) = value;
            let name = format!("{middle_name} {sweep} {value}");
            points.push(Planned { name, sweep, against: Some(middle_name.clone()), knobs, generator: None });
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::RenderSettings;
    use crate::settings::SettingsGroup as _;
    use crate::transducer::Probe;

    #[test]
    fn every_point_has_its_own_name_and_values_and_an_earlier_neighbour() {
        for quick in [false, true] {
            let points = planned_points(Knobs::of(&Probe::default(), &RenderSettings::default()), true, true, quick);
            for (i, point) in points.iter().enumerate() {
                let before = &points[..i];
                assert!(before.iter().all(|p| p.name != point.name && p.knobs != point.knobs), "{point:?}");
                let known = |name: &String| before.iter().any(|p| p.name == *name);
                assert!(point.against.as_ref().is_none_or(known), "{point:?}");
                let (probe, settings) = point.knobs.apply(&Probe::default(), &RenderSettings::default(), 0);
                assert!(probe.validate().is_ok() && settings.validate().is_ok(), "{point:?}");
            }
            for name in ["1x1", "32x3", "8x3"] {
                assert!(points.iter().any(|p| p.name == name), "{name}");
            }
            let swept: std::collections::BTreeSet<_> = points.iter().map(|p| p.sweep).collect();
            assert_eq!(swept.len(), 11);
            assert!(points.len() <= if quick { 37 } else { 67 }, "{}", points.len());
        }
    }

    #[test]
    fn the_least_stations_have_points_that_can_be_rendered_each_once() {
        for (scanlines, samples) in [(1, 1), (2, 3), (3, 2), (4, 7)] {
            let probe = Probe { scanlines, samples: samples.into(), ..Probe::default() };
            let points = planned_points(Knobs::of(&probe, &RenderSettings::default()), true, true, false);
            for (i, point) in points.iter().enumerate() {
                assert!(point.knobs.scanlines >= 1 && point.knobs.samples >= 1);
                assert!(points[..i].iter().all(|p| p.name != point.name), "{point:?}");
            }
        }
    }

    #[test]
    fn only_probes_that_steer_are_compounded_and_only_those_that_move_roll() {
        let base = Knobs::of(&Probe::default(), &RenderSettings::default());
        let sweeps = |compounds, moves| {
            let points = planned_points(base.compounded(5, false), compounds, moves, false);
            ["angles", "rolling angles"].map(|sweep| points.iter().filter(|p| p.sweep == sweep).count())
        };
        assert_eq!([sweeps(true, true), sweeps(true, false), sweeps(false, true)], [[8, 12], [8, 0], [0, 0]]);
        assert!(planned_points(base.compounded(5, false), false, true, false).iter().all(|p| p.knobs.angles == 1));
    }

    #[test]
    fn all_effects_are_measured_beside_those_that_the_scene_calls_for() {
        let base = Knobs::of(&Probe::default(), &RenderSettings::default());
        for quick in [false, true] {
            let points = planned_points(base, true, false, quick);
            for name in ["1x1", "8x1", "32x3"] {
                let of = |name: &str| points.iter().find(|p| p.name == name).unwrap();
                let (planned, all) = (of(name), of(&format!("{name} all effects")));
                assert_eq!((all.sweep, all.against.as_deref()), ("all effects", Some(name)));
                assert_eq!(all.knobs, planned.knobs.with_all_effects());
                assert!(!planned.knobs.all_effects);
            }
        }
        assert!(planned_points(base.with_all_effects(), true, false, false).iter().all(|p| p.sweep != "all effects"));
    }
}
