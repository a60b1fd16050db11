// Every crossing of a straight ray, sorted, up to the capacity CROSSINGS, which each pass defines.

var<private> crossing_t: array<f32, CROSSINGS>;
// Triangle in leaf order, and its facing in the lowest bit: 1 if the ray enters.
var<private> crossing_key: array<u32, CROSSINGS>;
var<private> crossing_count: u32;
var<private> crossing_lost: u32;
// Distance of the nearest one that was lost, mm.
var<private> crossing_lost_mm: f32;

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
            let hits = intersect_node(group.x + before, origin, reciprocal, octant, t_min, t_max);
            group = vec2<u32>(hits.child_base, (hits.children & 0xff000000u) | hits.inner);
            leaf = vec2<u32>(hits.triangle_base, hits.children & 0x00ffffffu);
        }
        while leaf.y != 0u {
            let offset = firstLeadingBit(leaf.y);
            leaf.y &= ~(1u << offset);
            let index = leaf.x + offset;
            let hit = intersect_triangle(index, origin, direction);
            // Appended here and sorted at the end: software devices run all of a loop's body for every thread.
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

// Insertion sort by distance, then by key: a traversal finds crossings nearly in order.
fn sort_crossings() {
    for (var i = 1u; i < crossing_count; i++) {
        let t = crossing_t[i];
        let key = crossing_key[i];
        var slot = i;
        while slot > 0u && (crossing_t[slot - 1u] > t || (crossing_t[slot - 1u] == t && crossing_key[slot - 1u] > key)) {
            crossing_t[slot] = crossing_t[slot - 1u];
            crossing_key[slot] = crossing_key[slot - 1u];
            slot--;
        }
        crossing_t[slot] = t;
        crossing_key[slot] = key;
    }
}

fn crossing_surface(i: u32) -> u32 {
    return triangles[3u * (crossing_key[i] >> 1u)].w;
}

// Applies all crossings within TOUCH_MM of the one at `first`, and returns the index after them. A surface that is
// entered and left at one place is a crease or a silhouette: its membership is unchanged.
fn cross_place(first: u32) -> u32 {
    let limit = crossing_t[first] + TOUCH_MM;
    var end = first + 1u;
    while end < crossing_count && crossing_t[end] <= limit {
        end++;
    }
    for (var i = first; i < end; i++) {
        let surface = crossing_surface(i);
        var entered = false;
        var left = false;
        for (var j = first; j < end; j++) {
            if crossing_surface(j) == surface {
                if (crossing_key[j] & 1u) != 0u {
                    entered = true;
                } else {
                    left = true;
                }
            }
        }
        if entered != left {
            set_inside(surface, entered);
        }
    }
    return end;
}
