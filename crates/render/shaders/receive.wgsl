// Adds what the receiver adds to the focused lines: noise, clutter near the face, and reverberation of uncoupled parts
// of the face. In and out: complex [scanlines × row_samples], two samples per vector and thread.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;
// Baseband of reverberation and clutter at the samples near the face [scanlines × near_samples].
@group(0) @binding(3) var<storage, read> near_field: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> focused: array<vec4<f32>>;

// Factor on everything that the receiver adds.
const ADDED: f32 = 1.0;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.y;
    let first = 2u * id.x;
    if first >= params.row_samples {
        return;
    }
    let at = (line * params.row_samples + first) >> 1u;
    var value = focused[at];
    if first < params.near_samples {
        // ln of the two-way amplitude that the face passes. What does not pass reverberates in the probe.
        let ln_passed = max(segments[axial_path_of(line) * SEGMENTS].ln_passed_at_zero, 2.0 * LN_UNCOUPLED);
        let reverberation = ADDED * (1.0 - exp(0.5 * ln_passed)) * params.reverberation;
        let clutter = ADDED * exp(max(ln_passed, LN_UNCOUPLED)) * params.clutter;
        let a = near_field[line * params.near_samples + first];
        let b = near_field[line * params.near_samples + first + 1u];
        value += reverberation * vec4<f32>(a.xy, b.xy) + clutter * vec4<f32>(a.zw, b.zw);
    }
    if params.noise > 0.0 {
        let a = scatterer_deviate(pcg3d(vec3<u32>(first, line, params.noise_seed)).x);
        let b = scatterer_deviate(pcg3d(vec3<u32>(first + 1u, line, params.noise_seed)).x);
        value += ADDED * params.noise * vec4<f32>(a, b);
    }
    focused[at] = value;
}
