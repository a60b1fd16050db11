//! File of a station's surfaces: given, or generated and cached.

use std::path::{Path, PathBuf};

use super::{SceneSource, Station, StationError};
use crate::anatomy::Scene;
use crate::files::cache_directory;
use crate::phantom::{self, PhantomFile};

/// File of a station's surfaces.
#[derive(Debug)]
pub enum SceneFile {
    /// File that the station names.
    Given(PathBuf),
    /// File of a generated phantom. Outside the cache it is removed with this value.
    Generated(PhantomFile),
}

impl SceneFile {
    /// Path of the file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Given(path) => path,
            Self::Generated(file) => &file.path,
        }
    }
}

impl Station {
    /// File of the surfaces. A generated scene is built and cached in [`cache_directory`] if it is not there; `progress` is
    /// called only during such a build, from several threads.
    ///
    /// # Errors
    /// The phantom cannot be built or written.
    pub fn prepare_scene_file(&self, progress: &(dyn Fn(phantom::Progress) + Sync)) -> Result<SceneFile, StationError> {
        match &self.scene {
            SceneSource::File(path) => Ok(SceneFile::Given(path.clone())),
            SceneSource::ObstetricPhantom(options) => {
                Ok(SceneFile::Generated(phantom::cached_or_temporary(&cache_directory(), options, progress)?))
            }
        }
    }

    /// Surfaces with this station's tissues, from [`Station::prepare_scene_file`].
    ///
    /// # Errors
    /// Those of [`Station::prepare_scene_file`] and [`Station::load_scene_from`].
    pub fn load_scene(&self, progress: &(dyn Fn(phantom::Progress) + Sync)) -> Result<Scene, StationError> {
        self.load_scene_from(self.prepare_scene_file(progress)?.path())
    }
}
