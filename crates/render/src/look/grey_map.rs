//! Grey maps: tables from grey levels of the picture to grey levels of the display.

use insonify_core::settings::GreyMap;

/// Display level of each picture level 0..=255. Black stays black, white stays white.
pub fn table(map: GreyMap) -> [u8; 256] {
    std::array::from_fn(|level| (255.0 * curve(map, level as f64 / 255.0)).round() as u8)
}

/// A grey map as a function from 0..=1 to 0..=1.
fn curve(map: GreyMap, x: f64) -> f64 {
    let smooth = x * x * (3.0 - 2.0 * x);
    match map {
        GreyMap::Linear => x,
        GreyMap::Soft => x.powf(0.8),
        GreyMap::Bright => x.powf(0.6),
        GreyMap::Dark => x.powf(1.5),
        GreyMap::Contrast => 0.5 * (x + smooth),
        GreyMap::Sharp => smooth,
    }
}
