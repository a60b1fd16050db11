//! Post-processing of pictures, as a scanner does it after the lines: speckle reduction, edge enhancement, persistence,
//! grey maps.
//!
//! Pictures are grey levels [height × width], 0 outside the sector. A [`Look`] holds the memory for one stream of
//! pictures. Each step has an f64 twin in `twin.rs`.

mod blur;
mod edges;
mod grey_map;
mod persistence;
mod speckle_reduction;
#[cfg(test)]
mod tests;
#[cfg(any(test, feature = "test-hooks"))]
pub mod twin;

use blur::Blur;
use edges::enhance;
pub use grey_map::table as grey_table;
use persistence::Persistence;
use speckle_reduction::SpeckleReduction;

use insonify_core::settings::{GreyMap, ImageSettings, LookSettings};

/// Post-processing of one stream of pictures.
#[derive(Debug, Default)]
pub struct Look {
    speckle: SpeckleReduction,
    blur: Blur,
    persistence: Persistence,
}

/// Size, mask and scale of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    /// Width, pixels.
    pub width: usize,
    /// Side of a pixel, mm. Persistence starts over when it changes.
    pub pixel_mm: f64,
    /// 255 inside the sector [height × width].
    pub mask: &'a [u8],
    /// Dynamic range of the grey levels, dB.
    pub dynamic_range_db: f64,
    /// Number of independent pictures in the compounded mean; 1 without compounding.
    pub independent_angles: f64,
}

impl<'a> Shape<'a> {
    /// Shape of a picture made with the settings `image`.
    pub fn new(width: u32, pixel_mm: f64, mask: &'a [u8], image: &ImageSettings, independent_angles: f64) -> Self {
        Self { width: width as usize, pixel_mm, mask, dynamic_range_db: image.dynamic_range_db, independent_angles }
    }
}

impl Look {
    /// Whether these settings leave pictures unchanged.
    pub fn is_plain(settings: &LookSettings) -> bool {
        settings.speckle_reduction == 0.0
            && settings.edge_enhancement == 0.0
            && settings.persistence == 0.0
            && settings.grey_map == GreyMap::Linear
    }

    /// Forgets all earlier pictures.
    pub fn reset(&mut self) {
        self.persistence.reset();
    }

    /// Processes the next picture in place.
    pub fn apply(&mut self, settings: &LookSettings, shape: Shape<'_>, picture: &mut [u8]) {
        if Self::is_plain(settings) || shape.width == 0 || shape.mask.len() != picture.len() {
            self.reset();
            return;
        }
        if settings.speckle_reduction > 0.0 {
            self.speckle.apply(settings.speckle_reduction as f32, shape, picture);
        }
        if settings.edge_enhancement > 0.0 {
            enhance(&mut self.blur, settings.edge_enhancement as f32, shape, picture);
        }
        self.persistence.apply(settings.persistence as f32, shape, picture);
        if settings.grey_map != GreyMap::Linear {
            let table = grey_map::table(settings.grey_map);
            picture.iter_mut().for_each(|level| *level = table[usize::from(*level)]);
        }
    }
}
