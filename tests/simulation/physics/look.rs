//! Tests of signal processing as in scanners: compounding, harmonics, noise and texture, compared with statistics,
//! diffraction and loss.

use insonify::anatomy::Tissue;
use insonify::render::{Choice, Effect, Frame, RenderSettings};
use insonify::settings::{LookSettings, ReceiverSettings};
use insonify::transducer::{Probe, ProbeKind};

use super::bench::{Bench, Rig, assert_part, at, grainy, linear, magnitude, mean_square, post, silent, small};
use super::speckle::block;

const RANGE_DB: f64 = 60.0;

fn settings(look: LookSettings) -> RenderSettings {
    let base = small(1, 1);
    let mut image = base.image;
    (image.width, image.height, image.gain_db, image.tgc_db_per_cm) = (400, 500, 30.0, 0.0);
    image.dynamic_range_db = RANGE_DB;
    RenderSettings { image, look, ..base }
}

fn compounded(angles: u32) -> LookSettings {
    LookSettings { angles, span_deg: 30.0, ..LookSettings::default() }
}

/// Amplitudes in a box of a picture, whose sides are fractions of the picture's width and height.
fn amplitudes(frame: &Frame, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) -> Vec<f64> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let of = |part: f64, whole: usize| (part * whole as f64) as usize;
    let rows = of(top, h)..of(bottom, h);
    rows.flat_map(|y| &frame.bmode[y * w + of(left, w)..y * w + of(right, w)])
        .map(|&level| 10f64.powf((f64::from(level) / 255.0 - 1.0) * RANGE_DB / 20.0))
        .collect()
}

fn snr(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    mean / (mean_square(values.iter().copied()) - mean * mean).sqrt()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let shared = |f: &dyn Fn(usize) -> f64| (0..a.len()).map(f).sum::<f64>();
    let both = shared(&|i| (a[i] - ma) * (b[i] - mb));
    both / (shared(&|i| (a[i] - ma).powi(2)) * shared(&|i| (b[i] - mb).powi(2))).sqrt()
}

fn probe() -> Probe {
    linear(256, 0.3, 1536, 80.0)
}

#[test]
fn compounding_raises_the_snr_as_its_angles_correlate() {
    let scene = block(Tissue { attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) });
    let boxes = ([0.42, 0.58], [0.3, 0.8]);
    // Each of the nine angles by itself.
    let angles: Vec<Vec<f64>> = (0..9)
        .map(|angle| {
            let mut rig = Rig::new(&scene, &probe(), &settings(compounded(9)));
            amplitudes(&rig.angle(&at(0.0, 0.0, 0.0), angle), boxes.0, boxes.1)
        })
        .collect();
    let shared: f64 = angles.iter().flat_map(|a| angles.iter().map(move |b| correlation(a, b))).sum();
    let single = snr(&angles[8]);
    let mut rig = Rig::new(&scene, &probe(), &settings(compounded(9)));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let found = snr(&amplitudes(&frame, boxes.0, boxes.1));
    // The variance of a mean of n equal variables is the mean of their n² covariances.
    let expected = single * (81.0 / shared).sqrt();
    println!("SNR {single:.2} → {found:.2}, expected {expected:.2}; mean correlation {:.3}", (shared - 9.0) / 72.0);
    assert_part(found, expected, 0.1, "SNR of nine angles");
    assert!(found > 1.5 * single, "{found} of {single}");
}

