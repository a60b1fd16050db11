//! Scene: quality-assurance phantom with the layout of [`insonify::anatomy::specimens::qa`].

use std::f32::consts::FRAC_1_SQRT_2;

use glam::Vec3;
use insonify::anatomy::Mesh;
use insonify::anatomy::analytic::{Part, joined, tube};
use insonify::anatomy::specimens::qa::{
    CONTRAST, CONTRAST_DEPTH_MM, CONTRAST_DIAMETER_MM, CYSTS_MM, HORIZONTAL_DEPTHS_MM, HORIZONTAL_MM,
    RESOLUTION_DEPTHS_MM, VERTICAL_COUNT, WIRE_MM, resolution, vertical,
};

use super::layer;

/// Lateral positions and depths of the near-field wires, mm.
const NEAR_FIELD_MM: [(f32, f32); 5] = [(-28.0, 1.0), (-26.0, 2.0), (-24.0, 3.0), (-22.0, 4.0), (-20.0, 5.0)];
const HALF_LENGTH_MM: f32 = 38.0;

/// Block of tissue-mimicking material from x = −45 to 45 mm and z = 0.3 to 130 mm. The probe's gel is above it.
pub(crate) fn qa_phantom() -> Vec<Part> {
    let mut parts = vec![
        layer("background", "tmm", 1, (45.0, 40.0), (0.3, 130.0)),
        Part { name: "wires", tissue: "nylon", priority: 3, mesh: wires() },
        Part {
            name: "cysts",
            tissue: "tmm_anechoic",
            priority: 2,
            mesh: joined(CYSTS_MM.map(|(x, depth, diameter)| cylinder(x, depth, diameter))),
        },
    ];
    let names = ["target -9 dB", "target -6 dB", "target -3 dB", "target +3 dB", "target +6 dB", "target +15 dB"];
    parts.extend(names.into_iter().zip(CONTRAST).map(|(name, (x, _, tissue))| {
        let mesh = cylinder(x, CONTRAST_DEPTH_MM, CONTRAST_DIAMETER_MM);
        Part { name, tissue, priority: 2, mesh }
    }));
    parts
}

fn wires() -> Mesh {
    let vertical = (0..VERTICAL_COUNT).map(vertical);
    let horizontal = HORIZONTAL_DEPTHS_MM.into_iter().flat_map(|depth| HORIZONTAL_MM.map(|x| (x, depth)));
    let places = NEAR_FIELD_MM.into_iter().chain(vertical).chain(horizontal);
    joined(places.chain(RESOLUTION_DEPTHS_MM.into_iter().flat_map(resolution)).map(|(x, depth)| {
        let half = WIRE_MM * FRAC_1_SQRT_2;
        along_y(x, depth + 0.5 * WIRE_MM, half, 4)
    }))
}

fn cylinder(x_mm: f32, depth_mm: f32, diameter_mm: f32) -> Mesh {
    along_y(x_mm, depth_mm, 0.5 * diameter_mm, 48)
}

fn along_y(x_mm: f32, depth_mm: f32, radius_mm: f32, sides: u32) -> Mesh {
    let ring = |y| (Vec3::new(x_mm, y, depth_mm), (radius_mm, radius_mm));
    tube(&[ring(-HALF_LENGTH_MM), ring(HALF_LENGTH_MM)], sides)
}
