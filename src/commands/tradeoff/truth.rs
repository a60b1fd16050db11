//! Converged images at one pose, which points are compared with.

use insonify::quality::speckle::speckle;
use insonify::quality::{ClassSpeckle, Pair};
use insonify::render::Frame;

use super::super::Failure;

/// Reference images at one pose.
pub(super) struct Truth {
    pub(super) size: [usize; 2],
    pub(super) bmode: Vec<u8>,
    pub(super) segmentation: Vec<u8>,
    pub(super) mask: Vec<u8>,
    pub(super) speckle: Vec<ClassSpeckle>,
}

impl Truth {
    pub(super) fn of(frame: &Frame, dynamic_range_db: f64) -> Result<Self, Failure> {
        let size = [frame.width as usize, frame.height as usize];
        Self::new(size, frame.bmode.clone(), frame.segmentation.clone(), frame.mask.clone(), dynamic_range_db)
    }

    pub(super) fn new(
        size: [usize; 2],
        bmode: Vec<u8>,
        segmentation: Vec<u8>,
        mask: Vec<u8>,
        range_db: f64,
    ) -> Result<Self, Failure> {
        let speckle = speckle(&bmode, &segmentation, size, range_db)?;
        Ok(Self { size, bmode, segmentation, mask, speckle })
    }

    /// Pair of `image` and this reference within the sector.
    pub(super) fn pair<'a>(&'a self, image: &'a [u8]) -> Result<Pair<'a>, Failure> {
        Ok(Pair::new(self.size, image, &self.bmode, Some(&self.mask))?)
    }
}
