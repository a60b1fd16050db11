// Motion of the scene: see crates/core/src/anatomy/motion.

// A displacement field. Positions are relative to the tree's centre, mm.
struct Field {
    // Centre or joint, mm; kind: 0 a beat, 1 a breath, 2 a swing.
    origin: vec3<f32>,
    kind: u32,
    // Axis of length 1.
    axis: vec3<f32>,
    radius_mm: f32,
    // Beat: squeeze and shorten, parts of the radius. Breath: half length (mm), widening (a part), shift (mm). Swing: far end of the
    // limb from its joint (mm).
    form: vec3<f32>,
    // Largest rotation of a swing, turns.
    turns: f32,
    // Amounts of movement, 0 to 1.
    amounts: vec2<f32>,
    unused: vec2<f32>,
}

struct Motion {
    fields: array<Field, FIELDS_MAX>,
    // Bit set of the fields whose amounts have changed.
    changed: u32,
}

// Part of the tables that a dispatch works on.
struct Step {
    // Index of the first triangle, or of the first entry of a level.
    first: u32,
    count: u32,
}
