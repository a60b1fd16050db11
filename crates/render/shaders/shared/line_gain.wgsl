// Aperture gain at samples and interfaces of a scanline, from the outputs of `visibility`.

// A depth interval of a scanline, with a depth plane in its middle.
struct Interval {
    // Positions among the depth planes at the interval's start and end.
    start: f32,
    end: f32,
    // Loss from the face to the interval's start, loss within it, and the part of the latter that all scanlines share;
    // one-way nepers.
    begins_np: f32,
    total_np: f32,
    row_np: f32,
    // Loss that all scanlines share, from the face to the interval's start, one-way nepers.
    shared_np: f32,
}

fn interval_at(line: u32, index: u32) -> Interval {
    let row = line * (aperture.planes + 1u) + index;
    let a = line_gains[row];
    let b = line_gains[row + 1u];
    return Interval(a.x, b.x, a.y, b.y - a.y, b.w - a.w, a.w);
}

// Loss of a scanline within an interval, beyond the loss that all scanlines share, one-way nepers.
fn own_np(interval: Interval) -> f32 {
    return max(interval.total_np - interval.row_np, 0.0);
}

// Fraction of an interval's loss that has occurred at the fraction `part` of its depth. `loss_np` is the loss from the
// face to that depth.
fn lost_part(interval: Interval, part: f32, loss_np: f32) -> f32 {
    return clamp((loss_np - interval.begins_np + EVEN_NP * part) / (max(interval.total_np, 0.0) + EVEN_NP), 0.0, 1.0);
}

// Position among the depth planes at the fractions `part` of an interval's depth and `lost` of its loss.
fn position_within(interval: Interval, part: f32, lost: f32) -> f32 {
    let own = own_np(interval);
    let done = (own * lost + SPREAD_NP * part) / (own + SPREAD_NP);
    return interval.start + done * (interval.end - interval.start);
}

// Index of the depth interval that contains a range.
fn interval_index(range_mm: f32) -> u32 {
    return min(u32(max(range_mm / aperture.plane_mm, 0.0)), aperture.planes - 1u);
}

// ln of the aperture gain at a position among the depth planes; −1 is the face.
fn gain_at(line: u32, position: f32) -> f32 {
    let at = clamp(position + 1.0, 0.0, f32(aperture.planes));
    let low = min(u32(at), aperture.planes - 1u);
    let row = line * (aperture.planes + 1u) + low;
    return mix(line_gains[row].z, line_gains[row + 1u].z, at - f32(low));
}

// Position among the depth planes, of scatterers at a range that the scanline reaches with a loss of `loss_np`.
fn position_of(line: u32, range_mm: f32, loss_np: f32) -> f32 {
    let index = interval_index(range_mm);
    let interval = interval_at(line, index);
    let part = range_mm / aperture.plane_mm - f32(index);
    return position_within(interval, part, lost_part(interval, part, loss_np));
}

// ln of the two-way amplitude of scatterers at a range that the scanline reaches with a loss of `loss_np`.
fn scatterer_gain_at(line: u32, range_mm: f32, loss_np: f32) -> f32 {
    let index = interval_index(range_mm);
    let interval = interval_at(line, index);
    let part = range_mm / aperture.plane_mm - f32(index);
    let lost = lost_part(interval, part, loss_np);
    return gain_at(line, position_within(interval, part, lost)) - 2.0 * (interval.shared_np + interval.row_np * lost);
}