#[test]
fn angles_are_as_unlike_as_waves_make_them() {
    // By tests/truth/compounding.py (8 MHz, aperture 20 mm, focus 70 mm), mean over 66 to 74 mm: angles 3.75° and 7.5°
    // apart, and nine. Correlation falls away from the focus: at 3.75° it is 0.41 at 70 mm and 0.21 at 80 mm.
    const CORRELATIONS: [([usize; 2], f64); 2] = [([7, 6], 0.395), ([5, 4], 0.025)];
    const SNR: f64 = 4.39;
    const ALLOWED: f64 = 0.1;
    const POSES: u32 = 3;
    let scene = block(Tissue { attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) });
    // Close scanlines and samples: each of the scatterers' cells is met by several of every angle.
    let probe = Probe { frequency_mhz: 8.0, aperture_mm: 20.0, focus_mm: 70.0, ..linear(1024, 0.07, 3072, 100.0) };
    let (box_x, box_z) = ([0.35, 0.65], [0.66, 0.74]);
    let mut rig = Rig::new(&scene, &probe, &settings(compounded(9)));
    let level = |values: &[f64]| 20.0 * (values.iter().sum::<f64>() / values.len() as f64).log10();
    let (mut correlations, mut found, mut raised_db) = ([0.0; CORRELATIONS.len()], 0.0, 0.0);
    for pose in 0..POSES {
        let pose = at(1.37 * f64::from(pose), 3.1 * f64::from(pose), 0.0);
        let mut seen = |angle: usize| amplitudes(&rig.angle(&pose, angle), box_x, box_z);
        let straight = seen(8);
        for (sum, (steered, _)) in correlations.iter_mut().zip(CORRELATIONS) {
            *sum += steered.map(|steered| correlation(&straight, &seen(steered))).iter().sum::<f64>();
        }
        let mean = amplitudes(&rig.frame(&pose), box_x, box_z);
        found += snr(&mean) / f64::from(POSES);
        raised_db += (level(&mean) - level(&straight)) / f64::from(POSES);
    }
    for (sum, (_, expected)) in correlations.into_iter().zip(CORRELATIONS) {
        let found = sum / (2.0 * f64::from(POSES));
        println!("correlation {found:.3}, theory {expected}");
        assert!((found - expected).abs() < ALLOWED, "{found}, theory {expected}");
    }
    println!("SNR {found:.2}, theory {SNR}; level {raised_db:+.2} dB");
    assert_part(found, SNR, 0.1, "SNR of nine angles");
    assert!(raised_db.abs() < 0.5, "{raised_db} dB");
}

#[test]
fn angles_of_distant_scanlines_share_their_scatterers() {
    struct Case {
        probe: Probe,
        /// Expected correlation of angles 3.75° apart, and its tolerance; `snr` is the SNR of nine angles. Both are
        /// from tests/truth/compounding.py as above, with `--radius 40` for the curved face. The tolerance is needed
        /// since a sample takes one scatterer of a cell as wide as the scanlines' distance, where a beam takes all.
        correlation: [f64; 2],
        snr: [f64; 2],
    }
    let scene = block(Tissue { attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) });
    // Scanlines as far apart as a station's.
    let flat = linear(288, 0.25, 3072, 100.0);
    let kind = ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 };
    let curved = Probe { kind, scanlines: 256, ..flat };
    let cases = [
        Case { probe: flat, correlation: [0.395, 0.2], snr: [4.39, 0.1] },
        Case { probe: curved, correlation: [0.88, 0.36], snr: [2.8, 0.32] },
    ];
    for Case { probe, correlation: [expected, allowed], snr: [expected_snr, allowed_part] } in cases {
        let probe = Probe { frequency_mhz: 8.0, aperture_mm: 20.0, focus_mm: 70.0, ..probe };
        let (box_x, box_z) = ([0.35, 0.65], [0.66, 0.74]);
        let mut rig = Rig::new(&scene, &probe, &settings(compounded(9)));
        let (mut alike, mut nine, mut power) = (0.0, 0.0, 0.0);
        for pose in [0.0, 1.0, 2.0].map(|step| at(1.37 * step, 3.1 * step, 0.0)) {
            let mut seen = |angle: usize| amplitudes(&rig.angle(&pose, angle), box_x, box_z);
            let straight = seen(8);
            alike += [7, 6].map(|steered| correlation(&straight, &seen(steered))).iter().sum::<f64>() / 6.0;
            power += mean_square(straight.iter().copied()) / 3.0;
            nine += snr(&amplitudes(&rig.frame(&pose), box_x, box_z)) / 3.0;
        }
        // A gain of 30 dB over scatterers of −40.
        let level_db = 10.0 * power.log10() + 10.0;
        println!(
            "correlation {alike:.3}, theory {expected}; SNR {nine:.2}, theory {expected_snr}; level {level_db:+.2} dB"
        );
        assert!((alike - expected).abs() < allowed, "{alike}, theory {expected}");
        assert_part(nine, expected_snr, allowed_part, "SNR of nine angles");
        // Neighbours that share scatterers add in amplitude.
        assert!(level_db.abs() < 0.7, "{level_db} dB");
    }
}

