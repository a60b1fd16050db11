//! Sample of an image's values: at labelled voxels, and in the whole image.

use glam::DVec3;

use crate::segmentation::grid::Grid;
use crate::segmentation::inputs::Organ;
use crate::segmentation::volume::Image;

/// Largest number of labelled voxels in the sample.
const LABELLED_MAX: usize = 200_000;

/// Largest number of voxels of the whole image in the sample.
const IMAGE_MAX: usize = 1_000_000;

/// Fewest voxels of a matter whose values are used.
const LEAST_VOXELS: usize = 50;

/// Matter of an organ: group of tissues of similar density.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Matter {
    /// Bone.
    Bone,
    /// Lungs and airways.
    Gas,
    /// Soft tissue and fluids.
    Soft,
    /// Classes without a clear density: bowel, whose gas may be anywhere, and fat.
    Other,
}

impl Matter {
    fn of(organ: &Organ) -> Self {
        match organ.tissue.as_str() {
            tissue if tissue.starts_with("bone") => Self::Bone,
            "air" | "lung_aerated" => Self::Gas,
            "fat" | "gallstone" => Self::Other,
            _ if organ.gas.is_some() => Self::Other,
            _ => Self::Soft,
        }
    }
}

/// A labelled voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Labelled {
    pub(super) matter: Matter,
    /// Indices of the image's voxel.
    pub(super) at: [usize; 3],
}

/// Two neighbouring voxels of the image, the first one labelled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// Index of the organ to which the first voxel belongs.
    pub(super) organ: u16,
    /// Whether the voxels have different labels.
    pub(super) at_border: bool,
    pub(super) ends: [[usize; 3]; 2],
}

/// Labelled voxels, evenly spread over the labels, and their neighbours.
pub(super) struct Sample {
    pub(super) voxels: Vec<Labelled>,
    pub(super) pairs: Vec<Pair>,
    pub(super) organs: usize,
}

impl Sample {
    /// Samples the labelled voxels that lie within the image.
    pub(super) fn of(image: &Image, grid: &Grid, labels: &[u16], organs: &[Organ]) -> Self {
        let matters: Vec<Matter> = organs.iter().map(Matter::of).collect();
        let count = labels.iter().filter(|label| **label != 0).count();
        let step = count.div_ceil(LABELLED_MAX).max(1);
        let image_from_grid = image.lps_from_voxel.inverse() * grid.lps_from_voxel;
        let image_voxel = |i: usize| -> Option<[usize; 3]> {
            let p = image_from_grid.transform_point3(DVec3::from_array(grid.at(i).map(|v| v as f64))).round();
            let within = (0..3).all(|n| (0.0..image.size[n] as f64).contains(&p[n]));
            within.then(|| p.to_array().map(|v| v as usize))
        };
        let labelled = labels.iter().enumerate().filter(|(_, label)| **label != 0).step_by(step);
        let (mut voxels, mut pairs) = (Vec::new(), Vec::new());
        for (i, label) in labelled {
            let organ = label - 1;
            let (Some(matter), Some(at)) = (matters.get(usize::from(organ)), image_voxel(i)) else { continue };
            voxels.push(Labelled { matter: *matter, at });
            let index = grid.at(i);
            for (axis, stride) in grid.strides().into_iter().enumerate() {
                let before = (index[axis] > 0).then(|| i - stride);
                let after = (index[axis] + 1 < grid.size[axis]).then(|| i + stride);
                for neighbour in [before, after].into_iter().flatten() {
                    let Some(other) = image_voxel(neighbour) else { continue };
                    pairs.push(Pair { organ, at_border: labels[neighbour] != *label, ends: [at, other] });
                }
            }
        }
        Self { voxels, pairs, organs: organs.len() }
    }

