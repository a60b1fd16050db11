//! Small scenes and probes that together reach every branch of the passes.
//!
//! Flat surfaces avoid the faces of the scatterer lattice (multiples of 0.15 mm from the scene's centre), where
//! rounding would decide the cell.

use std::sync::LazyLock;

use glam::{DVec3, Quat, Vec3};
use insonify::anatomy::analytic::{self, Part, cuboid, oblique_slab, plate, sphere};
use insonify::anatomy::{Bvh, Mesh, Scene, TissueTable};
use insonify::pose::Pose;
use insonify::render::{
    Backend, BackendChoice, Frame, ImageSettings, Quality, RenderSettings, Renderer, ShaderSet, Snapshot, TestHooks,
};
use insonify::settings::ReceiverSettings;
use insonify::transducer::{Probe, ProbeKind};

/// Backend on a device, which may be software.
pub(crate) static DEVICE: LazyLock<Backend> = LazyLock::new(|| Backend::open(BackendChoice::Device).unwrap());
/// Backend on the host.
pub(crate) static HOST: LazyLock<Backend> = LazyLock::new(|| Backend::open(BackendChoice::Host).unwrap());

/// A scene, a probe in it and settings.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) scene: Scene,
    pub(crate) probe: Probe,
    pub(crate) settings: RenderSettings,
    pub(crate) pose: Pose,
}

impl Case {
    /// A renderer on the device.
    pub(crate) fn renderer(&self, shaders: &ShaderSet) -> Renderer {
        self.renderer_on(&DEVICE, &TestHooks { shaders: shaders.clone(), ..TestHooks::default() })
    }

    /// A renderer on the host.
    pub(crate) fn host_renderer(&self) -> Renderer {
        self.renderer_on(&HOST, &TestHooks::default())
    }

    pub(crate) fn renderer_on(&self, backend: &Backend, hooks: &TestHooks) -> Renderer {
        let bvh = Bvh::build(&self.scene).unwrap();
        Renderer::with_hooks(backend, &self.scene, bvh, &self.probe, &self.settings, hooks).unwrap()
    }
}

pub(crate) fn scene(parts: Vec<Part>, background: &str) -> Scene {
    analytic::scene(parts, &TissueTable::builtin().unwrap(), background).unwrap()
}

pub(crate) fn probe(kind: ProbeKind, depth_mm: f64, scanlines: u32, samples: u32) -> Probe {
    // A narrow aperture: the beam spans several of the few scanlines.
    let beam = Probe { focus_mm: 0.5 * depth_mm, aperture_mm: 5.0, ..Probe::default() };
    Probe { kind, depth_mm, scanlines, samples: samples.into(), ..beam }
}

pub(crate) fn settings(quality: (u32, u32), width: u32) -> RenderSettings {
    let image = ImageSettings {
        width,
        height: 150,
        gain_db: 20.0,
        tgc_sliders_db: [0.0, -6.0, 3.0, 5.0, 5.0, -2.0, 4.0, 8.0],
        ..ImageSettings::default()
    };
    let quality = Quality { rays: quality.0, layers: quality.1, seed: 7 };
    RenderSettings { image, quality, lines: true, maps: true, ..RenderSettings::default() }
}

/// Pose at `from` that looks at `target`, rotated slightly so that nothing is in a coordinate plane.
fn pose(from: [f64; 3], target: [f64; 3]) -> Pose {
    let (from, target) = (DVec3::from(from), DVec3::from(target));
    Pose::looking(from, target - from, DVec3::new(1.0, 0.13, 0.07))
}

pub(crate) fn part(name: &'static str, tissue: &'static str, priority: i32, mesh: Mesh) -> Part {
    Part { name, tissue, priority, mesh }
}

