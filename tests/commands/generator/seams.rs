//! Tests of every shipped generator on the full field of view. Nothing appears outside the sector, crops equal the
//! whole image beyond a margin, and padding changes the frame's edge only up to a limit.

use super::*;

/// Largest difference in grey levels that rounding and summation order explain.
const ROUNDING: u8 = 1;
/// Padding multiple from which a model's receptive field is the whole frame, as for pix2pix of 8 levels.
const DEEP: u32 = 256;

/// Paths of all models in `assets/generators`.
pub(super) fn shipped() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/generators");
    let folders = std::fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir());
    let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    let mut models: Vec<PathBuf> = files
        .filter(|path| path.extension().is_some_and(|e| e == "onnx") && Manifest::path_of(path).is_file())
        .collect();
    models.sort();
    assert!(!models.is_empty());
    models
}

/// Loads a generator with the tissues of the built-in table.
fn load_shipped(path: &Path) -> Generator {
    let tissues = TissueTable::builtin().unwrap().names().to_vec();
    let options = LoadOptions { tissues: &tissues, ..LoadOptions::default() };
    Generator::load(path, runtime(), &options).unwrap_or_else(|e| panic!("{e}"))
}

/// Maps of speckle over blobs of tissue, and a shadow, all determined by the seed.
fn scene(width: usize, height: usize, mask: impl Fn(usize, usize) -> bool, seed: u32) -> Maps {
    let hash = |x: usize, y: usize, salt: u32| {
        let n = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77) ^ (seed + salt);
        (n ^ (n >> 15)).wrapping_mul(0x27d4_eb2f) >> 24
    };
    let mut maps = Maps {
        width: width as u32,
        height: height as u32,
        image: vec![],
        segmentation: vec![],
        attenuation: vec![],
        mask: vec![],
    };
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let inside = mask(x, y);
        let tissue = 1 + hash(x / 40, y / 24, 1) % 40;
        // A mean of four is between single-look and multi-look speckle.
        let speckle = (0..4).map(|salt| hash(x / 2, y, 7 + salt)).sum::<u32>() / 4;
        let level = (speckle * (tissue % 7 + 1) / 5).min(255) as u8;
        maps.image.push(if inside { level } else { 0 });
        maps.segmentation.push(if inside { tissue as u8 } else { 0 });
        let shadow = if hash(x / 60, 0, 3) < 60 { 0.3 } else { 1.0 };
        let attenuation = shadow * (1.0 - 0.8 * y as f32 / height as f32);
        maps.attenuation.push(if inside { attenuation } else { 0.0 });
        maps.mask.push(if inside { 255 } else { 0 });
    }
    maps
}

/// The maps' columns from `from` on.
fn columns(maps: &Maps, from: usize) -> Maps {
    fn cut<T: Copy>(map: &[T], width: usize, from: usize) -> Vec<T> {
        map.chunks_exact(width).flat_map(|row| &row[from..]).copied().collect()
    }
    let width = maps.width as usize;
    Maps {
        width: maps.width - from as u32,
        height: maps.height,
        image: cut(&maps.image, width, from),
        segmentation: cut(&maps.segmentation, width, from),
        attenuation: cut(&maps.attenuation, width, from),
        mask: cut(&maps.mask, width, from),
    }
}

/// The maps with `border` more pixels on every side, outside the sector.
fn bordered(maps: &Maps, border: usize) -> Maps {
    fn frame<T: Copy + Default>(map: &[T], width: usize, border: usize) -> Vec<T> {
        let outer = width + 2 * border;
        let mut out = vec![T::default(); border * outer];
        for row in map.chunks_exact(width) {
            out.extend(std::iter::repeat_n(T::default(), border));
            out.extend_from_slice(row);
            out.extend(std::iter::repeat_n(T::default(), border));
        }
        out.extend(std::iter::repeat_n(T::default(), border * outer));
        out
    }
    let width = maps.width as usize;
    Maps {
        width: maps.width + 2 * border as u32,
        height: maps.height + 2 * border as u32,
        image: frame(&maps.image, width, border),
        segmentation: frame(&maps.segmentation, width, border),
        attenuation: frame(&maps.attenuation, width, border),
        mask: frame(&maps.mask, width, border),
    }
}

