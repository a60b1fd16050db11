// Texture of tissues: their scattering level as a fixed random function of position. See crates/render/src/texture.rs.
struct Texture {
    // Direction of the fibres (unit vector); in w, width over length of structures along them, minus 1.
    fibre: vec4<f32>,
    // Offset (xyz, in scales) and inverse scale (w, 1/mm) of the fields of clouds, grain and septa.
    fields: array<vec4<f32>, 3>,
    // Amplitudes of clouds, grain and septa, nepers; in w, an added level that keeps the mean power.
    amounts: vec4<f32>,
}

// A Gaussian random field of variance 1, whose correlation at a distance d is e^(−d²/2).
fn gaussian_field(at: vec3<f32>) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < WAVES; i++) {
        let turns = dot(TEXTURE_WAVES[i].xyz, at) + TEXTURE_WAVES[i].w;
        let u = 2.0 * abs(turns - round(turns));
        sum += 1.0 - 2.0 * u * u * (3.0 - 2.0 * u);
    }
    return sum / sqrt(f32(WAVES) * WAVE_VARIANCE);
}

// Factor on the scatterers' amplitude at a position in the scene at rest.
fn texture_gain(texture: Texture, here_mm: vec3<f32>) -> f32 {
    let stretched_mm = here_mm + texture.fibre.w * dot(here_mm, texture.fibre.xyz) * texture.fibre.xyz;
    var level = texture.amounts.w;
    for (var field = 0u; field < 3u; field++) {
        let amount = texture.amounts[field];
        if amount != 0.0 {
            let value = gaussian_field(stretched_mm * texture.fields[field].w + texture.fields[field].xyz);
            let septum = exp(-min(value * value / (SEPTUM_WIDTH * SEPTUM_WIDTH), 80.0));
            level += amount * select(value, septum, field == 2u);
        }
    }
    return exp(level);
}
