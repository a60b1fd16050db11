//! The acoustic windows: organ, usual direction to the probe, and plane of each.

use glam::DVec3;
use insonify_core::anatomy::planes::{
    Caliper, CaliperKind, PLANES_VERSION, PlaneLandmark, StandardPlane, StandardPlanes, Tolerances, View,
};
use insonify_core::anatomy::{Mesh, Skin};

use super::{ProbeSite, Sight, WindowRow, best_site};
use crate::segmentation::from_labels::Made;
use crate::segmentation::probe_choice::ProbeChoice;
use crate::segmentation::shape::Shape;

/// Patient directions.
const LEFT: DVec3 = DVec3::X;
const BACK: DVec3 = DVec3::Y;
const RIGHT: DVec3 = DVec3::NEG_X;
const FRONT: DVec3 = DVec3::NEG_Y;
const HEAD: DVec3 = DVec3::Z;
const FEET: DVec3 = DVec3::NEG_Z;

const ABDOMEN_GUIDE: &str = "AIUM Practice Parameter for the Performance of an Ultrasound Examination of the Abdomen \
                             and/or Retroperitoneum (2017)";
const LUNG_GUIDE: &str = "Volpicelli et al., International evidence-based recommendations for point-of-care lung \
                          ultrasound (2012)";
const TRAUMA_GUIDE: &str = "AIUM Practice Guideline for the Performance of the Focused Assessment With Sonography for \
                            Trauma (FAST) Examination (2014)";
const THYROID_GUIDE: &str = "AIUM Practice Parameter for the Performance of a Thyroid and Parathyroid Ultrasound \
                             Examination (2016)";
const HEART_GUIDE: &str = "ASE Guidelines for Performing a Comprehensive Transthoracic Echocardiographic Examination \
                           in Adults (2019)";

/// Organs of a patient by the names of their segments.
struct Organs<'a>(&'a [Made]);

impl<'a> Organs<'a> {
    /// Outer surface of the first of `names` that the patient has.
    fn of(&self, names: &[&str]) -> Option<&'a Made> {
        names
            .iter()
            .find_map(|name| self.0.iter().find(|s| s.segment.as_deref() == Some(name) && s.voxels_mm3.is_some()))
    }
}

/// A view whose probe is still to be placed. `radius_mm` is the radius of the target. `cone_deg` is the largest
/// accepted angle between the direction to the probe and the usual direction.
struct Wish {
    view: View,
    radius_mm: f64,
    cone_deg: f64,
    /// Other centres of the view, and directions to the probe. The best one is taken.
    others: Vec<(DVec3, DVec3)>,
}

impl Wish {
    fn new(view: View, radius_mm: f64, cone_deg: f64) -> Self {
        Self { view, radius_mm, cone_deg, others: Vec::new() }
    }
}

/// Windows of a patient, with poses, hidden shares and contact. A window without its organs, or without skin, is left out.
pub fn windows(surfaces: &[Made], sight: &Sight) -> (StandardPlanes, Vec<WindowRow>) {
    let organs = Organs(surfaces);
    let all: [fn(&Organs) -> Option<Window>; 14] = [
        liver,
        gallbladder,
        morison,
        right_kidney,
        right_kidney_across,
        left_kidney,
        spleen,
        aorta,
        aorta_across,
        bladder,
        heart,
        four_chambers,
        lung,
        thyroid,
    ];
    let made = all.map(|window| window(&organs));
    let (mut planes, mut rows) = (Vec::new(), Vec::new());
    for (mut plane, wish) in made.into_iter().flatten() {
        let Some((view, site)) = placed(wish, sight) else { continue };
        rows.push(WindowRow::new(&plane.name, &plane.title, view.centre_mm, &site));
        plane.views.push(view);
        planes.push(plane);
    }
    (StandardPlanes { version: PLANES_VERSION, planes }, rows)
}

