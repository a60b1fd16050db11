//! Whether an image fits the labels: no organs in air, and no mirror image that fits better.

use super::error::ImageError;
use super::judge::Judgement;
use super::levels::{Levels, Matter, Sample, quantile, value};
use crate::segmentation::volume::Image;

/// Value between soft tissue and aerated lung, HU.
const AIR_HU: f32 = -300.0;
/// Share of the soft tissue in air from which a CT is refused, in the background from which another image is, and in air
/// from which a remark is made.
const REFUSED_SHARE: f64 = 0.2;
const REFUSED_SHARE_MR: f64 = 0.5;
const REMARKED_SHARE: f64 = 0.03;
/// Brightness below which an image other than a CT shows background, relative to its brightest parts.
const BACKGROUND: f32 = 0.03;
/// Least share of the variance that organs explain in a mirror image that is taken for the right one, and by how much it
/// must be better.
const EXPLAINED: f64 = 0.5;
const BETTER: f64 = 0.15;
/// Lowest density of the dense parts of bone, HU.
const CORTEX_HU: f32 = 150.0;

/// How well an image fits the labels, perhaps mirrored.
#[derive(Debug, Clone, Copy, Default)]
struct Fit {
    /// Axes that are reversed.
    mirrored: [bool; 3],
    /// Share of the soft tissue in air.
    in_air: f64,
    /// Share of the variance at labelled voxels that lies between organs, not within them.
    explained: f64,
}

/// Remarks on the fit of an image.
///
/// # Errors
/// Soft tissue in air, and a mirror image that fits better.
pub(super) fn check(
    image: &Image,
    sample: &Sample,
    levels: &Levels,
    judgement: &Judgement,
) -> Result<Vec<String>, ImageError> {
    let is_ct = !matches!(judgement, Judgement::Other(_));
    let limit = match judgement {
        Judgement::Hu(_) => AIR_HU,
        Judgement::Window { low, .. } => low + 1.0,
        Judgement::Other(_) => {
            let (least, bright) = (levels.least(), quantile(&levels.all, 0.98));
            least + BACKGROUND * (bright - least)
        }
    };
    let range = (quantile(&levels.all, 0.005), quantile(&levels.all, 0.995));
    let fits: Vec<Fit> = (0..8usize)
        .map(|bits| Fit::of(image, sample, std::array::from_fn(|axis| bits >> axis & 1 == 1), limit, range))
        .collect();
    let Some((own, mirrored)) = fits.split_first() else { return Ok(Vec::new()) };
    let better = mirrored.iter().filter(|fit| {
        fit.explained > EXPLAINED && fit.explained > own.explained + BETTER && fit.in_air <= own.in_air + 0.01
    });
    let best = better.max_by(|a, b| a.explained.total_cmp(&b.explained));
    let percent = 100.0 * own.in_air;
    if own.in_air > if is_ct { REFUSED_SHARE } else { REFUSED_SHARE_MR } {
        let hint = match best {
            Some(fit) => format!(
                "Mirrored {}, only {:.0} % would: mirror its voxels and keep its affine, or give the image that was \
                 segmented",
                fit.direction(),
                100.0 * fit.in_air
            ),
            None => "It is shifted, or of another scan: give the image that was segmented".to_owned(),
        };
        let what = if is_ct { "air" } else { "the dark background" };
        let soft = levels.soft_median().unwrap_or(f32::NAN);
        let unit = if is_ct { " HU" } else { "" };
        let seen = format!("median {soft:.0}{unit}");
        return Err(ImageError::InAir { path: image.path.clone(), percent, what, seen, hint });
    }
    if let Some(fit) = best {
        return Err(ImageError::Mirrored {
            path: image.path.clone(),
            direction: fit.direction(),
            percent: 100.0 * own.explained,
            mirrored: 100.0 * fit.explained,
        });
    }
    let mut remarks = Vec::new();
    if is_ct && own.in_air > REMARKED_SHARE {
        remarks.push(format!(
            "{percent:.0} % of the labelled soft tissue lies in the CT's air: is the image of the same scan?"
        ));
    }
    // A window may end below the cortex.
    let cortex = CORTEX_HU.min(0.9 * levels.most());
    if let Some(dense) = levels.bone.as_ref().map(|bone| quantile(bone, 0.9)).filter(|dense| is_ct && *dense < cortex) {
        let remark =
            format!("nine tenths of the labelled bone have less than {dense:.0} HU: is the image of the same scan?");
        remarks.push(remark);
    }
    Ok(remarks)
}

impl Fit {
    fn of(image: &Image, sample: &Sample, mirrored: [bool; 3], limit: f32, range: (f32, f32)) -> Self {
        // Number, sum and sum of squares of each organ.
        let mut of_organs = vec![(0.0_f64, 0.0_f64, 0.0_f64); sample.organs];
        let (mut soft, mut in_air) = (0usize, 0usize);
        for voxel in &sample.voxels {
            let at = std::array::from_fn(|axis| {
                let at = voxel.at[axis];
                if mirrored[axis] { image.size[axis] - 1 - at } else { at }
            });
            let found = value(image, at);
            if !found.is_finite() {
                continue;
            }
            if voxel.matter == Matter::Soft {
                soft += 1;
                in_air += usize::from(found < limit);
            }
            let clamped = f64::from(found.clamp(range.0, range.1.max(range.0)));
            let (count, sum, squares) = &mut of_organs[usize::from(voxel.organ)];
            (*count, *sum, *squares) = (*count + 1.0, *sum + clamped, *squares + clamped * clamped);
        }
        let total = of_organs.iter().fold((0.0, 0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
        let variation = |(count, sum, squares): (f64, f64, f64)| squares - sum * sum / f64::max(count, 1.0);
        let within: f64 = of_organs.iter().copied().map(variation).sum();
        let all = variation(total);
        let explained = if all > 1e-6 * total.2.max(f64::MIN_POSITIVE) { 1.0 - within / all } else { 0.0 };
        Self { mirrored, in_air: in_air as f64 / soft.max(1) as f64, explained }
    }

    /// Directions of the mirrored axes.
    fn direction(&self) -> String {
        let names = ["left to right", "front to back", "head to feet"];
        let mirrored = names.into_iter().zip(self.mirrored).filter_map(|(name, mirrored)| mirrored.then_some(name));
        mirrored.collect::<Vec<_>>().join(" and ")
    }
}
