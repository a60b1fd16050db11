// Lateral point-spread function: each sample becomes the beam's weighted mean over neighbouring scanlines.
// The kernel belongs to a block of DEPTH_BLOCK samples; at the sector's edges the weights that remain are renormalised.
// Complex [scanlines × row_samples] in and out, two samples a vector. Four samples a thread.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> kernels: array<f32>;
@group(0) @binding(2) var<storage, read> baseband: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> focused: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = i32(id.y);
    let first = id.x * 4u;
    if first >= params.row_samples {
        return;
    }
    let half = i32(params.lateral_half);
    let kernel = i32((first / DEPTH_BLOCK) * (2u * params.lateral_half + 1u)) + half;
    let row = params.row_samples / 2u;
    let low = max(-half, -line);
    let high = min(half, i32(params.scanlines) - 1 - line);
    var total = 0.0;
    var a = vec4<f32>(0.0);
    var b = vec4<f32>(0.0);
    for (var tap = low; tap <= high; tap++) {
        let weight = kernels[kernel + tap];
        let at = u32(line + tap) * row + first / 2u;
        total += weight;
        a += weight * baseband[at];
        b += weight * baseband[at + 1u];
    }
    let scale = 1.0 / max(total, 1.0e-30);
    let out = u32(line) * row + first / 2u;
    focused[out] = a * scale;
    focused[out + 1u] = b * scale;
}
