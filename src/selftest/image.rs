//! Checks of the image and its maps: shadow of a plate, time-gain compensation, segmentation, attenuation.

use glam::DVec2;

use super::bench::{Bench, at, grainy, linear, silent, slab, small};
use super::{Check, Family, Rig};
use crate::acoustics::attenuation::attenuation_db_mm;
use crate::acoustics::decibel::db_from_amplitude;
use crate::acoustics::interface::interface;
use crate::anatomy::Tissue;
use crate::render::{Frame, RenderError, RenderSettings};
use crate::statistics::slope;
use crate::transducer::{Probe, Sector};

/// Attenuation of a block, and of an absorbing plate in it, dB/cm/MHz.
const BLOCK_ALPHA: f64 = 0.5;
const PLATE_ALPHA: f64 = 3.0;
/// Impedances of block and plate, MRayl. They are so close that multiple reflections can be ignored.
const BLOCK_IMPEDANCE: f64 = 1.6;
const PLATE_IMPEDANCE: f64 = 1.9;
/// Depths of the plate's front and back face, mm.
const PLATE_MM: (f64, f64) = (20.0, 24.0);
/// Depth range below the plate in which speckle is measured, mm.
const BELOW_MM: (f64, f64) = (28.0, 56.0);
/// Gain and dynamic range, dB, at which speckle is mid-grey.
const GAIN_DB: f64 = 10.0;
const RANGE_DB: f64 = 100.0;
/// Time-gain compensation, dB/cm. It differs from the loss, so that a measurable slope remains.
const TGC_DB_CM: f64 = 5.0;
/// RMS amplitude of the block's scatterers.
const DEVIATION: f64 = 0.03;
/// Difference of the RMS level of fully developed speckle from its mean level, dB: 10·γ/ln 10 for exponentially
/// distributed power, with Euler's constant γ.
const LOG_SPECKLE_DB: f64 = 2.506_815_5;

/// Position of a block whose left half holds the plate.
pub(super) struct Image {
    place: DVec2,
    plate_tissue: usize,
}

fn probe() -> Probe {
    linear(128, 0.3, 1536, 60.0)
}

fn settings() -> RenderSettings {
    let mut settings = small(1, 1);
    (settings.image.width, settings.image.height) = (384, 600);
    (settings.image.gain_db, settings.image.dynamic_range_db) = (GAIN_DB, RANGE_DB);
    settings.image.tgc_db_per_cm = TGC_DB_CM;
    settings
}

impl Image {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let place = bench.place();
        let block = bench.tissue(Tissue { attenuation_db_cm_mhz: BLOCK_ALPHA, ..grainy(0.0, DEVIATION) });
        let plate_tissue =
            bench.tissue(Tissue { attenuation_db_cm_mhz: PLATE_ALPHA, ..silent(1540.0, PLATE_IMPEDANCE) });
        bench.add(block, 1, slab(place, 40.0, -20.0, 90.0));
        // The plate lies in the left half only.
        bench.add(plate_tissue, 2, slab(place - DVec2::new(15.0, 0.0), 15.0, PLATE_MM.0, PLATE_MM.1));
        Self { place, plate_tissue }
    }
}

/// A frame and its sector, for means over rectangles of lateral range × depth range, mm.
struct View<'a> {
    frame: &'a Frame,
    sector: Sector,
}

impl View<'_> {
    /// Mean of `value(pixel index)` over the pixels whose centres are in the rectangle `x` × `z`.
    fn mean(&self, x: (f64, f64), z: (f64, f64), value: impl Fn(usize) -> f64) -> f64 {
        let (mut count, mut sum) = (0u32, 0.0);
        for row in 0..self.sector.height {
            for column in 0..self.sector.width {
                let at = self.sector.pixel_centre_mm(column, row);
                if at.x >= x.0 && at.x < x.1 && at.y >= z.0 && at.y < z.1 {
                    count += 1;
                    sum += value((row * self.sector.width + column) as usize);
                }
            }
        }
        sum / f64::from(count)
    }

    /// Mean grey level in a rectangle, dB.
    fn db(&self, x: (f64, f64), z: (f64, f64)) -> f64 {
        self.mean(x, z, |i| f64::from(self.frame.bmode[i]) * RANGE_DB / 255.0)
    }
}