/// A view of the segment `name`: through the segment's window if there is one, otherwise from the best direction at the
/// front or the sides. `None` if there is no such segment, or no skin from which it can be seen.
pub fn look_at(surfaces: &[Made], sight: &Sight, name: &str) -> Option<View> {
    let organs = Organs(surfaces);
    let window: Option<fn(&Organs) -> Option<Window>> = match name {
        "liver" => Some(liver),
        "gallbladder" => Some(gallbladder),
        "spleen" => Some(spleen),
        "thyroid_gland" => Some(thyroid),
        "kidney_right" => Some(right_kidney),
        "kidney_left" => Some(left_kidney),
        "aorta" => Some(aorta),
        "urinary_bladder" => Some(bladder),
        name if name.starts_with("heart") => Some(heart),
        name if lung_of(&organs).is_some_and(|lung| lung.segment.as_deref() == Some(name)) => Some(lung),
        _ => None,
    };
    let wish = window.and_then(|window| window(&organs)).map(|(_, wish)| wish).or_else(|| {
        let shape = Shape::of(&organs.of(&[name])?.mesh)?;
        let mut view = view("", shape.centre_mm, LEFT, FRONT);
        view.outlines = vec![organs.of(&[name])?.name.clone()];
        Some(Wish::new(view, 0.35 * shape.length_mm(), 100.0))
    })?;
    placed(wish, sight).map(|(view, _)| view)
}

/// The view with its probe at the best position.
fn placed(wish: Wish, sight: &Sight) -> Option<(View, ProbeSite)> {
    let Wish { view, radius_mm, cone_deg, others } = wish;
    let kind = view.outlines.first().and_then(|name| ProbeChoice::kind_of(name));
    let at = |(centre_mm, to_probe)| {
        let view = View { centre_mm, to_probe, ..view.clone() };
        best_site(sight, &view, kind, radius_mm, cone_deg).map(|(cost, site)| (cost, centre_mm, site))
    };
    let sites = std::iter::once((view.centre_mm, view.to_probe)).chain(others).filter_map(at);
    let (_, centre_mm, site) = sites.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let mut view = View { centre_mm, ..view };
    view.lateral = view.lateral.reject_from(site.to_probe).normalize_or(site.to_probe.any_orthonormal_vector());
    view.to_probe = site.to_probe;
    view.normal = view.to_probe.cross(view.lateral);
    view.pose = view.pose_on(sight.skin(), site.touch.press_mm);
    // A landmark too far from the plane is left out, since it would prevent the recognition of the plane.
    let (centre_mm, normal) = (view.centre_mm, view.normal);
    let off_mm = |mark: &PlaneLandmark| (mark.position_mm - centre_mm).dot(normal).abs();
    view.landmarks.retain(|mark| mark.within_mm.is_none_or(|within_mm| off_mm(mark) < 0.7 * within_mm));
    Some((view, site))
}

type Window = (StandardPlane, Wish);

fn plane(name: &str, title: &str, source: &str, angle_deg: f64, distance_mm: f64) -> StandardPlane {
    let tolerances = Tolerances {
        angle_deg,
        distance_mm,
        in_plane_deg: Some(45.0),
        centring_mm: 35.0,
        depth_mm: [15.0, 220.0],
        source: "assumed".to_owned(),
    };
    StandardPlane {
        name: name.to_owned(),
        title: title.to_owned(),
        source: source.to_owned(),
        tolerances,
        views: Vec::new(),
    }
}

fn view(name: &str, centre_mm: DVec3, lateral: DVec3, to_probe: DVec3) -> View {
    let to_probe = to_probe.normalize_or(FRONT);
    let lateral = lateral.reject_from(to_probe).normalize_or(to_probe.any_orthonormal_vector());
    View::new(name, centre_mm, lateral, to_probe)
}

fn mark(name: &str, position_mm: DVec3, within_mm: f64) -> PlaneLandmark {
    PlaneLandmark { name: name.to_owned(), position_mm, within_mm: Some(within_mm) }
}

fn caliper(name: &str, title: &str, points_mm: [DVec3; 2], surface: &str, reach_mm: f64) -> Caliper {
    Caliper {
        name: name.to_owned(),
        title: title.to_owned(),
        kind: CaliperKind::Line,
        points_mm: points_mm.into(),
        surface: surface.to_owned(),
        far_surface: None,
        reach_mm,
        true_mm: None,
    }
}

