//! Gain and TGC of a view, from the attenuation along it, as a scanner's automatic gain sets them.
//!
//! The tissues along each scanline give the loss to each depth. The mean over the half of the scanlines that lose least
//! counts. TGC is its slope, and the gain makes up for the loss at the face. The TGC sliders follow the loss where it
//! leaves this line, as behind a full bladder.

use glam::DVec3;
use insonify_core::acoustics::attenuation::attenuation_db_mm;
use insonify_core::anatomy::{Mesh, Tissue, ray};
use insonify_core::pose::Pose;
use insonify_core::settings::TGC_SLIDERS;
use insonify_core::statistics;

use super::probe_choice::ProbeChoice;

/// Acoustic impedances of tissues that ultrasound passes, MRayl: above gas, below bone.
pub(super) const PASSED_MRAYL: std::ops::RangeInclusive<f64> = 0.5..=2.6;
/// Number of scanlines and distance of the depths at which the loss is told, mm.
const SCANLINES: usize = 33;
const STEP_MM: f64 = 2.0;
/// Depth from which the loss counts, mm: nearer, the probe's own field rules.
const FROM_MM: f64 = 10.0;
/// Fewest scanlines at a depth whose mean counts.
const FEWEST: usize = 4;
/// Distance of crossings that are one, mm.
const SAME_MM: f64 = 1e-6;
/// Gain without any loss, dB: liver is a middle grey.
const GAIN_DB: f64 = 8.0;
/// Range of the gain, dB, and of TGC, dB/cm.
const GAINS_DB: [f64; 2] = [-10.0, 40.0];
const TGC_DB_PER_CM: [f64; 2] = [0.5, 20.0];
/// Largest change by a TGC slider, dB.
const SLIDER_DB: f64 = 12.0;

/// Gain of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Overall gain, dB.
    pub gain_db: f64,
    /// Time gain compensation, dB/cm.
    pub tgc_db_per_cm: f64,
    /// Gain added at eight depths, evenly spaced from the face to the full depth, dB.
    pub tgc_sliders_db: [f64; TGC_SLIDERS],
}

/// A surface along the view: mesh, priority, and tissue inside.
pub type Layer<'a> = (&'a Mesh, i32, &'a Tissue);

impl Gain {
    /// Gain for `probe` at `pose` in a scene of `layers`.
    pub fn of(layers: &[Layer], probe: &ProbeChoice, pose: &Pose) -> Self {
        let ends = probe
            .scanlines(SCANLINES)
            .into_iter()
            .map(|(from, along)| (pose.transform_point(from), pose.transform_vector(along)));
        let lines: Vec<(DVec3, DVec3)> = ends.collect();
        let crossings = crossings(layers, &lines, pose.transform_vector(DVec3::Y), probe.depth_mm);
        let steps = (probe.depth_mm / STEP_MM) as usize;
        let lines: Vec<Vec<f64>> = crossings.iter().map(|line| losses_db(layers, line, probe, steps)).collect();
        let point = |step: usize| {
            let depth_mm = (step + 1) as f64 * STEP_MM;
            let losses_db: Vec<f64> = lines.iter().filter_map(|line| line.get(step).copied()).collect();
            if depth_mm <= FROM_MM || losses_db.len() < FEWEST {
                return None;
            }
            Some((0.1 * depth_mm, usual(losses_db)?))
        };
        let points: Vec<(f64, f64)> = (0..steps).filter_map(point).collect();
        let (start_db, slope) = line_through(&points).unwrap_or_else(|| (0.0, usual_db_per_cm(probe)));
        let tgc_db_per_cm = (10.0 * slope).round() / 10.0;
        let off_line: Vec<(f64, f64)> = points.iter().map(|&(cm, db)| (cm, db - start_db - slope * cm)).collect();
        Self {
            gain_db: (GAIN_DB + start_db).round().clamp(GAINS_DB[0], GAINS_DB[1]),
            tgc_db_per_cm: tgc_db_per_cm.clamp(TGC_DB_PER_CM[0], TGC_DB_PER_CM[1]),
            tgc_sliders_db: sliders(&off_line, 0.1 * probe.depth_mm),
        }
    }
}

/// The loss at a depth that gain and TGC make up for: the mean over the half of the scanlines that lose least. Tissue
/// behind a full bladder then has the usual grey level. Tissue beside the bladder is darker.
fn usual(mut losses_db: Vec<f64>) -> Option<f64> {
    losses_db.sort_by(f64::total_cmp);
    losses_db.truncate(losses_db.len().div_ceil(2));
    statistics::mean(losses_db)
}

/// Two-way loss of soft tissue and muscle, dB/cm, for views in which nothing passes.
fn usual_db_per_cm(probe: &ProbeChoice) -> f64 {
    1.3 * probe.frequency_mhz
}

/// Least-squares line through points: its value at 0 and its slope. `None` for points of fewer than two places.
fn line_through(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let (slope, _) = statistics::slope(points);
    let start = statistics::mean(points.iter().map(|(x, y)| y - slope * x))?;
    slope.is_finite().then_some((start, slope))
}

