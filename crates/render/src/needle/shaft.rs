//! Echoes of the shaft on one scanline.
//!
//! The shaft is a line of scatterers on the generator that faces the probe. Its mirror echo is the integral of the beam
//! along the line, times what a tilted mirror returns. Its diffuse echo comes from points at fixed places of the shaft.

use glam::DVec3;
use insonify_core::acoustics::ASSUMED_SPEED_M_S;
use insonify_core::random;
use insonify_core::transducer::Probe;

use super::scanline::{Line, Scanline, clipped};
use super::{NEEDLE_ECHOES_MAX, NeedleEcho, NeedleTables, Placed};

/// Echoes of a scanline that are not points of the diffuse echo: mirror, lumen, round trips and bevel, rounded up.
const OTHER_ECHOES: usize = 16;
/// Standard deviations of the beam to either side that the mirror's integral covers.
const COVERED: f64 = 3.2;
/// Distance of the integral's positions across the slice and along the face, mm.
const STEP_MM: f64 = 0.15;
/// Longest piece of the shaft that counts as one mirror, standard deviation in mm.
const PIECE_MM: f64 = 25.0;
/// Number of echoes from within the lumen.
const LUMEN_ECHOES: i32 = 6;
/// Amplitude of each echo from within the lumen over the one before: −3 dB (assumed).
const LUMEN_RATIO: f64 = 0.708;
/// Speed of sound in the fluid of the lumen, m/s.
const LUMEN_SPEED_M_S: f64 = 1480.0;
/// Most round trips between the face and the shaft.
const ROUND_TRIPS: i32 = 3;
/// Amplitude that the face returns of an echo: −10 dB (assumed).
const FACE_REFLECTION: f64 = 0.316;
/// Smallest amplitude of an echo that is added: −120 dB.
const LEAST: f64 = 1e-6;

/// The line of the shaft that faces the probe, and the range of its positions.
struct Generator {
    line: Line,
    ends_mm: [f64; 2],
}

impl NeedleTables {
    /// Adds the echoes of the shaft.
    pub(super) fn add_shaft(&self, placed: &Placed, scanline: &Scanline, probe: &Probe, into: &mut Vec<NeedleEcho>) {
        let Some(generator) = self.generator(placed, scanline, probe.depth_mm) else { return };
        self.add_mirror(&generator, into);
        // All scanlines share the room for echoes.
        let room = (NEEDLE_ECHOES_MAX / probe.scanlines.max(1) as usize).saturating_sub(OTHER_ECHOES);
        self.add_diffuse(&generator, room.max(1) as u64, into);
    }

    /// The line of the shaft that faces the probe; `None` if it lies outside the image or the slice.
    fn generator(&self, placed: &Placed, scanline: &Scanline, depth_mm: f64) -> Option<Generator> {
        let direction = -scanline.vector(placed.direction);
        // Unit vector from the axis towards the probe, perpendicular to the axis.
        let normal = (direction * direction.z - DVec3::Z).normalize_or_zero();
        let radius_mm = self.settings.radius_mm();
        let line = Line { start_mm: scanline.point_mm(placed.axis_mm) + radius_mm * normal, direction };
        // The facet cuts the shaft obliquely: the generator ends where it meets the facet.
        let cut_mm = placed.bevel.map_or(0.0, |bevel| {
            let beside_mm = radius_mm * (1.0 + normal.dot(scanline.vector(bevel)));
            beside_mm / self.settings.bevel_deg.to_radians().tan()
        });
        // Positions within the image's depth and within the slice. A long facet may cut all of a short shaft.
        let reach_mm = self.slice.reach_mm();
        let in_depth = clipped([cut_mm, self.settings.length_mm], line.start_mm.z, direction.z, [1e-3, depth_mm])?;
        let ends_mm = clipped(in_depth, line.start_mm.y, direction.y, [-reach_mm, reach_mm])?;
        (ends_mm[0] < ends_mm[1]).then_some(Generator { line, ends_mm })
    }

