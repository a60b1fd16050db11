//! Content of the fetal skull: fluid around the brain, falx, ventricles with choroid plexus, thalami, posterior fossa.
//! In the head's frame, in mm as drawn.

use glam::Vec3;
use insonify_core::anatomy::sdf::{
    Isometry, Solid, ellipsoid, half_space, plate, round_cone, rounded_box, smooth_sweep, smooth_union, sphere, union,
};

use super::head;
use crate::phantom::attitude::Attitude;
use crate::phantom::biometry::Biometry;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Thickness of the fluid between the skull and the brain, mm.
const SUBARACHNOID_MM: f32 = 1.6;

/// Centre of the cavum septi pellucidi.
const CAVUM: Vec3 = Vec3::new(0.0, 2.0, 13.5);
const CAVUM_SEMI: Vec3 = Vec3::new(1.9, 3.4, 5.2);

/// Subarachnoid fluid, brain, and the structures in it.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let biometry = &attitude.biometry;
    let scale = biometry.head_scale();
    let place = |solid: Solid| attitude.in_head(solid);
    let inside = head::cranium(biometry, -head::table(biometry));
    let fossa = PosteriorFossa::of(biometry);
    vec![
        Fetus.organ("subarachnoid_space", "csf", 142, 0.95, 6.0 * scale, place(inside.clone())),
        Fetus.organ("brain", "brain", 144, 0.85, 5.0 * scale, place(brain(biometry))),
        Fetus.organ("deep_brain", "brain_deep", 146, 0.7, 1.8 * scale, place(union([deep_brain(), fossa.brainstem()]))),
        Fetus.organ("falx_and_tentorium", "falx", 148, 0.55, 1.1 * scale, place(falx(&inside))),
        Fetus.organ("ventricles", "csf", 150, 0.55, 1.8 * scale, place(ventricles(biometry, &inside, &fossa))),
        Fetus.organ("cerebellum", "cerebellum", 151, 0.7, 3.2 * scale, place(fossa.hemispheres())),
        Fetus.organ("choroid_plexus", "choroid_plexus", 152, 0.5, 1.7 * scale, place(choroid_plexus(biometry))),
        Fetus.organ("vermis", "cerebellar_vermis", 153, 0.6, 2.0 * scale, place(fossa.vermis())),
    ]
}

/// Hemispheres with a shallow fissure between them and an insula pressed in on each side; late in pregnancy with sulci.
fn brain(biometry: &Biometry) -> Solid {
    let v = Vec3::new;
    let whole = head::cranium(biometry, -(head::table(biometry) + SUBARACHNOID_MM));
    let semi = head::semi(biometry);
    let insula = ellipsoid(v(semi.x - 2.5, -1.0, 5.0), v(4.6, 4.2, 7.5)).with_mirror_image();
    let fissure = rounded_box(v(0.0, semi.y - 1.0, 0.0), v(0.9, 6.0, 30.0), 0.9);
    let smooth = whole.smooth_subtract(union([insula, fissure]), 2.0);
    // Sulci deepen from about 25 weeks on, when the biparietal diameter is 62 mm (assumed depth).
    let depth = 1.1 * ((biometry.biparietal_mm - 62.0) / 24.0).clamp(0.0, 1.0);
    if depth == 0.0 {
        return smooth;
    }
    smooth.displaced(depth, move |p| {
        let wave = |x: f32, y: f32, z: f32, phase: f32| (x * p.x + y * p.y + z * p.z + phase).sin();
        let folds = wave(0.31, 0.52, 0.38, 0.7) + wave(-0.47, 0.29, 0.55, 2.1) + wave(0.18, -0.41, 0.62, 4.0);
        // Broad gyri, narrow sulci.
        -depth * (1.0 - (0.9 * folds).abs()).max(0.0)
    })
}

/// Thalami and the corpus callosum over the cavum.
fn deep_brain() -> Solid {
    let v = Vec3::new;
    let thalamus = ellipsoid(v(5.6, -1.5, -1.2), v(4.9, 5.4, 7.4)).with_mirror_image();
    let callosum = smooth_sweep(
        &[
            (v(0.0, 0.5, 20.6), 0.9),
            (v(0.0, 5.0, 19.6), 1.3),
            (v(0.0, 7.6, 13.0), 1.1),
            (v(0.0, 9.0, 4.0), 1.0),
            (v(0.0, 8.4, -5.0), 1.1),
            (v(0.0, 5.6, -10.6), 1.6),
        ],
        5,
    );
    // The corpus callosum is broader than high.
    let callosum =
        Solid::new(callosum.bounds().grown(3.0), move |p| callosum.distance_mm(p.with_x(p.x - p.x.clamp(-3.0, 3.0))));
    union([thalamus, callosum])
}

