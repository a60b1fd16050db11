//! The pass `trace` by lanes of a subgroup finds the same paths as by single threads.

use std::sync::LazyLock;

use insonify::render::{Backend, Quality, RenderError, Renderer, ShaderSet, Snapshot, TestHooks, TraceBy};

use crate::twins::DAMAGES;
use crate::twins::compare::compare;
use crate::twins::moving::{TIME_S, beating};
use crate::twins::scenes::{Case, DEVICE, RENDERED, cases, nested};

/// The device, tracing by lanes; `None` if its subgroups don't fit.
static BY_LANES: LazyLock<Option<Backend>> = LazyLock::new(|| {
    let fit = DEVICE.has_trace_by_lanes();
    println!("{}: lanes of a subgroup {} share a path", *DEVICE, if fit { "can" } else { "can't" });
    assert!(fit || !DEVICE.name().contains("llvmpipe"), "software Vulkan has subgroups of eight");
    fit.then(|| DEVICE.clone().tracing_by(TraceBy::Lanes).unwrap())
});

/// Shaders in which 4 lanes share a path, so that a subgroup of 8 has two paths.
fn of_four_lanes() -> ShaderSet {
    let mut shaders = ShaderSet::default();
    assert!(shaders.replace("trace", "PATH_LANES: u32 = 8u", "PATH_LANES: u32 = 4u"));
    shaders
}

fn renderer_by(case: &Case, backend: &Backend, shaders: &ShaderSet) -> Renderer {
    case.renderer_on(backend, &TestHooks { shaders: shaders.clone(), ..TestHooks::default() })
}

fn by_lanes(case: &Case, shaders: &ShaderSet) -> Option<Snapshot> {
    let backend = BY_LANES.as_ref()?;
    Some(renderer_by(case, backend, shaders).snapshot(&case.pose).unwrap())
}

/// Checks that two variants of `trace` agree: bit for bit in software; a GPU's compiler may round two shaders
/// differently.
fn check_same(together: &Snapshot, alone: &Snapshot, what: &str) {
    compare("trace", together).unwrap();
    assert!(!DEVICE.name().contains("llvmpipe") || together == alone, "{what}");
}

#[test]
fn lanes_find_the_paths_of_single_threads_bit_for_bit() {
    for case in cases() {
        let alone = &RENDERED.iter().find(|rendered| rendered.name == case.name).unwrap().snapshot;
        for shaders in [ShaderSet::default(), of_four_lanes()] {
            let Some(together) = by_lanes(&case, &shaders) else { return };
            check_same(&together, alone, case.name);
        }
    }
}

#[test]
fn lanes_find_the_paths_of_single_threads_at_every_quality() {
    let mut case = nested();
    for (rays, layers, reflections_max) in [(1, 1, 4), (2, 5, 4), (13, 1, 1), (32, 3, 4)] {
        case.settings.quality = Quality { rays, layers, seed: rays };
        case.settings.reflections_max = reflections_max;
        let Some(together) = by_lanes(&case, &ShaderSet::default()) else { return };
        let alone = case.renderer(&ShaderSet::default()).snapshot(&case.pose).unwrap();
        assert!(alone.paths.iter().any(|path| path.segments.iter().any(|segment| segment.has_reflected)));
        check_same(&together, &alone, &format!("{rays} rays, {layers} layers"));
    }
}

#[test]
fn lanes_find_the_paths_of_single_threads_in_a_scene_that_moves() {
    let Some(backend) = BY_LANES.as_ref() else { return };
    let case = beating();
    let [together, alone] = [backend, &*DEVICE].map(|backend| {
        let mut renderer = renderer_by(&case, backend, &ShaderSet::default());
        renderer.set_time_s(TIME_S);
        renderer.snapshot(&case.pose).unwrap()
    });
    check_same(&together, &alone, case.name);
}

#[test]
fn a_damaged_trace_by_lanes_is_caught() {
    let case = nested();
    let wrong: [(&str, &str, &str, &str); 3] = [
        ("a child is never tested", "trace", "for (var child = own_lane;", "for (var child = max(own_lane, 1u);"),
        ("triangles of the first lane alone", "trace", "var found = vote(there);", "var found = vote(there) & 1u;"),
        (
            "the first lane's triangle is the nearest",
            "trace",
            "first_lane + firstTrailingBit(vote(met && hit.t == least))",
            "first_lane",
        ),
    ];
    let of_trace = DAMAGES.iter().copied().flatten().chain(&wrong).filter(|(_, pass, ..)| *pass == "trace");
    let mut missed: Vec<&str> = Vec::new();
    for (what, pass, from, to) in of_trace {
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace(pass, from, to), "{pass} has no `{from}` to damage ({what})");
        let Some(snapshot) = by_lanes(&case, &shaders) else { return };
        missed.extend(compare("trace", &snapshot).is_ok().then_some(*what));
    }
    assert!(missed.is_empty(), "not caught: {missed:#?}");
}

#[test]
fn a_device_says_how_it_traces() {
    let case = nested();
    let built = |backend: &Backend| -> Result<Renderer, RenderError> {
        Renderer::new(backend, &case.scene, &case.probe, &case.settings)
    };
    let alone = Backend::open(insonify::render::BackendChoice::Device).unwrap().tracing_by(TraceBy::Path).unwrap();
    assert_eq!(alone.trace().unwrap(), "path");
    assert!(alone.to_string().ends_with(", trace by path"));
    let Some(together) = BY_LANES.as_ref() else {
        let error = alone.tracing_by(TraceBy::Lanes).unwrap_err().to_string();
        assert!(error.contains("can't trace by lanes") && error.contains("INSONIFY_TRACE"), "{error}");
        return;
    };
    built(together).unwrap();
    assert_eq!(together.trace().unwrap(), "lanes");
    let again = together.reopen().unwrap();
    assert_eq!(again.trace().unwrap(), "lanes", "a device that is opened again keeps its way");
}
