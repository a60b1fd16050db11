//! Aberration by the meshes of the phantom's abdominal walls, at the poses of the exam and of the standard planes.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use glam::{DQuat, DVec3, Vec3};
use insonify::anatomy::doctor::aberration::{Aberration, Aperture, Caster, summary};
use insonify::anatomy::planes::View;
use insonify::anatomy::{Axes, Motion, Scene, Surface, Tissue, TissueTable, analytic};
use insonify::exam::sweep::{KEY_FRAMES, RATE_HZ, SEED, sweep};
use insonify::phantom::{self, Organ, Parameters, Wall, landmarks, organs, parts};
use insonify::pose::Pose;
use insonify::render::{Backend, BackendChoice, Frame, ImageSettings, RenderSettings, Renderer};
use insonify::settings::Probe;
use insonify::transducer::ProbeKind;

/// Cell size of the muscles' border, as in the full phantom, mm.
const BORDER_CELL_MM: f32 = 4.0;
/// Cell size of other organs, mm: finer than in the full phantom.
const CELL_MM: f32 = 7.0;
/// Depth to which the probe's face is pressed into the skin, mm.
const PRESS_MM: f64 = 2.5;

fn of(wall: Wall) -> Parameters {
    Parameters { wall, maternal_fat_mm: wall.fat_mm(), ..Parameters::default() }
}

/// Organs from the skin to the inside of the abdominal wall.
fn wall_organs(parameters: &Parameters) -> Vec<Organ> {
    let mut all = organs(parameters);
    let inside = all.iter().find(|o| o.name == "abdominal_interior").unwrap().priority;
    all.retain(|o| o.priority <= inside);
    all
}

/// Scene of the wall alone. The space inside it is gel, to whose speed delays refer.
fn scene(parameters: &Parameters) -> Scene {
    let names: Vec<&str> = wall_organs(parameters).iter().map(|o| o.name).collect();
    let tissues = TissueTable::builtin().unwrap();
    let gel = tissues.index_of("gel").unwrap();
    let surface = |part: insonify::phantom::PhantomSurface| {
        let tissue = if part.name == "abdominal_interior" { gel } else { tissues.index_of(&part.tissue).unwrap() };
        Surface { name: part.name, tissue, priority: part.priority, mesh: part.mesh }
    };
    let (border, others): (Vec<&str>, Vec<&str>) = names.into_iter().partition(|&name| name == "muscle_border_fat");
    let all = [parts(parameters, &border, BORDER_CELL_MM), parts(parameters, &others, CELL_MM)].concat();
    let surfaces = all.into_iter().map(surface).collect();
    let mut scene = Scene { tissues, background: gel, surfaces, motion: Motion::default(), axes: Axes::default() };
    scene.sort_by_priority();
    scene
}

/// Names and poses of the standard planes' views and of the exam's key frames.
fn poses(parameters: &Parameters) -> Vec<(String, Pose)> {
    let skin = phantom::skin(parameters);
    let planes = phantom::planes(parameters).with_poses(&skin, PRESS_MM).planes;
    let views = planes.into_iter().flat_map(|plane| {
        let pose_of = move |view: View| Some((format!("{} {}", plane.name, view.name), view.pose?));
        plane.views.into_iter().filter_map(pose_of)
    });
    let exam = sweep(&landmarks(parameters), |from, along| skin.exit(from, along), SEED).unwrap();
    let key_frame =
        |(name, time_s): (&str, f64)| (format!("key frame {name}"), exam[(time_s * f64::from(RATE_HZ)) as usize].pose);
    views.chain(KEY_FRAMES.map(key_frame)).collect()
}

fn aperture() -> Aperture {
    Aperture { width_mm: 30.0, face_radius_mm: Probe::default().face_radius_mm(), depth_mm: 60.0 }
}

