// The aperture's gain at samples and interfaces of a scanline, from the outputs of `visibility`.

// An interval of a scanline.
struct Interval {
    // Positions among the planes at its ends.
    start: f32,
    end: f32,
    // Loss at its start, loss in it, and the part of that which its row shares; one-way nepers.
    begins_np: f32,
    total_np: f32,
    row_np: f32,
    // Loss that all scanlines share, at its start.
    shared_np: f32,
}

fn interval_at(line: u32, index: u32) -> Interval {
    let row = line * (aperture.planes + 1u) + index;
    let a = line_gains[row];
    let b = line_gains[row + 1u];
    return Interval(a.x, b.x, a.y, b.y - a.y, b.w - a.w, a.w);
}

// The scanline's loss in an interval beyond its row's, one-way nepers.
fn own_np(interval: Interval) -> f32 {
    return max(interval.total_np - interval.row_np, 0.0);
}

// Part of an interval's loss that has been lost where `loss_np` is lost at a part of its depth.
fn lost_part(interval: Interval, part: f32, loss_np: f32) -> f32 {
    return clamp((loss_np - interval.begins_np + EVEN_NP * part) / (max(interval.total_np, 0.0) + EVEN_NP), 0.0, 1.0);
}

// Position among the planes at a part of an interval's depth and of its loss.
fn position_within(interval: Interval, part: f32, lost: f32) -> f32 {
    let own = own_np(interval);
    let done = (own * lost + SPREAD_NP * part) / (own + SPREAD_NP);
    return interval.start + done * (interval.end - interval.start);
}

// Index of the interval that holds a range.
fn interval_index(range_mm: f32) -> u32 {
    return min(u32(max(range_mm / aperture.plane_mm, 0.0)), aperture.planes - 1u);
}

// Gain at a position among the planes, −1 being the face.
fn gain_at(line: u32, position: f32) -> f32 {
    let at = clamp(position + 1.0, 0.0, f32(aperture.planes));
    let low = min(u32(at), aperture.planes - 1u);
    let row = line * (aperture.planes + 1u) + low;
    return mix(line_gains[row].z, line_gains[row + 1u].z, at - f32(low));
}

// Position among the planes of scatterers at a range that the scanline reaches with a loss of `loss_np`.
fn position_of(line: u32, range_mm: f32, loss_np: f32) -> f32 {
    let index = interval_index(range_mm);
    let interval = interval_at(line, index);
    let part = range_mm / aperture.plane_mm - f32(index);
    return position_within(interval, part, lost_part(interval, part, loss_np));
}

// ln of the amplitude, two-way, of scatterers at a range that the scanline reaches with a loss of `loss_np`.
fn scatterer_gain_at(line: u32, range_mm: f32, loss_np: f32) -> f32 {
    let index = interval_index(range_mm);
    let interval = interval_at(line, index);
    let part = range_mm / aperture.plane_mm - f32(index);
    let lost = lost_part(interval, part, loss_np);
    return gain_at(line, position_within(interval, part, lost)) - 2.0 * (interval.shared_np + interval.row_np * lost);
}
