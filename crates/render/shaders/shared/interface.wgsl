// Snell's and Fresnel's laws between two fluids, as in crates/core/src/acoustics/interface.rs.
struct Interface {
    pressure_reflection: f32,
    energy_reflection: f32,
    cos_transmitted: f32,
}

fn interface_between(z1: f32, z2: f32, speed_ratio: f32, cos_incident: f32) -> Interface {
    // Equal speeds: the reflection is the same at every angle, and there is no critical angle.
    if speed_ratio == 1.0 {
        let same = (z2 - z1) / max(z2 + z1, 1.0e-30);
        return Interface(same, min(same * same, 1.0), cos_incident);
    }
    // As a product, since 1 − cos² loses its digits as cos approaches 1.
    let sin2_incident = max((1.0 - cos_incident) * (1.0 + cos_incident), 0.0);
    let sin2_transmitted = speed_ratio * speed_ratio * sin2_incident;
    if sin2_transmitted >= 1.0 {
        return Interface(1.0, 1.0, 0.0);
    }
    let cos_transmitted = sqrt(max(1.0 - sin2_transmitted, 0.0));
    let a = z2 * cos_incident;
    let b = z1 * cos_transmitted;
    let sum = a + b;
    let r = select(1.0, (a - b) / max(sum, 1.0e-30), sum > 1.0e-30);
    return Interface(r, min(r * r, 1.0), cos_transmitted);
}
