// Echo power of the beams at each plane, over that without obstacles [planes × cells], the first nodes of each row.
// A thread per node and plane.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> aperture: Aperture;
@group(0) @binding(2) var<storage, read> modes: array<i32>;
// Part of each mode in the transmit beam, then in the receive beam of each plane, at x = 0.
@group(0) @binding(3) var<storage, read> beam_parts: array<vec2<f32>>;
// Distance in nodes within which a beam's scatterers are summed [planes].
@group(0) @binding(4) var<storage, read> reach_nodes: array<f32>;
@group(0) @binding(5) var<storage, read> unobstructed: array<f32>;
@group(0) @binding(6) var<storage, read> fields: array<f32>;
@group(0) @binding(7) var<storage, read_write> powers: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let plane = id.y;
    let nodes = aperture.cells / node_cells_at(plane);
    let axis = id.x;
    if axis >= nodes {
        return;
    }
    // Node `nodes`/2 is x = 0; from `halves_at` on there are only even modes, half as far apart.
    let beam = i32((axis + nodes / 2u) % aperture.beams);
    let stride = select(2, 1, plane < aperture.halves_at || aperture.node_cells == 1u);
    let reach = reach_nodes[plane];
    let furthest = u32(reach + 0.5);
    let last = min(axis + furthest, nodes - 1u);
    var sum = 0.0;
    for (var node = max(axis, furthest) - furthest; node <= last; node++) {
        var sent = vec2<f32>(0.0);
        var heard = vec2<f32>(0.0);
        for (var slot = 0u; slot < aperture.modes; slot++) {
            let mode = modes[slot];
            if mode_ends(slot, plane) {
                break;
            }
            if mode == MODE_NONE {
                continue;
            }
            let row = (slot * aperture.planes + plane) * 2u * aperture.cells;
            let field = vec2<f32>(fields[row + node], fields[row + aperture.cells + node]);
            let count = i32(aperture.beams);
            let turns = (mode / stride * beam) % count;
            let turned = times(field, phasor(-f32(turns) / f32(count)));
            sent += times(turned, beam_parts[slot]);
            heard += times(turned, beam_parts[(plane + 1u) * aperture.modes + slot]);
        }
        let apart = f32(max(axis, node) - min(axis, node));
        sum += clamp(reach + 0.5 - apart, 0.0, 1.0) * dot(sent, sent) * dot(heard, heard);
    }
    let at = plane * aperture.cells + axis;
    powers[at] = sum / max(unobstructed[at], 1.0e-30);
}
