// Moved triangles, from their vertices.
// In: rest positions and displacements of vertices. Out: triangles and their displacements. One thread per moving
// triangle.

@group(0) @binding(0) var<uniform> step_of: Step;
@group(0) @binding(1) var<uniform> motion: Motion;
@group(0) @binding(2) var<storage, read> vertices: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> moved: array<vec4<f32>>;
// Indices of a triangle's three vertices, and the bit set of the fields that move its part of the tree.
@group(0) @binding(4) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> triangles: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> displacements: array<vec4<f32>>;

@compute @workgroup_size(MOTION_GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= step_of.count {
        return;
    }
    let corner = corners[id.x];
    if (corner.w & motion.changed) == 0u {
        return;
    }
    let a = bitcast<vec3<f32>>(vertices[corner.x].xyz) + moved[corner.x].xyz;
    let b = bitcast<vec3<f32>>(vertices[corner.y].xyz) + moved[corner.y].xyz;
    let c = bitcast<vec3<f32>>(vertices[corner.z].xyz) + moved[corner.z].xyz;
    let edge1 = b - a;
    let edge2 = c - a;
    let longest = max(max(length(edge1), length(edge2)), length(edge2 - edge1));
    let index = step_of.first + id.x;
    triangles[3u * index] = vec4<u32>(bitcast<vec3<u32>>(a), triangles[3u * index].w);
    triangles[3u * index + 1u] = vec4<u32>(bitcast<vec3<u32>>(edge1), triangles[3u * index + 1u].w);
    triangles[3u * index + 2u] = vec4<u32>(bitcast<vec3<u32>>(edge2), bitcast<u32>(longest * EDGE_TOLERANCE_PER_MM));
    displacements[index] = vec4<f32>((moved[corner.x].xyz + moved[corner.y].xyz + moved[corner.z].xyz) * (1.0 / 3.0), 0.0);
}
