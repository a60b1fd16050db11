// A family of parallel sheets of scatterers: see crates/render/src/sheets.rs.
struct SheetFamily {
    // Unit normal of the sheets; in w, mm along the elevational axis per mm along the normal.
    normal: vec4<f32>,
    // Axes of the sheets' cells; in w, on an elevational line, displacement along that axis per mm along the normal.
    first: vec4<f32>,
    second: vec4<f32>,
    // Amplitude weight of the family; the squares over a slice's families sum to 1.
    share: f32,
    // Added to each sheet's number before it is hashed.
    salt: u32,
    // Side of a cell, mm.
    cell_mm: f32,
    // Scatterers of a cell, 1 to 4.
    cell_scatterers: u32,
}

// Uniforms of every pass: `Params` of crates/render/src/params.rs, field by field.
struct Params {
    // Axes of the probe in the scene, unit vectors. Their w components are the position of the face's centre relative
    // to the tree's centre, mm.
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
    // Words of four 8-bit pixels per row of the image.
    row_words: u32,
    sample_spacing_mm: f32,
    depth_mm: f32,
    // Turns of baseband phase per mm of depth.
    phase_turns_per_mm: f32,
    aperture_mm: f32,
    reach_mm: f32,
    tgc_db_per_mm: f32,
    // Radius of the face, mm; negative for a linear face.
    face_radius_mm: f32,
    background: u32,
    // Samples per row in memory: a multiple of 16.
    row_samples: u32,
    hint_words: u32,
    // Number of depths on each map ray, map_step_mm apart.
    map_depths: u32,
    map_step_mm: f32,
    // Number of words of four pixels that overlap the sector.
    sector_words: u32,
    // Most reflections of a path.
    reflections_max: u32,
    // Elevational layers of the frame.
    layers: u32,
    // Number of axial paths, which set where scatterers lie: one per scanline, or 0 if a scanline has only one path.
    axial_paths: u32,
    // Number of families in `sheets`, and distance between neighbouring sheets of a family, mm.
    sheet_families: u32,
    sheet_spacing_mm: f32,
    // Tissue outside all surfaces, deeper than the film of gel.
    beyond: u32,
    // Thickness of the film of gel, mm; negative if contact is not simulated.
    film_mm: f32,
    // Amplitudes of white noise, clutter and reverberation; 0 if they are off.
    noise: f32,
    clutter: f32,
    reverberation: f32,
    // Samples per scanline in the table of clutter and reverberation.
    near_samples: u32,
    // Seed of the receiver's noise in this frame.
    noise_seed: u32,
    // Cosine and sine of the steering angle.
    steer_cos: f32,
    steer_sin: f32,
    // Offset of this steering angle in the table of pixel positions, words of four pixels.
    angle_words: u32,
    // Range by which a steered wavefront falls behind from one scanline to the next, mm.
    steer_shift_mm: f32,
    // Angle between neighbouring scanlines of a phased array, turns; 0 for other arrays.
    line_turns: f32,
    // Number of paths of each scanline that follow reflections: all of them, or fewer.
    reflecting_paths: u32,
    // Grey levels that `detect` makes of each sample: 1, or 2 if one lies midway to the next sample.
    levels_per_sample: u32,
    // Amplitude that the face reflects; 0 without multiples.
    face_reflection: f32,
    sheets: array<SheetFamily, SHEET_FAMILIES>,
    // Settings of the section [image]. Generated functions read them: image_gain_db(), image_tgc_sliders_db(index).
    image: array<vec4<u32>, IMAGE_QUADS>,
}

fn scene_from_probe_point(p: vec3<f32>) -> vec3<f32> {
    let origin = vec3<f32>(params.lateral.w, params.elevational.w, params.axial.w);
    return origin + scene_from_probe_vector(p);
}

fn scene_from_probe_vector(v: vec3<f32>) -> vec3<f32> {
    return params.lateral.xyz * v.x + params.elevational.xyz * v.y + params.axial.xyz * v.z;
}
