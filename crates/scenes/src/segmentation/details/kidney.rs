//! Inside of a kidney: pyramids of the medulla around the sinus.
//!
//! A point's depth is its distance from the kidney's outer surface without the hilum, where the sinus opens. The cortex
//! is outermost, then pyramids with columns of cortex between them, then the sinus.

use glam::DVec3;
use insonify_core::anatomy::Mesh;

use super::field::{FAR_MM, Field, Inside, distance_mm, intersection_mm, surface};
use super::{Part, outer, spread};
use crate::segmentation::from_labels::Made;
use crate::segmentation::meshing::winding::Winding;
use crate::segmentation::shape::{Shape, pieces_mm3};

/// Segments that are kidneys, each with the direction to the body's middle.
const KIDNEYS: [(&str, DVec3); 2] = [("kidney_right", DVec3::X), ("kidney_left", DVec3::NEG_X)];
/// Direction of the hilum: towards the middle, and forward by this share.
const FORWARD: f64 = 0.5;
/// Half the length of the hilum, relative to the kidney's length, and its half angle about the long axis, degrees.
const HILUM: (f64, f64) = (0.3, 52.0);
/// Thickness of cortex and parenchyma, mm, in a kidney of usual thickness (Glodny et al., BMC Urology 2009).
const CORTEX_MM: f64 = 6.6;
const PARENCHYMA_MM: f64 = 15.4;
/// Half the thickness of such a kidney, mm.
const USUAL_MM: f64 = 22.0;
/// Share of the parenchyma that is missing at the hilum's lips.
const LIPS: f64 = 0.35;
/// Distance of the pyramids' axes on the surface, relative to the kidney's length. Radius of their base and tip, relative
/// to that distance: the axes converge, and columns of cortex stay between them.
const SPACING: f64 = 0.17;
const RADII: [f64; 2] = [0.29, 0.09];
/// Length of a papilla in the sinus, mm.
const PAPILLA_MM: f64 = 1.5;
/// Cortex that closes the sinus at the hilum, mm.
const CLOSED_MM: f64 = 0.8;
/// Voxels for the surfaces, mm.
const VOXEL_MM: f64 = 0.9;

/// A kidney's axes, depth and pyramids.
struct Kidney {
    inside: Inside,
    /// Outer surface without the hilum.
    rind: Winding,
    centre_mm: DVec3,
    hilum: DVec3,
    half_width_mm: f64,
    /// Ratio to a kidney of usual thickness.
    scale: f64,
    base_mm: f64,
    /// Axis of each pyramid: a point of the surface, and the direction inward.
    axes: Vec<(DVec3, DVec3)>,
}

/// Pyramids and sinus of each kidney.
pub(super) fn parts(surfaces: &[Made]) -> Vec<Part> {
    let mut parts = Vec::new();
    for (name, medial) in KIDNEYS {
        let Some(mesh) = outer(surfaces, name).map(|made| without_cavities(&made.mesh)) else { continue };
        let Some((kidney, bounds)) = Kidney::of(&mesh, medial).zip(mesh.bounds_mm()) else { continue };
        let mut add = |part: &str, tissue: &str, above, mesh: Mesh| {
            let within = Some(name.to_owned());
            parts.push(Part { name: format!("{name}_{part}"), tissue: tissue.to_owned(), within, above, mesh });
        };
        add("sinus", "renal_sinus", 0, surface(&|at| kidney.sinus_mm(at), bounds, VOXEL_MM));
        add("pyramids", "renal_medulla", 1, surface(&|at| kidney.pyramid_mm(at), bounds, VOXEL_MM));
    }
    parts
}

