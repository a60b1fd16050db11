//! The needle's table against formulas: steering, curved faces, bevel, lumen, round trips, and extreme settings.

use glam::DVec3;
use insonify_core::needle::Needle;
use insonify_core::pose::Pose;
use insonify_core::settings::{NeedleKind, NeedleSettings, ProbeKind, Quality};
use insonify_core::transducer::{Probe, Sector};

use super::{NEEDLE_ECHOES_MAX, NeedleEcho, NeedleFrame, NeedleTables, View};
use crate::aperture::ApertureTables;

/// The table of a needle in the probe's frame, for scanlines steered by `steer_rad`.
fn placed(probe: &Probe, settings: NeedleSettings, needle: Needle, steer_rad: f64) -> NeedleFrame {
    let tables = (NeedleTables::new(settings, probe, 7), ApertureTables::new(probe, Quality::LQ));
    placed_by(probe, &tables, needle, steer_rad)
}

/// As [`placed`], with ready tables.
fn placed_by(
    probe: &Probe,
    (tables, aperture): &(NeedleTables, Option<ApertureTables>),
    needle: Needle,
    steer_rad: f64,
) -> NeedleFrame {
    let sector = Sector::fit(probe, 320, 240);
    let view =
        View { probe, aperture: aperture.as_ref(), sector: &sector, scene_from_probe: &Pose::IDENTITY, steer_rad };
    let mut frame = NeedleFrame::without_needle(probe);
    frame.place(tables, view, Some(&needle));
    frame
}

/// A needle along `direction` whose tip is at `tip_mm`; its facet faces `bevel`, if that is known.
fn needle(tip_mm: DVec3, direction: DVec3, bevel: Option<DVec3>) -> Needle {
    let x = bevel.unwrap_or_else(|| direction.any_orthogonal_vector());
    Needle { scene_from_needle: Pose::looking(tip_mm, direction, x), bevel_known: bevel.is_some() }
}

/// Echoes of a scanline without the points of the diffuse echo.
fn mirrors(frame: &NeedleFrame, line: usize) -> Vec<NeedleEcho> {
    let [from, to] = [line, line + 1].map(|line| frame.starts[line] as usize);
    frame.echoes[from..to].iter().copied().filter(|echo| echo.turns == 0.0).collect()
}

fn db(ratio: f32) -> f32 {
    20.0 * ratio.log10()
}

fn linear() -> Probe {
    let kind = ProbeKind::Linear { width_mm: 40.0 };
    Probe { kind, frequency_mhz: 8.0, scanlines: 128, depth_mm: 90.0, ..Probe::default() }
}

#[test]
fn a_needle_perpendicular_to_steered_scanlines_faces_them() {
    let settings = NeedleSettings::default();
    let level = |steer_deg: f64, tilt_deg: f64| {
        // A positive steering angle turns scanlines towards +x.
        let (sin, cos) = f64::to_radians(tilt_deg).sin_cos();
        let shaft = DVec3::new(cos, 0.0, -sin);
        let at = needle(DVec3::new(0.0, 0.0, 50.0) + 45.0 * shaft, shaft, None);
        let frame = placed(&linear(), settings, at, f64::to_radians(steer_deg));
        mirrors(&frame, 64).first().map_or(-200.0, |echo| db(echo.amplitude))
    };
    let facing = level(0.0, 0.0);
    assert!((level(10.0, 10.0) - facing).abs() < 0.5, "{} dB, not {facing}", level(10.0, 10.0));
    assert!(level(10.0, -10.0) < facing - 40.0, "{} dB", level(10.0, -10.0));
    assert!(level(10.0, 0.0) < facing - 10.0, "{} dB", level(10.0, 0.0));
}

#[test]
fn a_needle_along_the_arc_of_a_curved_face_faces_its_scanline() {
    let kind = ProbeKind::Convex { radius_mm: 50.0, fov_deg: 70.0 };
    let probe = Probe { kind, frequency_mhz: 5.0, scanlines: 129, ..Probe::default() };
    let level = |line: u32| {
        let fraction = (f64::from(line) + 0.5) / 129.0;
        let (origin, direction) = probe.ray(probe.lateral_coordinate(fraction));
        let shaft = DVec3::new(direction.z, 0.0, -direction.x);
        let at = needle(origin + 60.0 * direction + 30.0 * shaft, shaft, None);
        let mirror = mirrors(&placed(&probe, NeedleSettings::default(), at, 0.0), line as usize)[0];
        // The surface that faces the probe lies a radius before the axis.
        assert!((mirror.depth_mm - 59.64).abs() < 0.01, "{} mm", mirror.depth_mm);
        db(mirror.amplitude)
    };
    let middle = level(64);
    for line in [10, 40, 100, 120] {
        assert!((level(line) - middle).abs() < 0.1, "{} dB on scanline {line}, not {middle}", level(line));
    }
}

#[test]
fn echoes_of_the_lumen_and_round_trips_follow_the_mirror() {
    let settings = NeedleSettings { gauge: 18, ..NeedleSettings::default() };
    let at = needle(DVec3::new(45.0, 0.0, 25.0), DVec3::X, None);
    let echoes = mirrors(&placed(&linear(), settings, at, 0.0), 64);
    let once = echoes[0].amplitude;
    for (n, echo) in echoes[1..7].iter().enumerate() {
        assert!((echo.extra_mm - (n + 1) as f32 * 0.84 * 1540.0 / 1480.0).abs() < 1e-3, "{echo:?}");
        assert!((db(echo.amplitude / once) + 3.0 * (n + 1) as f32).abs() < 0.05, "{echo:?}");
    }
    let trips: Vec<f32> = echoes[7..].iter().map(|echo| echo.extra_mm).collect();
    assert_eq!(trips, [-2.0, -3.0]);
    assert!((db(echoes[7].amplitude) - 2.0 * db(once) + 10.0).abs() < 0.1, "{:?}", echoes[7]);
}

