use serde_json::json;

use super::*;
use crate::transducer::{Probe, ProbeKind, Sector};

const GRID: BeamGrid = BeamGrid { scanlines: 48, cell_mm: 1.5, detail_kept: 0.0 };
const CONVEX: ProbeKind = ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 };

fn geometry(kind: ProbeKind) -> ScanGeometry {
    ScanGeometry::fit(&Probe { kind, ..Probe::default() }, 160, 120)
}

/// Maps of a frame.
struct Maps {
    image: Vec<u8>,
    segmentation: Vec<u8>,
    attenuation: Vec<f32>,
    mask: Vec<u8>,
}

impl Maps {
    fn of(geometry: &ScanGeometry, level: impl Fn(f64, f64) -> u8) -> Self {
        let Sector { width, height, .. } = geometry.sector;
        let pixels: Vec<_> = (0..height).flat_map(|row| (0..width).map(move |column| (column, row))).collect();
        let beam = |&(column, row): &(u32, u32)| geometry.beam_at(column, row);
        Self {
            image: pixels
                .iter()
                .map(|at| beam(at).map_or(0, |(fraction, depth_mm)| level(fraction, depth_mm)))
                .collect(),
            segmentation: pixels.iter().map(|at| beam(at).map_or(0, |_| 1 + ((at.0 + 2 * at.1) % 5) as u8)).collect(),
            attenuation: pixels
                .iter()
                .map(|at| beam(at).map_or(0.0, |(_, depth_mm)| 1.0 / (1.0 + depth_mm as f32)))
                .collect(),
            mask: pixels.iter().map(|at| if beam(at).is_some() { 255 } else { 0 }).collect(),
        }
    }

    fn input(&self, geometry: &ScanGeometry) -> Input<'_> {
        Input {
            width: geometry.sector.width,
            height: geometry.sector.height,
            image: &self.image,
            segmentation: &self.segmentation,
            attenuation: &self.attenuation,
            mask: &self.mask,
            scan: Some(*geometry),
        }
    }
}

/// Picture whose grey level varies slowly, as a function of lateral fraction and depth.
fn smooth(fraction: f64, depth_mm: f64) -> u8 {
    (120.0 + 60.0 * (9.0 * fraction).sin() + 40.0 * (depth_mm / 12.0).cos()).round() as u8
}

#[test]
fn the_grid_shows_the_picture_at_its_positions() {
    for kind in [CONVEX, ProbeKind::Linear { width_mm: 60.0 }, ProbeKind::Phased { fov_deg: 80.0 }] {
        let geometry = geometry(kind);
        let maps = Maps::of(&geometry, smooth);
        let mut sampling = BeamSampling::new(GRID, geometry);
        let on_grid = sampling.resample(&maps.input(&geometry));
        assert_eq!((on_grid.width, on_grid.height), (48, 100), "{kind:?}");
        for (index, (&level, &inside)) in on_grid.image.iter().zip(on_grid.mask).enumerate() {
            let (cell, scanline) = (index / 48, index % 48);
            // At the sector's rim, a value comes from the nearest pixels inside. At a phased array's apex, scanlines
            // share pixels.
            if !(12..98).contains(&cell) || !(2..46).contains(&scanline) || inside == 0 {
                continue;
            }
            let expected = smooth((scanline as f64 + 0.5) / 48.0, (cell as f64 + 0.5) * 1.5);
            assert!(level.abs_diff(expected) <= 6, "{kind:?}: cell {cell}, scanline {scanline}: {level}, {expected}");
        }
        let missing = on_grid.mask.iter().filter(|inside| **inside == 0).count();
        assert!(missing < 48, "{kind:?}: {missing} values without a pixel");
    }
}

#[test]
fn a_picture_comes_back_from_the_grid() {
    for kind in [CONVEX, ProbeKind::Linear { width_mm: 60.0 }, ProbeKind::Phased { fov_deg: 80.0 }] {
        let geometry = geometry(kind);
        let maps = Maps::of(&geometry, smooth);
        let mut sampling = BeamSampling::new(GRID, geometry);
        let values: Vec<f32> =
            sampling.resample(&maps.input(&geometry)).image.iter().map(|l| f32::from(*l) / 255.0).collect();
        let mut out = vec![7; 3];
        sampling.picture(&values, [0, 48], Affine::new(1.0, 0.0), &maps.input(&geometry), &mut out);
        assert!(out.iter().zip(&maps.mask).all(|(level, inside)| *inside > 0 || *level == 0));
        let off: Vec<u8> = out.iter().zip(&maps.image).map(|(found, expected)| found.abs_diff(*expected)).collect();
        let far = off.iter().filter(|off| **off > 6).count();
        assert!(far < off.len() / 200, "{kind:?}: {far} pixels are off by more than 6 grey levels");
    }
}

