//! Judgement of an image: a CT in HU, a CT in other units, or no CT.

use super::error::ImageError;
use super::levels::{Levels, quantile, share_within, sorted};
use crate::segmentation::body::{distances_mm, from_mask};
use crate::segmentation::grid::Grid;
use crate::segmentation::volume::{Image, Modality};

/// Limit of the lowest value, HU: an image with lower values is in HU, since only air is that low. MR images have no
/// negative values, or only slightly negative ones.
const AIR_HU: f32 = -500.0;
/// Range of air in HU.
const AIR_RANGE_HU: std::ops::Range<f32> = -1100.0..-900.0;
/// Range of soft tissue minus air in HU, with and without contrast agent.
const AIR_TO_SOFT_HU: std::ops::Range<f32> = 950.0..1250.0;
/// Range of soft tissue minus fat in HU, with and without contrast agent.
const FAT_TO_SOFT_HU: std::ops::Range<f32> = 60.0..400.0;
/// Range of the median of soft tissue in HU, with and without contrast agent.
const SOFT_HU: std::ops::Range<f32> = -50.0..300.0;
/// Largest plausible median of soft tissue in HU, even with contrast agent.
const SOFT_HU_MAX: f32 = 400.0;
/// Largest accepted median of soft tissue, HU, in an image that the user states to be a CT. Blood with contrast agent
/// is below this limit, and values without their rescale intercept are above it.
const STATED_SOFT_HU_MAX: f32 = 800.0;
/// Range of fat in HU.
const FAT_HU: std::ops::Range<f32> = -150.0..-50.0;
/// Largest lower end of a clipped CT's window, HU, at which fat can be told from air.
const WINDOW_HU: f32 = -125.0;
/// Smallest contrast of fat to soft tissue, relative to the contrast of soft tissue to air, that shows an MR.
const BRIGHT_FAT: f32 = 0.5;
/// Range of depths below the skin at which fat is sought, mm.
const FAT_DEPTH_MM: std::ops::Range<f32> = 4.0..12.0;

/// Kind of an image, with the reason as a sentence.
pub(super) enum Judgement {
    /// A CT in HU.
    Hu(String),
    /// A CT in HU with clipped values: those below `low` became `low`.
    Window { low: f32, reason: String },
    /// An MR, or any other image in which bright voxels are the body.
    Other(String),
}