/// TGC sliders, dB, for `points` of depth in cm and loss beyond the line of gain and slope in dB. A slider takes the
/// weighted mean of the points up to the neighbouring sliders. A slider without points is set as the slider before it; at
/// the face, as the first slider that has points.
fn sliders(points: &[(f64, f64)], depth_cm: f64) -> [f64; TGC_SLIDERS] {
    let apart_cm = depth_cm / (TGC_SLIDERS - 1) as f64;
    let mean_at = |slider: usize| {
        let at_cm = slider as f64 * apart_cm;
        let weighted = points.iter().map(|&(cm, db)| ((1.0 - (cm - at_cm).abs() / apart_cm).max(0.0), db));
        let (weight, sum) = weighted.fold((0.0, 0.0), |(weight, sum), (w, db)| (weight + w, sum + w * db));
        (weight > 0.0).then(|| (sum / weight).round().clamp(-SLIDER_DB, SLIDER_DB))
    };
    let means: [Option<f64>; TGC_SLIDERS] = std::array::from_fn(mean_at);
    let first = means.iter().flatten().next().copied();
    let mut last = first.unwrap_or(0.0);
    means.map(|mean| {
        last = mean.unwrap_or(last);
        last
    })
}

/// Crossings of each line with the layers, ascending: depth in mm, index of the layer, and whether the line enters it. The
/// lines lie in a plane with the unit normal `elevational`.
fn crossings(
    layers: &[Layer],
    lines: &[(DVec3, DVec3)],
    elevational: DVec3,
    depth_mm: f64,
) -> Vec<Vec<(f64, usize, bool)>> {
    let mut found = vec![Vec::new(); lines.len()];
    let Some(&(in_plane, _)) = lines.first() else { return found };
    for (index, (mesh, ..)) in layers.iter().enumerate() {
        for corners in mesh.corners_mm() {
            // Most triangles lie on one side of the plane.
            let heights_mm = corners.map(|v| (v.as_dvec3() - in_plane).dot(elevational));
            if heights_mm.iter().all(|mm| *mm > SAME_MM) || heights_mm.iter().all(|mm| *mm < -SAME_MM) {
                continue;
            }
            for (line, &(from, along)) in found.iter_mut().zip(lines) {
                let hit = ray::intersect(corners, 0.0, from, along);
                line.extend(
                    hit.filter(|(depth, _)| depth.abs() < depth_mm).map(|(depth, leaves)| (depth, index, !leaves)),
                );
            }
        }
    }
    for line in &mut found {
        line.sort_by(|a, b| (a.1, a.2).cmp(&(b.1, b.2)).then(a.0.total_cmp(&b.0)));
        // A line through a shared edge meets both triangles.
        line.dedup_by(|a, b| (a.1, a.2) == (b.1, b.2) && (a.0 - b.0).abs() < SAME_MM);
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    found
}

/// Two-way loss from the face to each step of a line, dB, up to bone, gas or the far side of the body.
fn losses_db(layers: &[Layer], crossings: &[(f64, usize, bool)], probe: &ProbeChoice, steps: usize) -> Vec<f64> {
    let mut inside = vec![0i32; layers.len()];
    let mut next = crossings.iter().peekable();
    let mut loss_db = 0.0;
    let mut losses = Vec::new();
    let mut was_inside = false;
    for step in 0..steps {
        let middle_mm = (step as f64 + 0.5) * STEP_MM;
        while let Some(&(_, index, enters)) = next.next_if(|(depth, ..)| *depth < middle_mm) {
            inside[index] += if enters { 1 } else { -1 };
        }
        let present = layers.iter().zip(&inside).filter(|(_, count)| **count > 0).map(|(layer, _)| layer);
        // Of equal priorities, the later one is the medium.
        match present.max_by_key(|(_, priority, _)| *priority) {
            Some((.., tissue)) if PASSED_MRAYL.contains(&tissue.impedance_mrayl()) => {
                was_inside = true;
                let (a, y) = (tissue.attenuation_db_cm_mhz, tissue.attenuation_exponent);
                loss_db += 2.0 * attenuation_db_mm(a, y, probe.frequency_mhz) * STEP_MM;
            }
            None if !was_inside => {}
            _ => break,
        }
        losses.push(loss_db);
    }
    losses
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::TissueTable;
    use insonify_core::anatomy::analytic::cuboid;

    use super::*;
    use crate::segmentation::probe_choice::ProbeKind;

    fn gain(parts: &[(&str, f32, f32)], kind: ProbeKind) -> (Gain, ProbeChoice) {
        let table = TissueTable::builtin().unwrap();
        let slab =
            |&(_, from, to): &(&str, f32, f32)| cuboid(Vec3::new(-300.0, -300.0, from), Vec3::new(300.0, 300.0, to));
        let meshes: Vec<Mesh> = parts.iter().map(slab).collect();
        let layer = |(n, part): (usize, &(&str, f32, f32))| {
            (&meshes[n], n as i32, &table.tissues()[table.index_of(part.0).unwrap()])
        };
        let layers: Vec<Layer> = parts.iter().enumerate().map(layer).collect();
        let probe = ProbeChoice::of_depth(Some(kind), 120.0);
        (Gain::of(&layers, &probe, &Pose::IDENTITY), probe)
    }

    #[test]
    fn a_line_through_the_edge_between_two_triangles_crosses_once() {
        let table = TissueTable::builtin().unwrap();
        let cube = cuboid(Vec3::splat(-10.0), Vec3::splat(10.0));
        let layers: [Layer; 1] = [(&cube, 0, &table.tissues()[0])];
        let from_mm = DVec3::new(0.0, 0.0, -30.0);
        // The diagonals of both faces pass through the middle.
        let found = crossings(&layers, &[(from_mm, DVec3::Z)], DVec3::Y, 100.0);
        assert_eq!(found, [[(20.0, 0, true), (40.0, 0, false)]]);
    }

    #[test]
    fn in_one_tissue_tgc_is_its_loss_two_ways() {
        let (found, probe) = gain(&[("liver", -1.0, 200.0)], ProbeKind::Linear);
        let want = 2.0 * 0.55 * probe.frequency_mhz;
        assert!((found.tgc_db_per_cm - want).abs() <= 0.05 && found.gain_db == GAIN_DB, "{found:?}, {want}");
    }

    #[test]
    fn muscle_before_the_liver_adds_gain_and_a_bladder_takes_tgc() {
        let liver = gain(&[("liver", -1.0, 200.0)], ProbeKind::Convex).0;
        let behind = gain(&[("liver", -1.0, 200.0), ("muscle", -1.0, 20.0)], ProbeKind::Convex).0;
        assert!(behind.gain_db >= liver.gain_db + 3.0, "{behind:?}");
        let bladder = gain(&[("liver", -1.0, 200.0), ("urine", 30.0, 90.0)], ProbeKind::Convex).0;
        assert!(bladder.tgc_db_per_cm < 0.7 * liver.tgc_db_per_cm, "{bladder:?}");
    }

    #[test]
    fn sliders_bring_tissue_behind_a_bladder_to_the_level_before_it() {
        let (found, probe) = gain(&[("liver", -1.0, 200.0), ("urine", 30.0, 90.0)], ProbeKind::Convex);
        let cm = |depth_mm: f64| 0.1 * depth_mm;
        // Loss of the liver, two ways; urine has nearly none.
        let loss_db =
            |depth_mm: f64| 2.0 * 0.55 * probe.frequency_mhz * cm(depth_mm - (depth_mm - 30.0).clamp(0.0, 60.0));
        let set_db = |depth_mm: f64| {
            let position = 7.0 * depth_mm / probe.depth_mm;
            let [low, high] =
                [position.floor(), position.floor() + 1.0].map(|at| found.tgc_sliders_db[(at as usize).min(7)]);
            found.gain_db - GAIN_DB + found.tgc_db_per_cm * cm(depth_mm) + low + (high - low) * position.fract()
        };
        for depth_mm in [15.0, 25.0, 100.0, 115.0] {
            let off_db = set_db(depth_mm) - loss_db(depth_mm);
            assert!(off_db.abs() < 4.0, "{depth_mm} mm: {off_db:.1} dB, {found:?}");
        }
        let spread_db = |of: fn(f64, f64) -> f64| found.tgc_sliders_db.into_iter().reduce(of).unwrap();
        assert!(spread_db(f64::max) - spread_db(f64::min) >= 5.0, "{found:?}");
    }

    #[test]
    fn one_tissue_moves_no_slider_and_depths_without_loss_take_the_nearest() {
        assert_eq!(gain(&[("liver", -1.0, 200.0)], ProbeKind::Linear).0.tgc_sliders_db, [0.0; TGC_SLIDERS]);
        assert_eq!(sliders(&[], 10.0), [0.0; TGC_SLIDERS]);
        assert_eq!(sliders(&[(3.0, 2.0), (4.0, -40.0)], 7.0), [2.0, 2.0, 2.0, 2.0, -12.0, -12.0, -12.0, -12.0]);
    }

    #[test]
    fn what_lies_behind_gas_or_beyond_the_body_does_not_count() {
        let liver = gain(&[("liver", -1.0, 200.0)], ProbeKind::Linear).0;
        for gas in [("air", 60.0, 80.0), ("bone_adult", 60.0, 80.0)] {
            assert_eq!(gain(&[("liver", -1.0, 60.0), gas, ("muscle", 80.0, 200.0)], ProbeKind::Linear).0, liver);
        }
        assert_eq!(gain(&[("liver", -1.0, 60.0)], ProbeKind::Linear).0, liver);
        // Nothing is seen behind the ribs: a usual slope.
        let (found, probe) = gain(&[("bone_adult", -1.0, 200.0)], ProbeKind::Linear);
        assert!((found.tgc_db_per_cm - usual_db_per_cm(&probe)).abs() < 0.06, "{found:?}");
    }
}