#[test]
fn padded_values_are_read_at_their_offsets() {
    let geometry = geometry(CONVEX);
    let maps = Maps::of(&geometry, smooth);
    let mut sampling = BeamSampling::new(GRID, geometry);
    let value = |cell: usize, scanline: usize| 0.3 + 0.004 * cell as f32 + 0.002 * scanline as f32;
    let plain: Vec<f32> = (0..100 * 48).map(|i| value(i / 48, i % 48)).collect();
    // Padding: three rows above the grid and five columns to its left.
    let mut padded = vec![f32::NAN; 110 * 64];
    for cell in 0..100 {
        for scanline in 0..48 {
            padded[(cell + 3) * 64 + scanline + 5] = value(cell, scanline);
        }
    }
    let (mut found, mut expected) = (Vec::new(), Vec::new());
    sampling.picture(&plain, [0, 48], Affine::new(1.0, 0.0), &maps.input(&geometry), &mut expected);
    sampling.picture(&padded, [3 * 64 + 5, 64], Affine::new(1.0, 0.0), &maps.input(&geometry), &mut found);
    assert_eq!(found, expected);
}

#[test]
fn a_picture_keeps_detail_that_is_finer_than_the_grid() {
    let geometry = geometry(CONVEX);
    let fine = |fraction: f64, depth_mm: f64| smooth(fraction, depth_mm) + ((depth_mm * 7.0) as u8 % 3) * 12;
    let maps = Maps::of(&geometry, fine);
    let input = maps.input(&geometry);
    let mut sampling = BeamSampling::new(BeamGrid { detail_kept: 1.0, ..GRID }, geometry);
    let values: Vec<f32> = sampling.resample(&input).image.iter().map(|level| f32::from(*level) / 255.0).collect();
    let mut out = Vec::new();
    // An output that equals the input changes nothing, to the last pixel.
    sampling.picture(&values, [0, 48], Affine::new(1.0, 0.0), &input, &mut out);
    assert_eq!(out, maps.image);
    // Twenty levels more on the grid are twenty more in the picture; white stays white.
    sampling.picture(&values, [0, 48], Affine::new(1.0, 20.0 / 255.0), &input, &mut out);
    let white = |level: u8| level > 225;
    for ((&found, &level), &inside) in out.iter().zip(&maps.image).zip(&maps.mask) {
        let expected = if inside == 0 { 0 } else { level.saturating_add(20) };
        assert!(found.abs_diff(expected) <= 1 || white(level), "{found}, {level}");
    }
}

#[test]
fn maps_take_the_nearest_pixel_and_empty_ones_stay_empty() {
    let geometry = geometry(CONVEX);
    let maps = Maps::of(&geometry, smooth);
    let mut sampling = BeamSampling::new(GRID, geometry);
    let on_grid = sampling.resample(&maps.input(&geometry));
    assert!(on_grid.segmentation.iter().zip(on_grid.mask).all(|(number, inside)| (*number > 0) == (*inside > 0)));
    assert!(on_grid.attenuation.iter().zip(on_grid.mask).all(|(a, inside)| (*a > 0.0) == (*inside > 0)));
    let without = Input { segmentation: &[], attenuation: &[], ..maps.input(&geometry) };
    let on_grid = sampling.resample(&without);
    assert!(on_grid.segmentation.is_empty() && on_grid.attenuation.is_empty() && on_grid.image.len() == 4800);
}

/// The Rust code and the training package (training/tests/test_beam.py) resample grid and picture alike.
#[test]
fn training_resamples_alike() {
    let geometry = ScanGeometry::fit(&Probe { kind: CONVEX, ..Probe::default() }, 64, 46);
    let grid = BeamGrid { scanlines: 16, cell_mm: 9.0, detail_kept: 0.0 };
    let maps = Maps::of(&geometry, |fraction, depth_mm| ((fraction * 977.0 + depth_mm * 31.0) as u32 % 251) as u8);
    let mut sampling = BeamSampling::new(grid, geometry);
    let on_grid = sampling.resample(&maps.input(&geometry));
    let (image, segmentation) = (on_grid.image.to_vec(), on_grid.segmentation.to_vec());
    let values: Vec<f32> = image.iter().map(|level| f32::from(*level) / 255.0).collect();
    let mut picture = Vec::new();
    sampling.picture(&values, [0, 16], Affine::new(1.0, 0.0), &maps.input(&geometry), &mut picture);
    let mut keeping = BeamSampling::new(BeamGrid { detail_kept: 0.5, ..grid }, geometry);
    keeping.resample(&maps.input(&geometry));
    let mut corrected = Vec::new();
    keeping.picture(&values, [0, 16], Affine::new(0.5, 0.25), &maps.input(&geometry), &mut corrected);
    let ScanGeometry { sector, depth_mm, .. } = geometry;
    let scan = json!({
        "radius_mm": 40.0, "half_extent": Probe::default().half_extent(), "depth_mm": depth_mm,
        "pixel_mm": sector.pixel_mm, "corner_mm": sector.corner_mm.to_array(),
    });
    let made = json!({
        "grid": "16x9", "size": [64, 46], "scan": scan,
        "image": maps.image, "segmentation": maps.segmentation, "mask": maps.mask,
        "grid_image": image, "grid_segmentation": segmentation, "picture": picture, "corrected": corrected,
    });
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/beam_grid.json");
    if std::env::var_os("INSONIFY_WRITE_SUMS").is_some() {
        std::fs::write(path, made.to_string() + "\n").unwrap();
    }
    let kept: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    for key in ["grid_image", "grid_segmentation", "picture", "corrected"] {
        assert_eq!(made[key], kept[key], "{key}: INSONIFY_WRITE_SUMS=1 writes it anew, and training/ must agree");
    }
}
