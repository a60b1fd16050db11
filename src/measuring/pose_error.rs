//! Errors of an operating point at its poses, and their means.

use super::reference::Reference;
use super::{ClassError, Errors};
use crate::quality::speckle::speckle;
use crate::quality::structures::{contrast_lost, structures};
use crate::quality::{ClassSpeckle, ClassStructure, QualityError, Scores, SeenError, psnr_db};
use crate::statistics::mean;

/// Errors of an operating point at one pose.
pub(super) struct PoseError {
    pub(super) rmse: [f64; 2],
    pub(super) seen: [SeenError; 2],
    pub(super) scores: Scores,
    pub(super) speckle: Vec<ClassSpeckle>,
    pub(super) structures: Vec<ClassStructure>,
}

impl PoseError {
    /// Errors of an image. Its RMS errors are filled in later, for each seed.
    pub(super) fn of(image: &[u8], reference: &Reference, range_db: f64) -> Result<Self, QualityError> {
        Ok(Self {
            rmse: [0.0; 2],
            seen: [SeenError::default(); 2],
            scores: Scores::of(&reference.pair(image)?),
            speckle: speckle(image, &reference.segmentation, reference.size, range_db)?,
            structures: structures(image, &reference.bmode, &reference.segmentation, reference.size)?,
        })
    }
}

/// Errors by tissue, as means over the poses. Grey differences are weighted by pixels.
pub(super) fn classes(tissues: &[String], errors: &[PoseError], references: &[Reference]) -> Vec<ClassError> {
    let of = |number: usize, tissue: &String| {
        let is = |class: u8| usize::from(class) == number;
        let structures: Vec<&ClassStructure> =
            errors.iter().flat_map(|e| &e.structures).filter(|s| is(s.class)).collect();
        let pixels: usize = structures.iter().map(|s| s.pixels).sum();
        let snr = |all: &mut dyn Iterator<Item = &ClassSpeckle>| {
            mean(all.filter(|s| is(s.class)).filter_map(|s| s.envelope_snr))
        };
        (pixels > 0).then(|| ClassError {
            tissue: tissue.clone(),
            pixels,
            grey_difference: structures.iter().map(|s| s.grey_difference * s.pixels as f64).sum::<f64>()
                / pixels as f64,
            envelope_snr: snr(&mut errors.iter().flat_map(|e| &e.speckle)),
            reference_snr: snr(&mut references.iter().flat_map(|t| &t.speckle)),
            contrast_lost: mean(structures.iter().filter_map(|s| s.contrast_lost)),
        })
    };
    tissues.iter().enumerate().filter_map(|(index, tissue)| of(index + 1, tissue)).collect()
}

/// Means of the errors over poses.
pub(super) fn summary(errors: &[PoseError], classes: &[ClassError]) -> Errors {
    let over = |of: &dyn Fn(&PoseError) -> f64| mean(errors.iter().map(of)).unwrap_or(f64::NAN);
    let pixels_of = [0, 1].map(|turn| over(&|e| e.rmse[turn]));
    let seen_of = |part: fn(&SeenError) -> f64| [0, 1].map(|turn| over(&|e| part(&e.seen[turn])));
    let whole_of = seen_of(|seen| seen.whole);
    let middle = |[first, second]: [f64; 2]| 0.5 * (first + second);
    let spread = |[first, second]: [f64; 2]| (first - second).abs();
    let finite = errors.iter().map(|e| e.scores.psnr_db).filter(|db| db.is_finite());
    let pixels: usize = classes.iter().map(|c| c.pixels).sum();
    let grey: f64 = classes.iter().map(|c| c.grey_difference.abs() * c.pixels as f64).sum();
    Errors {
        seen: SeenError {
            whole: middle(whole_of),
            levels: middle(seen_of(|seen| seen.levels)),
            texture: middle(seen_of(|seen| seen.texture)),
        },
        seen_spread: spread(whole_of),
        rmse: middle(pixels_of),
        psnr_db: mean(finite).unwrap_or(f64::INFINITY),
        identical: errors.iter().filter(|e| e.scores.psnr_db.is_infinite()).count(),
        ssim: over(&|e| e.scores.ssim),
        pkl: mean(errors.iter().filter_map(|e| e.scores.pkl)),
        snr_difference: mean(classes.iter().filter_map(|c| Some(c.envelope_snr? - c.reference_snr?))),
        grey_difference: grey / pixels.max(1) as f64,
        contrast_lost: mean(errors.iter().filter_map(|e| contrast_lost(&e.structures))),
    }
}

/// RMS difference inside the sector, grey levels.
pub(super) fn rmse(image: &[u8], reference: &Reference) -> Result<f64, QualityError> {
    let pair = reference.pair(image)?;
    Ok(255.0 * 10f64.powf(-psnr_db(&pair) / 20.0))
}
