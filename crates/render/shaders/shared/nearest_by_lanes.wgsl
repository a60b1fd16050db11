// `nearest_of_leaf` of `nearest`, by the lanes of a path together. Hits of one round are compared at once. If distances
// differ by exactly TOUCH_MM, `nearest_crowded` may differ from that of one thread; `trace` finds the same crossings
// even then.

// Smaller of `before`, the nearest distance so far, and the nearest hit of a leaf's triangles. They are given by the
// index of the first one and a bit for each.
fn nearest_of_leaf(
    triangles_of: vec2<u32>, origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32, before: f32,
) -> f32 {
    var leaf = triangles_of;
    var best = before;
    while leaf.y != 0u {
        let share = share_triangles(leaf.y);
        leaf.y = share.rest;
        let index = leaf.x + share.offset;
        let hit = intersect_triangle(index, origin, direction);
        let first = nearest_key == NO_KEY;
        let met = share.is_some && hit.facing != 0 && hit.t > t_min && hit.t <= select(best + TOUCH_MM, t_max, first);
        if vote(met) == 0u {
            continue;
        }
        let least = least_of_lanes(select(BEYOND_MM, hit.t, met));
        // Crossings that may lie within TOUCH_MM: the nearest one before, those near it, and hits of this round.
        let near_before = !first && !(least < best - TOUCH_MM);
        let nearer = first || least < best;
        let key = subgroupShuffle(index << 1u | select(0u, 1u, hit.facing > 0), first_lane + firstTrailingBit(vote(met && hit.t == least)));
        best = select(best, least, nearer);
        nearest_key = select(nearest_key, key, nearer);
        let near = countOneBits(vote(met && hit.t <= best + TOUCH_MM));
        nearest_crowded = near_before || near > 1u;
    }
    return best;
}
