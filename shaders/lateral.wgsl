// Lateral point-spread function: each sample becomes the beam's weighted mean over neighbouring scanlines.
// Each block of DEPTH_BLOCK samples has a kernel; at the sector's edges the remaining weights are renormalised.
// Complex [scanlines × row_samples] in and out, two samples per vector. A thread makes four samples of four scanlines,
// so each scanline that it reads serves all four. Each scanline sees its neighbours' scatterers with the gain
// of its own aperture.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> kernels: array<f32>;
@group(0) @binding(2) var<storage, read> baseband: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> focused: array<vec4<f32>>;
// Gain of each block as amplitude, and its reciprocal [scanlines × blocks]. Read if APERTURE.
@group(0) @binding(4) var<storage, read> block_gains: array<vec2<f32>>;

override APERTURE: bool;

// Gain of a scanline in a block.
fn own_gain(line: i32, block: u32) -> f32 {
    let last = i32(params.scanlines) - 1;
    return block_gains[u32(min(line, last)) * (params.row_samples >> BLOCK_SHIFT) + block].x;
}

fn store(line: u32, first: u32, a: vec4<f32>, b: vec4<f32>, total: f32) {
    if line < params.scanlines {
        let out = (line * params.row_samples + first) >> 1u;
        let scale = 1.0 / max(total, 1.0e-30);
        focused[out] = a * scale;
        focused[out + 1u] = b * scale;
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = i32(id.y) * 4;
    let first = id.x * 4u;
    if first >= params.row_samples {
        return;
    }
    let half = i32(params.lateral_half);
    let kernel = i32((first >> BLOCK_SHIFT) * (2u * params.lateral_half + 1u)) + half;
    // Weights of the current scanline for the four outputs; each scanline shifts them by one.
    var weights = vec4<f32>(0.0);
    var total = vec4<f32>(0.0);
    var a0 = vec4<f32>(0.0);
    var b0 = vec4<f32>(0.0);
    var a1 = vec4<f32>(0.0);
    var b1 = vec4<f32>(0.0);
    var a2 = vec4<f32>(0.0);
    var b2 = vec4<f32>(0.0);
    var a3 = vec4<f32>(0.0);
    var b3 = vec4<f32>(0.0);
    let block = first >> BLOCK_SHIFT;
    var own = vec4<f32>(1.0);
    if APERTURE {
        own = vec4<f32>(own_gain(line, block), own_gain(line + 1, block), own_gain(line + 2, block), own_gain(line + 3, block));
    }
    for (var tap = -half; tap <= half + 3; tap++) {
        weights = vec4<f32>(select(0.0, kernels[kernel + min(tap, half)], tap <= half), weights.xyz);
        let source = line + tap;
        let there = source >= 0 && source < i32(params.scanlines);
        let w = select(vec4<f32>(0.0), weights, there);
        let other = u32(clamp(source, 0, i32(params.scanlines) - 1));
        let at = (other * params.row_samples + first) >> 1u;
        let a = baseband[at];
        let b = baseband[at + 1u];
        total += w;
        var seen = w;
        if APERTURE {
            let reciprocal = block_gains[other * (params.row_samples >> BLOCK_SHIFT) + block].y;
            seen *= min(own * reciprocal, vec4<f32>(NEIGHBOUR_GAIN_MAX));
        }
        a0 += seen.x * a;
        b0 += seen.x * b;
        a1 += seen.y * a;
        b1 += seen.y * b;
        a2 += seen.z * a;
        b2 += seen.z * b;
        a3 += seen.w * a;
        b3 += seen.w * b;
    }
    store(u32(line), first, a0, b0, total.x);
    store(u32(line) + 1u, first, a1, b1, total.y);
    store(u32(line) + 2u, first, a2, b2, total.z);
    store(u32(line) + 3u, first, a3, b3, total.w);
}
