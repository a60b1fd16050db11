//! Specimens: synthetic tissues and bodies with known echoes, side by side in one scene.

use glam::{DQuat, DVec2, DVec3, Vec3};

use crate::anatomy::{Mesh, Scene, Surface, Tissue, TissueError, TissueTable, analytic};
use crate::pose::Pose;
use crate::render::{Choice, Effect, ImageSettings, RenderSettings};
use crate::transducer::{Probe, ProbeKind};

/// Distance between the positions of neighbouring specimens, mm.
const PITCH_MM: f64 = 100.0;
/// Number of specimens in a row.
const ROW: u32 = 5;
/// Half the length of a prism across the scan plane, mm.
const HALF_LENGTH_MM: f64 = 40.0;

/// Lossless tissue without scatterers, with a given speed and impedance.
pub fn silent(speed_m_s: f64, impedance_mrayl: f64) -> Tissue {
    Tissue {
        speed_m_s,
        density_kg_m3: impedance_mrayl * 1e6 / speed_m_s,
        attenuation_db_cm_mhz: 0.0,
        ..Tissue::default()
    }
}

/// Tissue of 1.6 MRayl with a scatterer in every lattice cell. Its amplitudes have this mean and deviation.
pub fn grainy(mean: f64, deviation: f64) -> Tissue {
    Tissue { scatterer_density: 1.0, scatterer_mean: mean, scatterer_deviation: deviation, ..silent(1540.0, 1.6) }
}

/// Tissues and surfaces of specimens under construction. The first tissue is the background.
#[derive(Debug, Default)]
pub struct Bench {
    tissues: Vec<Tissue>,
    surfaces: Vec<Surface>,
    /// Number of positions that are taken.
    places: u32,
}

impl Bench {
    /// Starts without specimens. `background` becomes tissue 0.
    pub fn new(background: Tissue) -> Self {
        Self { tissues: vec![background], ..Self::default() }
    }

    /// Takes the next free position of a specimen, (x, y) in mm, on a grid of 100 mm.
    pub(super) fn place(&mut self) -> DVec2 {
        let place = DVec2::new(f64::from(self.places % ROW), f64::from(self.places / ROW));
        self.places += 1;
        PITCH_MM * place
    }

    /// Adds a tissue and returns its index.
    pub fn tissue(&mut self, tissue: Tissue) -> usize {
        self.tissues.push(tissue);
        self.tissues.len() - 1
    }

    /// Adds a body with this tissue index, bounded by `mesh`. Where bodies overlap, the higher priority counts.
    pub fn add(&mut self, tissue: usize, priority: i32, mesh: Mesh) {
        self.surfaces.push(Surface { name: String::new(), tissue, priority, mesh });
    }

    /// Scene of the specimens. Tissue indices stay the same.
    ///
    /// # Errors
    /// A tissue outside its range, or more than 255 tissues.
    pub fn scene(self) -> Result<Scene, TissueError> {
        // Tissue tables are sorted by name, so the names keep the order of the indices.
        let named = self.tissues.into_iter().enumerate().map(|(i, t)| (format!("t{i:03}"), t));
        let mut scene = Scene {
            tissues: TissueTable::new(named)?,
            background: 0,
            surfaces: self.surfaces,
            motion: Default::default(),
            axes: Default::default(),
        };
        scene.sort_by_priority();
        Ok(scene)
    }
}

/// Probe with parallel scanlines `spacing_mm` apart.
pub fn linear(scanlines: u32, spacing_mm: f64, samples: u32, depth_mm: f64) -> Probe {
    let kind = ProbeKind::Linear { width_mm: spacing_mm * f64::from(scanlines) };
    Probe { kind, scanlines, samples: samples.into(), depth_mm, ..Probe::default() }
}

/// Settings with a small image and the scanlines' samples. `aperture` is off: most formulas describe single paths.
pub fn small(rays: u32, layers: u32) -> RenderSettings {
    let mut settings = RenderSettings { lines: true, ..RenderSettings::default() };
    settings.effects = settings.effects.with(Effect::Aperture, Choice::Off);
    settings.image = ImageSettings { width: 96, height: 64, ..ImageSettings::default() };
    (settings.quality.rays, settings.quality.layers) = (rays, layers);
    settings
}

