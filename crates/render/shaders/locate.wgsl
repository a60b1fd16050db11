// Surfaces that each path starts inside, and the coupling of its part of the face.
// In: ray table, BVH. Out: eight words of surface bits per path, and the one-way amplitude that the face passes. One
// thread per path: rays fastest, then scanlines, then layers; then the axial paths.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> surface_tissue: array<u32>;
@group(0) @binding(4) var<storage, read> rays: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> starts_inside: array<u32>;
@group(0) @binding(6) var<storage, read_write> overflows: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> couplings: array<f32>;

const CROSSINGS: u32 = CROSSINGS_BEHIND;

// Threads started for each one that searches: idle threads between them save waiting within a subgroup.
override LANES_APART: u32 = 1u;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let path = id.x / LANES_APART;
    if id.x % LANES_APART != 0u {
        return;
    }
    if path >= params.line_count * params.rays * params.layer_count + params.axial_paths {
        return;
    }
    let ray = launch(path);
    // A start outside all surfaces is coupled if gel reaches the first surface ahead.
    let down = dot(ray.direction, params.axial.xyz);
    let film_reach_mm = max((params.film_mm + GAP_MAX_MM - ray.face_depth_mm) / max(down, 0.1), 0.0);
    collect(ray.origin, ray.direction, -params.reach_mm, select(film_reach_mm, 0.0, params.film_mm < 0.0));
    let found = crossing_count;
    var behind = 0u;
    while behind < found && crossing_t[behind] <= 0.0 {
        behind++;
    }
    crossing_count = behind;
    for (var i = 0u; i < crossing_count;) {
        i = cross_coincident(i);
    }
    couplings[path] = coupling_of(ray.face_depth_mm, down, crossing_t[min(behind, CROSSINGS - 1u)], behind == found);
    if crossing_lost > 0u {
        atomicAdd(&overflows[0], crossing_lost);
    }
    for (var word = 0u; word < 8u; word++) {
        starts_inside[path * 8u + word] = inside[word];
    }
}
