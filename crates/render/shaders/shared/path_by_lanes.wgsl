// A path by PATH_LANES neighbouring lanes of a subgroup. They hold the same state and take the same branches; only
// searches of the tree are shared out. Lanes of other paths may be at other instructions.

// Number of paths to start lanes for, for each path that is traced: idle lanes between paths save time.
override LANES_APART: u32 = 1u;

// Index of this lane in its path, and index of the path's first lane in the subgroup.
var<private> own_lane: u32;
var<private> first_lane: u32;

// Whether this thread writes the outputs of its path.
fn is_writer() -> bool {
    return own_lane == 0u;
}

// Bit set of the path's lanes for which `value` holds.
fn vote(value: bool) -> u32 {
    let words = subgroupBallot(value);
    let low = select(words.x, words.y, (first_lane & 32u) != 0u);
    let high = select(words.z, words.w, (first_lane & 32u) != 0u);
    let word = select(low, high, (first_lane & 64u) != 0u);
    return (word >> (first_lane & 31u)) & ((1u << PATH_LANES) - 1u);
}

fn or_of_lanes(value: u32) -> u32 {
    var all = value | subgroupShuffleXor(value, 1u);
    all |= subgroupShuffleXor(all, 2u);
    if PATH_LANES > 4u {
        all |= subgroupShuffleXor(all, 4u);
    }
    return all;
}

fn least_of_lanes(value: f32) -> f32 {
    var least = min(value, subgroupShuffleXor(value, 1u));
    least = min(least, subgroupShuffleXor(least, 2u));
    if PATH_LANES > 4u {
        least = min(least, subgroupShuffleXor(least, 4u));
    }
    return least;
}

// The triangle of a group of leaves that this lane tests in a round.
struct Share {
    offset: u32,
    // Whether this lane has a triangle; if not, `offset` is that of another lane.
    is_some: bool,
    // Bit set of the triangles left for the next rounds.
    rest: u32,
}

// Gives each lane one triangle, from the highest bit of `triangles` down. At least one bit is set.
fn share_triangles(triangles: u32) -> Share {
    var rest = triangles;
    var own = 0u;
    for (var lane = 0u; lane < PATH_LANES; lane++) {
        own = select(own, rest, lane == own_lane);
        rest &= ~select(0u, 1u << (firstLeadingBit(rest) & 31u), rest != 0u);
    }
    return Share(firstLeadingBit(select(triangles, own, own != 0u)), own != 0u, rest);
}

// Intersects the children of a node by the lanes of a path: each lane tests the child with its own index, or several.
fn intersect_node(
    index: u32, origin: vec3<f32>, reciprocal: vec3<f32>, octant: u32, t_min: f32, t_max: f32,
) -> NodeHits {
    let n = node_boxes(index, origin, reciprocal, t_min, t_max);
    var children = 0u;
    for (var child = own_lane; child < 8u; child += PATH_LANES) {
        let half = child >= 4u;
        let meta4 = select(n.metas.x, n.metas.y, half);
        let inner = (meta4 & (meta4 << 1u)) & 0x10101010u;
        let bit_index = (meta4 ^ (octant & ((inner >> 4u) * 0xffu))) & 0x1f1f1f1fu;
        children |= child_mask(
            8u * (child & 3u), (meta4 >> 5u) & 0x07070707u, bit_index, n.scale, n.base,
            select(n.low_x.x, n.low_x.y, half), select(n.high_x.x, n.high_x.y, half),
            select(n.low_y.x, n.low_y.y, half), select(n.high_y.x, n.high_y.y, half),
            select(n.low_z.x, n.low_z.y, half), select(n.high_z.x, n.high_z.y, half), n.first, n.last);
    }
    return NodeHits(or_of_lanes(children), n.child_base, n.triangle_base, n.inner);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(subgroup_invocation_id) lane: u32) {
    own_lane = lane % PATH_LANES;
    first_lane = lane - own_lane;
    let group = id.x / PATH_LANES;
    if group % LANES_APART != 0u {
        return;
    }
    trace_path(group / LANES_APART);
}