    /// Adds the mirror echo and its reverberation.
    fn add_mirror(&self, Generator { line, ends_mm }: &Generator, into: &mut Vec<NeedleEcho>) {
        let (start, direction) = (line.start_mm, line.direction);
        let crossing = if direction.x.abs() > 1e-9 { -start.x / direction.x } else { ends_mm[0] };
        let guess_mm = line.at(crossing.clamp(ends_mm[0], ends_mm[1])).z;
        let [sigma_x, sigma_y] = self.sigmas_mm(guess_mm);
        let [along, across] = [(direction.x / sigma_x).powi(2), (direction.y / sigma_y).powi(2)];
        let narrow = along + across;
        if narrow < 1e-9 {
            return;
        }
        // Position at which the line passes nearest to the beam's axis, and standard deviation of the lit piece.
        let nearest = -(start.x * direction.x / (sigma_x * sigma_x) + start.y * direction.y / (sigma_y * sigma_y));
        let nearest = (nearest / narrow).clamp(ends_mm[0], ends_mm[1]);
        let sigma_s = 1.0 / (narrow + PIECE_MM.powi(-2)).sqrt();
        let at = line.at(nearest);
        if at.x.abs() > self.beam.reach_mm(at.z) || at.y.abs() > self.slice.reach_mm() {
            return;
        }
        let tangent = |sigma: f64| direction.z * sigma_s / sigma;
        let share = along / narrow;
        let tilt = self.beam.tilt(at.z, tangent(sigma_x)).powf(share)
            * self.slice.tilt(at.z, tangent(sigma_y)).powf(1.0 - share);
        // The mirror of an oblique shaft returns nothing to the face.
        if tilt == 0.0 {
            return;
        }
        let lit = [nearest - COVERED * sigma_s, nearest + COVERED * sigma_s];
        let coverage = self.coverage(line, [lit[0].max(ends_mm[0]), lit[1].min(ends_mm[1])], at.z);
        let (depth_mm, mirror) = (at.z as f32, self.strength_mm * coverage);
        let mut add = |extra_mm: f64, amplitude: f64| {
            if amplitude > LEAST {
                into.push(NeedleEcho { depth_mm, extra_mm: extra_mm as f32, amplitude: amplitude as f32, turns: 0.0 });
            }
        };
        let once = mirror * tilt;
        add(0.0, once);
        let lumen_mm = self.settings.bore_mm() * ASSUMED_SPEED_M_S / LUMEN_SPEED_M_S;
        (1..=LUMEN_ECHOES).for_each(|n| add(f64::from(n) * lumen_mm, once * LUMEN_RATIO.powi(n)));
        // The direction turns by twice the tilt at each round trip, so a Gaussian's exponent grows with its square.
        for trips in 2..=ROUND_TRIPS {
            let returned = mirror.powi(trips) * FACE_REFLECTION.powi(trips - 1) * tilt.powi(trips * trips);
            add(f64::from(-trips), returned);
        }
    }

    /// Integral of the two-way beam along a piece of a line, 1/mm.
    fn coverage(&self, line: &Line, [from, to]: [f64; 2], depth_mm: f64) -> f64 {
        if from >= to {
            return 0.0;
        }
        let across_mm = (to - from) * line.direction.truncate().length();
        let steps = (across_mm / STEP_MM).ceil().clamp(12.0, 160.0);
        let step = (to - from) / steps;
        let (amplitude, field) = (self.beam.amplitudes(depth_mm), self.slice.fields(depth_mm));
        let at = |i: u32| {
            let point = line.at(from + (f64::from(i) + 0.5) * step);
            amplitude(point.x) * field(point.y)
        };
        (0..steps as u32).map(at).sum::<glam::DVec2>().length() * step
    }

    /// Adds the diffuse echo: points at fixed places of the shaft, each with a phase of its own. If there is no room for
    /// all of them, every second, fourth or eighth point stands for the others.
    fn add_diffuse(&self, Generator { line, ends_mm }: &Generator, room: u64, into: &mut Vec<NeedleEcho>) {
        let widest_mm = ends_mm.map(|end| self.beam.reach_mm(line.at(end).z)).into_iter().fold(0.0, f64::max);
        let Some([from, to]) = clipped(*ends_mm, line.start_mm.x, line.direction.x, [-widest_mm, widest_mm]) else {
            return;
        };
        let number_of = |position_mm: f64| (position_mm / self.points_mm - 0.5).ceil().max(0.0) as u64;
        let (first, end) = (number_of(from), number_of(to));
        let stride = end.saturating_sub(first).div_ceil(room).next_power_of_two();
        let spacing_mm = self.points_mm * stride as f64;
        for number in (first.next_multiple_of(stride)..end).step_by(stride as usize) {
            let point = line.at((number as f64 + 0.5) * self.points_mm);
            if point.x.abs() > self.beam.reach_mm(point.z) {
                continue;
            }
            let seen = self.beam.normalised_amplitude(point.z, point.x) * self.slice.level(point.z, point.y);
            let amplitude = self.diffuse * self.strength_mm * seen * spacing_mm.sqrt();
            if amplitude > LEAST {
                into.push(NeedleEcho {
                    depth_mm: point.z as f32,
                    extra_mm: 0.0,
                    amplitude: amplitude as f32,
                    turns: random::fraction(random::bits(number)) as f32,
                });
            }
        }
    }
}
