//! Sheets of scatterers, which make speckle change gradually across the slice.
//!
//! A family is a stack of parallel sheets, fixed in the scene and `spacing_mm` apart, with scatterers in square cells:
//! see [`SheetCells`]. A sample at X takes the scatterers where its elevational line X + y·ŷ meets the sheets at |y| ≤
//! Y. A sheet at y has the weight (1 − (y/Y)²)², divided by the root of the weights' squared sum.
//!
//! If the probe slides along ŷ, the line meets the sheets at the same points, and only the weights change. So speckle
//! has the autocorrelation of the weights. Y is fitted to theory.
//!
//! Six families lie on the axes of an icosahedron, so that one of them is within 37.4° of any slice. A frame takes the
//! nearest family, and blends two or three that are about equally near.

use glam::{DMat3, DQuat, DVec2, DVec3};
use insonify_core::transducer::Probe;

use super::constants::{DEPTH_BLOCK, SHEET_FAMILIES, SHEETS};
use super::sheet_cells::SheetCells;

/// Rotation of the families against the scene's axes, which makes usual slices cut the sheets obliquely: 1.16 rad about
/// (−1, 1, 1). Each scene axis is then 20.6° from its nearest family, and far from orientations that blend families.
const TURN_RAD: f64 = 1.16;
/// A family is blended in if its squared cosine, between normal and elevational axis, is at most this much below the
/// nearest family's.
const BORDER: f64 = 0.06;
/// Number of depths at which Y is fitted.
const NODES: usize = 16;
/// Number of slides across the slice used for the fit, and the largest in units of λ·F/H (wavelength × focus / height).
const SLIDES: usize = 24;
const SLIDE_MAX: f64 = 1.3;
/// Range of values of Y that are tried, in units of λ·F/H, and number of steps.
const TRIED: [f64; 2] = [0.3, 3.0];
const TRIES: usize = 135;
/// Largest ratio of Y to its mean over the depths, and of the mean to Y.
const DEPARTS_MAX: f64 = 1.25;
/// Number of slice orientations over which the scatterers' power is averaged.
const ORIENTATIONS: u32 = 512;

/// Sheets of scatterers for a probe.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sheets {
    /// Distance between neighbouring sheets of a family, mm.
    pub(crate) spacing_mm: f64,
    /// 1/Y at each block of samples, 1/mm.
    pub(crate) per_reach_mm: Vec<f32>,
    /// Mean of Y over the depths, mm.
    reach_mm: f64,
    cells: SheetCells,
}

/// A family of sheets, weighted for one slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Family {
    pub(crate) number: u32,
    /// Unit normal of the sheets, and the two axes of their cells.
    pub(crate) axes: DMat3,
    /// Amplitude weight of this family; the squares over a slice's families sum to 1.
    pub(crate) share: f64,
}

impl Sheets {
    pub(crate) fn new(probe: &Probe) -> Self {
        let depths_mm: Vec<f64> = (0..NODES).map(|i| probe.depth_mm * i as f64 / (NODES - 1) as f64).collect();
        let nodes_mm = reaches_mm(probe, &depths_mm);
        let mean_mm = nodes_mm.iter().sum::<f64>() / NODES as f64;
        let blocks = probe.sample_count().div_ceil(DEPTH_BLOCK);
        let within = |mm: f64| mm.clamp(mean_mm / DEPARTS_MAX, mean_mm * DEPARTS_MAX);
        let reach_mm = |block: u32| {
            let at = (f64::from(block) + 0.5) / f64::from(blocks) * (NODES - 1) as f64;
            let node = (at as usize).min(NODES - 2);
            let part = at - node as f64;
            within(nodes_mm[node]) * (1.0 - part) + within(nodes_mm[node + 1]) * part
        };
        let reaches_mm: Vec<f64> = (0..blocks).map(reach_mm).collect();
        let widest = reaches_mm.iter().copied().fold(0.0, f64::max);
        Self {
            // At most SHEETS sheets lie within ±Y of a slice parallel to them, even with rounding.
            spacing_mm: 2.001 * widest / f64::from(SHEETS),
            per_reach_mm: reaches_mm.iter().map(|y| (1.0 / y) as f32).collect(),
            reach_mm: mean_mm,
            cells: SheetCells::new(probe),
        }
    }