/// Judges an image by its values. `fat_ring(limit)` gives the median value just under the skin of the body, where all
/// voxels above `limit` count as body.
pub(super) fn judge(
    image: &Image,
    levels: &Levels,
    fat_ring: &dyn Fn(f32) -> Option<f32>,
) -> Result<Judgement, ImageError> {
    let refused = |air: f32, fat: Option<f32>, remedy: String| -> Result<Judgement, ImageError> {
        Err(ImageError::NotHu { path: image.path.clone(), seen: seen(levels, air, fat), remedy })
    };
    let soft = levels.soft_median();
    match image.stated {
        Some(Modality::Ct) if soft.is_some_and(|soft| !(AIR_HU..=STATED_SOFT_HU_MAX).contains(&soft)) => {
            let remedy =
                "--image-type ct doesn't convert values, and no soft tissue has such ones in HU: subtract the rescale \
                          intercept (1024 for most scanners), or convert the series anew with dcm2niix"
                    .to_owned();
            return refused(levels.least(), None, remedy);
        }
        Some(Modality::Ct) if levels.least() >= AIR_HU && levels.clipped_low(0.005) => return window(levels, &refused),
        Some(Modality::Ct) => {
            return Ok(Judgement::Hu(format!(
                "the image was taken as a CT in HU, as --image-type says: {}",
                seen(levels, levels.least(), None)
            )));
        }
        Some(Modality::Mr) => return Ok(Judgement::Other(other("as --image-type says", levels, None))),
        None => {}
    }
    if let Some(soft) = soft {
        let air = levels.air(soft - 0.3 * (soft - levels.least()).max(1.0));
        let offset = air + 1000.0;
        if AIR_TO_SOFT_HU.contains(&(soft - air)) && offset.abs() > 150.0 && is_denser(levels, air, soft) {
            let fat = fat_ring(air + 0.5 * (soft - air));
            if fat.is_none_or(|fat| FAT_TO_SOFT_HU.contains(&(soft - fat))) {
                let offset = (offset / 10.0).round() * 10.0;
                let remedy = format!(
                    "It is shifted by about {offset:.0} HU, as without its rescale intercept: subtract that (1024 for most \
                     scanners), or convert the series anew with dcm2niix"
                );
                return refused(air, fat, remedy);
            }
        }
    }
    let least = levels.least();
    if least < AIR_HU {
        // Beyond the scanner's field of view, values may be lower than air.
        let has_air = share_within(&levels.all, AIR_RANGE_HU.start, AIR_RANGE_HU.end) > 0.02;
        if !has_air && is_padded(levels) {
            let seen = seen(levels, None::<f32>, None);
            return Ok(Judgement::Hu(format!("the image was taken as a CT in HU, padded with {least:.0}: {seen}")));
        }
        let air = if has_air { -1000.0 } else { levels.air(soft.unwrap_or(0.0).min(0.0)) };
        let scaled = soft.is_some_and(|soft| {
            soft > SOFT_HU_MAX || (is_denser(levels, air, soft) && !AIR_TO_SOFT_HU.contains(&(soft - air)))
        });
        if scaled || (air < AIR_RANGE_HU.start && !has_air) {
            let remedy =
                "Air has -1000 HU and soft tissue up to 300: it was rescaled. Give the CT as dcm2niix or 3D Slicer \
                          writes it"
                    .to_owned();
            return refused(air, None, remedy);
        }
        return Ok(Judgement::Hu(format!("the image was taken as a CT in HU: {}", seen(levels, air, None))));
    }
    if is_hu_scale(levels) {
        return window(levels, &refused);
    }
    let Some(soft) = soft else {
        return Ok(Judgement::Other(other("it has no values as low as air in HU", levels, None)));
    };
    let air = levels.air(soft - 0.3 * (soft - least).max(f32::MIN_POSITIVE));
    let fat = fat_ring(air + 0.1 * (soft - air));
    // If a window begins above the fat, the values under the skin are those of muscle. Bone is then far brighter than
    // organs.
    let darker = fat.is_none_or(|fat| fat < soft - 0.05 * (soft - air));
    let far = levels.bone.as_ref().is_some_and(|bone| quantile(bone, 0.5) - air > 1.5 * (soft - air));
    // In an MR, fat may be far brighter than organs.
    let is_fat_bright = fat.is_some_and(|fat| fat > soft + BRIGHT_FAT * (soft - air));
    if is_denser(levels, air, soft) && (darker || (far && !is_fat_bright)) {
        let remedy =
            "Air, fat, organs and bone follow each other as in a CT: it was rescaled or clipped. Give the CT as \
                      dcm2niix or 3D Slicer writes it, before any normalization"
                .to_owned();
        return refused(air, fat, remedy);
    }
    Ok(Judgement::Other(other(why_other(levels, fat, soft), levels, fat)))
}

/// Judges a CT in HU without air: its field of view lies within the body, or its values are clipped.
fn window(
    levels: &Levels,
    refused: &dyn Fn(f32, Option<f32>, String) -> Result<Judgement, ImageError>,
) -> Result<Judgement, ImageError> {
    let (low, high) = (levels.least(), levels.most());
    if !levels.clipped_low(0.005) {
        let seen = seen(levels, low, None);
        return Ok(Judgement::Hu(format!("the image was taken as a CT in HU whose field holds no air: {seen}")));
    }
    if low > WINDOW_HU {
        let remedy = format!(
            "It is clipped to {low:.0} to {high:.0} HU, where fat can't be told from air. Give the CT as it was before, or \
             clip it at -200 HU or below"
        );
        return refused(low, None, remedy);
    }
    let reason = format!(
        "the image was taken as a CT clipped to {low:.0} to {high:.0} HU: what has {low:.0} is taken as air, and fat is still \
         seen"
    );
    Ok(Judgement::Window { low, reason })
}

/// Whether an image without values of air is in HU: fat is negative, and bone is as far above organs as in a CT. Also
/// true for values that are clipped above fat.
fn is_hu_scale(levels: &Levels) -> bool {
    let (low, high) = (levels.least(), levels.most());
    let soft = levels.soft_median();
    if !(AIR_HU..=-20.0).contains(&low) || high < 60.0 || soft.is_some_and(|soft| !SOFT_HU.contains(&soft)) {
        return false;
    }
    // Many voxels have the lowest value, so the values are clipped above the fat. `window` then refuses the image.
    if low > WINDOW_HU && levels.clipped_low(0.02) {
        return true;
    }
    let has_fat = share_within(&levels.all, FAT_HU.start.max(low + 1.0), FAT_HU.end) > 0.01;
    let Some(soft) = soft else { return has_fat };
    // Organs are about as far above fat, or above the lower end of a window, as bone is above organs. They are farther
    // above air.
    let below = soft - levels.air(soft - 0.3 * (soft - low));
    has_fat
        && match &levels.bone {
            // With contrast agent, a window may end just above the organs, so that bone has its highest value.
            Some(bone) => {
                let dense = quantile(bone, 0.95);
                dense - soft > 0.7 * below || dense >= high - 1.0
            }
            None => (100.0..400.0).contains(&below),
        }
}

