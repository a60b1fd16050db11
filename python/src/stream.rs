//! Streams of frames: a thread renders the frames of many poses ahead of the caller.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};

use insonify::chooser::StillFrame;
use pyo3::prelude::*;

use crate::errors::{Failure, Kind};
use crate::frame::{FrameRequest, NeedleArgument, Still};
use crate::rendering::Rendering;
use crate::shared::SharedStation;
use crate::work::wait;

/// Queue of poses to a rendering thread, and queue of frames back from it. Settings are those at the stream's start.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Stream {
    requests: Mutex<Option<Sender<FrameRequest>>>,
    frames: Mutex<Receiver<Result<StillFrame, Failure>>>,
    closed: Arc<AtomicBool>,
    process: u32,
    has_needle: bool,
}

impl Stream {
    pub(crate) fn start(inner: Arc<SharedStation>) -> PyResult<Self> {
        let (requests, asked) = mpsc::channel::<FrameRequest>();
        let (made, frames) = mpsc::channel();
        let closed = Arc::new(AtomicBool::new(false));
        let (described, stop) = (inner.described(), closed.clone());
        let has_needle = described.station.settings.needle.is_some();
        let thread = std::thread::Builder::new().name("insonify-ahead".into()).spawn(move || {
            // If a budget chooses the quality of the first frame, all other frames have this quality, too.
            let mut chosen = None;
            let at_once = Rendering::at_once();
            // All requests that are waiting are rendered together; the thread does not wait for more.
            while let Ok(first) = asked.recv() {
                // The frame that chooses the quality is rendered alone.
                let single = chosen.is_none() && described.station.frame_budget_ms.is_some();
                let room = if single { 0 } else { at_once - 1 };
                let requests: Vec<FrameRequest> = std::iter::once(first).chain(asked.try_iter().take(room)).collect();
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                let closed = || Failure::new(Kind::Render, "the stream is closed");
                let send = |still| made.send(Ok(still)).map_err(|_| closed());
                let rendered = match requests.as_slice() {
                    [only] => Rendering::still(&inner.rendering, &described, only, &mut chosen).and_then(send),
                    all => Rendering::stills(&inner.rendering, &described, all, chosen, send),
                };
                // After a frame that fails, the stream ends.
                if let Err(failure) = rendered {
                    let _ = made.send(Err(failure));
                    break;
                }
            }
        });
        thread.map_err(|e| Failure::new(Kind::Internal, format!("no thread can be started: {e}")))?;
        let process = std::process::id();
        Ok(Self { requests: Mutex::new(Some(requests)), frames: Mutex::new(frames), closed, process, has_needle })
    }

    fn check(&self) -> Result<(), Failure> {
        if self.process == std::process::id() {
            return Ok(());
        }
        Err(Failure::new(
            Kind::Render,
            "this process was forked from the one that renders these frames; call render_many here",
        ))
    }
}

#[pymethods]
impl Stream {
    /// Requests a frame. Returns at once.
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn push(
        &self,
        pose: [f64; 7],
        needle: Option<NeedleArgument>,
        quality: Option<&str>,
        seed: Option<u32>,
        time_s: f64,
        maps: bool,
        lines: bool,
    ) -> PyResult<()> {
        self.check()?;
        let request = FrameRequest::new(pose, needle, self.has_needle, quality, seed, time_s, maps, lines)?;
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner);
        let sent = requests.as_ref().is_some_and(|requests| requests.send(request).is_ok());
        if sent { Ok(()) } else { Err(Failure::new(Kind::Render, "the stream is closed").into()) }
    }

    /// Waits for the next frame, in the order of the poses.
    fn next(&self, py: Python<'_>) -> PyResult<Still> {
        self.check()?;
        Still::new(py, wait(py, &self.frames)??)
    }

    /// Ends the thread after the frame that it is rendering.
    fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
        self.requests.lock().unwrap_or_else(PoisonError::into_inner).take();
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.close();
    }
}
