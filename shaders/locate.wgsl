// Surfaces that each path starts inside.
// In: ray table, BVH. Out: eight words of surface bits per path.
// One thread per path: rays fastest, then scanlines, then layers; then the guides.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> surface_tissue: array<u32>;
@group(0) @binding(4) var<storage, read> rays: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> starts_inside: array<u32>;
@group(0) @binding(6) var<storage, read_write> overflows: array<atomic<u32>>;

const CROSSINGS: u32 = CROSSINGS_BEHIND;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let path = id.x;
    if path >= params.scanlines * params.rays * params.layer_count + params.guides {
        return;
    }
    let ray = launch(path);
    collect(ray.origin, ray.direction, -params.reach_mm, 0.0);
    for (var i = 0u; i < crossing_count;) {
        i = cross_place(i);
    }
    if crossing_lost > 0u {
        atomicAdd(&overflows[0], crossing_lost);
    }
    for (var word = 0u; word < 8u; word++) {
        starts_inside[path * 8u + word] = inside[word];
    }
}
