//! Standard planes of the obstetric phantom.
//!
//! The content of each plane follows the guidelines in its `source`. The guidelines give no numeric tolerances, so
//! tolerances are assumed from the effect of an error on the measurement:
//!
//! - An ellipse cut at an angle θ grows by (1/cosθ − 1)/2, 0.8 % at 10°.
//! - A head or belly of 30 mm radius, cut 5 mm off its widest section, shrinks by 1.4 %.
//! - A femur 39 mm long and 5 mm thick leaves a slice of 1.5 mm beyond 9°.
//!
//! In practice, measurements differ by several percent between observers (Sarris et al., Ultrasound Obstet Gynecol
//! 39:266, 2012). The listed effects are smaller.

use glam::{DVec3, Vec3};
use insonify_core::anatomy::planes::{
    Caliper, CaliperKind, PLANES_VERSION, PlaneLandmark, StandardPlane, StandardPlanes, Tolerances, View,
};

use super::{Biometry, Landmarks, Parameters, landmarks};

const BIOMETRY_GUIDE: &str = "ISUOG Practice Guidelines: ultrasound assessment of fetal biometry and growth, \
                              Ultrasound Obstet Gynecol 53:715 (2019)";
const BRAIN_GUIDE: &str = "ISUOG Practice Guidelines: sonographic examination of the fetal central nervous system, \
                           part 1, Ultrasound Obstet Gynecol 56:476 (2020)";
const HEART_GUIDE: &str = "ISUOG Practice Guidelines: fetal cardiac screening, Ultrasound Obstet Gynecol 61:788 (2023)";
const SURVEY_GUIDE: &str = "ISUOG Practice Guidelines: performance of the routine mid-trimester fetal ultrasound scan, \
                            Ultrasound Obstet Gynecol 59:840 (2022); AIUM Practice Parameter for the Performance of \
                            Standard Diagnostic Obstetric Ultrasound Examinations, J Ultrasound Med 37:E13 (2018; volume \
                            and page unverified)";

/// Planes of the phantom that [`build`](super::build) makes from `parameters`.
pub fn planes(parameters: &Parameters) -> StandardPlanes {
    planes_of(&landmarks(parameters), &Biometry::at_weeks(parameters.gestational_weeks))
}

/// Planes of a phantom with these landmarks and sizes.
pub(crate) fn planes_of(landmarks: &Landmarks, biometry: &Biometry) -> StandardPlanes {
    let anatomy = Anatomy::of(landmarks, biometry);
    let planes = [head, cerebellum, abdomen, femur, heart, spine, profile].map(|plane| plane(&anatomy));
    StandardPlanes { version: PLANES_VERSION, planes: planes.into() }
}

/// Landmarks and sizes, and unit directions in the scene that several planes share.
struct Anatomy<'a> {
    landmarks: &'a Landmarks,
    biometry: &'a Biometry,
    left: DVec3,
    /// Direction to the fetus' left or right, whichever is nearer to the mother's belly, where the probe is.
    near: DVec3,
    vertex: DVec3,
    face: DVec3,
    /// Direction from the fetal spine to the fetal belly.
    ventral: DVec3,
}

impl<'a> Anatomy<'a> {
    fn of(landmarks: &'a Landmarks, biometry: &'a Biometry) -> Self {
        let unit = |v: Vec3| v.as_dvec3().normalize();
        let left = unit(landmarks.fetus_left);
        Self {
            landmarks,
            biometry,
            left,
            near: if left.z < 0.0 { -left } else { left },
            vertex: unit(landmarks.head_vertex),
            face: unit(landmarks.head_face),
            ventral: unit(landmarks.abdomen_ventral),
        }
    }

    /// Scene position, mm, of the point `(x, y, z)` in the frame of the head as drawn (mm at 22 weeks). It is scaled
    /// with the skull.
    fn in_head(&self, x: f64, y: f64, z: f64) -> DVec3 {
        let size = (self.biometry.skull_semi_mm() / Biometry::default().skull_semi_mm()).as_dvec3();
        let p = DVec3::new(x, y, z) * size;
        self.landmarks.head_centre_mm.as_dvec3() + self.left * p.x + self.vertex * p.y + self.face * p.z
    }
}

/// Tolerances of a plane; all are assumed, see the top of this file.
fn tolerances(angle_deg: f64, distance_mm: f64, in_plane_deg: Option<f64>) -> Tolerances {
    Tolerances {
        angle_deg,
        distance_mm,
        in_plane_deg,
        centring_mm: 25.0,
        depth_mm: [20.0, 140.0],
        source: "assumed: the error of the measurement stays below about 2 %".to_owned(),
    }
}