/// Length of the portal vein that gives the direction of the liver's plane, mm.
const PORTAL_MM: f64 = 35.0;

/// Oblique plane from below the right ribs up into the right lobe of the liver.
fn liver(organs: &Organs) -> Option<Window> {
    let liver = organs.of(&["liver"])?;
    let shape = Shape::of(&liver.mesh)?;
    // Through the portal vein where it lies deepest in the liver.
    let away_mm = |v: &glam::Vec3| v.as_dvec3().distance(shape.centre_mm);
    let portal = organs.of(&["portal_vein_and_splenic_vein", "portal_vein"]);
    let nearest = portal.and_then(|p| p.mesh.vertices_mm.iter().min_by(|a, b| away_mm(a).total_cmp(&away_mm(b))));
    let centre_mm = nearest.map_or(shape.centre_mm, |v| v.as_dvec3());
    // Along the portal vein: towards its farthest point nearby.
    let along = portal.map_or(LEFT, |portal| {
        let near = portal.mesh.vertices_mm.iter().map(|v| v.as_dvec3() - centre_mm).filter(|v| v.length() < PORTAL_MM);
        let far = near.max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(LEFT);
        far.normalize_or(LEFT) * if far.x < 0.0 { -1.0 } else { 1.0 }
    });
    let mut view = view("", centre_mm, along, FRONT + 0.8 * FEET);
    view.outlines = vec![liver.name.clone()];
    if let Some(gallbladder) = organs.of(&["gallbladder"]) {
        view.outlines.push(gallbladder.name.clone());
    }
    let plane = plane("liver", "subcostal view of the liver", ABDOMEN_GUIDE, 20.0, 20.0);
    Some((plane, Wish::new(view, 45.0, 45.0)))
}

/// Long axis of the gallbladder, from the front below the ribs.
fn gallbladder(organs: &Organs) -> Option<Window> {
    let gallbladder = organs.of(&["gallbladder"])?;
    let shape = Shape::of(&gallbladder.mesh)?;
    let mut view = view("", shape.centre_mm, shape.long_axis(FEET), FRONT + 0.3 * FEET);
    view.outlines = vec![gallbladder.name.clone()];
    let plane = plane("gallbladder", "gallbladder, long axis", ABDOMEN_GUIDE, 20.0, 8.0);
    Some((plane, Wish::new(view, 0.35 * shape.length_mm(), 50.0)))
}

/// Morison's pouch: from the right flank, along the body, through the border of liver and kidney.
fn morison(organs: &Organs) -> Option<Window> {
    let (kidney, liver) = (organs.of(&["kidney_right"])?, organs.of(&["liver"])?);
    let shape = Shape::of(&kidney.mesh)?;
    let (pouch_mm, gap_mm) = between(&kidney.mesh, &liver.mesh)?;
    let centre_mm = shape.centre_mm.lerp(pouch_mm, 0.6);
    let mut view = view("", centre_mm, shape.long_axis(FEET), RIGHT + 0.3 * FRONT);
    view.outlines = vec![liver.name.clone(), kidney.name.clone()];
    view.landmarks = vec![mark("Morison's pouch", pouch_mm, 15.0)];
    let plane = plane("morison", "Morison's pouch, between liver and right kidney", TRAUMA_GUIDE, 20.0, 12.0);
    (gap_mm < 40.0).then(|| (plane, Wish::new(view, 35.0, 45.0)))
}

/// Cross-section of the right kidney at its hilum, from the flank.
fn right_kidney_across(organs: &Organs) -> Option<Window> {
    let kidney = organs.of(&["kidney_right"])?;
    let Wish { mut view, .. } = kidney_wish(kidney, RIGHT, "RKL")?;
    (view.lateral, view.landmarks, view.calipers) = (view.to_probe.cross(view.lateral), Vec::new(), Vec::new());
    let plane = plane("right_kidney_across", "right kidney, transverse", ABDOMEN_GUIDE, 20.0, 10.0);
    Some((plane, Wish::new(view, 22.0, 50.0)))
}

