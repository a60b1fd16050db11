//! Shared helpers of the phantom's benchmarks.

use std::path::PathBuf;

use etcetera::BaseStrategy;
use insonify::anatomy::Scene;
use insonify::phantom;
use insonify::station::{SceneSource, Station};

/// The station's scene; a phantom is taken from the program's cache.
pub(crate) fn scene(station: &Station) -> Scene {
    let path = match &station.scene {
        SceneSource::File(path) => path.clone(),
        SceneSource::ObstetricPhantom(options) => {
            let cache = std::env::var_os("INSONIFY_CACHE").map(PathBuf::from).or_else(|| {
                let strategy = etcetera::choose_base_strategy().ok()?;
                Some(strategy.cache_dir().join("insonify"))
            });
            phantom::cached(&cache.expect("a cache directory"), options, &|_| {}).expect("the phantom")
        }
    };
    station.load_scene_from(&path).expect("the scene")
}
