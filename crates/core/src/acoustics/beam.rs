//! Beams of focused apertures by diffraction sums: a fixed transmit focus with a dynamic receive focus, and a fixed
//! lens.
//!
//! Transmission and reception are each a Huygens sum over the elements of the aperture. The two-way power is summed
//! over the frequency band of the echo. By Parseval's theorem, that sum is the energy of a point's echo. The band is a
//! Gaussian about the centre frequency.

use super::pulse::FWHM_PER_SIGMA;
use super::wavelength_mm;
use crate::settings::Apodization;

/// Smallest F-number of the receive aperture: elements are insensitive at steeper angles.
pub const RECEIVE_F_NUMBER_MIN: f64 = 2.0;
/// Number of offsets from the axis in a [`Profile`].
pub const OFFSETS: usize = 160;
/// Extent of a dynamically focused beam's [`Profile`] from the axis, in units of λ·F# of reception. Side lobes farther
/// out are below −30 dB.
const LOBES: f64 = 6.0;
/// Number of frequencies at which the band of the echo is sampled.
const FREQUENCIES: u32 = 9;
/// Largest number of elements in one half of an aperture; scanners have about as many.
const ELEMENTS_MAX: f64 = 128.0;
/// Number of a profile's offsets that are computed at a time.
const LANES: usize = 8;

/// Focus of reception.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reception {
    /// Focus at every depth; the aperture grows with the depth up to its full width.
    Dynamic,
    /// Focus at the transmit focus, for all depths.
    Fixed,
}

/// An apodized aperture and its focus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Two-way −6 dB bandwidth over the centre frequency.
    pub fractional_bandwidth: f64,
    /// Weights across the aperture.
    pub apodization: Apodization,
    /// Width of the aperture, mm.
    pub aperture_mm: f64,
    /// Focal depth of transmission, mm.
    pub focus_mm: f64,
    /// Focus of reception.
    pub reception: Reception,
    /// Whether reception is at twice the frequency, from the square of the transmitted field: tissue harmonics.
    pub harmonic: bool,
}

/// Two-way amplitude of the beam at one depth, as a function of the offset from its axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Distance between neighbouring offsets, mm.
    pub step_mm: f64,
    /// Amplitude at the offset i·`step_mm` from the axis; the maximum is 1.
    pub levels: [f64; OFFSETS],
}

/// Pair of elements at equal distances from the axis.
struct Pair {
    amplitude: f64,
    /// Path from an element to a point on the axis, minus the path from the aperture's centre to that point, minus the
    /// focusing delay, mm.
    late_mm: f64,
    /// Sine of the angle between the axis and the line from an element to the point.
    sine: f64,
}

impl Beam {
    /// Two-way amplitude across the beam at `depth_mm`.
    pub fn profile(&self, depth_mm: f64) -> Profile {
        let wavelength = wavelength_mm(self.frequency_mhz);
        let depth_mm = depth_mm.max(self.least_depth_mm());
        let step_mm = self.reach_mm(depth_mm) / OFFSETS as f64;
        let transmit = self.pairs(self.aperture_mm, self.focus_mm, depth_mm);
        let receive = match self.reception {
            Reception::Dynamic => {
                Some(self.pairs(self.aperture_mm.min(depth_mm / RECEIVE_F_NUMBER_MIN), depth_mm, depth_mm))
            }
            Reception::Fixed => None,
        };
        let mut power = [0.0; OFFSETS];
        for i in 0..FREQUENCIES {
            let aside = self.fractional_bandwidth * (f64::from(i) / f64::from(FREQUENCIES - 1) - 0.5);
            let weight = (-0.5 * (aside * FWHM_PER_SIGMA / self.fractional_bandwidth).powi(2)).exp();
            let wave_number = std::f64::consts::TAU * (1.0 + aside) / wavelength;
            let out = intensity(&transmit, wave_number, step_mm);
            let returning = if self.harmonic { 2.0 * wave_number } else { wave_number };
            let back = match &receive {
                None if !self.harmonic => out,
                receive => intensity(receive.as_ref().unwrap_or(&transmit), returning, step_mm),
            };
            for (power, (out, back)) in power.iter_mut().zip(out.iter().zip(&back)) {
                // The second harmonic is proportional to the square of the transmitted pressure.
                let sent = if self.harmonic { out * out } else { *out };
                *power += weight * sent * back;
            }
        }
        let most = power.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        Profile { step_mm, levels: power.map(|power| (power / most).sqrt()) }
    }

    /// −6 dB two-way width at `depth_mm`, mm.
    pub fn width_mm(&self, depth_mm: f64) -> f64 {
        let profile = self.profile(depth_mm);
        2.0 * profile.steps_above(0.5) * profile.step_mm
    }

