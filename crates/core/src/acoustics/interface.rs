//! Snell's law and the Fresnel pressure coefficients between two fluids.
//!
//! Solids are treated as fluids: shear waves are left out.

use glam::DVec3;

/// Pressure reflection and transmission at a plane interface between two fluids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// Signed pressure reflection coefficient r, −1..=1.
    pub pressure_reflection: f64,
    /// Energy reflection R = r², 0..=1; the transmitted part is 1 − R.
    pub energy_reflection: f64,
    /// Cosine of the refracted angle; 0 beyond the critical angle.
    pub cos_transmitted: f64,
}

/// Interface from medium 1 to medium 2 at `cos_incident` (0..=1).
///
/// r = (Z₂cosθᵢ − Z₁cosθₜ)/(Z₂cosθᵢ + Z₁cosθₜ); beyond the critical angle R = 1. Between media of equal speed r is the
/// normal-incidence value at every angle. Source: Szabo, *Diagnostic Ultrasound Imaging* (2nd ed.), section 3.3.
pub fn interface(z1_mrayl: f64, z2_mrayl: f64, c1_m_s: f64, c2_m_s: f64, cos_incident: f64) -> Interface {
    let cos_i = cos_incident.clamp(0.0, 1.0);
    if c1_m_s == c2_m_s {
        let r = (z2_mrayl - z1_mrayl) / (z2_mrayl + z1_mrayl);
        return Interface { pressure_reflection: r, energy_reflection: r * r, cos_transmitted: cos_i };
    }
    let ratio = c2_m_s / c1_m_s;
    // The factored form of 1 − cos² keeps its precision at normal incidence.
    let cos2_t = 1.0 - ratio * ratio * (1.0 - cos_i) * (1.0 + cos_i);
    if cos2_t <= 0.0 {
        return Interface { pressure_reflection: 1.0, energy_reflection: 1.0, cos_transmitted: 0.0 };
    }
    let cos_t = cos2_t.sqrt();
    let (a, b) = (z2_mrayl * cos_i, z1_mrayl * cos_t);
    let sum = a + b;
    let r = if sum > 0.0 { (a - b) / sum } else { 1.0 };
    Interface { pressure_reflection: r, energy_reflection: r * r, cos_transmitted: cos_t }
}

/// Unit direction of a refracted ray; `None` beyond the critical angle.
///
/// The incident ray has the unit `direction` and passes from medium 1 into medium 2. The interface's unit `normal`
/// points into medium 1. Snell's law: the tangential component of the slowness is conserved.
pub fn refracted(c1_m_s: f64, c2_m_s: f64, normal: DVec3, direction: DVec3) -> Option<DVec3> {
    let ratio = c2_m_s / c1_m_s;
    let cos_i = -normal.dot(direction);
    let along = direction + cos_i * normal;
    let sin2_t = ratio * ratio * along.length_squared();
    (sin2_t < 1.0).then(|| ratio * along - (1.0 - sin2_t).sqrt() * normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal(z1: f64, z2: f64) -> f64 {
        interface(z1, z2, 1540.0, 1540.0, 1.0).pressure_reflection.abs()
    }

    #[test]
    fn normal_incidence_from_published_impedances() {
        for (z1, z2, r) in [(1.48, 7.80, 0.6810), (1.38, 1.65, 0.0891), (1.65, 1.62, 0.00917), (1.65, 0.0004, 0.9995)] {
            assert!((normal(z1, z2) - r).abs() < 6e-5, "{z1} | {z2}");
        }
    }

    #[test]
    fn fat_to_liver_refracts_20_degrees_to_21_85() {
        let i = interface(1.38, 1.65, 1450.0, 1578.0, 20f64.to_radians().cos());
        assert!((i.cos_transmitted.acos().to_degrees() - 21.85).abs() < 0.01);
    }

    #[test]
    fn a_refracted_ray_has_the_cosine_of_its_interface() {
        let direction = DVec3::new(20f64.to_radians().sin(), 0.0, 20f64.to_radians().cos());
        let bent = refracted(1450.0, 1578.0, DVec3::NEG_Z, direction).unwrap();
        let i = interface(1.38, 1.65, 1450.0, 1578.0, direction.z);
        assert!((bent.z - i.cos_transmitted).abs() < 1e-12 && (bent.length() - 1.0).abs() < 1e-12 && bent.y == 0.0);
        assert_eq!(refracted(1480.0, 4080.0, DVec3::NEG_Z, direction.with_x(0.4).normalize()), None);
    }

    #[test]
    fn media_of_one_speed_reflect_the_same_at_every_angle() {
        for cos in [1.0, 0.5, 1e-4, 1e-9, 0.0] {
            assert_eq!(interface(1.6, 1.6, 1540.0, 1540.0, cos).energy_reflection, 0.0, "{cos}");
            let i = interface(1.5, 1.7, 1540.0, 1540.0, cos);
            assert!((i.pressure_reflection - 0.0625).abs() < 1e-12 && i.cos_transmitted == cos, "{cos}: {i:?}");
        }
        // Into a slower medium there is no total reflection, however grazing.
        let slower = interface(1.6, 1.6, 1540.0, 1539.0, 1e-9);
        assert!(slower.cos_transmitted > 0.03, "{slower:?}");
    }

    #[test]
    fn water_to_bone_is_total_from_21_27_degrees() {
        let at = |deg: f64| interface(1.48, 7.8, 1480.0, 4080.0, deg.to_radians().cos()).energy_reflection;
        assert!(at(21.25) < 1.0);
        assert_eq!(at(21.29), 1.0);
    }
}
