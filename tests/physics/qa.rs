//! The QA phantom measured as on a scanner: on the image, by what a person would read off it.

use std::path::Path;

use insonify::acoustics::pulse::FWHM_PER_SIGMA;
use insonify::anatomy::specimens::qa;
use insonify::render::Frame;
use insonify::station::Station;
use insonify::transducer::{Probe, Sector};

use super::bench::{Rig, assert_part, at};

/// Mean of the images at places along the targets: in dB, and in power.
struct Measured {
    probe: Probe,
    sector: Sector,
    level_db: Vec<f64>,
    power: Vec<f64>,
}

impl Measured {
    fn phantom() -> Self {
        let station = Station::load(Path::new("configs/qa_phantom.toml")).unwrap();
        let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
        let mut rig = Rig::new(&scene, &station.probe, &station.settings);
        let image = station.settings.image;
        let pixels = (image.width * image.height) as usize;
        let (mut level_db, mut power) = (vec![0.0; pixels], vec![0.0; pixels]);
        let places = [-20.0, -12.0, -4.0, 4.0, 12.0, 20.0];
        for y in places {
            let frame: Frame = rig.frame(&at(0.0, y, 0.0));
            for (i, &grey) in frame.bmode.iter().enumerate() {
                let db = f64::from(grey) / 255.0 * image.dynamic_range_db;
                level_db[i] += db / places.len() as f64;
                power[i] += 10f64.powf(0.1 * db) / places.len() as f64;
            }
        }
        Self { probe: station.probe, sector: rig.sector(), level_db, power }
    }

    fn index(&self, column: u32, row: u32) -> usize {
        (row * self.sector.width + column) as usize
    }

    /// Pixels (column, row, lateral place and depth in mm) whose centres lie within a box about (x, z).
    fn pixels(&self, (x, z): (f64, f64), half: (f64, f64)) -> Vec<(u32, u32, f64, f64)> {
        let mut found = Vec::new();
        for row in 0..self.sector.height {
            for column in 0..self.sector.width {
                let place = self.sector.pixel_centre_mm(column, row);
                if (place.x - x).abs() <= half.0 && (place.y - z).abs() <= half.1 {
                    found.push((column, row, place.x, place.y));
                }
            }
        }
        found
    }

    /// Mean level of a disc, dB.
    fn disc_db(&self, centre: (f64, f64), radius: f64) -> f64 {
        let inside = |p: &(u32, u32, f64, f64)| (p.2 - centre.0).hypot(p.3 - centre.1) <= radius;
        let levels: Vec<f64> = self
            .pixels(centre, (radius, radius))
            .iter()
            .filter(|p| inside(p))
            .map(|p| self.level_db[self.index(p.0, p.1)])
            .collect();
        levels.iter().sum::<f64>() / levels.len() as f64
    }

    /// Where the wire near (x, depth) is seen: the centre of what is within 10 dB of its peak.
    fn wire(&self, (x, depth): (f32, f32)) -> (f64, f64) {
        let pixels = self.pixels((x.into(), f64::from(depth) + 0.1), (1.6, 0.5));
        let power = |p: &&(u32, u32, f64, f64)| self.power[self.index(p.0, p.1)];
        let peak = pixels.iter().map(|p| power(&p)).fold(0.0, f64::max);
        let bright: Vec<_> = pixels.iter().filter(|p| power(p) > 0.1 * peak).collect();
        let weight: f64 = bright.iter().map(power).sum();
        let mean = |of: fn(&(u32, u32, f64, f64)) -> f64| bright.iter().map(|p| of(p) * power(p)).sum::<f64>() / weight;
        (mean(|p| p.2), mean(|p| p.3))
    }

