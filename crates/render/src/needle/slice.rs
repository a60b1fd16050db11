//! The beam across the slice, at positions of the needle: complex two-way field and intensity of the lens.
//!
//! The field of a line across the slice is a sum of line sources over the lens. Fields are divided by the echo of a
//! plate at the same depth, ∫t²dy, so that a plate's echo is 1 at every depth.

use glam::DVec2;
use insonify_core::acoustics::wavelength_mm;
use insonify_core::transducer::Probe;
use rayon::prelude::*;

/// Number of offsets from the image plane.
const OFFSETS: usize = 192;
/// Number of line sources on the lens: bounds, and sources per wavelength between them.
const SOURCES: [f64; 2] = [256.0, 1024.0];
const SOURCES_PER_WAVELENGTH: f64 = 2.0;
/// Number of intervals between the tabulated depths: the field of a lens ripples with the depth.
const INTERVALS: u32 = 128;
/// Smallest tabulated depth, wavelengths. Nearer to the lens the sums are too coarse.
const NEAREST_WAVELENGTHS: f64 = 4.0;

/// The slice at equally spaced depths.
#[derive(Debug, Clone)]
pub(super) struct Slice {
    depth_step_mm: f64,
    depths: Vec<AtDepth>,
    /// Largest offset of the tables, mm.
    reach_mm: f64,
    /// Overlap of the lens with its mirror image, by the distance of the image: see [`Slice::tilt`].
    overlap: Overlap,
}

/// The slice at one depth.
#[derive(Debug, Clone)]
struct AtDepth {
    /// Distance of neighbouring offsets, mm.
    step_mm: f64,
    /// Two-way field at each offset, 1/mm. Its integral over all offsets is 1.
    field: Vec<DVec2>,
    /// Magnitude of the field at each offset, 1/mm.
    level: Vec<f64>,
    /// Share of |field| between the image plane and each offset, on one side: 0 to 0.5. Without harmonics |field| is the
    /// intensity of the transmitted beam.
    share: Vec<f64>,
    /// Standard deviation of the Gaussian that has the −6 dB width of the field, mm.
    sigma_mm: f64,
}

/// ∫w(x)·w'(x − d)dx for two sets of weights of an aperture, relative to d = 0.
#[derive(Debug, Clone)]
pub(super) struct Overlap {
    step_mm: f64,
    levels: Vec<f64>,
}

impl Overlap {
    /// Number of shifts.
    const SHIFTS: usize = 64;
    /// Number of positions of an integral.
    const POSITIONS: u32 = 128;

    /// The overlap of two apertures of different widths, mm.
    pub(super) fn new(probe: &Probe, [one_mm, other_mm]: [f64; 2]) -> Self {
        // The integral is over the narrower aperture.
        let (a_mm, b_mm) = (one_mm.min(other_mm), one_mm.max(other_mm));
        let weight = |x_mm: f64, width_mm: f64| {
            let position = x_mm / width_mm;
            if position.abs() <= 0.5 { probe.apodization.weight(position) } else { 0.0 }
        };
        let step_mm = 0.5 * (a_mm + b_mm) / (Self::SHIFTS - 1) as f64;
        let sum = |shift_mm: f64| {
            let x_mm = |i: u32| ((f64::from(i) + 0.5) / f64::from(Self::POSITIONS) - 0.5) * a_mm;
            (0..Self::POSITIONS).map(|i| weight(x_mm(i), a_mm) * weight(x_mm(i) - shift_mm, b_mm)).sum::<f64>()
        };
        let whole = sum(0.0).max(f64::MIN_POSITIVE);
        Self { step_mm, levels: (0..Self::SHIFTS).map(|i| sum(i as f64 * step_mm) / whole).collect() }
    }

    /// The overlap at a shift, mm.
    pub(super) fn at(&self, shift_mm: f64) -> f64 {
        let place = shift_mm.abs() / self.step_mm;
        if place >= (Self::SHIFTS - 1) as f64 {
            return 0.0;
        }
        let low = place as usize;
        self.levels[low] + (self.levels[low + 1] - self.levels[low]) * place.fract()
    }
}

/// Distance by which a mirror, tilted by an angle with this tangent, shifts an aperture's reflection at a depth, mm:
/// depth · tan 2θ. Infinite from 45° on.
pub(super) fn reflection_shift_mm(depth_mm: f64, tangent: f64) -> f64 {
    let tangent = tangent.abs();
    if tangent >= 1.0 { f64::INFINITY } else { depth_mm * 2.0 * tangent / (1.0 - tangent * tangent) }
}

impl Slice {
    pub(super) fn new(probe: &Probe) -> Self {
        let depth_step_mm = probe.depth_mm / f64::from(INTERVALS);
        let nearest_mm = NEAREST_WAVELENGTHS * wavelength_mm(probe.frequency_mhz);
        let depth = |i: u32| AtDepth::new(probe, (f64::from(i) * depth_step_mm).max(nearest_mm));
        let depths: Vec<AtDepth> = (0..=INTERVALS).into_par_iter().map(depth).collect();
        Self {
            depth_step_mm,
            reach_mm: depths.iter().map(AtDepth::reach_mm).fold(0.0, f64::max),
            depths,
            overlap: Overlap::new(probe, [probe.elevational_height_mm; 2]),
        }
    }

