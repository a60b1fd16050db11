// Marks the needle's cross-section in the segmentation. One thread per row of the image.

struct Outline {
    // End of the axis at the tip, probe frame, and length of the axis, mm.
    tip_mm: vec3<f32>,
    length_mm: f32,
    // Unit vector from the tip to the hub, and radius, mm.
    direction: vec3<f32>,
    radius_mm: f32,
    // Probe-frame x and z of the image's upper left corner, and side of a pixel, mm.
    corner_mm: vec2<f32>,
    pixel_mm: f32,
    // Number of the needle's tissue.
    tissue: u32,
    // First column, a multiple of four, and first row; numbers of columns and rows that may show the needle.
    first: vec2<u32>,
    size: vec2<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> outline: Outline;
@group(0) @binding(2) var<storage, read_write> segmentation: array<u32>;

// Factor of the radius.
const NEEDLE_RADIUS: f32 = 1.0;

// Whether the cross-section covers the centre of a pixel.
fn covers(column: u32, row: u32) -> bool {
    let x = outline.corner_mm.x + (f32(column) + 0.5) * outline.pixel_mm - outline.tip_mm.x;
    let z = outline.corner_mm.y + (f32(row) + 0.5) * outline.pixel_mm - outline.tip_mm.z;
    let from_tip = vec3<f32>(x, -outline.tip_mm.y, z);
    let along = dot(from_tip, outline.direction);
    let beside = from_tip - along * outline.direction;
    let radius_mm = NEEDLE_RADIUS * outline.radius_mm;
    return along >= 0.0 && along <= outline.length_mm && dot(beside, beside) <= radius_mm * radius_mm;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = id.x;
    if row < outline.first.y || row >= outline.first.y + outline.size.y {
        return;
    }
    for (var column = outline.first.x; column < outline.first.x + outline.size.x; column += 4u) {
        let word = row * params.row_words + column / 4u;
        var tissues = segmentation[word];
        for (var i = 0u; i < 4u; i++) {
            let mask = 0xffu << (8u * i);
            // Pixels outside the sector have the number 0.
            if (tissues & mask) != 0u && covers(column + i, row) {
                tissues = (tissues & ~mask) | outline.tissue << (8u * i);
            }
        }
        segmentation[word] = tissues;
    }
}
