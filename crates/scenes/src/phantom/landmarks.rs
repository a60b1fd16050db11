//! Landmarks of the phantom, for scan planes and sweeps.

use glam::Vec3;

use super::attitude::Attitude;
use super::parameters::Parameters;
use super::{fetus, mother};

/// Points (mm) and unit directions in the scene frame: x mother's left, y cranial, z anterior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landmarks {
    /// Centre of the fetal skull, in the transthalamic plane.
    pub head_centre_mm: Vec3,
    /// Normal of the axial planes of the head (transthalamic, transventricular), towards the vertex.
    pub head_vertex: Vec3,
    /// Direction from the head's centre to the face, in the axial planes, along the midline echo.
    pub head_face: Vec3,
    /// Direction to the fetus' left; normal of the midsagittal planes of head and trunk.
    pub fetus_left: Vec3,
    /// Centre of the fetal abdomen at the level of the stomach: the plane of the abdominal circumference.
    pub abdomen_centre_mm: Vec3,
    /// Unit direction of the spine at the level of [`Self::abdomen_centre_mm`], towards the fetal head: normal of the
    /// plane of the circumference.
    pub abdomen_cranial: Vec3,
    /// Unit direction from the spine to the belly at the level of [`Self::abdomen_centre_mm`].
    pub abdomen_ventral: Vec3,
    /// Centre of the fetal heart, in the four-chamber plane.
    pub heart_centre_mm: Vec3,
    /// Normal of the four-chamber plane, towards the fetal head.
    pub heart_cranial: Vec3,
    /// Proximal (hip) and distal (knee) tip of the ossified left femur; their distance is the femur length.
    pub left_femur_mm: [Vec3; 2],
    /// Proximal and distal tip of the ossified right femur.
    pub right_femur_mm: [Vec3; 2],
    /// Centres of the vertebral bodies from C1 to S5, every fourth.
    pub spine_mm: [Vec3; 8],
    /// Ends of the biparietal diameter: outer table on the left, inner table on the right.
    pub biparietal_mm: [Vec3; 2],
    /// Ends of the occipitofrontal diameter, outer to outer: frontal, occipital.
    pub occipitofrontal_mm: [Vec3; 2],
    /// Centre of the cavum septi pellucidi.
    pub cavum_mm: Vec3,
    /// Inner and outer wall of the atrium of the left, then of the right lateral ventricle.
    pub atria_mm: [[Vec3; 2]; 2],
    /// Left and right end of the cerebellum; with the cavum they span the transcerebellar plane.
    pub cerebellum_mm: [Vec3; 2],
    /// Ends of the cisterna magna's depth: vermis, inner table.
    pub cisterna_magna_mm: [Vec3; 2],
    /// Centres of the left and right eye.
    pub eyes_mm: [Vec3; 2],
    /// Outer borders of the left and right eye: the binocular distance.
    pub eye_borders_mm: [Vec3; 2],
    /// Skin at the tip of the nose.
    pub nose_tip_mm: Vec3,
    /// Skin at the chin.
    pub chin_mm: Vec3,
    /// Centres of left arch, right arch and body of the vertebrae T6, L1, L3 and S1.
    pub ossification_centres_mm: [[Vec3; 3]; 4],
    /// Centre, upper and lower pole of the left, then of the right kidney.
    pub kidneys_mm: [[Vec3; 3]; 2],
    /// Centres of left ventricle, right ventricle, left atrium and right atrium.
    pub heart_chambers_mm: [Vec3; 4],
    /// Crux of the heart, where the septa and both valves meet.
    pub heart_crux_mm: Vec3,
    /// Centre of the descending aorta in front of the spine, in the four-chamber plane and in the plane of the
    /// abdominal circumference.
    pub aorta_mm: [Vec3; 2],
    /// Shoulder and elbow tip of the ossified left, then right humerus.
    pub humeri_mm: [[Vec3; 2]; 2],
    /// Knee and ankle tip of the ossified left, then right tibia.
    pub tibiae_mm: [[Vec3; 2]; 2],
    /// Ends of the abdomen's axes at the skin: ventral, dorsal, left, right.
    pub abdomen_axes_mm: [Vec3; 4],
    /// Bend of the umbilical vein into the portal sinus.
    pub portal_sinus_mm: Vec3,
    /// Insertion of the umbilical cord in the fetal belly's skin.
    pub cord_insertion_mm: Vec3,
    /// Centre of the fetal bladder.
    pub fetal_bladder_mm: Vec3,
    /// Centre of the fetal stomach bubble.
    pub stomach_mm: Vec3,
    /// Centre of the placenta, in the middle of its thickness.
    pub placenta_centre_mm: Vec3,
    /// Direction from the placenta's centre to the uterine wall that bears it.
    pub placenta_outward: Vec3,
    /// Centre of the maternal bladder.
    pub maternal_bladder_mm: Vec3,
    /// Semi-axes of the uterine cavity, centred at the origin, along x, y, z.
    pub cavity_semi_mm: Vec3,
    /// Highest point of the belly's skin above the origin: (0, 0, z).
    pub belly_top_mm: Vec3,
}

