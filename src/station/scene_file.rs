//! Scene file of a station: named by the station, or generated and cached.

use std::path::{Path, PathBuf};

use super::{SceneSource, Station, StationError};
use crate::anatomy::Scene;
use crate::files::cache_directory;
use crate::phantom::{self, PhantomFile};

/// Scene file of a station.
#[derive(Debug)]
pub enum SceneFile {
    /// File that the station names.
    Given(PathBuf),
    /// File of a generated phantom. If it is not in the cache, it is removed when this value is dropped.
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
    /// The station's scene file. If a generated scene is not cached, it is built and cached in [`cache_directory`].
    /// `progress` is called only during such a build, from several threads.
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

    /// Loads the file from [`Station::prepare_scene_file`], with this station's tissues.
    ///
    /// # Errors
    /// Errors of [`Station::prepare_scene_file`] and [`Station::load_scene_from`].
    pub fn load_scene(&self, progress: &(dyn Fn(phantom::Progress) + Sync)) -> Result<Scene, StationError> {
        self.load_scene_from(self.prepare_scene_file(progress)?.path())
    }
}
