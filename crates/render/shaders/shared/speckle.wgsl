// Echo of the scatterers at a sample, from the lattice or from sheets.

// Strength of the scatterers at a sample, averaged over the scanline's paths.
struct Strength {
    // Mean and standard deviation of a scatterer's amplitude.
    mean: f32,
    deviation: f32,
    // Fraction of cells that hold a scatterer, in 1/131072.
    density: f32,
}

// A sample's position on its axial path.
struct Position {
    // Position in the scene at rest, relative to the tree's centre, mm.
    here: vec3<f32>,
    // Change of the position per mm of range.
    step: vec3<f32>,
    range_mm: f32,
}

// Echo of the scatterer with the random words `bits`, which lies `ahead_mm` of range beyond the sample.
fn scatterer_echo(bits: vec3<u32>, ahead_mm: f32, position: Position, strength: Strength) -> vec2<f32> {
    // The scatterer's own range sets the phase, whichever sample finds its cell.
    let turn = phasor(-params.phase_turns_per_mm * (position.range_mm + ahead_mm));
    let amplitude = vec2<f32>(strength.mean, 0.0) + strength.deviation * scatterer_deviate(bits.z);
    return select(vec2<f32>(0.0), times(amplitude, turn), f32(i32(bits.x >> 15u)) < strength.density);
}

// Echo of the single scatterer in the sample's lattice cell.
fn lattice_echo(position: Position, strength: Strength) -> vec2<f32> {
    let cell = lattice_cell(position.here);
    let bits = lattice_hash(cell);
    let ahead = scatterer_position(cell, bits.y) - position.here;
    let ahead_mm = dot(ahead, position.step) / max(dot(position.step, position.step), 1.0e-12);
    return scatterer_echo(bits, ahead_mm, position, strength);
}

// Random words of a sheet's cell: presence, position and amplitude of its scatterer.
fn sheet_hash(cell: vec3<i32>) -> vec3<u32> {
    return pcg3d(bitcast<vec3<u32>>(cell));
}

// A scatterer of a cell, relative to a sample.
struct CellScatterer {
    // Random words for presence, position and amplitude.
    bits: vec3<u32>,
    // Range beyond the sample, mm.
    ahead_mm: f32,
}

// Position of a scatterer in its cell (0..1 on both axes), from ten bits each of a random word.
fn sheet_offset(bits: u32) -> vec2<f32> {
    return (vec2<f32>(vec2<i32>(vec2<u32>(bits, bits >> 10u) & vec2<u32>(1023u))) + 0.5) * (1.0 / 1024.0);
}

// The scatterer of a cell whose range is nearest to the sample's. Each scatterer has its own quarter of the cell; two
// of them have opposite quarters. `corner` is the vector from the sample to the cell's corner, in cells. `rate` is the
// range per cell along both axes, mm.
fn nearest_scatterer(scatterers: u32, bits: vec3<u32>, corner: vec2<f32>, rate: vec2<f32>) -> CellScatterer {
    var nearest = 0u;
    var ahead_mm = BEYOND_MM;
    for (var quarter = 0u; quarter < scatterers; quarter++) {
        let position = bits.y + quarter * (bits.x * SCATTERER_STRIDE);
        let half = vec2<f32>(vec2<i32>(vec2<u32>(quarter ^ (quarter >> 1u), quarter) & vec2<u32>(1u))) * 0.5;
        let along_mm = dot(corner + (half + 0.5 * sheet_offset(position)), rate);
        if abs(along_mm) < abs(ahead_mm) {
            nearest = quarter;
            ahead_mm = along_mm;
        }
    }
    let words = vec3<u32>(bits.x + nearest * bits.z, bits.y, bits.z + nearest * (bits.y * SCATTERER_STRIDE));
    return CellScatterer(words, ahead_mm);
}

// Echo of the scatterers where the sample's elevational line meets the sheets: see crates/render/src/sheets.rs.
fn sheets_echo(position: Position, strength: Strength, per_reach_mm: f32) -> vec2<f32> {
    let steps = 1.0 / max(dot(position.step, position.step), 1.0e-12);
    var sum = vec2<f32>(0.0);
    for (var k = 0u; k < params.sheet_families; k++) {
        let family = params.sheets[k];
        let per_cell = 1.0 / family.cell_mm;
        let across = dot(family.normal.xyz, position.here) / params.sheet_spacing_mm;
        let in_sheet = vec2<f32>(dot(family.first.xyz, position.here), dot(family.second.xyz, position.here)) * per_cell;
        // From one sheet to the next along the elevational line: displacement in cells. Then mm of range per cell.
        let drift = vec2<f32>(family.first.w, family.second.w) * (params.sheet_spacing_mm * per_cell);
        let rate = vec2<f32>(dot(family.first.xyz, position.step), dot(family.second.xyz, position.step)) * (steps * family.cell_mm);
        let lowest = i32(floor(across - 0.5 * f32(SHEETS))) + 1;
        var echo = vec2<f32>(0.0);
        var squares = 0.0;
        for (var i = 0; i < i32(SHEETS); i++) {
            let sheet = lowest + i;
            let off = f32(sheet) - across;
            let y = off * (params.sheet_spacing_mm * family.normal.w) * per_reach_mm;
            let bell = max(1.0 - y * y, 0.0);
            let weight = bell * bell;
            let met = in_sheet + off * drift;
            let cell = vec2<i32>(floor(met));
            let bits = sheet_hash(vec3<i32>(cell, sheet + i32(family.salt)));
            let corner = vec2<f32>(cell) - met;
            var scatterer = CellScatterer(bits, dot(corner + sheet_offset(bits.y), rate));
            if family.cell_scatterers > 1u {
                scatterer = nearest_scatterer(family.cell_scatterers, bits, corner, rate);
            }
            echo += weight * scatterer_echo(scatterer.bits, scatterer.ahead_mm, position, strength);
            squares += weight * weight;
        }
        sum += family.share / sqrt(max(squares, 1.0e-12)) * echo;
    }
    return sum;
}
