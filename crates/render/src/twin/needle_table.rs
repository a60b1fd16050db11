//! The table of a frame's needle in f64.

use crate::needle::{NeedleFrame, Outline};

/// One echo of the needle on a scanline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleEcho {
    /// Depth at which the sound meets the needle, mm along the scanline.
    pub depth_mm: f64,
    /// Length that reverberation adds to the range, mm; below 0: minus the number of round trips.
    pub extra_mm: f64,
    /// Amplitude over a perfect plate's echo.
    pub amplitude: f64,
    /// Phase in addition to the range's, turns.
    pub turns: f64,
}

/// The table of a frame's needle.
#[derive(Debug, Clone, PartialEq)]
pub struct Needle {
    /// Echoes of each scanline.
    pub echoes: Vec<Vec<NeedleEcho>>,
    /// Index of a cell of the scan plane [planes × cells], and the amplitude that passes.
    pub shadows: Vec<(usize, f64)>,
    pub(crate) outline: Outline,
}

impl Needle {
    pub(crate) fn new(frame: &NeedleFrame) -> Self {
        let echo = |echo: &crate::needle::NeedleEcho| NeedleEcho {
            depth_mm: echo.depth_mm.into(),
            extra_mm: echo.extra_mm.into(),
            amplitude: echo.amplitude.into(),
            turns: echo.turns.into(),
        };
        let line = |ends: &[u32]| frame.echoes[ends[0] as usize..ends[1] as usize].iter().map(echo).collect();
        Self {
            echoes: frame.starts.windows(2).map(line).collect(),
            shadows: frame.shadows.iter().map(|shadow| (shadow.cell as usize, shadow.passes.into())).collect(),
            outline: frame.outline,
        }
    }

    /// Number of the needle's tissue in the segmentation.
    pub fn tissue(&self) -> u8 {
        self.outline.tissue as u8
    }
}
