// Sizes of the aperture's grid: `ApertureShape` of src/render/aperture/shape.rs, field by field.
struct Aperture {
    cells: u32,
    planes: u32,
    beams: u32,
    node_cells: u32,
    halves_at: u32,
    modes: u32,
    lasting_modes: u32,
    plane_mm: f32,
}

// Cells per node at a plane.
fn node_cells_at(plane: u32) -> u32 {
    return select(1u, aperture.node_cells, plane < aperture.halves_at);
}

// Whether the waves of a mode are left out from a plane on.
fn mode_ends(mode_slot: u32, plane: u32) -> bool {
    return plane >= aperture.halves_at && mode_slot >= aperture.lasting_modes;
}
