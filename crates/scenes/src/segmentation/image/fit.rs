//! Fit of an image to the labels: organs must not lie in air, and no mirror image must fit better.

use rayon::prelude::*;

use super::error::ImageError;
use super::judge::Judgement;
use super::levels::{Levels, Matter, Sample, quantile, value};
use crate::segmentation::volume::Image;

/// Density between soft tissue and aerated lung, HU. Lower values count as air.
const AIR_HU: f32 = -300.0;
/// Largest shares of the soft tissue in air, 0..=1: in a CT that is accepted, in an MR that is accepted (dark
/// background instead of air), and in a CT that gets no remark.
const REFUSED_SHARE: f64 = 0.2;
const REFUSED_SHARE_MR: f64 = 0.5;
const REMARKED_SHARE: f64 = 0.03;
/// Brightness below which an image other than a CT shows background, relative to its brightest voxels.
const BACKGROUND: f32 = 0.03;
/// Smallest ratios at which a mirror image counts as right: its quality relative to the image as given, and its edges
/// at organs' borders relative to its edges within organs.
const BETTER: f64 = 1.15;
const ABOVE_INNER: f64 = 1.25;
/// Fewest organs from which a mirror image is refused. One or two organs may fit better by chance.
const TELLING_ORGANS: usize = 3;
/// Value added to the mean difference of neighbours within organs, relative to the limit of differences. The value
/// prevents a division by zero for images without noise.
const NOISE: f64 = 0.02;
/// Limit of the difference of neighbours, relative to the image's range of values. Larger differences are clamped.
const EDGE: f32 = 0.1;
/// Smallest plausible density of the dense parts of bone, and of bone's median, HU. Marrow without minerals has about
/// the density of soft tissue.
const CORTEX_HU: f32 = 150.0;
const MARROW_HU: f32 = 70.0;

/// Fit of an image, perhaps mirrored, to the labels.
#[derive(Debug, Clone, Copy, Default)]
struct Fit {
    /// For each axis, whether the image is mirrored along it.
    mirrored: [bool; 3],
    /// Share of the soft tissue in air, 0..=1.
    in_air: f64,
    /// Mean differences of neighbouring voxels: at the borders of organs, where all organs have the same weight, and
    /// within organs.
    edges: f64,
    inner: f64,
    /// Ratio of differences at borders to differences within organs.
    quality: f64,
    /// Number of organs with borders within the image.
    organs: usize,
}

/// Remarks on the fit of an image.
///
/// # Errors
/// Too much soft tissue in air; a mirror image that fits better, if three or more organs have borders in the image.
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
    let range = quantile(&levels.all, 0.995) - quantile(&levels.all, 0.005);
    let fits: Vec<Fit> = (0..8usize)
        .into_par_iter()
        .map(|bits| Fit::of(image, sample, std::array::from_fn(|axis| bits >> axis & 1 == 1), limit, EDGE * range))
        .collect();
    let Some((own, mirrored)) = fits.split_first() else { return Ok(Vec::new()) };
    let better = mirrored.iter().filter(|fit| {
        fit.quality > BETTER * own.quality && fit.edges > ABOVE_INNER * fit.inner && fit.in_air <= own.in_air + 0.01
    });
    let best = better.max_by(|a, b| a.quality.total_cmp(&b.quality));
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
    if let Some(fit) = best.filter(|_| own.organs >= TELLING_ORGANS) {
        return Err(ImageError::Mirrored {
            path: image.path.clone(),
            direction: fit.direction(),
            times: fit.quality / own.quality.max(f64::MIN_POSITIVE),
        });
    }
    let mut remarks = Vec::new();
    if let Some(fit) = best {
        remarks.push(format!("the image would fit better mirrored {}: check its axes", fit.direction()));
    }
    if is_ct && own.in_air > REMARKED_SHARE {
        remarks.push(format!(
            "{percent:.0} % of the labelled soft tissue lies in the CT's air: is the image of the same scan?"
        ));
    }
    // The image's highest value may be below that of cortical bone, if its values are clipped.
    let cortex = CORTEX_HU.min(0.9 * levels.most());
    if let Some(dense) = levels.bone.as_ref().map(|bone| quantile(bone, 0.9)).filter(|dense| is_ct && *dense < cortex) {
        let remark =
            format!("nine tenths of the labelled bone have less than {dense:.0} HU: is the image of the same scan?");
        remarks.push(remark);
    } else if let Some(bone) = levels.bone.as_ref().map(|bone| quantile(bone, 0.5)).filter(|b| is_ct && *b < MARROW_HU)
    {
        remarks.push(format!(
            "half of the labelled bone has less than {bone:.0} HU: is the image of the same scan, or shifted?"
        ));
    }
    Ok(remarks)
}

impl Fit {
    fn of(image: &Image, sample: &Sample, mirrored: [bool; 3], limit: f32, largest: f32) -> Self {
        let found = |at: [usize; 3]| {
            let turned = |axis: usize| if mirrored[axis] { image.size[axis] - 1 - at[axis] } else { at[axis] };
            value(image, std::array::from_fn(turned))
        };
        let (mut soft, mut in_air) = (0usize, 0usize);
        for voxel in sample.voxels.iter().filter(|voxel| voxel.matter == Matter::Soft) {
            soft += 1;
            in_air += usize::from(found(voxel.at) < limit);
        }
        // Number of pairs of neighbours and sum of their differences: at the border of each organ, and within all
        // organs.
        let mut borders = vec![(0.0_f64, 0.0_f64); sample.organs];
        let mut inner = (0.0, 0.0);
        for pair in &sample.pairs {
            let [a, b] = pair.ends.map(found);
            let difference = f64::from((a - b).abs().min(largest));
            if difference.is_finite() {
                let sum = if pair.at_border { &mut borders[usize::from(pair.organ)] } else { &mut inner };
                *sum = (sum.0 + 1.0, sum.1 + difference);
            }
        }
        let mean = |(count, sum): (f64, f64)| sum / f64::max(count, 1.0);
        let known: Vec<f64> = borders.into_iter().filter(|border| border.0 > 0.0).map(mean).collect();
        let edges = known.iter().sum::<f64>() / known.len().max(1) as f64;
        let inner = mean(inner);
        let quality = edges / (inner + NOISE * f64::from(largest)).max(f64::MIN_POSITIVE);
        let in_air = in_air as f64 / soft.max(1) as f64;
        Self { mirrored, in_air, edges, inner, quality, organs: known.len() }
    }

    /// The mirrored axes in words.
    fn direction(&self) -> String {
        let names = ["left to right", "front to back", "head to feet"];
        let mirrored = names.into_iter().zip(self.mirrored).filter_map(|(name, mirrored)| mirrored.then_some(name));
        mirrored.collect::<Vec<_>>().join(" and ")
    }
}
