// The first ray of a path: its scanline's, moved to its elevational layer.
struct Launch {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

fn launch(path: u32) -> Launch {
    let line_rays = params.scanlines * params.rays;
    let line_ray = path % line_rays;
    let layer = layers[params.layer_first + path / line_rays];
    let origin = rays[2u * line_ray].xyz + vec3<f32>(0.0, layer.x, 0.0);
    let direction = rays[2u * line_ray + 1u].xyz + vec3<f32>(0.0, layer.y, 0.0);
    return Launch(scene_from_probe_point(origin), normalize(scene_from_probe_vector(direction)));
}
