//! The small scenes of `configs/` show the effects that they were made for.

use std::path::Path;

use glam::DVec2;
use insonify::anatomy::analytic::Part;
use insonify::anatomy::{Scene, TissueTable, analytic};
use insonify::render::{Frame, Quality};
use insonify::station::Station;
use insonify::transducer::Sector;

use super::bench::{Rig, at};
use super::scenes::lung_air;
use super::scenes::needle::vessel_needle_at;

struct Shot {
    frame: Frame,
    sector: Sector,
    db_per_level: f64,
    names: Vec<String>,
}

/// Image of the station `name` with its own scene, or with a scene of `parts`.
fn shot(name: &str, parts: Option<Vec<Part>>, quality: Quality) -> Shot {
    let mut station = Station::load(Path::new(&format!("configs/{name}.toml"))).unwrap();
    station.settings.quality = quality;
    let scene: Scene = match parts {
        Some(parts) => analytic::scene(parts, &TissueTable::builtin().unwrap(), &station.background).unwrap(),
        None => station.load_scene_from(station.scene_file().unwrap()).unwrap(),
    };
    let pose = station.default_pose.unwrap_or(at(0.0, 0.0, 0.0));
    let mut rig = Rig::new(&scene, &station.probe, &station.settings);
    let frame = rig.frame(&pose);
    let db_per_level = station.settings.image.dynamic_range_db / 255.0;
    Shot { frame, sector: rig.sector(), db_per_level, names: scene.tissues.names().to_vec() }
}

impl Shot {
    fn pixel(&self, x: f64, z: f64) -> Option<usize> {
        let p = self.sector.pixel_from_probe(DVec2::new(x, z));
        let inside =
            p.x >= 0.0 && p.y >= 0.0 && p.x < f64::from(self.sector.width) && p.y < f64::from(self.sector.height);
        inside.then(|| p.y as usize * self.sector.width as usize + p.x as usize)
    }

    fn db(&self, x: f64, z: f64) -> f64 {
        self.pixel(x, z).map_or(0.0, |i| f64::from(self.frame.bmode[i]) * self.db_per_level)
    }

    /// Mean level of the image in a box, dB.
    fn mean_db(&self, x: (f64, f64), z: (f64, f64)) -> f64 {
        let steps = 60;
        let at = |range: (f64, f64), i: i32| range.0 + (range.1 - range.0) * (f64::from(i) + 0.5) / f64::from(steps);
        let sum: f64 =
            (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))).map(|(i, j)| self.db(at(x, i), at(z, j))).sum();
        sum / f64::from(steps * steps)
    }

    fn tissue(&self, x: f64, z: f64) -> &str {
        let number = self.pixel(x, z).map_or(0, |i| usize::from(self.frame.segmentation[i]));
        number.checked_sub(1).map_or("", |i| &self.names[i])
    }
}

#[test]
fn stones_cast_shadows_and_bile_enhances() {
    let shot = shot("gallbladder_stones", None, Quality { rays: 8, layers: 1, seed: 0 });
    // Beams start at the apex 60 mm above the face.
    let (mut shadow, mut behind_bile, mut beside) = (vec![], vec![], vec![]);
    for i in -240..=240_i32 {
        let angle = f64::from(i) * 0.1_f64.to_radians();
        let on_beam = |depth: f64| ((60.0 + depth) * angle.sin(), (60.0 + depth) * angle.cos() - 60.0);
        let length = |tissue: &str| {
            (40..240).map(|s| on_beam(f64::from(s) * 0.4)).filter(|&(x, z)| shot.tissue(x, z) == tissue).count()
        };
        let (stone, bile) = (length("gallstone"), length("bile"));
        let there: Vec<f64> =
            (0..40).map(|s| on_beam(84.0 + 0.25 * f64::from(s))).map(|(x, z)| shot.db(x, z)).collect();
        let level = there.iter().sum::<f64>() / 40.0;
        if stone >= 12 {
            shadow.push(level);
        } else if stone == 0 && bile >= 45 {
            behind_bile.push(level);
        } else if bile == 0 && i.abs() > 150 {
            beside.push(level);
        }
    }
    let mean = |levels: &[f64]| levels.iter().sum::<f64>() / levels.len() as f64;
    assert!(shadow.len() > 10 && behind_bile.len() > 10 && beside.len() > 10);
    let (shadow, bile, beside) = (mean(&shadow), mean(&behind_bile), mean(&beside));
    println!("shadow {shadow:.1} dB, behind bile {bile:.1} dB, beside {beside:.1} dB");
    // 18 mm of bile instead of liver: 2 × 1.8 cm × (0.55 − 0.03) dB/cm/MHz × 4 MHz = 7.5 dB.
    assert!(beside - shadow > 15.0, "shadow {shadow} dB, beside {beside} dB");
    assert!(bile - beside > 3.0, "behind bile {bile} dB, beside {beside} dB");
}