    /// Offset from the axis at which a profile at `depth_mm` ends, mm.
    pub fn reach_mm(&self, depth_mm: f64) -> f64 {
        let wavelength = wavelength_mm(self.frequency_mhz);
        let f_number = depth_mm / self.aperture_mm;
        match self.reception {
            Reception::Dynamic => LOBES * wavelength * f_number.max(RECEIVE_F_NUMBER_MIN),
            Reception::Fixed => {
                let geometric = 0.5 * self.aperture_mm * (depth_mm / self.focus_mm - 1.0).abs();
                let longest = wavelength / (1.0 - 0.5 * self.fractional_bandwidth);
                geometric + (longest * depth_mm).sqrt() + 1.5 * longest * f_number
            }
        }
    }

    /// Smallest depth at which the sums are valid, mm: a wavelength. For a fixed receive focus, it is also deep enough
    /// that [`ELEMENTS_MAX`] elements sample the aperture densely.
    fn least_depth_mm(&self) -> f64 {
        let wavelength = wavelength_mm(self.frequency_mhz);
        match self.reception {
            Reception::Dynamic => wavelength,
            Reception::Fixed => wavelength.max(0.5 * self.aperture_mm.powi(2) / (ELEMENTS_MAX * self.shortest_mm())),
        }
    }

    /// Shortest wavelength of the band, mm.
    fn shortest_mm(&self) -> f64 {
        wavelength_mm(self.frequency_mhz) / (1.0 + 0.5 * self.fractional_bandwidth)
    }

    /// Element pairs of an aperture `width_mm` wide, focused at `focus_mm`, for points at `depth_mm`.
    ///
    /// For dynamic reception, distances are exact on the axis and linear in the offset from it, as the beam is narrow.
    /// For a lens, distances are parabolic. Away from the focus, the beam is as wide as the lens, but the parabola is
    /// accurate enough for the elements that matter there.
    fn pairs(&self, width_mm: f64, focus_mm: f64, depth_mm: f64) -> Vec<Pair> {
        let exact = self.reception == Reception::Dynamic;
        let away_mm = |position_mm: f64, focus_mm: f64| {
            if exact { position_mm.hypot(focus_mm) - focus_mm } else { 0.5 * position_mm * position_mm / focus_mm }
        };
        let late_mm = |position_mm| away_mm(position_mm, depth_mm) - away_mm(position_mm, focus_mm);
        // Largest phase difference between the middle and the end of the aperture, in turns. It sets the number of
        // elements.
        let end_mm = 0.5 * width_mm;
        let turns = (late_mm(end_mm).abs() + end_mm * self.reach_mm(depth_mm) / depth_mm) / self.shortest_mm();
        let count = (12.0 + 2.5 * turns).min(ELEMENTS_MAX).ceil() as u32;
        let pair = |i| {
            let position = 0.5 * (f64::from(i) + 0.5) / f64::from(count);
            let position_mm = position * width_mm;
            let distance_mm = if exact { position_mm.hypot(depth_mm) } else { depth_mm };
            Pair {
                amplitude: self.apodization.weight(position) / distance_mm.sqrt(),
                late_mm: late_mm(position_mm),
                sine: position_mm / distance_mm,
            }
        };
        (0..count).map(pair).collect()
    }
}

/// Squared magnitude of the one-way field at every offset of a profile.
///
/// At an offset x from the axis, one element of a pair is x·sine nearer and the other x·sine farther. The remaining
/// change in distance is nearly equal for all elements, so it is left out.
fn intensity(pairs: &[Pair], wave_number: f64, step_mm: f64) -> [f64; OFFSETS] {
    let (mut re, mut im) = ([0.0; OFFSETS], [0.0; OFFSETS]);
    for pair in pairs {
        let (sin, cos) = (wave_number * pair.late_mm).sin_cos();
        let amplitude = [pair.amplitude * cos, pair.amplitude * sin];
        // Cosines of multiples of an angle by Chebyshev's recurrence: the first ones singly, then `LANES` at a time.
        let mut cosines = [1.0; LANES + 1];
        cosines[1] = (wave_number * pair.sine * step_mm).cos();
        for i in 2..=LANES {
            cosines[i] = 2.0 * cosines[1] * cosines[i - 1] - cosines[i - 2];
        }
        let twice = 2.0 * cosines[LANES];
        let mut now: [f64; LANES] = std::array::from_fn(|i| cosines[i]);
        let mut before: [f64; LANES] = std::array::from_fn(|i| cosines[LANES - i]);
        for (re, im) in re.as_chunks_mut::<LANES>().0.iter_mut().zip(im.as_chunks_mut::<LANES>().0) {
            for i in 0..LANES {
                re[i] += amplitude[0] * now[i];
                im[i] += amplitude[1] * now[i];
                (before[i], now[i]) = (now[i], twice * now[i] - before[i]);
            }
        }
    }
    std::array::from_fn(|i| re[i] * re[i] + im[i] * im[i])
}

