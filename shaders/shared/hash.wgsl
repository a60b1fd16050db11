// Integer hashes: no state, no order, the same on every device.

// pcg3d (Jarzynski and Olano, "Hash functions for GPU rendering", JCGT 2020).
fn pcg3d(key: vec3<u32>) -> vec3<u32> {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// 24 bits as a number in 0..1, exact in f32.
fn unit(bits: u32) -> f32 {
    return f32(i32(bits >> 8u)) * 5.9604644775390625e-8;
}

// Generators of Kronecker sequences, 2³² times the golden ratio's and the square roots' of 2, 3, 7, 11, 13, 19, 22, 29, 31,
// 43, 33, 53, 58, 71, 73 fractional parts: badly approximable, so that neighbouring scanlines differ.
const KRONECKER = array<u32, 16>(
    2654435769u, 1779033703u, 3144134277u, 2773480763u,
    1359893119u, 2600822925u, 1541459225u, 2965313109u,
    1654270251u, 2438529371u, 2394180231u, 3197872217u,
    1203062813u, 2644725351u, 1830299339u, 2336478295u,
);

// A number in 0..1 for dimension `dim` (0..3) of the path's `bounce`-th interface: low-discrepancy over the scanlines
// and rays in the first bounces, a plain hash after them.
fn sample_unit(line_ray: u32, layer: u32, bounce: u32, dim: u32) -> f32 {
    let rotation = pcg3d(vec3<u32>(params.seed, layer, bounce * 4u + dim));
    if bounce < 4u {
        return unit(line_ray * KRONECKER[bounce * 4u + dim] + rotation.x);
    }
    return unit(pcg3d(vec3<u32>(line_ray, rotation.x, rotation.y)).x);
}
