//! Paths through the scene: refraction, reflection, attenuation and the echoes of interfaces.

use glam::DVec3;
use insonify_core::acoustics::interface::{Interface, interface};
use rayon::prelude::*;

use super::inputs::{Inputs, Ray};
use super::locate::Launched;
use super::medium::Medium;
use super::segment::{Path, Segment};
use super::surfaces::{Crossing, Membership, coincident, crossings};
use super::{hash, lattice};
use crate::constants::{
    APERTURE_HALF_ANGLE, APERTURE_HALF_ANGLE_MAX, APERTURE_HALF_ANGLE_MIN, CELLS_OF_A_BEAM, DIFFUSE,
    DIFFUSE_HALF_ROUGHNESS2, FACET_COS_MIN, LN_GIVEN_UP, LN_SILENT, LN_UNCOUPLED, OFF_THE_GRID_MM, PLACES_MAX,
    REFLECTION_FOLLOWED, SEGMENTS, SURFACE_SALT, TOUCH_MM,
};

/// Follows every path through the scene, from its start in `launches` `[paths]`.
///
/// At a change of medium, the interface returns an echo. The path then reflects with probability R, else it is
/// refracted (Russian roulette). Range stands for time: mm of path over the medium's c/c₀.
pub fn trace(inputs: &Inputs, launches: &[Launched]) -> Vec<Path> {
    (0..inputs.paths()).into_par_iter().map(|path| Tracer::new(inputs, path, launches[path]).run()).collect()
}

/// State of a path while it is traced.
struct Tracer<'a> {
    inputs: &'a Inputs,
    line_ray: usize,
    layer: usize,
    /// Length of the path per mm of depth.
    stretch: f64,
    /// Whether this is an axial path: it sets where the scatterers of its scanline lie, and its echoes replace those
    /// that reflected paths miss.
    is_axial: bool,
    /// Whether it follows reflections. If only some paths of a scanline do, each of these stands for several.
    follows_reflections: bool,
    inside: Membership,
    /// Whether the path goes on beyond the film of gel: its start is coupled, or the aperture's other parts may reach
    /// the tissue below.
    goes_on: bool,
    ray: Ray,
    range_mm: f64,
    /// Range that this path saved in fast hard bodies, mm. The aperture's sound goes around such bodies and saves none.
    behind_mm: f64,
    ln_amplitude: f64,
    /// ln of an amplitude factor of the scatterers alone. Their powers add over the paths, so the random choice of
    /// reflection makes half of an interface's loss in nepers; this is the other half.
    ln_scatter: f64,
    /// ln of the two-way amplitude of a wave that passes every interface.
    ln_passed: f64,
    has_reflected: bool,
    bounce: u32,
    /// Displacement of the medium from its rest position, mm: speckle moves with its tissue.
    carried_mm: DVec3,
}

/// Interface at which a path changes its medium.
struct MediumChange<'a> {
    /// Surfaces that the path was inside before the interface.
    before: Membership,
    crossing: Crossing<'a>,
    /// Index of the tissue beyond.
    there: usize,
}

impl<'a> Tracer<'a> {
    fn new(inputs: &'a Inputs, path: usize, Launched { inside, coupling }: Launched) -> Self {
        let ln_coupling = 2.0 * coupling.ln().max(LN_UNCOUPLED);
        Self {
            inputs,
            line_ray: path % inputs.rays.len(),
            layer: if path >= inputs.sounding() { 0 } else { path / inputs.rays.len() },
            stretch: inputs.elevation_of(path).stretch,
            is_axial: path >= inputs.sounding(),
            follows_reflections: inputs.follows_reflections(path),
            inside,
            goes_on: coupling > 0.0 || inputs.aperture.is_some(),
            ray: inputs.launch(path),
            range_mm: 0.0,
            behind_mm: 0.0,
            ln_amplitude: ln_coupling,
            ln_scatter: 0.0,
            ln_passed: ln_coupling,
            has_reflected: false,
            bounce: 0,
            carried_mm: DVec3::ZERO,
        }
    }

