//! Scenes: surfaces from arrays, and loaded scenes that several stations share.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::SystemTime;

use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::anatomy::import::mesh_of_arrays;
use insonify::anatomy::{Bvh, Mesh, Scene, TissueTable};
use insonify::glam::Vec3;
use insonify::station::SceneSource;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::errors::{Failure, Kind};
use crate::work::{interruptibly, on_pool};

/// Surfaces of a scene, repaired as surfaces of a file are, and the tissue outside of them.
pub(crate) struct Surfaces {
    surfaces: Vec<LabelledSurface>,
    pub(crate) background: String,
}

/// A scene made from arrays.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct SceneArrays(pub(crate) Arc<Surfaces>);

/// A surface: name, tissue, priority, vertices [n × 3] in mm, triangles [m × 3].
type Given<'py> = (String, String, i32, PyReadonlyArray2<'py, f32>, PyReadonlyArray2<'py, u32>);

#[pymethods]
impl SceneArrays {
    #[new]
    fn new(py: Python<'_>, surfaces: Vec<Given<'_>>, background: String) -> PyResult<Self> {
        let copied = surfaces.into_iter().map(Copied::of).collect::<Result<Vec<_>, _>>()?;
        let mend = || copied.into_iter().map(Copied::mended).collect::<Result<Vec<_>, _>>();
        // In a forked process, only this crate's own pool has threads.
        let surfaces = interruptibly(py, move || on_pool(mend))?;
        Ok(Self(Arc::new(Surfaces { surfaces, background })))
    }

    /// Name, tissue, priority and number of triangles of each surface.
    #[getter]
    fn surfaces(&self) -> Vec<(String, String, i32, usize)> {
        let shown = |s: &LabelledSurface| (s.name.clone(), s.tissue.clone(), s.priority, s.mesh.triangles.len());
        self.0.surfaces.iter().map(shown).collect()
    }

    #[getter]
    fn background(&self) -> &str {
        &self.0.background
    }

    /// Writes the surfaces as a binary glTF file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = py.detach(|| write_glb(&self.0.surfaces, &path));
        Ok(written.map_err(|error| Failure::of(Kind::Scene, &error))?)
    }
}

/// A surface in its own memory, copied from the caller's arrays.
struct Copied {
    name: String,
    tissue: String,
    priority: i32,
    vertices_mm: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Copied {
    fn of((name, tissue, priority, vertices, triangles): Given<'_>) -> Result<Self, Failure> {
        let wrong = |what: &str| {
            Failure::new(Kind::Scene, format!("surface `{name}`: {what} must be a C-ordered array [n, 3]"))
        };
        let corners = vertices.as_slice().map_err(|_| wrong("vertices"))?.as_chunks::<3>();
        let corners = if corners.1.is_empty() { corners.0 } else { return Err(wrong("vertices")) };
        let indices = triangles.as_slice().map_err(|_| wrong("triangles"))?.as_chunks::<3>();
        let indices = if indices.1.is_empty() { indices.0 } else { return Err(wrong("triangles")) };
        let vertices_mm = corners.iter().map(|&corner| Vec3::from_array(corner)).collect();
        let triangles = indices.to_vec();
        Ok(Self { name, tissue, priority, vertices_mm, triangles })
    }

    fn mended(self) -> Result<LabelledSurface, Failure> {
        let Self { name, tissue, priority, vertices_mm, triangles } = self;
        let (mesh, findings) = mesh_of_arrays(&name, vertices_mm, triangles)?;
        for finding in findings {
            tracing::warn!("{finding}");
        }
        Ok(LabelledSurface { name, tissue, priority, mesh })
    }
}

impl Surfaces {
    fn scene(&self, tissues: &TissueTable) -> Result<Scene, Failure> {
        let mut scene = Scene::new(tissues.clone(), &self.background)?;
        for LabelledSurface { name, tissue, priority, mesh } in &self.surfaces {
            let mesh = Mesh::clone(mesh);
            if mesh.triangles.is_empty() {
                continue;
            }
            scene.add(name, tissue, *priority, mesh)?;
        }
        Ok(scene)
    }
}

/// A scene with its BVH, as renderers share it.
pub(crate) struct Loaded {
    pub(crate) key: SceneKey,
    pub(crate) scene: Scene,
    pub(crate) bvh: Arc<Bvh>,
}

/// Identity of a scene: everything that it is made from.
#[derive(Clone)]
pub(crate) struct SceneKey {
    station: insonify::Station,
    arrays: Option<Arc<Surfaces>>,
    /// Time of the last change of the scene's file, and its size, bytes; `None` without a readable file.
    stamp: Option<(SystemTime, u64)>,
}

impl SceneKey {
    pub(crate) fn of(station: &insonify::Station, arrays: Option<Arc<Surfaces>>) -> Self {
        let file = match &station.scene {
            SceneSource::File(path) if arrays.is_none() => std::fs::metadata(path).ok(),
            _ => None,
        };
        let stamp = file.and_then(|file| Some((file.modified().ok()?, file.len())));
        Self { station: station.clone(), arrays, stamp }
    }

    /// Whether both keys have the same surfaces, tissues and motion.
    pub(crate) fn same_scene(&self, other: &Self) -> bool {
        let same_arrays = match (&self.arrays, &other.arrays) {
            (None, None) => self.station.scene == other.station.scene,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        let parts = |key: &Self| (key.station.background.clone(), key.station.motion);
        // Deleting the file does not change a scene that is in use.
        let same_file = self.stamp == other.stamp || other.stamp.is_none();
        same_arrays && same_file && parts(self) == parts(other) && self.station.tissues == other.station.tissues
    }

    /// Loads the scene, or returns it if a station of this process uses it.
    ///
    /// Must not be called from a thread of the pool, which might wait for itself.
    pub(crate) fn load(self) -> Result<Arc<Loaded>, Failure> {
        static SCENES: Mutex<Vec<Weak<Loaded>>> = Mutex::new(Vec::new());
        let mut scenes = SCENES.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.retain(|scene| scene.strong_count() > 0);
        if let Some(known) = scenes.iter().filter_map(Weak::upgrade).find(|known| known.key.same_scene(&self)) {
            return Ok(known);
        }
        let (scene, bvh) = on_pool(|| {
            let scene = match &self.arrays {
                Some(arrays) => arrays.scene(&self.station.tissues)?,
                None => self.station.load_scene(&|_| ())?,
            };
            let bvh = Arc::new(Bvh::build(&scene)?);
            Ok((scene, bvh))
        })?;
        let loaded = Arc::new(Loaded { key: self, scene, bvh });
        scenes.push(Arc::downgrade(&loaded));
        Ok(loaded)
    }
}
