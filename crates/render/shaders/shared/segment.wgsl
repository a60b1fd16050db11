// A straight segment of a path, linear in the range ρ in mm: `Segment` of crates/render/src/segment.rs, field by field.
struct Segment {
    // Scatterer lookup position at ρ = 0, mm.
    origin_mm: vec3<f32>,
    // ln of the amplitude at ρ = 0, two-way.
    ln_amplitude_at_zero: f32,
    // Change of the lookup position per mm of range.
    step: vec3<f32>,
    // Decrease of the ln amplitude per mm of range.
    fall_np_mm: f32,
    // Mean amplitude of the medium's scatterers, and its standard deviation.
    scatterer_mean: f32,
    scatterer_deviation: f32,
    // Density of the scatterers (TAG_DENSITY), number of the texture (TEXTURE_SHIFT), whether the path has reflected
    // (HAS_REFLECTED), and TAG.
    scatterers: u32,
    // ln of the amplitude at ρ = 0, two-way, of a wave that passes every interface; behind a reflection, the value just
    // behind the interface.
    ln_passed_at_zero: f32,
}
