//! Compares each step of post-processing with its twin.

use insonify_core::random;

use super::*;

const WIDTH: usize = 61;
const HEIGHT: usize = 47;

/// Grey levels and mask of a test picture: speckle with a bright and a dark half, in a sector with a slanted border.
fn picture() -> (Vec<u8>, Vec<u8>) {
    let mask = (0..WIDTH * HEIGHT).map(|i| if i % WIDTH > i / WIDTH / 3 { 255 } else { 0 }).collect::<Vec<u8>>();
    let level = |i: usize| {
        let rayleigh_db = 10.0 * (-random::at(9, i as u64).max(1e-9).ln()).log10();
        let mean = if i % WIDTH > 30 { 170.0 } else { 90.0 };
        (mean + rayleigh_db * 255.0 / 60.0).clamp(0.0, 255.0) as u8
    };
    let levels = (0..WIDTH * HEIGHT).map(|i| if mask[i] == 0 { 0 } else { level(i) }).collect();
    (levels, mask)
}

fn shape(mask: &[u8]) -> Shape<'_> {
    Shape { width: WIDTH, pixel_mm: 0.2, mask, dynamic_range_db: 60.0, independent_angles: 1.0 }
}

fn wide(picture: &[u8]) -> Vec<f64> {
    picture.iter().map(|&level| f64::from(level)).collect()
}

/// Largest difference of any pixel.
fn off(one: &[u8], twin: &[f64]) -> f64 {
    one.iter().zip(twin).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
}

#[test]
fn each_step_is_its_twin() {
    let (levels, mask) = picture();
    let of = |change: fn(&mut LookSettings)| {
        let mut settings = LookSettings::default();
        change(&mut settings);
        settings
    };
    let steps = [
        of(|s| s.speckle_reduction = 1.0),
        of(|s| s.speckle_reduction = 0.4),
        of(|s| s.edge_enhancement = 0.8),
        of(|s| s.grey_map = GreyMap::Sharp),
    ];
    for settings in steps {
        let mut found = levels.clone();
        Look::default().apply(&settings, shape(&mask), &mut found);
        let twin = twin::apply(&settings, shape(&mask), &wide(&levels), None);
        assert!(off(&found, &twin) < 0.51, "{settings:?}: {}", off(&found, &twin));
        assert!(found != levels, "{settings:?} changes nothing");
        assert!(found.iter().zip(&mask).all(|(level, mask)| *mask == 255 || *level == 0), "outside the sector");
        // The comparison must notice a slightly different strength.
        let weaker = LookSettings {
            speckle_reduction: 0.9 * settings.speckle_reduction,
            edge_enhancement: 0.9 * settings.edge_enhancement,
            grey_map: if settings.grey_map == GreyMap::Sharp { GreyMap::Contrast } else { settings.grey_map },
            ..settings
        };
        let wrong = twin::apply(&weaker, shape(&mask), &wide(&levels), None);
        assert!(off(&found, &wrong) > 1.0);
    }
}

#[test]
fn persistence_is_a_running_mean_that_begins_anew_with_another_size() {
    let (levels, mask) = picture();
    let settings = LookSettings { persistence: 0.6, ..LookSettings::default() };
    let mut look = Look::default();
    let mut before: Option<Vec<f64>> = None;
    for frame in 0..6 {
        let mut found: Vec<u8> = levels.iter().map(|level| level.saturating_sub(20 * frame)).collect();
        let expected = twin::persist(0.6, &wide(&found), before.as_deref());
        look.apply(&settings, shape(&mask), &mut found);
        assert!(off(&found, &expected) < 0.51, "frame {frame}");
        before = Some(expected);
    }
    // A picture of another depth.
    let mut deeper = levels.clone();
    look.apply(&settings, Shape { pixel_mm: 0.3, ..shape(&mask) }, &mut deeper);
    assert_eq!(deeper, levels);
    let (mut small, mask) = (vec![200; 12], vec![255; 12]);
    look.apply(&settings, Shape { width: 4, mask: &mask, ..shape(&mask) }, &mut small);
    assert_eq!(small, [200; 12]);
}