#[test]
fn the_bevel_flashes_where_its_facet_faces_the_probe() {
    let settings = NeedleSettings { gauge: 18, bevel_deg: 17.0, ..NeedleSettings::default() };
    // The facet's normal is the bevel's side, turned by the bevel's angle towards the tip.
    let level = |down_deg: f64, bevel_up: bool| {
        let (sin, cos) = f64::to_radians(down_deg).sin_cos();
        let (shaft, up) = (DVec3::new(cos, 0.0, sin), DVec3::new(sin, 0.0, -cos));
        let at = needle(DVec3::new(0.0, 0.0, 40.0), shaft, Some(if bevel_up { up } else { -up }));
        let frame = placed(&linear(), settings, at, 0.0);
        let near = (60..68).flat_map(|line| mirrors(&frame, line));
        db(near.filter(|echo| echo.extra_mm == 0.0).map(|echo| echo.amplitude).fold(1e-9, f32::max))
    };
    // An upward slope of 17° to the tip: the facet is level.
    let flash = level(-17.0, true);
    assert!(flash > level(-17.0, false) + 10.0 && flash > level(0.0, true) - 25.0, "{flash} dB");
    assert!(flash > level(30.0, true) + 10.0, "{flash} dB");
}

#[test]
fn a_needle_across_the_slice_is_a_dot_as_wide_as_the_beam() {
    let at = needle(DVec3::new(0.0, 45.0, 50.0), DVec3::Y, None);
    let frame = placed(&linear(), NeedleSettings::default(), at, 0.0);
    let level = |line: usize| mirrors(&frame, line).first().map_or(-200.0, |echo| db(echo.amplitude));
    assert!(level(63) > level(60) && level(64) > level(67), "{} {}", level(60), level(67));
    assert!(level(64) > -30.0 && level(40) < -60.0, "{} and {} dB", level(64), level(40));
    // Its shadow is as wide as the shaft, and nearly complete.
    let darkest = frame.shadows.iter().map(|shadow| shadow.passes).fold(1.0, f32::min);
    assert!(darkest < 0.5 && frame.shadows.len() < 20, "{darkest} in {} cells", frame.shadows.len());
}

#[test]
fn tables_are_finite_and_in_bounds_at_extreme_settings() {
    let kinds = [
        ProbeKind::Linear { width_mm: 40.0 },
        ProbeKind::Convex { radius_mm: 40.0, fov_deg: 60.0 },
        ProbeKind::Phased { fov_deg: 90.0 },
    ];
    let directions = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z, DVec3::new(0.5, 0.1, 0.8)];
    let tips = [DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -20.0), DVec3::new(1.0, 0.5, 60.0)];
    let needles = [
        NeedleSettings { gauge: 14, length_mm: 10.0, bevel_deg: 10.0, kind: NeedleKind::Plain },
        NeedleSettings { gauge: 27, length_mm: 300.0, bevel_deg: 90.0, kind: NeedleKind::Etched },
    ];
    for kind in kinds {
        for (depth_mm, aperture_mm, scanlines) in [(5.0, 20.0, 1), (150.0, 0.5, 1024), (500.0, 20.0, 64)] {
            let probe = Probe { kind, depth_mm, aperture_mm, scanlines, ..Probe::default() };
            for settings in needles {
                let tables = (NeedleTables::new(settings, &probe, 7), ApertureTables::new(&probe, Quality::LQ));
                for (direction, tip_mm) in directions.into_iter().flat_map(|d| tips.map(|tip| (d, tip))) {
                    for bevel in [None, Some(DVec3::new(0.3, 0.2, -0.9).cross(direction))] {
                        let at = needle(tip_mm, direction.normalize(), bevel.filter(|b| b.length() > 0.1));
                        check(&placed_by(&probe, &tables, at, 0.1), scanlines);
                    }
                }
            }
        }
    }
}

/// Checks that a table is finite and in order.
fn check(frame: &NeedleFrame, scanlines: u32) {
    assert_eq!(frame.starts.len(), scanlines as usize + 1);
    assert!(frame.starts.is_sorted() && frame.starts.last() == Some(&(frame.echoes.len() as u32)));
    assert!(frame.echoes.len() <= NEEDLE_ECHOES_MAX);
    for echo in &frame.echoes {
        assert!(echo.amplitude.is_finite() && echo.amplitude > 0.0 && echo.amplitude < 2.0, "{echo:?}");
        assert!(echo.depth_mm > 0.0 && echo.depth_mm.is_finite() && echo.extra_mm.is_finite(), "{echo:?}");
    }
    assert!(frame.shadows.iter().all(|shadow| shadow.passes > 0.0 && shadow.passes <= 1.0));
    let mut cells: Vec<u32> = frame.shadows.iter().map(|shadow| shadow.cell).collect();
    cells.sort_unstable();
    assert!(cells.windows(2).all(|pair| pair[0] < pair[1]), "a cell is listed twice");
}

#[test]
fn an_unknown_turn_leaves_the_axis_at_the_tip() {
    let at = |bevel| needle(DVec3::new(45.0, 0.0, 50.0), DVec3::X, bevel);
    let depth = |needle| mirrors(&placed(&linear(), NeedleSettings::default(), needle, 0.0), 64)[0].depth_mm;
    assert!((depth(at(None)) - 49.64).abs() < 1e-3);
    // The tip lies on the outer surface, opposite to the side that the facet faces.
    assert!((depth(at(Some(-DVec3::Z))) - 49.28).abs() < 1e-3);
    assert!((depth(at(Some(DVec3::Z))) - 50.0).abs() < 1e-3);
}