impl Profile {
    /// Offset beyond which the amplitude stays below `level`, in steps, interpolated; the last offset if the amplitude
    /// is still at or above `level` there.
    pub fn steps_above(&self, level: f64) -> f64 {
        let last = self.levels.iter().rposition(|&l| l >= level).unwrap_or(0);
        let Some(next) = self.levels.get(last + 1) else { return last as f64 };
        last as f64 + (self.levels[last] - level) / (self.levels[last] - next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lateral(apodization: Apodization, focus_mm: f64) -> Beam {
        Beam {
            frequency_mhz: 8.0,
            fractional_bandwidth: 0.6,
            apodization,
            aperture_mm: 20.0,
            focus_mm,
            reception: Reception::Dynamic,
            harmonic: false,
        }
    }

    #[test]
    fn widths_are_those_of_the_reference() {
        let rows =
            include_str!("../../../../tests/truth/point_spread.csv").lines().filter(|line| !line.starts_with('#'));
        for row in rows.skip(1) {
            let (name, numbers) = row.split_once(',').unwrap();
            let numbers: Vec<f64> = numbers.split(',').map(|number| number.parse().unwrap()).collect();
            let &[frequency_mhz, aperture_mm, focus_mm, depth, _, want, ..] = &numbers[..] else { panic!("{row}") };
            let beam = lateral(Apodization::named(name).unwrap(), focus_mm);
            let got = Beam { frequency_mhz, aperture_mm, ..beam }.width_mm(depth);
            assert!((got / want - 1.0).abs() < 0.01, "{row}: {got}");
        }
    }

    #[test]
    fn a_narrow_band_has_the_textbook_width_at_the_focus() {
        // sinc² falls to a half at ±0.443 λ·F#.
        let beam = Beam { fractional_bandwidth: 0.05, ..lateral(Apodization::Rectangular, 70.0) };
        let want = 0.886 * wavelength_mm(8.0) * 3.5;
        assert!((beam.width_mm(70.0) / want - 1.0).abs() < 0.01, "{}", beam.width_mm(70.0));
    }

    #[test]
    fn harmonics_narrow_the_beam_at_its_focus() {
        // sinc²(x) of transmission, squared, times sinc(2x) of reception, falls to a half at ±0.280 λ·F#.
        let beam = Beam { fractional_bandwidth: 0.05, harmonic: true, ..lateral(Apodization::Rectangular, 70.0) };
        let amplitude = |x: f64| {
            let sinc =
                |x: f64| if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
            sinc(x).powi(2) * sinc(2.0 * x).abs()
        };
        let half = (0..10_000).map(|i| f64::from(i) * 1e-4).find(|&x| amplitude(x) < 0.5).unwrap();
        let want = 2.0 * half * wavelength_mm(8.0) * 3.5;
        assert!((beam.width_mm(70.0) / want - 1.0).abs() < 0.02, "{} {want}", beam.width_mm(70.0));
    }

    #[test]
    fn apodization_lowers_side_lobes() {
        let beyond = |apodization| {
            let profile = lateral(apodization, 70.0).profile(70.0);
            profile.levels[(1.6 * profile.steps_above(0.5) * 2.0) as usize]
        };
        let [rectangular, hann, gaussian] = Apodization::ALL.map(beyond);
        assert!((0.02..0.06).contains(&rectangular), "{rectangular}");
        assert!(gaussian < 0.01 && hann < 0.01, "{gaussian} {hann}");
    }

    #[test]
    fn beams_of_any_size_are_finite_and_wide() {
        for aperture_mm in [0.5, 20.0, 200.0] {
            for (focus_mm, fractional_bandwidth) in [(1.0, 1.5), (70.0, 0.6), (1000.0, 0.05)] {
                for reception in [Reception::Dynamic, Reception::Fixed] {
                    let beam = lateral(Apodization::Hann, focus_mm);
                    let beam = Beam { aperture_mm, fractional_bandwidth, reception, ..beam };
                    for depth in [0.0, 1.0, 70.0, 500.0] {
                        let width = beam.width_mm(depth);
                        assert!(width.is_finite() && width > 0.0, "{beam:?} at {depth} mm: {width}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_lens_is_widest_away_from_its_focus() {
        let lens = Beam { aperture_mm: 12.0, reception: Reception::Fixed, ..lateral(Apodization::Gaussian, 60.0) };
        for depth in [1.0, 20.0, 140.0] {
            assert!(lens.width_mm(depth) > 1.2 * lens.width_mm(60.0), "{depth} mm");
        }
    }
}
