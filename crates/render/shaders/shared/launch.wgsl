// Start of a path: a ray of its scanline, moved across the slice. After the paths of all layers come the axial paths,
// one per scanline, along the scanlines' axes. They set where scatterers lie, and their echoes replace those that
// reflected paths miss.
struct Launch {
    origin: vec3<f32>,
    direction: vec3<f32>,
    // Depth of the origin below the apex of the face, mm; negative on a convex face.
    face_depth_mm: f32,
}

// Elevational offset (mm), slope, and length per mm of depth of a path; an axial path lies in the image plane. The
// buffer `rays` holds them after rays and axes, for every path of a scanline [angles × layers × rays].
fn elevation_of(path: u32) -> vec3<f32> {
    let line_rays = params.scanlines * params.rays;
    let angle = params.angle_words / max(params.sector_words, 1u);
    let layer = angle * params.layers + params.layer_first + path / (params.line_count * params.rays);
    let across = layer * params.rays + path % params.rays;
    let at = 2u * (line_rays + params.scanlines) + select(across, 0u, is_axial_path(path));
    return select(rays[at].xyz, vec3<f32>(0.0, 0.0, 1.0), is_axial_path(path));
}

fn is_axial_path(path: u32) -> bool {
    return path >= params.line_count * params.rays * params.layer_count;
}

fn launch(path: u32) -> Launch {
    let of_layer = params.line_count * params.rays;
    // In `rays`, the axes follow the rays.
    let axis = path - of_layer * params.layer_count + params.scanlines * params.rays;
    let ray = 2u * select(params.line_first * params.rays + path % of_layer, axis, is_axial_path(path));
    let elevation = elevation_of(path);
    let origin = rays[ray].xyz + vec3<f32>(0.0, elevation.x, 0.0);
    let straight = rays[ray + 1u].xyz;
    let steered = vec3<f32>(
        straight.x * params.steer_cos + straight.z * params.steer_sin,
        straight.y,
        straight.z * params.steer_cos - straight.x * params.steer_sin);
    let direction = steered + vec3<f32>(0.0, elevation.y, 0.0);
    return Launch(scene_from_probe_point(origin), normalize(scene_from_probe_vector(direction)), origin.z);
}
