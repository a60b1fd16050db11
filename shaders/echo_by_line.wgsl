// Adds the interfaces' echoes to the baseband, as echo.wgsl does; for software, where threads take turns. One thread per scanline
// takes its paths in their order: the same sums.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> echoes: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> segment_counts: array<u32>;
// Read if APERTURE.
@group(0) @binding(5) var<uniform> aperture: Aperture;
@group(0) @binding(6) var<storage, read> line_gains: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> baseband: array<vec2<f32>>;

// Whether the aperture's gain replaces the loss of paths that have not reflected.
override APERTURE: bool = false;

fn add(line: u32, path: u32, segment: u32, weight: f32) {
    let echo = echo_of(line, path, segment, weight);
    if echo.sample != NO_SAMPLE {
        let echoed = echo.value;
        baseband[line * params.row_samples + echo.sample] += echoed;
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
            if diverted(path, i) {
                reflected_mm = min(reflected_mm, starts[path * STARTS + i]);
            }
            add(line, path, i, 1.0);
        }
        if APERTURE && params.guides > 0u && reflected_mm < BEYOND_MM {
            // The guide stands for what the path missed.
            let guide = guide_of(line);
            let of_guide = count_of(guide);
            for (var i = 1u; i <= of_guide; i++) {
                if starts[guide * STARTS + i] > reflected_mm {
                    add(line, guide, i, weight);
                }
            }
        }
    }
}
