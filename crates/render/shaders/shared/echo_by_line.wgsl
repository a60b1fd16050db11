// Echoes of a scanline by one thread, for software, where threads run in turn. The sums are the same as by workgroups.

fn add(line: u32, path: u32, segment: u32, weight: f32) {
    let echo = echo_of(line, path, segment, weight);
    if echo.sample == NO_SAMPLE {
        return;
    }
    for (var tap = 0; tap < taps(); tap++) {
        let sample = echo.sample + tap;
        if in_row(sample) {
            let echoed = echo.weights[tap] * echo.value;
            baseband[line * params.row_samples + u32(sample)] += echoed;
        }
    }
}

@compute @workgroup_size(16)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.line_count {
        return;
    }
    let line = params.line_first + id.x;
    let weight = 1.0 / f32(params.rays * params.layers);
    for (var ordinal = 0u; ordinal < params.rays * params.layer_count; ordinal++) {
        let path = path_of(line, ordinal);
        let count = count_of(path);
        var reflected_mm = BEYOND_MM;
        for (var i = 1u; i <= count; i++) {
            if has_reflected(path, i) {
                reflected_mm = min(reflected_mm, starts[path * STARTS + i]);
            }
            add(line, path, i, 1.0);
        }
        if APERTURE && params.axial_paths > 0u && reflected_mm < BEYOND_MM {
            // Beyond the first reflection, the axial path's echoes replace those that the path missed.
            let axial_path = axial_path_of(line);
            let axial_count = count_of(axial_path);
            for (var i = 1u; i <= axial_count; i++) {
                if starts[axial_path * STARTS + i] > reflected_mm {
                    add(line, axial_path, i, weight);
                }
            }
        }
    }
}
