// `collect` of collect.wgsl by the lanes of a path together: the same crossings, found in the same order.

// Crossings in (t_min, t_max]; those beyond CROSSINGS are lost and counted.
fn collect(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) {
    let reciprocal = safe_reciprocal(direction);
    let octant = octant_mask(direction);
    var stack: array<vec2<u32>, STACK_DEPTH>;
    var depth = 0u;
    var group = vec2<u32>(0u, 0x80000000u);
    crossing_count = 0u;
    crossing_lost = 0u;
    crossing_lost_mm = BEYOND_MM;
    loop {
        var leaf = vec2<u32>(0u, 0u);
        if (group.y & 0xff000000u) != 0u {
            let bits = group.y;
            let child = firstLeadingBit(bits);
            group.y &= ~(1u << child);
            if (group.y & 0xff000000u) != 0u && depth < STACK_DEPTH {
                stack[depth] = group;
                depth++;
            }
            let slot = (child - 24u) ^ (octant & 255u);
            let before = countOneBits(bits & ~(0xffffffffu << slot));
            let hits = intersect_node_by_lanes(group.x + before, origin, reciprocal, octant, t_min, t_max);
            group = vec2<u32>(hits.child_base, (hits.children & 0xff000000u) | hits.inner);
            leaf = vec2<u32>(hits.triangle_base, hits.children & 0x00ffffffu);
        }
        while leaf.y != 0u {
            let share = share_triangles(leaf.y);
            leaf.y = share.rest;
            let index = leaf.x + share.offset;
            let hit = intersect_triangle(index, origin, direction);
            let there = share.is_some && hit.facing != 0 && hit.t > t_min && hit.t <= t_max;
            let key = index << 1u | select(0u, 1u, hit.facing > 0);
            // In the order in which a path alone finds them.
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
        if (group.y & 0xff000000u) == 0u {
            if depth == 0u {
                break;
            }
            depth--;
            group = stack[depth];
        }
    }
    sort_crossings();
}
