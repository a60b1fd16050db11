//! The tracked needle: its gauge, length, bevel and finish.

use serde::{Deserialize, Serialize};

use super::{settings, stored_word};

/// Outer and inner diameters of hypodermic needles by gauge, mm: ISO 9626 and the usual regular wall.
const DIAMETERS_MM: [(u32, f64, f64); 14] = [
    (14, 2.11, 1.60),
    (15, 1.83, 1.37),
    (16, 1.65, 1.19),
    (17, 1.47, 1.07),
    (18, 1.27, 0.84),
    (19, 1.07, 0.69),
    (20, 0.91, 0.60),
    (21, 0.82, 0.51),
    (22, 0.72, 0.41),
    (23, 0.64, 0.34),
    (24, 0.57, 0.31),
    (25, 0.51, 0.26),
    (26, 0.46, 0.26),
    (27, 0.41, 0.21),
];

/// Kind of the second tracked tool.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NeedleKind {
    /// A smooth steel shaft, which reflects like a mirror.
    #[default]
    Plain,
    /// A shaft with an etched surface, which also scatters sound to all sides.
    Etched,
    /// A pointer without an echo. Displays draw it over the picture and in the 3-D view.
    Pointer,
}

crate::names::named!(NeedleKind { Plain = "plain", Etched = "etched", Pointer = "pointer" });

stored_word!(NeedleKind);

settings! {
    /// The needle of a station, from its `[needle]`.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct NeedleSettings in "needle" {
        /// Gauge of the needle, which sets its outer and inner diameter.
        gauge: u32 = 22, "", 14.0..=27.0, Everything;

        /// Length of the shaft from the hub to the tip.
        length_mm: f64 = 90.0, "mm", 10.0..=300.0, Everything;

        /// Angle between the bevel's facet and the shaft; 90: a blunt end.
        bevel_deg: f64 = 17.0, "°", 10.0..=90.0, Everything;

        /// Kind of the tool: a plain or an etched needle, or a pointer without an echo.
        kind: NeedleKind = NeedleKind::Plain, "", NeedleKind::RANGE, Everything;
    }
}

impl NeedleSettings {
    /// Outer and inner diameter by gauge, mm. A gauge outside its range counts as the nearest one.
    fn diameters_mm(&self) -> (f64, f64) {
        let first = DIAMETERS_MM[0].0;
        let index = (self.gauge.max(first) - first) as usize;
        let (_, outer_mm, inner_mm) = DIAMETERS_MM[index.min(DIAMETERS_MM.len() - 1)];
        (outer_mm, inner_mm)
    }

    /// Outer diameter of the shaft, mm.
    pub fn diameter_mm(&self) -> f64 {
        self.diameters_mm().0
    }

    /// Outer radius of the shaft, mm.
    pub fn radius_mm(&self) -> f64 {
        0.5 * self.diameter_mm()
    }

    /// Diameter of the lumen, mm.
    pub fn bore_mm(&self) -> f64 {
        self.diameters_mm().1
    }

    /// Whether the tool has an echo.
    pub fn echoes(&self) -> bool {
        self.kind != NeedleKind::Pointer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauges_have_the_diameters_of_the_standard() {
        for (gauge, outer_mm) in [(18, 1.27), (20, 0.91), (22, 0.72), (25, 0.51)] {
            let needle = NeedleSettings { gauge, ..NeedleSettings::default() };
            assert_eq!((needle.diameter_mm(), 2.0 * needle.radius_mm()), (outer_mm, outer_mm), "{gauge}");
            assert!(needle.bore_mm() < outer_mm);
        }
        assert!(DIAMETERS_MM.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1 && pair[1].1 < pair[0].1));
    }
}
