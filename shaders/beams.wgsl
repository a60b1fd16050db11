// Two-way amplitude of each beam of a period at every cell of each plane [planes × beams × cells].
// A thread per cell, beam and plane.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> aperture: Aperture;
@group(0) @binding(2) var<storage, read> modes: array<i32>;
// Part of each mode in the transmit beam, then in the receive beam of each plane, at x = 0.
@group(0) @binding(3) var<storage, read> beam_parts: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> fields: array<f32>;
@group(0) @binding(5) var<storage, read_write> amplitudes: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let cell = id.x;
    let plane = id.z;
    let beam = id.y;
    if cell >= aperture.cells {
        return;
    }
    // From `halves_at` on there are only even modes, half as far apart.
    let stride = select(2, 1, plane < aperture.halves_at);
    let count = i32(aperture.beams);
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
        let field = vec2<f32>(fields[row + cell], fields[row + aperture.cells + cell]);
        let turns = (mode / stride * i32(beam)) % count;
        let turned = times(field, phasor(-f32(turns) / f32(count)));
        sent += times(turned, beam_parts[slot]);
        heard += times(turned, beam_parts[(plane + 1u) * aperture.modes + slot]);
    }
    amplitudes[(plane * aperture.beams + beam) * aperture.cells + cell] = sqrt(dot(sent, sent) * dot(heard, heard));
}
