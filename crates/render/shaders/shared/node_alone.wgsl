// Intersects the children of a node by one thread.

fn intersect_node(
    index: u32, origin: vec3<f32>, reciprocal: vec3<f32>, octant: u32, t_min: f32, t_max: f32,
) -> NodeHits {
    let n = node_boxes(index, origin, reciprocal, t_min, t_max);
    let a = half_node_mask(n.metas.x, octant, n.scale, n.base, n.low_x.x, n.high_x.x, n.low_y.x, n.high_y.x, n.low_z.x, n.high_z.x, n.first, n.last);
    let b = half_node_mask(n.metas.y, octant, n.scale, n.base, n.low_x.y, n.high_x.y, n.low_y.y, n.high_y.y, n.low_z.y, n.high_z.y, n.first, n.last);
    return NodeHits(a | b, n.child_base, n.triangle_base, n.inner);
}
