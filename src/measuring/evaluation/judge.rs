//! Metrics of one row of the report: the low quality, a generator, or the high quality rendered again.

use std::path::PathBuf;

use serde::Serialize;

use super::models::{Extractor, add_features};
use crate::dataset::Tuple;
use crate::generator::Variant;
use crate::measuring::MeasuringError;
use crate::quality::structures::{contrast_lost, structures};
use crate::quality::{FeatureExtractor, Pair, RegionError, RegionSum, Scores, Summary, cut, frechet_distance_of};
use crate::statistics::mean;

/// Feature vectors that one extractor computed from crops, and from full fields of view.
#[derive(Clone, Default)]
pub(super) struct Vectors {
    pub(super) crops: Vec<Vec<f64>>,
    pub(super) full: Vec<Vec<f64>>,
}

/// A tuple with the data needed to judge its images.
pub(super) struct Judged<'a> {
    pub(super) tuple: &'a Tuple,
    /// Index of the tuple.
    pub(super) index: usize,
    /// Upper left corner [x, y] of each crop, pixels.
    pub(super) places: Vec<[usize; 2]>,
    pub(super) side: usize,
    /// Whether each pixel lies behind bone along its scanline; `None` if the scanlines are unknown.
    pub(super) behind: Option<Vec<bool>>,
}

/// Scores of one image, for the table of images.
#[derive(Debug, Clone, Serialize)]
pub struct ImageScores {
    /// Index of the tuple.
    pub index: usize,
    /// Scores on the full field of view.
    pub full: Scores,
    /// Left and top of each crop, pixels, and the scores on it.
    pub crops: Vec<([usize; 2], Scores)>,
}

/// Metrics of a row, accumulated over its images.
#[derive(Default)]
pub(super) struct Row {
    pub(super) name: String,
    pub(super) model: Option<PathBuf>,
    pub(super) variant: Option<Variant>,
    pub(super) images: Vec<ImageScores>,
    /// Feature vectors of the images, by extractor.
    pub(super) vectors: Vec<Vectors>,
    tissues: Vec<RegionSum>,
    behind: RegionSum,
    elsewhere: RegionSum,
    lost: Vec<f64>,
}

/// A row of the report.
#[derive(Debug, Clone, Serialize)]
pub struct RowReport {
    /// `LQ`, the generator's name, or the name of the repeated high quality.
    pub name: String,
    /// Model file, if the row is a generator's.
    pub model: Option<PathBuf>,
    /// Maps that the generator takes, if the row is a generator's.
    pub variant: Option<Variant>,
    /// Scores on random crops; `None` without crops.
    pub crops: Option<Summary>,
    /// Scores on the full field of view.
    pub full: Summary,
    /// Fréchet distances to the features of the high quality, one per extractor.
    pub distances: Vec<Distance>,
    /// Lost share of the contrast at tissue borders, mean over images; `None` without such borders.
    pub contrast_lost: Option<f64>,
    /// Errors of each tissue in the images.
    pub tissues: Vec<TissueRow>,
    /// Errors behind bone; `None` without such pixels.
    pub behind_bone: Option<RegionError>,
    /// Errors in the rest of the sector; `None` without such pixels.
    pub elsewhere: Option<RegionError>,
    /// Scores of each image.
    pub images: Vec<ImageScores>,
}

/// A Fréchet distance, named after its extractor.
#[derive(Debug, Clone, Serialize)]
pub struct Distance {
    /// Name of the distance.
    pub name: String,
    /// Distance of the crops; `None` with fewer than two feature vectors.
    pub crops: Option<f64>,
    /// Distance of the full fields of view; `None` with fewer than two feature vectors.
    pub full: Option<f64>,
}

/// Errors of one tissue.
#[derive(Debug, Clone, Serialize)]
pub struct TissueRow {
    /// Name of the tissue.
    pub tissue: String,
    /// Share of this tissue in the pixels inside the sectors.
    pub share: f64,
    /// Errors of the tissue's grey levels.
    #[serde(flatten)]
    pub error: RegionError,
}

