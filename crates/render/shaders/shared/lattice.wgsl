// The scatterer lattice, fixed in the scene. The scatterer of a cell is a hash of the cell's coordinates: nothing
// repeats or is stored.

fn lattice_cell(p: vec3<f32>) -> vec3<i32> {
    return vec3<i32>(floor(p * (1.0 / CELL_MM)));
}

fn lattice_hash(cell: vec3<i32>) -> vec3<u32> {
    return pcg3d(bitcast<vec3<u32>>(cell));
}

// Position of a cell's scatterer, scene at rest, mm. `bits` holds three offsets of ten bits.
fn scatterer_position(cell: vec3<i32>, bits: u32) -> vec3<f32> {
    let offset = vec3<f32>(vec3<i32>(vec3<u32>(bits, bits >> 10u, bits >> 20u) & vec3<u32>(1023u))) + 0.5;
    return (vec3<f32>(cell) + offset * (1.0 / 1024.0)) * CELL_MM;
}

// A complex random number of mean 0 and mean square 1, nearly Gaussian: each part is a sum of four nibbles. It stands
// for the many scatterers of a real cell, so speckle is fully developed even if a pulse covers few cells.
fn scatterer_deviate(bits: u32) -> vec2<f32> {
    let pairs = (bits & 0x0f0f0f0fu) + ((bits >> 4u) & 0x0f0f0f0fu);
    let sums = vec2<u32>(pairs + (pairs >> 8u), (pairs >> 16u) + (pairs >> 24u)) & vec2<u32>(255u);
    return (vec2<f32>(vec2<i32>(sums)) - 30.0) * DEVIATE_SCALE;
}
