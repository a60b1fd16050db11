//! Planning of a requested data set. Only rendering remains to be done afterwards.

use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;

use super::recipe::Qualities;
use super::stations::classes;
use super::targets::Targets;
use super::{ATTENUATION_POWER, DatasetError, Exam, FORMAT, Header, PLANES, Plan, Recipe, Shard, Split, StationRow};
use crate::names::thousands;
use crate::render::FrameQuality;

/// A planned data set, ready to be rendered.
#[derive(Debug)]
pub struct Maker {
    pub(super) recipe: Recipe,
    pub(super) header: Header,
    plan: Plan,
    pub(super) targets: Option<Targets>,
}

/// Size of a planned data set, or of its shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Planned {
    /// Number of training tuples.
    pub train: usize,
    /// Number of test tuples.
    pub test: usize,
    /// Number of sessions (exams).
    pub exams: usize,
    /// Number of drawn phantoms; 0 if stations keep their own scenes.
    pub phantoms: usize,
    /// Size of the array files, bytes.
    pub bytes: u64,
}

impl fmt::Display for Maker {
    /// Writes tuples, qualities and size of the shard in one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Planned { train, test, exams, phantoms, bytes } = self.planned();
        let Header { lq, lq_more, hq, look, .. } = &self.header;
        let quality = |[rays, layers]: [u32; 2], angles| FrameQuality { angles, ..FrameQuality::new(rays, layers) };
        let lq: Vec<String> =
            std::iter::once(lq).chain(lq_more).map(|&lq| quality(lq, look.lq_angles).to_string()).collect();
        let (lq, hq) = (lq.join(", "), quality(*hq, look.hq_angles));
        write!(f, "{} tuples", thousands(train + test))?;
        if self.recipe.shard.of > 1 {
            write!(f, " (shard {})", self.recipe.shard)?;
        }
        write!(f, " of {exams} sessions")?;
        if phantoms > 0 {
            write!(f, " over {phantoms} phantoms")?;
        }
        write!(f, ": {train} to train, {test} to test; {lq} against {hq} rays x layers; {} on disk", megabytes(bytes))
    }
}

/// Text for a size, in MB or GB.
pub(super) fn megabytes(bytes: u64) -> String {
    match bytes as f64 * 1e-6 {
        mb if mb < 2000.0 => format!("{mb:.0} MB"),
        mb => format!("{:.1} GB", mb * 1e-3),
    }
}

impl Maker {
    /// Plans the data set of `recipe`. Reads the files of its stations, and writes nothing.
    ///
    /// # Errors
    /// The request can't be planned; a quality, a number of angles or a span is outside its range; there are more
    /// than 255 tissues; a station's files can't be read; or the data set in [`Recipe::hq_from`] has another plan.
    pub fn new(recipe: Recipe) -> Result<Self, DatasetError> {
        let Shard { number, of } = recipe.shard;
        if !(1..=of).contains(&number) {
            return Err(DatasetError::Plan(format!("there is no shard {number}/{of}: shards of {of} are 1..={of}")));
        }
        let wishes = recipe.wishes();
        let plan = Plan::new(&wishes)?;
        let Qualities { lq, lq_more, hq } = recipe.qualities()?;
        let header = Header {
            format: FORMAT,
            insonify: env!("CARGO_PKG_VERSION").to_owned(),
            seed: recipe.seed,
            frames: recipe.frames,
            classes: classes(&recipe.stations)?,
            planes: PLANES.map(str::to_owned).to_vec(),
            attenuation_power: ATTENUATION_POWER,
            lq,
            lq_more,
            hq,
            look: recipe.compounding()?,
            phantoms: wishes.phantoms,
            frames_per_exam: wishes.frames_per_exam,
            test_share: wishes.test_share,
            stations: recipe.stations.iter().map(StationRow::of).collect::<Result<_, _>>()?,
        };
        let targets = recipe.hq_from.as_deref().map(|from| Targets::open(from, &header)).transpose()?;
        Ok(Self { recipe, header, plan, targets })
    }

    /// Exams (simulated sessions) in the shard.
    pub fn exams(&self) -> &[Exam] {
        self.recipe.shard.of(&self.plan.exams)
    }

    /// Indices of the shard's tuples. Consecutive exams have consecutive tuples.
    pub fn tuples(&self) -> Range<usize> {
        let exams = self.exams();
        exams.first().zip(exams.last()).map_or(0..0, |(first, last)| first.tuples.start..last.tuples.end)
    }

    /// Numbers of tuples, exams and phantoms in the shard, and its size.
    pub fn planned(&self) -> Planned {
        let exams = self.exams();
        let count = |split| exams.iter().filter(|e| e.split == split).map(|e| e.tuples.len()).sum::<usize>();
        let bytes = |exam: &Exam| {
            let image = self.recipe.stations.get(exam.station).map(|s| s.settings.image).unwrap_or_default();
            (exam.tuples.len() * PLANES.len()) as u64 * u64::from(image.width) * u64::from(image.height)
        };
        let phantoms: BTreeSet<u64> = exams.iter().filter_map(|e| e.phantom.map(|p| p.seed)).collect();
        Planned {
            train: count(Split::Train),
            test: count(Split::Test),
            exams: exams.len(),
            phantoms: phantoms.len(),
            bytes: exams.iter().map(bytes).sum(),
        }
    }
}
