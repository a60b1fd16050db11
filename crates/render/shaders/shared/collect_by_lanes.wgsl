// `collect_leaf` of `collect`, by the lanes of a path together. It finds the same crossings in the same order as one
// thread.

// Appends the crossings of a leaf's triangles, given by the index of the first one and a bit for each.
fn collect_leaf(triangles_of: vec2<u32>, origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) {
    var leaf = triangles_of;
    while leaf.y != 0u {
        let share = share_triangles(leaf.y);
        leaf.y = share.rest;
        let index = leaf.x + share.offset;
        let hit = intersect_triangle(index, origin, direction);
        let there = share.is_some && hit.facing != 0 && hit.t > t_min && hit.t <= t_max;
        let key = index << 1u | select(0u, 1u, hit.facing > 0);
        // Appends in the order in which one thread finds them.
        var found = vote(there);
        while found != 0u {
            let lane = firstTrailingBit(found);
            found &= found - 1u;
            let t = subgroupShuffle(hit.t, first_lane + lane);
            let its_key = subgroupShuffle(key, first_lane + lane);
            if crossing_count < CROSSINGS {
                crossing_t[crossing_count] = t;
                crossing_key[crossing_count] = its_key;
                crossing_count++;
            } else {
                crossing_lost++;
                crossing_lost_mm = min(crossing_lost_mm, t);
            }
        }
    }
}
