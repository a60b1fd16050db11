// Scatterers along the paths: complex baseband before the point-spread function.
// In: segments. Out: complex [scanlines × row_samples], two samples a vector. Sixteen consecutive samples a thread.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> hints: array<u32>;
@group(0) @binding(4) var<uniform> layers: array<vec4<f32>, LAYERS_MAX>;
// Gain of the scatterers, one for each block of DEPTH_BLOCK samples.
@group(0) @binding(5) var<uniform> scatterer_gain: array<vec4<f32>, BLOCK_QUADS>;
@group(0) @binding(6) var<storage, read_write> baseband: array<vec4<f32>>;

const PAIRS: u32 = 8u;
// One path a scanline: its samples need no choice among paths.
override SINGLE_PATH: bool = false;
const LN_SILENT: f32 = -80.0;

// The segment in hand.
var<private> path: u32;
var<private> at: u32;
var<private> ends_mm: f32;
var<private> s0: vec4<f32>;
var<private> s1: vec4<f32>;
var<private> s2: vec4<f32>;
// Segment of the scanline's guide, and the lattice's place along it.
var<private> guide_at: u32;
var<private> guide_ends_mm: f32;
var<private> place_mm: vec3<f32>;
var<private> step: vec3<f32>;

// Loads the segment of path `chosen` that holds a sample.
fn seek(chosen: u32, sample: u32, range_mm: f32) {
    // A loop, not an `if`: software devices skip a loop that no thread enters.
    loop {
        if chosen == path && range_mm < ends_mm {
            break;
        }
        let block = sample >> HINT_SHIFT;
        let hint = (hints[chosen * params.hint_words + (block >> 2u)] >> (8u * (block & 3u))) & 255u;
        at = select(hint, at, chosen == path);
        path = chosen;
        ends_mm = starts[path * STARTS + at + 1u];
        while ends_mm <= range_mm {
            at++;
            ends_mm = starts[path * STARTS + at + 1u];
        }
        let slot = 3u * (path * SEGMENTS + at);
        s0 = segments[slot];
        s1 = segments[slot + 1u];
        s2 = segments[slot + 2u];
    }
}

// Loads where the scanline's guide, path `guide`, finds scatterers at a sample: samples come in ascending order.
fn seek_place(guide: u32, sample: u32, range_mm: f32) {
    loop {
        if range_mm < guide_ends_mm {
            break;
        }
        let block = sample >> HINT_SHIFT;
        let hint = (hints[guide * params.hint_words + (block >> 2u)] >> (8u * (block & 3u))) & 255u;
        guide_at = max(guide_at, hint);
        guide_ends_mm = starts[guide * STARTS + guide_at + 1u];
        while guide_ends_mm <= range_mm {
            guide_at++;
            guide_ends_mm = starts[guide * STARTS + guide_at + 1u];
        }
        let slot = 3u * (guide * SEGMENTS + guide_at);
        place_mm = segments[slot].xyz;
        step = segments[slot + 1u].xyz;
    }
}

// Echo at `range_mm` of the scatterer that lies at the place, as strong as the segment in hand says.
fn scatter(range_mm: f32) -> vec2<f32> {
    let here = place_mm + step * range_mm;
    let cell = lattice_cell(here);
    let bits = lattice_hash(cell);
    // Where the scatterer lies on the path: its phase is exact, whichever sample meets its cell.
    let ahead_mm = dot(scatterer_position(cell, bits.y) - here, step) / max(dot(step, step), 1.0e-12);
    let ln_amplitude = s0.w - s1.w * range_mm;
    let strength = (vec2<f32>(s2.x, 0.0) + s2.y * scatterer_deviate(bits.z)) * exp(max(ln_amplitude, LN_SILENT));
    let there = (bits.x >> 15u) < (bitcast<u32>(s2.z) & TAG_DENSITY) && ln_amplitude > LN_SILENT;
    let turn = phasor(-params.phase_turns_per_mm * (range_mm + ahead_mm));
    let echo = vec2<f32>(strength.x * turn.x - strength.y * turn.y, strength.x * turn.y + strength.y * turn.x);
    return select(vec2<f32>(0.0), echo, there);
}

// The only path of a scanline, stretch by stretch: software devices run a loop's body once whether a thread enters it
// or not, so that the search stands outside of the loop over samples.
fn march_single(line: u32, first: u32, gain: f32) {
    let last = min(first + 2u * PAIRS, params.row_samples);
    var sample = first;
    while sample < last {
        var range_mm = (f32(i32(sample)) + 0.5) * params.sample_spacing_mm;
        seek(line, sample, range_mm);
        place_mm = s0.xyz;
        step = s1.xyz;
        loop {
            baseband[(line * params.row_samples + sample) >> 1u] =
                gain * vec4<f32>(scatter(range_mm), scatter(range_mm + params.sample_spacing_mm));
            sample += 2u;
            range_mm = (f32(i32(sample)) + 0.5) * params.sample_spacing_mm;
            if sample >= last || range_mm >= ends_mm {
                break;
            }
        }
    }
}

// Which layer (of this dispatch; another one's is not below layer_count) and which of its rays carry the `k`-th echo of a
// sample, a layer as often as its weight says. They take turns in an order of low discrepancy over depth and scanlines (R2:
// Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018), two samples each, less than the pulse is long.
fn turn_of(line: u32, sample: u32, k: u32, rotation: u32) -> vec2<u32> {
    let number = (sample >> 1u) * params.paths_per_sample + k;
    var turn = (number * 3242174889u + line * 2447445414u + rotation) >> 16u;
    var layer = 0u;
    var share = u32(layers[0].z * 65536.0);
    while turn >= share && layer + 1u < params.layers {
        turn -= share;
        layer++;
        share = u32(layers[layer].z * 65536.0);
    }
    // The last one's share is what rounding left.
    return vec2<u32>(layer - params.layer_first, min(turn * params.rays / max(share, 1u), params.rays - 1u));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.y;
    let first = id.x * PAIRS * 2u;
    if first >= params.row_samples {
        return;
    }
    path = 0xffffffffu;
    let block = first >> BLOCK_SHIFT;
    let gain = scatterer_gain[block >> 2u][block & 3u] / sqrt(f32(params.paths_per_sample));
    if SINGLE_PATH {
        march_single(line, first, gain);
        return;
    }
    let guide = params.layer_count * params.scanlines * params.rays + line;
    let rotation = pcg3d(vec3<u32>(params.seed, 0u, 0u)).x;
    guide_at = 0u;
    guide_ends_mm = 0.0;
    for (var pair = 0u; pair < PAIRS; pair++) {
        let sample = first + 2u * pair;
        let range_mm = (f32(i32(sample)) + 0.5) * params.sample_spacing_mm;
        // Where scatterers lie the guide says for all, how strong they are the ray whose turn it is.
        seek_place(guide, sample, range_mm);
        var sum = vec4<f32>(0.0);
        for (var k = 0u; k < params.paths_per_sample; k++) {
            let turn = turn_of(line, sample, k, rotation);
            if turn.x < params.layer_count {
                seek((turn.x * params.scanlines + line) * params.rays + turn.y, sample, range_mm);
                sum += vec4<f32>(scatter(range_mm), scatter(range_mm + params.sample_spacing_mm));
            }
        }
        let out = (line * params.row_samples + sample) >> 1u;
        if params.layer_first == 0u {
            baseband[out] = gain * sum;
        } else {
            baseband[out] += gain * sum;
        }
    }
}