/// Aberration over an aperture of 30 mm, at five scanlines of each pose: the pose's name, the scanline's angle in
/// degrees, and the aberration. The face is moved out of the body by `lifted_mm`.
fn figures(parameters: &Parameters, lifted_mm: f64) -> Vec<(String, f64, Aberration)> {
    let (scene, probe) = (scene(parameters), Probe::default());
    let (caster, aperture) = (Caster::of(&scene), aperture());
    let mut all = Vec::new();
    for (name, pose) in poses(parameters) {
        for fraction in [0.15, 0.325, 0.5, 0.675, 0.85] {
            let angle = probe.lateral_coordinate(fraction);
            let origin_mm = probe.ray(angle).0 - DVec3::Z * lifted_mm;
            let beam = Pose { position_mm: origin_mm, orientation: DQuat::from_rotation_y(angle) };
            all.push((name.clone(), angle.to_degrees(), caster.aberration(&(pose * beam), &aperture)));
        }
    }
    all
}

fn median_rms_and_length(figures: &[(String, f64, Aberration)]) -> (f64, f64, Wall) {
    let all: Vec<Aberration> = figures.iter().map(|&(.., a)| a).collect();
    let summary = summary(&all, &aperture()).unwrap();
    (summary.delay_rms_ns[0], summary.correlation_mm.unwrap(), summary.wall)
}

#[test]
fn an_easy_wall_is_frosted_glass_and_no_lens() {
    let mut figures = figures(&of(Wall::Easy), 0.0);
    // At the profile's plane the face is pressed obliquely into a flank: the missing fat is a wedge.
    figures.retain(|(name, ..)| !name.starts_with("profile"));
    let (rms, length, wall) = median_rms_and_length(&figures);
    assert!(rms <= 17.0 && wall == Wall::Easy, "{rms} ns");
    assert!((4.0..=8.0).contains(&length), "{length} mm");
    for (name, angle, a) in &figures {
        // Beams that leave obliquely pass more of each layer on one side.
        let (most_ns, most_mrad) = if angle.abs() < 15.0 { (22.0, 3.5) } else { (24.0, 7.0) };
        assert!(a.delay_rms_ns <= most_ns, "{name} at {angle:.0}°: {a:?}");
        assert!(a.tilt_mrad.abs() <= most_mrad, "{name} at {angle:.0}°: {a:?}");
    }
}

#[test]
fn an_easy_wall_hardly_tilts_if_the_face_does_not_cut_it() {
    // A face before the skin, in gel: what is left is the wall's own.
    for (name, angle, a) in figures(&of(Wall::Easy), 12.0).into_iter().filter(|(_, angle, _)| angle.abs() < 15.0) {
        assert!(a.delay_rms_ns <= 14.0 && a.tilt_mrad.abs() <= 3.5, "{name} at {angle:.0}°: {a:?}");
    }
}

#[test]
fn average_and_hard_walls_aberrate_as_their_names_say() {
    let (average, length, name) = median_rms_and_length(&figures(&of(Wall::Average), 0.0));
    assert!((40.0..=50.0).contains(&average) && name == Wall::Average, "{average} ns");
    assert!((4.0..=8.0).contains(&length), "{length} mm");
    let (hard, length, name) = median_rms_and_length(&figures(&of(Wall::Hard), 0.0));
    assert!((60.0..=90.0).contains(&hard) && name == Wall::Hard, "{hard} ns");
    assert!((3.5..=8.0).contains(&length), "{length} mm");
}

#[test]
fn the_recti_are_a_lens_only_if_asked() {
    let over_the_gap = |recti_lens| {
        let parameters = Parameters { recti_lens, ..Parameters::default() };
        let femur =
            figures(&parameters, 0.0).into_iter().find(|(name, angle, _)| name == "femur left" && *angle == 0.0);
        femur.unwrap().2.delay_rms_ns
    };
    let (without, with) = (over_the_gap(false), over_the_gap(true));
    assert!(without < 20.0 && with > 80.0, "{without} and {with} ns");
}

/// Half the width of a stripe of scatterers, the distance between stripes, and their depth range, mm.
const STRIPE_HALF_MM: f64 = 2.0;
const STRIPE_PERIOD_MM: f64 = 8.0;
const STRIPES_MM: [f64; 2] = [90.0, 125.0];