#[test]
fn a_rolling_compound_at_rest_is_the_stills() {
    let scene = block(grainy(0.0, 0.01));
    let mut rig = Rig::new(&scene, &probe(), &settings(compounded(5)));
    let still = rig.frame(&at(0.0, 0.0, 0.0));
    let rolling = rig.rolling(&at(0.0, 0.0, 0.0), 12);
    assert!(rolling.bmode == still.bmode);
    // Each angle has its own noise, in a still as in a rolling compound.
    let mut noisy = settings(compounded(5));
    noisy.receiver = ReceiverSettings { noise_db: -50.0, ..ReceiverSettings::default() };
    noisy.effects = noisy.effects.with(Effect::Noise, Choice::On);
    let mut noisy = Rig::new(&scene, &probe(), &noisy);
    let with_noise = noisy.frame(&at(0.0, 0.0, 0.0));
    assert!(with_noise.bmode != still.bmode && noisy.rolling(&at(0.0, 0.0, 0.0), 7).bmode == with_noise.bmode);
    let mut plain = Rig::new(&scene, &probe(), &settings(compounded(1)));
    let plain = plain.frame(&at(0.0, 0.0, 0.0));
    assert!(plain.bmode != still.bmode);
    let mut begun = Rig::new(&scene, &probe(), &settings(compounded(5)));
    assert!(begun.rolling(&at(0.0, 0.0, 0.0), 1).bmode == plain.bmode, "the first picture is straight and whole");
    assert!(plain.segmentation == still.segmentation && plain.attenuation == still.attenuation, "maps are straight");
    assert!(plain.lines == still.lines, "lines are those of the straight angle");
}

#[test]
fn frames_from_where_the_probe_was_are_left_out() {
    let scene = block(grainy(0.0, 0.01));
    let (there, here) = (at(3.0, 0.0, 0.0), at(-3.0, 0.0, 0.0));
    let plain = Rig::new(&scene, &probe(), &settings(compounded(1))).frame(&here);
    let with_reach = |reach_mm: f64| {
        let mut rig =
            Rig::new(&scene, &probe(), &settings(LookSettings { registration: false, reach_mm, ..compounded(5) }));
        rig.rolling(&there, 5);
        [1, 4].map(|frames| rig.rolling(&here, frames).bmode)
    };
    let still = Rig::new(&scene, &probe(), &settings(compounded(5))).frame(&here).bmode;
    let [first, whole] = with_reach(5.0);
    assert!(first == plain.bmode, "6 mm away, the straight angle is alone");
    assert!(whole == still, "at rest, the others return");
    let [smeared, renewed] = with_reach(7.0);
    assert!(smeared != plain.bmode && smeared != still, "within reach, they stay");
    assert!(renewed == still);
}