fn run(generator: &mut Generator, maps: &Maps) -> Vec<u8> {
    let mut out = Vec::new();
    generator.run(&maps.input(), &mut out).unwrap();
    out
}

/// Last column in which two images of `width` columns differ by more than rounding; `None` if they don't.
fn last_difference(a: &[u8], b: &[u8], width: usize) -> Option<usize> {
    let differs = |column: &usize| {
        (0..a.len() / width).any(|row| a[row * width + column].abs_diff(b[row * width + column]) > ROUNDING)
    };
    (0..width).rev().find(differs)
}

#[test]
fn a_crops_output_equals_the_full_frames_beyond_a_margin() {
    let (width, height, from) = (1024, 256, 512);
    let mut compared = 0;
    for path in shipped() {
        let mut generator = load_shipped(&path);
        let name = generator.manifest().name.clone();
        if generator.manifest().padding_multiple >= DEEP {
            // Its receptive field is the whole frame: no margin is wide enough.
            continue;
        }
        if generator.manifest().beam.is_some() {
            // Its input is always the whole sector.
            continue;
        }
        let all = scene(width, height, |_, _| true, 1);
        let mut changed = scene(width, height, |_, _| true, 77);
        for row in 0..height {
            let kept = row * width + from..(row + 1) * width;
            changed.image[kept.clone()].copy_from_slice(&all.image[kept.clone()]);
            changed.segmentation[kept.clone()].copy_from_slice(&all.segmentation[kept.clone()]);
            changed.attenuation[kept.clone()].copy_from_slice(&all.attenuation[kept]);
        }
        let full = run(&mut generator, &all);
        // Reach of changes left of `from` to the right. Statistics of the whole frame would reach everywhere.
        let other = run(&mut generator, &changed);
        let last = last_difference(&full, &other, width);
        assert!(last.is_some_and(|column| column + 32 > from), "{name}: {last:?}, the change is not seen");
        let reach = last.map_or(0, |column| (column + 1).saturating_sub(from));
        assert!(reach <= 200, "{name}: {reach} columns beyond the change differ: are its statistics frozen?");
        let crop = run(&mut generator, &columns(&all, from));
        let inner: Vec<u8> = full.chunks_exact(width).flat_map(|row| &row[from..]).copied().collect();
        let margin = last_difference(&crop, &inner, width - from).map_or(0, |column| column + 1);
        assert!(margin <= 200, "{name}: a crop differs {margin} columns from its edge");
        eprintln!("{name}: a change is seen {reach} columns away, a crop's edge {margin}");
        compared += 1;
    }
    assert!(compared > 0, "every shipped model is deep");
}

#[test]
fn nothing_is_outside_the_sector_and_padding_changes_its_edge_by_a_few_levels() {
    // A fan that touches all four sides, of a size that is no multiple of any model's.
    let (width, height) = (603usize, 437usize);
    let fan = |x: usize, y: usize| {
        let (dx, dy) = (x as f64 - 301.0, y as f64 + 120.0);
        let (radius, angle) = (dx.hypot(dy), dx.atan2(dy).abs());
        (120.0..557.0).contains(&radius) && angle < 0.575
    };
    for path in shipped() {
        let mut generator = load_shipped(&path);
        let name = generator.manifest().name.clone();
        if generator.manifest().beam.is_some() {
            // The edge of its grid is the sector's, in training, too.
            continue;
        }
        let maps = scene(width, height, fan, 5);
        assert!(maps.mask[301] > 0 && maps.mask[(height - 1) * width + 301] > 0);
        let alone = run(&mut generator, &maps);
        assert!(alone.iter().zip(&maps.mask).all(|(&level, &mask)| mask > 0 || level == 0), "{name}: outside");
        // On a larger canvas no edge of the tensor touches the sector: any difference comes from padding.
        let border = 64usize.next_multiple_of(generator.manifest().padding_multiple as usize);
        let canvas = run(&mut generator, &bordered(&maps, border));
        let outer = width + 2 * border;
        let (mut sums, mut counts) = ([0u64; 2], [0u64; 2]);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            if maps.mask[y * width + x] == 0 {
                continue;
            }
            let from_edge = x.min(y).min(width - 1 - x).min(height - 1 - y);
            let off = alone[y * width + x].abs_diff(canvas[(y + border) * outer + x + border]);
            let zone = usize::from(from_edge >= 16);
            sums[zone] += u64::from(off);
            counts[zone] += 1;
        }
        let [near, far] = [0, 1].map(|zone| sums[zone] as f64 / counts[zone].max(1) as f64);
        eprintln!("{name}: {near:.2} grey levels within 16 pixels of the frame's edge, {far:.3} elsewhere");
        assert!(counts[0] > 2000, "{counts:?}");
        // Without an image a model infers levels from distant maps, and it has never seen patches like these.
        let [near_max, far_max] =
            if generator.manifest().takes(insonify::generator::Channel::Image) { [8.0, 1.0] } else { [20.0, 3.0] };
        assert!(near < near_max && far < far_max, "{name}: {near} levels at the frame's edge, {far} elsewhere");
    }
}

