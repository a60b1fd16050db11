//! What an interface returns and lets pass, in f32: `shaders/shared/interface.wgsl` and the functions of `trace.wgsl`.

use glam::Vec3;

/// Snell and Fresnel between two fluids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interface {
    pub(super) pressure_reflection: f32,
    pub(super) energy_reflection: f32,
    pub(super) cos_transmitted: f32,
}

/// The formulas of `acoustics::interface`.
pub(super) fn interface_between(z1: f32, z2: f32, speed_ratio: f32, cos_incident: f32) -> Interface {
    // One speed: the same at every angle, and no critical one.
    if speed_ratio == 1.0 {
        let same = (z2 - z1) / (z2 + z1).max(1.0e-30);
        return Interface {
            pressure_reflection: same,
            energy_reflection: (same * same).min(1.0),
            cos_transmitted: cos_incident,
        };
    }
    // Grazing rays: 1 − cos² from its factors keeps its digits.
    let sin2_incident = ((1.0 - cos_incident) * (1.0 + cos_incident)).max(0.0);
    let sin2_transmitted = speed_ratio * speed_ratio * sin2_incident;
    if sin2_transmitted >= 1.0 {
        return Interface { pressure_reflection: 1.0, energy_reflection: 1.0, cos_transmitted: 0.0 };
    }
    let cos_transmitted = (1.0 - sin2_transmitted).max(0.0).sqrt();
    let (a, b) = (z2 * cos_incident, z1 * cos_transmitted);
    let sum = a + b;
    let r = if sum > 1.0e-30 { (a - b) / sum.max(1.0e-30) } else { 1.0 };
    Interface { pressure_reflection: r, energy_reflection: (r * r).min(1.0), cos_transmitted }
}

/// Normal of a microfacet on a surface of normal `n`: Beckmann's distribution of slopes, mean square `variance`.
pub(super) fn microfacet(n: Vec3, variance: f32, u: f32, v: f32) -> Vec3 {
    let slope = (-variance * (1.0 - u).max(1.0e-7).ln()).max(0.0).sqrt();
    let helper = if n.x.abs() > 0.7 { Vec3::Y } else { Vec3::X };
    let tangent = helper.cross(n).normalize();
    let bitangent = n.cross(tangent);
    let (sin, cos) = (std::f32::consts::TAU * v).sin_cos();
    (n + slope * (cos * tangent + sin * bitangent)).normalize()
}

/// Mean square slope of the reflected rays that an aperture accepts, seen from `range_mm`.
fn aperture_variance(range_mm: f32, aperture_mm: f32) -> f32 {
    let half_angle = (0.25 * aperture_mm / range_mm.max(1.0)).clamp(0.06, 0.5);
    half_angle * half_angle
}

/// Part of the energy of a reflected beam that a surface of slope variance `variance` leaves within the aperture.
pub(super) fn acceptance(variance: f32, range_mm: f32, aperture_mm: f32) -> f32 {
    let aperture = aperture_variance(range_mm, aperture_mm);
    aperture / (aperture + variance)
}

/// Part of an echo's pressure that returns: a Gaussian lobe about the facet, as wide as the aperture and the half of the
/// roughness below the facet together, and a diffuse floor.
pub(super) fn returning(cos_facet: f32, roughness: f32, range_mm: f32, aperture_mm: f32, diffuse: f32) -> f32 {
    let rough2 = roughness * roughness;
    let lobe2 = aperture_variance(range_mm, aperture_mm) + 0.5 * rough2;
    let cos2 = (cos_facet * cos_facet).max(1.0e-6);
    let tan2 = (1.0 - cos2).max(0.0) / cos2;
    let specular = acceptance(0.5 * rough2, range_mm, aperture_mm) * (-(tan2 / lobe2).min(80.0)).exp();
    (specular + diffuse * rough2 / (rough2 + 0.1) * cos2).sqrt()
}
