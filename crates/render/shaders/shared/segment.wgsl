// A straight segment of a path, linear in the range ρ in mm: `Segment` of crates/render/src/segment.rs, field by field.
struct Segment {
    // Position at which scatterers are looked up at ρ = 0, scene at rest, mm.
    origin_mm: vec3<f32>,
    // ln of the two-way amplitude at ρ = 0.
    ln_amplitude_at_zero: f32,
    // Change of the lookup position per mm of range.
    step: vec3<f32>,
    // Decrease of the ln amplitude, nepers per mm of range.
    fall_np_mm: f32,
    // Mean and standard deviation of the amplitude of the medium's scatterers.
    scatterer_mean: f32,
    scatterer_deviation: f32,
    // Scatterer density (bits TAG_DENSITY), texture number (from bit TEXTURE_SHIFT on), whether the path has reflected
    // (bit HAS_REFLECTED), and TAG.
    scatterers: u32,
    // ln of the two-way amplitude at ρ = 0 of a wave that passes every interface. From the first reflection on, it
    // keeps its value just beyond the reflecting interface.
    ln_passed_at_zero: f32,
}