/// Whether an image in HU is padded: nearly all values below air are equal, as in a region that wasn't scanned. A
/// rescaled CT has more distinct values there, since its air is noisy.
fn is_padded(levels: &Levels) -> bool {
    let least = levels.least();
    let padding = share_within(&levels.all, least, least + 1.0);
    let between = share_within(&levels.all, least + 1.0, AIR_RANGE_HU.start);
    levels.soft_median().is_some_and(|soft| SOFT_HU.contains(&soft))
        && share_within(&levels.all, FAT_HU.start, FAT_HU.end) > 0.01
        && least < AIR_RANGE_HU.start
        && between < 0.1 * padding
}

/// Whether nearly all bone is denser than soft tissue, as in a CT; in an MR, the cortex of a bone is dark. Without
/// labelled bone: whether all soft tissue has about one value, as far above air as in HU.
fn is_denser(levels: &Levels, air: f32, soft: f32) -> bool {
    let relative = |value: f32| (value - air) / (soft - air).max(f32::MIN_POSITIVE);
    match (&levels.bone, &levels.soft) {
        (Some(bone), _) => {
            let at = |share| relative(quantile(bone, share));
            at(0.1) > 0.9 && at(0.5) > 1.03 && at(0.9) > 1.1
        }
        (None, Some(values)) => {
            // In a CT without contrast agent, the values of all organs lie within 60 HU: 6 % of their distance from
            // air.
            let spread = relative(quantile(values, 0.9)) - relative(quantile(values, 0.1));
            spread < 0.15 && AIR_TO_SOFT_HU.contains(&(soft - air))
        }
        (None, None) => false,
    }
}

/// Median value of the unlabelled voxels at `FAT_DEPTH_MM` below the surface of the body. Voxels above `limit` count as
/// body. `None` if there are no such voxels.
pub(super) fn fat_ring(values: &[f32], grid: &Grid, labels: &[u16], limit: f32) -> Option<f32> {
    let body = from_mask(values.iter().map(|value| *value > limit).collect(), grid, |_| false);
    let outside: Vec<bool> = body.iter().map(|inside| !inside).collect();
    let depth_mm = distances_mm(&outside, grid.size, grid.voxel_mm());
    let ring = (0..values.len()).filter(|&i| labels[i] == 0 && FAT_DEPTH_MM.contains(&depth_mm[i]));
    let sorted = sorted(ring.map(|i| values[i]));
    (!sorted.is_empty()).then(|| quantile(&sorted, 0.5))
}

fn why_other(levels: &Levels, fat: Option<f32>, soft: f32) -> &'static str {
    match (fat, &levels.bone) {
        (Some(fat), _) if fat > soft => "fat under the skin is brighter than organs",
        (_, Some(bone)) if quantile(bone, 0.1) < 0.9 * soft => "bone has dark parts",
        _ => "its values are neither HU nor in the order of a CT",
    }
}

/// Sentence that an image is no CT, with the reason `why`.
fn other(why: &str, levels: &Levels, fat: Option<f32>) -> String {
    let seen = seen(levels, levels.least(), fat);
    format!("the image was taken as an MR, {why} ({seen}): its fat isn't used")
}

/// Values of air, lungs, fat, soft tissue and bone in the image, as text.
fn seen(levels: &Levels, air: impl Into<Option<f32>>, fat: Option<f32>) -> String {
    let number = |value: f32| if value.abs() < 10.0 { format!("{value:.2}") } else { format!("{value:.0}") };
    let median = |values: &Option<Vec<f32>>| values.as_ref().map(|values| quantile(values, 0.5));
    let named = [
        ("air", air.into()),
        ("lungs", median(&levels.lungs)),
        ("fat", fat),
        ("soft tissue", median(&levels.soft)),
        ("bone", median(&levels.bone)),
    ];
    let known = named.into_iter().filter_map(|(name, value)| Some(format!("{name} {}", number(value?))));
    known.collect::<Vec<_>>().join(", ")
}
