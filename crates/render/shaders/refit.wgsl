// Refits the boxes of nodes above moved triangles; the tree's topology is kept. Ylitie et al. 2017, as in
// crates/core/src/anatomy/bvh/refit.rs.
// In: triangles, exact boxes of lower nodes. Out: nodes and their exact boxes. One thread per node of a level.

@group(0) @binding(0) var<uniform> step_of: Step;
@group(0) @binding(1) var<uniform> motion: Motion;
// Index of a node, and the bit set of the fields that move its part of the tree.
@group(0) @binding(2) var<storage, read> order: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> triangles: array<vec4<u32>>;
// Minimum and maximum corner of each node's exact box, mm.
@group(0) @binding(4) var<storage, read_write> extents: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> nodes: array<vec4<u32>>;

struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

// Box around `count` triangles from index `first` on.
fn box_of_leaf(first: u32, count: u32) -> Box {
    var all = Box(vec3<f32>(BEYOND_MM), vec3<f32>(-BEYOND_MM));
    for (var i = first; i < first + count; i++) {
        let a = bitcast<vec3<f32>>(triangles[3u * i].xyz);
        let b = a + bitcast<vec3<f32>>(triangles[3u * i + 1u].xyz);
        let c = a + bitcast<vec3<f32>>(triangles[3u * i + 2u].xyz);
        all = Box(min(all.low, min(a, min(b, c))), max(all.high, max(a, max(b, c))));
    }
    return all;
}

// Biased exponent of the smallest power of two such that 255 of it cover `extent_mm`.
fn step_exponent(extent_mm: f32) -> u32 {
    let least = bitcast<u32>(max(extent_mm, 1.0e-20) * (1.0 / 255.0));
    let exponent = (least + 0x007fffffu) >> 23u;
    // A product may round to less than the quotient.
    return select(exponent, exponent + 1u, bitcast<f32>(exponent << 23u) * 255.0 < extent_mm);
}

fn byte_of(value: f32, slot: u32) -> u32 {
    return u32(i32(clamp(value, 0.0, 255.0))) << (8u * (slot & 3u));
}

@compute @workgroup_size(MOTION_GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= step_of.count {
        return;
    }
    let entry = order[step_of.first + id.x];
    if (entry.y & motion.changed) == 0u {
        return;
    }
    let node = 5u * entry.x;
    let inner = nodes[node].w >> 24u;
    let links = nodes[node + 1u];
    var lows: array<vec3<f32>, 8>;
    var highs: array<vec3<f32>, 8>;
    var whole = Box(vec3<f32>(BEYOND_MM), vec3<f32>(-BEYOND_MM));
    for (var slot = 0u; slot < 8u; slot++) {
        let word = select(links.w, links.z, slot < 4u);
        let child = (word >> (8u * (slot & 3u))) & 255u;
        if child == 0u {
            continue;
        }
        var held = Box(vec3<f32>(0.0), vec3<f32>(0.0));
        if (inner & (1u << slot)) == 0u {
            held = box_of_leaf(links.y + (child & 31u), countOneBits(child & 0xe0u));
        } else {
            let below = links.x + countOneBits(inner & ~(0xffffffffu << ((child & 31u) - 24u)));
            held = Box(extents[2u * below].xyz, extents[2u * below + 1u].xyz);
        }
        lows[slot] = held.low;
        highs[slot] = held.high;
        whole = Box(min(whole.low, held.low), max(whole.high, held.high));
    }
    let size = whole.high - whole.low;
    let exponents = vec3<u32>(step_exponent(size.x), step_exponent(size.y), step_exponent(size.z));
    // Products with powers of two are exact.
    let per_mm = bitcast<vec3<f32>>((vec3<u32>(254u) - exponents) << vec3<u32>(23u));
    var low_bytes: array<vec3<u32>, 2>;
    var high_bytes: array<vec3<u32>, 2>;
    for (var slot = 0u; slot < 8u; slot++) {
        let word = select(links.w, links.z, slot < 4u);
        if ((word >> (8u * (slot & 3u))) & 255u) == 0u {
            continue;
        }
        let low = floor((lows[slot] - whole.low) * per_mm);
        let high = ceil((highs[slot] - whole.low) * per_mm);
        let part = slot / 4u;
        low_bytes[part] |= vec3<u32>(byte_of(low.x, slot), byte_of(low.y, slot), byte_of(low.z, slot));
        high_bytes[part] |= vec3<u32>(byte_of(high.x, slot), byte_of(high.y, slot), byte_of(high.z, slot));
    }
    nodes[node] = vec4<u32>(
        bitcast<vec3<u32>>(whole.low),
        exponents.x | (exponents.y << 8u) | (exponents.z << 16u) | (inner << 24u));
    nodes[node + 2u] = vec4<u32>(low_bytes[0].x, low_bytes[1].x, high_bytes[0].x, high_bytes[1].x);
    nodes[node + 3u] = vec4<u32>(low_bytes[0].y, low_bytes[1].y, high_bytes[0].y, high_bytes[1].y);
    nodes[node + 4u] = vec4<u32>(low_bytes[0].z, low_bytes[1].z, high_bytes[0].z, high_bytes[1].z);
    extents[2u * entry.x] = vec4<f32>(whole.low, 0.0);
    extents[2u * entry.x + 1u] = vec4<f32>(whole.high, 0.0);
}
