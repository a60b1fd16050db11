// Scatterers along the paths: complex baseband before the point-spread function.
// In: segments. Out: complex [scanlines × row_samples], two samples per vector. Eight consecutive samples per thread.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> hints: array<u32>;
@group(0) @binding(4) var<uniform> layers: array<vec4<f32>, LAYERS_MAX>;
// Gain of the scatterers, one for each block of DEPTH_BLOCK samples.
@group(0) @binding(5) var<uniform> scatterer_gain: array<vec4<f32>, BLOCK_QUADS>;
@group(0) @binding(6) var<storage, read_write> baseband: array<vec4<f32>>;
// Power of the scatterers, kept between the dispatches of a frame: mean and deviation, scaled; two samples per vector.
@group(0) @binding(7) var<storage, read_write> powers: array<vec4<f32>>;
// Their power times the density, as a part of 1.
@group(0) @binding(8) var<storage, read_write> dense_powers: array<vec2<f32>>;
// 1/Y of the sheets of scatterers, one for each block.
@group(0) @binding(9) var<uniform> sheet_reach: array<vec4<f32>, BLOCK_QUADS>;

// Speckle that changes gradually across the slice.
override ELEVATIONAL_SPECKLE: bool;

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

// Mean and deviation of a scatterer's amplitude on the current path, scaled.
fn strength(range_mm: f32) -> vec2<f32> {
    let ln_amplitude = s0.w - s1.w * range_mm;
    let there = density() > 0.0 && ln_amplitude > LN_SPECKLE_SILENT;
    return select(vec2<f32>(0.0), s2.xy * exp(max(ln_amplitude, LN_SPECKLE_SILENT) + LN_SCALE), there);
}

// Part of the cells that hold a scatterer, on the current path.
fn density() -> f32 {
    return f32(i32(bitcast<u32>(s2.z) & TAG_DENSITY)) * (1.0 / DENSITY_ONE);
}

// Echo of the scatterers at a range on the current path.
fn echo_at(range_mm: f32, strength: Strength, per_reach_mm: f32) -> vec2<f32> {
    let place = Place(s0.xyz + s1.xyz * range_mm, s1.xyz, range_mm);
    if ELEVATIONAL_SPECKLE {
        return sheets_echo(place, strength, per_reach_mm);
    }
    return lattice_echo(place, strength);
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
    let out = (line * params.row_samples + first) >> 1u;
    let begins = params.layer_first == 0u;
    let ends = params.layer_first + params.layer_count == params.layers;

    // The mean power of all rays sets the scatterers' strength.
    path = 0xffffffffu;
    var power: array<vec4<f32>, RUN / 2u>;
    var dense: array<vec2<f32>, RUN / 2u>;
    for (var layer = 0u; layer < params.layer_count; layer++) {
        let weight = layers[params.layer_first + layer].z / f32(params.rays);
        for (var ray = 0u; ray < params.rays; ray++) {
            for (var pair = 0u; pair < RUN / 2u; pair++) {
                // Two samples share a segment: that of the first.
                let sample = first + 2u * pair;
                seek((layer * params.scanlines + line) * params.rays + ray, sample, range_of(sample));
                let s = vec4<f32>(strength(range_of(sample)), strength(range_of(sample + 1u)));
                let part = weight * s * s;
                power[pair] += part;
                dense[pair] += density() * (part.xz + part.yw);
            }
        }
    }
    let block = first >> BLOCK_SHIFT;
    let gain = UNSCALED * scatterer_gain[block >> 2u][block & 3u];
    let reach = sheet_reach[block >> 2u][block & 3u];
    // One guide places the scatterers of all paths of a scanline; a single path is its own guide. Samples restart here,
    // so the current segment is reset.
    let guide = select(params.layer_count * params.scanlines * params.rays, 0u, params.guides == 0u) + line;
    path = 0xffffffffu;
    for (var pair = 0u; pair < RUN / 2u; pair++) {
        var sum = power[pair];
        var dense_sum = dense[pair];
        if !begins {
            sum += powers[out + pair];
            dense_sum += dense_powers[out + pair];
        }
        var echoed = vec4<f32>(0.0);
        if ends {
            let s = gain * sqrt(sum);
            let part = DENSITY_ONE * dense_sum / max(sum.xz + sum.yw, vec2<f32>(LEAST_POWER));
            let sample = first + 2u * pair;
            seek(guide, sample, range_of(sample));
            echoed = vec4<f32>(
                echo_at(range_of(sample), Strength(s.x, s.y, part.x), reach),
                echo_at(range_of(sample + 1u), Strength(s.z, s.w, part.y), reach));
        } else {
            powers[out + pair] = sum;
            dense_powers[out + pair] = dense_sum;
        }
        // `baseband` already holds the echoes of earlier dispatches.
        baseband[out + pair] = echoed + select(baseband[out + pair], vec4<f32>(0.0), begins);
    }
}
