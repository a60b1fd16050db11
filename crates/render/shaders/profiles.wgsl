// Weights of a scanline's neighbours and echo power of the beams at each depth plane, from the beams' amplitudes.
// Out: weights [planes × scanlines × (2·lateral_half + 1)]. They are added to a fraction of the depth's kernel: that
// fraction, first tap and end of the weights [planes × scanlines × 3].
// Out: echo power relative to the greatest one without obstacles [planes × cells]; each row has values only at its
// first elements, one per node. A thread per plane and scanline or node.
//
// If nothing bends or hides a beam, it has the kernel of its depth. Otherwise the beam's own amplitude takes over.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> aperture: Aperture;
// Lateral position of each scanline, in cells.
@group(0) @binding(2) var<storage, read> line_cells: array<f32>;
// For each depth plane: distance within which a beam's scatterers are summed (cells), and greatest power without
// obstacles.
@group(0) @binding(3) var<storage, read> reaches: array<vec2<f32>>;
// Two-way amplitude of an unobstructed beam, by the offset from its axis in cells [planes × offsets].
@group(0) @binding(4) var<storage, read> unobstructed: array<f32>;
@group(0) @binding(5) var<storage, read> kernels: array<f32>;
@group(0) @binding(6) var<storage, read> amplitudes: array<f32>;
@group(0) @binding(7) var<storage, read_write> powers: array<f32>;
@group(0) @binding(8) var<storage, read_write> weights: array<f32>;
@group(0) @binding(9) var<storage, read_write> blends: array<f32>;

// Catmull-Rom spline through four values, at the fraction `part` between the second and the third.
fn catmull_rom(v: vec4<f32>, part: f32) -> f32 {
    let bend = v.x - 2.5 * v.y + 2.0 * v.z - 0.5 * v.w;
    let twist = 0.5 * (v.w - v.x) + 1.5 * (v.y - v.z);
    return v.y + part * (0.5 * (v.z - v.x) + part * (bend + part * twist));
}

fn amplitude_at(plane: u32, axis: u32, offset: i32) -> f32 {
    let cell = i32(axis * node_cells_at(plane)) + offset + i32(aperture.cells);
    let row = (plane * aperture.beams + beam_of(plane, axis)) * aperture.cells;
    // The grid is periodic across the face.
    return amplitudes[row + u32(cell) % aperture.cells];
}

// Amplitude of a scanline's beam at an offset in cells. The scanline lies at the fraction `part` between the axes `low`
// and `low` + 1.
fn between(plane: u32, low: u32, part: f32, offset: i32) -> f32 {
    return (1.0 - part) * amplitude_at(plane, low, offset) + part * amplitude_at(plane, low + 1u, offset);
}

fn unobstructed_at(plane: u32, offset: i32) -> f32 {
    let at = u32(abs(offset));
    return select(0.0, unobstructed[plane * aperture.offsets + min(at, aperture.offsets - 1u)], at < aperture.offsets);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let plane = id.y;
    let reach = reaches[plane].x;
    let node_cells = node_cells_at(plane);
    let nodes = aperture.cells / node_cells;
    if id.x < aperture.cells {
        var sum = 0.0;
        if id.x < nodes {
            let furthest = i32(reach + 0.5);
            for (var offset = -furthest; offset <= furthest; offset++) {
                let amplitude = amplitude_at(plane, id.x, offset);
                sum += clamp(reach + 0.5 - f32(abs(offset)), 0.0, 1.0) * amplitude * amplitude;
            }
        }
        powers[plane * aperture.cells + id.x] = sum / max(reaches[plane].y, 1.0e-30);
    }
    let line = id.x;
    if line >= params.scanlines {
        return;
    }
    let half = i32(params.lateral_half);
    let taps = 2u * params.lateral_half + 1u;
    let node = clamp(line_cells[line] / f32(node_cells), 0.0, f32(nodes) - 1.001);
    let low = u32(node);
    let part = node - f32(low);
    let block = min((2u * plane + 1u) * aperture.plane_samples / 2u, params.samples - 1u) >> BLOCK_SHIFT;
    let first_weight = (plane * params.scanlines + line) * taps;
    var power = 0.0;
    var overlap = 0.0;
    var plain_power = 0.0;
    var kernel_power = 0.0;
    var greatest = 0.0;
    for (var tap = -half; tap <= half; tap++) {
        let offset = f32(tap) * aperture.line_spacing_cells;
        var weight = 0.0;
        var plain = 0.0;
        if abs(offset) <= reach {
            let whole = i32(floor(offset));
            let within = offset - floor(offset);
            let near = vec4<f32>(
                between(plane, low, part, whole - 1), between(plane, low, part, whole),
                between(plane, low, part, whole + 1), between(plane, low, part, whole + 2));
            weight = max(catmull_rom(near, within), 0.0);
            let near_plain = vec4<f32>(
                unobstructed_at(plane, whole - 1), unobstructed_at(plane, whole),
                unobstructed_at(plane, whole + 1), unobstructed_at(plane, whole + 2));
            plain = max(catmull_rom(near_plain, within), 0.0);
        }
        let kernel = kernels[block * taps + u32(tap + half)];
        power += weight * weight;
        overlap += weight * plain;
        plain_power += plain * plain;
        kernel_power += kernel * kernel;
        greatest = max(greatest, weight);
        weights[first_weight + u32(tap + half)] = weight;
    }
    let alike = overlap * overlap / max(power * plain_power, 1.2e-38);
    let kept = select(1.0, max(1.0 - max(1.0 - alike, 0.0) / UNLIKE, 0.0), power > 0.0);
    var first = taps;
    var end = 0u;
    if kept < 1.0 {
        let scale = (1.0 - kept) * sqrt(kernel_power / max(power, 1.0e-38));
        for (var tap = 0u; tap < taps; tap++) {
            let weight = weights[first_weight + tap];
            if weight >= PROFILE_CUT * greatest {
                first = min(first, tap);
                end = tap + 1u;
            }
            weights[first_weight + tap] = weight * scale;
        }
    }
    let at = 3u * (plane * params.scanlines + line);
    blends[at] = min(kept, 1.0);
    blends[at + 1u] = f32(min(first, end));
    blends[at + 2u] = f32(end);
}