/// Adds stripes of scatterers below a pose, long in the probe's y direction. The scene's other tissues stay.
fn add_stripes(scene: &mut Scene, pose: &Pose) {
    let name_of = |index: usize| scene.tissues.names()[index].clone();
    let interior = scene.tissues.tissues()[scene.background].clone();
    let stripe = Tissue { scatterer_density: 1.0, scatterer_deviation: 0.05, ..interior };
    let named = scene.tissues.names().iter().cloned().zip(scene.tissues.tissues().iter().cloned());
    let tissues = TissueTable::new(named.chain([("stripe".to_owned(), stripe)])).unwrap();
    let mut surfaces: Vec<Surface> = scene.surfaces.clone();
    for surface in &mut surfaces {
        surface.tissue = tissues.index_of(&name_of(surface.tissue)).unwrap();
    }
    let [top, bottom] = STRIPES_MM.map(|mm| mm as f32);
    for number in -2..=2 {
        let (middle, half) = (f64::from(number) * STRIPE_PERIOD_MM, STRIPE_HALF_MM);
        let low = Vec3::new((middle - half) as f32, -40.0, top);
        let mut mesh = analytic::cuboid(low, Vec3::new((middle + half) as f32, 40.0, bottom));
        for vertex in &mut mesh.vertices_mm {
            *vertex = (pose.position_mm + pose.orientation * vertex.as_dvec3()).as_vec3();
        }
        surfaces.push(Surface {
            name: format!("stripe {number}"),
            tissue: tissues.index_of("stripe").unwrap(),
            priority: i32::MAX,
            mesh,
        });
    }
    scene.background = tissues.index_of(&name_of(scene.background)).unwrap();
    (scene.tissues, scene.surfaces) = (tissues, surfaces);
    scene.sort_by_priority();
}

/// A linear array at 8 MHz with an aperture of 20 mm.
fn flat_probe() -> Probe {
    let kind = ProbeKind::Linear { width_mm: 64.0 };
    Probe {
        kind,
        scanlines: 256,
        samples: 2560.into(),
        depth_mm: 130.0,
        frequency_mhz: 8.0,
        aperture_mm: 20.0,
        ..Probe::default()
    }
}

fn rendered(scene: &Scene, pose: &Pose, rays: u32, image: ImageSettings) -> Frame {
    let mut settings = RenderSettings { lines: true, image, ..RenderSettings::default() };
    (settings.quality.rays, settings.quality.layers) = (rays, 3);
    let backend = Backend::open(BackendChoice::Host).unwrap();
    let mut frame = Frame::default();
    Renderer::new(&backend, scene, &flat_probe(), &settings).unwrap().render(pose, &mut frame).unwrap();
    frame
}

/// Ratio of the echo power on the stripes to that between them, 95 to 120 mm deep, dB.
fn stripe_contrast_db(scene: &Scene, pose: &Pose) -> f64 {
    let probe = flat_probe();
    let frame = rendered(scene, pose, 32, ImageSettings { width: 96, height: 64, ..ImageSettings::default() });
    let samples = [95.0, 120.0].map(|mm| (mm / probe.sample_spacing_mm()) as usize);
    let power_at = |x_mm: f64| {
        let lines = (0..probe.scanlines).filter(|&line| {
            let fraction = (f64::from(line) + 0.5) / f64::from(probe.scanlines);
            (probe.lateral_coordinate(fraction) - x_mm).abs() < 0.5
        });
        let line = |line: u32| &frame.lines[(line * probe.sample_count()) as usize..][samples[0]..samples[1]];
        lines.flat_map(line).map(|s| f64::from(s[0]).powi(2) + f64::from(s[1]).powi(2)).sum::<f64>()
    };
    let half = 0.5 * STRIPE_PERIOD_MM;
    let on: f64 = [-1.0, 0.0, 1.0].map(|n| power_at(n * STRIPE_PERIOD_MM)).iter().sum();
    let between: f64 = [-3.0, -1.0, 1.0, 3.0].map(|n| power_at(n * half)).iter().sum();
    10.0 * ((on / 3.0) / (between / 4.0)).log10()
}

