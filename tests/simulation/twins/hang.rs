//! Tests of a device that does not answer in time.

use std::time::Duration;

use insonify::render::{Backend, BackendChoice, BackendError, Frame, Quality, RenderError, Renderer};

use crate::twins::scenes::nested;

#[test]
fn a_frame_that_takes_too_long_is_given_up_and_the_device_opened_again() {
    let mut case = nested();
    // No device has so many paths done in ten microseconds, the limit of a first frame.
    case.settings.quality = Quality { rays: 64, layers: 3, ..case.settings.quality };
    // A new renderer makes a frame, so that the first one that is asked for isn't late.
    let built = |backend: &Backend| Renderer::new(backend, &case.scene, &case.probe, &case.settings).map(|_| ());
    let device = Backend::open(BackendChoice::Device).unwrap().answering_within(Duration::from_micros(1));
    for attempt in ["the first frame", "no later one is trusted", "another renderer"] {
        let error = built(&device).unwrap_err();
        let RenderError::Backend(error) = &error else { panic!("{attempt}: {error}") };
        assert!(matches!(error, BackendError::Hung { .. } | BackendError::Lost { .. }), "{attempt}: {error:?}");
        assert!(error.to_string().contains("did not answer within 0.00001 s"), "{attempt}: {error}");
    }
    let again = device.reopen().unwrap();
    drop(device);
    let error = built(&again).unwrap_err().to_string();
    assert!(error.contains("did not answer"), "a device that is opened again keeps its limit: {error}");
    let patient = again.reopen().unwrap().answering_within(Duration::from_secs(60));
    let mut renderer = Renderer::new(&patient, &case.scene, &case.probe, &case.settings).unwrap();
    let mut frame = Frame::default();
    renderer.render(&case.pose, &mut frame).unwrap();
    assert!(frame.bmode.iter().any(|&grey| grey > 0), "pictures again");
}
