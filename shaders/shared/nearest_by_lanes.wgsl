// `nearest` of nearest.wgsl by the lanes of a path together. Hits of a round are compared at once: at distances that differ
// by TOUCH_MM to the last bit, `nearest_crowded` may differ; `trace` finds the same place then.

// Distance to the nearest crossing in (t_min, t_max], mm, or −1.
fn nearest(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) -> f32 {
    let reciprocal = safe_reciprocal(direction);
    let octant = octant_mask(direction);
    var stack: array<vec2<u32>, STACK_DEPTH>;
    var depth = 0u;
    var group = vec2<u32>(0u, 0x80000000u);
    var best = t_max;
    nearest_key = NO_KEY;
    nearest_crowded = false;
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
            let hits = intersect_node_by_lanes(group.x + before, origin, reciprocal, octant, t_min, best);
            group = vec2<u32>(hits.child_base, (hits.children & 0xff000000u) | hits.inner);
            leaf = vec2<u32>(hits.triangle_base, hits.children & 0x00ffffffu);
        }
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
            // Others that may lie within TOUCH_MM: the nearest before, what was near that, and hits of this round.
            let near_before = !first && !(least < best - TOUCH_MM);
            let nearer = first || least < best;
            let key = subgroupShuffle(index << 1u | select(0u, 1u, hit.facing > 0), first_lane + firstTrailingBit(vote(met && hit.t == least)));
            best = select(best, least, nearer);
            nearest_key = select(nearest_key, key, nearer);
            let near = countOneBits(vote(met && hit.t <= best + TOUCH_MM));
            nearest_crowded = near_before || near > 1u;
        }
        if (group.y & 0xff000000u) == 0u {
            if depth == 0u {
                break;
            }
            depth--;
            group = stack[depth];
        }
    }
    return select(-1.0, best, nearest_key != NO_KEY);
}
