// `nearest_of_leaf` of `nearest`, by one thread.

// Smaller of `before`, the nearest distance so far, and the nearest hit of a leaf's triangles. They are given by the
// index of the first one and a bit for each.
fn nearest_of_leaf(
    triangles_of: vec2<u32>, origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32, before: f32,
) -> f32 {
    var leaf = triangles_of;
    var best = before;
    while leaf.y != 0u {
        let offset = firstLeadingBit(leaf.y);
        leaf.y &= ~(1u << offset);
        let index = leaf.x + offset;
        let hit = intersect_triangle(index, origin, direction);
        // Without branches: software devices run both sides of a branch for every thread.
        let first = nearest_key == NO_KEY;
        let met = hit.facing != 0 && hit.t > t_min && hit.t <= select(best + TOUCH_MM, t_max, first);
        nearest_crowded = select(nearest_crowded, !(first || hit.t < best - TOUCH_MM), met);
        let nearer = met && (first || hit.t < best);
        best = select(best, hit.t, nearer);
        nearest_key = select(nearest_key, index << 1u | select(0u, 1u, hit.facing > 0), nearer);
    }
    return best;
}
