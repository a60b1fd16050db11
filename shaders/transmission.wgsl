// Transmission of the scan plane: what each cell of each interval lets pass, and by how much it delays it, from the loss
// and the speed along the paths.
// Out: transmission over the greatest of each row, with the phase of the delay against the middle cell [planes × cells];
// loss of that greatest one, one-way nepers [planes]. A workgroup per plane.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<vec4<f32>>;
@group(0) @binding(3) var<uniform> aperture: Aperture;
// Rays of each cell: the first, the distance to the next, their number, and the parts of the first and of the last ray
// within the cell.
@group(0) @binding(4) var<storage, read> cell_rays: array<vec4<u32>>;
// Between batches: means over the layers of the fourth power of the transmission, and of the delay in mm.
@group(0) @binding(5) var<storage, read_write> transmissions: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> row_np: array<f32>;
@group(0) @binding(7) var<storage, read> rays: array<vec4<f32>>;

const THREADS: u32 = 64u;

var<workgroup> greatest: array<f32, THREADS>;
var<workgroup> middle_mm: f32;

// Loss of a path at a range; from its first reflection on, it rises as that of its scanline's guide. What the face does
// not couple is lost in the first interval.
fn path_loss(path: u32, guide: u32, range_mm: f32) -> f32 {
    if range_mm == 0.0 {
        return 0.0;
    }
    var at = 0u;
    while starts[path * STARTS + at + 1u] <= range_mm && !diverted(path, at) {
        at++;
    }
    if !diverted(path, at) {
        return loss_on(path, at, range_mm);
    }
    let reflected_mm = starts[path * STARTS + at];
    let reflected_np = -0.5 * segments[3u * (path * SEGMENTS + at) + 2u].w;
    let before = segment_from(guide, 0u, reflected_mm);
    let here = segment_from(guide, before, max(range_mm, reflected_mm));
    return reflected_np + (loss_on(guide, here, range_mm) - loss_on(guide, before, reflected_mm));
}

// Range that a segment gains over depth, mm per mm of range: 0 in hard media, which sound has passed beside.
fn delay_rate(path: u32, at: u32, stretch: f32) -> f32 {
    let rate = 1.0 - length(segments[3u * (path * SEGMENTS + at) + 1u].xyz) / stretch;
    return select(0.0, rate, abs(rate) >= DELAY_MIN && abs(rate) <= HARD_SPEED);
}

// Range less depth that a path gains between two ranges, mm, up to its first reflection; that one's range in y, else `to`.
fn delay_between(path: u32, stretch: f32, from_mm: f32, to_mm: f32, follow: bool) -> vec2<f32> {
    var late_mm = 0.0;
    var at = segment_from(path, 0u, from_mm);
    var low = from_mm;
    if diverted(path, at) && !follow {
        return vec2<f32>(0.0, from_mm);
    }
    while starts[path * STARTS + at + 1u] <= to_mm {
        late_mm += (starts[path * STARTS + at + 1u] - low) * delay_rate(path, at, stretch);
        at++;
        low = starts[path * STARTS + at];
        if diverted(path, at) && !follow {
            return vec2<f32>(late_mm, low);
        }
    }
    return vec2<f32>(late_mm + (to_mm - low) * delay_rate(path, at, stretch), to_mm);
}

// Delay of a path between two ranges, mm; from its first reflection on, it rises as that of its scanline's guide.
fn path_delay(path: u32, guide: u32, from_mm: f32, to_mm: f32) -> f32 {
    let own = delay_between(path, elevation_of(path).z, from_mm, to_mm, false);
    if own.y >= to_mm {
        return own.x;
    }
    return own.x + delay_between(guide, 1.0, own.y, to_mm, true).x;
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let plane = group.x;
    let begins = params.layer_first == 0u;
    let ends = params.layer_first + params.layer_count == params.layers;
    let from_mm = f32(plane) * aperture.plane_mm;
    let to_mm = f32(plane + 1u) * aperture.plane_mm;
    var best = TRANSMISSION_MIN;
    for (var cell = local.x; cell < aperture.cells; cell += THREADS) {
        let of_cell = cell_rays[cell];
        let parts = unpack2x16unorm(of_cell.w);
        var power = 0.0;
        var late_mm = 0.0;
        for (var layer = 0u; layer < params.layer_count; layer++) {
            var sum = 0.0;
            var late = 0.0;
            var total = 0.0;
            for (var ray = 0u; ray < of_cell.z; ray++) {
                let line_ray = of_cell.x + ray * of_cell.y;
                let path = layer * params.scanlines * params.rays + line_ray;
                let guide = guide_of(line_ray / params.rays);
                let lost = path_loss(path, guide, to_mm) - path_loss(path, guide, from_mm);
                let weight = select(1.0, parts.x, ray == 0u) * select(1.0, parts.y, ray + 1u == of_cell.z);
                sum += weight * exp(-clamp(lost, 0.0, 80.0));
                if aperture.turns_per_mm > 0.0 {
                    late += weight * path_delay(path, guide, from_mm, to_mm);
                }
                total += weight;
            }
            // Powers of layers add, on both ways.
            let mean = sum / total;
            power += (mean * mean) * (mean * mean) / f32(params.layers);
            late_mm += late / (total * f32(params.layers));
        }
        let at = plane * aperture.cells + cell;
        var value = vec2<f32>(power, late_mm) + select(transmissions[at], vec2<f32>(0.0), begins);
        if ends {
            value.x = sqrt(sqrt(value.x));
            best = max(best, value.x);
        }
        if cell == aperture.cells / 2u {
            middle_mm = value.y;
        }
        transmissions[at] = value;
    }
    if !ends {
        return;
    }
    greatest[local.x] = best;
    workgroupBarrier();
    for (var i = 0u; i < THREADS; i++) {
        best = max(best, greatest[i]);
    }
    for (var cell = local.x; cell < aperture.cells; cell += THREADS) {
        let at = plane * aperture.cells + cell;
        let value = transmissions[at];
        transmissions[at] = value.x * (1.0 / best) * phasor(aperture.turns_per_mm * (value.y - middle_mm));
    }
    if local.x == 0u {
        row_np[plane] = -log(best);
    }
}
