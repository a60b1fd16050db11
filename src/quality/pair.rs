//! Two images of one size, and where they are compared.

use super::QualityError;

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
    /// `image` and `reference` [height × width] are compared everywhere, or where `mask` [height × width] is not 0.
    ///
    /// # Errors
    /// A map that does not have that size, an image without pixels, a mask without a pixel inside.
    pub fn new(
        [width, height]: [usize; 2],
        image: &'a [u8],
        reference: &'a [u8],
        mask: Option<&'a [u8]>,
    ) -> Result<Self, QualityError> {
        if width == 0 || height == 0 {
            return Err(QualityError::NoPixels { width, height });
        }
        let maps = [("image", image), ("reference", reference), ("mask", mask.unwrap_or(image))];
        for (what, map) in maps {
            if Some(map.len()) != width.checked_mul(height) {
                return Err(QualityError::Size { what, found: map.len(), width, height });
            }
        }
        if mask.is_some_and(|mask| mask.iter().all(|&m| m == 0)) {
            return Err(QualityError::EmptyMask);
        }
        Ok(Self { image, reference, mask, width, height })
    }

    /// Whether the pixel of that index is compared.
    pub(super) fn inside(&self, index: usize) -> bool {
        self.mask.is_none_or(|mask| mask[index] != 0)
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