/// The surface without the walls of cavities, in which cysts and tumours lie.
fn without_cavities(mesh: &Mesh) -> Mesh {
    let (piece_of, volumes) = pieces_mm3(mesh);
    let mut kept = Mesh::default();
    let mut number_of = vec![u32::MAX; mesh.vertices_mm.len()];
    for (triangle, _) in mesh.triangles.iter().zip(&piece_of).filter(|(_, piece)| volumes[**piece as usize] > 0.0) {
        kept.triangles.push(triangle.map(|v| {
            let number = &mut number_of[v as usize];
            if *number == u32::MAX {
                *number = kept.vertices_mm.len() as u32;
                kept.vertices_mm.push(mesh.vertices_mm[v as usize]);
            }
            *number
        }));
    }
    kept
}

impl Kidney {
    fn of(mesh: &Mesh, medial: DVec3) -> Option<Self> {
        let shape = Shape::of(mesh)?;
        let (axis, centre_mm) = (shape.axes[0], shape.centre_mm);
        let hilum = (medial + FORWARD * DVec3::NEG_Y).reject_from(axis).try_normalize()?;
        let length_mm = shape.length_mm();
        let across = shape.extent_mm[2];
        let half_mm = 0.5 * (across[1] - across[0]);
        let is_hilum = |at_mm: DVec3| {
            let from = at_mm - centre_mm;
            let side = from.reject_from(axis);
            from.dot(axis).abs() < HILUM.0 * length_mm && side.dot(hilum) > HILUM.1.to_radians().cos() * side.length()
        };
        let middle = |t: &[glam::Vec3; 3]| (t[0] + t[1] + t[2]).as_dvec3() / 3.0;
        let rind = Winding::of(mesh.corners_mm().filter(|corners| !is_hilum(middle(corners))));
        // Half of the long axis that lies within the sinus.
        let core_mm = (0.5 * length_mm - half_mm).max(0.0);
        let inward = |at_mm: DVec3| {
            let along = (at_mm - centre_mm).dot(axis).clamp(-core_mm, core_mm);
            (centre_mm + along * axis - at_mm).normalize_or_zero()
        };
        let outside = mesh.vertices_mm.iter().map(|v| v.as_dvec3()).filter(|&v| !is_hilum(v));
        let seeds = spread(&outside.collect::<Vec<_>>(), SPACING * length_mm);
        let half_width_mm = mesh.vertices_mm.iter().map(|v| (v.as_dvec3() - centre_mm).dot(hilum)).fold(0.0, f64::max);
        Some(Self {
            inside: Inside::of([mesh]),
            rind,
            centre_mm,
            hilum,
            half_width_mm: half_width_mm.max(1.0),
            scale: half_mm / USUAL_MM,
            base_mm: RADII[0] * SPACING * length_mm,
            axes: seeds.into_iter().map(|at| (at, inward(at))).collect(),
        })
    }

    /// Thickness of the parenchyma at a point, mm: less towards the hilum.
    fn parenchyma_mm(&self, at_mm: DVec3) -> f64 {
        let share = ((at_mm - self.centre_mm).dot(self.hilum) / self.half_width_mm).clamp(0.0, 1.0);
        PARENCHYMA_MM * self.scale * (1.0 - LIPS * share)
    }

    fn sinus_mm(&self, at_mm: DVec3) -> f64 {
        let end_mm = self.parenchyma_mm(at_mm);
        let depth_mm = distance_mm(&self.rind, at_mm, end_mm + FAR_MM);
        intersection_mm(depth_mm - end_mm, || self.inside.depth_mm(at_mm) - CLOSED_MM)
    }

