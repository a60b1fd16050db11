//! Tests that measure the image of the QA phantom, as on a scanner.

use std::path::Path;

use insonify::quality::levels::Levels;
use insonify::quality::qa_phantom::{QaMeasurements, measure};
use insonify::station::Station;

use super::bench::{Rig, assert_part, at};

fn report(tgc_db_per_cm: Option<f64>) -> QaMeasurements {
    let mut station = Station::load(Path::new("configs/qa_phantom.toml")).unwrap();
    if let Some(tgc) = tgc_db_per_cm {
        station.settings.image.tgc_db_per_cm = tgc;
    }
    let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
    let mut rig = Rig::new(&scene, &station.probe, &station.settings);
    let mut levels = Levels::new(rig.sector(), station.settings.image.dynamic_range_db);
    for y in [-20.0, -12.0, -4.0, 4.0, 12.0, 20.0] {
        assert!(levels.add(&rig.frame(&at(0.0, y, 0.0)).bmode));
    }
    measure(&levels, &station.probe)
}

#[test]
fn measurements_of_the_qa_phantom_match_its_design() {
    let report = report(None);

    assert_eq!(report.distances.len(), 12 + 2 * 4);
    for d in &report.distances {
        let tolerance = if d.true_mm > 50.0 { 0.002 } else { 0.01 };
        assert_part(d.measured_mm, d.true_mm, tolerance, &format!("{} at {} mm", d.direction, d.depth_mm));
    }

    assert_eq!(report.contrast.len(), 6);
    for c in &report.contrast {
        println!("{:+.2} dB, nominal {:+.0}", c.measured_db, c.true_db);
        assert!((c.measured_db - c.true_db).abs() <= 1.0, "{c:?}");
    }

    // Cysts: dark in the middle; larger ones are darker.
    assert_eq!(report.cysts.len(), 10);
    for c in &report.cysts {
        println!("cyst of {:.1} mm at {} mm: {:.1} dB below the background", c.diameter_mm, c.depth_mm, c.void_db);
        let least = match c.diameter_mm {
            d if d >= 3.0 => 12.0,
            d if d >= 2.0 => 5.0,
            _ => 0.0,
        };
        assert!(c.void_db > least, "{c:?}");
    }

    // −6 dB widths compared with those of beam and pulse.
    assert!(report.widths.len() >= 11);
    let widths: Vec<_> = report.widths.iter().filter(|w| [20.0, 40.0, 70.0, 90.0].contains(&w.depth_mm)).collect();
    assert_eq!(widths.len(), 4);
    for w in widths {
        println!("{w:?}");
        assert_part(w.lateral_mm, w.lateral_expected_mm, 0.15, "lateral width");
        assert_part(w.axial_mm, w.axial_expected_mm, 0.15, "axial width");
    }

    // Distant wires are resolved; wires closer than beam or pulse are not.
    for p in &report.pairs {
        println!("{} at {} mm, {} mm apart: dip {:.1} dB", p.direction, p.depth_mm, p.apart_mm, p.dip_db);
        if p.apart_mm >= 3.0 {
            assert!(p.is_resolved(), "{p:?}");
        }
    }
    let axial = |apart: f64| report.pairs.iter().find(|p| p.direction == "axial" && p.apart_mm == apart).unwrap();
    assert!(axial(1.0).is_resolved() && !axial(0.25).is_resolved());
    // The time gain matches the phantom's attenuation, so the background is level to the bottom.
    assert!(report.penetration.whole_depth && report.penetration.slope_db_cm.abs() < 0.5, "{:?}", report.penetration);
}

#[test]
fn without_time_gain_the_qa_phantom_fades_by_its_attenuation() {
    let penetration = report(Some(0.0)).penetration;
    println!("{penetration:?}");
    // 2 × 0.5 dB/cm/MHz × 5 MHz.
    assert_part(penetration.slope_db_cm, -5.0, 0.1, "fall of the background, dB/cm");
    assert!(!penetration.whole_depth && (20.0..100.0).contains(&penetration.seen_mm));
}
