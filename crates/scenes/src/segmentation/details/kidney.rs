//! Inside of a kidney: pyramids of the medulla around the sinus.
//!
//! The sinus is an ellipsoid that opens to the hilum. The pyramids are cones from the cortex to the sinus. They stand in
//! rows along the kidney, each row as wide as a beam is thick or wider, so that planes along the kidney show columns of
//! cortex between them.

use glam::DVec3;
use insonify_core::anatomy::{Mesh, Skin};

use super::field::{FAR_MM, Field, Inside, distance_mm, intersection_mm, surface};
use super::{Part, outer};
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
/// Parenchyma at the poles, and between sinus and front or back, relative to that opposite the hilum (assumed).
const POLES: f64 = 1.5;
const FRONT_BACK: f64 = 0.85;
/// Least half width of the sinus, relative to the kidney's.
const SINUS_MIN: f64 = 0.25;
/// Share of the parenchyma that surrounds the sinus everywhere but at the hilum, also in a bent kidney.
const AROUND: f64 = 0.7;
/// Rows of pyramids along the kidney: angle about the axis, degrees, from the side opposite the hilum towards the front, and
/// positions in steps of `SPACING` along the axis from the middle (assumed). With one pyramid at each pole there are 16;
/// textbooks tell of 8 to 18. A plane from the flank passes the second row.
const ROWS: [(f64, &[f64]); 4] =
    [(105.0, &STAGGERED), (45.0, &[-1.5, -0.5, 0.5, 1.5]), (-15.0, &STAGGERED), (-75.0, &[-1.5, -0.5, 0.5, 1.5])];
const STAGGERED: [f64; 3] = [-1.0, 0.0, 1.0];
/// Distance of the pyramids of a row relative to the kidney's length, and how much the axes converge towards the middle
/// (assumed).
const SPACING: f64 = 0.17;
const CONVERGING: f64 = 0.3;
/// Half widths of a pyramid's base, along the kidney and around it, relative to the distance of neighbouring axes (assumed).
/// Both are below 0.5, so columns of cortex stay between neighbours.
const BASES: [f64; 2] = [0.34, 0.4];
/// Half width of a pyramid's tip, relative to its base (assumed).
const TIP: f64 = 0.25;
/// Exponent of a cone's narrowing towards its tip: 1 for straight sides.
const BULGE: f64 = 1.3;
/// Length of a papilla in the sinus, mm.
const PAPILLA_MM: f64 = 1.5;
/// Cortex that closes the sinus at the hilum, mm.
const CLOSED_MM: f64 = 0.8;
/// Voxels for the surfaces, mm.
const VOXEL_MM: f64 = 0.9;
/// Step at which a pyramid's end is searched for, mm.
const STEP_MM: f64 = 0.25;

/// A kidney's sinus and pyramids.
struct Kidney {
    inside: Inside,
    /// Outer surface without the hilum.
    rind: Winding,
    /// Ratio to a kidney of usual thickness.
    scale: f64,
    /// Centre and half axes of the sinus: along the kidney, towards the hilum, and across both.
    sinus_centre_mm: DVec3,
    sinus_axes: [(DVec3, f64); 3],
    pyramids: Vec<Pyramid>,
}

