// The Σμ below which BRIGHTEST_PART of the sector's area lies: e^(−Σμ) is the attenuation's 98th percentile. Bisects Σμ
// by the area in front of it, which works since Σμ never falls along a ray. One workgroup.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> entries: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> entry_counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> percentile: array<f32>;

const THREADS: u32 = 256u;

var<workgroup> partial: array<f32, THREADS>;

// Area of a map ray's strip up to depth t, in arbitrary units.
fn area(t: f32) -> f32 {
    if params.face_radius_mm < 0.0 {
        return t;
    }
    return t * (0.5 * t + params.face_radius_mm);
}

// Depth on a map ray at which Σμ exceeds `limit`.
fn reach(ray: u32, limit: f32) -> f32 {
    let count = entry_counts[ray];
    for (var i = 0u; i < count; i++) {
        let entry = entries[ray * ENTRIES + i];
        var end = params.depth_mm;
        if i + 1u < count {
            end = entries[ray * ENTRIES + i + 1u].x;
        }
        if entry.y + entry.z * (end - entry.x) > limit {
            return clamp(entry.x + (limit - entry.y) / max(entry.z, 1.0e-30), entry.x, end);
        }
    }
    return params.depth_mm;
}

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32) {
    var low = 0.0;
    var high = 1.0e4;
    let wanted = BRIGHTEST_PART * area(params.depth_mm) * f32(params.map_rays);
    for (var step = 0u; step < PERCENTILE_STEPS; step++) {
        let middle = select(0.5 * (low + high), sqrt(max(low, 1.0e-6) * high), step < 14u);
        var sum = 0.0;
        for (var ray = thread; ray < params.map_rays; ray += THREADS) {
            sum += area(reach(ray, middle));
        }
        partial[thread] = sum;
        workgroupBarrier();
        for (var width = THREADS / 2u; width > 0u; width >>= 1u) {
            if thread < width {
                partial[thread] += partial[thread + width];
            }
            workgroupBarrier();
        }
        let total = partial[0];
        workgroupBarrier();
        if total > wanted {
            high = middle;
        } else {
            low = middle;
        }
    }
    if thread == 0u {
        percentile[0] = 0.5 * (low + high);
    }
}