/// Long axis of the spleen, from the left flank between the ribs.
fn spleen(organs: &Organs) -> Option<Window> {
    let spleen = organs.of(&["spleen"])?;
    let shape = Shape::of(&spleen.mesh)?;
    let mut view = view("", shape.centre_mm, shape.long_axis(FEET), LEFT + 0.3 * BACK);
    view.outlines = vec![spleen.name.clone()];
    let plane = plane("spleen", "spleen, long axis", ABDOMEN_GUIDE, 20.0, 12.0);
    Some((plane, Wish::new(view, 0.3 * shape.length_mm(), 50.0)))
}

/// Long axis of the right kidney, from the flank. If Morison's pouch, between kidney and liver, is near, the plane
/// is turned towards the pouch.
fn right_kidney(organs: &Organs) -> Option<Window> {
    let kidney = organs.of(&["kidney_right"])?;
    let mut wish = kidney_wish(kidney, RIGHT, "RKL")?;
    if let Some(liver) = organs.of(&["liver"]) {
        wish.view.outlines.push(liver.name.clone());
        let (pouch_mm, gap_mm) = between(&kidney.mesh, &liver.mesh)?;
        if gap_mm < 40.0 {
            // The plane is turned about the kidney's axis towards the pouch.
            let view = &mut wish.view;
            let aside = (pouch_mm - view.centre_mm).reject_from(view.lateral).normalize_or_zero();
            view.to_probe = (view.to_probe + 0.7 * aside).reject_from(view.lateral).normalize_or(view.to_probe);
            view.landmarks.push(mark("Morison's pouch", pouch_mm, 15.0));
        }
    }
    let plane = plane("right_kidney", "right kidney and Morison's pouch", ABDOMEN_GUIDE, 15.0, 10.0);
    Some((plane, wish))
}

/// Long axis of the left kidney, from the flank.
fn left_kidney(organs: &Organs) -> Option<Window> {
    let kidney = organs.of(&["kidney_left"])?;
    let mut wish = kidney_wish(kidney, LEFT, "LKL")?;
    if let Some(spleen) = organs.of(&["spleen"]) {
        wish.view.outlines.push(spleen.name.clone());
    }
    Some((plane("left_kidney", "left kidney", ABDOMEN_GUIDE, 15.0, 10.0), wish))
}

fn kidney_wish(kidney: &Made, side: DVec3, caliper_name: &str) -> Option<Wish> {
    let shape = Shape::of(&kidney.mesh)?;
    let axis = shape.long_axis(FEET);
    let mut view = view("", shape.centre_mm, axis, side + 0.35 * FRONT);
    view.outlines = vec![kidney.name.clone()];
    let [low, high] = shape.extent_mm[0];
    // The axis may point against `shape.axes[0]`, to which the extent refers.
    let poles = if axis == shape.axes[0] { [low, high] } else { [-high, -low] }.map(|x| shape.centre_mm + axis * x);
    view.landmarks = vec![mark("upper pole", poles[0], 12.0), mark("lower pole", poles[1], 12.0)];
    let line = caliper(caliper_name, "kidney length", poles, &kidney.name, 12.0);
    view.calipers = vec![Caliper { true_mm: Some(shape.length_mm()), ..line }];
    Some(Wish::new(view, 0.4 * shape.length_mm(), 50.0))
}

