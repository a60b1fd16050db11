// Echoes of the scatterers along the scanlines: complex baseband before the point-spread function.
// In: segments. Out: complex [scanlines × row_samples], two samples per vector. Eight consecutive samples per thread.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;
@group(0) @binding(3) var<storage, read> hints: array<u32>;
// Gain of the scatterers for each block of DEPTH_BLOCK samples.
@group(0) @binding(4) var<uniform> scatterer_gain: array<vec4<f32>, BLOCK_QUADS>;
@group(0) @binding(5) var<storage, read_write> baseband: array<vec4<f32>>;
// Scaled power of the scatterers at each sample, kept between the dispatches of a frame: mean, deviation, both times
// the density, 0.
@group(0) @binding(6) var<storage, read_write> powers: array<vec4<f32>>;
// This and the next one are read if APERTURE.
@group(0) @binding(7) var<uniform> aperture: Aperture;
@group(0) @binding(8) var<storage, read> line_gains: array<vec4<f32>>;
// 1/Y of the sheets of scatterers for each block, 1/mm: see crates/render/src/sheets.rs.
@group(0) @binding(9) var<uniform> sheet_reach: array<vec4<f32>, BLOCK_QUADS>;

// Texture of each tissue, by the texture's number − 1.
@group(0) @binding(10) var<storage, read> textures: array<Texture>;
// Ratio of the amplitude that came by reflections to the amplitude that the aperture sees, at the first sample of each
// block [scanlines × blocks]. Until the last dispatch of a frame, the scaled power of the reflections. Written if
// APERTURE.
@group(0) @binding(11) var<storage, read_write> reflected: array<f32>;

// Whether the aperture gain replaces the loss of paths that have not reflected.
override APERTURE: bool = false;
// Whether speckle changes gradually across the slice: scatterers on sheets, not on the lattice.
override ELEVATIONAL_SPECKLE: bool;
// Whether scattering varies within a tissue.
override TEXTURE: bool;

// Samples per thread.
const RUN: u32 = 8u;

// The current path, the index of its current segment, the segment's end (mm), and the segment.
var<private> path: u32;
var<private> at: u32;
var<private> ends_mm: f32;
var<private> current: Segment;

// Loads the segment of path `chosen` that contains a sample. Samples of one path must come in ascending order.
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
        current = segments[path * SEGMENTS + at];
    }
}

// Power of the current segment's scatterers: squared mean, squared deviation, and their sum times the density (0..1).
fn scatterer_power() -> vec3<f32> {
    let density = f32(i32(current.scatterers & TAG_DENSITY)) * (1.0 / DENSITY_ONE);
    let amplitude = vec2<f32>(current.scatterer_mean, current.scatterer_deviation);
    let power = amplitude * amplitude;
    return select(vec3<f32>(0.0), vec3<f32>(power, (power.x + power.y) * density), density > 0.0);
}

// Scaled power of an amplitude.
fn scaled_power(ln_amplitude: f32) -> f32 {
    return exp(2.0 * (clamp(ln_amplitude, LN_SPECKLE_SILENT, 0.25 + LN_SCALE) + LN_SCALE));
}

// Scaled power left by the current path's own loss at a range; 0 if inaudible.
fn own_power(range_mm: f32) -> f32 {
    let ln_amplitude = current.ln_amplitude_at_zero - current.fall_np_mm * range_mm;
    return select(0.0, scaled_power(ln_amplitude), ln_amplitude > LN_SPECKLE_SILENT);
}

// Echo of scatterers of the given power, at a range on the current path.
fn echo_at(range_mm: f32, power: vec3<f32>, gain: f32, per_reach_mm: f32) -> vec2<f32> {
    let position = Position(current.origin_mm + current.step * range_mm, current.step, range_mm);
    // If the paths are in different media, their densities are averaged by power.
    let density = DENSITY_ONE * power.z / max(power.x + power.y, LEAST_POWER);
    let strength = Strength(gain * sqrt(power.x), gain * sqrt(power.y), density);
    if ELEVATIONAL_SPECKLE {
        return sheets_echo(position, strength, per_reach_mm);
    }
    return lattice_echo(position, strength);
}

// Ratio of two amplitudes, from their powers, at most REFLECTED_MAX.
fn reflected_over_aperture(by_reflections: f32, by_aperture: f32) -> f32 {
    if by_reflections == 0.0 {
        return 0.0;
    }
    let bounded = by_aperture > by_reflections * (1.0 / (REFLECTED_MAX * REFLECTED_MAX));
    return select(REFLECTED_MAX, sqrt(by_reflections / by_aperture), bounded);
}

