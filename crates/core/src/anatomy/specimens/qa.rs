//! Layout of a multi-purpose quality-assurance phantom of a common type. `examples/make_scenes` builds it.
//!
//! The groups follow two commercial phantoms. CIRS 040GSE (user guide at support.cirsinc.com) has a near-field group,
//! vertical and horizontal distances, axial and lateral resolution, stepped anechoic cylinders, and grey-scale targets
//! of −9, −6, −3, +3, +6 and more dB. Gammex 405 GSX LE (its user guide) has grey-scale cylinders, pins and cysts. The
//! positions are our own, so that everything fits below one linear probe 60 mm wide. All targets are parallel to y.
//!
//! Real filaments are 0.08 to 0.1 mm thick, a fraction of a wavelength, and scatter more than their geometric width.
//! Rays see only the width. The wires are therefore bars of [`WIRE_MM`] with a flat side up, about as bright above the
//! speckle as real ones. The wires of the vertical group are offset sideways by 0.4 mm, out of each other's shadow. In
//! a real phantom, diffraction fills the shadow.

/// Side of a wire's square cross-section, mm.
pub const WIRE_MM: f32 = 0.3;
/// Distance between neighbouring wires of the vertical group, and depth of the first wire, mm.
pub(crate) const VERTICAL_STEP_MM: f32 = 10.0;
/// Number of wires of the vertical group.
pub const VERTICAL_COUNT: u16 = 12;
/// Lateral positions of the wires of a horizontal group, mm.
pub const HORIZONTAL_MM: [f32; 4] = [-20.0, -10.0, 10.0, 20.0];
/// Depths of the horizontal groups, mm.
pub const HORIZONTAL_DEPTHS_MM: [f32; 2] = [40.0, 90.0];
/// Distances between neighbouring wires of a resolution group, mm.
pub(crate) const RESOLUTION_MM: [f32; 6] = [4.0, 3.0, 2.0, 1.0, 0.5, 0.25];
/// Depths at which the resolution groups begin, mm.
pub const RESOLUTION_DEPTHS_MM: [f32; 2] = [24.0, 100.0];
/// Grey-scale targets: lateral position (mm), level relative to the background (dB), and name of the tissue.
pub const CONTRAST: [(f32, f64, &str); 6] = [
    (-25.0, -9.0, "tmm_minus_9_db"),
    (-15.0, -6.0, "tmm_minus_6_db"),
    (-5.0, -3.0, "tmm_minus_3_db"),
    (5.0, 3.0, "tmm_plus_3_db"),
    (15.0, 6.0, "tmm_plus_6_db"),
    (25.0, 15.0, "tmm_plus_15_db"),
];
/// Depth of the grey-scale targets, mm.
pub const CONTRAST_DEPTH_MM: f32 = 55.0;
/// Diameter of the grey-scale targets, mm.
pub const CONTRAST_DIAMETER_MM: f32 = 8.0;
/// Anechoic cylinders: lateral position, depth and diameter, mm.
pub const CYSTS_MM: [(f32, f32, f32); 10] = [
    (-22.0, 76.0, 10.0),
    (-11.0, 76.0, 6.7),
    (-4.5, 76.0, 4.0),
    (5.0, 76.0, 3.0),
    (11.0, 76.0, 2.0),
    (17.0, 76.0, 1.3),
    (-22.0, 14.0, 4.0),
    (-14.0, 14.0, 3.0),
    (14.0, 14.0, 2.0),
    (22.0, 14.0, 1.3),
];

/// Lateral position and depth of the wire with this index in the vertical group, mm.
pub fn vertical(index: u16) -> (f32, f32) {
    (0.4 * (f32::from(index) - 5.5), VERTICAL_STEP_MM * f32::from(index + 1))
}

/// Lateral positions and depths of the wires of a resolution group, mm: a staircase on the right, a row on the left.
pub fn resolution(depth_mm: f32) -> Vec<(f32, f32)> {
    let mut positions = vec![(8.0, depth_mm), (-8.0, depth_mm)];
    let mut apart = 0.0;
    for (i, step) in RESOLUTION_MM.into_iter().enumerate() {
        apart += step;
        // A sideways step of 1.5 mm keeps each wire out of the shadow of the wire above.
        positions.push((8.0 + 1.5 * (i + 1) as f32, depth_mm + apart));
        if step > WIRE_MM + 0.1 {
            positions.push((-8.0 - apart, depth_mm));
        }
    }
    positions
}
