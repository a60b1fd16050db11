//! A generator: a model with its manifest, which translates frames.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::Channel;
use super::beam_sampling::BeamSampling;
use super::compute_device::compute_device_of;
use super::load_options::{Execution, LoadOptions};
use super::manifest::{Affine, BeamGrid, Manifest};
use super::maps::{self, ClassMap, Geometry};
use super::parity::{self, ParityReport};
use super::precision::Stored;
use super::session::{RunFailure, Session, check_hash};
use super::tensor_values::Values;
use super::{GeneratorError, Input, Precision, Provider, Runtime, Terminator};
use crate::files::{self, FileError, FileKind};
use crate::render::{ComputeDevice, Frame};
use crate::transducer::{Probe, ScanGeometry};

/// A generator, ready to run. It keeps its tensors, so runs of one size allocate nothing.
pub struct Generator {
    path: PathBuf,
    manifest: Manifest,
    parity: ParityReport,
    classes: Option<ClassMap>,
    session: Session,
    provider: Provider,
    precision: Precision,
    /// Resampling tables for the geometry of the last run, if the model works in beam coordinates.
    sampling: Option<BeamSampling>,
    /// Grey levels on the beam grid, if the model works in beam coordinates and its output is uint8.
    grid_levels: Vec<f32>,
}

impl std::fmt::Debug for Generator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { path, provider, precision, .. } = self;
        let mut f = f.debug_struct("Generator");
        f.field("path", path).field("provider", provider).field("precision", precision).finish_non_exhaustive()
    }
}

impl Generator {
    /// Loads the model at `path` with its manifest, and runs its parity pair (an input with its expected output). If
    /// [`Precision::Auto`] chooses a precision that is refused, float32 replaces it, with a warning.
    ///
    /// # Errors
    /// A file that cannot be read, or contradicts another; a provider or a precision that is not available; a model
    /// that ONNX Runtime refuses; a tissue without a class; or a parity pair that does not match.
    pub fn load(path: &Path, runtime: &Runtime, options: &LoadOptions) -> Result<Self, GeneratorError> {
        let manifest = Manifest::load(&Manifest::path_of(path))?;
        let stored = Stored::choose(path, &manifest, options)?;
        let may_give_way = options.precision == Precision::Auto && stored.precision != Precision::Float32;
        let precision = stored.precision;
        match Self::open(path, manifest.clone(), stored, runtime, options) {
            // Without its provider, the model can't run in float32 either.
            Err(error) if may_give_way && !matches!(error, GeneratorError::Provider { .. }) => {
                tracing::warn!("{precision} is refused, float32 runs instead: {error}");
            }
            loaded => return loaded,
        }
        let stored = Stored::as_trained(path, &manifest);
        Self::open(path, manifest, stored, runtime, options)
    }

