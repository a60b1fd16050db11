// A family of sheets of scatterers: see crates/render/src/sheets.rs.
struct SheetFamily {
    // Normal of the sheets; distance along the elevational axis per mm along the normal.
    normal: vec4<f32>,
    // Axes of the sheets' cells; way along each per mm along the normal, on an elevational line.
    first: vec4<f32>,
    second: vec4<f32>,
    // Part of its amplitude in the sum.
    share: f32,
    // Added to the number of each sheet.
    salt: u32,
    // Side of a cell, mm.
    cell_mm: f32,
    // Scatterers of a cell, 1 to 4.
    cell_scatterers: u32,
}

// Uniforms of every pass: `Params` of crates/render/src/params.rs, field by field.
struct Params {
    // Columns of scene_from_probe; w holds the translation's x, y, z relative to the tree's centre, mm.
    lateral: vec4<f32>,
    elevational: vec4<f32>,
    axial: vec4<f32>,
    scanlines: u32,
    samples: u32,
    rays: u32,
    // Layers and scanlines of this dispatch.
    layer_first: u32,
    layer_count: u32,
    line_first: u32,
    line_count: u32,
    seed: u32,
    lateral_half: u32,
    axial_half: u32,
    map_rays: u32,
    // u32 words per row of packed 8-bit pixels.
    row_words: u32,
    sample_spacing_mm: f32,
    depth_mm: f32,
    // Turns of baseband phase per mm of depth.
    phase_turns_per_mm: f32,
    aperture_mm: f32,
    reach_mm: f32,
    tgc_db_per_mm: f32,
    // Radius of the face; negative for a linear face.
    face_radius_mm: f32,
    background: u32,
    // Samples per row in memory: a multiple of 16.
    row_samples: u32,
    hint_words: u32,
    // Number of depths per map ray, map_step_mm apart.
    map_depths: u32,
    map_step_mm: f32,
    // Words of packed pixels that overlap the sector.
    sector_words: u32,
    // Most reflections of a path.
    reflections_max: u32,
    // Elevational layers of the frame.
    layers: u32,
    // Axial paths, which set where the scatterers lie: one per scanline; 0 if a scanline has only one path.
    axial_paths: u32,
    // Number of `sheets`, and the distance between the sheets of one.
    sheet_families: u32,
    sheet_spacing_mm: f32,
    // Tissue outside all surfaces beyond the film of gel.
    beyond: u32,
    // Thickness of the film of gel, mm; negative if everything is coupled.
    film_mm: f32,
    // Amplitudes of white noise, clutter and reverberation; 0 if they are off.
    noise: f32,
    clutter: f32,
    reverberation: f32,
    // Samples of a scanline in the table of clutter and reverberation.
    near_samples: u32,
    // Seed of the noise of this frame.
    noise_seed: u32,
    // Cosine and sine of the steering angle.
    steer_cos: f32,
    steer_sin: f32,
    // First word of the positions of this look's pixels.
    angle_words: u32,
    // Range by which the wavefront of a steered look falls behind from one scanline to the next, mm.
    steer_shift_mm: f32,
    // Angle between neighbouring scanlines of a phased array, turns; 0 for other arrays.
    line_turns: f32,
    sheets: array<SheetFamily, SHEET_FAMILIES>,
    // Settings of [image]; a generated function reads each: image_gain_db(), image_tgc_sliders_db(index).
    image: array<vec4<u32>, IMAGE_QUADS>,
}

fn scene_from_probe_point(p: vec3<f32>) -> vec3<f32> {
    let origin = vec3<f32>(params.lateral.w, params.elevational.w, params.axial.w);
    return origin + scene_from_probe_vector(p);
}

fn scene_from_probe_vector(v: vec3<f32>) -> vec3<f32> {
    return params.lateral.xyz * v.x + params.elevational.xyz * v.y + params.axial.xyz * v.z;
}