/// Landmarks of the phantom that [`build`](super::build) makes.
pub fn landmarks(parameters: &Parameters) -> Landmarks {
    let attitude = Attitude::of(parameters);
    let biometry = attitude.biometry;
    let scene = |fetal: Vec3| attitude.scene_from_fetus.point(fetal);
    let head = attitude.scene_from_fetus.then(&attitude.fetus_from_head);
    let abdomen = attitude.scene_from_fetus.then(&attitude.vertebra(fetus::ABDOMEN_LEVEL));
    let heart = attitude.scene_from_fetus.then(&fetus::heart_frame(&attitude));
    let (placenta_centre_mm, placenta_outward) = mother::placenta_centre(parameters);
    let semi = biometry.skull_semi_mm();
    let abdomen_centre_mm = scene(fetus::trunk_centre(&attitude, fetus::ABDOMEN_LEVEL));
    let eyes_mm = fetus::eye_centres(&attitude).map(scene);
    let ocular = 0.5 * biometry.ocular_mm * head.vector(Vec3::X);
    let (chambers, crux) = fetus::chamber_centres(&attitude);
    let pair = |of: &dyn Fn(usize) -> [Vec3; 2]| [0, 1].map(|side| of(side).map(scene));
    let axes = [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X];
    let [left_femur_mm, right_femur_mm] = pair(&|side| fetus::femur_tips(&attitude, side));
    Landmarks {
        head_centre_mm: head.translation,
        head_vertex: head.vector(Vec3::Y),
        head_face: head.vector(Vec3::Z),
        fetus_left: head.vector(Vec3::X),
        abdomen_centre_mm,
        abdomen_cranial: abdomen.vector(Vec3::Y),
        abdomen_ventral: abdomen.vector(Vec3::Z),
        heart_centre_mm: heart.translation,
        heart_cranial: heart.vector(Vec3::Y),
        left_femur_mm,
        right_femur_mm,
        spine_mm: std::array::from_fn(|i| scene(attitude.vertebra(0.5 + 4.0 * i as f32).translation)),
        biparietal_mm: [Vec3::X * semi.x, Vec3::X * (biometry.skull_thickness_mm - semi.x)].map(|p| head.point(p)),
        occipitofrontal_mm: fetus::occipitofrontal_ends(&attitude).map(scene),
        cavum_mm: scene(fetus::cavum_centre(&attitude)),
        atria_mm: fetus::atrium_walls(&attitude).map(|walls| walls.map(scene)),
        cerebellum_mm: fetus::cerebellum_ends(&attitude).map(scene),
        cisterna_magna_mm: fetus::cisterna_magna(&attitude).map(scene),
        eyes_mm,
        eye_borders_mm: [eyes_mm[0] + ocular, eyes_mm[1] - ocular],
        nose_tip_mm: scene(fetus::nose_tip(&attitude)),
        chin_mm: scene(fetus::chin(&attitude)),
        ossification_centres_mm: [12.5, 19.5, 21.5, 24.5]
            .map(|level| fetus::ossification_centres(&attitude, level).map(scene)),
        kidneys_mm: fetus::kidney_poles(&attitude).map(|poles| poles.map(scene)),
        heart_chambers_mm: chambers.map(scene),
        heart_crux_mm: scene(crux),
        aorta_mm: [fetus::HEART_LEVEL, fetus::ABDOMEN_LEVEL]
            .map(|level| scene(fetus::descending_aorta(&attitude, level))),
        humeri_mm: pair(&|side| fetus::humerus_tips(&attitude, side)),
        tibiae_mm: pair(&|side| fetus::tibia_tips(&attitude, side)),
        abdomen_axes_mm: fetus::skin_points(&attitude, fetus::ABDOMEN_LEVEL, axes).map(scene),
        portal_sinus_mm: scene(fetus::portal_sinus(&attitude)),
        cord_insertion_mm: scene(fetus::navel(&attitude)),
        fetal_bladder_mm: scene(fetus::bladder_centre(&attitude)),
        stomach_mm: scene(fetus::stomach_centre(&attitude)),
        placenta_centre_mm,
        placenta_outward,
        maternal_bladder_mm: mother::bladder_centre(parameters),
        cavity_semi_mm: mother::cavity_semi_mm(parameters),
        belly_top_mm: Vec3::new(0.0, 0.0, mother::belly_top_mm(parameters)),
    }
}
