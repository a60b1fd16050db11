// Integer hashes: stateless, independent of order, and the same on every device.

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

// Upper 24 bits as a number in 0..1, exact in f32.
fn unit(bits: u32) -> f32 {
    return f32(i32(bits >> 8u)) * 5.9604644775390625e-8;
}

// A random number in 0..1 for dimension `dim` (0..4) of a path's `bounce`-th interface. For the first four interfaces,
// it is low-discrepancy over scanlines and rays; after them, it is a plain hash.
fn sample_unit(line_ray: u32, layer: u32, bounce: u32, dim: u32) -> f32 {
    let rotation = pcg3d(vec3<u32>(params.seed, layer, bounce * 4u + dim));
    if bounce < 4u {
        return unit(line_ray * KRONECKER[bounce * 4u + dim] + rotation.x);
    }
    return unit(pcg3d(vec3<u32>(line_ray, rotation.x, rotation.y)).x);
}
