// The scatterer lattice, fixed in the scene: a pure hash of a cell, so that nothing repeats and nothing is stored.

// CELL_MM, the side of a cell in mm, comes from src/render/tables.rs.

fn lattice_cell(p: vec3<f32>) -> vec3<i32> {
    return vec3<i32>(floor(p * (1.0 / CELL_MM)));
}

fn lattice_hash(cell: vec3<i32>) -> vec3<u32> {
    return pcg3d(bitcast<vec3<u32>>(cell));
}

// Where in its cell the scatterer lies, scene frame, mm: three times ten bits.
fn scatterer_position(cell: vec3<i32>, bits: u32) -> vec3<f32> {
    let offset = vec3<f32>(vec3<i32>(vec3<u32>(bits, bits >> 10u, bits >> 20u) & vec3<u32>(1023u))) + 0.5;
    return (vec3<f32>(cell) + offset * (1.0 / 1024.0)) * CELL_MM;
}

// A nearly normal number of mean 0 and deviation 1: the sum of four bytes.
fn normal_from_bytes(bits: u32) -> f32 {
    let sum = (bits & 255u) + ((bits >> 8u) & 255u) + ((bits >> 16u) & 255u) + (bits >> 24u);
    return (f32(i32(sum)) - 510.0) * 0.006765875;
}