    fn run(mut self) -> Path {
        let media = &self.inputs.media;
        let mut path = Path::default();
        let mut here = self.inside.medium(self.inputs, self.ray.origin_mm);
        let (mut echo, mut echo_range_mm) = (0.0, 0.0);
        let (mut crossed, mut reflections) = (0, 0);
        let mut open = self.goes_on;
        loop {
            // A segment beyond the capacity replaces the last one, whose range then counts as the medium before it.
            path.segments.truncate(SEGMENTS as usize - 1);
            path.segments.push(self.segment(&media[here], echo, echo_range_mm));
            if !open {
                return path;
            }
            let Some(change) = self.next_change(here, &mut crossed) else { return path };
            let (tissue, beyond) = (&media[here], &media[change.there]);
            let boundary = boundary(tissue, beyond);
            let triangle = change.crossing.triangle;
            let outward = triangle.edge1_mm.cross(triangle.edge2_mm).normalize();
            let normal = if outward.dot(self.ray.direction) > 0.0 { -outward } else { outward };
            let facet = self.facet(normal, boundary.roughness);

            // Echoes depend on the facet; paths follow the mean surface.
            let cos_facet = (-facet.dot(self.ray.direction)).clamp(0.0, 1.0);
            let at_facet = between(tissue, beyond, cos_facet);
            (echo, echo_range_mm) = self.echo(&at_facet, cos_facet, tissue, &boundary, triangle.surface);

            let cos_incident = (-normal.dot(self.ray.direction)).clamp(0.0, 1.0);
            let split = between(tissue, beyond, cos_incident);
            let accepted = self.acceptance(boundary.roughness * boundary.roughness);
            // If the reflection is not followed, the path continues with the transmitted energy: a rough surface
            // scatters and never forms a mirror image.
            let may_reflect = self.inputs.reflections;
            let follow =
                may_reflect && self.follows_reflections && split.energy_reflection * accepted >= REFLECTION_FOLLOWED;
            // An axial path takes the likelier way, so scatterer positions don't depend on chance.
            let chance = if self.is_axial { 0.5 } else { self.random(0) };
            let total = may_reflect && split.energy_reflection >= 1.0;
            // With the aperture, an axial path passes every interface, since the aperture reaches the scatterers behind
            // it.
            let passes = self.inputs.aperture.is_some() && self.is_axial;
            let reflects = !passes && (total || (follow && chance < split.energy_reflection));
            let ln_passed = (1.0 - split.energy_reflection).max(1.0e-30).ln();
            if !self.has_reflected {
                self.ln_passed += ln_passed;
            }
            self.has_reflected |= reflects;
            if reflects {
                self.inside = change.before;
                reflections += 1;
                // A rough surface spreads part of the beam beyond the aperture, on the way out and back.
                self.ln_amplitude += accepted.ln();
                self.ln_scatter += 0.5 * split.energy_reflection.max(1.0e-30).ln();
                self.reflect(facet, normal);
            } else {
                if follow {
                    self.ln_scatter += 0.5 * ln_passed;
                } else {
                    self.ln_amplitude += ln_passed;
                }
                here = change.there;
                if self.by_aperture() && beyond.speed_ratio <= beyond.aperture_speed_ratio {
                    // Echoes from behind a fast body go around it, so the range that the path saved in it is added
                    // again.
                    self.range_mm += self.behind_mm;
                    self.behind_mm = 0.0;
                }
                let moves = self.inside.highest().is_some_and(|s| self.inputs.surface_moves[s as usize]);
                self.carried_mm = if moves { triangle.displacement_mm } else { DVec3::ZERO };
                // Beams bend by the delays over the aperture, not by the facet that a path meets.
                if self.has_reflected {
                    self.refract(normal, cos_incident, split.cos_transmitted, beyond.bending / tissue.bending);
                }
            }
            let given_up = self.ln_amplitude <= LN_GIVEN_UP && !self.by_aperture();
            // Total reflection turns back every path; only those that follow reflections go on.
            let not_followed = reflects && !self.follows_reflections;
            if reflections > self.inputs.reflections_max || given_up || not_followed {
                self.ln_amplitude = 2.0 * LN_SILENT;
                open = false;
            }
            self.bounce += 1;
        }
    }

    /// Whether the aperture's gain replaces the path's own loss.
    fn by_aperture(&self) -> bool {
        self.inputs.aperture.is_some() && !self.has_reflected
    }

    /// Random number in 0..1 for dimension `dim` of the current interface.
    fn random(&self, dim: u32) -> f64 {
        hash::sample_unit(self.inputs.seed, self.line_ray as u32, self.layer as u32, self.bounce, dim)
    }

    /// Length of path per mm of range. Range counts depth: the lens delays its middle, so echoes of oblique layers come
    /// no later.
    fn path_per_range(&self, tissue: &Medium) -> f64 {
        // For the aperture, slow hard media delay nothing behind them.
        let past_it = self.by_aperture() && tissue.aperture_speed_ratio > tissue.speed_ratio;
        self.stretch * if past_it { tissue.aperture_speed_ratio } else { tissue.speed_ratio }
    }

    /// [`Self::path_per_range`] of the aperture's sound, which goes around hard bodies.
    fn aperture_path_per_range(&self, tissue: &Medium) -> f64 {
        if self.by_aperture() { self.stretch * tissue.aperture_speed_ratio } else { self.path_per_range(tissue) }
    }

