//! Low quality and generators on the tuples of a data set.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{anyhow, ensure};
use insonify::dataset::{Dataset, Row as TupleRow, Split, Step, Tuple};
use insonify::quality::regions::is_bone;
use insonify::quality::{CROP_INSIDE, crop_places};
use insonify::render::BackendChoice;
use insonify::statistics::evenly;
use serde::Serialize;

use super::super::progress::Progress;
use super::super::steps::Steps;
use super::super::{Classify, Failure};
use super::again::Again;
use super::judge::{Judged, Row, RowReport, Vectors};
use super::scan::Scan;
use super::{Args, models, sheets};

/// Result, for JSON.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) dataset: std::path::PathBuf,
    pub(super) split: String,
    /// Tuples judged.
    pub(super) tuples: usize,
    pub(super) crop_side: usize,
    pub(super) crops_per_tuple: usize,
    /// Least share of a crop inside the sector.
    pub(super) crop_inside: f64,
    pub(super) seed: u64,
    /// Low quality first, then the generators, then the high quality rendered again.
    pub(super) rows: Vec<RowReport>,
    /// Notes on the figures.
    pub(super) notes: Vec<String>,
    /// Pictures written.
    pub(super) sheets: Vec<std::path::PathBuf>,
}

/// Scanlines of the images, by station and size.
struct Geometry<'a> {
    dataset: &'a Dataset,
    known: HashMap<(String, [u32; 2]), Option<Scan>>,
    notes: Vec<String>,
}

impl Geometry<'_> {
    /// Scanlines of a row's pictures; none if its station can't be read.
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

/// Judges the chosen tuples.
pub(super) fn run(args: &Args, directory: &Path) -> Result<Report, Failure> {
    let dataset = Dataset::open(directory).input()?;
    let chosen = chosen(args, &dataset).input()?;
    let classes = &dataset.header.classes;
    let tissues = classes.get(1..).unwrap_or_default();
    let mut generators = models::generators(args, tissues)?;
    let mut extractors = models::extractors(args)?;
    let count = extractors.len();
    let mut rows = vec![Row::new("LQ".to_owned(), None, None, count)];
    for (name, generator) in &generators {
        let manifest = generator.manifest();
        rows.push(Row::new(name.clone(), Some(generator.path().to_owned()), Some(manifest.variant), count));
    }
    let backend = args.again.map(|_| args.backend.open(BackendChoice::Auto)).transpose()?;
    let steps = Steps::new(Progress::new("evaluate", chosen.len()));
    let show = |step| steps.set(step);
    let mut again =
        backend.as_ref().zip(args.again).map(|(backend, renders)| Again::new(backend, &dataset, renders, &show));
    if let Some(renders) = args.again {
        let mean = format!("mean of {renders} of HQ");
        rows.extend(["HQ again".to_owned(), mean].map(|name| Row::new(name, None, None, count)));
    }
    let mut target = vec![Vectors::default(); count];
    let mut geometry = Geometry { dataset: &dataset, known: HashMap::new(), notes: Vec::new() };
    let (side, seed) = (args.crop as usize, args.seed);
    let mut image = Vec::new();
    let mut without_crops = 0;
    for (done, row) in chosen.iter().enumerate() {
        steps.set(Step::Tuples { done, total: chosen.len() });
        let tuple = dataset.tuple(row).input()?;
        let fits = tuple.size.into_iter().all(|n| n >= side);
        without_crops += usize::from(!fits);
        let crops = if fits { args.crops as usize } else { 0 };
        let places = match crops {
            0 => Vec::new(),
            crops => crop_places(&tuple.mask, tuple.size, side, crops, seed.wrapping_add((row.index as u64) << 20))?,
        };
        let behind = geometry.behind_bone(row, &tuple);
        let judged = Judged { tuple: &tuple, index: row.index, places, side, behind };
        judged.features(&tuple.hq, &mut extractors, &mut target)?;
        rows[0].add(&judged, &tuple.lq, &mut extractors)?;
        let attenuation = tuple.attenuation_map();
        let scan = geometry.of(row).map(|scan| scan.geometry);
        for ((_, generator), row) in generators.iter_mut().zip(&mut rows[1..]) {
            models::generate(generator, &tuple, &attenuation, scan, &mut image)?;
            row.add(&judged, &image, &mut extractors)?;
        }
        if let Some(again) = &mut again {
            for (image, of_table) in again.render(row, &tuple.hq)?.iter().zip(&mut rows[1 + generators.len()..]) {
                of_table.add(&judged, image, &mut extractors)?;
            }
        }
    }
    let mut notes = geometry.notes;
    if without_crops > 0 && args.crops > 0 {
        notes.push(format!(
            "{without_crops} tuples are smaller than a crop of {side} x {side} and are in the full field of view only"
        ));
    }
    for station in again.into_iter().flat_map(|again| again.foreign) {
        notes.push(format!(
            "with its own seed, too, a tuple of {station} comes out otherwise than the data set has it: another device, driver \
             or version rendered it, and a part of what the high quality rendered again is off by comes from that"
        ));
    }
    for (extractor, target) in extractors.iter().zip(&target) {
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
    let reports =
        rows.into_iter().map(|row| row.report(classes, &target, &extractors)).collect::<Result<Vec<_>, _>>()?;
    let sheets = match &args.out {
        Some(out) => {
            sheets::write(out, &dataset, &chosen, &reports[..=generators.len()], &mut generators, (side, seed))?
        }
        None => Vec::new(),
    };
    Ok(Report {
        dataset: directory.to_owned(),
        split: args.split.clone(),
        tuples: chosen.len(),
        crop_side: side,
        crops_per_tuple: args.crops as usize,
        crop_inside: CROP_INSIDE,
        seed,
        rows: reports,
        notes,
        sheets,
    })
}

/// Tuples of the split, at most `--limit`, spread evenly.
fn chosen<'a>(args: &Args, dataset: &'a Dataset) -> Result<Vec<&'a TupleRow>, anyhow::Error> {
    let header = &dataset.header;
    ensure!(
        header.classes.first().is_some_and(|name| name == "outside"),
        "the first class of {} is not `outside`",
        dataset.directory.display()
    );
    let all: Vec<&TupleRow> = match args.split.as_str() {
        "all" => dataset.rows.iter().collect(),
        "train" => dataset.of(Split::Train).collect(),
        _ => dataset.of(Split::Test).collect(),
    };
    if all.is_empty() {
        let [train, test] = [Split::Train, Split::Test].map(|split| dataset.of(split).count());
        return Err(anyhow!(
            "{} has no tuple of the split {} yet: {train} for training, {test} for the test",
            dataset.directory.display(),
            args.split
        ));
    }
    let count = args.limit.map_or(all.len(), |n| (n as usize).min(all.len()));
    Ok(evenly(count, all.len()).map(|i| all[i]).collect())
}
