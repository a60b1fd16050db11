//! Rendering of a planned data set (or of a shard, one part of the set) into a directory.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::maker::megabytes;
use super::plan::{Moment, Source};
use super::scenes::{Scenes, TupleScene};
use super::stations::{has_planes, station_of, with_phantom};
use super::step::{Progress, Step};
use super::store::Store;
use super::tuple_renderer::{TupleRenderer, tables_of};
use super::{DatasetError, Exam, ExamRow, Maker, PoseRow, RollingRow, Row, SettingsRow};
use crate::lanes::in_order;
use crate::render::{Backend, SharedTables};
use crate::station::{PlaneScene, SceneSource};

/// A shard to be rendered into a directory. While this value exists, the directory is locked against other runs of the
/// shard.
#[derive(Debug)]
pub struct Job<'a> {
    maker: &'a Maker,
    directory: PathBuf,
    store: Store,
    /// Number of the shard's tuples that were complete when the directory was opened.
    kept: usize,
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// Number of tuples rendered by this run.
    pub made: usize,
    /// Number of the shard's tuples rendered by earlier runs.
    pub kept: usize,
    /// Number of complete training tuples in the shard.
    pub train: usize,
    /// Number of complete test tuples in the shard.
    pub test: usize,
    /// Size of the shard's array files, bytes.
    pub bytes: u64,
    /// Path of the shard's manifest.
    pub manifest: PathBuf,
}

impl fmt::Display for Made {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { made, kept, train, test, bytes, .. } = self;
        write!(f, "{made} tuples made, {kept} were there; {train} to train, {test} to test, {}", megabytes(*bytes))
    }
}

impl Maker {
    /// Opens or creates the data set in `directory`. Complete tuples, whose files have the right sizes, are kept.
    ///
    /// # Errors
    /// The directory can't be written or holds another data set, or another run is writing the tuples.
    pub fn open(&self, directory: &Path) -> Result<Job<'_>, DatasetError> {
        let store = Store::open(directory, &self.header, &self.recipe.stations, self.recipe.shard, self.tuples())?;
        Ok(Job { maker: self, directory: directory.to_owned(), kept: store.done(), store })
    }

    /// Renders the shard into `directory`: [`Maker::open`], then [`Job::render`].
    ///
    /// # Errors
    /// Errors of [`Maker::open`] and [`Job::render`].
    pub fn make(&self, directory: &Path, backend: &Backend, progress: &Progress<'_>) -> Result<Made, DatasetError> {
        let mut job = self.open(directory)?;
        job.render(backend, progress)?;
        Ok(job.made())
    }
}

impl Job<'_> {
    /// Number of tuples in the shard.
    pub fn total(&self) -> usize {
        self.maker.tuples().len()
    }

    /// Number of the shard's tuples that are still to be rendered.
    pub fn missing(&self) -> usize {
        self.total() - self.store.done()
    }

    /// Number of the shard's tuples with missing or truncated files. [`Job::render`] makes these files again. If a mask
    /// shared by several tuples is lost, only one of them is rendered again.
    pub fn lost(&self) -> usize {
        self.store.lost.len()
    }

    /// Renders the missing tuples, several at once. Continues an interrupted run.
    ///
    /// # Errors
    /// This machine renders an existing tuple differently (one is checked); a scene can't be loaded or rendered; a
    /// station has neither standard planes nor a pose; or a file can't be written. Tuples before the failed one are
    /// kept.
    pub fn render(&mut self, backend: &Backend, progress: &Progress<'_>) -> Result<(), DatasetError> {
        let total = self.total();
        if self.missing() == 0 {
            return Ok(());
        }
        let mut lanes = TupleRenderer::lanes(backend);
        let mut scenes = Scenes::new(self.maker.header.classes.clone(), progress);
        self.check_machine(&mut scenes, lanes.first_mut())?;
        progress(Step::Tuples { done: self.store.done(), total });
        let (maker, directory, store) = (self.maker, &self.directory, &mut self.store);
        let missing = maker.exams().iter().map(|exam| (exam, store.missing(exam.tuples.clone())));
        let missing: Vec<(&Exam, Vec<usize>)> = missing.filter(|(_, tuples)| !tuples.is_empty()).collect();
        let sums: HashMap<usize, String> = store.lost.values().map(|row| (row.index, row.sha256.clone())).collect();
        let (mut tables, mut planes) = (Vec::new(), None);
        let mut planned = |(exam, tuples): &(&Exam, Vec<usize>)| {
            let planned = planned(maker, &mut scenes, &mut planes, (exam, tuples), &tables)?;
            tables = planned.first().map(|planned| planned.tables.clone()).unwrap_or_default();
            Ok(planned)
        };
        let planned = missing.iter().flat_map(|exam| match planned(exam) {
            Ok(tuples) => tuples.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        });
        let write = |renderer: &mut TupleRenderer<'_>, Planned { scene, tables, row }: Planned| {
            let target = maker.targets.as_ref().map(|targets| targets.of(&row)).transpose()?;
            // A tuple rendered again must have its earlier checksum.
            let row = Row { sha256: sums.get(&row.index).cloned().unwrap_or_default(), ..row };
            let tuple = renderer.write(&scene, tables, &row, target, directory)?;
            Ok((row, tuple))
        };
        in_order(&mut lanes, planned, write, |_, (row, tuple)| {
            store.keep(row, tuple)?;
            progress(Step::Tuples { done: store.done(), total });
            Ok(())
        })
    }

    /// Numbers of tuples so far, and path of the manifest.
    pub fn made(&self) -> Made {
        let (train, test) = self.store.splits;
        Made {
            made: self.store.done() - self.kept,
            kept: self.kept,
            train,
            test,
            bytes: self.store.bytes,
            manifest: self.store.path.clone(),
        }
    }

    /// Refuses to continue a data set that this machine renders differently. Renders one existing tuple for comparison.
    fn check_machine(
        &self,
        scenes: &mut Scenes<'_>,
        renderer: Option<&mut TupleRenderer<'_>>,
    ) -> Result<(), DatasetError> {
        let (Some(row), Some(renderer)) = (&self.store.last, renderer) else { return Ok(()) };
        let scene = scenes.of(&station_of(&self.directory, &self.maker.header, row)?)?;
        if renderer.agrees(&scene, row)? {
            return Ok(());
        }
        Err(DatasetError::OtherMachine { directory: self.directory.clone(), index: row.index })
    }
}

