//! Pictures of a patient's scene for its report.

use std::path::Path;

use insonify::anatomy::{Axes, Scene};
use insonify::pose::Pose;
use insonify::render::{Frame, Quality, RenderSettings, Renderer};
use insonify::report::scene_view::{
    BmodeImage, Cut, Direction, Fan, Orbit, PictureSettings, SceneView, Selection, ViewError,
};
use insonify::report::segmentation::Plate;
use insonify::segmentation::gain::{Gain, Layer};
use insonify::segmentation::probe_choice::ProbeChoice;
use insonify::segmentation::start::Start;
use insonify::segmentation::station_text::station_text;
use insonify::sink::png;
use insonify::station::Station;

use super::super::backend::BackendArgs;
use super::super::{Classify, Failure};

/// Largest number of B-mode views.
const VIEWS_MAX: usize = 15;
/// Names of surfaces that hide the organs.
const OUTER: [&str; 4] = ["skin", "fat", "fascia", "soft_tissue"];
const SIZE: [u32; 2] = [900, 700];

/// Pictures of a report.
pub(super) struct Pictures {
    pub(super) scene: Vec<Plate>,
    pub(super) bmode: Vec<Plate>,
}

/// Draws the scene from the front, from the left and at the probe's fan. Renders B-mode frames of the first view and of
/// the standard planes, with the rays of the quality `hq` and the station's layers.
pub(super) fn of(scene: &Scene, start: &Start, file: &Path, backend: &BackendArgs) -> Result<Pictures, Failure> {
    let scene_name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let directory = file.parent().unwrap_or(Path::new("."));
    let tissues = scene.tissues.tissues();
    let layers: Vec<Layer> =
        scene.surfaces.iter().filter_map(|s| Some((&s.mesh, s.priority, tissues.get(s.tissue)?))).collect();
    let station_of = |probe: &ProbeChoice, pose: &Pose| {
        let gain = Gain::of(&layers, probe, pose);
        Station::parse(&station_text(&scene_name, "a view", probe, pose, &gain), directory)
    };
    let first_pose = start.view.pose.unwrap_or_default();
    let first = station_of(&start.probe, &first_pose)?;
    let backend = backend.open(first.backend)?;

    let mut views = vec![(format!("{}: the station's first view", start.target), first_pose, start.probe)];
    for plane in &start.planes.planes {
        for view in plane.views.iter().filter(|view| view.pose != start.view.pose) {
            let Some(pose) = view.pose else { continue };
            let outline = view.outlines.first();
            let organ = scene.surfaces.iter().find(|s| Some(&s.name) == outline);
            let probe = organ.map_or(start.probe, |organ| ProbeChoice::for_organ(&pose, &organ.name, &organ.mesh));
            views.push((plane.title.clone(), pose, probe));
        }
    }
    let mut bmode = Vec::new();
    let mut image = None;
    for (caption, pose, probe) in views.into_iter().take(VIEWS_MAX) {
        let station = station_of(&probe, &pose)?;
        // With a single ray for each scanline, reflections by chance show as streaks.
        let quality = Quality { rays: Quality::HQ.rays, ..station.settings.quality };
        let settings = RenderSettings { quality, ..station.settings };
        let mut renderer = Renderer::new(&backend, scene, &station.probe, &settings)?;
        let mut frame = Frame::default();
        renderer.render(&pose, &mut frame)?;
        let sector = *renderer.sector();
        let rgb: Vec<u8> = frame.bmode.iter().flat_map(|&grey| [grey; 3]).collect();
        bmode.push(plate(caption, sector.width, sector.height, &rgb)?);
        image.get_or_insert(BmodeImage { sector, grey: frame.bmode });
    }

    let all = Selection::all(scene);
    let hidden: Vec<String> =
        OUTER.iter().filter(|name| scene.surfaces.iter().any(|s| s.name == **name)).map(|s| (*s).to_owned()).collect();
    let inner = Selection::of(scene, &[], &hidden).unwrap_or_else(|_: ViewError| all.clone());
    let fan = Fan { scene_from_probe: first_pose, probe: first.probe, image };
    let pictures = [
        ("from the front, without skin and fat", Direction::Front, &inner, None),
        ("from the left, without skin and fat", Direction::Left, &inner, None),
        ("from the front", Direction::Front, &all, None),
        ("cut at the first view", Direction::Fan, &all, Some(Cut::Fan)),
    ];
    let mut plates = Vec::new();
    for (caption, from, selection, cut) in pictures {
        let view = SceneView::new(scene, selection, Some(fan.clone()), Axes::Patient);
        let [width, height] = SIZE;
        let picture = view.picture(&PictureSettings { width, height, from, orbit: Orbit::default(), cut }).other()?;
        plates.push(plate(caption.to_owned(), picture.width, picture.height, &picture.rgb)?);
    }
    Ok(Pictures { scene: plates, bmode })
}

fn plate(caption: String, width: u32, height: u32, rgb: &[u8]) -> Result<Plate, Failure> {
    Ok(Plate { caption, png: png::rgb_bytes(width, height, rgb).other()? })
}