/// A picture of a sector of this size, with speckle that is fixed to scanlines and range cells.
fn beam_scene(width: u32, height: u32) -> Frame {
    let scan = ScanGeometry::fit(&Probe::default(), width, height);
    // Speckle of some three scanlines by five cells of 0.2 mm, brighter in some tissues.
    let speckle = |fraction: f64, depth_mm: f64| {
        let waves = (0..24).map(|i| {
            let turn = f64::from(i * i) * 0.618;
            (540.0 * fraction * (turn * 1.7).sin() + depth_mm * 6.0 * (turn * 2.3).cos() + 7.0 * turn).sin()
        });
        0.5 + waves.sum::<f64>() / 24.0
    };
    let tissue = |fraction: f64, depth_mm: f64| 1 + ((5.0 * fraction) as u8 + (depth_mm / 20.0) as u8) % 20;
    let mut frame = Frame { width, height, scan: Some(scan), ..Frame::default() };
    let mut mask = Vec::new();
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        let beam = scan.beam_at(column, row);
        let tissue = beam.map_or(0, |(fraction, depth_mm)| tissue(fraction, depth_mm));
        let level =
            beam.map_or(0.0, |(fraction, depth_mm)| speckle(fraction, depth_mm) * (40.0 + 8.0 * f64::from(tissue)));
        frame.bmode.push(level.clamp(0.0, 255.0) as u8);
        frame.segmentation.push(tissue);
        frame.attenuation.push(beam.map_or(0.0, |(_, depth_mm)| (-depth_mm / 40.0).exp() as f32));
        mask.push(if beam.is_some() { 255 } else { 0 });
    }
    frame.mask = mask.into();
    frame
}

#[test]
fn models_in_beam_coordinates_see_the_same_at_any_size() {
    let (small, large) = (beam_scene(693, 500), beam_scene(1386, 1000));
    let mut compared = 0;
    for path in shipped() {
        let mut generator = load_shipped(&path);
        if generator.manifest().beam.is_none() {
            continue;
        }
        let name = generator.manifest().name.clone();
        let (mut at_small, mut at_large) = (Vec::new(), Vec::new());
        generator.run(&Input::from(&small), &mut at_small).unwrap();
        generator.run(&Input::from(&large), &mut at_large).unwrap();
        assert!(at_large.iter().zip(&*large.mask).all(|(&level, &mask)| mask > 0 || level == 0), "{name}: outside");
        let (mut sum, mut count) = (0.0, 0.0);
        for (row, column) in (0..500usize).flat_map(|row| (0..693usize).map(move |column| (row, column))) {
            let of_large = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(y, x)| (2 * row + y) * 1386 + 2 * column + x);
            if small.mask[row * 693 + column] > 0 && of_large.iter().all(|&at| large.mask[at] > 0) {
                let mean = of_large.iter().map(|&at| f64::from(at_large[at])).sum::<f64>() / 4.0;
                sum += (mean - f64::from(at_small[row * 693 + column])).abs();
                count += 1.0;
            }
        }
        eprintln!("{name}: {:.2} grey levels between pictures of 693 x 500 and 1386 x 1000", sum / count);
        assert!(count > 150_000.0 && sum / count < 3.0, "{name}: {} grey levels", sum / count);
        let level = at_large.iter().map(|l| f64::from(*l)).sum::<f64>() / at_large.len() as f64;
        assert!(level > 10.0, "{name}: a mean level of {level}");
        compared += 1;
    }
    assert!(compared > 0, "no shipped model works in beam coordinates");
}
