//! Comparison of every pass on the device with its f64 twin on the CPU; damaged passes must fail it.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod across;
mod batches;
mod compare;
mod compare_motion;
mod hang;
mod host;
mod image_on_host;
mod many;
mod moving;
mod multiples;
mod needle;
mod reconfigure;
mod scenes;
mod trace_by;

use across::assert_alike;
use compare::{PASSES, compare};
use insonify::render::{Choice, Effect, Frame, ShaderSet, twin};
use insonify::transducer::Probe;
use scenes::{Case, RENDERED, cases, lifted, nested};

#[test]
fn every_pass_is_its_twin() {
    let mut wrong = Vec::new();
    for case in RENDERED.iter() {
        println!("--- {}", case.name);
        assert_eq!(case.snapshot.overflows, 0, "{}", case.name);
        wrong.extend(PASSES.iter().filter_map(|pass| compare(pass, &case.snapshot).err()).map(|e| (case.name, e)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Groups of effects that are switched off together.
const WITHOUT: [&[Effect]; 5] = [
    &[Effect::Refraction, Effect::Attenuation],
    &[Effect::InterfaceEchoes, Effect::SpeedDisplacement],
    &[Effect::Roughness, Effect::Thickness, Effect::FrequencyExponent, Effect::Scatterers],
    &[Effect::Reflections, Effect::Rays, Effect::Layers],
    &[Effect::ElevationalSpeckle],
];

#[test]
fn without_some_effects_every_pass_is_its_twin() {
    let mut wrong = Vec::new();
    for group in WITHOUT {
        let mut case = nested();
        for &effect in group {
            case.settings.effects = case.settings.effects.with(effect, Choice::Off);
        }
        let snapshot = case.renderer(&ShaderSet::default()).snapshot(&case.pose).unwrap();
        println!("--- without {group:?}");
        // Without interface echoes there is nothing to compare.
        let compared = |pass: &&&str| **pass != "echo" || !group.contains(&Effect::InterfaceEchoes);
        let wrong_here = PASSES.iter().filter(compared).filter_map(|pass| compare(pass, &snapshot).err());
        wrong.extend(wrong_here.map(|e| (group, e)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn every_angle_of_a_compounded_frame_is_its_twin() {
    let mut wrong = Vec::new();
    for mut case in [lifted(), cases().swap_remove(1)] {
        (case.settings.look.angles, case.settings.look.span_deg) = (3, 22.0);
        for mut renderer in [case.renderer(&ShaderSet::default()), case.host_renderer()] {
            let straight = renderer.snapshot(&case.pose).unwrap();
            for look in 0..3 {
                let snapshot = renderer.snapshot_of_angle(&case.pose, look).unwrap();
                assert_eq!(snapshot.bmode == straight.bmode, look == 2, "{}: look {look}", case.name);
                assert_eq!(snapshot.segmentation, straight.segmentation, "maps are straight");
                wrong.extend(
                    PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (case.name, look, e)),
                );
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_snapshot_is_the_frame() {
    for case in RENDERED.iter() {
        assert_eq!(case.frame.bmode, case.snapshot.bmode, "{}", case.name);
        assert_eq!(case.frame.segmentation, case.snapshot.segmentation, "{}", case.name);
        let levels: Vec<f64> = case.frame.attenuation.iter().map(|&a| a.into()).collect();
        assert_eq!(levels, case.snapshot.attenuation, "{}", case.name);
        let lines: Vec<_> = case.frame.lines.iter().map(|&[re, im]| glam::DVec2::new(re.into(), im.into())).collect();
        assert_eq!(lines, case.snapshot.lines, "{}", case.name);
    }
}

#[test]
fn from_pose_to_image_the_twins_show_the_same() {
    for case in RENDERED.iter() {
        let twin = twin::frame(&case.snapshot.inputs);
        let inside: Vec<usize> = (0..twin.grey.len()).filter(|&i| case.frame.mask[i] == 255).collect();
        let mut errors: Vec<f64> =
            inside.iter().map(|&i| (f64::from(case.frame.bmode[i]) - twin.grey[i]).abs()).collect();
        errors.sort_by(f64::total_cmp);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let p99 = errors[errors.len() * 99 / 100];
        let mean_level = inside.iter().map(|&i| twin.grey[i]).sum::<f64>() / errors.len() as f64;
        let other = inside.iter().filter(|&&i| case.frame.segmentation[i] != twin.segmentation[i]).count();
        let level = inside.iter().map(|&i| (f64::from(case.frame.attenuation[i]) - twin.attenuation[i]).abs());
        let level = level.sum::<f64>() / errors.len() as f64;
        println!(
            "{}: grey {mean_level:.1}, off by {mean:.3}, p99 {p99:.2}; {other} pixels of another tissue; attenuation off by {level:.1e}",
            case.name
        );
        assert!(mean_level > 20.0, "{}: a black image proves nothing", case.name);
        assert!(mean < 1.0 && p99 < 4.0, "{}: mean {mean}, p99 {p99}", case.name);
        assert!((other as f64) < 0.005 * inside.len() as f64, "{}: {other} pixels", case.name);
        assert!(level < 1.0e-3, "{}: {level}", case.name);
    }
}

/// At most one damage per pass: description, pass, source text and its replacement.
type Damages = &'static [(&'static str, &'static str, &'static str, &'static str)];

/// Sets of damages. Passes are compared on the device's own inputs, so one renderer can have a damage in each pass.
const DAMAGES: [Damages; 5] = [
    &[
        (
            "surfaces are never left",
            "locate",
            "select(inside[word] & ~bit, inside[word] | bit, value)",
            "inside[word] | bit",
        ),
        ("Fresnel without the cosine beyond", "trace", "let b = z1 * cos_transmitted;", "let b = z1;"),
        ("layers add in amplitude", "transmission", "(mean * mean) * (mean * mean)", "mean"),
        (
            "the second obstacle is not met",
            "propagate",
            "field[cell] = times(field[cell], transmissions[plane * cells + cell])",
            "field[cell] += 0.0 * times(field[cell], transmissions[plane * cells + cell])",
        ),
        ("one way only", "beams", "dot(sent, sent) * dot(heard, heard)", "dot(sent, sent)"),
        ("profiles of another power", "profiles", "sqrt(kernel_power /", "(kernel_power /"),
        ("the plane before an obstacle", "visibility", "(1.0 - followed) * last", "last"),
        ("sign of the phase", "march", "phasor(-params", "phasor(params"),
        ("an echo overwrites its sample", "echo", "+= echoed", "= echoed"),
        (
            "the beam is off by a scanline",
            "lateral",
            "let other = mirrored(i32(line) + tap);",
            "let other = mirrored(i32(line) + tap + 1);",
        ),
        ("all of the face shows its reverberation", "receive", "(1.0 - exp(0.5 * ln_passed))", "1.0"),
        ("half of the TGC", "detect", "params.tgc_db_per_mm *", "0.5 * params.tgc_db_per_mm *"),
        ("priority ignored", "section", "firstLeadingBit(inside[word])", "firstTrailingBit(inside[word])"),
        ("another percentile", "percentile", "BRIGHTEST_PART: f32 = 0.02", "BRIGHTEST_PART: f32 = 0.05"),
        ("segmentation off by one", "scan_convert", "tissue + FIRST_TISSUE", "tissue + 2u"),
    ],
    &[
        ("inside out", "locate", "select(0u, 1u, hit.facing > 0)", "select(1u, 0u, hit.facing > 0)"),
        (
            "one-way attenuation",
            "trace",
            "ln_amplitude -= tissue.attenuation_np_mm * t",
            "ln_amplitude -= 0.5 * tissue.attenuation_np_mm * t",
        ),
        ("rows not over their greatest cell", "transmission", "value.x * (1.0 / best)", "value.x"),
        ("a spectrum in another order", "propagate", "reverseBits(k) >> shift", "k"),
        ("scatterers of all depths within the same reach", "profiles", "reaches[plane].x", "reaches[0].x"),
        ("beams not interpolated", "visibility", "node - f32(low)", "0.0"),
        ("phase of the sample, not of its scatterer", "march", "(position.range_mm + ahead_mm)", "(position.range_mm)"),
        ("echoes a sample too deep", "echo", "i32(before) - 1, value", "i32(before), value"),
        (
            "weights of a kernel and two profiles not made up for",
            "lateral",
            "sqrt(kernel_power / max(power, 0.5 * kernel_power))",
            "1.0",
        ),
        (
            "the pulse a sample late",
            "detect",
            "at[i] += pair.xy * taps[4 - i] + pair.zw * taps[5 - i];",
            "at[i] += pair.xy * taps[5 - i] + pair.zw * taps[5 - i];",
        ),
        ("two-way attenuation in the map", "section", "ONE_WAY * tissues[here]", "tissues[here]"),
        ("a fan's area as a rectangle's", "percentile", "t * (0.5 * t + params.face_radius_mm)", "t"),
        ("nearest sample", "scan_convert", "fract(level)", "0.0"),
    ],
    &[
        ("crossings beyond the face count", "locate", "crossing_count = behind;", "crossing_count = found;"),
        ("sound speed ignored in travel time", "trace", "let passed_mm = t / path_per_range", "let passed_mm = t"),
        ("reflected paths pass", "transmission", "return reflected_np +", "return 0.0 * reflected_np +"),
        ("no end of the array", "propagate", "face[cell] * wave", "wave"),
        ("the receive beam of the face", "beams", "(plane + 1u) * aperture.modes", "aperture.modes"),
        (
            "shared loss once too often",
            "visibility",
            "shared_np += row_np[interval]",
            "shared_np += 1.1 * row_np[interval]",
        ),
        ("the aperture's gain as an amplitude", "march", "exp(2.0 * (clamp", "exp((clamp"),
        ("carrier f/c in place of 2f/c", "echo", "params.phase_turns_per_mm", "0.5 * params.phase_turns_per_mm"),
        ("mirror image in phase", "lateral", "vec4<f32>(-pair.y, pair.x, -pair.w, pair.z)", "pair"),
        (
            "one side of the beam",
            "lateral",
            "select(0.0, kernel, there)",
            "select(0.0, kernel, there && at >= params.lateral_half)",
        ),
        ("decibels of power as of amplitude", "detect", "DB_A_DOUBLING * log2", "6.02059991328 * log2"),
        ("attenuation from the face in each run", "section", "rate * (t - start)", "rate * t"),
        ("depth beyond the runs forgotten", "percentile", "f32(params.map_rays)", "f32(params.scanlines)"),
        ("attenuation not normalised", "scan_convert", "percentile[0]", "0.0"),
    ],
    &[
        ("sheets of scatterers of other weights", "march", "let weight = bell * bell;", "let weight = bell;"),
        (
            "every echo midway between samples",
            "echo",
            "mix(delays[low], delays[low + 1u], step - f32(low))",
            "delays[DELAY_STEPS / 2u]",
        ),
        ("levels midway like those at the samples", "detect", "pair.xy * taps_midway[4 - i]", "pair.xy * taps[4 - i]"),
        ("the first scatterer of a cell", "march", "abs(along_mm) < abs(ahead_mm)", "quarter == 0u"),
        ("neighbours of a scanline in the shadow as loud", "lateral", "min(own / carried, NEIGHBOUR_GAIN_MAX)", "1.0"),
        ("reflections of a pair of samples", "march", "select(0.0, own.x + own.y, pair == 0u)", "own.x + own.y"),
        ("delays of the axial path alone", "transmission", "return own.x +", "return 0.0 * own.x +"),
        (
            "a profile of the plane before",
            "profiles",
            "between(plane, low, part, whole - 1)",
            "between(plane, low, part, whole)",
        ),
        ("bones delay what is seen past them", "trace", "range_mm += behind_mm;", "range_mm += 0.0 * behind_mm;"),
        (
            "gains of blocks a block late",
            "visibility",
            "(f32(block << BLOCK_SHIFT) + 0.5)",
            "(f32((block + 1u) << BLOCK_SHIFT) + 0.5)",
        ),
        ("attenuation in eight bits", "scan_convert", "ROOT_STEPS * root + 0.5", "257.0 * floor(255.0 * root + 0.5)"),
        ("a run late", "section", "return low;", "return min(low + 1u, entry_counts[ray] - 1u);"),
    ],
    &[(
        "reflected echoes of neighbours are hidden",
        "lateral",
        "max(by_gain, kernel_at(block, at, projection) * of_kernel * ratio)",
        "by_gain",
    )],
];

/// Damages of what passes do where samples are so dense that levels and echoes lie at samples alone.
const DENSE_DAMAGES: Damages = &[
    (
        "echoes a sample too deep",
        "echo",
        "Echo(i32(sample), value",
        "Echo(min(i32(sample) + 1, i32(params.samples) - 1), value",
    ),
    ("the pulse a sample late", "detect", "pair.xy * near.z + pair.zw * near.y", "pair.xy * near.y + pair.zw * near.x"),
];

/// Damages that the comparison of their pass with its twin doesn't notice.
fn missed(case: &Case, damages: Damages, as_gpu: bool) -> Vec<String> {
    let mut shaders = ShaderSet::default();
    shaders.as_gpu = as_gpu;
    for (what, pass, from, to) in damages {
        assert!(shaders.replace(pass, from, to), "{pass} has no `{from}` to damage ({what})");
    }
    let snapshot = case.renderer(&shaders).snapshot(&case.pose).unwrap();
    let passed = damages.iter().filter(|(_, pass, ..)| compare(pass, &snapshot).is_ok());
    passed.map(|(what, pass, ..)| format!("{pass}: {what}")).collect()
}

#[test]
fn a_damaged_pass_is_caught() {
    let case = nested();
    assert_eq!(case.probe.levels_per_sample(), 2);
    let sets = DAMAGES.into_iter().enumerate();
    let mut missed: Vec<String> = sets.flat_map(|(set, damages)| self::missed(&case, damages, set % 2 == 1)).collect();
    let dense = Case { probe: Probe { samples: 1023.into(), ..case.probe }, ..case };
    assert_eq!(dense.probe.levels_per_sample(), 1);
    for as_gpu in [false, true] {
        missed.extend(self::missed(&dense, DENSE_DAMAGES, as_gpu));
    }
    assert!(missed.is_empty(), "not caught: {missed:#?}");
}

#[test]
fn some_of_many_paths_follow_reflections_as_in_the_twin() {
    let mut case = nested();
    (case.settings.quality.rays, case.settings.quality.layers, case.settings.reflecting_share) = (16, 3, 0.5);
    assert_eq!(case.settings.reflecting_paths(), 24);
    for mut renderer in [case.renderer(&ShaderSet::default()), case.host_renderer()] {
        let snapshot = renderer.snapshot(&case.pose).unwrap();
        let wrong: Vec<_> = PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).collect();
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
    let damages = [
        ("a reflected path stands for itself alone", "ln_share = 0.5 * log", "ln_share = 0.0 * log"),
        ("all paths follow reflections", "% paths < params.reflecting_paths;", "% paths < paths;"),
    ];
    for (what, from, to) in damages {
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace("trace", from, to), "no `{from}` to damage");
        let snapshot = case.renderer(&shaders).snapshot(&case.pose).unwrap();
        assert!(compare("trace", &snapshot).is_err(), "not caught: {what}");
    }
}

#[test]
fn software_makes_the_same_by_echo_and_section_of_a_gpu() {
    for case in [cases().swap_remove(0), nested(), lifted()] {
        let rendered = RENDERED.iter().find(|r| r.name == case.name).unwrap();
        let mut shaders = ShaderSet::default();
        shaders.as_gpu = true;
        let snapshot = case.renderer(&shaders).snapshot(&case.pose).unwrap();
        assert!(snapshot == rendered.snapshot, "{}", case.name);
    }
}

#[test]
fn places_of_another_angle_are_caught() {
    let mut case = nested();
    (case.settings.look.angles, case.settings.look.span_deg) = (3, 22.0);
    let mut shaders = ShaderSet::default();
    assert!(shaders.replace("trace", "angle * params.layers + params.layer_first", "params.layer_first"));
    let mut renderer = case.renderer(&shaders);
    // The straight look's places come first.
    assert!(compare("trace", &renderer.snapshot(&case.pose).unwrap()).is_ok());
    assert!(compare("trace", &renderer.snapshot_of_angle(&case.pose, 0).unwrap()).is_err());
}

#[test]
fn frames_are_the_same_from_run_to_run_and_with_every_index_checked() {
    for case in [cases().swap_remove(0), nested()] {
        let rendered = RENDERED.iter().find(|r| r.name == case.name).unwrap();
        // Another renderer of the same pipelines, bit for bit.
        let (mut renderer, mut frame) = (case.renderer(&ShaderSet::default()), Frame::default());
        for run in 0..2 {
            renderer.render(&case.pose, &mut frame).unwrap();
            let bits = |frame: &Frame| -> Vec<u32> {
                let lines = frame.lines.iter().flatten();
                lines.chain(&frame.attenuation).map(|v| v.to_bits()).chain([frame.attenuation_p98.to_bits()]).collect()
            };
            assert!(bits(&frame) == bits(&rendered.frame), "{}, run {run}", case.name);
            assert!(frame.bmode == rendered.frame.bmode, "{}, run {run}", case.name);
            assert!(frame.segmentation == rendered.frame.segmentation, "{}, run {run}", case.name);
        }
        // Other pipelines, with every index checked: no pass reads or writes beyond its buffers.
        let mut checked = ShaderSet::default();
        checked.bounds_checks = true;
        case.renderer(&checked).render(&case.pose, &mut frame).unwrap();
        assert_alike(&frame, &rendered.frame, case.name);
    }
}