    /// Full widths at half the amplitude of the wire near (x, depth): lateral and axial, mm.
    fn widths(&self, place: (f32, f32)) -> (f64, f64) {
        let (x, z) = self.wire(place);
        let centre = self.sector.pixel_from_probe(glam::DVec2::new(x, z)).floor();
        let (column, row) = (centre.x as u32, centre.y as u32);
        // Speckle beside the wire, whose power adds to its own.
        let beside = self.pixels((x, z + 2.5), (3.0, 0.8));
        let noise = beside.iter().map(|p| self.power[self.index(p.0, p.1)]).sum::<f64>() / beside.len() as f64;
        let width = |at: &dyn Fn(i32) -> usize| {
            let amplitude = |i: i32| (self.power[at(i)] - noise).max(1e-9).sqrt();
            let top = (-3..=3).max_by(|&a, &b| amplitude(a).total_cmp(&amplitude(b))).unwrap();
            let half = 0.5 * amplitude(top);
            let side = |step: i32| {
                let mut i = top;
                while amplitude(i + step) >= half {
                    i += step;
                }
                let (inside, outside) = (amplitude(i), amplitude(i + step));
                f64::from((i - top).abs()) + (inside - half) / (inside - outside)
            };
            (side(1) + side(-1)) * self.sector.pixel_mm
        };
        let lateral = width(&|i| self.index((column as i32 + i) as u32, row));
        (lateral, width(&|i| self.index(column, (row as i32 + i) as u32)))
    }
}

#[test]
fn the_qa_phantom_measures_as_it_is_built() {
    let measured = Measured::phantom();

    // Distances, by calipers from wire to wire.
    let vertical: Vec<_> = (0..qa::VERTICAL_COUNT).map(|i| measured.wire(qa::vertical(i))).collect();
    for (i, pair) in vertical.windows(2).enumerate() {
        assert_part(pair[1].1 - pair[0].1, 10.0, 0.01, &format!("vertical {i}"));
    }
    assert_part(vertical[11].1 - vertical[0].1, 110.0, 0.002, "the whole vertical group");
    for depth in qa::HORIZONTAL_DEPTHS_MM {
        let row: Vec<_> = qa::HORIZONTAL_MM.iter().map(|&x| measured.wire((x, depth))).collect();
        for (pair, want) in row.windows(2).zip([10.0, 20.0, 10.0]) {
            assert_part(pair[1].0 - pair[0].0, want, 0.01, &format!("horizontal at {depth}"));
        }
    }

    // Contrast against the background just above and below.
    for (x, want, name) in qa::CONTRAST {
        let (x, z) = (f64::from(x), f64::from(qa::CONTRAST_DEPTH_MM));
        let around = 0.5 * (measured.disc_db((x, z - 7.6), 2.4) + measured.disc_db((x, z + 7.6), 2.4));
        let contrast = measured.disc_db((x, z), 3.2) - around;
        println!("{name}: {contrast:+.2} dB, nominal {want:+.0}");
        assert!((contrast - want).abs() <= 1.0, "{name}: {contrast} dB");
    }

    // Cysts: dark in the middle, the larger the darker.
    for (x, depth, diameter) in qa::CYSTS_MM.map(|(x, z, d)| (f64::from(x), f64::from(z), f64::from(d))) {
        let around = 0.5 * (measured.disc_db((x, depth - 7.0), 1.5) + measured.disc_db((x, depth + 7.0), 1.5));
        let void = around - measured.disc_db((x, depth), 0.25 * diameter);
        println!("cyst of {diameter:.1} mm at {depth} mm: {void:.1} dB below the background");
        let least = if diameter >= 3.0 {
            12.0
        } else if diameter >= 2.0 {
            5.0
        } else {
            0.0
        };
        assert!(void > least, "cyst of {diameter} mm at {depth} mm: {void} dB");
    }

    // Resolution: -6 dB widths against the beam's and the pulse's; the wire's own width adds.
    for index in [1, 3, 6, 8] {
        let place = qa::vertical(index);
        let depth = f64::from(place.1);
        let (lateral, axial) = measured.widths(place);
        let beam = FWHM_PER_SIGMA * measured.probe.lateral_sigma_mm(depth);
        let pulse = FWHM_PER_SIGMA * measured.probe.axial_sigma_mm();
        println!("at {depth} mm: lateral {lateral:.2} mm (beam {beam:.2}), axial {axial:.3} mm (pulse {pulse:.3})");
        let wire = f64::from(qa::WIRE_MM);
        // The second moments of a Gaussian and a box add.
        assert_part(
            lateral,
            (beam.powi(2) + FWHM_PER_SIGMA.powi(2) / 12.0 * wire.powi(2)).sqrt(),
            0.15,
            "lateral width",
        );
        // Upper and lower side of the wire echo one behind the other; nylon is faster than the phantom.
        assert_part(axial, pulse + wire * 1540.0 / 2600.0, 0.15, "axial width");
    }
}