/// Long axis of the abdominal aorta, from the front.
fn aorta(organs: &Organs) -> Option<Window> {
    let aorta = organs.of(&["aorta"])?;
    // Level of the kidneys' centres, or else in the lower third of the aorta.
    let bounds = aorta.mesh.bounds_mm()?;
    let kidneys: Vec<Shape> =
        ["kidney_left", "kidney_right"].iter().filter_map(|&k| Shape::of(&organs.of(&[k])?.mesh)).collect();
    let level = match kidneys.len() {
        0 => f64::from(bounds.min.z) + 0.3 * f64::from(bounds.max.z - bounds.min.z),
        n => kidneys.iter().map(|k| k.centre_mm.z).sum::<f64>() / n as f64,
    };
    let [low, high] = [bounds.min.z, bounds.max.z].map(f64::from);
    let inset = 10.0_f64.min(0.5 * (high - low));
    let level = level.max(low + inset).min(high - inset);
    let at = |z: f64| {
        let near = aorta.mesh.vertices_mm.iter().filter(|v| (f64::from(v.z) - z).abs() < 6.0);
        let (sum, count) = near.fold((DVec3::ZERO, 0.0), |(sum, n), v| (sum + v.as_dvec3(), n + 1.0));
        (count > 2.0).then(|| sum / count)
    };
    let centre = at(level)?;
    let (above, below) = (at(level + 25.0).unwrap_or(centre), at(level - 25.0).unwrap_or(centre));
    let along = (below - above).normalize_or(FEET);
    let mut view = view("", centre, along, FRONT);
    view.outlines = vec![aorta.name.clone()];
    view.landmarks = vec![mark("aorta above", above, 8.0), mark("aorta below", below, 8.0)];
    let plane = plane("aorta", "abdominal aorta, long axis", ABDOMEN_GUIDE, 12.0, 8.0);
    Some((plane, Wish::new(view, 25.0, 35.0)))
}

/// Cross-section of the abdominal aorta, from the front.
fn aorta_across(organs: &Organs) -> Option<Window> {
    let (_, Wish { mut view, .. }) = aorta(organs)?;
    view.lateral = LEFT.reject_from(view.lateral).reject_from(view.to_probe).try_normalize()?;
    view.landmarks = Vec::new();
    let plane = plane("aorta_across", "abdominal aorta, transverse", ABDOMEN_GUIDE, 15.0, 15.0);
    Some((plane, Wish::new(view, 20.0, 35.0)))
}

/// Cross-section of the bladder, from above the symphysis.
fn bladder(organs: &Organs) -> Option<Window> {
    let bladder = organs.of(&["urinary_bladder"])?;
    let shape = Shape::of(&bladder.mesh)?;
    let mut view = view("", shape.centre_mm, LEFT, FRONT + 0.4 * HEAD);
    view.outlines = vec![bladder.name.clone()];
    if let Some(prostate) = organs.of(&["prostate", "uterus"]) {
        view.outlines.push(prostate.name.clone());
    }
    let plane = plane("bladder", "bladder, transverse", ABDOMEN_GUIDE, 20.0, 12.0);
    Some((plane, Wish::new(view, 0.3 * shape.length_mm(), 40.0)))
}

/// Parasternal long axis of the heart: from between the ribs to the left of the sternum, along the left heart's axis.
fn heart(organs: &Organs) -> Option<Window> {
    let heart = organs.of(&["heart", "heart_myocardium", "heart_ventricle_left"])?;
    let shape = Shape::of(&heart.mesh)?;
    let chamber = |names: &[&str]| Some(Shape::of(&organs.of(names)?.mesh)?.centre_mm);
    let base = chamber(&["heart_atrium_left", "atrial_appendage_left"]);
    let apex = chamber(&["heart_ventricle_left"]);
    // Without the left chambers, the axis from the right shoulder to the left hip is used.
    let axis = match (base, apex) {
        (Some(base), Some(apex)) => apex - base,
        _ => LEFT + 0.6 * FRONT + 0.8 * FEET,
    };
    let centre = match (base, apex) {
        (Some(base), Some(apex)) => 0.5 * (base + apex),
        _ => shape.centre_mm,
    };
    // The apex is on the left of the image, as the probe's lateral axis points to the heart's base.
    let mut view = view("", centre, -axis, FRONT + 0.3 * LEFT);
    view.outlines = vec![heart.name.clone()];
    if let Some(left) = organs.of(&["heart_ventricle_left"]).filter(|left| left.name != heart.name) {
        view.outlines.push(left.name.clone());
    }
    let plane = plane("heart", "parasternal long axis of the heart", HEART_GUIDE, 20.0, 12.0);
    Some((plane, Wish::new(view, 25.0, 40.0)))
}