/// Writes the sound speeds in the scan plane below a pose, m/s, for `tests/truth/stripes.py`: f32 [1040 × 512], pixels
/// of 0.125 mm.
fn write_speeds(scene: &Scene, pose: &Pose, path: &Path) {
    let image = ImageSettings { width: 512, height: 1040, ..ImageSettings::default() };
    let frame = rendered(scene, pose, 1, image);
    let tissues = scene.tissues.tissues();
    let speed = |&number: &u8| tissues[usize::from(number.max(1)) - 1].speed_m_s as f32;
    let bytes: Vec<u8> = frame.segmentation.iter().flat_map(|number| speed(number).to_le_bytes()).collect();
    std::fs::write(path, bytes).unwrap();
}

/// Stripe contrasts by wave theory through the same scan planes, dB. They are from `tests/truth/stripes.py`, with the
/// maps that this test writes to the folder `INSONIFY_WRITE_SPEEDS`.
const THEORY_DB: [(Wall, [(&str, f64); 3]); 3] = [
    (Wall::Easy, [("head", 15.3), ("heart", 17.6), ("femur", 21.4)]),
    (Wall::Average, [("head", -1.4), ("heart", 4.7), ("femur", 9.4)]),
    (Wall::Hard, [("head", -4.6), ("heart", 6.3), ("femur", 3.5)]),
];

#[test]
fn stripes_behind_walls_have_the_contrast_of_wave_theory() {
    for (wall, expected) in THEORY_DB {
        let parameters = of(wall);
        let bare = scene(&parameters);
        let poses = poses(&parameters);
        for (name, theory_db) in expected {
            let key_frame = format!("key frame {name}");
            let &(_, pose) = poses.iter().find(|(name, _)| *name == key_frame).unwrap();
            if let Some(folder) = std::env::var_os("INSONIFY_WRITE_SPEEDS") {
                write_speeds(&bare, &pose, &Path::new(&folder).join(format!("{}_{name}.f32", wall.name())));
            }
            let mut scene = bare.clone();
            add_stripes(&mut scene, &pose);
            let contrast_db = stripe_contrast_db(&scene, &pose);
            println!("{wall:?}, {name}: {contrast_db:.1} dB, by theory {theory_db}");
            assert!((contrast_db - theory_db).abs() <= 3.0, "{wall:?}, {name}: {contrast_db:.1} dB, not {theory_db}");
            assert!(wall != Wall::Easy || contrast_db >= 10.0, "{name}: {contrast_db:.1} dB");
        }
    }
}

#[test]
fn all_walls_show_their_layers() {
    for wall in Wall::ALL {
        let parameters = of(wall);
        let mut organs = wall_organs(&parameters);
        organs.sort_by_key(|o| o.priority);
        let tissue = |p: Vec3| organs.iter().rev().find(|o| o.solid.distance_mm(p) < 0.0).map(|o| o.tissue);
        // Inward through a rectus, then through the linea alba: thickness of each medium, mm.
        for (x, muscle) in [(35.0, true), (0.0, false)] {
            let mut thickness = std::collections::BTreeMap::new();
            (0..2000).filter_map(|i| tissue(Vec3::new(x, 5.0, 110.0 - 0.03 * i as f32))).for_each(|name| {
                *thickness.entry(name).or_insert(0.0) += 0.03;
            });
            let of = |name: &str| thickness.get(name).copied().unwrap_or(0.0);
            assert!((1.9..2.6).contains(&of("skin")), "{wall:?} at {x}: {thickness:?}");
            assert!(of("fat") + of("septum") > wall.fat_mm() as f32, "{wall:?} at {x}: {thickness:?}");
            assert!(of("fascia") > 0.4 && of("peritoneum") > 0.4, "{wall:?} at {x}: {thickness:?}");
            assert_eq!(of("muscle") > 2.0, muscle, "{wall:?} at {x}: {thickness:?}");
        }
    }
}