    /// Correlation of the scatterers at two points of a slice, as a function of the points' distance across and along
    /// scanlines, mm. It is averaged over the slice's orientations.
    pub(crate) fn shared(&self) -> impl Fn([f64; 2]) -> f64 {
        let ways: Vec<[Direction; 2]> = (0..ORIENTATIONS).flat_map(orientation).collect();
        let (sum, reach_mm) = (ways.iter().map(|[way, _]| way.power).sum::<f64>(), self.reach_mm);
        let cells = self.cells;
        move |[across_mm, along_mm]| {
            let of = |[across, along]: &[Direction; 2]| {
                let moved = |of: fn(&Direction) -> f64| across_mm * of(across) + along_mm * of(along);
                let cell = cells.chance_of_same([moved(|way| way.first), moved(|way| way.second)]);
                // A step across scanlines doesn't change which scatterer of a cell is nearest in range.
                let nearest = cells.chance_of_same_nearest(along_mm / along.in_sheet);
                along.power * cell * nearest * weights_correlation(moved(|way| way.elevational) / reach_mm)
            };
            ways.iter().map(of).sum::<f64>() / sum
        }
    }
}

/// Y at each depth, mm: the weights' autocorrelation then comes nearest to that of the lens's speckle.
fn reaches_mm(probe: &Probe, depths_mm: &[f64]) -> Vec<f64> {
    let lens = probe.elevational_lens();
    let scale_mm = lens.scale_mm();
    let slides_mm: Vec<f64> = (1..=SLIDES).map(|i| SLIDE_MAX * scale_mm * i as f64 / SLIDES as f64).collect();
    let fit = |theory: Vec<f64>| {
        let error = |reach_mm: f64| {
            let pairs = slides_mm.iter().zip(&theory);
            pairs.map(|(d, rho)| (weights_correlation(d / reach_mm) - rho).abs()).fold(0.0, f64::max)
        };
        let tried = (0..=TRIES).map(|i| scale_mm * (TRIED[0] + (TRIED[1] - TRIED[0]) * i as f64 / TRIES as f64));
        let best = tried.map(|mm| (error(mm), mm)).min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(scale_mm, |(_, mm)| mm)
    };
    lens.slide_correlation(|part| probe.apodization.weight(part), depths_mm, &slides_mm).into_iter().map(fit).collect()
}

/// Autocorrelation of the weight (1 − x²)² on −1..1 at a lag.
fn weights_correlation(distance: f64) -> f64 {
    let u = (0.5 * distance.abs()).min(1.0);
    (1.0 - u).powi(5) * (1.0 + u * (5.0 + u * (9.0 + u * (5.0 + u))))
}

/// The families that a slice takes, with their weights. `elevational` is the slice's elevational axis in the scene.
pub(crate) fn families(elevational: DVec3) -> impl Iterator<Item = Family> {
    // The axes of an icosahedron: (0, 1, ±φ) and its rotations.
    let long = 0.5 * (1.0 + 5f64.sqrt());
    let turn = DQuat::from_axis_angle(DVec3::new(-1.0, 1.0, 1.0).normalize(), TURN_RAD);
    let upright = [DVec3::new(0.0, 1.0, long), DVec3::new(1.0, long, 0.0), DVec3::new(long, 0.0, 1.0)];
    let mirrored = [DVec3::new(0.0, -1.0, long), DVec3::new(-1.0, long, 0.0), DVec3::new(long, 0.0, -1.0)];
    let normals = [upright[0], mirrored[0], upright[1], mirrored[1], upright[2], mirrored[2]];
    let normals = normals.map(|v| turn * v.normalize());
    let near = normals.map(|normal| normal.dot(elevational).powi(2));
    let nearest = near.into_iter().fold(0.0, f64::max);
    let counts = near.map(|near| ((near - nearest + BORDER) / BORDER).max(0.0));
    // At most three families are near enough to be blended.
    let total = counts.iter().map(|c| c * c).sum::<f64>().sqrt();
    let family = move |(number, normal): (u32, DVec3)| {
        let first = normal.any_orthonormal_vector();
        let axes = DMat3::from_cols(normal, first, normal.cross(first));
        Family { number, axes, share: counts[number as usize] / total }
    };
    (0u32..).zip(normals).map(family).filter(|family| family.share > 0.0).take(SHEET_FAMILIES as usize)
}

/// A direction in a slice, relative to one family: motion of the point where a sample's elevational line meets a sheet,
/// if the sample moves in that direction.
#[derive(Debug, Clone, Copy)]
struct Direction {
    /// Displacement of that point along the two axes of the cells, and along the elevational axis, per mm of the
    /// sample.
    first: f64,
    second: f64,
    elevational: f64,
    /// Length of the direction's projection on the sheet.
    in_sheet: f64,
    /// Weight of the family in power.
    power: f64,
}

