//! Which points are measured.

use super::Knobs;

/// Rays and layers about which the other knobs are turned one at a time.
const MIDDLE: (u32, u32) = (8, 3);

/// A point to be measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Planned {
    /// Name, unlike all others.
    pub name: String,
    /// The knob that is turned: `rays x layers`, or one of [`Knobs::values`].
    pub sweep: &'static str,
    /// The neighbour that it is compared with to tell a difference from noise.
    pub against: Option<String>,
    /// Values.
    pub knobs: Knobs,
}

/// Name of a knob, its values, where it is.
type Sweep = (&'static str, Vec<u32>, fn(&mut Knobs) -> &mut u32);

/// A small grid of rays × layers, then every other knob alone about 8 × 3, from those of the station; with `quick` fewer
/// of each. The station's own values of samples, scanlines and taps are the greatest that are tried.
pub fn plan(base: Knobs, quick: bool) -> Vec<Planned> {
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
            });
            against = Some(name);
        }
    }
    let middle = base.with(MIDDLE.0, MIDDLE.1);
    let middle_name = format!("{}x{}", MIDDLE.0, MIDDLE.1);
    let part = |whole: u32, of: &[u32]| of.iter().map(|n| (whole * n / 8).max(1)).collect::<Vec<_>>();
    let sweeps: [Sweep; 6] = [
        ("paths_per_sample", vec![1, 2, 4, 8], |k| &mut k.paths_per_sample),
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
            // What the station has is the middle itself; a cap beyond it caps nothing.
            if value == own || (value > own && sweep != "paths_per_sample") {
                continue;
            }
            *knob(&mut knobs) = value;
            let name = format!("{middle_name} {sweep} {value}");
            points.push(Planned { name, sweep, against: Some(middle_name.clone()), knobs });
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::RenderSettings;
    use crate::transducer::Probe;

    #[test]
    fn every_point_has_its_own_name_and_values_and_an_earlier_neighbour() {
        for quick in [false, true] {
            let points = plan(Knobs::of(&Probe::default(), &RenderSettings::default()), quick);
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
            assert_eq!(swept.len(), 7);
            assert!(points.len() <= if quick { 20 } else { 40 });
        }
    }

    #[test]
    fn the_least_station_has_points_that_can_be_rendered() {
        let probe = Probe { scanlines: 1, samples: 1, ..Probe::default() };
        for point in plan(Knobs::of(&probe, &RenderSettings::default()), false) {
            assert!(point.knobs.scanlines >= 1 && point.knobs.samples >= 1);
        }
    }
}