/// Pose at a point (mm), facing +z, with its lateral axis along +x.
pub fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose { position_mm: DVec3::new(x, y, z), orientation: DQuat::IDENTITY }
}

/// Box around `centre` (x, y) from depth `top` to depth `bottom`, mm.
pub fn slab(centre: DVec2, half_width: f64, top: f64, bottom: f64) -> Mesh {
    let centre = centre.as_vec2();
    let half = half_width as f32;
    analytic::cuboid(
        Vec3::new(centre.x - half, centre.y - half, top as f32),
        Vec3::new(centre.x + half, centre.y + half, bottom as f32),
    )
}

/// Cube with sides of `size` mm whose front face is centred at `point`. `rotation` turns the face's normal from −z.
pub fn facing(point: DVec3, size: f64, rotation: DQuat) -> Mesh {
    let centre = point + rotation * DVec3::new(0.0, 0.0, 0.5 * size);
    analytic::plate(centre.as_vec3(), Vec3::splat(size as f32), rotation.as_quat())
}

/// Body around `centre` (x, y), mm. Its section in the scan plane lies between the curves `top` and `bottom`, sampled
/// at the lateral positions `xs`.
pub fn prism(centre: DVec2, xs: &[f64], top: impl Fn(f64) -> f64, bottom: impl Fn(f64) -> f64) -> Mesh {
    let count = xs.len() as u32;
    let mut vertices_mm = Vec::new();
    for y in [-HALF_LENGTH_MM, HALF_LENGTH_MM] {
        let vertex = |x: f64, z: f64| (centre + DVec2::new(x, y)).extend(z).as_vec3();
        vertices_mm.extend(xs.iter().map(|&x| vertex(x, top(x))));
        vertices_mm.extend(xs.iter().map(|&x| vertex(x, bottom(x))));
    }
    let at = |y: u32, curve: u32, i: u32| (2 * y + curve) * count + i;
    let mut triangles = Vec::new();
    let mut quad = |[a, b, c, d]: [u32; 4]| triangles.extend([[a, c, b], [a, d, c]]);
    for (i, next) in (0..count).zip(1..count) {
        quad([at(0, 0, i), at(0, 0, next), at(1, 0, next), at(1, 0, i)]);
        quad([at(0, 1, i), at(1, 1, i), at(1, 1, next), at(0, 1, next)]);
        quad([at(0, 0, i), at(0, 1, i), at(0, 1, next), at(0, 0, next)]);
        quad([at(1, 0, i), at(1, 0, next), at(1, 1, next), at(1, 1, i)]);
    }
    let last = count.saturating_sub(1);
    quad([at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0)]);
    quad([at(0, 0, last), at(0, 1, last), at(1, 1, last), at(1, 0, last)]);
    Mesh { vertices_mm, triangles }
}

/// Post along a scanline of a probe whose face is at `face`. It is so narrow that only that scanline's ray hits it. Its
/// only visible face is at `depth_mm`.
pub fn post(face: DVec3, probe: &Probe, line: u32, depth_mm: f64, length_mm: f64) -> Mesh {
    let lateral = probe.lateral_coordinate((f64::from(line) + 0.5) / f64::from(probe.scanlines));
    let (origin, direction) = probe.ray(lateral);
    let width = 0.6 * probe.line_spacing_mm(depth_mm);
    let centre = face + origin + direction * (depth_mm + 0.5 * length_mm);
    let rotation = DQuat::from_rotation_arc(DVec3::Z, direction);
    let size = DVec3::new(width, width, length_mm);
    analytic::plate(centre.as_vec3(), size.as_vec3(), rotation.as_quat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prisms_are_closed_and_face_outwards() {
        let xs: Vec<f64> = (0..=20).map(|i| f64::from(i) - 10.0).collect();
        let mesh = prism(DVec2::new(100.0, 5.0), &xs, |x| 3.0 + x.sin(), |_| 6.0);
        let volume_mm3 = 3.0 * 20.0 * 2.0 * HALF_LENGTH_MM;
        assert!(mesh.unpaired_edges() == 0);
        assert!((mesh.signed_volume_mm3() / volume_mm3 - 1.0).abs() < 0.01, "{}", mesh.signed_volume_mm3());
    }
}
