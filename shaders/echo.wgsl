// Adds the interfaces' echoes to the baseband. One thread per scanline takes its paths in a fixed order: the float sums
// are reproducible without atomics.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> echoes: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> segment_counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> baseband: array<vec2<f32>>;

@compute @workgroup_size(16)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.x;
    if line >= params.scanlines {
        return;
    }
    for (var layer = 0u; layer < params.layer_count; layer++) {
        for (var ray = 0u; ray < params.rays; ray++) {
            let path = (layer * params.scanlines + line) * params.rays + ray;
            let count = segment_counts[path];
            for (var i = 1u; i < count; i++) {
                let echo = echoes[path * SEGMENTS + i];
                let sample = echo.y / params.sample_spacing_mm;
                if echo.x != 0.0 && sample >= 0.0 && sample < f32(params.samples) {
                    baseband[line * params.row_samples + u32(sample)] += echo.x * phasor(-params.phase_turns_per_mm * echo.y);
                }
            }
        }
    }
}
