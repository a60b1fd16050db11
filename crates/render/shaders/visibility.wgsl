// Gain along each scanline: what the aperture sees of the scatterers at a depth, relative to a medium without loss.
// Out, at each boundary of the depth intervals [scanlines × (planes + 1)]: position among the depth planes; loss of the
// axial path; gain at the plane before; loss that all scanlines share. Losses are in one-way nepers, the gain is in
// nepers of two-way amplitude. A thread per scanline.
//
// The position of a scanline among the depth planes follows its own loss. Before an obstacle it stays at the plane
// before it, and beyond the obstacle at the plane beyond, wherever in an interval the obstacle lies.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;
@group(0) @binding(3) var<uniform> aperture: Aperture;
// Lateral position of each scanline, in cells.
@group(0) @binding(4) var<storage, read> line_cells: array<f32>;
@group(0) @binding(5) var<storage, read> powers: array<f32>;
@group(0) @binding(6) var<storage, read> row_np: array<f32>;
@group(0) @binding(7) var<storage, read_write> line_gains: array<vec4<f32>>;
// Gain (as an amplitude) of each block of samples, and its position among the depth planes [scanlines × blocks].
@group(0) @binding(8) var<storage, read_write> block_gains: array<vec2<f32>>;

fn node_root(plane: u32, node: u32) -> f32 {
    return sqrt(sqrt(max(powers[plane * aperture.cells + node], VISIBLE_MIN)));
}

// ln of the gain of a scanline at a depth plane, interpolated between the beams. The fourth root of the power is
// interpolated: it follows the edge of a shadow better than the power or its logarithm.
fn plane_gain(line: u32, plane: u32) -> f32 {
    let node_cells = node_cells_at(plane);
    let node = clamp(line_cells[line] / f32(node_cells), 0.0, f32(aperture.cells / node_cells) - 1.001);
    let low = u32(node);
    let between = mix(node_root(plane, low), node_root(plane, low + 1u), node - f32(low));
    return min(2.0 * log(between), VISIBLE_MAX_NP);
}

@compute @workgroup_size(16)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.x;
    if line >= params.scanlines {
        return;
    }
    let axial_path = axial_path_of(line);
    let row = line * (aperture.planes + 1u);
    var at = 0u;
    var begins_np = loss_on(axial_path, 0u, 0.0);
    var shared_np = 0.0;
    // Where in its interval the latest loss occurred, 0..1.
    var last = 0.5;
    line_gains[row] = vec4<f32>(-0.5, begins_np, max(-2.0 * begins_np, VISIBLE_MIN_NP), 0.0);
    for (var interval = 0u; interval < aperture.planes; interval++) {
        let from_mm = f32(interval) * aperture.plane_mm;
        let to_mm = f32(interval + 1u) * aperture.plane_mm;
        // Integral of the loss over the interval, by trapezoids between segment starts.
        var low = from_mm;
        var area = 0.0;
        while low < to_mm {
            at = segment_from(axial_path, at, low);
            let high = min(starts[axial_path * STARTS + at + 1u], to_mm);
            area += 0.5 * (loss_on(axial_path, at, low) + loss_on(axial_path, at, high) - 2.0 * begins_np) * (high - low);
            low = high;
        }
        at = segment_from(axial_path, at, to_mm);
        let ends_np = loss_on(axial_path, at, to_mm);
        let own_np = max(ends_np - begins_np - row_np[interval], 0.0);
        let followed = own_np / (own_np + TRACKED_NP);
        let mean_np = area / aperture.plane_mm - 0.5 * row_np[interval];
        let centre = clamp(1.0 - mean_np / max(own_np, 1.0e-6), 0.0, 1.0);
        last = mix(last, centre, followed);
        shared_np += row_np[interval];
        begins_np = ends_np;
        let position = f32(interval + 1u) - (1.0 - followed) * last;
        line_gains[row + interval + 1u] = vec4<f32>(position, ends_np, plane_gain(line, interval), shared_np);
    }
    at = 0u;
    let blocks = params.row_samples >> BLOCK_SHIFT;
    for (var block = 0u; block < blocks; block++) {
        // The gain at the block's first sample: an interface within the block counts as not yet crossed.
        let range_mm = (f32(block << BLOCK_SHIFT) + 0.5) * params.sample_spacing_mm;
        at = segment_from(axial_path, at, range_mm);
        let position = position_of(line, range_mm, loss_on(axial_path, at, range_mm));
        block_gains[line * blocks + block] = vec2<f32>(exp(gain_at(line, position)), position);
    }
}
