//! A replay as a tracked sequence (.igs.mha), as PLUS and 3D Slicer read it.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Replay, ReplayError, Stretch};
use crate::anatomy::Scene;
use crate::render::Backend;
use crate::sink::meta_image::{ImageTracking, MetaImageWriter};
use crate::transducer::Sector;

/// Pixel values of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SequenceMap {
    /// Grey levels.
    #[default]
    Bmode,
    /// Tissue numbers.
    Segmentation,
}

/// A written sequence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct WrittenSequence {
    /// File.
    pub path: PathBuf,
    /// Number of images.
    pub images: usize,
    /// Number of images in gaps of the recording; their transforms are marked invalid.
    pub invalid: usize,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}

impl Replay {
    /// Checks that all frames have the same depth, because a sequence has one image size.
    ///
    /// # Errors
    /// The depth changes among the frames, or there is none.
    pub fn check_depth(&self) -> Result<(), ReplayError> {
        let depth_mm = self.first()?.probe.depth_mm;
        match self.stretches.iter().find(|part| part.probe.depth_mm != depth_mm) {
            Some(part) => Err(ReplayError::Depth { frame: part.frames.start }),
            None => Ok(()),
        }
    }

    /// Renders all frames into the sequence at `out`; zlib compresses it if asked. `progress` receives the number of
    /// finished frames.
    ///
    /// # Errors
    /// Errors of [`Self::check_depth`]; a frame that can't be rendered, or a file that can't be written.
    pub fn write_sequence(
        &self,
        backend: &Backend,
        scene: &Scene,
        out: &Path,
        (map, compress): (SequenceMap, bool),
        progress: &dyn Fn(usize),
    ) -> Result<WrittenSequence, ReplayError> {
        self.check_depth()?;
        let Stretch { probe, settings, .. } = self.first()?;
        let sector = Sector::fit(probe, settings.image.width, settings.image.height);
        let tracking = |index: usize| ImageTracking {
            time_s: self.timeline.seconds(index),
            pose: self.timeline.poses[index],
            tracked: !self.timeline.is_held(index),
            needle: self.timeline.needles[index].map(|needle| needle.scene_from_needle),
            needle_tracked: self.timeline.is_needle_known(index),
        };
        let images: Vec<_> = self.frames.clone().map(tracking).collect();
        let mut writer = MetaImageWriter::create(out, &sector, &images, compress)?;
        self.render(
            backend,
            scene,
            |_| {},
            |i, frame| {
                writer.push(match map {
                    SequenceMap::Bmode => &frame.bmode,
                    SequenceMap::Segmentation => &frame.segmentation,
                })?;
                progress(i + 1);
                Ok::<(), ReplayError>(())
            },
        )?;
        writer.finish()?;
        let invalid = images.iter().filter(|image| !image.tracked).count();
        let (width, height) = (sector.width, sector.height);
        Ok(WrittenSequence { path: out.to_owned(), images: images.len(), invalid, width, height })
    }
}

impl fmt::Display for WrittenSequence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, images, invalid, width, height } = self;
        writeln!(f, "{images} images of {width} x {height}")?;
        if *invalid > 0 {
            writeln!(f, "{invalid} of them in gaps of the recording: their transforms are marked INVALID")?;
        }
        writeln!(f, "{}", path.display())
    }
}
