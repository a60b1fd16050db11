// Media along straight map rays: the cross-section of the surfaces, and the attenuation from the face.
// Out: for each map ray, up to ENTRIES runs, which are stretches of one medium [start mm, one-way Σμ at the start in
// nepers, μ in nepers/mm, tissue].
// Out: one raster word per map_step_mm of depth. It holds Σμ as f32 without its sign and lowest 8 bits, the bit WHOLE
// if the run reaches the next depth, and the tissue in the lowest 8 bits.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> surface_tissue: array<u32>;
@group(0) @binding(4) var<storage, read> map_rays: array<vec4<f32>>;
@group(0) @binding(5) var<uniform> tissues: array<Tissue, TISSUES_MAX>;
@group(0) @binding(6) var<storage, read_write> entries: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> entry_counts: array<u32>;
@group(0) @binding(8) var<storage, read_write> overflows: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> raster: array<u32>;

const CROSSINGS: u32 = CROSSINGS_OF_A_MAP_RAY;

// Threads started for each one that traces a map ray: idle threads between them save waiting within a subgroup.
override LANES_APART: u32 = 1u;

// Whether this is the second dispatch of a frame, which makes the raster from the runs; a thread makes DEPTHS words.
override RASTER: bool = false;
override DEPTHS: u32 = 1u;

const THREADS: u32 = 32u;

// Number of runs of a ray that end at or before a depth.
fn runs_before(ray: u32, at_mm: f32) -> u32 {
    var low = 0u;
    var high = entry_counts[ray] - 1u;
    while low < high {
        let middle = (low + high) >> 1u;
        if entries[ray * ENTRIES + middle + 1u].x <= at_mm {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

fn rasterise(index: u32) {
    let parts = (params.map_depths + DEPTHS - 1u) / DEPTHS;
    let ray = index / parts;
    if ray >= params.map_rays {
        return;
    }
    var depth = index % parts * DEPTHS;
    let limit = min(depth + DEPTHS, params.map_depths);
    var run = runs_before(ray, f32(depth) * params.map_step_mm);
    while depth < limit {
        let entry = entries[ray * ENTRIES + run];
        // The last run extends beyond every depth.
        var end = 2.0 * params.depth_mm + 1.0;
        if run + 1u < entry_counts[ray] {
            end = entries[ray * ENTRIES + run + 1u].x;
        }
        let id = bitcast<u32>(entry.w) & TISSUE_MASK;
        loop {
            let at_mm = f32(depth) * params.map_step_mm;
            if at_mm >= end || depth >= limit {
                break;
            }
            let sum = entry.y + entry.z * (at_mm - entry.x);
            let whole = select(0u, WHOLE, at_mm + params.map_step_mm < end);
            raster[ray * params.map_depths + depth] = (bitcast<u32>(max(sum, 0.0)) << 1u & 0xfffffe00u) | whole | id;
            depth++;
        }
        run++;
    }
}

fn cut(ray: u32) {
    let origin = scene_from_probe_point(map_rays[2u * ray].xyz);
    let direction = normalize(scene_from_probe_vector(map_rays[2u * ray + 1u].xyz));
    collect(origin, direction, -params.reach_mm, params.depth_mm);

    var i = 0u;
    while i < crossing_count && crossing_t[i] <= 0.0 {
        i = cross_coincident(i);
    }
    // If the ray's part of the face is not coupled, the whole ray is in air.
    let down = dot(direction, params.axial.xyz);
    let ahead_mm = crossing_t[min(i, CROSSINGS - 1u)];
    let coupled = coupling_of(map_rays[2u * ray].z, down, ahead_mm, i >= crossing_count) >= COUPLED_MIN;
    crossing_count = select(0u, crossing_count, coupled);
    here_depth_mm = map_rays[2u * ray].z;
    var here = select(params.beyond, medium(), coupled);
    var start = 0.0;
    var sum_np = 0.0;
    var rate = ONE_WAY * tissues[here].attenuation_np_mm;
    var count = 0u;
    var lost = crossing_lost;
    entries[ray * ENTRIES] = vec4<f32>(0.0, 0.0, rate, bitcast<f32>(TAG | here));
    count = 1u;
    while i < crossing_count {
        let t = crossing_t[i];
        i = cross_coincident(i);
        here_depth_mm = map_rays[2u * ray].z + down * t;
        let there = medium();
        if there != here {
            sum_np += rate * (t - start);
            start = t;
            here = there;
            rate = ONE_WAY * tissues[here].attenuation_np_mm;
            if count < ENTRIES {
                entries[ray * ENTRIES + count] = vec4<f32>(start, sum_np, rate, bitcast<f32>(TAG | here));
                count++;
            } else {
                lost++;
            }
        }
    }
    entry_counts[ray] = count;
    if lost > 0u {
        atomicAdd(&overflows[0], lost);
    }
}

@compute @workgroup_size(32)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    if RASTER {
        rasterise(id.y * groups.x * THREADS + id.x);
        return;
    }
    let ray = id.x / LANES_APART;
    if id.x % LANES_APART == 0u && ray < params.map_rays {
        cut(ray);
    }
}
