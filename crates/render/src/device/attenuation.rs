//! Attenuation in the form that leaves the device: its square root in 16 bits per pixel, in steps of 1/65,535.

use crate::constants::ROOT_STEPS;

/// Attenuation from its coded root; 0 and 1 are exact.
pub(super) fn level(root: u16) -> f32 {
    let root = f32::from(root) * (1.0 / ROOT_STEPS as f32);
    root * root
}

/// Decodes the first `width` roots of each row of `stride`. One thread does it, as for the other maps.
pub(super) fn unpad_levels(into: &mut Vec<f32>, from: &[u16], width: usize, stride: usize) {
    into.clear();
    if width == stride {
        into.extend(from.iter().map(|&root| level(root)));
        return;
    }
    for row in from.chunks_exact(stride) {
        into.extend(row[..width].iter().map(|&root| level(root)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_kept_to_a_step_and_dark_ones_to_far_less() {
        assert_eq!((level(0), level(u16::MAX)), (0.0, 1.0));
        assert!((0..u16::MAX).all(|root| level(root) < level(root + 1)));
        let step = 1.0 / ROOT_STEPS;
        for tenth_db in 0..2400 {
            let exact = 10f64.powf(-f64::from(tenth_db) / 200.0);
            let kept = f64::from(level((ROOT_STEPS * exact.sqrt() + 0.5) as u16));
            // Half a step of the root, and the rounding of the square.
            let bound = step * exact.sqrt() + 0.25 * step * step + 1.0e-7 * exact;
            assert!((kept - exact).abs() <= bound, "{exact}: {kept}");
            // Data sets keep one byte of the fourth root. Even for tiny values, it changes by less than a step.
            assert!(255.0 * (kept.powf(0.25) - exact.powf(0.25)).abs() < 0.71, "{exact}: {kept}");
        }
    }

    #[test]
    fn rows_lose_their_padding() {
        let (mut levels, roots) = (vec![9.0], [65_535, 0, 7, 0, 65_535, 7]);
        unpad_levels(&mut levels, &roots, 2, 3);
        assert_eq!(levels, [1.0, 0.0, 0.0, 1.0]);
        unpad_levels(&mut levels, &roots, 3, 3);
        assert_eq!(levels, roots.map(level));
    }
}