/// Falx, a crescent in the midline over the corpus callosum, and tentorium between cerebrum and cerebellum.
fn falx(inside: &Solid) -> Solid {
    let v = Vec3::new;
    let crescent = ellipsoid(v(0.0, -9.0, -1.0), v(40.0, 20.0, 21.5));
    let above = half_space(v(0.0, -9.0, 0.0), v(0.0, -0.96, 0.28));
    let within = inside.grown(-0.4);
    let falx = plate(Vec3::ZERO, Vec3::X, 0.5).intersect(within.clone()).intersect(above).subtract(crescent);
    // The tentorium is half a tent: it slopes down sideways from its ridge and is open in front for the brainstem.
    let slope = v(0.42, 0.90, -0.12).normalize();
    let notch = ellipsoid(v(0.0, -9.0, -7.0), v(11.0, 14.0, 10.0));
    let behind = half_space(v(0.0, 0.0, -4.0), Vec3::Z);
    let right = half_space(v(21.0, 0.0, 0.0), Vec3::X);
    let tent =
        plate(v(0.0, -6.0, -18.0), slope, 0.45).intersect(within).intersect(behind).intersect(right).subtract(notch);
    union([falx, tent.with_mirror_image()])
}

/// Width of the ventricles relative to the model as drawn, whose atrium measures 6.8 mm.
fn ventricle_width(biometry: &Biometry) -> f32 {
    biometry.atrium_mm / biometry.head_scale() / 6.8
}

/// Centre line, with radii, of the left ventricle's body, atrium and temporal horn, mm as drawn.
const LATERAL: [(Vec3, f32); 7] = [
    (Vec3::new(5.0, 2.5, 20.0), 1.1),
    (Vec3::new(6.0, 5.5, 13.0), 2.0),
    (Vec3::new(8.2, 8.5, 3.0), 2.0),
    (Vec3::new(10.4, 7.0, -7.0), 2.7),
    (ATRIUM, 3.4),
    (Vec3::new(14.2, -3.5, -10.0), 2.0),
    (Vec3::new(15.5, -7.0, -1.0), 1.3),
];
const ATRIUM: Vec3 = Vec3::new(12.2, 3.0, -13.5);

/// Lateral, third and fourth ventricle, cavum septi pellucidi and cisterna magna.
fn ventricles(biometry: &Biometry, inside: &Solid, fossa: &PosteriorFossa) -> Solid {
    let v = Vec3::new;
    let width = ventricle_width(biometry);
    let tube = |knots: &[(Vec3, f32)]| {
        let knots: Vec<_> = knots.iter().map(|&(p, r)| (p, r * width)).collect();
        smooth_sweep(&knots, 6)
    };
    let occipital = [(v(12.0, 3.0, -13.0), 3.2), (v(10.8, 2.5, -19.0), 2.4), (v(9.0, 2.0, -24.0), 1.2)];
    let lateral = smooth_union([tube(&LATERAL), tube(&occipital)], 2.0).with_mirror_image();
    let cavum = rounded_box(CAVUM, CAVUM_SEMI, 1.5);
    let third = rounded_box(v(0.0, -3.5, 0.0), v(0.65, 4.5, 6.0), 0.6);
    union([lateral, cavum, third, fossa.fluid(inside)])
}

/// Choroid plexus, which nearly fills the bodies and atria of the ventricles.
fn choroid_plexus(biometry: &Biometry) -> Solid {
    let v = Vec3::new;
    let width = ventricle_width(biometry);
    let knots =
        [(v(8.2, 8.0, 2.0), 1.1), (v(10.3, 6.6, -6.0), 1.9), (v(12.2, 2.8, -13.0), 2.6), (v(13.9, -3.0, -9.8), 1.5)];
    let knots = knots.map(|(p, r)| (p, r * width));
    let glomus = smooth_sweep(&knots, 6);
    glomus.displaced(0.25, |p| 0.25 * (p.x * 2.9).sin() * (p.y * 2.5).sin() * (p.z * 2.7).sin()).with_mirror_image()
}

/// Posterior fossa: cerebellum, brainstem and the fluid behind them.
struct PosteriorFossa {
    /// Size of the cerebellum relative to the model as drawn, 22.4 mm wide.
    size: f32,
    /// Centre of the vermis.
    vermis: Vec3,
}

const VERMIS_SEMI: Vec3 = Vec3::new(2.6, 5.0, 4.2);
/// Vector from the vermis to the centre of the left hemisphere of the cerebellum, and that hemisphere's semi-axes.
const LOBE: Vec3 = Vec3::new(5.8, -0.8, -1.0);
const LOBE_SEMI: Vec3 = Vec3::new(5.4, 5.8, 5.2);