/// Four chambers of the heart, from its apex.
fn four_chambers(organs: &Organs) -> Option<Window> {
    let centre = |name: &str| Some(Shape::of(&organs.of(&[name])?.mesh)?.centre_mm);
    let [left, right] = [centre("heart_ventricle_left")?, centre("heart_ventricle_right")?];
    let [left_atrium, right_atrium] = [centre("heart_atrium_left")?, centre("heart_atrium_right")?];
    let (ventricles, atria) = (0.5 * (left + right), 0.5 * (left_atrium + right_atrium));
    // The left ventricle is on the right of the image.
    let mut view = view("", 0.6 * ventricles + 0.4 * atria, left - right, ventricles - atria);
    view.outlines = vec![organs.of(&["heart_ventricle_left"])?.name.clone()];
    let plane = plane("four_chambers", "apical four chambers of the heart", HEART_GUIDE, 20.0, 12.0);
    Some((plane, Wish::new(view, 25.0, 35.0)))
}

/// Cross-section of the thyroid at its right lobe, from the front of the neck.
fn thyroid(organs: &Organs) -> Option<Window> {
    let thyroid = organs.of(&["thyroid_gland"])?;
    let shape = Shape::of(&thyroid.mesh)?;
    let lobe = thyroid.mesh.vertices_mm.iter().map(|v| v.as_dvec3()).filter(|v| v.x < shape.centre_mm.x);
    let (sum, count) = lobe.fold((DVec3::ZERO, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    let mut view = view("", sum / count, LEFT, FRONT);
    view.outlines = vec![thyroid.name.clone()];
    let plane = plane("thyroid", "thyroid, transverse", THYROID_GUIDE, 20.0, 10.0);
    Some((plane, Wish::new(view, 15.0, 30.0)))
}

/// Distance of the lung window's centre from the pleura, mm.
const PLEURA_MM: f64 = 4.0;
/// Distances from the lung's centre at which the window may lie, mm: to the side and along the body. Step along the body.
const BESIDE_MM: [f64; 5] = [-30.0, -15.0, 0.0, 15.0, 30.0];
const ALONG_MM: i32 = 60;
const ALONG_STEP_MM: usize = 3;
/// Radius of the patch of pleura to which the beam is perpendicular, mm.
const PATCH_MM: f64 = 10.0;

/// Lung, or lobe of a lung, at the front of the chest.
fn lung_of<'a>(organs: &Organs<'a>) -> Option<&'a Made> {
    organs.of(&["lung_upper_lobe_right", "lung_right", "lung_upper_lobe_left", "lung_left", "lung"])
}

/// Pleural line between the ribs: from the front, along the body, where the lung reaches the chest's wall. The probe is
/// slid between two ribs and turned until the middle of the beam is perpendicular to the pleura. Only then does its echo
/// return to the face again and again.
fn lung(organs: &Organs) -> Option<Window> {
    let lung = lung_of(organs)?;
    let shape = Shape::of(&lung.mesh)?;
    let pleura = Skin::of_triangles(lung.mesh.corners_mm()).ok()?;
    let at = |beside_mm: f64, along_mm: f64| {
        let pleura_mm = pleura.exit(shape.centre_mm + beside_mm * LEFT + along_mm * HEAD, FRONT)?;
        let normal = outward(&lung.mesh, pleura_mm, PATCH_MM)?;
        // In front of the pleura, so that the lung itself doesn't count as gas in between.
        Some((pleura_mm + PLEURA_MM * normal, normal))
    };
    let along = || (-ALONG_MM..=ALONG_MM).step_by(ALONG_STEP_MM).map(f64::from);
    let mut places = BESIDE_MM.into_iter().flat_map(|beside| along().filter_map(move |along| at(beside, along)));
    let (centre_mm, normal) = places.next()?;
    let mut view = view("", centre_mm, FEET, normal);
    view.outlines = vec![lung.name.clone()];
    let plane = plane("lung", "lung with pleural line", LUNG_GUIDE, 20.0, 20.0);
    Some((plane, Wish { others: places.collect(), ..Wish::new(view, 4.0, 0.0) }))
}

