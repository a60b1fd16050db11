//! Sink of the window, and the slot that it shares with the event loop.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use winit::event_loop::EventLoopProxy;

use crate::presented::{FrameInfo, FrameSource, PresentedFrame};
use crate::sink::SinkError;
use crate::sink::error::check_shape;
use crate::sink::live::LiveSink;

pub(super) const NAME: &str = "window";

/// Event that tells the event loop that the slot has changed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wake;

/// Contents of a frame that the window shows.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Shown {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixel_mm: f64,
    pub(super) face_row: f64,
    pub(super) image: Vec<u8>,
    pub(super) source: FrameSource,
    pub(super) info: FrameInfo,
    pub(super) latency: Option<Duration>,
    pub(super) generator: String,
    pub(super) notice: String,
}

impl Shown {
    fn copy_from(&mut self, frame: &PresentedFrame) {
        (self.width, self.height) = (frame.width, frame.height);
        (self.pixel_mm, self.face_row) = (frame.pixel_mm, frame.face_row());
        self.image.clone_from(&frame.image);
        (self.source, self.info, self.latency) = (frame.source, frame.info, frame.info.pose_to_present());
        for (to, from) in [(&mut self.generator, &frame.generator), (&mut self.notice, &frame.notice)] {
            to.clear();
            to.push_str(from.as_deref().unwrap_or(""));
        }
    }
}

#[derive(Debug, Default)]
pub(super) struct State {
    newest: Shown,
    fresh: bool,
    dropped: u64,
    pub(super) sink_ended: bool,
    /// Reason why the window has closed; none while it is open.
    pub(super) window_gone: Option<&'static str>,
    pub(super) proxy: Option<EventLoopProxy<Wake>>,
}

/// The newest frame, shared by the sink and the window.
#[derive(Debug, Clone, Default)]
pub struct WindowSlot(Arc<Mutex<State>>);

impl WindowSlot {
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of frames that a newer one replaced before the window had drawn them.
    pub fn dropped(&self) -> u64 {
        self.state().dropped
    }

    /// Swaps `shown` with the newest frame; false if there is no new one.
    pub(super) fn take(&self, shown: &mut Shown) -> bool {
        let mut state = self.state();
        if !std::mem::take(&mut state.fresh) {
            return false;
        }
        std::mem::swap(&mut state.newest, shown);
        true
    }
}

/// Live sink that hands frames to the window.
#[derive(Debug)]
pub struct WindowSink {
    slot: WindowSlot,
    filling: Shown,
}

impl WindowSink {
    /// A sink, and the slot that [`run_on_main_thread`](super::run_on_main_thread) shows.
    pub fn new() -> (Self, WindowSlot) {
        let slot = WindowSlot::default();
        (Self { slot: slot.clone(), filling: Shown::default() }, slot)
    }
}

/// Wakes the event loop, unless it has ended.
fn wake(proxy: Option<&EventLoopProxy<Wake>>) {
    let _ = proxy.map(|proxy| proxy.send_event(Wake));
}

impl LiveSink for WindowSink {
    fn name(&self) -> &str {
        NAME
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        let shape = [frame.height as usize, frame.width as usize];
        check_shape(std::path::Path::new("the window's image"), shape, frame.image.len())?;
        self.filling.copy_from(frame);
        let mut state = self.slot.state();
        if let Some(reason) = state.window_gone {
            return Err(SinkError::Ended { sink: NAME, reason: reason.to_owned() });
        }
        std::mem::swap(&mut state.newest, &mut self.filling);
        if std::mem::replace(&mut state.fresh, true) {
            state.dropped += 1;
        } else {
            wake(state.proxy.as_ref());
        }
        Ok(())
    }
}

impl Drop for WindowSink {
    fn drop(&mut self) {
        let proxy = {
            let mut state = self.slot.state();
            state.sink_ended = true;
            state.proxy.take()
        };
        wake(proxy.as_ref());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u64) -> PresentedFrame {
        PresentedFrame {
            number,
            width: 2,
            height: 2,
            image: vec![number as u8; 4],
            mask: [255; 4].into(),
            generator: Some("MS".into()),
            point: None,
            ..PresentedFrame::default()
        }
    }

    #[test]
    fn the_newest_frame_lies_in_the_slot() {
        let (mut sink, slot) = WindowSink::new();
        let mut shown = Shown::default();
        assert!(!slot.take(&mut shown));
        for number in 1..=3 {
            sink.present(&frame(number)).unwrap();
        }
        assert!(slot.take(&mut shown) && !slot.take(&mut shown));
        assert_eq!((shown.image[0], shown.generator.as_str(), slot.dropped()), (3, "MS", 2));
    }

    #[test]
    fn each_half_hears_that_the_other_has_gone() {
        let (mut sink, slot) = WindowSink::new();
        slot.state().window_gone = Some("the window was closed");
        let error = sink.present(&frame(1)).unwrap_err().to_string();
        assert!(error.contains("the window was closed"), "{error}");
        Box::new(sink).finish().unwrap();
        assert!(slot.state().sink_ended);
    }

    #[test]
    fn a_frame_of_the_wrong_size_is_an_error() {
        let (mut sink, _slot) = WindowSink::new();
        assert!(sink.present(&PresentedFrame { width: 3, ..frame(1) }).is_err());
    }
}