#[test]
fn speckle_gets_smoother_and_edges_stay() {
    let (levels, mask) = picture();
    let mut found = levels.clone();
    let settings = LookSettings { speckle_reduction: 1.0, ..LookSettings::default() };
    Look::default().apply(&settings, shape(&mask), &mut found);
    let deviation = |picture: &[u8]| {
        let inside: Vec<f64> =
            (0..picture.len()).filter(|i| (40..56).contains(&(i % WIDTH))).map(|i| f64::from(picture[i])).collect();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        ((inside.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / inside.len() as f64).sqrt(), mean)
    };
    let ((before, level_before), (after, level_after)) = (deviation(&levels), deviation(&found));
    assert!(after < 0.55 * before, "{before} {after}");
    assert!((level_before - level_after).abs() < 2.0);
}

#[test]
fn grey_maps_rise_from_black_to_white() {
    for map in GreyMap::ALL {
        let table = grey_table(map);
        assert_eq!((table[0], table[255]), (0, 255), "{map:?}");
        assert!(table.windows(2).all(|pair| pair[0] <= pair[1]), "{map:?}");
    }
    assert!(GreyMap::ALL.len() >= 5);
}

#[test]
fn each_grey_map_is_its_twin_and_no_other() {
    let levels: Vec<f64> = (0..256).map(f64::from).collect();
    // Grey levels that each map's formula gives for 32, 64, 128 and 192, computed by another program.
    let maps = [
        (GreyMap::Linear, [32, 64, 128, 192]),
        (GreyMap::Soft, [48, 84, 147, 203]),
        (GreyMap::Bright, [73, 111, 169, 215]),
        (GreyMap::Dark, [11, 32, 91, 167]),
        (GreyMap::Contrast, [22, 52, 128, 204]),
        (GreyMap::Sharp, [11, 40, 128, 216]),
    ];
    assert_eq!(maps.map(|(map, _)| map).as_slice(), GreyMap::ALL.as_slice());
    for (map, expected) in maps {
        let table = grey_table(map);
        assert_eq!([32, 64, 128, 192].map(|level| table[level]), expected, "{map:?}");
        for other in GreyMap::ALL {
            let most = off(&table, &twin::grey_map(other, &levels));
            assert_eq!(most < 0.5 + 1e-9, other == map, "{map:?} and the twin of {other:?}: {most}");
        }
    }
}

#[test]
fn all_steps_follow_each_other_as_in_the_twin() {
    let (levels, mask) = picture();
    let settings = LookSettings {
        speckle_reduction: 0.7,
        edge_enhancement: 0.5,
        persistence: 0.4,
        grey_map: GreyMap::Contrast,
        ..LookSettings::default()
    };
    let mut look = Look::default();
    let mut first = levels.clone();
    look.apply(&settings, shape(&mask), &mut first);
    let before =
        twin::apply(&LookSettings { grey_map: GreyMap::Linear, ..settings }, shape(&mask), &wide(&levels), None);
    let next: Vec<u8> = levels.iter().map(|level| level / 2).collect();
    let mut found = next.clone();
    look.apply(&settings, shape(&mask), &mut found);
    let twin = twin::apply(&settings, shape(&mask), &wide(&next), Some(&before));
    // Each step rounds to whole levels; edge enhancement and grey map amplify the rounding.
    assert!(off(&found, &twin) < 2.5, "{}", off(&found, &twin));
    assert!(off(&first, &twin) > 10.0);
}

#[test]
fn a_compounded_picture_keeps_more_of_its_texture() {
    let (levels, mask) = picture();
    let settings = LookSettings { speckle_reduction: 1.0, ..LookSettings::default() };
    // Half the amplitude of the speckle, as in a mean of four independent angles.
    let calm: Vec<u8> = levels.iter().map(|&level| if level == 0 { 0 } else { 64 + level / 2 }).collect();
    let change = |independent_angles: f64| {
        let mut found = calm.clone();
        Look::default().apply(&settings, Shape { independent_angles, ..shape(&mask) }, &mut found);
        let twin = twin::apply(&settings, Shape { independent_angles, ..shape(&mask) }, &wide(&calm), None);
        assert!(off(&found, &twin) < 0.51, "{independent_angles} independent angles");
        found.iter().zip(&calm).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>()
    };
    assert!(change(16.0) < 0.7 * change(4.0) && change(4.0) <= change(1.0));
}
