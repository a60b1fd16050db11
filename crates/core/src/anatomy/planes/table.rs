//! Standard planes as a text table.

use std::fmt;

use super::{Caliper, PlaneLandmark, StandardPlane, StandardPlanes, Tolerances};

impl fmt::Display for StandardPlanes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:12} {:6} {:>7} {:>9} {:>9}  measured", "plane", "view", "angle", "distance", "depth")?;
        for (plane, view) in self.planes.iter().flat_map(|plane| plane.views.iter().map(move |view| (plane, view))) {
            let depth_mm = view.pose.map(|pose| pose.position_mm.distance(view.centre_mm));
            let depth = depth_mm.map_or_else(|| "no skin".to_owned(), |mm| format!("{mm:.0} mm"));
            let caliper = |c: &Caliper| c.true_mm.map_or_else(|| c.name.clone(), |mm| format!("{} {mm:.1} mm", c.name));
            let calipers = view.calipers.iter().map(caliper).collect::<Vec<_>>().join(", ");
            let (angle_deg, distance_mm) = (plane.tolerances.angle_deg, plane.tolerances.distance_mm);
            let (plane, view) = (&plane.name, &view.name);
            writeln!(f, "{plane:12} {view:6} {angle_deg:>5.0}° {distance_mm:>6.0} mm {depth:>9}  {calipers}")?;
        }
        writeln!(f)?;
        self.planes.iter().try_for_each(|p| writeln!(f, "{:12} {} ({})", p.name, p.title, p.source))?;
        writeln!(f, "\nall that counts, at most, of each view:")?;
        self.planes.iter().try_for_each(|plane| tolerances(f, plane))
    }
}

/// Writes all tolerances of a plane, and the landmarks that the image must show.
fn tolerances(f: &mut fmt::Formatter<'_>, plane: &StandardPlane) -> fmt::Result {
    let Tolerances { angle_deg, distance_mm, in_plane_deg, centring_mm, depth_mm: [least, greatest], source } =
        &plane.tolerances;
    write!(f, "{:12} tilt {angle_deg}°, {distance_mm} mm beside the plane, ", plane.name)?;
    match in_plane_deg {
        Some(deg) => write!(f, "turned in the picture by {deg}°, ")?,
        None => write!(f, "turned in the picture by any angle, ")?,
    }
    writeln!(f, "centre {centring_mm} mm off the middle line and {least} to {greatest} mm below the face")?;
    for view in plane.views.iter().filter(|view| !view.landmarks.is_empty()) {
        let landmark = |mark: &PlaneLandmark| match mark.within_mm {
            Some(within_mm) => format!("{} (within {within_mm} mm of the plane)", mark.name),
            None => mark.name.clone(),
        };
        let landmarks = view.landmarks.iter().map(landmark).collect::<Vec<_>>().join(", ");
        let name = if view.name.is_empty() { String::new() } else { format!("{}: ", view.name) };
        writeln!(f, "{:12} {name}in the picture: {landmarks}", "")?;
    }
    if source.is_empty() { Ok(()) } else { writeln!(f, "{:12} {source}", "") }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn all_tolerances_are_listed() {
        let planes = serde_json::json!({ "version": 1, "planes": [{
            "name": "middle", "title": "middle of the block",
            "tolerances": {
                "angle_deg": 10, "distance_mm": 5, "in_plane_deg": 30, "centring_mm": 25, "depth_mm": [20, 60],
                "source": "assumed for a test"
            },
            "views": [{
                "centre_mm": [0, 0, 50], "normal": [0, 1, 0], "lateral": [1, 0, 0], "to_probe": [0, 0, -1],
                "landmarks": [{ "name": "vessel", "position_mm": [0, 0, 50], "within_mm": 3 }]
            }]
        }]});
        let text = StandardPlanes::from_json(&planes.to_string(), Path::new("t.planes.json")).unwrap().to_string();
        for part in [
            "middle       tilt 10°, 5 mm beside the plane, turned in the picture by 30°, centre 25 mm off",
            "20 to 60 mm below the face",
            "in the picture: vessel (within 3 mm of the plane)",
            "assumed for a test",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
