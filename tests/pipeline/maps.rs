//! Maps of frames are rendered only while somebody reads them.

use super::*;

/// Numbers of the frames that had maps. Checks that the maps belong to their frame.
fn frames_with_maps(
    clock: &Arc<dyn Clock>,
    generators: Option<Box<dyn FrameGenerators>>,
    seconds: u32,
    mut each: impl FnMut(u64, &AtomicBool, &tokio::sync::mpsc::Sender<Control>) + Send + 'static,
) -> Vec<u64> {
    let with_maps = Arc::<Mutex<Vec<u64>>>::default();
    let wanted = Arc::new(AtomicBool::new(false));
    let (sender, controls) = tokio::sync::mpsc::channel(4);
    let (kept, asked) = (with_maps.clone(), wanted.clone());
    let take = move |frame: &PresentedFrame| {
        assert_eq!(frame.segmentation.len(), frame.attenuation.len());
        assert_eq!([frame.image.len(), frame.mask.len()], [PIXELS; 2]);
        if !frame.segmentation.is_empty() {
            let x = frame.info.pose().map(|pose| pose.position_mm.x as f32);
            assert!(frame.attenuation.iter().all(|&a| Some(a) == x), "another frame's maps: {}", frame.number);
            kept.lock().unwrap().push(frame.number);
        }
        each(frame.number, &asked, &sender);
        Ok(())
    };
    let maps: MapsWanted = Arc::new(move || wanted.load(Ordering::Relaxed));
    let overlay = Box::new(Sink { name: "overlay", maps: Some(maps), take });
    let limits = Limits { duration: Some(seconds * SECOND), frames: None };
    let points = generators.is_some().then(with_generator);
    Session { controls, generators, limits, points, sinks: vec![overlay], ..Session::new(clock, moving) }.run();
    std::mem::take(&mut *with_maps.lock().unwrap())
}

#[test]
fn maps_are_rendered_while_somebody_reads_them() {
    let _guard = beside_others();
    let clock = clock();
    // An overlay that is shown from frame 50 to frame 120.
    let with_maps = frames_with_maps(&clock, None, 10, |number, wanted, _| {
        wanted.store((50..120).contains(&number), Ordering::Relaxed);
    });
    let (first, last) = (with_maps[0], *with_maps.last().unwrap());
    assert!((51..=53).contains(&first) && (120..=122).contains(&last), "{first}..={last}");
    assert_eq!(with_maps.len() as u64, last - first + 1, "{with_maps:?}");
}

#[test]
fn maps_are_rendered_while_the_generator_is_at_work() {
    let _guard = beside_others();
    let clock = Arc::new(SimulatedClock::new()) as Arc<dyn Clock>;
    let read = Arc::<AtomicU64>::default();
    let (runs, clock_of_run) = (read.clone(), clock.clone());
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        assert_eq!([frame.segmentation.len(), frame.attenuation.len()], [PIXELS; 2], "a generator without its maps");
        runs.fetch_add(1, Ordering::Relaxed);
        clock_of_run.sleep_until(clock_of_run.now() + 10 * MS);
        out.resize(PIXELS, 200);
        Ok(())
    };
    let generators = Some(translate(work));
    let with_maps = frames_with_maps(&clock, generators, 10, |number, _, sender| match number {
        50 => sender.try_send(Control::set("generator", false)).unwrap(),
        120 => sender.try_send(Control::set("generator", true)).unwrap(),
        _ => {}
    });
    assert!(with_maps.contains(&0) && with_maps.contains(&50) && with_maps.contains(&199));
    let without: Vec<u64> = (0..200).filter(|number| !with_maps.contains(number)).collect();
    assert!(without.len() >= 65 && without[0] > 50 && *without.last().unwrap() <= 123, "{without:?}");
    assert!(read.load(Ordering::Relaxed) > 100);
}

#[test]
fn maps_are_not_rendered_while_a_generator_that_failed_is_left() {
    let _guard = beside_others();
    let clock = Arc::new(SimulatedClock::new()) as Arc<dyn Clock>;
    let clock_of_run = clock.clone();
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        assert_eq!([frame.segmentation.len(), frame.attenuation.len()], [PIXELS; 2], "a generator without its maps");
        out.resize(PIXELS, 200);
        match (2 * SECOND..4 * SECOND).contains(&clock_of_run.now()) {
            true => Err(GenerateError::Failed("pixel 7 is NaN".to_owned())),
            false => Ok(()),
        }
    };
    let with_maps = frames_with_maps(&clock, Some(translate(work)), 80, |_, _, _| {});
    let without: Vec<u64> = (0..1600).filter(|number| !with_maps.contains(number)).collect();
    // 20 frames/s: three runs fail from frame 40 on, and the generator is left for a minute.
    assert!(with_maps.contains(&0) && with_maps.contains(&1599), "{with_maps:?}");
    assert!((42..=46).contains(&without[0]) && (1240..=1400).contains(without.last().unwrap()), "{without:?}");
    assert_eq!(without.len() as u64, 1 + without.last().unwrap() - without[0], "without a gap");
}

#[test]
fn a_generator_of_the_image_alone_makes_nobody_render_maps() {
    struct OfTheImage(Arc<AtomicU64>);
    impl FrameGenerators for OfTheImage {
        fn name(&self, _: usize) -> &str {
            "of the image"
        }

        fn compute_device(&self) -> ComputeDevice {
            gpu(2)
        }

        fn reads_maps(&self, _: usize) -> bool {
            false
        }

        fn generate(&mut self, _: usize, frame: &Frame, out: &mut Vec<u8>) -> Result<(), GenerateError> {
            self.0.fetch_add(1, Ordering::Relaxed);
            out.resize(frame.bmode.len(), 200);
            Ok(())
        }

        fn terminator(&self) -> Option<Terminator> {
            None
        }
    }
    let _guard = beside_others();
    let clock = Arc::new(SimulatedClock::new()) as Arc<dyn Clock>;
    let runs = Arc::<AtomicU64>::default();
    let generators = Box::new(OfTheImage(runs.clone()));
    let with_maps = frames_with_maps(&clock, Some(generators), 10, |number, wanted, _| {
        wanted.store((50..70).contains(&number), Ordering::Relaxed);
    });
    assert!(with_maps[0] > 50 && with_maps.len() <= 22, "an overlay's alone: {with_maps:?}");
    assert_eq!(runs.load(Ordering::Relaxed), 200);
}