/// Directions across and along the scanlines of a slice, for each of its families. Indices spread the slices evenly
/// over all orientations.
fn orientation(index: u32) -> impl Iterator<Item = [Direction; 2]> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let z = 1.0 - (f64::from(index) + 0.5) * 2.0 / f64::from(ORIENTATIONS);
    let turn = DQuat::from_rotation_z(std::f64::consts::TAU * f64::from(index) / golden)
        * DQuat::from_rotation_y(z.acos())
        * DQuat::from_rotation_z(std::f64::consts::TAU * f64::from(index) * std::f64::consts::SQRT_2);
    let elevational = turn * DVec3::Z;
    families(elevational).map(move |Family { axes, share, .. }| {
        [turn * DVec3::Y, turn * DVec3::X].map(|way| {
            let across = -axes.x_axis.dot(way) / axes.x_axis.dot(elevational);
            let moved = way + across * elevational;
            let in_sheet = DVec2::new(axes.y_axis.dot(way), axes.z_axis.dot(way)).length();
            let [first, second] = [axes.y_axis, axes.z_axis].map(|axis| axis.dot(moved));
            Direction { first, second, elevational: across, in_sheet, power: share * share }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_follow_theory() {
        for frequency_mhz in [5.0, 8.0] {
            let probe = Probe { frequency_mhz, ..Probe::default() };
            let sheets = Sheets::new(&probe);
            let slides = [0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5];
            let depths = [30.0, 70.0, 120.0];
            let theory =
                probe.elevational_lens().slide_correlation(|part| probe.apodization.weight(part), &depths, &slides);
            for (depth, theory) in depths.into_iter().zip(theory) {
                let block = (depth / probe.depth_mm * sheets.per_reach_mm.len() as f64) as usize;
                let per_reach_mm = f64::from(sheets.per_reach_mm[block]);
                for (slide, rho) in slides.into_iter().zip(theory) {
                    let off = weights_correlation(slide * per_reach_mm) - rho;
                    println!("{frequency_mhz} MHz, {depth} mm, {slide} mm: {off:+.3}");
                    assert!(off.abs() < 0.045, "{frequency_mhz} MHz, {depth} mm, {slide} mm: {off}");
                }
            }
        }
    }

    #[test]
    fn every_slice_is_near_a_family_and_shares_are_continuous() {
        let mut before: Option<(DVec3, Vec<Family>)> = None;
        let mut several = 0;
        for i in 0..20_000 {
            let angle = f64::from(i) * 1e-3;
            let axis = DVec3::new(angle.cos(), angle.sin() * (0.37 * angle).cos(), angle.sin() * (0.37 * angle).sin());
            let now: Vec<Family> = families(axis).collect();
            several += usize::from(now.len() > 1);
            let power: f64 = now.iter().map(|f| f.share * f.share).sum();
            let nearest = now.iter().map(|f| f.axes.x_axis.dot(axis).abs()).fold(0.0, f64::max);
            assert!((power - 1.0).abs() < 1e-12 && nearest > 0.794, "{axis} {now:?}");
            if let Some((_, before)) = &before {
                for number in 0..6 {
                    let share = |of: &[Family]| of.iter().find(|f| f.number == number).map_or(0.0, |f| f.share);
                    assert!((share(&now) - share(before)).abs() < 0.12, "{axis} {now:?} {before:?}");
                }
            }
            before = Some((axis, now));
        }
        println!("{several} of 20,000 slices take more than one family");
        assert!((1000..4000).contains(&several), "{several}");
        for axis in DVec3::AXES {
            assert_eq!(families(axis).count(), 1);
        }
    }

    #[test]
    fn no_more_sheets_reach_a_sample_than_are_looked_up() {
        for (height_mm, focus_mm) in [(12.0, 70.0), (0.5, 1000.0), (100.0, 1.0), (4.0, 300.0)] {
            let probe = Probe { elevational_height_mm: height_mm, elevational_focus_mm: focus_mm, ..Probe::default() };
            let sheets = Sheets::new(&probe);
            for per_reach_mm in sheets.per_reach_mm {
                let within = 2.0 / (f64::from(per_reach_mm) * sheets.spacing_mm);
                // At least one sheet has a weight, even on the most oblique slice.
                assert!(within <= f64::from(SHEETS) && 0.77 * within > 1.2, "{height_mm} {focus_mm}: {within}");
            }
        }
    }
}