    /// Largest offset of the tables, mm.
    pub(super) fn reach_mm(&self) -> f64 {
        self.reach_mm
    }

    /// The two tabulated depths around `depth_mm`, and the fraction of the way from the first to the second.
    fn around(&self, depth_mm: f64) -> ([&AtDepth; 2], f64) {
        let place = (depth_mm / self.depth_step_mm).clamp(0.0, f64::from(INTERVALS));
        let low = (place as usize).min(INTERVALS as usize - 1);
        ([&self.depths[low], &self.depths[low + 1]], place - low as f64)
    }

    /// Two-way field at a depth as a function of the offset from the image plane, 1/mm; 0 beyond the tables. Between
    /// depths, magnitudes are interpolated, and the phase is that of the nearer depth.
    pub(super) fn fields(&self, depth_mm: f64) -> impl Fn(f64) -> DVec2 {
        let ([above, below], deeper) = self.around(depth_mm);
        let nearer = if deeper < 0.5 { above } else { below };
        move |offset_mm| {
            let [a, b] = [above, below].map(|at| at.level_at(offset_mm));
            nearer.field_at(offset_mm).normalize_or_zero() * (a + (b - a) * deeper)
        }
    }

    /// Magnitude of the [field](Self::fields) at a depth and an offset from the image plane, 1/mm.
    pub(super) fn level(&self, depth_mm: f64, offset_mm: f64) -> f64 {
        let (depths, deeper) = self.around(depth_mm);
        let [a, b] = depths.map(|at| at.level_at(offset_mm));
        a + (b - a) * deeper
    }

    /// Share of |field| between two offsets from the image plane.
    pub(super) fn share(&self, depth_mm: f64, [from_mm, to_mm]: [f64; 2]) -> f64 {
        let (depths, deeper) = self.around(depth_mm);
        let up_to = |offset_mm: f64| {
            let [a, b] = depths.map(|at| at.share_at(offset_mm.abs()));
            (a + (b - a) * deeper).copysign(offset_mm)
        };
        (up_to(to_mm) - up_to(from_mm)).clamp(0.0, 1.0)
    }

    /// Standard deviation of the field across the slice, mm.
    pub(super) fn sigma_mm(&self, depth_mm: f64) -> f64 {
        let (depths, deeper) = self.around(depth_mm);
        depths[0].sigma_mm + (depths[1].sigma_mm - depths[0].sigma_mm) * deeper
    }

    /// Amplitude of a long mirror that is tilted across the slice by an angle with this tangent, relative to none.
    pub(super) fn tilt(&self, depth_mm: f64, tangent: f64) -> f64 {
        self.overlap.at(reflection_shift_mm(depth_mm, tangent))
    }
}

impl AtDepth {
    /// Largest offset, mm.
    fn reach_mm(&self) -> f64 {
        self.step_mm * (OFFSETS - 1) as f64
    }

    /// Tabulated offset before an offset, and the fraction of the way to the next; `None` beyond the table.
    fn around(&self, offset_mm: f64) -> Option<(usize, f64)> {
        let place = offset_mm.abs() / self.step_mm;
        let low = place as usize;
        (low + 1 < OFFSETS).then_some((low, place.fract()))
    }

    /// Field at an offset, 1/mm; 0 beyond the table.
    fn field_at(&self, offset_mm: f64) -> DVec2 {
        self.around(offset_mm).map_or(DVec2::ZERO, |(low, part)| self.field[low].lerp(self.field[low + 1], part))
    }

    /// Magnitude of the field at an offset, 1/mm; 0 beyond the table.
    fn level_at(&self, offset_mm: f64) -> f64 {
        let between = |(low, part): (usize, f64)| self.level[low] + (self.level[low + 1] - self.level[low]) * part;
        self.around(offset_mm).map_or(0.0, between)
    }

    /// Share between the image plane and a positive offset, mm.
    fn share_at(&self, offset_mm: f64) -> f64 {
        let place = (offset_mm / self.step_mm).min((OFFSETS - 1) as f64 - 1e-9);
        let low = place as usize;
        self.share[low] + (self.share[low + 1] - self.share[low]) * place.fract()
    }

