//! Standard planes as a text table.

use std::fmt;

use super::{Caliper, StandardPlanes};

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
        self.planes.iter().try_for_each(|p| writeln!(f, "{:12} {} ({})", p.name, p.title, p.source))
    }
}
