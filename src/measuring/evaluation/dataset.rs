//! Evaluation of low quality and generators on the tuples of a data set.

use std::collections::HashMap;
use std::path::PathBuf;

use serde::Serialize;

use super::judge::{Judged, Row, RowReport, Vectors};
use super::models::{Extractor, generate};
use super::repeat::{Jobs, Lane, Rendered, RepeatJob};
use super::scan::Scan;
use super::{Models, Repeat, sheets, trained_for};
use crate::dataset::{Dataset, Progress, Row as TupleRow, Split, Step, Tuple};
use crate::generator::Generator;
use crate::lanes::in_order;
use crate::measuring::MeasuringError;
use crate::quality::regions::is_bone;
use crate::quality::{CROP_COUNT, CROP_INSIDE, CROP_SIDE, crop_places};
use crate::statistics::evenly;

/// Tuples to evaluate, and their crops.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Split of the data set; `None` for both splits.
    pub split: Option<Split>,
    /// Largest number of tuples, which are spread evenly over the split; `None` for no limit.
    pub limit: Option<usize>,
    /// Number of random crops of each tuple; 0 omits their scores.
    pub crops: usize,
    /// Side of a crop, pixels.
    pub crop_side: usize,
    /// Seed of the crops' positions.
    pub seed: u64,
    /// Folder for pictures of the best, the median and the worst tuple; made if missing. `None` writes none.
    pub sheets: Option<PathBuf>,
}

impl Default for Settings {
    /// The whole test split.
    fn default() -> Self {
        Self { split: Some(Split::Test), limit: None, crops: CROP_COUNT, crop_side: CROP_SIDE, seed: 1, sheets: None }
    }
}

/// Scores of low quality and generators on a data set.
#[derive(Debug, Clone, Serialize)]
pub struct DatasetReport {
    /// Directory of the data set.
    pub dataset: PathBuf,
    /// `test`, `train` or `all`.
    pub split: String,
    /// Number of tuples judged.
    pub tuples: usize,
    /// Side of a crop, pixels.
    pub crop_side: usize,
    /// Number of crops of each tuple.
    pub crops_per_tuple: usize,
    /// Least share of a crop's pixels inside the sector.
    pub crop_inside: f64,
    /// Seed of the crops' positions.
    pub seed: u64,
    /// Low quality first, then the generators, then the high quality rendered again, if requested.
    pub rows: Vec<RowReport>,
    /// Remarks on the figures.
    pub notes: Vec<String>,
    /// Paths of the written pictures.
    pub sheets: Vec<PathBuf>,
}

/// Evaluation of low quality and generators on a data set.
#[derive(Debug)]
pub struct Evaluation<'a> {
    dataset: &'a Dataset,
    settings: Settings,
    chosen: Vec<&'a TupleRow>,
    generators: Vec<(String, Generator)>,
    extractors: Vec<Extractor>,
}

/// Scanlines of the images, by the tuples' station and size.
struct Geometry<'a> {
    dataset: &'a Dataset,
    known: HashMap<(String, [u32; 2]), Option<Scan>>,
    notes: Vec<String>,
}

/// Sums over the tuples judged so far.
struct Tally<'a> {
    rows: Vec<Row>,
    /// Feature vectors of the high quality, by extractor.
    target: Vec<Vectors>,
    geometry: Geometry<'a>,
    without_crops: usize,
    /// Stations with a tuple that this machine renders differently from the data set.
    foreign: Vec<String>,
}

impl Geometry<'_> {
    /// Scanlines of a tuple's pictures; `None` if its station can't be read.
    fn of(&mut self, row: &TupleRow) -> Option<&Scan> {
        let key = (row.station.clone(), row.size);
        if !self.known.contains_key(&key) {
            let found = Scan::of(self.dataset, row);
            if let Err(reason) = &found {
                self.notes
                    .push(format!("nothing is said of what lies behind bone in images of {}: {reason}", row.station));
            }
            self.known.insert(key.clone(), found.ok());
        }
        self.known.get(&key)?.as_ref()
    }

    fn behind_bone(&mut self, row: &TupleRow, tuple: &Tuple) -> Option<Vec<bool>> {
        let classes = &self.dataset.header.classes;
        let casts = |number: u8| classes.get(usize::from(number)).is_some_and(|name| is_bone(name));
        self.of(row).map(|scan| scan.scanlines.behind(&tuple.segmentation, casts))
    }
}

