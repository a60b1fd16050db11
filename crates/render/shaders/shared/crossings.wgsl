// Crossings of a straight ray with surfaces. Each pass defines their capacity CROSSINGS.

var<private> crossing_t: array<f32, CROSSINGS>;
// Index of the triangle in leaf order, shifted by one bit; the lowest bit is 1 if the ray enters the surface.
var<private> crossing_key: array<u32, CROSSINGS>;
var<private> crossing_count: u32;
var<private> crossing_lost: u32;
// Distance of the nearest crossing that was lost, mm.
var<private> crossing_lost_mm: f32;

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

// Updates `inside` by all crossings within TOUCH_MM beyond crossing `first`. Returns the index after them. A surface
// that is both entered and left there is a crease or a silhouette: its membership is unchanged.
fn cross_coincident(first: u32) -> u32 {
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
