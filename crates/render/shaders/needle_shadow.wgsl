// Multiplies the transmission of the cells behind the needle. One thread per cell that is listed; each is listed once.

@group(0) @binding(0) var<uniform> params: Params;
// Index of a cell of the scan plane [planes × cells], or NO_CELL; then the amplitude that passes, as bits.
@group(0) @binding(1) var<storage, read> shadows: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> transmissions: array<vec2<f32>>;

// Marks unused entries of the list.
const NO_CELL: u32 = 0xffffffffu;
// Factor of the amplitude that passes.
const NEEDLE_TRANSMISSION: f32 = 1.0;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&shadows) {
        return;
    }
    let shadow = shadows[id.x];
    if shadow.x != NO_CELL {
        transmissions[shadow.x] *= NEEDLE_TRANSMISSION * bitcast<f32>(shadow.y);
    }
}
