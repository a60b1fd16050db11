//! Two images of the same size, and the mask of the pixels that are compared.

use super::QualityError;
use super::error::{check_holds, check_sizes};

/// Side of a patch, pixels.
pub const PATCH: usize = 32;

/// An image, its reference, and the mask within which they are compared.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    pub(super) image: &'a [u8],
    pub(super) reference: &'a [u8],
    pub(super) mask: Option<&'a [u8]>,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl<'a> Pair<'a> {
    /// Compares `image` and `reference` [height × width], either everywhere or only where `mask` [height × width] is
    /// not 0.
    ///
    /// # Errors
    /// A map has another size, the image has no pixels, or the mask has no pixel inside.
    pub fn new(
        size @ [width, height]: [usize; 2],
        image: &'a [u8],
        reference: &'a [u8],
        mask: Option<&'a [u8]>,
    ) -> Result<Self, QualityError> {
        if width == 0 || height == 0 {
            return Err(QualityError::NoPixels { width, height });
        }
        check_sizes(size, &[("image", image), ("reference", reference), ("mask", mask.unwrap_or(image))])?;
        if mask.is_some_and(|mask| mask.iter().all(|&m| m == 0)) {
            return Err(QualityError::EmptyMask);
        }
        Ok(Self { image, reference, mask, width, height })
    }

    /// Whether the pixel with this index is compared.
    pub(super) fn inside(&self, index: usize) -> bool {
        self.mask.is_none_or(|mask| mask[index] != 0)
    }

    /// Mean of `values` over the patches. `values` receives the indices of a patch's pixels inside the mask. A patch
    /// counts if at least half of its pixels are inside. Patches do not overlap, and the first one is at the upper
    /// left corner. Incomplete patches at the right and bottom edges are ignored.
    ///
    /// # Errors
    /// The image is smaller than a patch, or the mask leaves no patch.
    pub(super) fn mean_over_patches<const N: usize>(
        &self,
        metric: &'static str,
        values: impl Fn(&[usize]) -> [f64; N],
    ) -> Result<[f64; N], QualityError> {
        check_holds([self.width, self.height], PATCH, metric)?;
        let (mut sums, mut patches) = ([0.0; N], 0u32);
        let mut indices = Vec::with_capacity(PATCH * PATCH);
        for top in (0..=self.height - PATCH).step_by(PATCH) {
            for left in (0..=self.width - PATCH).step_by(PATCH) {
                let rows = (top..top + PATCH).map(|row| row * self.width + left);
                indices.clear();
                indices.extend(rows.flat_map(|start| start..start + PATCH).filter(|&index| self.inside(index)));
                if 2 * indices.len() >= PATCH * PATCH {
                    sums.iter_mut().zip(values(&indices)).for_each(|(sum, value)| *sum += value);
                    patches += 1;
                }
            }
        }
        if patches == 0 {
            Err(QualityError::NoPatch { patch: PATCH })
        } else {
            Ok(sums.map(|sum| sum / f64::from(patches)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_masks_are_checked() {
        let of = |size, image: &[u8], mask| Pair::new(size, image, &[0; 6], mask).map(|_| ());
        assert_eq!(of([3, 2], &[0; 6], None), Ok(()));
        assert_eq!(of([3, 2], &[0; 6], Some(&[0, 0, 0, 0, 0, 1])), Ok(()));
        let short = QualityError::Size { what: "image", found: 5, width: 3, height: 2 };
        assert_eq!(of([3, 2], &[0; 5], None), Err(short));
        assert!(matches!(of([3, 2], &[0; 6], Some(&[1; 7])), Err(QualityError::Size { what: "mask", .. })));
        assert_eq!(of([3, 2], &[0; 6], Some(&[0; 6])), Err(QualityError::EmptyMask));
        assert_eq!(of([0, 2], &[], None), Err(QualityError::NoPixels { width: 0, height: 2 }));
    }
}
