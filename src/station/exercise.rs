//! `[exercise]`: what a trainee does with the needle.

use glam::DVec3;

use super::StationError;
use super::values::Values;
use crate::exam::needle::{Approach, Exercise, Region};

/// Default of `exercise.time_s`, s.
const TIME_S: f64 = 60.0;

/// Exercise from checked values. The scene is not opened, so names of surfaces are not checked.
pub(super) fn exercise(values: &Values) -> Result<Exercise, StationError> {
    let target = region(values, ["target", "target_mm", "radius_mm"])?.ok_or_else(|| StationError::Missing {
        key: "exercise.target".to_owned(),
        needed: "give the name of a surface, or `target_mm` and `radius_mm`, the centre and radius of a ball"
            .to_owned(),
    })?;
    let entry = region(values, ["entry", "entry_mm", "entry_radius_mm"])?;
    let forbidden = values.texts("forbidden").unwrap_or_default().into_iter().map(str::to_owned).collect();
    let approach = values.text("approach").and_then(Approach::named).unwrap_or_default();
    let name = values.text("name").unwrap_or("needle exercise").to_owned();
    let mut time_s = TIME_S;
    values.set("time_s", &mut time_s);
    Ok(Exercise { name, target, entry, forbidden, approach, time_s })
}

/// Region from three keys: the name of a surface, or the centre and radius of a ball; `None` without any of them.
fn region(values: &Values, [surface, centre, radius]: [&str; 3]) -> Result<Option<Region>, StationError> {
    if let Some(name) = values.text(surface) {
        values.refuse(&[centre, radius], &format!("`exercise.{surface}` names a surface, too; give one of the two"))?;
        return Ok(Some(Region::Surface(name.to_owned())));
    }
    match (values.numbers(centre), values.number(radius)) {
        (Some(centre_mm), Some(radius_mm)) => {
            Ok(Some(Region::Ball { centre_mm: DVec3::from_array(centre_mm), radius_mm }))
        }
        (None, None) => Ok(None),
        (found, _) => {
            let (missing, given) = if found.is_some() { (radius, centre) } else { (centre, radius) };
            let needed = format!("`exercise.{given}` is given, and a ball needs both its centre and its radius");
            Err(StationError::Missing { key: format!("exercise.{missing}"), needed })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn regions_are_surfaces_or_balls() {
        assert_eq!(parse("").unwrap().exercise, None);
        let exercise = parse("[exercise]\ntarget = 'cyst'").unwrap().exercise.unwrap();
        assert_eq!((exercise.target, exercise.entry), (Region::Surface("cyst".into()), None));
        assert_eq!((exercise.approach, exercise.time_s), (Approach::Any, 60.0));
        let text = "[exercise]\nname = 'Puncture'\ntarget_mm = [1, 2, 30.5]\nradius_mm = 4\nentry_mm = [0, 0, 0]\n\
                    entry_radius_mm = 10\nforbidden = ['placenta', 'fetus_*']\napproach = 'in-plane'\ntime_s = 30";
        let expected = Exercise {
            name: "Puncture".into(),
            target: Region::Ball { centre_mm: DVec3::new(1.0, 2.0, 30.5), radius_mm: 4.0 },
            entry: Some(Region::Ball { centre_mm: DVec3::ZERO, radius_mm: 10.0 }),
            forbidden: vec!["placenta".into(), "fetus_*".into()],
            approach: Approach::InPlane,
            time_s: 30.0,
        };
        assert_eq!(parse(text).unwrap().exercise, Some(expected));
    }

    #[test]
    fn mistakes_are_named_with_what_would_be_right() {
        let lines = [
            ("name = 'x'", ["`exercise.target` is missing", "`target_mm` and `radius_mm`"]),
            ("target = 'a'\nradius_mm = 3", ["exercise.radius_mm", "names a surface, too"]),
            ("target_mm = [0, 0, 0]", ["`exercise.radius_mm` is missing", "`exercise.target_mm` is given"]),
            ("target = 'a'\nentry_radius_mm = 3", ["`exercise.entry_mm` is missing", "exercise.entry_radius_mm"]),
            ("target = 'a'\napproach = 'in plane'", ["exercise.approach", "did you mean `in-plane`"]),
            ("target = 'a'\nforbiden = []", ["forbiden", "did you mean `forbidden`"]),
            ("target = 'a'\ntime_s = 0", ["exercise.time_s", "1..=3600"]),
        ];
        assert_refused("exercise", &lines);
    }
}