/// View with the probe in the direction `to_probe`; `lateral` is made perpendicular to it.
fn view(name: &str, centre_mm: DVec3, lateral: DVec3, to_probe: DVec3) -> View {
    let lateral = lateral.normalize_or(DVec3::X);
    let to_probe = to_probe.reject_from(lateral).normalize_or(lateral.any_orthonormal_vector());
    View::new(name, centre_mm, lateral, to_probe)
}

/// View in the midsagittal plane of the fetus with the probe in the direction `to_probe`. A probe cannot reach the
/// mother's back. A direction towards her back is replaced by the direction in the plane closest to her front.
fn midsagittal(a: &Anatomy, centre_mm: DVec3, lateral: DVec3, to_probe: DVec3) -> View {
    /// Smallest z of the unit direction to the probe: on a flank, a beam points up by at most about 15° (assumed).
    const LOWEST_Z: f64 = -0.25;
    let wanted = view("", centre_mm, lateral, to_probe.reject_from(a.left));
    if wanted.to_probe.z >= LOWEST_Z {
        return wanted;
    }
    let to_probe = DVec3::Z.reject_from(a.left);
    let across = to_probe.cross(a.left);
    view("", centre_mm, across * across.dot(lateral).signum(), to_probe)
}

/// Landmarks from `(name, position, distance)`. `distance` is the largest accepted distance from the image plane, mm:
/// half the landmark's size plus part of the slice thickness.
fn marks(points: &[(&str, DVec3, f64)]) -> Vec<PlaneLandmark> {
    let mark = |&(name, position_mm, within_mm): &(&str, DVec3, f64)| PlaneLandmark {
        name: name.to_owned(),
        position_mm,
        within_mm: Some(within_mm),
    };
    points.iter().map(mark).collect()
}

