//! Maps that a generator reads.

use super::GeneratorError;
use super::manifest::{Channel, Manifest};
use crate::render::Frame;
use crate::transducer::ScanGeometry;

/// Maps of one frame, row by row; the first row is the nearest to the probe. Maps that the model does not take
/// ([`Manifest::takes`]) are not read and may be empty. The mask must not be empty.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// Width of the frame, pixels.
    pub width: u32,
    /// Height of the frame, pixels.
    pub height: u32,
    /// Grey levels [height × width].
    pub image: &'a [u8],
    /// Tissue numbers [height × width]: the index of the tissue in the station's table plus 1, or 0 outside the sector.
    pub segmentation: &'a [u8],
    /// One-way attenuation divided by its 98th percentile, 0..=1 [height × width].
    pub attenuation: &'a [f32],
    /// 255 inside the sector, 0 outside [height × width].
    pub mask: &'a [u8],
    /// Geometry of the scanlines in the picture. Only models in beam coordinates ([`Manifest::beam`]) need it.
    pub scan: Option<ScanGeometry>,
}

impl<'a> From<&'a Frame> for Input<'a> {
    fn from(frame: &'a Frame) -> Self {
        Self {
            width: frame.width,
            height: frame.height,
            image: &frame.bmode,
            segmentation: &frame.segmentation,
            attenuation: &frame.attenuation,
            mask: &frame.mask,
            scan: frame.scan,
        }
    }
}

impl Input<'_> {
    /// Checks that all maps taken by the model have the frame's size.
    pub(super) fn check(&self, manifest: &Manifest) -> Result<(), GeneratorError> {
        let (width, height) = (self.width, self.height);
        let expected = width as usize * height as usize;
        let maps = [
            (Channel::Mask, "mask", self.mask.len()),
            (Channel::Image, "image", self.image.len()),
            (Channel::Segmentation, "segmentation", self.segmentation.len()),
            (Channel::Attenuation, "attenuation", self.attenuation.len()),
        ];
        let wrong = |&(channel, _, found): &(Channel, _, usize)| {
            manifest.takes(channel) && (found != expected || expected == 0)
        };
        match maps.into_iter().find(wrong) {
            Some((_, map, found)) => Err(GeneratorError::InputSize { map, width, height, expected, found }),
            None => Ok(()),
        }
    }
}
