//! The image at the best moment, next to the image of the standard plane.

use std::fmt::Write;

use glam::DVec2;

use crate::anatomy::planes::{CaliperKind, StandardPlane, View};
use crate::anatomy::section::Section;
use crate::exam::measure::{Measured, measure};
use crate::exam::score::{PlaneScore, Reference, slice_mm};
use crate::pose::Pose;
use crate::report::html::{escape, points};
use crate::report::scene_view::border_mm;
use crate::transducer::{Probe, ProbeKind, Sector};

/// Depth to which the face presses the skin in the standard view, mm.
const PRESS_MM: f64 = 2.5;

/// Outlines of the view's surfaces, as markup: at the best moment, and in the standard plane.
pub(super) fn pair(plane: &StandardPlane, result: &PlaneScore, reference: &Reference<'_>) -> String {
    let (Some(pose), Some(view)) = (&result.best_pose, plane.views.get(result.view_index)) else {
        return String::new();
    };
    let measured: Vec<_> = result.measures.iter().map(|m| m.measured.clone()).collect();
    let probe = result.best_probe.unwrap_or(*reference.probe);
    let mut out = "<div class=\"row\">".to_owned();
    out.push_str(&figure("At the best moment", view, pose, &measured, &probe, reference));
    let perfect = reference.skin.and_then(|skin| view.pose_on(skin, PRESS_MM));
    if let Some(perfect) = perfect {
        let depth_mm = perfect.position_mm.distance(view.centre_mm);
        let slice = slice_mm(reference.probe, depth_mm);
        let cut = |c: &crate::anatomy::planes::Caliper| {
            let far = c.far_surface.as_ref().and_then(|name| reference.surfaces.get(name));
            measure(c, reference.surfaces.get(&c.surface)?, far, &perfect, slice)
        };
        let measured: Vec<_> = view.calipers.iter().map(cut).collect();
        out.push_str(&figure("The standard plane", view, &perfect, &measured, reference.probe, reference));
    }
    out + "</div>\n"
}

fn figure(
    caption: &str,
    view: &View,
    pose: &Pose,
    measured: &[Option<Measured>],
    probe: &Probe,
    reference: &Reference<'_>,
) -> String {
    let sector = Sector::fit(probe, 400, 300);
    let size = DVec2::new(f64::from(sector.width), f64::from(sector.height)) * sector.pixel_mm;
    let corner = sector.corner_mm;
    let mut out = format!(
        "<figure><svg viewBox=\"{:.1} {:.1} {:.1} {:.1}\"><polygon class=\"sector\" points=\"{}\"/>",
        corner.x,
        corner.y,
        size.x,
        size.y,
        points(outline(probe).into_iter().map(Into::into))
    );
    let is_measured =
        |name: &str| view.calipers.iter().any(|c| c.surface == name || c.far_surface.as_deref() == Some(name));
    let mut names: Vec<&str> = view.outlines.iter().map(String::as_str).collect();
    let calipers =
        view.calipers.iter().flat_map(|c| std::iter::once(c.surface.as_str()).chain(c.far_surface.as_deref()));
    for name in calipers {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    for name in names {
        let Some(mesh) = reference.surfaces.get(name) else { continue };
        let class = if is_measured(name) { "surface measured" } else { "surface" };
        let _ = write!(
            out,
            "<path class=\"line {class}\" d=\"{}\"><title>{}</title></path>",
            path(&Section::of(mesh, pose, 0.0), probe),
            escape(name)
        );
    }
    for (caliper, measured) in view.calipers.iter().zip(measured) {
        let Some(measured) = measured else { continue };
        let tag = if caliper.kind == CaliperKind::Line { "polyline" } else { "polygon" };
        let _ = write!(
            out,
            "<{tag} class=\"line caliper\" points=\"{}\"/>",
            points(measured.points_mm.iter().map(|&p| p.into()))
        );
    }
    let probe_from_scene = pose.inverse();
    for landmark in &view.landmarks {
        let p = probe_from_scene.transform_point(landmark.position_mm);
        let _ = write!(
            out,
            "<circle class=\"mark\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.2\"><title>{}, {:.1} mm off the image</title></circle>",
            p.x,
            p.z,
            escape(&landmark.name),
            p.y.abs()
        );
    }
    let names: Vec<_> = view
        .calipers
        .iter()
        .zip(measured)
        .filter_map(|(caliper, measured)| {
            Some(format!("{} {:.1} mm", escape(&caliper.name), measured.as_ref()?.length_mm))
        })
        .collect();
    let names = if names.is_empty() { String::new() } else { format!(": {}", names.join(", ")) };
    let _ = write!(out, "</svg><figcaption>{caption}{names}</figcaption></figure>");
    out
}

/// Border of the sector: (x, z) in the probe frame, mm.
fn outline(probe: &Probe) -> Vec<DVec2> {
    let steps = if matches!(probe.kind, ProbeKind::Linear { .. }) { 1 } else { 40 };
    border_mm(probe, steps).map(|p| DVec2::new(p.x, p.z)).collect()
}

/// Segments of the section that touch the sector, as an SVG path.
fn path(section: &Section, probe: &Probe) -> String {
    let mut out = String::new();
    for [a, b] in &section.segments_mm {
        if Sector::polar(probe, *a).is_some() || Sector::polar(probe, *b).is_some() {
            let _ = write!(out, "M{:.1} {:.1}L{:.1} {:.1}", a.x, a.y, b.x, b.y);
        }
    }
    out
}
