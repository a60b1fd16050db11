// `collect_leaf` of `collect` by one thread.

// Appends the crossings of a leaf's triangles, given by the index of the first one and a bit for each.
fn collect_leaf(triangles_of: vec2<u32>, origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) {
    var leaf = triangles_of;
    while leaf.y != 0u {
        let offset = firstLeadingBit(leaf.y);
        leaf.y &= ~(1u << offset);
        let index = leaf.x + offset;
        let hit = intersect_triangle(index, origin, direction);
        // Crossings are sorted at the end of `collect`: software devices run all of a loop's body for every thread.
        let there = hit.facing != 0 && hit.t > t_min && hit.t <= t_max;
        let room = crossing_count < CROSSINGS;
        if there && room {
            crossing_t[crossing_count] = hit.t;
            crossing_key[crossing_count] = index << 1u | select(0u, 1u, hit.facing > 0);
        }
        crossing_count += select(0u, 1u, there && room);
        crossing_lost += select(0u, 1u, there && !room);
        crossing_lost_mm = select(crossing_lost_mm, min(crossing_lost_mm, hit.t), there && !room);
    }
}
