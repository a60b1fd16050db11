//! Where things are in the phantom, for scan planes and sweeps.

use glam::Vec3;

use super::attitude::Attitude;
use super::biometry::Biometry;
use super::parameters::Parameters;
use super::{fetus, mother};

/// Points (mm) and unit directions in the scene frame: x mother's left, y cranial, z anterior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landmarks {
    /// Centre of the fetal skull, in the transthalamic plane.
    pub head_centre_mm: Vec3,
    /// Normal of the axial planes of the head (transthalamic, transventricular), towards the vertex.
    pub head_vertex: Vec3,
    /// From the head's centre to the face; lies in the axial planes, along the midline echo.
    pub head_face: Vec3,
    /// To the fetus' left; normal of the midsagittal planes of head and trunk.
    pub fetus_left: Vec3,
    /// Centre of the fetal abdomen at the level of the stomach: the plane of the abdominal circumference.
    pub abdomen_centre_mm: Vec3,
    /// Direction of the spine at that level, towards the fetal head: normal of the plane of the circumference.
    pub abdomen_cranial: Vec3,
    /// From the spine to the belly at that level.
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
    /// Centre of the fetal bladder.
    pub fetal_bladder_mm: Vec3,
    /// Centre of the fetal stomach bubble.
    pub stomach_mm: Vec3,
    /// Middle of the placenta's thickness at its centre.
    pub placenta_centre_mm: Vec3,
    /// From the placenta's centre to the uterine wall that bears it.
    pub placenta_outward: Vec3,
    /// Centre of the maternal bladder.
    pub maternal_bladder_mm: Vec3,
    /// Half axes of the uterine cavity, centred at the origin, along x, y, z.
    pub cavity_semi_mm: Vec3,
    /// Highest point of the belly's skin above the origin: (0, 0, z).
    pub belly_top_mm: Vec3,
}

/// Landmarks of the phantom that [`build`](super::build) makes.
pub fn landmarks() -> Landmarks {
    let parameters = Parameters::default();
    let biometry = Biometry::default();
    let attitude = Attitude::curled(&biometry);
    let head = attitude.scene_from_fetus.then(&attitude.fetus_from_head);
    let abdomen = attitude.scene_from_fetus.then(&attitude.vertebra(fetus::ABDOMEN_LEVEL));
    let heart = attitude.scene_from_fetus.then(&fetus::heart_frame(&attitude));
    let femur = |side: usize| fetus::femur_tips(&biometry, &attitude.legs[side]).map(|p| attitude.scene_point(p));
    let (placenta_centre_mm, placenta_outward) = mother::placenta_centre(&parameters);
    Landmarks {
        head_centre_mm: head.translation,
        head_vertex: head.vector(Vec3::Y),
        head_face: head.vector(Vec3::Z),
        fetus_left: head.vector(Vec3::X),
        abdomen_centre_mm: attitude.scene_point(fetus::trunk_centre(&attitude, fetus::ABDOMEN_LEVEL)),
        abdomen_cranial: abdomen.vector(Vec3::Y),
        abdomen_ventral: abdomen.vector(Vec3::Z),
        heart_centre_mm: heart.translation,
        heart_cranial: heart.vector(Vec3::Y),
        left_femur_mm: femur(0),
        right_femur_mm: femur(1),
        spine_mm: std::array::from_fn(|i| attitude.scene_point(attitude.vertebra(0.5 + 4.0 * i as f32).translation)),
        fetal_bladder_mm: attitude.scene_point(fetus::bladder_centre(&attitude)),
        stomach_mm: attitude.scene_point(fetus::stomach_centre(&attitude)),
        placenta_centre_mm,
        placenta_outward,
        maternal_bladder_mm: mother::bladder_centre(&parameters),
        cavity_semi_mm: mother::cavity_semi_mm(&parameters),
        belly_top_mm: Vec3::new(0.0, 0.0, mother::belly_top_mm(&parameters)),
    }
}
