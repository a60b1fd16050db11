//! Multiplies the transmission of the cells behind the needle.

use crate::host::constants::ImageConstants;
use crate::needle::Shadow;

/// Applies the shadow to `mask`, complex [planes × cells].
pub(in crate::host) fn needle_shadow(constants: ImageConstants, shadows: &[Shadow], mask: &mut [[f32; 2]]) {
    for &Shadow { cell, passes } in shadows {
        if let Some([re, im]) = mask.get_mut(cell as usize) {
            let passes = constants.needle_transmission() * passes;
            (*re, *im) = (*re * passes, *im * passes);
        }
    }
}
