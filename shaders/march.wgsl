// Scatterers along the paths: complex baseband before the point-spread function.
// In: segments. Out: complex [scanlines × row_samples], two samples per vector. Eight consecutive samples per thread.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> hints: array<u32>;
// Gain of the scatterers, one for each block of DEPTH_BLOCK samples.
@group(0) @binding(4) var<uniform> scatterer_gain: array<vec4<f32>, BLOCK_QUADS>;
@group(0) @binding(5) var<storage, read_write> baseband: array<vec4<f32>>;
// Power of the scatterers, kept between the dispatches of a frame: mean and deviation, scaled; two samples per vector.
@group(0) @binding(6) var<storage, read_write> powers: array<vec4<f32>>;

// Samples per thread.
const RUN: u32 = 8u;

// The current segment.
var<private> path: u32;
var<private> at: u32;
var<private> ends_mm: f32;
var<private> s0: vec4<f32>;
var<private> s1: vec4<f32>;
var<private> s2: vec4<f32>;

// Loads the segment of path `chosen` that holds a sample. Samples of one path must come in ascending order.
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

// The lattice cell of a sample on the current path.
struct Met {
    // The cell holds a scatterer in media whose density is above this.
    presence: u32,
    bits: u32,
    turn: vec2<f32>,
}

fn meet(range_mm: f32) -> Met {
    let here = s0.xyz + s1.xyz * range_mm;
    let cell = lattice_cell(here);
    let bits = lattice_hash(cell);
    // The scatterer's own range sets the phase, whichever sample finds its cell.
    let ahead_mm = dot(scatterer_position(cell, bits.y) - here, s1.xyz) / max(dot(s1.xyz, s1.xyz), 1.0e-12);
    return Met(bits.x >> 15u, bits.z, phasor(-params.phase_turns_per_mm * (range_mm + ahead_mm)));
}

// Mean and deviation of a scatterer's amplitude on the current path, scaled.
fn strength(presence: u32, range_mm: f32) -> vec2<f32> {
    let ln_amplitude = s0.w - s1.w * range_mm;
    let there = presence < (bitcast<u32>(s2.z) & TAG_DENSITY) && ln_amplitude > LN_SPECKLE_SILENT;
    return select(vec2<f32>(0.0), s2.xy * exp(max(ln_amplitude, LN_SPECKLE_SILENT) + LN_SCALE), there);
}

fn echo(met: Met, strength: vec2<f32>) -> vec2<f32> {
    let amplitude = vec2<f32>(strength.x, 0.0) + strength.y * scatterer_deviate(met.bits);
    return vec2<f32>(
        amplitude.x * met.turn.x - amplitude.y * met.turn.y, amplitude.x * met.turn.y + amplitude.y * met.turn.x);
}

fn range_of(sample: u32) -> f32 {
    return (f32(i32(sample)) + 0.5) * params.sample_spacing_mm;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.y;
    let first = id.x * RUN;
    if first >= params.row_samples {
        return;
    }
    path = 0xffffffffu;
    let out = (line * params.row_samples + first) >> 1u;
    let begins = params.layer_first == 0u;
    let ends = params.layer_first + params.layer_count == params.layers;

    // One guide places the scatterers of all paths of a scanline; a single path is its own guide.
    let guide = select(params.layer_count * params.scanlines * params.rays, 0u, params.guides == 0u) + line;
    var met: array<Met, RUN>;
    for (var i = 0u; i < RUN; i++) {
        // Two samples share a segment: that of the first.
        let sample = first + (i & ~1u);
        seek(guide, sample, range_of(sample));
        met[i] = meet(range_of(first + i));
    }
    // The mean power of all rays sets their strength. Samples restart here, so the current segment is reset.
    path = 0xffffffffu;
    var power: array<vec4<f32>, RUN / 2u>;
    let weight = 1.0 / f32(params.rays * params.layers);
    for (var layer = 0u; layer < params.layer_count; layer++) {
        for (var ray = 0u; ray < params.rays; ray++) {
            for (var pair = 0u; pair < RUN / 2u; pair++) {
                let sample = first + 2u * pair;
                seek((layer * params.scanlines + line) * params.rays + ray, sample, range_of(sample));
                let s = vec4<f32>(
                    strength(met[2u * pair].presence, range_of(sample)),
                    strength(met[2u * pair + 1u].presence, range_of(sample + 1u)));
                power[pair] += weight * s * s;
            }
        }
    }
    let block = first >> BLOCK_SHIFT;
    let gain = UNSCALED * scatterer_gain[block >> 2u][block & 3u];
    for (var pair = 0u; pair < RUN / 2u; pair++) {
        var sum = power[pair];
        if !begins {
            sum += powers[out + pair];
        }
        var echoed = vec4<f32>(0.0);
        if ends {
            let s = gain * sqrt(sum);
            echoed = vec4<f32>(echo(met[2u * pair], s.xy), echo(met[2u * pair + 1u], s.zw));
        } else {
            powers[out + pair] = sum;
        }
        // `baseband` already holds the echoes of earlier dispatches.
        baseband[out + pair] = echoed + select(baseband[out + pair], vec4<f32>(0.0), begins);
    }
}