/// A pyramid: a cone with an elliptic base.
struct Pyramid {
    /// Point of the kidney's surface above the base.
    from_mm: DVec3,
    inward: DVec3,
    /// Unit vectors and half widths of the base.
    base: [(DVec3, f64); 2],
    /// Distance of the tip from `from_mm`, mm.
    length_mm: f64,
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
        let half_mm = 0.5 * (shape.extent_mm[2][1] - shape.extent_mm[2][0]);
        let scale = half_mm / USUAL_MM;
        let is_hilum = |at_mm: DVec3| {
            let from = at_mm - centre_mm;
            let side = from.reject_from(axis);
            from.dot(axis).abs() < HILUM.0 * length_mm && side.dot(hilum) > HILUM.1.to_radians().cos() * side.length()
        };
        let middle = |t: &[glam::Vec3; 3]| (t[0] + t[1] + t[2]).as_dvec3() / 3.0;
        let rind = Winding::of(mesh.corners_mm().filter(|corners| !is_hilum(middle(corners))));
        let skin = Skin::of_triangles(mesh.corners_mm()).ok()?;
        let away_mm = |direction: DVec3| skin.exit(centre_mm, direction).map_or(0.0, |at| at.distance(centre_mm));
        let across = axis.cross(hilum);
        let front = if across.y < 0.0 { across } else { -across };
        let parenchyma_mm = PARENCHYMA_MM * scale;
        let half = |axis: DVec3, part: f64| {
            let whole_mm = 0.5 * (away_mm(axis) + away_mm(-axis));
            (axis, (whole_mm - part * parenchyma_mm).max(SINUS_MIN * whole_mm))
        };
        let (lateral_mm, medial_mm) = (away_mm(-hilum) - parenchyma_mm, away_mm(hilum));
        // From the parenchyma opposite the hilum to the surface at the hilum.
        let opening = (hilum, (0.5 * (lateral_mm + medial_mm)).max(SINUS_MIN * half_mm));
        let mut kidney = Self {
            inside: Inside::of([mesh]),
            rind,
            scale,
            sinus_centre_mm: centre_mm + 0.5 * (medial_mm - lateral_mm) * hilum,
            sinus_axes: [half(axis, POLES), opening, half(across, FRONT_BACK)],
            pyramids: Vec::new(),
        };
        let spacing_mm = SPACING * length_mm;
        let around_mm = (half_mm - CORTEX_MM * scale) * (ROWS[0].0 - ROWS[1].0).to_radians();
        let mut add = |along_mm: f64, out: DVec3, bases: [(DVec3, f64); 2]| {
            let core_mm = centre_mm + along_mm * axis;
            if let Some(from_mm) = skin.exit(core_mm, out) {
                let ends_mm = kidney.end_mm(from_mm, -out, from_mm.distance(core_mm));
                kidney.pyramids.push(Pyramid { from_mm, inward: -out, base: bases, length_mm: ends_mm + PAPILLA_MM });
            }
        };
        for (angle_deg, row) in ROWS {
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let side = front * sin - hilum * cos;
            for along_mm in row.iter().map(|steps| steps * spacing_mm) {
                let out = (half_mm * side + CONVERGING * along_mm * axis).normalize();
                let around = axis.cross(side);
                let bases = [(out.cross(around), BASES[0] * spacing_mm), (around, BASES[1] * around_mm)];
                add((1.0 - CONVERGING) * along_mm, out, bases);
            }
        }
        for pole in [axis, -axis] {
            add(0.0, pole, [hilum, across].map(|side| (side, BASES[0] * spacing_mm)));
        }
        Some(kidney)
    }

    /// Distance from a point of the surface to the sinus in a direction, mm, at most `most_mm`.
    fn end_mm(&self, from_mm: DVec3, inward: DVec3, most_mm: f64) -> f64 {
        let mut mm = CORTEX_MM * self.scale;
        while mm < most_mm && self.sinus_ellipsoid_mm(from_mm + mm * inward) < 0.0 {
            mm += STEP_MM;
        }
        mm
    }

    /// Depth in the sinus' ellipsoid, mm, or less.
    fn sinus_ellipsoid_mm(&self, at_mm: DVec3) -> f64 {
        let from = at_mm - self.sinus_centre_mm;
        let parts = self.sinus_axes.map(|(axis, half_mm)| from.dot(axis) / half_mm);
        let least_mm = self.sinus_axes.iter().map(|(_, half_mm)| *half_mm).fold(f64::INFINITY, f64::min);
        least_mm * (1.0 - DVec3::from(parts).length())
    }

    fn sinus_mm(&self, at_mm: DVec3) -> f64 {
        intersection_mm(self.sinus_ellipsoid_mm(at_mm), || {
            let around_mm = AROUND * PARENCHYMA_MM * self.scale;
            let depth_mm = distance_mm(&self.rind, at_mm, around_mm + FAR_MM) - around_mm;
            intersection_mm(depth_mm, || self.inside.depth_mm(at_mm) - CLOSED_MM)
        })
    }

    fn pyramid_mm(&self, at_mm: DVec3) -> f64 {
        let cortex_mm = CORTEX_MM * self.scale;
        let cones = self.pyramids.iter().map(|pyramid| pyramid.cone_mm(at_mm, cortex_mm));
        intersection_mm(cones.fold(f64::NEG_INFINITY, f64::max), || {
            let depth_mm = distance_mm(&self.rind, at_mm, cortex_mm + FAR_MM) - cortex_mm;
            intersection_mm(depth_mm, || self.inside.depth_mm(at_mm) - CLOSED_MM)
        })
    }
}

impl Pyramid {
    /// Depth in the cone, mm, or less. Its sides bulge a little: the base is as wide as the cone for some way.
    fn cone_mm(&self, at_mm: DVec3, cortex_mm: f64) -> f64 {
        let from = at_mm - self.from_mm;
        let along_mm = from.dot(self.inward);
        let share = ((along_mm - cortex_mm) / (self.length_mm - cortex_mm).max(1.0)).clamp(0.0, 1.0);
        let [a, b] = self.base.map(|(side, half_mm)| from.dot(side) / half_mm);
        let narrow_mm = self.base[0].1.min(self.base[1].1);
        let side_mm = narrow_mm * (1.0 - (1.0 - TIP) * share.powf(BULGE) - a.hypot(b));
        // Less than the distance, since the width changes along the cone, too.
        (0.75 * side_mm).min(self.length_mm - along_mm)
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
            let opposite = |v: &Vec3, medial: f64| {
                let side = DVec3::new(f64::from(v.x) * medial, f64::from(v.y), 0.0).normalize();
                side.dot(DVec3::new(-1.0, FORWARD, 0.0).normalize()) > 0.97 && v.z.abs() < 8.0
            };
            assert!((depths(&sinus.mesh, opposite) - PARENCHYMA_MM).abs() < 1.0, "{}", depths(&sinus.mesh, opposite));
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
    fn columns_of_cortex_part_the_pyramids_in_planes_along_the_kidney() {
        let pyramids = Inside::of([&parts(&[kidney("kidney_right")])[1].mesh]);
        let hilum = DVec3::new(1.0, -FORWARD, 0.0).normalize();
        for (angle_deg, row) in ROWS {
            // Along the middle of the row, in the outer half of the medulla.
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let side = hilum.cross(DVec3::Z) * sin - hilum * cos;
            let at = |z: f64| side * 14.0 * (1.0 - (z / 55.0).powi(2)).sqrt() + DVec3::Z * z;
            let is_in: Vec<bool> = (-160..=160).map(|n| pyramids.depth_mm(at(0.25 * f64::from(n))) > 0.0).collect();
            let runs: Vec<&[bool]> = is_in.chunk_by(|a, b| a == b).collect();
            assert_eq!(runs.iter().filter(|run| run[0]).count(), row.len(), "{angle_deg}");
            let columns = runs[1..runs.len() - 1].iter().filter(|run| !run[0]);
            let narrowest_mm = columns.map(|run| 0.25 * run.len() as f64).fold(f64::INFINITY, f64::min);
            assert!(narrowest_mm > 3.5, "{angle_deg}: {narrowest_mm}");
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
