// The aperture's gain at samples and interfaces of a scanline, from the outputs of `visibility`.

// An interval of a scanline.
struct Interval {
    // Places among the planes at its ends.
    start: f32,
    end: f32,
    // Loss at its start, loss of its row, and the scanline's own loss in it; one-way nepers.
    begins_np: f32,
    row_np: f32,
    own_np: f32,
    // Loss that all scanlines share, at its start.
    shared_np: f32,
}

fn interval_at(line: u32, index: u32) -> Interval {
    let row = line * (aperture.planes + 1u) + index;
    let a = line_gains[row];
    let b = line_gains[row + 1u];
    let row_np = b.w - a.w;
    return Interval(a.x, b.x, a.y, row_np, max(b.y - a.y - row_np, 0.0), a.w);
}

// Index of the interval that holds a range.
fn interval_index(range_mm: f32) -> u32 {
    return min(u32(max(range_mm / aperture.plane_mm, 0.0)), aperture.planes - 1u);
}

// Gain at a place among the planes, −1 being the face.
fn gain_at(line: u32, place: f32) -> f32 {
    let at = clamp(place + 1.0, 0.0, f32(aperture.planes));
    let low = min(u32(at), aperture.planes - 1u);
    let row = line * (aperture.planes + 1u) + low;
    return mix(line_gains[row].z, line_gains[row + 1u].z, at - f32(low));
}

// ln of the amplitude, two-way, where `loss_np` is lost at a part of an interval.
fn gain_within(line: u32, interval: Interval, part: f32, loss_np: f32) -> f32 {
    let lost_np = loss_np - interval.begins_np - interval.row_np * part + SPREAD_NP * part;
    let done = clamp(lost_np / (interval.own_np + SPREAD_NP), 0.0, 1.0);
    let place = interval.start + done * (interval.end - interval.start);
    return gain_at(line, place) - 2.0 * (interval.shared_np + interval.row_np * part);
}

// ln of the amplitude, two-way, of scatterers at a range that the scanline reaches with a loss of `loss_np`.
fn scatterer_gain_at(line: u32, range_mm: f32, loss_np: f32) -> f32 {
    let index = interval_index(range_mm);
    return gain_within(line, interval_at(line, index), range_mm / aperture.plane_mm - f32(index), loss_np);
}
