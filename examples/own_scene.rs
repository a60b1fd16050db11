//! One's own scene: surfaces from arrays of vertices and triangles, with one's own tissues:
//! `cargo run --release --example own_scene -- [PICTURE]`

use std::error::Error;
use std::path::PathBuf;

use insonify::anatomy::{Mesh, Tissue, TissueTable};
use insonify::glam::Vec3;
use insonify::render::{Backend, BackendChoice, RenderSettings};
use insonify::sink::png::{Effort, write_grey};
use insonify::transducer::Probe;
use insonify::{Frame, Pose, Renderer, Scene};

/// Vertices of an octahedron around (0, 0, 60), mm.
const VERTICES_MM: [[f32; 3]; 6] =
    [[20., 0., 60.], [-20., 0., 60.], [0., 20., 60.], [0., -20., 60.], [0., 0., 80.], [0., 0., 40.]];
/// Vertex indices of the triangles, counter-clockwise as seen from outside.
const TRIANGLES: [[u32; 3]; 8] =
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];

/// The scene: a lesion in soft tissue. The lesion's echoes are 14 dB weaker.
pub(crate) fn scene() -> Result<Scene, Box<dyn Error>> {
    let lesion = Tissue { scatterer_density: 0.9, scatterer_deviation: 0.002, speed_m_s: 1550.0, ..Tissue::default() };
    let soft = Tissue { scatterer_deviation: 0.01, speed_m_s: 1540.0, ..lesion.clone() };
    let tissues = TissueTable::new([("soft".to_owned(), soft), ("lesion".to_owned(), lesion)])?;
    let mesh = Mesh { vertices_mm: VERTICES_MM.map(Vec3::from).to_vec(), triangles: TRIANGLES.to_vec() };
    if mesh.unpaired_edges() > 0 || mesh.signed_volume_mm3() <= 0.0 {
        return Err("a surface must be closed, and its triangles counter-clockwise seen from outside".into());
    }
    let mut scene = Scene::new(tissues, "soft")?;
    scene.add("octahedron", "lesion", 1, mesh)?;
    Ok(scene)
}

/// Renders a frame of the scene with a probe at the origin, facing +z.
pub(crate) fn render(scene: &Scene) -> Result<Frame, Box<dyn Error>> {
    let probe = Probe { scanlines: 128, ..Probe::default() };
    let backend = Backend::open(BackendChoice::Host)?;
    let mut frame = Frame::default();
    Renderer::new(&backend, scene, &probe, &RenderSettings::default())?.render(&Pose::IDENTITY, &mut frame)?;
    Ok(frame)
}

fn main() -> Result<(), Box<dyn Error>> {
    let picture = std::env::args_os().nth(1).map_or_else(|| "own_scene.png".into(), PathBuf::from);
    let frame = render(&scene()?)?;
    write_grey(&picture, frame.width, frame.height, &frame.bmode, Effort::Small)?;
    println!("{}", picture.display());
    Ok(())
}
