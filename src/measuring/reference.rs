//! Converged images at one pose, with which measured frames are compared.

use crate::quality::speckle::speckle;
use crate::quality::{ClassSpeckle, Pair, QualityError};
use crate::render::Frame;
use std::sync::Arc;

/// Reference images at one pose.
#[derive(Debug)]
pub(crate) struct Reference {
    pub(super) size: [usize; 2],
    pub(super) bmode: Vec<u8>,
    pub(super) segmentation: Vec<u8>,
    pub(super) mask: Arc<[u8]>,
    pub(super) speckle: Vec<ClassSpeckle>,
}

impl Reference {
    pub(super) fn of(frame: &Frame, dynamic_range_db: f64) -> Result<Self, QualityError> {
        let size = [frame.width as usize, frame.height as usize];
        Self::new(size, frame.bmode.clone(), frame.segmentation.clone(), frame.mask.clone(), dynamic_range_db)
    }

    pub(super) fn new(
        size: [usize; 2],
        bmode: Vec<u8>,
        segmentation: Vec<u8>,
        mask: Arc<[u8]>,
        range_db: f64,
    ) -> Result<Self, QualityError> {
        let speckle = speckle(&bmode, &segmentation, size, range_db)?;
        Ok(Self { size, bmode, segmentation, mask, speckle })
    }

    /// `image` paired with this reference, within the sector.
    pub(super) fn pair<'a>(&'a self, image: &'a [u8]) -> Result<Pair<'a>, QualityError> {
        Pair::new(self.size, image, &self.bmode, Some(&self.mask))
    }
}