impl Judged<'_> {
    /// Computes the features of `image`, on its crops and on the full field of view. Appends them to each extractor's
    /// vectors.
    pub(super) fn features(
        &self,
        image: &[u8],
        extractors: &mut [Extractor],
        vectors: &mut [Vectors],
    ) -> Result<(), MeasuringError> {
        for (extractor, vectors) in extractors.iter_mut().zip(vectors) {
            let side = extractor.network.crop();
            let mut add = |image: &[u8], size: [usize; 2], to: &mut Vec<Vec<f64>>| {
                // An image too small for the network has no features: the distance is left out.
                let fits = size.into_iter().all(|n| n >= side);
                if fits { add_features(&mut extractor.network, image, size, to) } else { Ok(()) }
            };
            for &place in &self.places {
                let crop = cut(image, self.tuple.size[0], place, self.side);
                add(&crop, [self.side; 2], &mut vectors.crops)?;
            }
            add(image, self.tuple.size, &mut vectors.full)?;
        }
        Ok(())
    }

    /// Scores of an image and of its crops.
    fn scores(&self, image: &[u8]) -> Result<ImageScores, MeasuringError> {
        let Tuple { size, hq, mask, .. } = self.tuple;
        let full = Scores::of(&Pair::new(*size, image, hq, Some(mask))?);
        let crop = |&place: &[usize; 2]| {
            let [image, hq, mask] = [image, hq, mask].map(|map| cut(map, size[0], place, self.side));
            Ok((place, Scores::of(&Pair::new([self.side; 2], &image, &hq, Some(&mask))?)))
        };
        let crops = self.places.iter().map(crop).collect::<Result<Vec<_>, MeasuringError>>()?;
        Ok(ImageScores { index: self.index, full, crops })
    }
}

impl Row {
    pub(super) fn new(name: String, model: Option<PathBuf>, variant: Option<Variant>, extractors: usize) -> Self {
        Self {
            name,
            model,
            variant,
            vectors: vec![Vectors::default(); extractors],
            tissues: vec![RegionSum::default(); 256],
            ..Self::default()
        }
    }

    /// Judges an image and adds its metrics to the row.
    pub(super) fn add(
        &mut self,
        judged: &Judged<'_>,
        image: &[u8],
        extractors: &mut [Extractor],
    ) -> Result<(), MeasuringError> {
        self.images.push(judged.scores(image)?);
        judged.features(image, extractors, &mut self.vectors)?;
        let Tuple { size, hq, segmentation, mask, .. } = judged.tuple;
        for (index, ((&found, &expected), &number)) in image.iter().zip(hq).zip(segmentation).enumerate() {
            if mask[index] == 0 {
                continue;
            }
            self.tissues[usize::from(number)].add(found, expected);
            match judged.behind.as_ref().map(|behind| behind[index]) {
                Some(true) => self.behind.add(found, expected),
                Some(false) => self.elsewhere.add(found, expected),
                None => (),
            }
        }
        self.lost.extend(contrast_lost(&structures(image, hq, segmentation, *size)?));
        Ok(())
    }

    /// The row's mean scores, and its distances to the target's feature vectors.
    pub(super) fn report(
        self,
        names: &[String],
        target: &[Vectors],
        extractors: &[Extractor],
    ) -> Result<RowReport, MeasuringError> {
        let crops: Vec<Scores> = self.images.iter().flat_map(|i| i.crops.iter().map(|c| c.1)).collect();
        let full: Vec<Scores> = self.images.iter().map(|i| i.full).collect();
        let Some(full) = Summary::of(&full) else { return Err(MeasuringError::Nothing("tuple")) };
        let distance =
            |a: &[Vec<f64>], b: &[Vec<f64>]| (a.len().min(b.len()) > 1).then(|| frechet_distance_of(a, b)).transpose();
        let mut distances = Vec::new();
        for ((extractor, own), target) in extractors.iter().zip(&self.vectors).zip(target) {
            distances.push(Distance {
                name: extractor.label.clone(),
                crops: distance(&own.crops, &target.crops)?,
                full: distance(&own.full, &target.full)?,
            });
        }
        let all: u64 = self.tissues.iter().map(RegionSum::pixels).sum();
        let tissue = |(name, sum): (&String, &RegionSum)| {
            let error = sum.error()?;
            Some(TissueRow { tissue: name.clone(), share: error.pixels as f64 / all.max(1) as f64, error })
        };
        let mut tissues: Vec<TissueRow> = names.iter().zip(&self.tissues).filter_map(tissue).collect();
        tissues.sort_by(|a, b| b.error.pixels.cmp(&a.error.pixels).then_with(|| a.tissue.cmp(&b.tissue)));
        Ok(RowReport {
            name: self.name,
            model: self.model,
            variant: self.variant,
            crops: Summary::of(&crops),
            full,
            distances,
            contrast_lost: mean(self.lost),
            tissues,
            behind_bone: self.behind.error(),
            elsewhere: self.elsewhere.error(),
            images: self.images,
        })
    }
}
