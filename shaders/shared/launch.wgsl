// The first ray of a path: its scanline's, moved to its elevational layer. After the paths of all layers come the
// guides, one per scanline, along the axes: they carry no echo and place the scatterers of the other paths.
struct Launch {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

// Offset, slope, weight and stretch of a path's layer; a guide is in the image plane, with weight 0.
fn layer_of(path: u32) -> vec4<f32> {
    let layer = path / (params.scanlines * params.rays);
    return select(vec4<f32>(0.0, 0.0, 0.0, 1.0), layers[min(params.layer_first + layer, LAYERS_MAX - 1u)], layer < params.layer_count);
}

fn is_guide(path: u32) -> bool {
    return path >= params.scanlines * params.rays * params.layer_count;
}

fn launch(path: u32) -> Launch {
    let line_rays = params.scanlines * params.rays;
    // The axes follow the rays in their table.
    let ray = 2u * select(path % line_rays, path - line_rays * params.layer_count + line_rays, is_guide(path));
    let layer = layer_of(path);
    let origin = rays[ray].xyz + vec3<f32>(0.0, layer.x, 0.0);
    let direction = rays[ray + 1u].xyz + vec3<f32>(0.0, layer.y, 0.0);
    return Launch(scene_from_probe_point(origin), normalize(scene_from_probe_vector(direction)));
}