#[test]
fn compounding_keeps_the_width_of_a_point_and_makes_shadows_cones() {
    let probe = probe();
    let mut bench = Bench::new(silent(1540.0, 1.5));
    // Rough, so that all angles see it.
    let target = bench.tissue(Tissue { roughness: 1.0, ..silent(1540.0, 1.7) });
    bench.add(target, 1, post(glam::DVec3::ZERO, &probe, 128, 40.0, 0.4));
    let scene = bench.scene().unwrap();
    let width = |angles: u32| {
        let mut rig = Rig::new(&scene, &probe, &settings(compounded(angles)));
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        let (w, h) = (frame.width as usize, frame.height as usize);
        let brightest = (0..w * h).max_by_key(|&i| frame.bmode[i]).unwrap();
        let row = &frame.bmode[brightest / w * w..][..w];
        let half = f64::from(row[brightest % w]) - 6.0206 * 255.0 / RANGE_DB;
        // Width of the row above half of the amplitude, between pixels.
        let above = |range: &mut dyn Iterator<Item = usize>| {
            let mut last = brightest % w;
            for i in range {
                if f64::from(row[i]) < half {
                    let (inner, outer) = (f64::from(row[last]), f64::from(row[i]));
                    return last.abs_diff(brightest % w) as f64 + (inner - half) / (inner - outer);
                }
                last = i;
            }
            f64::NAN
        };
        above(&mut (brightest % w + 1..w)) + above(&mut (0..brightest % w).rev())
    };
    assert_part(width(9), width(1), 0.15, "width of a point");

    // Behind a plate, the shadow of nine angles ends in a cone: its core is shallower than the straight shadow's.
    let mut bench = Bench::new(Tissue { attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) });
    let opaque = bench.tissue(Tissue { attenuation_db_cm_mhz: 60.0, ..grainy(0.0, 0.0) });
    bench.add(opaque, 1, super::bench::slab(0.0, 4.0, 15.0, 17.0));
    let scene = bench.scene().unwrap();
    let level = |angles: u32, depth: [f64; 2]| {
        let mut look = settings(compounded(angles));
        look.effects = look.effects.with(Effect::Aperture, Choice::Off);
        let mut rig = Rig::new(&scene, &probe, &look);
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        10.0 * mean_square(amplitudes(&frame, [0.49, 0.51], depth).into_iter()).log10()
    };
    let (near, far) = ([0.26, 0.3], [0.8, 0.9]);
    assert!(level(1, near) < -45.0 && level(1, far) < -45.0, "one angle: {} {}", level(1, near), level(1, far));
    assert!(level(9, near) < -40.0 && level(9, far) > -25.0, "nine: {} {}", level(9, near), level(9, far));
}

#[test]
fn noise_is_rayleigh_and_rises_as_the_gain_says() {
    let scene = block(silent(1540.0, 1.5));
    let probe = probe();
    let noise_db = -70.0;
    let mut look = settings(LookSettings::default());
    look.receiver = ReceiverSettings { noise_db, ..ReceiverSettings::default() };
    look.effects = look.effects.with(Effect::Noise, Choice::On);
    (look.image.gain_db, look.image.tgc_db_per_cm) = (20.0, 4.0);
    let mut rig = Rig::new(&scene, &probe, &look);
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let samples = probe.sample_count() as usize;
    let envelope: Vec<f64> = (0..probe.scanlines)
        .flat_map(|l| rig.line(&frame, l)[40..samples - 40].iter().map(|&s| magnitude(s)))
        .collect();
    assert!((snr(&envelope) - 1.913).abs() < 0.05, "{}", snr(&envelope));
    let level_db = 10.0 * mean_square(envelope.iter().copied()).log10();
    assert!((level_db - noise_db).abs() < 0.2, "{level_db}");
    // On the display, by depth: mean level of Rayleigh noise in dB is 2.51 dB below its power.
    for part in [0.15, 0.4, 0.65, 0.9] {
        let (w, h) = (frame.width as usize, frame.height as usize);
        let row = (part * h as f64) as usize;
        let inside: Vec<f64> = (row..row + 12)
            .flat_map(|y| (0..w).map(move |x| y * w + x))
            .filter(|&i| frame.mask[i] == 255)
            .map(|i| (f64::from(frame.bmode[i]) / 255.0 - 1.0) * RANGE_DB)
            .collect();
        let mean_db = inside.iter().sum::<f64>() / inside.len() as f64;
        let depth_cm = (rig.sector().corner_mm.y + (row as f64 + 6.0) * rig.sector().pixel_mm) / 10.0;
        let expected_db = noise_db + 20.0 + 4.0 * depth_cm - 2.51;
        assert!((mean_db - expected_db).abs() < 0.5, "{depth_cm:.1} cm: {mean_db:.2} dB, expected {expected_db:.2}");
    }
    // Another time, other noise; the same time, the same.
    let again = rig.frame(&at(0.0, 0.0, 0.0));
    assert!(again.lines == frame.lines);
    rig.set_time_s(0.04);
    assert!(rig.frame(&at(0.0, 0.0, 0.0)).lines != frame.lines);
}