impl PosteriorFossa {
    fn of(biometry: &Biometry) -> Self {
        let scale = biometry.head_scale();
        let size = biometry.cerebellum_mm / scale / (2.0 * (LOBE.x + LOBE_SEMI.x));
        // Depth of the cisterna magna from the vermis to the inner table.
        let semi = head::semi(biometry) - head::table(biometry);
        let y = -14.7;
        let table = -semi.z * (1.0 - (y / semi.y).powi(2)).max(0.0).sqrt();
        let vermis = Vec3::new(0.0, y, table + biometry.cisterna_magna_mm / scale + VERMIS_SEMI.z * size);
        Self { size, vermis }
    }

    fn hemispheres(&self) -> Solid {
        let lobe = ellipsoid(LOBE, LOBE_SEMI).with_mirror_image();
        // Folia: shallow parallel furrows.
        self.place(lobe.displaced(0.18, |p| 0.18 * (2.4 * (p.y + 0.35 * p.x.abs())).sin()))
    }

    fn vermis(&self) -> Solid {
        self.place(ellipsoid(Vec3::ZERO, VERMIS_SEMI))
    }

    fn place(&self, solid: Solid) -> Solid {
        solid.scaled(self.size).placed(Isometry { translation: self.vermis, ..Isometry::IDENTITY })
    }

    /// Midbrain, pons and medulla.
    fn brainstem(&self) -> Solid {
        let v = Vec3::new;
        let midbrain = round_cone(v(0.0, -8.5, -5.5), v(0.0, -13.0, -6.0), 4.4, 4.2);
        let pons = sphere(v(0.0, -14.0, -5.5), 4.6);
        let medulla = round_cone(v(0.0, -15.0, -6.5), v(0.0, -23.5, -11.0), 3.6, 2.6);
        // A peduncle leads to each hemisphere of the cerebellum.
        let peduncle = round_cone(v(2.0, -14.0, -7.0), self.vermis + self.size * LOBE + v(-1.5, 0.0, 2.0), 2.0, 2.2)
            .with_mirror_image();
        smooth_union([midbrain, pons, medulla, peduncle], 1.5)
    }

    /// Fourth ventricle and cisterna magna.
    fn fluid(&self, inside: &Solid) -> Solid {
        let v = Vec3::new;
        let fourth = ellipsoid(self.vermis + v(0.0, 0.0, VERMIS_SEMI.z * self.size + 0.8), v(1.9, 2.2, 1.3));
        let cisterna = ellipsoid(self.vermis + v(0.0, -1.5, -3.5), v(14.0, 8.6, 10.5)).intersect(inside.grown(-0.3));
        union([fourth, cisterna])
    }
}

/// Centre of the cavum septi pellucidi, fetal frame, mm.
pub(in crate::phantom) fn cavum_centre(attitude: &Attitude) -> Vec3 {
    attitude.head_point(CAVUM)
}

/// Inner and outer wall of the atrium of the left, then of the right ventricle, across the ventricle in an axial plane;
/// fetal frame, mm.
pub(in crate::phantom) fn atrium_walls(attitude: &Attitude) -> [[Vec3; 2]; 2] {
    let radius = 3.4 * ventricle_width(&attitude.biometry);
    [1.0, -1.0].map(|side| {
        [-radius, radius].map(|across| attitude.head_point((ATRIUM + Vec3::X * across) * Vec3::new(side, 1.0, 1.0)))
    })
}

/// Left and right end of the cerebellum, fetal frame, mm.
pub(in crate::phantom) fn cerebellum_ends(attitude: &Attitude) -> [Vec3; 2] {
    let fossa = PosteriorFossa::of(&attitude.biometry);
    [1.0, -1.0].map(|side| {
        let end = (LOBE + Vec3::X * LOBE_SEMI.x) * Vec3::new(side, 1.0, 1.0);
        attitude.head_point(fossa.vermis + fossa.size * end)
    })
}

/// Ends of the cisterna magna's depth, on the vermis and on the skull's inner table; fetal frame, mm.
pub(in crate::phantom) fn cisterna_magna(attitude: &Attitude) -> [Vec3; 2] {
    let fossa = PosteriorFossa::of(&attitude.biometry);
    let back = fossa.vermis - Vec3::Z * (VERMIS_SEMI.z * fossa.size);
    let depth = attitude.biometry.cisterna_magna_mm / attitude.biometry.head_scale();
    [back, back - Vec3::Z * depth].map(|p| attitude.head_point(p))
}
