// All crossings of a straight ray, sorted.

// Collects the crossings in (t_min, t_max]. Those beyond the capacity CROSSINGS are lost and counted.
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
            let hits = intersect_node(group.x + before, origin, reciprocal, octant, t_min, t_max);
            group = vec2<u32>(hits.child_base, (hits.children & 0xff000000u) | hits.inner);
            leaf = vec2<u32>(hits.triangle_base, hits.children & 0x00ffffffu);
        }
        collect_leaf(leaf, origin, direction, t_min, t_max);
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
