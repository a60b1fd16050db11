// Propagation of the modes from plane to plane through the transmission and the delays of the scan plane: an angular
// spectrum. Out: field of each mode at each cell before the interval of each plane
// [modes × planes × (real parts, imaginary parts) × cells]. A workgroup per mode.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> aperture: Aperture;
// Number of each mode; MODE_NONE pads.
@group(0) @binding(2) var<storage, read> modes: array<i32>;
@group(0) @binding(3) var<storage, read> face: array<f32>;
// Propagation of each spatial frequency to each plane, over the number of cells [planes × cells].
@group(0) @binding(4) var<storage, read> steps: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> transmissions: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> fields: array<f32>;

const THREADS: u32 = 64u;

var<workgroup> field: array<vec2<f32>, CELLS_MAX>;

// Spectrum of the field, in bit-reversed order.
fn forward(thread: u32) {
    for (var half = aperture.cells / 2u; half > 0u; half /= 2u) {
        for (var i = thread; i < aperture.cells / 2u; i += THREADS) {
            let j = i % half;
            let at = 2u * (i - j) + j;
            let a = field[at];
            let b = field[at + half];
            field[at] = a + b;
            field[at + half] = times(a - b, phasor(-0.5 * f32(j) / f32(half)));
        }
        workgroupBarrier();
    }
}

// The field of a spectrum in bit-reversed order, times the number of cells.
fn inverse(thread: u32) {
    for (var half = 1u; half < aperture.cells; half *= 2u) {
        for (var i = thread; i < aperture.cells / 2u; i += THREADS) {
            let j = i % half;
            let at = 2u * (i - j) + j;
            let a = field[at];
            let b = times(field[at + half], phasor(0.5 * f32(j) / f32(half)));
            field[at] = a + b;
            field[at + half] = a - b;
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
        // Whole turns are taken off as integers.
        let turns = ((mode * (i32(cell) - i32(cells / 2u))) % period + period) % period;
        let wave = phasor(f32(turns) / f32(period));
        field[cell] = select(vec2<f32>(0.0), face[cell] * wave, mode != MODE_NONE);
    }
    workgroupBarrier();
    let shift = countLeadingZeros(cells) + 1u;
    for (var plane = 0u; plane < aperture.planes; plane++) {
        if mode_ends(slot, plane) {
            return;
        }
        forward(local.x);
        for (var k = local.x; k < cells; k += THREADS) {
            field[k] = times(field[k], steps[plane * cells + (reverseBits(k) >> shift)]);
        }
        workgroupBarrier();
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