impl Family for Image {
    fn groups(&self) -> &'static [&'static str] {
        &["Image", "Maps", "Shadow"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let frame = rig.frame(&probe(), &settings(), &at(self.place.x, self.place.y, 0.0))?.clone();
        let sector = rig.sector();
        let view = View { frame: &frame, sector };
        let one_way_db_mm = |alpha: f64| attenuation_db_mm(alpha, 1.0, probe().frequency_mhz);
        let (left, right) = ((-16.0, -3.0), (3.0, 16.0));

        let shadow = view.db(right, BELOW_MM) - view.db(left, BELOW_MM);
        let thickness = PLATE_MM.1 - PLATE_MM.0;
        let passed = 1.0 - interface(BLOCK_IMPEDANCE, PLATE_IMPEDANCE, 1540.0, 1540.0, 1.0).energy_reflection;
        let absorbed = 2.0 * thickness * (one_way_db_mm(PLATE_ALPHA) - one_way_db_mm(BLOCK_ALPHA));
        let want_shadow = absorbed - 2.0 * db_from_amplitude(passed);

        let rows: Vec<_> =
            (0..48).map(|i| 5.0 + f64::from(i)).map(|z| (0.1 * z + 0.05, view.db(right, (z, z + 1.0)))).collect();
        let want_slope = TGC_DB_CM - 20.0 * one_way_db_mm(BLOCK_ALPHA);
        let middle = |of: fn(&(f64, f64)) -> f64| rows.iter().map(of).sum::<f64>() / rows.len() as f64;
        let (depth_cm, level_db) = (middle(|row| row.0), middle(|row| row.1));
        let at_face_db = RANGE_DB + GAIN_DB + db_from_amplitude(DEVIATION) - LOG_SPECKLE_DB;
        let want_db = at_face_db + want_slope * depth_cm;
        let grey = format!("level of the grey at {:.0} mm", 10.0 * depth_cm);

        // Extent in depth of the pixels with the plate's tissue.
        let number = self.plate_tissue as u8 + 1;
        let column = (-10.0, -9.0);
        let is_plate = |i: usize| f64::from(u8::from(frame.segmentation[i] == number));
        let plate_mm = view.mean(column, (0.0, 60.0), is_plate) * 60.0;
        let top_mm = 60.0
            * view.mean(column, (0.0, 60.0), |i| {
                f64::from(u8::from(frame.segmentation[i] != number && row_mm(&sector, i) < PLATE_MM.1))
            });

        // One-way level of the attenuation map at a depth of 50 mm, in the shadow.
        let z = (49.0, 51.0);
        let level = view.mean(left, z, |i| db_from_amplitude(f64::from(frame.attenuation[i] * frame.attenuation_p98)));
        let want_level = -(50.0 - thickness) * one_way_db_mm(BLOCK_ALPHA) - thickness * one_way_db_mm(PLATE_ALPHA);
        Ok(vec![
            Check::new("Shadow", "depth behind an absorbing plate", "dB", want_shadow, shadow, 1.0),
            Check::new("Image", "slope of the grey levels with TGC", "dB/cm", want_slope, slope(&rows).0, 0.15),
            // About 4000 independent speckles, each with a deviation of 5.6 dB, give a random error of 0.1 dB, equal on
            // every device. The rest comes from the scatterer lattice.
            Check::new("Image", grey, "dB", want_db, level_db, 0.75),
            Check::new("Maps", "segmentation: depth of the plate", "mm", PLATE_MM.0, top_mm, sector.pixel_mm),
            Check::new("Maps", "segmentation: thickness of the plate", "mm", thickness, plate_mm, sector.pixel_mm),
            Check::new("Maps", "attenuation at 50 mm, one-way", "dB", want_level, level, 0.1),
        ])
    }
}

/// Depth of a pixel's centre, mm.
fn row_mm(sector: &Sector, index: usize) -> f64 {
    sector.pixel_centre_mm(0, index as u32 / sector.width).y
}
