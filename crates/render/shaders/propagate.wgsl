// Propagation of the modes (waves along the face) from depth plane to depth plane, through transmission and delays of
// the scan plane, by angular spectrum.
// Out: field of each mode at each cell of each depth plane, before the transmission of that plane's interval [modes ×
// planes × (real parts, imaginary parts) × cells]. A workgroup per mode.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> aperture: Aperture;
// Number of each mode: of its waves in one period of the beams; MODE_NONE pads.
@group(0) @binding(2) var<storage, read> modes: array<i32>;
@group(0) @binding(3) var<storage, read> face: array<f32>;
// Factor of each spatial frequency from the previous depth plane to each one, over the number of cells [planes ×
// cells].
@group(0) @binding(4) var<storage, read> steps: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> transmissions: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> fields: array<f32>;

const THREADS: u32 = 64u;

var<workgroup> field: array<vec2<f32>, CELLS_MAX>;

struct Quad {
    a: vec2<f32>,
    b: vec2<f32>,
    c: vec2<f32>,
    d: vec2<f32>,
}

// Multiplies a complex number by i.
fn turned(number: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(-number.y, number.x);
}

// Radix-4 step of the Fourier transform, with the twiddle factors of −`turns`.
fn forward_step(q: Quad, turns: f32) -> Quad {
    let w = phasor(-turns);
    let w2 = times(w, w);
    let even = q.a + q.c;
    let odd = q.a - q.c;
    let sum = q.b + q.d;
    let difference = turned(q.d - q.b);
    return Quad(even + sum, times(even - sum, w2), times(odd + difference, w), times(odd - difference, times(w2, w)));
}

// Radix-4 step of the inverse transform, with the twiddle factors of `turns`.
fn inverse_step(q: Quad, turns: f32) -> Quad {
    let w = phasor(turns);
    let w2 = times(w, w);
    let b = times(q.b, w2);
    let c = times(q.c, w);
    let d = times(q.d, times(w2, w));
    let even = q.a + b;
    let odd = q.a - b;
    let sum = c + d;
    let difference = turned(c - d);
    return Quad(even + sum, odd + difference, even - sum, odd - difference);
}

fn loaded(at: u32, apart: u32) -> Quad {
    return Quad(field[at], field[at + apart], field[at + 2u * apart], field[at + 3u * apart]);
}

fn store(at: u32, apart: u32, q: Quad) {
    field[at] = q.a;
    field[at + apart] = q.b;
    field[at + 2u * apart] = q.c;
    field[at + 3u * apart] = q.d;
}

// Index of the first of the four elements of the `i`-th step; they are `apart` apart.
fn place(i: u32, apart: u32) -> u32 {
    let j = i % apart;
    return 4u * (i - j) + j;
}

// Whether the transform needs a step of radix 2.
fn has_radix_2() -> bool {
    return countTrailingZeros(aperture.cells) % 2u == 1u;
}

// Transforms the field to its spectrum in bit-reversed order, except for the last step.
fn forward(thread: u32) {
    var block = aperture.cells;
    if has_radix_2() {
        block /= 2u;
        for (var i = thread; i < block; i += THREADS) {
            let a = field[i];
            let b = field[i + block];
            field[i] = a + b;
            field[i + block] = times(a - b, phasor(-0.5 * f32(i) / f32(block)));
        }
        workgroupBarrier();
    }
    for (; block > 4u; block /= 4u) {
        let apart = block / 4u;
        for (var i = thread; i < aperture.cells / 4u; i += THREADS) {
            let at = place(i, apart);
            store(at, apart, forward_step(loaded(at, apart), f32(i % apart) / f32(block)));
        }
        workgroupBarrier();
    }
}

// Last step of the transform, propagation to a depth plane, and first step of the inverse: all on the same elements.
fn propagate_spectrum(thread: u32, plane: u32) {
    let shift = countLeadingZeros(aperture.cells) + 1u;
    for (var i = thread; i < aperture.cells / 4u; i += THREADS) {
        var q = forward_step(loaded(4u * i, 1u), 0.0);
        q.a = times(q.a, step_of(4u * i, plane, shift));
        q.b = times(q.b, step_of(4u * i + 1u, plane, shift));
        q.c = times(q.c, step_of(4u * i + 2u, plane, shift));
        q.d = times(q.d, step_of(4u * i + 3u, plane, shift));
        store(4u * i, 1u, inverse_step(q, 0.0));
    }
    workgroupBarrier();
}

fn step_of(k: u32, plane: u32, shift: u32) -> vec2<f32> {
    return steps[plane * aperture.cells + (reverseBits(k) >> shift)];
}

// Transforms a spectrum in bit-reversed order back to the field, except for the first step. The result is multiplied by
// the number of cells.
fn inverse(thread: u32) {
    var block = 16u;
    for (; block <= aperture.cells; block *= 4u) {
        let apart = block / 4u;
        for (var i = thread; i < aperture.cells / 4u; i += THREADS) {
            let at = place(i, apart);
            store(at, apart, inverse_step(loaded(at, apart), f32(i % apart) / f32(block)));
        }
        workgroupBarrier();
    }
    if has_radix_2() {
        let half = aperture.cells / 2u;
        for (var i = thread; i < half; i += THREADS) {
            let a = field[i];
            let b = times(field[i + half], phasor(0.5 * f32(i) / f32(half)));
            field[i] = a + b;
            field[i + half] = a - b;
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let slot = group.x;
    let cells = aperture.cells;
    let mode = modes[slot];
    let period = i32(aperture.beams * aperture.node_cells);
    for (var cell = local.x; cell < cells; cell += THREADS) {
        // Integer arithmetic removes whole turns.
        let turns = ((mode * (i32(cell) - i32(cells / 2u))) % period + period) % period;
        let wave = phasor(f32(turns) / f32(period));
        field[cell] = select(vec2<f32>(0.0), face[cell] * wave, mode != MODE_NONE);
    }
    workgroupBarrier();
    for (var plane = 0u; plane < aperture.planes; plane++) {
        if mode_ends(slot, plane) {
            return;
        }
        forward(local.x);
        propagate_spectrum(local.x, plane);
        inverse(local.x);
        let row = (slot * aperture.planes + plane) * 2u * cells;
        for (var cell = local.x; cell < cells; cell += THREADS) {
            fields[row + cell] = field[cell].x;
            fields[row + cells + cell] = field[cell].y;
            field[cell] = times(field[cell], transmissions[plane * cells + cell]);
        }
        workgroupBarrier();
    }
}