    /// The segment that begins at the path's current position.
    fn segment(&self, tissue: &Medium, echo: f64, echo_range_mm: f64) -> Segment {
        let step = self.ray.direction * self.path_per_range(tissue);
        // The loss of a fast body is spread over the range that it has for the aperture.
        let fall_np_mm = tissue.attenuation_np_mm * self.aperture_path_per_range(tissue);
        // A path that has reflected stands for those that follow no reflections, too. Powers of scatterers add over the
        // paths.
        let share = self.inputs.reflected_weight() / self.inputs.path_weight();
        let ln_share = if self.has_reflected && !self.is_axial { 0.5 * share.ln() } else { 0.0 };
        Segment {
            start_mm: self.range_mm,
            origin_mm: self.ray.origin_mm - self.carried_mm - step * self.range_mm,
            step,
            ln_amplitude_at_zero: self.ln_amplitude + self.ln_scatter + ln_share + fall_np_mm * self.range_mm,
            fall_np_mm,
            scatterer_mean: tissue.scatterer_mean,
            scatterer_deviation: tissue.scatterer_deviation,
            scatterer_density: tissue.scatterer_density,
            texture: tissue.texture,
            has_reflected: self.has_reflected,
            ln_passed_at_zero: self.ln_passed + if self.has_reflected { 0.0 } else { fall_np_mm * self.range_mm },
            echo,
            echo_range_mm,
        }
    }

