//! A score as text tables.

use std::fmt;

use super::{CaliperScore, HOLD_S, NO_PLANE, PlaneScore, Score, TextScore};

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { found, points, duration_s, path_mm, mean_speed_mm_s, planes, calipers, .. } = self;
        let (contact, face_contact) = (100.0 * self.contact, 100.0 * self.face_contact);
        if let Some(why) = &self.not_judged {
            writeln!(f, "not judged: {why}")?;
        }
        if let Some(points) = points {
            write!(f, "{found} of {} planes found, {points:.0} of 100 points; ", planes.len())?;
        }
        writeln!(
            f,
            "{duration_s:.1} s, {path_mm:.0} mm of way at {mean_speed_mm_s:.0} mm/s, {contact:.0} % of the time on the skin, with {face_contact:.0} % of the face\n"
        )?;
        writeln!(
            f,
            "{:12} {:>9} {:>9} {:>8} {:>9} {:>9} {:>9} {:>9} {:>7}",
            "plane", "found at", "way", "held", "angle", "distance", "unsteady", "pressed", "points"
        )?;
        planes.iter().try_for_each(|plane| writeln!(f, "{}", plane_line(plane)))?;
        writeln!(
            f,
            "(angle, distance, steadiness and pressure in the best second; found: held within tolerance for {HOLD_S} s)"
        )?;
        let missed = || planes.iter().filter_map(|plane| Some((plane, plane.why_not.as_ref()?)));
        if self.not_judged.is_none() && missed().next().is_some() {
            writeln!(f, "\nwhy planes were not found:")?;
            missed().try_for_each(|(plane, why)| writeln!(f, "{:12} {why}", plane.name))?;
        }
        if planes.iter().any(|plane| !plane.measures.is_empty()) {
            writeln!(f, "\nwhat would be measured at the best moment:")?;
        }
        for (plane, m) in planes.iter().flat_map(|plane| plane.measures.iter().map(move |m| (plane, m))) {
            let line = measure_line(&m.name, m.measured_mm, m.true_mm, m.error_percent);
            writeln!(f, "{line}  {}: {}", plane.name, m.title)?;
        }
        if !calipers.is_empty() {
            writeln!(f, "\nwhat the session measured:")?;
        }
        calipers.iter().try_for_each(|c| writeln!(f, "{}", caliper_line(c)))?;
        if !self.texts.is_empty() {
            writeln!(f, "\nwhat the session wrote:")?;
        }
        self.texts.iter().try_for_each(|text| writeln!(f, "{}", text_line(text)))
    }
}

/// A measurement in the session as a line: value, true value, error, picture.
fn caliper_line(c: &CaliperScore) -> String {
    let name = if c.name.is_empty() { c.kind.name() } else { c.name.as_str() };
    let measured = match (c.measured_mm, c.angle_deg) {
        (Some(mm), _) => format!("{mm:.1} mm"),
        (None, angle_deg) => format!("{:.1}°", angle_deg.unwrap_or_default()),
    };
    let mut line = format!("{name:8} {measured:>10}");
    if let Some(area_mm2) = c.area_mm2 {
        line += &format!(", area {:.2} cm²", 0.01 * area_mm2);
    }
    if let (Some(true_mm), Some(error_mm), Some(percent)) = (c.true_mm, c.error_mm, c.error_percent) {
        line += &format!(", truly {true_mm:.1} mm: {error_mm:+.1} mm, {percent:+.1} %");
    }
    line += &picture(c.picture_s, c.plane.as_deref());
    if c.note.is_empty() { line } else { format!("{line}; {}", c.note) }
}

fn text_line(text: &TextScore) -> String {
    let written = match text.turn_deg {
        Some(turn_deg) => format!("body mark {}, probe turned by {turn_deg:.0}°", text.text),
        None => format!("\"{}\"", text.text),
    };
    written + &picture(text.picture_s, text.plane.as_deref())
}

/// Text that tells on which picture a mark is.
fn picture(picture_s: f64, plane: Option<&str>) -> String {
    match plane {
        Some(plane) => format!("; picture at {picture_s:.1} s, which shows the plane {plane}"),
        None => format!("; picture at {picture_s:.1} s: {NO_PLANE}"),
    }
}

fn plane_line(plane: &PlaneScore) -> String {
    let or_dash = |value: Option<f64>, unit: &str, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |v| format!("{v:.digits$}{unit}"))
    };
    let name = if plane.view.is_empty() { plane.name.clone() } else { format!("{} ({})", plane.name, plane.view) };
    // If no second could be judged, the plane has earned neither a "no" nor a 0.
    let judged = plane.best_s.map(|_| plane.points);
    let not_found = if judged.is_some() { "no" } else { "-" };
    format!(
        "{name:12} {:>9} {:>9} {:>8} {:>9} {:>9} {:>9} {:>9} {:>7}",
        plane.find_s.map_or_else(|| not_found.to_owned(), |s| format!("{s:.1} s")),
        or_dash(plane.path_to_find_mm, " mm", 0),
        or_dash(Some(plane.longest_hold_s), " s", 1),
        or_dash(plane.best.map(|b| b.angle_deg), "°", 1),
        or_dash(plane.best.map(|b| b.distance_mm), " mm", 1),
        or_dash(plane.unsteady_mm, " mm", 2),
        or_dash(plane.press_mm, " mm", 1),
        or_dash(judged, "", 0)
    )
}

fn measure_line(name: &str, measured_mm: Option<f64>, true_mm: Option<f64>, error_percent: Option<f64>) -> String {
    let mm = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.1} mm"));
    let error = error_percent.map_or_else(String::new, |e| format!("{e:+.1} %"));
    let measured = if measured_mm.is_some() { mm(measured_mm) } else { "not in view".to_owned() };
    format!("{name:6} {measured:>12}, truly {:>9}  {error:>8}", mm(true_mm))
}