    /// Opens the model's file of one precision, and runs its parity pair.
    fn open(
        path: &Path,
        manifest: Manifest,
        stored: Stored,
        runtime: &Runtime,
        options: &LoadOptions,
    ) -> Result<Self, GeneratorError> {
        let model = files::read(&stored.path, FileKind::Model).map_err(FileError::at("read", &stored.path))?;
        check_hash(&stored.path, &model, &stored.sha256)?;
        let segmentation = manifest.segmentation.as_ref();
        let classes = segmentation.map(|s| ClassMap::of_tissues(s, options.tissues, path)).transpose()?;
        let parity_classes = segmentation.map(ClassMap::identity);
        let pair = parity::read(&Manifest::path_of(path), &stored.parity)?;
        let threads = match options.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            n => n as usize,
        };
        let execution =
            Execution { provider: options.provider, precision: stored.precision, threads, sha256: &stored.sha256 };
        let session = Session::new(runtime, &stored.path, &model, &manifest, execution)?;
        let parity = ParityReport { difference: 0.0, row: 0, column: 0, tolerance: stored.parity.tolerance };
        let mut generator = Self {
            path: path.to_owned(),
            manifest,
            parity,
            classes: parity_classes,
            session,
            provider: options.provider,
            precision: stored.precision,
            sampling: None,
            grid_levels: Vec::new(),
        };
        let found = generator.levels(&pair.input())?;
        generator.parity = parity::compare(&stored.path, &pair, &found, stored.parity.tolerance)?;
        generator.classes = classes;
        Ok(generator)
    }

    /// Translates a whole frame into grey levels `out` [height × width], 0 outside the sector.
    ///
    /// # Errors
    /// Maps of the wrong size, unknown tissue numbers, a model in beam coordinates without [`Input::scan`], a run
    /// that fails or is stopped, or values that are not finite. After an error `out` is empty.
    pub fn run(&mut self, input: &Input, out: &mut Vec<u8>) -> Result<(), GeneratorError> {
        out.clear();
        if let Some(grid) = self.manifest.beam {
            return self.run_on(&grid, input, out);
        }
        let affine = self.output_affine();
        let (values, geometry) = self.infer(input)?;
        maps::quantise(values, affine, input.mask, &geometry, out);
        Ok(())
    }

    /// Does [`Self::run`] for a model in beam coordinates.
    fn run_on(&mut self, grid: &BeamGrid, input: &Input, out: &mut Vec<u8>) -> Result<(), GeneratorError> {
        input.check(&self.manifest)?;
        let (width, height) = (input.width, input.height);
        let of_picture = |scan: &ScanGeometry| (scan.sector.width, scan.sector.height) == (width, height);
        let Some(scan) = input.scan.filter(of_picture) else {
            return Err(GeneratorError::NoScanGeometry { name: self.manifest.name.clone(), width, height });
        };
        let affine = self.output_affine();
        let kept = self.sampling.take().filter(|sampling| sampling.is_of(grid, &scan));
        let mut sampling = kept.unwrap_or_else(|| BeamSampling::new(*grid, scan));
        // Maps that the model doesn't take are not resampled.
        let manifest = &self.manifest;
        let taken = Input {
            segmentation: if manifest.takes(Channel::Segmentation) { input.segmentation } else { &[] },
            attenuation: if manifest.takes(Channel::Attenuation) { input.attenuation } else { &[] },
            ..*input
        };
        let on_grid = sampling.resample(&taken);
        let mut levels = std::mem::take(&mut self.grid_levels);
        let done = self.infer(&on_grid).map(|(values, geometry)| {
            let (values, affine) = match values {
                Values::Floats(values) => (values, affine),
                Values::Bytes(values) => {
                    levels.clear();
                    levels.extend(values.iter().map(|level| f32::from(*level)));
                    (&*levels, Affine::new(1.0 / 255.0, 0.0))
                }
            };
            sampling.picture(values, [geometry.first(), geometry.padded_width], affine, input, out);
        });
        (self.sampling, self.grid_levels) = (Some(sampling), levels);
        done
    }

    /// Durations of `runs` runs on a synthetic frame of `width` × `height` pixels, after one warm-up run. A model in
    /// beam coordinates gets the scanlines of the default probe.
    ///
    /// # Errors
    /// Errors of [`Generator::run`].
    pub fn measure(&mut self, width: u32, height: u32, runs: usize) -> Result<Vec<Duration>, GeneratorError> {
        let pixels = width as usize * height as usize;
        let frame = Frame {
            width,
            height,
            // Grey levels vary, and stay below white.
            bmode: (0..pixels).map(|i| (i % 199) as u8).collect(),
            segmentation: vec![0; pixels],
            attenuation: vec![0.5; pixels],
            mask: std::iter::repeat_n(255, pixels).collect(),
            scan: Some(ScanGeometry::fit(&Probe::default(), width, height)),
            ..Frame::default()
        };
        let input = Input::from(&frame);
        let mut out = Vec::new();
        self.run(&input, &mut out)?;
        let mut timed = || {
            let started = Instant::now();
            self.run(&input, &mut out)?;
            Ok(started.elapsed())
        };
        (0..runs).map(|_| timed()).collect()
    }

    /// Manifest of the model.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// File of the model.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Execution provider that runs the model.
    pub fn provider(&self) -> Provider {
        self.provider
    }

    /// Device that runs the model.
    pub fn compute_device(&self) -> ComputeDevice {
        compute_device_of(self.provider)
    }

    /// Precision in use; never [`Precision::Auto`].
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Result of the parity check at loading.
    pub fn parity(&self) -> &ParityReport {
        &self.parity
    }

    /// Handle that stops this generator's runs from other threads.
    pub fn terminator(&self) -> Terminator {
        self.session.terminator()
    }

    fn levels(&mut self, input: &Input) -> Result<Vec<f32>, GeneratorError> {
        let affine = self.output_affine();
        let (values, geometry) = self.infer(input)?;
        Ok(maps::levels(values, affine, input.mask, &geometry))
    }

    fn output_affine(&self) -> Affine {
        Affine::new(self.manifest.output.scale, self.manifest.output.offset)
    }

    /// Runs the model and returns its output. All values in the field of view are finite.
    fn infer(&mut self, input: &Input) -> Result<(Values<'_>, Geometry), GeneratorError> {
        input.check(&self.manifest)?;
        let name = &self.manifest.name;
        let failed = |failure| match failure {
            RunFailure::Stopped => GeneratorError::Terminated { name: name.clone() },
            RunFailure::Failed(reason) => GeneratorError::Inference { name: name.clone(), reason },
        };
        let geometry = Geometry::new(input.width, input.height, self.manifest.padding_multiple);
        let tensor = self.session.input(&geometry).map_err(failed)?;
        maps::fill(&self.manifest, self.classes.as_ref(), input, &geometry, tensor)?;
        let values = self.session.run().map_err(failed)?;
        match maps::not_finite(values, &geometry) {
            Some((row, column, count)) => Err(GeneratorError::NotFinite { name: name.clone(), count, row, column }),
            None => Ok((values, geometry)),
        }
    }
}