impl<'a> Evaluation<'a> {
    /// Chooses the tuples and loads the models.
    ///
    /// # Errors
    /// A split without tuples, a data set whose first class isn't `outside`, or a model that cannot be loaded. ONNX
    /// Runtime is always needed, because the built-in network texture64 runs.
    pub fn new(dataset: &'a Dataset, models: &Models, settings: Settings) -> Result<Self, MeasuringError> {
        let chosen = chosen(dataset, &settings)?;
        let tissues = dataset.header.classes.get(1..).unwrap_or_default();
        let generators = models.load_generators(tissues)?;
        Ok(Self { dataset, settings, chosen, generators, extractors: models.load_extractors()? })
    }

    /// Number of tuples to judge.
    pub fn tuples(&self) -> usize {
        self.chosen.len()
    }

    /// Judges the tuples, and with `repeat` also the high quality rendered again.
    ///
    /// # Errors
    /// A tuple that cannot be read or rendered, a model that cannot be run on it, or a picture that cannot be written.
    pub fn run(mut self, repeat: Option<Repeat<'_>>, progress: &Progress<'_>) -> Result<DatasetReport, MeasuringError> {
        let geometry = Geometry { dataset: self.dataset, known: HashMap::new(), notes: Vec::new() };
        let target = vec![Vectors::default(); self.extractors.len()];
        let rows = self.rows(repeat.as_ref());
        let mut tally = Tally { rows, target, geometry, without_crops: 0, foreign: Vec::new() };
        let (chosen, total) = (self.chosen.clone(), self.chosen.len());
        progress(Step::Tuples { done: 0, total });
        if let Some(repeat) = repeat {
            let mut jobs = Jobs::new(self.dataset, progress);
            let render = |lane: &mut Lane<'_>, job: RepeatJob<'_>| Ok(lane.render(&job)?);
            in_order(&mut repeat.lanes()?, chosen.iter().map(|row| Ok(jobs.of(row)?)), render, |done, rendered| {
                self.judge(chosen[done], Some(&rendered), &mut tally)?;
                progress(Step::Tuples { done: done + 1, total });
                Ok::<_, MeasuringError>(())
            })?;
        } else {
            for (done, row) in chosen.iter().enumerate() {
                self.judge(row, None, &mut tally)?;
                progress(Step::Tuples { done: done + 1, total });
            }
        }
        self.report(tally)
    }

    /// Adds the images of a tuple to the rows of the report.
    fn judge(
        &mut self,
        row: &TupleRow,
        repeat: Option<&Rendered>,
        tally: &mut Tally<'_>,
    ) -> Result<(), MeasuringError> {
        let Tally { rows, target, geometry, without_crops, foreign } = tally;
        let tuple = self.dataset.tuple(row)?;
        let judged = judged(&self.settings, row, &tuple, geometry)?;
        *without_crops += usize::from(judged.places.len() < self.settings.crops);
        judged.features(&tuple.hq, &mut self.extractors, target)?;
        rows[0].add(&judged, &tuple.lq, &mut self.extractors)?;
        let attenuation = tuple.attenuation_map();
        let scan = geometry.of(row).map(|scan| scan.geometry);
        let mut image = Vec::new();
        for ((_, generator), row) in self.generators.iter_mut().zip(&mut rows[1..]) {
            generate(generator, &tuple, &attenuation, scan, &mut image)?;
            row.add(&judged, &image, &mut self.extractors)?;
        }
        let Some(repeat) = repeat else { return Ok(()) };
        if !repeat.is_of_this_machine(row, &tuple.hq)? {
            foreign.push(row.station.clone());
        }
        let of_table = &mut rows[1 + self.generators.len()..];
        for (image, of_table) in repeat.images.iter().zip(of_table) {
            of_table.add(&judged, image, &mut self.extractors)?;
        }
        Ok(())
    }

    fn report(&mut self, tally: Tally<'_>) -> Result<DatasetReport, MeasuringError> {
        let Tally { rows, target, geometry, without_crops, foreign } = tally;
        let mut notes = geometry.notes;
        notes.extend(self.notes(without_crops, &foreign, &target));
        let classes = &self.dataset.header.classes;
        let reports = rows.into_iter().map(|row| row.report(classes, &target, &self.extractors));
        let reports = reports.collect::<Result<Vec<_>, _>>()?;
        let sheets = self.sheets(&reports)?;
        let Settings { split, crops, crop_side, seed, .. } = self.settings;
        Ok(DatasetReport {
            dataset: self.dataset.directory.clone(),
            split: split_name(split).to_owned(),
            tuples: self.chosen.len(),
            crop_side,
            crops_per_tuple: crops,
            crop_inside: CROP_INSIDE,
            seed,
            rows: reports,
            notes,
            sheets,
        })
    }

