// Motion of the scene: see crates/core/src/anatomy/motion.

// A displacement field: a beating heart, a breathing trunk or a swinging limb. Positions are relative to the tree's
// centre, mm.
struct Field {
    // Centre or joint, mm. `kind` is 0 for a beat, 1 for a breath, 2 for a swing.
    origin: vec3<f32>,
    kind: u32,
    // Axis, a unit vector.
    axis: vec3<f32>,
    radius_mm: f32,
    // Of a beat: squeeze and shortening, fractions of the radius. Of a breath: half length (mm), widening (fraction),
    // shift (mm). Of a swing: vector from the joint to the limb's far end (mm).
    form: vec3<f32>,
    // Largest rotation of a swing, turns.
    turns: f32,
    // Amounts of the movement, 0 to 1.
    amounts: vec2<f32>,
    unused: vec2<f32>,
}

struct Motion {
    fields: array<Field, FIELDS_MAX>,
    // Bit set of the fields whose amounts have changed.
    changed: u32,
}

// Part of the motion tables that one dispatch works on.
struct Step {
    // Index of the first triangle, or of the first node entry of a tree level.
    first: u32,
    count: u32,
}