#[test]
fn harmonics_lose_twice_the_loss_at_f_out_and_that_at_2f_back() {
    let alpha = 0.7;
    let scene = block(Tissue { attenuation_db_cm_mhz: alpha, attenuation_exponent: 1.1, ..grainy(0.0, 0.01) });
    let slope_db_cm = |harmonics: bool| {
        let probe = Probe { harmonics, frequency_mhz: 3.0, ..probe() };
        let mut rig = Rig::new(&scene, &probe, &settings(LookSettings::default()));
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        let level = |from: usize| {
            let band = (8..248).flat_map(|l| rig.line(&frame, l)[from..from + 200].iter().map(|&s| magnitude(s)));
            10.0 * mean_square(band).log10()
        };
        let apart_cm = 1000.0 * probe.sample_spacing_mm() / 10.0;
        (level(200) - level(1200)) / apart_cm
    };
    let at_mhz = |f: f64| alpha * f.powf(1.1);
    assert_part(slope_db_cm(false), 2.0 * at_mhz(3.0), 0.05, "fundamental");
    assert_part(slope_db_cm(true), 2.0 * at_mhz(3.0) + at_mhz(6.0), 0.05, "harmonic");
}

#[test]
fn texture_leaves_speckle_rayleigh_and_varies_at_its_scale() {
    let tissue = Tissue { attenuation_db_cm_mhz: 0.0, cloud_db: 3.0, cloud_mm: 8.0, ..grainy(0.0, 0.01) };
    let scene = block(tissue);
    let mut look = settings(LookSettings::default());
    look.effects = look.effects.with(Effect::Texture, Choice::On);
    let mut means = Vec::new();
    let mut snrs = Vec::new();
    // Several places of the texture; windows of 2 mm, a quarter of its scale.
    for place in 0..12 {
        let mut rig = Rig::new(&scene, &probe(), &look);
        let frame = rig.frame(&at(17.0 * f64::from(place), 9.0 * f64::from(place), -60.0 + 11.0 * f64::from(place)));
        for line in (16..240).step_by(14) {
            for from in (100..1400).step_by(120) {
                let window: Vec<f64> = (line..line + 7)
                    .flat_map(|l| rig.line(&frame, l)[from..from + 40].iter().map(|&s| magnitude(s)))
                    .collect();
                means.push(10.0 * mean_square(window.iter().copied()).log10());
                let norm = mean_square(window.iter().copied()).sqrt();
                snrs.extend(window.iter().map(|v| v / norm));
            }
        }
    }
    // Windows hold few speckles, so that their own power varies, too: that of a uniform block is taken off.
    let uniform = {
        let scene = block(Tissue { attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) });
        let mut rig = Rig::new(&scene, &probe(), &settings(LookSettings::default()));
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        let windows = (16..240).step_by(14).flat_map(|line| (100..1400).step_by(120).map(move |from| (line, from)));
        let level = |(line, from): (u32, usize)| {
            let window =
                (line..line + 7).flat_map(|l| rig.line(&frame, l)[from..from + 40].iter().map(|&s| magnitude(s)));
            10.0 * mean_square(window).log10()
        };
        windows.map(level).collect::<Vec<_>>()
    };
    let variance = |v: &[f64]| {
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / v.len() as f64
    };
    let contrast_db = (variance(&means) - variance(&uniform)).sqrt();
    println!("contrast {contrast_db:.2} dB of 3, SNR within windows {:.3}", snr(&snrs));
    assert!((contrast_db - 3.0).abs() < 0.6, "{contrast_db}");
    assert!((snr(&snrs) - 1.913).abs() <= 0.05, "SNR {}", snr(&snrs));
}