    fn new(probe: &Probe, depth_mm: f64) -> Self {
        let (height_mm, focus_mm) = (probe.elevational_height_mm, probe.elevational_focus_mm);
        let spread = (depth_mm / focus_mm - 1.0).abs().max(1.0);
        let lobes_mm = 2.0 * depth_mm * wavelength_mm(probe.frequency_mhz) / height_mm;
        let step_mm = (0.5 * height_mm * spread + lobes_mm) / (OFFSETS - 1) as f64;
        let out = one_way(probe, probe.frequency_mhz, depth_mm, step_mm);
        let two_way: Vec<DVec2> = if probe.harmonics {
            // The second harmonic is proportional to the square of the transmitted field.
            let back = one_way(probe, 2.0 * probe.frequency_mhz, depth_mm, step_mm);
            out.iter().zip(&back).map(|(out, &back)| out.rotate(*out).rotate(back)).collect()
        } else {
            out.iter().map(|field| field.rotate(*field)).collect()
        };
        // Both sides of the image plane, by the trapezoidal rule.
        let plate = (2.0 * two_way.iter().sum::<DVec2>() - two_way[0]) * step_mm;
        let power = |field: &DVec2| field.length();
        let total: f64 = (2.0 * two_way.iter().map(power).sum::<f64>() - power(&two_way[0])).max(f64::MIN_POSITIVE);
        let mut sum = 0.0;
        let share = two_way.iter().enumerate().map(|(i, field)| {
            let before = i.checked_sub(1).map_or(0.0, |before| power(&two_way[before]));
            sum += if i == 0 { 0.0 } else { 0.5 * (before + power(field)) };
            sum / total
        });
        let share = share.collect();
        let greatest = two_way.iter().map(power).fold(0.0, f64::max);
        let last = two_way.iter().rposition(|field| power(field) >= 0.5 * greatest).unwrap_or(0);
        let scale = 1.0 / plate.length().max(f64::MIN_POSITIVE);
        Self {
            step_mm,
            field: two_way.iter().map(|&field| scale * field).collect(),
            level: two_way.iter().map(|field| scale * power(field)).collect(),
            share,
            sigma_mm: (last as f64 + 0.5) * step_mm / (2.0 * std::f64::consts::LN_2).sqrt(),
        }
    }
}

/// One-way field at each offset from the image plane: sum of line sources over the lens.
fn one_way(probe: &Probe, frequency_mhz: f64, depth_mm: f64, step_mm: f64) -> Vec<DVec2> {
    let wave_number = std::f64::consts::TAU / wavelength_mm(frequency_mhz);
    let focus_mm = probe.elevational_focus_mm;
    let per_lens = SOURCES_PER_WAVELENGTH * probe.elevational_height_mm / wavelength_mm(frequency_mhz);
    let count = per_lens.clamp(SOURCES[0], SOURCES[1]) as u32;
    let sources: Vec<(f64, f64, f64)> = (0..count)
        .map(|i| {
            let position = (f64::from(i) + 0.5) / f64::from(count) - 0.5;
            let y_mm = position * probe.elevational_height_mm;
            // Focusing delay √(y² + F²) − F, without cancellation.
            let early_mm = y_mm * y_mm / (y_mm.hypot(focus_mm) + focus_mm);
            (y_mm, probe.apodization.weight(position), early_mm)
        })
        .collect();
    let at = |offset_mm: f64| {
        let source = |&(y_mm, weight, early_mm): &(f64, f64, f64)| {
            let across_mm = y_mm - offset_mm;
            let late_mm = across_mm * across_mm / (across_mm.hypot(depth_mm) + depth_mm);
            weight * DVec2::from_angle(wave_number * (late_mm - early_mm))
        };
        sources.iter().map(source).sum()
    };
    (0..OFFSETS).map(|i| at(i as f64 * step_mm)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_has_an_echo_of_one_at_every_depth() {
        let slice = Slice::new(&Probe { frequency_mhz: 8.0, ..Probe::default() });
        for depth_mm in [20.0, 40.0, 70.0, 120.0] {
            let steps = 4000;
            let y_mm = |i: i32| (f64::from(i) / f64::from(steps) - 0.5) * 2.0 * slice.reach_mm();
            let plate: DVec2 = (0..=steps).map(|i| slice.fields(depth_mm)(y_mm(i))).sum();
            let echo = plate.length() * 2.0 * slice.reach_mm() / f64::from(steps);
            assert!((echo - 1.0).abs() < 0.05, "{echo} at {depth_mm} mm");
            assert!((slice.share(depth_mm, [-1e3, 1e3]) - 1.0).abs() < 1e-3);
        }
    }

    #[test]
    fn fields_have_the_tabulated_magnitudes() {
        let slice = Slice::new(&Probe { frequency_mhz: 8.0, ..Probe::default() });
        for i in 0..200 {
            let (depth_mm, offset_mm) = (5.0 + 0.61 * f64::from(i), 0.031 * f64::from(i % 97));
            let (field, level) = (slice.fields(depth_mm)(offset_mm).length(), slice.level(depth_mm, offset_mm));
            assert!((field - level).abs() < 1e-12 * slice.level(depth_mm, 0.0).max(level), "{field} {level}");
        }
    }

    #[test]
    fn tilts_are_those_of_the_reference() {
        let probe = Probe { frequency_mhz: 8.0, ..Probe::default() };
        let overlap = Overlap::new(&probe, [20.0, 20.0]);
        for (deg, want_db) in [(4.0, -2.5), (6.0, -5.7), (8.0, -10.6)] {
            let shift_mm = reflection_shift_mm(40.0, f64::to_radians(deg).tan());
            let got_db = 20.0 * overlap.at(shift_mm).log10();
            assert!((got_db - want_db).abs() < 1.0, "{got_db} dB at {deg} degrees, not {want_db}");
        }
    }
}