#[test]
fn a_lines_are_at_multiples_of_the_pleuras_depth() {
    let quality = Quality { rays: 64, layers: 1, seed: 0 };
    let with_face = shot("lung_air", None, quality);
    let without = lung_air().into_iter().filter(|part| part.name != "probe face").collect();
    let without_face = shot("lung_air", Some(without), quality);
    let row = |shot: &Shot, z: f64| shot.mean_db((-9.0, 9.0), (z - 0.03, z + 0.03));
    let strongest = |shot: &Shot, from: f64, to: f64| {
        let steps = ((to - from) / 0.05) as u32;
        let all = (0..=steps).map(|i| from + 0.05 * f64::from(i)).map(|z| (z, row(shot, z)));
        all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
    };
    let (pleura, bright) = strongest(&with_face, 18.0, 22.0);
    assert!(bright > 50.0, "pleura {bright} dB");
    for order in [2.0, 3.0] {
        let expected = order * pleura;
        let (z, level) = strongest(&with_face, expected - 2.0, expected + 2.0);
        let below = with_face.mean_db((-9.0, 9.0), (z + 1.0, z + 2.5));
        let (_, absent) = strongest(&without_face, expected - 2.0, expected + 2.0);
        println!(
            "A-line {order}: {z:.2} mm of {expected:.2}, {level:.1} dB, {below:.1} below it, {absent:.1} without face"
        );
        assert!((z - expected).abs() < 0.8, "A-line {order} at {z} mm");
        assert!(level > below + 5.0 && level > absent + 5.0, "A-line {order}: {level} dB");
    }
    // Behind a rib there is no pleura.
    let (_, behind_rib) = strongest(&with_face, 19.0, 21.5);
    let rib_shadow = with_face.mean_db((17.0, 21.0), (19.5, 21.0));
    assert!(behind_rib - rib_shadow > 20.0, "{behind_rib} {rib_shadow}");
}

#[test]
fn a_steeper_needle_is_fainter_and_a_perpendicular_wire_reverberates() {
    let quality = Quality { rays: 16, layers: 1, seed: 0 };
    let needle_db = |degrees: f32| {
        let shot = shot("vessel_needle", Some(vessel_needle_at(degrees)), quality);
        let angle = f64::from(degrees).to_radians();
        // Upper side of the needle inside the vessel and above it, 3 to 9 mm from the tip at (−2, 20).
        let along = (0..40).map(|i| 3.0 + 0.15 * f64::from(i)).map(|s| {
            let (x, z) = (-2.0 - s * angle.cos() + 0.63 * angle.sin(), 20.0 - s * angle.sin() - 0.63 * angle.cos());
            (-8..=8).map(|i| shot.db(x, z + 0.06 * f64::from(i))).fold(0.0, f64::max)
        });
        (along.sum::<f64>() / 40.0, shot)
    };
    let (shallow, shot) = needle_db(15.0);
    let levels = [shallow, needle_db(32.0).0, needle_db(60.0).0];
    println!("needle at 15, 32, 60 degrees: {levels:.1?} dB");
    assert!(levels[0] > levels[1] + 2.0 && levels[1] > levels[2] + 2.0, "{levels:?}");
    // The wire's upper side appears at 21.55 mm and its lower at 21.79, because steel is fast; later echoes are
    // reverberation.
    let (ringing, blood) = (shot.mean_db((12.0, 18.0), (21.95, 22.3)), shot.mean_db((12.0, 18.0), (17.5, 20.5)));
    println!("behind the wire {ringing:.1} dB, blood {blood:.1} dB");
    assert!(ringing > blood + 8.0, "{ringing} {blood}");
}
