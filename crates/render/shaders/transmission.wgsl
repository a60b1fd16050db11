// Transmission and delay of each cell in each depth interval of the scan plane, from loss and speed along the paths.
// Out: transmission relative to the greatest one in the interval [planes × cells], and the loss of that one, one-way
// nepers [planes]. The phase of a transmission is the delay relative to the middle cell. A thread per cell, then a
// workgroup per depth plane.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;
@group(0) @binding(3) var<uniform> aperture: Aperture;
// Rays that cross each cell: the first one, the step to the next, their number, and the fractions of the first and last
// ray that lie in the cell.
@group(0) @binding(4) var<storage, read> cell_rays: array<vec4<u32>>;
// Between batches: means over the layers of the transmission's fourth power, and of the delay in mm.
@group(0) @binding(5) var<storage, read_write> transmissions: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> row_np: array<f32>;
@group(0) @binding(7) var<storage, read> rays: array<vec4<f32>>;
// Between batches of scanlines of one layer: sums over the rays of each cell.
@group(0) @binding(8) var<storage, read_write> partial_sums: array<vec2<f32>>;

// Whether this is the second dispatch of a frame, which takes out what the cells of an interval share.
override ROWS: bool = false;

const THREADS: u32 = 64u;

var<workgroup> greatest: array<f32, THREADS>;

// Index of the segment that contains a range, or of the first one after a reflection. The search starts at segment
// `first`.
fn own_segment(path: u32, first: u32, range_mm: f32) -> u32 {
    var at = first;
    while starts[path * STARTS + at + 1u] <= range_mm && !has_reflected(path, at) {
        at++;
    }
    return at;
}

// Loss of a path from the face to a range on its segment `at`. From its first reflection on, it rises as that of its
// scanline's axial path. What the face does not couple is lost in the first interval.
fn path_loss(path: u32, axial_path: u32, at: u32, range_mm: f32) -> f32 {
    if range_mm == 0.0 {
        return 0.0;
    }
    if !has_reflected(path, at) {
        return loss_on(path, at, range_mm);
    }
    let reflected_mm = starts[path * STARTS + at];
    let reflected_np = -0.5 * segments[path * SEGMENTS + at].ln_passed_at_zero;
    let before = segment_from(axial_path, 0u, reflected_mm);
    let here = segment_from(axial_path, before, max(range_mm, reflected_mm));
    return reflected_np + (loss_on(axial_path, here, range_mm) - loss_on(axial_path, before, reflected_mm));
}

// Delay of a segment, mm per mm of range: 1 less its path per depth. It is 0 in hard media, which sound goes past.
fn delay_rate(path: u32, at: u32, stretch: f32) -> f32 {
    let rate = 1.0 - length(segments[path * SEGMENTS + at].step) / stretch;
    return select(0.0, rate, abs(rate) >= DELAY_MIN && abs(rate) <= HARD_SPEED);
}

// In x, the delay of a path between two ranges, mm, from segment `first` on. Unless `follow`, it ends at the first
// reflection. In y, the range where it ends, at most `to_mm`.
fn delay_between(path: u32, stretch: f32, first: u32, from_mm: f32, to_mm: f32, follow: bool) -> vec2<f32> {
    var late_mm = 0.0;
    var at = first;
    var low = from_mm;
    if has_reflected(path, at) && !follow {
        return vec2<f32>(0.0, from_mm);
    }
    while starts[path * STARTS + at + 1u] <= to_mm {
        late_mm += (starts[path * STARTS + at + 1u] - low) * delay_rate(path, at, stretch);
        at++;
        low = starts[path * STARTS + at];
        if has_reflected(path, at) && !follow {
            return vec2<f32>(late_mm, low);
        }
    }
    return vec2<f32>(late_mm + (to_mm - low) * delay_rate(path, at, stretch), to_mm);
}

// Delay of a path between two ranges, mm, from its segment `at` on. From its first reflection on, it rises as that of
// its scanline's axial path.
fn path_delay(path: u32, axial_path: u32, at: u32, from_mm: f32, to_mm: f32) -> f32 {
    let own = delay_between(path, elevation_of(path).z, at, from_mm, to_mm, false);
    if own.y >= to_mm {
        return own.x;
    }
    return own.x + delay_between(axial_path, 1.0, segment_from(axial_path, 0u, own.y), own.y, to_mm, true).x;
}

