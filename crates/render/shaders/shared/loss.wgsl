// Loss along traced paths, one-way nepers.

fn has_reflected(path: u32, at: u32) -> bool {
    return (segments[path * SEGMENTS + at].scatterers & HAS_REFLECTED) != 0u;
}

// Loss from the face to a range. Only valid on segments before the path's first reflection.
fn loss_on(path: u32, at: u32, range_mm: f32) -> f32 {
    let slot = path * SEGMENTS + at;
    return 0.5 * (segments[slot].fall_np_mm * range_mm - segments[slot].ln_passed_at_zero);
}

// Index of the segment that contains a range; the search starts at segment `first`.
fn segment_from(path: u32, first: u32, range_mm: f32) -> u32 {
    var at = first;
    while starts[path * STARTS + at + 1u] <= range_mm {
        at++;
    }
    return at;
}

// Index of the path of a scanline that passes every interface: its axial path, or its only path.
fn axial_path_of(line: u32) -> u32 {
    return select(params.layer_count * params.line_count * params.rays, 0u, params.axial_paths == 0u) + line;
}
