// A tissue as the passes need it: `PackedTissue` of crates/render/src/tables.rs.
struct Tissue {
    impedance_mrayl: f32,
    // c/c₀, which is mm of path per mm of range.
    speed_ratio: f32,
    // Two-way attenuation of the amplitude, nepers per mm of path.
    attenuation_np_mm: f32,
    roughness: f32,
    // Fraction of lattice cells that hold a scatterer, in 1/131072, and the texture's number from bit TEXTURE_SHIFT on.
    scatterers: u32,
    scatterer_mean: f32,
    scatterer_deviation: f32,
    thickness_mm: f32,
    // Fraction of an interface echo that stays in phase over the interface's thickness.
    coherence: f32,
    // c/c₀ in Snell's and Fresnel's laws; 1 without refraction.
    bending: f32,
    // `speed_ratio` for paths whose loss the aperture gain replaces: 1 in hard media, which sound goes past.
    aperture_speed_ratio: f32,
    pad0: u32,
}
