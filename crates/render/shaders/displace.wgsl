// Displacement of moving vertices from their rest positions.
// In: rest positions, amounts of the displacement fields. Out: displacements. One thread per vertex.

@group(0) @binding(0) var<uniform> step_of: Step;
@group(0) @binding(1) var<uniform> motion: Motion;
// Rest position as the bits of floats, and the bit set of the fields that move the vertex.
@group(0) @binding(2) var<storage, read> vertices: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> moved: array<vec4<f32>>;

// 0 up to `low`, 1 from `high` on, smooth in between.
fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    let t = clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// Beating heart: it narrows about its long axis, and its valve plane moves towards the apex.
fn beat(field: Field, q: vec3<f32>) -> vec3<f32> {
    let reach = length(q) / field.radius_mm;
    let fade = 1.0 - smooth_step(1.0, 1.0 + FADE, reach);
    let along = dot(q, field.axis) / field.radius_mm;
    let ventricular = smooth_step(-0.25, 0.15, along);
    let amount = field.amounts.x * ventricular + ATRIA * field.amounts.y * (1.0 - ventricular);
    let depth = 1.0 - (1.0 - OUTER_WALL) * smooth_step(0.3, 1.0, reach);
    let about_axis = q - field.axis * (along * field.radius_mm);
    let valves = exp(-(along * 2.0) * (along * 2.0));
    return fade * (field.axis * (field.amounts.x * field.form.y * field.radius_mm * valves)
        - about_axis * (amount * field.form.x * depth));
}

// Breathing trunk: it widens about an axis, and its inside moves along the axis.
fn breath(field: Field, q: vec3<f32>) -> vec3<f32> {
    let along = dot(q, field.axis);
    let about_axis = q - field.axis * along;
    let aside = length(about_axis) / field.radius_mm;
    let fade = (1.0 - smooth_step(0.3, 1.0 + FADE, abs(along) / field.form.x)) * (1.0 - smooth_step(1.0, 1.0 + FADE, aside));
    // The skin moves least along the axis.
    let inside = 1.0 - smooth_step(0.3, 1.0, aside);
    return field.amounts.x * fade * (field.form.y * about_axis + field.axis * (field.form.z * inside));
}

// Limb that swings about a joint.
fn swing(field: Field, q: vec3<f32>) -> vec3<f32> {
    let limb = field.form;
    let length_mm = length(limb);
    let along = clamp(dot(q, limb) / (length_mm * length_mm), 0.0, 1.0);
    let aside = length(q - limb * along) / field.radius_mm;
    // Only points distal to the joint rotate, with full weight from one radius along the limb on.
    let weight = (1.0 - smooth_step(1.0, 1.0 + FADE, aside))
        * smooth_step(0.0, 1.0, dot(q, limb) / (length_mm * min(field.radius_mm, length_mm)));
    let half = phasor(0.5 * weight * field.amounts.x * field.turns);
    // Displacement by Rodrigues' rotation formula.
    let across = cross(field.axis, q);
    return 2.0 * half.y * (half.x * across + half.y * cross(field.axis, across));
}

fn displacement(field: Field, rest: vec3<f32>) -> vec3<f32> {
    if field.amounts.x == 0.0 && field.amounts.y == 0.0 {
        return vec3<f32>(0.0);
    }
    let q = rest - field.origin;
    if field.kind == 0u {
        return beat(field, q);
    }
    if field.kind == 1u {
        return breath(field, q);
    }
    return swing(field, q);
}

@compute @workgroup_size(MOTION_GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= step_of.count {
        return;
    }
    let vertex = vertices[id.x];
    if (vertex.w & motion.changed) == 0u {
        return;
    }
    let rest = bitcast<vec3<f32>>(vertex.xyz);
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < FIELDS_MAX; i++) {
        if (vertex.w & (1u << i)) != 0u {
            sum += displacement(motion.fields[i], rest);
        }
    }
    moved[id.x] = vec4<f32>(sum, 0.0);
}