/// A scene, and its standard planes and skin.
type Planes = (Arc<TupleScene>, PlaneScene);

/// A tuple to be rendered.
struct Planned {
    scene: Arc<TupleScene>,
    tables: Vec<SharedTables>,
    row: Row,
}

/// The tuples of `exam` with the indices in `tuples`. `known` holds tables of the previous exam, which may be reused.
fn planned(
    maker: &Maker,
    scenes: &mut Scenes<'_>,
    planes: &mut Option<Planes>,
    (exam, tuples): (&Exam, &[usize]),
    known: &[SharedTables],
) -> Result<Vec<Planned>, DatasetError> {
    let Maker { recipe, header, .. } = maker;
    let Some(station) = recipe.stations.get(exam.station) else { return Ok(Vec::new()) };
    let station = with_phantom(station, exam);
    let frames_before = header.look.lq_angles - 1;
    let open = planes.as_ref().is_none_or(|(of, _)| of.station != station) && station.scene_file().is_none();
    // A phantom's standard planes are known without its mesh, so they load at the same time as the mesh.
    let (scene, opened) = rayon::join(|| scenes.of(&station), || open.then(|| PlaneScene::open(&station)).transpose());
    let scene = scene?;
    if let Some(opened) = opened? {
        *planes = Some((scene.clone(), opened));
    }
    let phantom = match &station.scene {
        SceneSource::ObstetricPhantom(options) => Some(*options),
        SceneSource::File(_) => None,
    };
    let settings = SettingsRow::draw(exam.seed, &station.probe, &station.settings);
    let about_planes = has_planes(&station);
    let row = |Moment { index, time_s, pose, seed, frame_rate_hz, before }: Moment| Row {
        index,
        split: exam.split,
        station: header.stations.get(exam.station).map(|s| s.file.clone()).unwrap_or_default(),
        phantom,
        exam: ExamRow {
            number: exam.number,
            seed: exam.seed,
            skill: about_planes.then(|| exam.skill.name().to_owned()),
        },
        time_s,
        pose: (&pose).into(),
        rolling: (frames_before > 0)
            .then(|| RollingRow { frame_rate_hz, poses: before.iter().map(PoseRow::from).collect() }),
        settings,
        seed,
        lq: header.lq_of(index),
        hq: header.hq,
        look: header.look,
        size: [station.settings.image.width, station.settings.image.height],
        file: format!("tuples/{index:07}.npy"),
        mask: String::new(),
        sha256: String::new(),
    };
    let moments = moments(&scene, planes, exam, frames_before)?.into_iter();
    let rows: Vec<Row> = moments.filter(|moment| tuples.contains(&moment.index)).map(row).collect();
    // All tuples of an exam have the same settings, so they share tables.
    let tables = rows.first().map(|row| tables_of(&scene, row, known)).transpose()?.unwrap_or_default();
    Ok(rows.into_iter().map(|row| Planned { scene: scene.clone(), tables: tables.clone(), row }).collect())
}

/// Key frames of an exam over `scene`. `planes` caches the standard planes of the last scene.
fn moments(
    scene: &Arc<TupleScene>,
    planes: &mut Option<Planes>,
    exam: &Exam,
    frames_before: u32,
) -> Result<Vec<Moment>, DatasetError> {
    let station = &scene.station;
    if has_planes(station) {
        let of_scene = planes.take_if(|(of, _)| Arc::ptr_eq(of, scene));
        let (_, planes) = planes.insert(match (of_scene, station.scene_file()) {
            (Some(kept), _) => kept,
            (None, Some(_)) => (scene.clone(), PlaneScene::of(station, &scene.scene)?),
            (None, None) => (scene.clone(), PlaneScene::open(station)?),
        });
        return Ok(exam.moments(&Source::Planes(&planes.planes, &planes.skin), frames_before)?);
    }
    let no_pose = || DatasetError::NoPose { station: station.path.clone() };
    Ok(exam.moments(&Source::About(station.default_pose.ok_or_else(no_pose)?), frames_before)?)
}
