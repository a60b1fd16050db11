// The nearest place that a ray crosses surfaces at, with all crossings within TOUCH_MM of it.

const PLACE_HITS: u32 = 6u;

var<private> place_t: array<f32, PLACE_HITS>;
// Triangle in leaf order, and its facing in the lowest bit.
var<private> place_key: array<u32, PLACE_HITS>;
var<private> place_count: u32;
var<private> place_lost: u32;

// Distance to the nearest place in (t_min, t_max], mm, or −1.
fn nearest(origin: vec3<f32>, direction: vec3<f32>, t_min: f32, t_max: f32) -> f32 {
    let reciprocal = safe_reciprocal(direction);
    let octant = octant_mask(direction);
    var stack: array<vec2<u32>, STACK_DEPTH>;
    var depth = 0u;
    var group = vec2<u32>(0u, 0x80000000u);
    var best = t_max;
    place_count = 0u;
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
        while leaf.y != 0u {
            let offset = firstLeadingBit(leaf.y);
            leaf.y &= ~(1u << offset);
            let index = leaf.x + offset;
            let hit = intersect_triangle(index, origin, direction);
            let limit = select(best + TOUCH_MM, t_max, place_count == 0u);
            // A loop, not an `if`: software devices skip a loop that no thread enters.
            loop {
                if hit.facing == 0 || hit.t <= t_min || hit.t > limit {
                    break;
                }
                if hit.t < best - TOUCH_MM {
                    place_count = 0u;
                }
                best = min(best, hit.t);
                keep(hit.t, index << 1u | select(0u, 1u, hit.facing > 0), best + TOUCH_MM);
                break;
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
    return select(-1.0, best, place_count > 0u);
}

// Adds a crossing to the place, and forgets those beyond `limit`. An edge or a corner that is hit again says nothing
// new: of one surface and side the first triangle is kept.
fn keep(t: f32, key: u32, limit: f32) {
    var kept = 0u;
    var known = false;
    for (var i = 0u; i < place_count; i++) {
        if place_t[i] <= limit {
            let same = place_surface(i) == triangles[3u * (key >> 1u)].w && ((place_key[i] ^ key) & 1u) == 0u;
            let first = triangles[3u * (key >> 1u) + 1u].w < triangles[3u * (place_key[i] >> 1u) + 1u].w;
            place_t[kept] = place_t[i];
            place_key[kept] = select(place_key[i], key, same && first);
            known = known || same;
            kept++;
        }
    }
    if !known {
        if kept < PLACE_HITS {
            place_t[kept] = t;
            place_key[kept] = key;
            kept++;
        } else {
            place_lost++;
        }
    }
    place_count = kept;
}

fn place_surface(i: u32) -> u32 {
    return triangles[3u * (place_key[i] >> 1u)].w;
}

// Enters and leaves the surfaces of the place, and returns the index among them of the interface: the highest surface,
// and of its triangles the first.
fn cross_place() -> u32 {
    var chosen = 0u;
    var chosen_surface = 0u;
    var chosen_triangle = 0xffffffffu;
    for (var i = 0u; i < place_count; i++) {
        let surface = place_surface(i);
        let triangle = triangles[3u * (place_key[i] >> 1u) + 1u].w;
        if surface > chosen_surface || (surface == chosen_surface && triangle < chosen_triangle) {
            chosen = i;
            chosen_surface = surface;
            chosen_triangle = triangle;
        }
        var entered = false;
        var left = false;
        for (var j = 0u; j < place_count; j++) {
            if place_surface(j) == surface {
                if (place_key[j] & 1u) != 0u {
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
    return chosen;
}
