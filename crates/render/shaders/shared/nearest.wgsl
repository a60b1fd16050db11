// Nearest crossing of a ray.

const NO_KEY: u32 = 0xffffffffu;

// Index of the nearest triangle in leaf order, shifted by one bit; the lowest bit is 1 if the ray enters the surface.
var<private> nearest_key: u32;
// Whether other crossings may lie within TOUCH_MM of the nearest one.
var<private> nearest_crowded: bool;

// Distance to the nearest crossing in (t_min, t_max], mm; −1 if there is none.
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
            let hits = intersect_node(group.x + before, origin, reciprocal, octant, t_min, best);
            group = vec2<u32>(hits.child_base, (hits.children & 0xff000000u) | hits.inner);
            leaf = vec2<u32>(hits.triangle_base, hits.children & 0x00ffffffu);
        }
        best = nearest_of_leaf(leaf, origin, direction, t_min, t_max, best);
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
