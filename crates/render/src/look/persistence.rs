//! Persistence: a running mean of pictures whose weights decrease with age.

use rayon::prelude::*;

use super::Shape;

/// Pixels per task.
const CHUNK: usize = 1 << 16;

/// The running mean.
#[derive(Debug, Default)]
pub(super) struct Persistence {
    /// Levels of the mean; empty before the first picture.
    mean: Vec<f32>,
    /// Width (pixels) and pixel size (mm) of the averaged pictures.
    scale: (usize, f64),
}

impl Persistence {
    /// Forgets the pictures so far.
    pub(super) fn reset(&mut self) {
        self.mean.clear();
    }

    /// Replaces a picture by `amount` (0..1) times the mean plus 1 − `amount` times the picture, which becomes the new
    /// mean. A picture of another size or pixel size starts a new mean.
    pub(super) fn apply(&mut self, amount: f32, shape: Shape<'_>, picture: &mut [u8]) {
        if amount == 0.0 {
            return self.reset();
        }
        let scale = (shape.width, shape.pixel_mm);
        if self.mean.len() != picture.len() || self.scale != scale {
            self.scale = scale;
            self.mean.clear();
            self.mean.extend(picture.iter().map(|&level| f32::from(level)));
            return;
        }
        let chunks = self.mean.par_chunks_mut(CHUNK).zip(picture.par_chunks_mut(CHUNK));
        chunks.for_each(|(mean, picture)| {
            for (mean, level) in mean.iter_mut().zip(picture) {
                *mean = amount * *mean + (1.0 - amount) * f32::from(*level);
                *level = (*mean + 0.5) as u8;
            }
        });
    }
}