    /// Values at the sampled voxels of `matter`, ascending; `None` if they are fewer than [`LEAST_VOXELS`].
    pub(super) fn values(&self, image: &Image, matter: Matter) -> Option<Vec<f32>> {
        let of = self.voxels.iter().filter(|v| v.matter == matter).map(|v| value(image, v.at));
        let sorted = sorted(of);
        (sorted.len() >= LEAST_VOXELS).then_some(sorted)
    }
}

/// Value of the image at a voxel.
pub(super) fn value(image: &Image, [i, j, k]: [usize; 3]) -> f32 {
    image.values[(k * image.size[1] + j) * image.size[0] + i]
}

/// Finite values, ascending.
pub(super) fn sorted(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut sorted: Vec<f32> = values.filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    sorted
}

/// Value below which the given share of the sorted values lies; NaN if there are none.
pub(super) fn quantile(sorted: &[f32], share: f64) -> f32 {
    let at = (share * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(at).copied().unwrap_or(f32::NAN)
}

/// Share of the sorted values within `from..to`, 0..=1.
pub(super) fn share_within(sorted: &[f32], from: f32, to: f32) -> f64 {
    let below = |limit: f32| sorted.partition_point(|value| *value < limit);
    (below(to).saturating_sub(below(from))) as f64 / sorted.len().max(1) as f64
}

/// Distributions of an image's values.
pub(super) struct Levels {
    /// Values of the whole image, ascending.
    pub(super) all: Vec<f32>,
    /// Values of soft tissue, bone and lungs, ascending; `None` where too few voxels are labelled.
    pub(super) soft: Option<Vec<f32>>,
    pub(super) bone: Option<Vec<f32>>,
    pub(super) lungs: Option<Vec<f32>>,
}

impl Levels {
    pub(super) fn of(image: &Image, sample: &Sample) -> Self {
        let step = image.values.len().div_ceil(IMAGE_MAX).max(1);
        Self {
            all: sorted(image.values.iter().copied().step_by(step)),
            soft: sample.values(image, Matter::Soft),
            bone: sample.values(image, Matter::Bone),
            lungs: sample.values(image, Matter::Gas),
        }
    }

    pub(super) fn least(&self) -> f32 {
        self.all.first().copied().unwrap_or(0.0)
    }

    pub(super) fn most(&self) -> f32 {
        self.all.last().copied().unwrap_or(0.0)
    }

    /// Median value of the soft tissue; `None` if too little is labelled.
    pub(super) fn soft_median(&self) -> Option<f32> {
        self.soft.as_ref().map(|soft| quantile(soft, 0.5))
    }

    /// Most frequent value below `limit`, which is the value of air in a CT or MR: the median within the fullest of 100
    /// bins.
    pub(super) fn air(&self, limit: f32) -> f32 {
        const BINS: usize = 100;
        let least = self.least();
        let below = &self.all[..self.all.partition_point(|value| *value < limit)];
        let width = (limit - least) / BINS as f32;
        if below.is_empty() || width <= 0.0 {
            return least;
        }
        let mut counts = [0usize; BINS];
        for value in below {
            counts[(((value - least) / width) as usize).min(BINS - 1)] += 1;
        }
        let fullest = (0..BINS).max_by_key(|bin| (counts[*bin], BINS - bin)).unwrap_or(0);
        let (from, to) = (least + fullest as f32 * width, least + (fullest + 1) as f32 * width);
        let start = below.partition_point(|value| *value < from);
        let end = below.partition_point(|value| *value < to).max(start + 1).min(below.len());
        quantile(&below[start..end], 0.5)
    }

    /// Whether the values must be clipped at the lower end: more than `share` of all voxels have the lowest value, and
    /// more than three times as many as have the values just above.
    pub(super) fn clipped_low(&self, share: f64) -> bool {
        let (least, most) = (self.least(), self.most());
        let step = (most - least) * 1e-3;
        let at_end = share_within(&self.all, least, least + step);
        at_end > share && at_end > 3.0 * share_within(&self.all, least + step, least + 5.0 * step)
    }
}
