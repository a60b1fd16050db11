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
    // Offsets of a profile, and samples per depth interval.
    offsets: u32,
    plane_samples: u32,
    // Turns of phase per mm of delay; 0 without refraction.
    turns_per_mm: f32,
    // Spacing of scanlines, in cells.
    line_spacing_cells: f32,
}

// Cells per node (axis of a beam) at a depth plane.
fn node_cells_at(plane: u32) -> u32 {
    return select(aperture.node_cells / 2u, aperture.node_cells, plane < aperture.halves_at);
}

// Whether a mode (a wave along the face) is left out at a depth plane and all deeper ones.
fn mode_ends(mode_slot: u32, plane: u32) -> bool {
    return plane >= aperture.halves_at && mode_slot >= aperture.lasting_modes;
}

// Index, within a period, of the beam whose axis is at node `axis`. Beam 0 is the one at x = 0, in the middle of the
// nodes.
fn beam_of(plane: u32, axis: u32) -> u32 {
    return (axis + aperture.cells / node_cells_at(plane) / 2u) % aperture.beams;
}