fn at(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Parts that are nested layers, one of them oblique.
fn slabs() -> Vec<Part> {
    vec![
        part("fat", "fat", 1, cuboid(at(-110.1, -40.1, 10.04), at(110.1, 40.1, 40.0))),
        part("muscle", "muscle", 2, cuboid(at(-109.2, -39.2, 35.03), at(109.2, 39.2, 110.0))),
        part("oblique liver", "liver", 3, oblique_slab(at(-108.3, -38.3, 75.0), at(108.3, 38.3, 135.17), 10.0)),
        part("water band", "water", 4, cuboid(at(-107.2, -37.2, 105.05), at(107.2, 37.2, 115.02))),
    ]
}

/// Nested, overlapping and touching surfaces, among them rough, bony and aerated ones; the probe starts inside two.
pub(crate) fn nested() -> Case {
    let parts = vec![
        part("block", "soft_tissue", 1, cuboid(at(-60.05, -40.0, -15.0), at(60.05, 40.0, 95.0))),
        part("skin", "skin", 2, cuboid(at(-61.0, -41.0, -15.6), at(61.0, 41.0, 3.04))),
        part("liver", "liver", 3, sphere(at(-8.0, 2.0, 38.0), 22.0, 3)),
        part("kidney", "kidney", 4, sphere(at(6.0, -1.0, 45.0), 16.0, 3)),
        part("cyst", "amniotic_fluid", 5, sphere(at(6.0, 0.0, 45.0), 7.0, 3)),
        part("bone", "bone_adult", 6, plate(at(-14.0, 0.0, 33.0), at(9.0, 50.0, 4.0), Quat::from_rotation_y(0.3))),
        // These two share a face.
        part("left", "muscle", 7, cuboid(at(-30.1, -30.1, 66.07), at(4.03, 30.1, 74.0))),
        part("right", "fat", 8, cuboid(at(4.03, -30.1, 66.07), at(36.07, 30.1, 74.0))),
        // The paths' lines cross this one behind the probe.
        part("behind", "cartilage", 1, cuboid(at(-50.0, -30.0, -13.0), at(50.0, 30.0, -11.03))),
        part("air", "air", 9, sphere(at(22.0, 3.0, 56.0), 5.0, 2)),
    ];
    Case {
        name: "nested, convex, 4 × 3",
        scene: scene(parts, "gel"),
        probe: Probe {
            frequency_mhz: 5.0,
            ..probe(ProbeKind::Convex { radius_mm: 40.0, fov_deg: 45.0 }, 90.0, 33, 511)
        },
        settings: settings((4, 3), 201),
        pose: pose([1.3, 0.7, 1.1], [3.0, -2.0, 60.0]),
    }
}

/// All cases; the first is the cheapest.
pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case {
            name: "slabs, convex, 1 × 1",
            scene: scene(slabs(), "gel"),
            probe: probe(ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 }, 150.0, 32, 512),
            settings: settings((1, 1), 200),
            pose: pose([0.4, 0.3, 0.2], [2.0, -3.0, 90.0]),
        },
        Case {
            name: "cyst, linear, 4 × 3",
            scene: scene(analytic::cyst(), "liver"),
            probe: probe(ProbeKind::Linear { width_mm: 40.0 }, 110.0, 32, 512),
            settings: settings((4, 3), 200),
            pose: pose([0.9, -0.8, 0.0], [1.0, 2.0, 70.0]),
        },
        Case {
            name: "bone plate, phased, 1 × 1",
            scene: scene(analytic::bone_plate(), "soft_tissue"),
            probe: probe(ProbeKind::Phased { fov_deg: 80.0 }, 90.0, 32, 512),
            settings: RenderSettings { reflections_max: 1, beam_taps_max: 5, ..settings((1, 1), 200) },
            pose: pose([0.2, 0.1, 0.3], [-9.0, 4.0, 50.0]),
        },
        nested(),
        lifted(),
    ]
}

/// A face on skin, tilted so that one end is in air, with noise and clutter. Paths leave the body sideways and below.
pub(crate) fn lifted() -> Case {
    let body = vec![
        part("skin", "skin", 1, cuboid(at(-14.03, -20.1, 0.04), at(40.1, 20.1, 60.0))),
        part("fat", "fat", 2, cuboid(at(-13.0, -19.0, 2.03), at(39.0, 19.0, 40.06))),
        part("liver", "liver", 3, sphere(at(4.0, 1.0, 25.0), 10.0, 3)),
    ];
    let base = settings((2, 2), 200);
    let image = ImageSettings { gain_db: 40.0, ..base.image };
    let receiver = ReceiverSettings { noise_db: -110.0, clutter_db: -50.0, reverberation_db: -40.0, ..base.receiver };
    Case {
        name: "lifted, convex, 2 × 2",
        scene: scene(body, "gel"),
        probe: probe(ProbeKind::Convex { radius_mm: 30.0, fov_deg: 60.0 }, 80.0, 33, 512),
        settings: RenderSettings { image, receiver, ..base },
        pose: pose([0.3, 0.7, -1.1], [5.0, 2.0, 24.0]),
    }
}

/// Frame and snapshot of a case by the device.
pub(crate) struct Rendered {
    pub(crate) name: &'static str,
    pub(crate) snapshot: Snapshot,
    pub(crate) frame: Frame,
}

/// Every case, rendered once for all tests.
pub(crate) static RENDERED: LazyLock<Vec<Rendered>> = LazyLock::new(|| {
    let render = |case: Case| {
        let mut renderer = case.renderer(&ShaderSet::default());
        let mut frame = Frame::default();
        renderer.render(&case.pose, &mut frame).unwrap();
        Rendered { name: case.name, snapshot: renderer.snapshot(&case.pose).unwrap(), frame }
    };
    cases().into_iter().map(render).collect()
});