    fn pyramid_mm(&self, at_mm: DVec3) -> f64 {
        let (cortex_mm, end_mm) = (CORTEX_MM * self.scale, self.parenchyma_mm(at_mm));
        let away_mm = self.axes.iter().map(|&(from, along)| (at_mm - from).reject_from(along).length());
        let away_mm = away_mm.fold(f64::INFINITY, f64::min);
        if away_mm > self.base_mm {
            return self.base_mm - away_mm;
        }
        let depth_mm = distance_mm(&self.rind, at_mm, end_mm + PAPILLA_MM + FAR_MM);
        let layer_mm = (depth_mm - cortex_mm).min(end_mm + PAPILLA_MM - depth_mm);
        let share = ((depth_mm - cortex_mm) / (end_mm - cortex_mm).max(1.0)).clamp(0.0, 1.0);
        let radius_mm = self.base_mm * (1.0 - share * (1.0 - RADII[1] / RADII[0]));
        // Less than the distance, since the radius changes with the depth, too.
        let cone_mm = 0.75 * (radius_mm - away_mm);
        intersection_mm(layer_mm.min(cone_mm), || self.inside.depth_mm(at_mm) - CLOSED_MM)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::sphere;

    use super::*;
    use crate::segmentation::details::tests::organ;

    /// A kidney of 110 × 50 × 44 mm about the origin, its long axis along z.
    fn kidney(name: &str) -> Made {
        let mut mesh = sphere(Vec3::ZERO, 1.0, 5);
        mesh.vertices_mm.iter_mut().for_each(|v| *v *= Vec3::new(25.0, 22.0, 55.0));
        organ(name, "renal_cortex", mesh)
    }

    #[test]
    fn the_cortex_has_its_published_thickness_and_the_sinus_opens_to_the_middle() {
        for (name, medial) in [("kidney_right", 1.0), ("kidney_left", -1.0)] {
            let made = kidney(name);
            let whole = Inside::of([&made.mesh]);
            let parts = parts(std::slice::from_ref(&made));
            let [sinus, pyramids] = &parts[..] else { panic!("{parts:?}") };
            assert!(sinus.name.ends_with("sinus") && pyramids.above > sinus.above);
            let depths = |mesh: &Mesh, of: fn(&Vec3, f64) -> bool| {
                let vertices = mesh.vertices_mm.iter().filter(|v| of(v, medial));
                vertices.map(|v| whole.distance_mm(v.as_dvec3(), 40.0)).fold(f64::INFINITY, f64::min)
            };
            // On the side away from the middle.
            let lateral = |v: &Vec3, medial: f64| f64::from(v.x) * medial < -5.0;
            assert!((depths(&pyramids.mesh, lateral) - CORTEX_MM).abs() < 0.7, "{}", depths(&pyramids.mesh, lateral));
            assert!((depths(&sinus.mesh, lateral) - PARENCHYMA_MM).abs() < 0.5, "{}", depths(&sinus.mesh, lateral));
            // At the hilum the sinus reaches the surface nearly.
            assert!(depths(&sinus.mesh, |_, _| true) < 1.2, "{}", depths(&sinus.mesh, |_, _| true));
            let share = |mesh: &Mesh| mesh.signed_volume_mm3() / made.mesh.signed_volume_mm3();
            assert!((0.05..0.3).contains(&share(&sinus.mesh)), "{}", share(&sinus.mesh));
            assert!((0.08..0.35).contains(&share(&pyramids.mesh)), "{}", share(&pyramids.mesh));
            for part in &parts {
                assert_eq!(part.mesh.unpaired_edges(), 0, "{}", part.name);
            }
        }
    }

    #[test]
    fn a_kidney_has_as_many_pyramids_as_textbooks_tell() {
        let made = kidney("kidney_left");
        let (_, count) = parts(&[made])[1].mesh.pieces();
        assert!((8..=18).contains(&count), "{count}");
        assert!(parts(&[kidney("kidney")]).is_empty());
        // A cyst within changes nothing.
        let mut with_cyst = kidney("kidney_left");
        let mut cyst = sphere(Vec3::new(5.0, 0.0, 30.0), 6.0, 3);
        cyst.flip();
        let first = with_cyst.mesh.vertices_mm.len() as u32;
        with_cyst.mesh.vertices_mm.extend(cyst.vertices_mm);
        with_cyst.mesh.triangles.extend(cyst.triangles.iter().map(|t| t.map(|v| v + first)));
        let [plain, cystic] = [kidney("kidney_left"), with_cyst].map(|made| parts(&[made])[1].mesh.signed_volume_mm3());
        assert!((cystic / plain - 1.0).abs() < 0.01, "{cystic} {plain}");
    }
}
