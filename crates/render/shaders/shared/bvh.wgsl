// Traversal of a compressed wide BVH; the layout is documented in crates/core/src/anatomy/bvh.

struct TriangleHit {
    // Signed distance along the ray, mm; undefined if `facing` is 0.
    t: f32,
    // +1 if the ray enters the surface, −1 if it leaves, 0 if it misses.
    facing: i32,
}

// 1 / v, with components too small to divide by replaced by ±10⁻¹².
fn safe_reciprocal(v: vec3<f32>) -> vec3<f32> {
    let tiny = vec3<f32>(1.0e-12);
    return 1.0 / select(v, select(-tiny, tiny, v >= vec3<f32>(0.0)), abs(v) < tiny);
}

// Möller–Trumbore relative to the ray's point nearest to the first corner, which keeps f32 precise far from the ray's
// origin. Edges extend outward by a tolerance, so a shared edge is never missed.
fn intersect_triangle(index: u32, origin: vec3<f32>, direction: vec3<f32>) -> TriangleHit {
    let w0 = bitcast<vec3<f32>>(triangles[3u * index].xyz);
    let w1 = bitcast<vec3<f32>>(triangles[3u * index + 1u].xyz);
    let w2 = bitcast<vec4<f32>>(triangles[3u * index + 2u]);
    let to_corner = w0 - origin;
    let t0 = dot(to_corner, direction);
    let s = direction * t0 - to_corner;
    let p = cross(direction, w2.xyz);
    let determinant = dot(w1, p);
    let magnitude = abs(determinant);
    let side = select(-1.0, 1.0, determinant >= 0.0);
    let q = cross(s, w1);
    let u = dot(s, p) * side;
    let v = dot(direction, q) * side;
    let tolerance = w2.w * (abs(t0) + 100.0);
    let hit = magnitude > 2.0 * tolerance && u >= -tolerance && v >= -tolerance && u + v <= magnitude + tolerance;
    let t = t0 + dot(w2.xyz, q) * side / max(magnitude, 1.0e-30);
    // edge1 × edge2 points outward, and determinant = −direction · (edge1 × edge2).
    return TriangleHit(t, select(0, select(-1, 1, determinant > 0.0), hit));
}

fn octant_mask(direction: vec3<f32>) -> u32 {
    return select(0x04040404u, 0u, direction.x < 0.0)
        | select(0x02020202u, 0u, direction.y < 0.0)
        | select(0x01010101u, 0u, direction.z < 0.0);
}

// Hit bits of one child, whose bytes begin at bit `shift` of each word; 0 if the ray misses its box.
fn child_mask(
    shift: u32, child_bits: u32, bit_index: u32, scale: vec3<f32>, base: vec3<f32>,
    low_x: u32, high_x: u32, low_y: u32, high_y: u32, low_z: u32, high_z: u32,
    t_min: f32, t_max: f32,
) -> u32 {
    // Via i32: many devices convert signed integers only.
    let low = vec3<f32>(vec3<i32>(vec3<u32>(low_x, low_y, low_z) >> vec3<u32>(shift) & vec3<u32>(255u))) * scale + base;
    let high = vec3<f32>(vec3<i32>(vec3<u32>(high_x, high_y, high_z) >> vec3<u32>(shift) & vec3<u32>(255u))) * scale + base;
    let near = max(max(low.x, low.y), max(low.z, t_min));
    let far = min(min(high.x, high.y), min(high.z, t_max));
    let bits = ((child_bits >> shift) & 255u) << ((bit_index >> shift) & 255u);
    return select(0u, bits, near <= far + 1.0e-4);
}

// Hit bits of four of a node's eight children: those that the ray meets between t_min and t_max.
fn half_node_mask(
    meta4: u32, octant: u32, scale: vec3<f32>, base: vec3<f32>,
    low_x: u32, high_x: u32, low_y: u32, high_y: u32, low_z: u32, high_z: u32,
    t_min: f32, t_max: f32,
) -> u32 {
    let inner = (meta4 & (meta4 << 1u)) & 0x10101010u;
    let inner_mask = (inner >> 4u) * 0xffu;
    let bit_index = (meta4 ^ (octant & inner_mask)) & 0x1f1f1f1fu;
    let child_bits = (meta4 >> 5u) & 0x07070707u;
    // Unrolled: software devices pay for every iteration of a loop.
    return child_mask(0u, child_bits, bit_index, scale, base, low_x, high_x, low_y, high_y, low_z, high_z, t_min, t_max)
        | child_mask(8u, child_bits, bit_index, scale, base, low_x, high_x, low_y, high_y, low_z, high_z, t_min, t_max)
        | child_mask(16u, child_bits, bit_index, scale, base, low_x, high_x, low_y, high_y, low_z, high_z, t_min, t_max)
        | child_mask(24u, child_bits, bit_index, scale, base, low_x, high_x, low_y, high_y, low_z, high_z, t_min, t_max);
}

struct NodeHits {
    children: u32,
    child_base: u32,
    triangle_base: u32,
    inner: u32,
}

// Boxes of a node's children, with near and far planes in the ray's order. Each pair of words holds children 0 to 3,
// then 4 to 7.
struct NodeBoxes {
    // Distance along the ray per step of the box coordinates, and to their origin, on each axis.
    scale: vec3<f32>,
    base: vec3<f32>,
    metas: vec2<u32>,
    low_x: vec2<u32>,
    high_x: vec2<u32>,
    low_y: vec2<u32>,
    high_y: vec2<u32>,
    low_z: vec2<u32>,
    high_z: vec2<u32>,
    child_base: u32,
    triangle_base: u32,
    inner: u32,
    // Limits of the ray, widened by a slack, mm.
    first: f32,
    last: f32,
}

fn node_boxes(index: u32, origin: vec3<f32>, reciprocal: vec3<f32>, t_min: f32, t_max: f32) -> NodeBoxes {
    let n0 = nodes[5u * index];
    let n1 = nodes[5u * index + 1u];
    let n2 = nodes[5u * index + 2u];
    let n3 = nodes[5u * index + 3u];
    let n4 = nodes[5u * index + 4u];
    let exponents = vec3<u32>(n0.w, n0.w >> 8u, n0.w >> 16u) & vec3<u32>(255u);
    let scale = bitcast<vec3<f32>>(exponents << vec3<u32>(23u)) * reciprocal;
    let base = (bitcast<vec3<f32>>(n0.xyz) - origin) * reciprocal;
    let back = reciprocal < vec3<f32>(0.0);
    // Quantised boxes are exact, but products are rounded: a slack of 10⁻⁶ of the distance plus 1 µm makes up for it.
    let slack = 1.0e-3 + 1.0e-6 * max(abs(t_min), abs(t_max));
    let first = t_min - slack;
    let last = t_max + slack;
    let low_x = select(n2.xy, n2.zw, back.x);
    let high_x = select(n2.zw, n2.xy, back.x);
    let low_y = select(n3.xy, n3.zw, back.y);
    let high_y = select(n3.zw, n3.xy, back.y);
    let low_z = select(n4.xy, n4.zw, back.z);
    let high_z = select(n4.zw, n4.xy, back.z);
    return NodeBoxes(scale, base, n1.zw, low_x, high_x, low_y, high_y, low_z, high_z, n1.x, n1.y, n0.w >> 24u, first, last);
}
