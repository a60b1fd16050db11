// Two-way amplitude of each beam of a period at every cell of each depth plane [planes × beams × cells]: a Fourier sum
// over the modes (waves along the face). A workgroup per plane and group of neighbouring cells.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> aperture: Aperture;
@group(0) @binding(2) var<storage, read> modes: array<i32>;
// Complex weight of each mode in the transmit beam, then in the receive beam of each depth plane, for beams at x = 0.
@group(0) @binding(3) var<storage, read> beam_parts: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> fields: array<f32>;
@group(0) @binding(5) var<storage, read_write> amplitudes: array<f32>;

const THREADS: u32 = 64u;

// Transmit field (xy) and receive field (zw), first of each spatial frequency, then of each beam in bit-reversed order
// [beams × cells of the workgroup].
var<workgroup> sums: array<vec4<f32>, BEAM_CELLS_OF_A_GROUP>;

fn both_times(pair: vec4<f32>, factor: vec2<f32>) -> vec4<f32> {
    return vec4<f32>(times(pair.xy, factor), times(pair.zw, factor));
}

// Multiplies both complex numbers by i.
fn both_turned(pair: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(-pair.y, pair.x, -pair.w, pair.z);
}

// Fourier transform over the rows, for each column: steps of radix 4, after one of radix 2 if the length needs it.
fn transform(thread: u32, columns: u32) {
    var block = aperture.beams;
    if countTrailingZeros(block) % 2u == 1u {
        block /= 2u;
        let apart = block * columns;
        for (var at = thread; at < apart; at += THREADS) {
            let a = sums[at];
            let b = sums[at + apart];
            sums[at] = a + b;
            sums[at + apart] = both_times(a - b, phasor(-0.5 * f32(at / columns) / f32(block)));
        }
        workgroupBarrier();
    }
    for (; block >= 4u; block /= 4u) {
        let quarter = block / 4u;
        let apart = quarter * columns;
        for (var i = thread; i < BEAM_CELLS_OF_A_GROUP / 4u; i += THREADS) {
            let row = i / columns;
            let j = row % quarter;
            let at = (4u * (row - j) + j) * columns + i % columns;
            let a = sums[at];
            let b = sums[at + apart];
            let c = sums[at + 2u * apart];
            let d = sums[at + 3u * apart];
            let w = phasor(-f32(j) / f32(block));
            let w2 = times(w, w);
            let even = a + c;
            let odd = a - c;
            let turned = both_turned(d - b);
            sums[at] = even + (b + d);
            sums[at + apart] = both_times(even - (b + d), w2);
            sums[at + 2u * apart] = both_times(odd + turned, w);
            sums[at + 3u * apart] = both_times(odd - turned, times(w2, w));
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let plane = group.y;
    // From plane `halves_at` on there are only even modes, whose spatial frequencies count half.
    let stride = select(2, 1, plane < aperture.halves_at);
    let count = i32(aperture.beams);
    let columns = BEAM_CELLS_OF_A_GROUP / aperture.beams;
    let first_cell = group.x * columns;
    let column = local.x % columns;
    // Modes of the same frequency are a multiple of `beams` apart, so one thread adds them all.
    let sharing = THREADS / columns;
    for (var slot = local.x / columns; slot < aperture.modes; slot += sharing) {
        let mode = modes[slot];
        if mode_ends(slot, plane) {
            break;
        }
        if mode == MODE_NONE {
            continue;
        }
        let start = (slot * aperture.planes + plane) * 2u * aperture.cells + first_cell + column;
        let field = vec2<f32>(fields[start], fields[start + aperture.cells]);
        let transmit = times(field, beam_parts[slot]);
        let receive = times(field, beam_parts[(plane + 1u) * aperture.modes + slot]);
        let frequency = u32(((mode / stride) % count + count) % count);
        sums[frequency * columns + column] += vec4<f32>(transmit, receive);
    }
    workgroupBarrier();
    transform(local.x, columns);
    let shift = countLeadingZeros(aperture.beams) + 1u;
    for (var i = local.x; i < BEAM_CELLS_OF_A_GROUP; i += THREADS) {
        let beam = i / columns;
        let pair = sums[(reverseBits(beam) >> shift) * columns + i % columns];
        let sent = pair.xy;
        let heard = pair.zw;
        amplitudes[(plane * aperture.beams + beam) * aperture.cells + first_cell + i % columns] =
            sqrt(dot(sent, sent) * dot(heard, heard));
    }
}