fn range_of(sample: u32) -> f32 {
    return (f32(i32(sample)) + 0.5) * params.sample_spacing_mm;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = params.line_first + id.y;
    let first = id.x * RUN;
    if first >= params.row_samples || id.y >= params.line_count {
        return;
    }
    path = 0xffffffffu;
    let out = line * params.row_samples + first;
    let begins = params.layer_first == 0u;
    let ends = params.layer_first + params.layer_count == params.layers;

    // The axial path sets where the scatterers of all paths of a scanline lie. A single path is its own axial path.
    let axial_path = axial_path_of(line);
    // Scaled power of the aperture gain at each sample, and power of the axial path's scatterers at each pair.
    var gain_power: array<f32, RUN>;
    var axial_power: array<vec3<f32>, RUN / 2u>;
    for (var i = 0u; APERTURE && i < RUN; i++) {
        let range_mm = range_of(first + i);
        // Both samples of a pair use the segment of the first.
        seek(axial_path, first + (i & ~1u), range_of(first + (i & ~1u)));
        axial_power[i >> 1u] = scatterer_power();
        gain_power[i] = scaled_power(scatterer_gain_at(line, range_mm, 0.5 * (current.fall_np_mm * range_mm - current.ln_passed_at_zero)));
    }
    // The mean power of all paths sets the scatterers' strength. Samples restart here, so the current segment is reset.
    path = 0xffffffffu;
    var power: array<vec3<f32>, RUN>;
    var by_reflections = 0.0;
    let block = first >> BLOCK_SHIFT;
    let of_block = line * (params.row_samples >> BLOCK_SHIFT) + block;
    let begins_block = first % DEPTH_BLOCK == 0u;
    // Continues the sums of earlier dispatches, as if their layers were in this one.
    if !begins {
        for (var i = 0u; i < RUN; i++) {
            power[i] = powers[out + i].xyz;
        }
        if APERTURE && begins_block {
            by_reflections = reflected[of_block];
        }
    }
    let weight = 1.0 / f32(params.rays * params.layers);
    for (var layer = 0u; layer < params.layer_count; layer++) {
        for (var ray = 0u; ray < params.rays; ray++) {
            for (var pair = 0u; pair < RUN / 2u; pair++) {
                let i = 2u * pair;
                let range_mm = range_of(first + i);
                seek((layer * params.line_count + id.y) * params.rays + ray, first + i, range_mm);
                let here = weight * scatterer_power();
                if APERTURE && (current.scatterers & HAS_REFLECTED) == 0u {
                    power[i] += gain_power[i] * here;
                    power[i + 1u] += gain_power[i + 1u] * here;
                } else {
                    // From its first reflection on a path has its own loss, and the axial path replaces what it missed.
                    let own = own_power(range_mm) * here;
                    power[i] += own;
                    by_reflections += select(0.0, own.x + own.y, pair == 0u);
                    power[i + 1u] += own_power(range_of(first + i + 1u)) * here;
                    if APERTURE {
                        power[i] += gain_power[i] * weight * axial_power[pair];
                        power[i + 1u] += gain_power[i + 1u] * weight * axial_power[pair];
                    }
                }
            }
        }
    }
    if APERTURE && begins_block {
        reflected[of_block] = select(by_reflections, reflected_over_aperture(by_reflections, gain_power[0] * (axial_power[0].x + axial_power[0].y)), ends);
    }
    let gain = UNSCALED * scatterer_gain[block >> 2u][block & 3u];
    var textured: array<f32, RUN / TEXTURE_SAMPLES>;
    path = 0xffffffffu;
    for (var i = 0u; ends && i < RUN / TEXTURE_SAMPLES; i++) {
        textured[i] = 1.0;
        let sample = first + i * TEXTURE_SAMPLES;
        if TEXTURE {
            seek(axial_path, sample, range_of(sample));
            let number = (current.scatterers >> TEXTURE_SHIFT) & TEXTURE_MASK;
            if number > 0u {
                let at_mm = range_of(sample) + 0.5 * f32(TEXTURE_SAMPLES - 1u) * params.sample_spacing_mm;
                textured[i] = texture_gain(textures[number - 1u], current.origin_mm + current.step * at_mm);
            }
        }
    }
    let reach = sheet_reach[block >> 2u][block & 3u];
    // Samples restart once more.
    path = 0xffffffffu;
    for (var i = 0u; i < RUN; i += 2u) {
        var echoed = vec4<f32>(0.0);
        if ends {
            let range_mm = range_of(first + i);
            seek(axial_path, first + i, range_mm);
            let here = gain * textured[i / TEXTURE_SAMPLES];
            echoed = vec4<f32>(
                echo_at(range_mm, power[i], here, reach), echo_at(range_of(first + i + 1u), power[i + 1u], here, reach));
        } else {
            powers[out + i] = vec4<f32>(power[i], 0.0);
            powers[out + i + 1u] = vec4<f32>(power[i + 1u], 0.0);
        }
        // `baseband` already holds the echoes of earlier dispatches.
        let at = (out + i) >> 1u;
        baseband[at] = echoed + select(baseband[at], vec4<f32>(0.0), begins);
    }
}
