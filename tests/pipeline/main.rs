//! Tests of sessions on simulated time, with fakes for everything that they use, and of the program on the real
//! renderer.

// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod controls;
mod device;
mod ending;
mod fakes;
mod fields;
mod frame_log;
mod frames;
mod generators;
mod hangs;
mod latency;
mod maps;
mod memory;
mod misplaced;
mod needle;
mod processors;
mod program;
mod quality;
#[cfg(feature = "gpu")]
mod real_hang;
mod session;
#[cfg(unix)]
mod signals;
mod sinks;
mod spans;
mod stuck;

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::VecDeque;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError, RwLock, mpsc};
use std::time::Duration;

use glam::{DQuat, DVec3};
use insonify::chooser::{Candidate, FrameBudget, PointController};
use insonify::exam::needle::{NeedleEvent, NeedleWatch};
use insonify::needle::{Needle, NeedleEstimate};
use insonify::pipeline::{
    Clock, FrameGenerators, FrameRenderer, GenerateError, ImageShape, Limits, NEVER, Observer, Part, Parts, Pipeline,
    PoseSource, RenderFault, RendererFactory, SimulatedClock, Stop, Summary, SystemClock, Terminator,
};
use insonify::pose::{BySpeed, Estimate, Pose, Speed, TrackingState};
use insonify::render::{Choice, ComputeDevice, Frame, FrameQuality, PciAddress, Quality, RenderSettings};
use insonify::settings::{Assignment, ChoiceSettings, Control, LiveSettings, PipelineSettings};
use insonify::sink::live::{FrameSource, LiveSink, MapsWanted, PresentedFrame};
use insonify::sink::{FrameLog, SinkError};
use insonify::transducer::{Contact, Probe};
use serde_json::Value;

use self::fakes::*;
use self::session::*;

/// Allocator that counts the allocations of the whole test program.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
static LIVE_BYTES: AtomicI64 = AtomicI64::new(0);

// SAFETY: every call is the system allocator's, with the caller's arguments; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        LIVE_BYTES.fetch_add(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE_BYTES.fetch_sub(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Lock that lets tests that count allocations run alone.
static ALONE: RwLock<()> = RwLock::new(());

fn beside_others() -> impl Drop {
    ALONE.read().unwrap_or_else(PoisonError::into_inner)
}

fn alone() -> impl Drop {
    ALONE.write().unwrap_or_else(PoisonError::into_inner)
}