    /// Rows of the report, without images yet.
    fn rows(&self, repeat: Option<&Repeat<'_>>) -> Vec<Row> {
        let count = self.extractors.len();
        let mut rows = vec![Row::new("LQ".to_owned(), None, None, count)];
        for (name, generator) in &self.generators {
            let variant = generator.manifest().variant;
            rows.push(Row::new(name.clone(), Some(generator.path().to_owned()), Some(variant), count));
        }
        if let Some(Repeat { renders, .. }) = repeat {
            let names = ["HQ again".to_owned(), format!("mean of {renders} of HQ")];
            rows.extend(names.map(|name| Row::new(name, None, None, count)));
        }
        rows
    }

    /// Remarks on generators trained for other frames, missing crops, stations that this machine renders
    /// differently, and covariances.
    fn notes(&self, without_crops: usize, foreign: &[String], target: &[Vectors]) -> Vec<String> {
        let side = self.settings.crop_side;
        let trained = self.generators.iter().filter_map(|(name, g)| Some((name, g.manifest().training.as_ref()?)));
        let mut notes: Vec<String> =
            trained.flat_map(|(name, training)| trained_for::notes(name, training, &self.dataset.header)).collect();
        if without_crops > 0 {
            notes.push(format!(
                "{without_crops} tuples are smaller than a crop of {side} x {side} and are in the full field of view only"
            ));
        }
        for station in foreign {
            notes.push(format!(
                "with its own seed, too, a tuple of {station} comes out otherwise than the data set has it: another device, driver \
                 or version rendered it, and a part of what the high quality rendered again is off by comes from that"
            ));
        }
        for (extractor, target) in self.extractors.iter().zip(target) {
            let dimensions = target.full.first().map_or(0, Vec::len);
            for (what, vectors) in [("crops", &target.crops), ("the full field of view", &target.full)] {
                if (1..=dimensions).contains(&vectors.len()) {
                    notes.push(format!(
                        "{} on {what} is of {} vectors of {dimensions} values: too few for a full covariance, it only compares rows of this table",
                        extractor.label, vectors.len()
                    ));
                }
            }
        }
        notes
    }

    /// Writes pictures of some tuples, if they are requested.
    fn sheets(&mut self, reports: &[RowReport]) -> Result<Vec<PathBuf>, MeasuringError> {
        let Settings { crop_side, seed, ref sheets, .. } = self.settings;
        let Some(out) = sheets else { return Ok(Vec::new()) };
        let rows = &reports[..=self.generators.len()];
        sheets::write(out, self.dataset, &self.chosen, rows, &mut self.generators, (crop_side, seed))
    }
}

/// A tuple with its crops and the pixels behind bone. A tuple smaller than a crop has no crops.
fn judged<'a>(
    settings: &Settings,
    row: &TupleRow,
    tuple: &'a Tuple,
    geometry: &mut Geometry<'_>,
) -> Result<Judged<'a>, MeasuringError> {
    let side = settings.crop_side;
    let fits = tuple.size.into_iter().all(|n| n >= side);
    let seed = settings.seed.wrapping_add((row.index as u64) << 20);
    let places = match settings.crops {
        crops if fits && crops > 0 => crop_places(&tuple.mask, tuple.size, side, crops, seed)?,
        _ => Vec::new(),
    };
    Ok(Judged { tuple, index: row.index, places, side, behind: geometry.behind_bone(row, tuple) })
}

fn split_name(split: Option<Split>) -> &'static str {
    match split {
        None => "all",
        Some(Split::Train) => "train",
        Some(Split::Test) => "test",
    }
}

/// Tuples of the split, at most `limit`, spread evenly.
fn chosen<'a>(dataset: &'a Dataset, settings: &Settings) -> Result<Vec<&'a TupleRow>, MeasuringError> {
    let directory = &dataset.directory;
    if dataset.header.classes.first().is_none_or(|name| name != "outside") {
        return Err(MeasuringError::Classes(directory.clone()));
    }
    let all: Vec<&TupleRow> = dataset.rows.iter().filter(|row| settings.split.is_none_or(|s| row.split == s)).collect();
    if all.is_empty() || settings.limit == Some(0) {
        let [train, test] = [Split::Train, Split::Test].map(|split| dataset.of(split).count());
        let split = split_name(settings.split);
        return Err(MeasuringError::NoTuple { directory: directory.clone(), split, train, test });
    }
    let count = settings.limit.map_or(all.len(), |n| n.min(all.len()));
    Ok(evenly(count, all.len()).map(|i| all[i]).collect())
}