/// Mean outward normal of a surface's patch around a point.
fn outward(mesh: &Mesh, at_mm: DVec3, radius_mm: f64) -> Option<DVec3> {
    let normal = |[a, b, c]: [glam::Vec3; 3]| {
        let near = ((a + b + c).as_dvec3() / 3.0).distance_squared(at_mm) < radius_mm * radius_mm;
        near.then(|| (b - a).cross(c - a).as_dvec3())
    };
    mesh.corners_mm().filter_map(normal).sum::<DVec3>().try_normalize()
}

/// Midpoint of the shortest line between vertices of two meshes, and the line's length, mm. At most some thousand
/// vertices of each mesh are compared.
fn between(a: &Mesh, b: &Mesh) -> Option<(DVec3, f64)> {
    let some = |mesh: &Mesh| -> Vec<DVec3> {
        let step = mesh.vertices_mm.len() / 1500 + 1;
        mesh.vertices_mm.iter().step_by(step).map(|v| v.as_dvec3()).collect()
    };
    let (a, b) = (some(a), some(b));
    let pairs = a.iter().flat_map(|&p| b.iter().map(move |&q| (p.distance_squared(q), p, q)));
    let (squared, p, q) = pairs.min_by(|x, y| x.0.total_cmp(&y.0))?;
    Some((0.5 * (p + q), squared.sqrt()))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{cuboid, sphere};

    use super::*;

    fn made(name: &str, mesh: Mesh) -> Made {
        let (name, segment) = (name.to_owned(), Some(name.to_owned()));
        Made { name, tissue: "liver".to_owned(), priority: 100, mesh, segment, voxels_mm3: Some(1.0) }
    }

    fn ball(name: &str, at: [f32; 3], semi_mm: [f32; 3]) -> Made {
        let mut mesh = sphere(Vec3::ZERO, 1.0, 4);
        mesh.vertices_mm.iter_mut().for_each(|v| *v = *v * Vec3::from(semi_mm) + Vec3::from(at));
        made(name, mesh)
    }

    /// A body of 300 × 200 × 700 mm with organs as ellipsoids.
    fn patient() -> Vec<Made> {
        vec![
            made("skin", cuboid(Vec3::new(-150.0, -100.0, -350.0), Vec3::new(150.0, 100.0, 350.0))),
            ball("liver", [-70.0, 0.0, 40.0], [60.0, 60.0, 60.0]),
            ball("kidney_right", [-60.0, 50.0, -60.0], [25.0, 22.0, 55.0]),
            ball("gallbladder", [-40.0, -50.0, -30.0], [12.0, 12.0, 35.0]),
            ball("spleen", [90.0, 40.0, 40.0], [20.0, 30.0, 50.0]),
            ball("aorta", [10.0, 50.0, 0.0], [10.0, 10.0, 150.0]),
            ball("thyroid_gland", [0.0, -70.0, 300.0], [30.0, 8.0, 20.0]),
            ball("heart_ventricle_left", [40.0, -40.0, 150.0], [20.0, 20.0, 20.0]),
            ball("heart_ventricle_right", [10.0, -50.0, 145.0], [20.0, 15.0, 20.0]),
            ball("heart_atrium_left", [20.0, 0.0, 180.0], [18.0, 18.0, 18.0]),
            ball("heart_atrium_right", [-10.0, -10.0, 175.0], [18.0, 18.0, 18.0]),
        ]
    }

    fn view_of(planes: &StandardPlanes, name: &str) -> View {
        planes.planes.iter().find(|plane| plane.name == name).unwrap_or_else(|| panic!("{name}")).views[0].clone()
    }

    #[test]
    fn planes_pass_their_organs_as_sonographers_hold_the_probe() {
        let surfaces = patient();
        let sight = Sight::new(&surfaces, Vec::new(), |_| false).unwrap();
        let (planes, rows) = windows(&surfaces, &sight);
        assert!(rows.iter().all(|row| row.hidden == 0.0), "{rows:?}");
        let along = |name: &str, axis: DVec3| view_of(&planes, name).lateral.dot(axis).abs();
        for (name, axis) in [("gallbladder", HEAD), ("spleen", HEAD), ("right_kidney", HEAD), ("aorta", HEAD)] {
            assert!(along(name, axis) > 0.8, "{name}: {}", along(name, axis));
        }
        for (name, axis) in [("right_kidney_across", HEAD), ("aorta_across", HEAD), ("thyroid", HEAD)] {
            assert!(along(name, axis) < 0.3, "{name}: {}", along(name, axis));
        }
        assert!(view_of(&planes, "spleen").to_probe.x > 0.7 && view_of(&planes, "morison").to_probe.x < -0.7);
        assert!(view_of(&planes, "thyroid").centre_mm.x < -5.0, "the right lobe");
        let morison = view_of(&planes, "morison");
        assert_eq!(morison.landmarks.len(), 1);
        assert_eq!(morison.outlines, ["liver", "kidney_right"]);
    }

    #[test]
    fn the_beam_meets_the_pleura_perpendicularly_between_two_ribs() {
        // A lung whose front slants by 14°, and ribs in front of it.
        let mut surfaces = patient();
        let mut lung = ball("lung_upper_lobe_right", [-60.0, -10.0, 150.0], [50.0, 60.0, 90.0]);
        lung.mesh.vertices_mm.iter_mut().for_each(|v| v.y += 0.25 * (v.z - 150.0));
        let ribs = (0..8).map(|n| {
            let low = Vec3::new(-130.0, -92.0, 40.0 + 26.0 * n as f32);
            made("rib", cuboid(low, low + Vec3::new(130.0, 10.0, 10.0)))
        });
        surfaces.extend(ribs);
        surfaces.push(lung);
        let sight =
            Sight::new(&surfaces, Vec::new(), |made| ["rib", "lung_upper_lobe_right"].contains(&made.name.as_str()));
        let (planes, rows) = windows(&surfaces, sight.as_ref().unwrap());
        let view = view_of(&planes, "lung");
        let lung = Skin::of_triangles(surfaces.last().unwrap().mesh.corners_mm()).unwrap();
        let pleura_mm = lung.exit(view.centre_mm - 20.0 * view.to_probe, view.to_probe).unwrap();
        let normal = outward(&surfaces.last().unwrap().mesh, pleura_mm, 5.0).unwrap();
        let off_deg = normal.angle_between(view.to_probe).to_degrees();
        let row = rows.iter().find(|row| row.name == "lung").unwrap();
        assert!(off_deg < 2.0 && row.touching == 1.0 && row.hidden == 0.0, "{off_deg:.1}°, {row:?}");
        // Between the ribs, which begin every 26 mm and are 10 mm high.
        let at_ribs_mm = view.centre_mm + view.to_probe * (view.centre_mm.y + 87.0) / -view.to_probe.y;
        let above_mm = (at_ribs_mm.z - 40.0).rem_euclid(26.0);
        assert!((12.0..24.0).contains(&above_mm), "{above_mm}");
    }

    #[test]
    fn the_apical_plane_passes_four_chambers_with_the_left_ones_on_the_right_of_the_image() {
        let surfaces = patient();
        let sight = Sight::new(&surfaces, Vec::new(), |_| false).unwrap();
        let view = view_of(&windows(&surfaces, &sight).0, "four_chambers");
        let at = |name: &str| {
            let made = surfaces.iter().find(|made| made.name == name).unwrap();
            Shape::of(&made.mesh).unwrap().centre_mm - view.centre_mm
        };
        for name in ["heart_ventricle_left", "heart_ventricle_right", "heart_atrium_left", "heart_atrium_right"] {
            assert!(at(name).dot(view.normal).abs() < 12.0, "{name}: {}", at(name).dot(view.normal));
        }
        assert!(at("heart_ventricle_left").dot(view.lateral) > at("heart_ventricle_right").dot(view.lateral));
        assert!(at("heart_ventricle_left").dot(view.to_probe) > at("heart_atrium_left").dot(view.to_probe));
        let without = &surfaces[..10];
        let sight = Sight::new(without, Vec::new(), |_| false).unwrap();
        assert!(windows(without, &sight).0.planes.iter().all(|plane| plane.name != "four_chambers"));
    }
}
