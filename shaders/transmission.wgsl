// Transmission of the scan plane: what each cell of each interval lets pass, from the loss along the paths.
// Out: [planes × cells] over the greatest of each row, and the loss of that greatest one, one-way nepers [planes].
// A workgroup per plane.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<vec4<f32>>;
@group(0) @binding(3) var<uniform> aperture: Aperture;
// Rays of each cell: the first, the distance to the next, their number, and the parts of the first and of the last ray
// within the cell.
@group(0) @binding(4) var<storage, read> cell_rays: array<vec4<u32>>;
// Between batches: mean over the layers of the fourth power of the transmission.
@group(0) @binding(5) var<storage, read_write> transmissions: array<f32>;
@group(0) @binding(6) var<storage, read_write> row_np: array<f32>;

const THREADS: u32 = 64u;

var<workgroup> greatest: array<f32, THREADS>;

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

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let plane = group.x;
    let begins = params.layer_first == 0u;
    let ends = params.layer_first + params.layer_count == params.layers;
    let from_mm = f32(plane) * aperture.plane_mm;
    let to_mm = f32(plane + 1u) * aperture.plane_mm;
    var best = TRANSMISSION_MIN;
    for (var cell = local.x; cell < aperture.cells; cell += THREADS) {
        let rays = cell_rays[cell];
        let parts = unpack2x16unorm(rays.w);
        var power = 0.0;
        for (var layer = 0u; layer < params.layer_count; layer++) {
            var sum = 0.0;
            var total = 0.0;
            for (var ray = 0u; ray < rays.z; ray++) {
                let line_ray = rays.x + ray * rays.y;
                let path = layer * params.scanlines * params.rays + line_ray;
                let guide = guide_of(line_ray / params.rays);
                let lost = path_loss(path, guide, to_mm) - path_loss(path, guide, from_mm);
                let weight = select(1.0, parts.x, ray == 0u) * select(1.0, parts.y, ray + 1u == rays.z);
                sum += weight * exp(-clamp(lost, 0.0, 80.0));
                total += weight;
            }
            // Powers of layers add, on both ways.
            let mean = sum / total;
            power += (mean * mean) * (mean * mean) / f32(params.layers);
        }
        let at = plane * aperture.cells + cell;
        var value = power + select(transmissions[at], 0.0, begins);
        if ends {
            value = sqrt(sqrt(value));
            best = max(best, value);
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
        transmissions[plane * aperture.cells + cell] *= 1.0 / best;
    }
    if local.x == 0u {
        row_np[plane] = -log(best);
    }
}