// Sums over the rays of a cell in one layer: transmission, delay in mm, and weights. `before` holds the first two sums
// over earlier batches of scanlines.
fn ray_sums(cell: u32, layer: u32, from_mm: f32, to_mm: f32, before: vec2<f32>) -> vec3<f32> {
    let of_cell = cell_rays[cell];
    let parts = unpack2x16unorm(of_cell.w);
    let here = params.line_count * params.rays;
    var sum = before.x;
    var late = before.y;
    var total = 0.0;
    for (var ray = 0u; ray < of_cell.z; ray++) {
        let line_ray = of_cell.x + ray * of_cell.y;
        let weight = select(1.0, parts.x, ray == 0u) * select(1.0, parts.y, ray + 1u == of_cell.z);
        total += weight;
        let of_batch = line_ray - params.line_first * params.rays;
        // For scanlines before the batch, the difference wraps to a large number.
        if of_batch >= here {
            continue;
        }
        let path = layer * here + of_batch;
        let axial_path = axial_path_of(line_ray / params.rays);
        let first = own_segment(path, 0u, from_mm);
        let last = own_segment(path, first, to_mm);
        let lost = path_loss(path, axial_path, last, to_mm) - path_loss(path, axial_path, first, from_mm);
        sum += weight * exp(-clamp(lost, 0.0, 80.0));
        if aperture.turns_per_mm > 0.0 {
            late += weight * path_delay(path, axial_path, first, from_mm, to_mm);
        }
    }
    return vec3<f32>(sum, late, total);
}

// Adds the layers of this batch to the means of a cell.
fn add_layers(plane: u32, cell: u32) {
    let from_mm = f32(plane) * aperture.plane_mm;
    let to_mm = f32(plane + 1u) * aperture.plane_mm;
    let at = plane * aperture.cells + cell;
    let lines_end = params.line_first + params.line_count == params.scanlines;
    var means = vec2<f32>(0.0);
    if params.layer_first > 0u {
        means = transmissions[at];
    }
    for (var layer = 0u; layer < params.layer_count; layer++) {
        var before = vec2<f32>(0.0);
        if params.line_first > 0u {
            before = partial_sums[at];
        }
        let sums = ray_sums(cell, layer, from_mm, to_mm, before);
        if !lines_end {
            partial_sums[at] = sums.xy;
            return;
        }
        // Two-way powers of the layers are averaged: fourth powers of the transmission.
        let mean = sums.x / sums.z;
        means.x += (mean * mean) * (mean * mean) / f32(params.layers);
        means.y += sums.y / (sums.z * f32(params.layers));
    }
    let ends = params.layer_first + params.layer_count == params.layers;
    transmissions[at] = vec2<f32>(select(means.x, sqrt(sqrt(means.x)), ends), means.y);
}

// Divides the transmissions of a depth interval by the greatest one, and turns delays into phases.
fn finish_row(plane: u32, thread: u32) {
    let row = plane * aperture.cells;
    var best = TRANSMISSION_MIN;
    for (var cell = thread; cell < aperture.cells; cell += THREADS) {
        best = max(best, transmissions[row + cell].x);
    }
    greatest[thread] = best;
    let middle_mm = transmissions[row + aperture.cells / 2u].y;
    workgroupBarrier();
    for (var i = 0u; i < THREADS; i++) {
        best = max(best, greatest[i]);
    }
    // From here on, every thread has read the middle cell.
    storageBarrier();
    for (var cell = thread; cell < aperture.cells; cell += THREADS) {
        let value = transmissions[row + cell];
        transmissions[row + cell] = value.x * (1.0 / best) * phasor(aperture.turns_per_mm * (value.y - middle_mm));
    }
    if thread == 0u {
        row_np[plane] = -log(best);
    }
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if ROWS {
        finish_row(group.x, thread);
        return;
    }
    let plane = group.x;
    let cell = group.y * THREADS + thread;
    if cell >= aperture.cells {
        return;
    }
    add_layers(plane, cell);
}
