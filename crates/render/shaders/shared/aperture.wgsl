// Sizes of the aperture's grid: `ApertureShape` of crates/render/src/aperture/shape.rs, field by field.
struct Aperture {
    cells: u32,
    planes: u32,
    beams: u32,
    node_cells: u32,
    halves_at: u32,
    modes: u32,
    lasting_modes: u32,
    plane_mm: f32,
    // Offsets of a profile, and samples of an interval.
    offsets: u32,
    plane_samples: u32,
    // Turns of a wave per mm of delay; none without refraction.
    turns_per_mm: f32,
    // Distance of neighbouring scanlines, in cells.
    line_spacing_cells: f32,
}

// Cells per node at a plane.
fn node_cells_at(plane: u32) -> u32 {
    return select(aperture.node_cells / 2u, aperture.node_cells, plane < aperture.halves_at);
}

// Whether the waves of a mode are left out from a plane on.
fn mode_ends(mode_slot: u32, plane: u32) -> bool {
    return plane >= aperture.halves_at && mode_slot >= aperture.lasting_modes;
}

// Beam, within a period, whose axis is at a node: node `nodes`/2 is x = 0.
fn beam_of(plane: u32, axis: u32) -> u32 {
    return (axis + aperture.cells / node_cells_at(plane) / 2u) % aperture.beams;
}