fn outlines(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

fn plane(name: &str, title: &str, source: &str, tolerances: Tolerances, views: Vec<View>) -> StandardPlane {
    StandardPlane { name: name.to_owned(), title: title.to_owned(), source: source.to_owned(), tolerances, views }
}

fn caliper(name: &str, title: &str, points_mm: Vec<DVec3>, surface: &str, reach_mm: f64) -> Caliper {
    let kind = if points_mm.len() == 2 { CaliperKind::Line } else { CaliperKind::Ellipse };
    Caliper {
        name: name.to_owned(),
        title: title.to_owned(),
        kind,
        points_mm,
        surface: surface.to_owned(),
        far_surface: None,
        reach_mm,
        true_mm: None,
    }
}

/// Axial plane at the thalami. The midline runs across the beam, the cavum septi pellucidi is in front, the cerebellum
/// not visible.
fn head(a: &Anatomy) -> StandardPlane {
    let (centre, biometry) = (a.landmarks.head_centre_mm.as_dvec3(), a.biometry);
    let semi = biometry.skull_semi_mm().as_dvec3();
    let inner = semi.x - f64::from(biometry.skull_thickness_mm);
    let (left, face) = (a.left * semi.x, a.face * semi.z);
    let mut view = view("", centre, a.face, a.near);
    view.outlines = outlines(&["skull", "subarachnoid_space", "ventricles", "falx_and_tentorium"]);
    let thalamus = a.left * 0.22 * semi.x;
    view.landmarks = marks(&[
        ("cavum septi pellucidi", a.landmarks.cavum_mm.as_dvec3(), 5.0),
        ("left thalamus", centre + thalamus, 6.0),
        ("right thalamus", centre - thalamus, 6.0),
    ]);
    let across = vec![centre + left, centre - a.left * inner];
    let ring = vec![centre + face, centre - face, centre + left, centre - left];
    view.calipers = vec![
        Caliper {
            far_surface: Some("subarachnoid_space".to_owned()),
            true_mm: Some(f64::from(biometry.biparietal_mm)),
            ..caliper("BPD", "biparietal diameter, outer to inner", across, "skull", 10.0)
        },
        caliper("HC", "head circumference", ring, "skull", 10.0),
    ];
    plane("head", "transthalamic plane of the head", BIOMETRY_GUIDE, tolerances(10.0, 5.0, Some(45.0)), vec![view])
}

/// Transcerebellar plane, through cavum septi pellucidi and cerebellum: the axial plane with its back tilted down.
fn cerebellum(a: &Anatomy) -> StandardPlane {
    let cavum = a.landmarks.cavum_mm.as_dvec3();
    let [left, right] = a.landmarks.cerebellum_mm.map(|v| v.as_dvec3());
    let centre = 0.5 * (left + right);
    let mut view = view("", 0.5 * (cavum + centre), cavum - centre, a.near);
    view.outlines = outlines(&["skull", "subarachnoid_space", "cerebellum", "ventricles"]);
    let half = a.left * (0.5 * left.distance(right));
    view.landmarks = marks(&[("cavum septi pellucidi", cavum, 5.0), ("cerebellum", centre, 6.0)]);
    let ends = vec![centre + half, centre - half];
    view.calipers = vec![caliper("TCD", "transcerebellar diameter", ends, "cerebellum", 7.0)];
    let title = "transcerebellar plane of the head";
    plane("cerebellum", title, BRAIN_GUIDE, tolerances(10.0, 4.0, Some(45.0)), vec![view])
}

/// Cross-section of the belly at the level of stomach and portal sinus, as round as possible.
fn abdomen(a: &Anatomy) -> StandardPlane {
    let radius = f64::from(a.biometry.abdominal_radius_mm());
    let centre = a.landmarks.abdomen_centre_mm.as_dvec3();
    let cranial = a.landmarks.abdomen_cranial.as_dvec3().normalize();
    let mut view = view("", centre, a.ventral, a.near.reject_from(cranial));
    view.outlines = outlines(&["fetal_skin", "stomach", "liver", "vertebrae", "kidneys"]);
    let (across, front) = (view.to_probe * radius, a.ventral * radius);
    view.landmarks =
        marks(&[("stomach", a.landmarks.stomach_mm.as_dvec3(), 6.0), ("spine", centre - 0.68 * front, 8.0)]);
    let ring = vec![centre + front, centre - front, centre + across, centre - across];
    view.calipers = vec![Caliper {
        true_mm: Some(f64::from(a.biometry.abdominal_circumference_mm)),
        ..caliper("AC", "abdominal circumference", ring, "fetal_skin", 8.0)
    }];
    plane("abdomen", "transverse plane of the abdomen (AC)", BIOMETRY_GUIDE, tolerances(10.0, 5.0, None), vec![view])
}

/// Plane along either femur: both ends of the ossified shaft in view, at most 45° from horizontal in the image.
fn femur(a: &Anatomy) -> StandardPlane {
    let femurs = [("left", a.landmarks.left_femur_mm), ("right", a.landmarks.right_femur_mm)];
    let views = femurs.map(|(name, tips)| {
        let [hip, knee] = tips.map(|v| v.as_dvec3());
        // A direction to the mother's front, +z, where her belly is.
        let mut view = view(name, 0.5 * (hip + knee), knee - hip, DVec3::Z);
        view.any_turn_about_lateral = true;
        view.outlines = outlines(&["fetal_skin", "long_bones"]);
        view.landmarks = marks(&[("proximal end", hip, 3.0), ("distal end", knee, 3.0)]);
        let line = caliper("FL", "femur length", vec![hip, knee], "long_bones", 4.0);
        view.calipers = vec![Caliper { true_mm: Some(f64::from(a.biometry.femur_mm)), ..line }];
        view
    });
    plane("femur", "long axis of a femur", BIOMETRY_GUIDE, tolerances(8.0, 3.0, Some(45.0)), views.into())
}

/// Cross-section of the chest with the heart's four chambers.
fn heart(a: &Anatomy) -> StandardPlane {
    let (centre, cranial) = (a.landmarks.heart_centre_mm.as_dvec3(), a.landmarks.heart_cranial.as_dvec3().normalize());
    let up = a.near.reject_from(cranial).normalize_or(a.near);
    let mut view = view("", centre, up.cross(cranial), up);
    view.outlines = outlines(&["fetal_skin", "heart", "heart_chambers", "ribs", "vertebrae"]);
    view.landmarks = marks(&[("heart", centre, 5.0)]);
    plane("heart", "four-chamber view of the heart", HEART_GUIDE, tolerances(12.0, 4.0, None), vec![view])
}

/// Midsagittal plane of the back, from a direction behind the fetus that a probe can reach.
fn spine(a: &Anatomy) -> StandardPlane {
    // A thoracic vertebra, the middle of the straight part, and a lumbar vertebra.
    let [chest, middle, lumbar] = [3, 4, 5].map(|i: usize| a.landmarks.spine_mm[i].as_dvec3());
    let lateral = (chest - lumbar).reject_from(a.left);
    let mut view = midsagittal(a, middle, lateral, -a.ventral);
    view.outlines = outlines(&["fetal_skin", "vertebrae"]);
    view.landmarks = marks(&[("thoracic spine", chest, 4.0), ("lumbar spine", lumbar, 4.0)]);
    plane("spine", "midsagittal plane of the spine", SURVEY_GUIDE, tolerances(8.0, 4.0, None), vec![view])
}

/// Midsagittal plane of the face, from a direction in front of it that a probe can reach.
fn profile(a: &Anatomy) -> StandardPlane {
    let [nose, chin] = [a.landmarks.nose_tip_mm, a.landmarks.chin_mm].map(|v| v.as_dvec3());
    let forehead = a.in_head(0.0, 8.0, 33.0);
    let mut view = midsagittal(a, 0.5 * (nose + forehead), a.vertex, a.face);
    view.outlines = outlines(&["fetal_skin", "skull", "face_and_skull_base"]);
    view.landmarks = marks(&[("forehead", forehead, 5.0), ("nose", nose, 5.0), ("chin", chin, 5.0)]);
    plane("profile", "midsagittal plane of the face", SURVEY_GUIDE, tolerances(8.0, 4.0, None), vec![view])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::phantom::{organs, skin};

    #[test]
    fn a_probe_on_the_skin_shows_every_view() {
        let planes = planes(&Parameters::default()).with_poses(&skin(&Parameters::default()), 2.5);
        assert_eq!(planes.planes.len(), 7);
        for plane in &planes.planes {
            for view in &plane.views {
                let pose = view.pose.unwrap();
                let local = pose.inverse();
                let centre = local.transform_point(view.centre_mm);
                let [least, greatest] = plane.tolerances.depth_mm;
                assert!(centre.x.abs() < 1e-6 && centre.y.abs() < 1e-6, "{}: {centre}", plane.name);
                assert!((least..greatest).contains(&centre.z), "{}: {} mm deep", plane.name, centre.z);
                let lateral = local.transform_vector(view.lateral);
                assert!(lateral.x > 0.9999 && local.transform_vector(view.normal).y.abs() > 0.9999);
                for landmark in &view.landmarks {
                    let off = local.transform_point(landmark.position_mm).y.abs();
                    let limit = 0.6 * landmark.within_mm.unwrap();
                    assert!(off <= limit, "{}: {} is {off} mm off the plane", plane.name, landmark.name);
                }
            }
        }
    }

    #[test]
    fn no_view_is_from_the_mothers_back_however_the_fetus_lies() {
        for roll_deg in [0.0, 90.0, -90.0, 180.0] {
            let parameters = Parameters { roll_deg, ..Parameters::default() };
            let planes = planes(&parameters).with_poses(&skin(&parameters), 2.5);
            let left = landmarks(&parameters).fetus_left.as_dvec3();
            for plane in planes.chosen(&["spine", "profile"]).unwrap() {
                let view = &plane.views[0];
                assert!(view.to_probe.z >= -0.25, "{}, roll {roll_deg}: from {}", plane.name, view.to_probe);
                assert!(view.normal.dot(left).abs() > 0.98, "{}, roll {roll_deg}: not midsagittal", plane.name);
                assert!(view.lateral.dot(view.to_probe).abs() < 1e-9, "{}, roll {roll_deg}", plane.name);
                assert!(view.pose.is_some(), "{}, roll {roll_deg}: out of reach", plane.name);
            }
        }
    }

    #[test]
    fn the_planes_match_their_file_and_the_phantom() {
        let planes = planes(&Parameters::default());
        let names: Vec<_> = organs(&Parameters::default()).iter().map(|organ| organ.name).collect();
        planes.check_surfaces(Path::new("t.planes.json"), &names).unwrap();
        let text = serde_json::to_string_pretty(&planes).unwrap();
        let back = StandardPlanes::from_json(&text, Path::new("t.planes.json")).unwrap();
        for (a, b) in planes.planes.iter().zip(&back.planes) {
            assert_eq!((&a.name, &a.tolerances, a.views.len()), (&b.name, &b.tolerances, b.views.len()));
            for (a, b) in a.views.iter().zip(&b.views) {
                assert!(a.normal.distance(b.normal) < 1e-9 && a.lateral.distance(b.lateral) < 1e-9);
                assert!(a.centre_mm.distance(b.centre_mm) < 1e-9);
                assert_eq!((a.calipers.len(), &a.landmarks.len()), (b.calipers.len(), &b.landmarks.len()));
            }
        }
    }
}