    /// Advances to the next change of medium, past surfaces that a higher one hides. `None` if the image's depth ends
    /// first, or after too many crossings.
    fn next_change(&mut self, here: usize, crossed: &mut u32) -> Option<MediumChange<'a>> {
        let tissue = self.inputs.media[here];
        // Skips the interface just left.
        let t_min_mm = if self.bounce == 0 { 0.0 } else { TOUCH_MM };
        let left_mm = (self.inputs.depth_mm - self.range_mm) * self.path_per_range(&tissue);
        let ahead = crossings(self.inputs, &self.ray, t_min_mm, left_mm + TOUCH_MM);
        let mut gone_mm = 0.0;
        let mut met = None;
        for coincident in coincident(&ahead) {
            let t_mm = coincident[0].t_mm;
            *crossed += 1;
            if t_mm > left_mm || *crossed > PLACES_MAX {
                break;
            }
            let before = self.inside;
            self.inside.cross(coincident);
            gone_mm = t_mm;
            let there = self.inside.medium(self.inputs, self.ray.origin_mm + self.ray.direction * t_mm);
            if there != here {
                // The interface is the first triangle, by index, of the highest surface that is crossed.
                let order = |c: &&Crossing<'_>| (c.triangle.surface, std::cmp::Reverse(c.triangle.index));
                met = coincident.iter().max_by_key(order).map(|&crossing| MediumChange { before, crossing, there });
                break;
            }
        }
        self.ray.origin_mm += self.ray.direction * gone_mm;
        let passed_mm = gone_mm / self.path_per_range(&tissue);
        self.range_mm += passed_mm;
        self.behind_mm += gone_mm / self.aperture_path_per_range(&tissue) - passed_mm;
        self.ln_amplitude -= tissue.attenuation_np_mm * gone_mm;
        self.ln_passed -= tissue.attenuation_np_mm * gone_mm;
        met
    }

    /// Normal of a microfacet on a surface of normal `n`: Beckmann's distribution of slopes. Half of the roughness
    /// tilts the facet, half widens the lobe about it.
    fn facet(&self, n: DVec3, roughness: f64) -> DVec3 {
        let variance = 0.5 * roughness * roughness;
        // An axial path has a facet of its own only if its scanline has a single path.
        let mean = self.is_axial && self.inputs.rays_per_line * self.inputs.layers > 1;
        if variance <= 0.0 || mean {
            return n;
        }
        let slope = (-variance * (1.0 - self.random(1)).max(1.0e-7).ln()).max(0.0).sqrt();
        let helper = if n.x.abs() > 0.7 { DVec3::Y } else { DVec3::X };
        let tangent = helper.cross(n).normalize();
        let (sin, cos) = (std::f64::consts::TAU * self.random(2)).sin_cos();
        let facet = (n + slope * (cos * tangent + sin * n.cross(tangent))).normalize();
        // Rejects a facet that the path would hit from behind or at a grazing angle.
        if facet.dot(self.ray.direction) > -FACET_COS_MIN { n } else { facet }
    }

    /// Amplitude and range (mm) of the echo of the interface at the path's position.
    fn echo(
        &self,
        at_facet: &Interface,
        cos_facet: f64,
        tissue: &Medium,
        boundary: &Medium,
        surface: u32,
    ) -> (f64, f64) {
        if !self.inputs.interface_echoes {
            return (0.0, self.range_mm);
        }
        // The echo's range is shifted within the interface's thickness by a hash of the position.
        let salt = (surface as i32 + 1).wrapping_mul(SURFACE_SALT as i32);
        let offset =
            hash::unit(lattice::hash(lattice::cell(self.ray.origin_mm + OFF_THE_GRID_MM).map(|c| c ^ salt))[0]) - 0.5;
        let range_mm = self.range_mm + offset * boundary.thickness_mm / self.path_per_range(tissue);
        // Over rays and layers, echoes in phase add in amplitude, others in power.
        let inputs = self.inputs;
        let of_path = if self.has_reflected { inputs.reflected_weight() } else { inputs.path_weight() };
        // An axial path's echoes replace those that reflected paths miss.
        let in_phase = if self.is_axial { 1.0 } else { of_path };
        let in_power = (in_phase * (CELLS_OF_A_BEAM * in_phase).min(1.0)).sqrt();
        let weight = in_power + (in_phase - in_power) * boundary.coherence;
        // The aperture's gain replaces the path's loss, in `echo`.
        let ln_arriving = if self.by_aperture() { 0.0 } else { self.ln_amplitude };
        let arriving = if ln_arriving > LN_SILENT { ln_arriving.exp() } else { 0.0 };
        (at_facet.pressure_reflection * self.returning(cos_facet, boundary.roughness) * weight * arriving, range_mm)
    }

    /// Fraction of an echo's pressure that returns: a Gaussian lobe about the facet, and a diffuse floor. The lobe's
    /// variance is the aperture's plus half of the squared roughness.
    fn returning(&self, cos_facet: f64, roughness: f64) -> f64 {
        let rough2 = roughness * roughness;
        let cos2 = (cos_facet * cos_facet).max(1.0e-6);
        let tan2 = (1.0 - cos2) / cos2;
        let lobe2 = self.aperture_variance() + 0.5 * rough2;
        let specular = self.acceptance(0.5 * rough2) * (-(tan2 / lobe2).min(80.0)).exp();
        let diffuse = DIFFUSE * rough2 / (rough2 + DIFFUSE_HALF_ROUGHNESS2) * cos2;
        (specular + diffuse).sqrt()
    }

    /// Fraction of a reflected beam's energy within the aperture, for a surface of slope variance `variance`.
    fn acceptance(&self, variance: f64) -> f64 {
        self.aperture_variance() / (self.aperture_variance() + variance)
    }

    /// Mean square slope of the reflected rays that the aperture accepts.
    fn aperture_variance(&self) -> f64 {
        let half_angle = APERTURE_HALF_ANGLE * self.inputs.aperture_mm / self.range_mm.max(1.0);
        half_angle.clamp(APERTURE_HALF_ANGLE_MIN, APERTURE_HALF_ANGLE_MAX).powi(2)
    }

    /// Reflects at the facet, or at the mean surface if the facet would reflect the path through the surface.
    fn reflect(&mut self, facet: DVec3, normal: DVec3) {
        let direction = self.ray.direction;
        let mirrored = |n: DVec3| direction - 2.0 * direction.dot(n) * n;
        let turned = mirrored(facet);
        self.ray.direction = if turned.dot(normal) > 0.0 { turned } else { mirrored(normal) }.normalize();
    }

    /// Refracts by Snell's law; `speed_ratio` is c₂/c₁.
    fn refract(&mut self, normal: DVec3, cos_incident: f64, cos_transmitted: f64, speed_ratio: f64) {
        let bent = speed_ratio * self.ray.direction + (speed_ratio * cos_incident - cos_transmitted) * normal;
        if cos_transmitted > 0.0 && bent.dot(normal) < 0.0 {
            self.ray.direction = bent.normalize();
        }
    }
}

/// Interface properties: the larger roughness and thickness, and the smaller coherence, of its two sides.
fn boundary(tissue: &Medium, beyond: &Medium) -> Medium {
    Medium {
        roughness: tissue.roughness.max(beyond.roughness),
        thickness_mm: tissue.thickness_mm.max(beyond.thickness_mm),
        coherence: tissue.coherence.min(beyond.coherence),
        ..*tissue
    }
}

/// Reflection and transmission between two media, at an angle of incidence.
fn between(from: &Medium, to: &Medium, cos_incident: f64) -> Interface {
    interface(from.impedance_mrayl, to.impedance_mrayl, from.bending, to.bending, cos_incident)
}
