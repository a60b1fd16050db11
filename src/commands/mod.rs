//! One file per subcommand, each a few calls into the library.

mod backend;
mod bench;
mod calibrate;
mod dataset;
mod demo;
mod doctor;
#[cfg(test)]
#[path = "../../tests/repository/documents/command_lines.rs"]
mod documents;
mod effects;
mod evaluate;
mod exam;
mod export;
mod failure;
mod front;
mod generator;
mod import;
mod input;
mod inspect;
mod live;
mod output;
mod phantom;
mod plan;
mod planes;
mod progress;
mod qa;
mod quality;
mod record;
mod render;
mod replay;
mod replay_args;
mod run;
mod runtime_args;
mod scene;
mod score;
mod selftest;
mod session;
mod station_keys;
mod status_line;
mod steps;
mod sweep_bar;
mod terminal;
mod tissues;
mod tracker_args;
mod trackers;
mod tradeoff;
mod view;

use clap::{Parser, Subcommand};

pub(crate) use failure::{Classify, Failure};
pub(crate) use terminal::start_log;

/// A real-time ultrasound simulator: the pose of a probe becomes B-mode frames with segmentation, attenuation and mask.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110, after_help = AFTER_HELP)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,

    /// Print more to stderr; given twice, print everything. RUST_LOG, if set, overrides this option.
    #[arg(long, short, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

const AFTER_HELP: &str = "\
Examples:
  insonify demo                                          a recorded exam over a fetus: live in the browser, and in out/demo
  insonify render configs/sphere.toml --out out/sphere   one frame with its maps
  insonify view configs/sphere.toml --cut fan --bmode    a picture of the scene with the probe in it
  insonify doctor scene.glb                              what is wrong with a scene, and what to do about it
  insonify trackers                                      serial ports and HID devices to read a tracker from
  insonify run configs/sphere.toml --sink png            a live session, until Ctrl-C
  insonify plan configs/sphere.toml                      which effects the scene calls for, why, and what each costs
  insonify station-keys                                  what a station file may say

Exit codes: 0 done; 2 wrong input (arguments, station, scene, pose, recording, no GPU driver); 1 other failures.

Environment:
  INSONIFY_BACKEND where frames are made: auto, host or device (--backend overrides it, it overrides the station)
  INSONIFY_CACHE   where generated scenes are kept (default: insonify/ in the user's cache directory)
  INSONIFY_TRACE   how a device traces: path or lanes, a path by one thread or by eight (default: what was measured to be faster)
  INSONIFY_SIMD    widest vector instructions of the host: portable, avx2 or avx512 (default: the processor's widest)
  WGPU_BACKEND     which graphics interface a device is opened by: vulkan, metal, dx12 or gl
  ORT_DYLIB_PATH   ONNX Runtime's library, for generators (default: where scripts/setup puts it)
  RUST_LOG         what to log to stderr, for example insonify=debug, or insonify_render=debug for one crate";

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Run(run::Args),
    Render(render::Args),
    Record(record::Args),
    Replay(replay::Args),
    View(view::Args),
    Doctor(doctor::Args),
    Inspect(inspect::Args),
    Import(import::Args),
    Export(export::Args),
    Phantom(phantom::Args),
    Scene(scene::Args),
    Plan(plan::Args),
    Planes(planes::Args),
    Exam(exam::Args),
    Score(score::Args),
    Qa(qa::Args),
    Selftest(selftest::Args),
    Bench(bench::Args),
    Calibrate(calibrate::Args),
    Dataset(dataset::Args),
    Generator(generator::Args),
    Evaluate(evaluate::Args),
    Tradeoff(tradeoff::Args),
    Front(front::Args),
    Tissues(tissues::Args),
    Trackers(trackers::Args),
    StationKeys(station_keys::Args),
}

impl Cli {
    /// Runs the subcommand.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match &self.command {
            Command::Demo(args) => demo::run(args),
            Command::Run(args) => run::run(args),
            Command::Render(args) => render::run(args),
            Command::Record(args) => record::run(args),
            Command::Replay(args) => replay::run(args),
            Command::View(args) => view::run(args),
            Command::Doctor(args) => doctor::run(args),
            Command::Inspect(args) => inspect::run(args),
            Command::Import(args) => import::run(args),
            Command::Export(args) => export::run(args),
            Command::Phantom(args) => phantom::run(args),
            Command::Scene(args) => scene::run(args),
            Command::Plan(args) => plan::run(args),
            Command::Planes(args) => planes::run(args),
            Command::Exam(args) => exam::run(args),
            Command::Score(args) => score::run(args),
            Command::Qa(args) => qa::run(args),
            Command::Selftest(args) => selftest::run(args),
            Command::Bench(args) => bench::run(args),
            Command::Calibrate(args) => calibrate::run(args),
            Command::Dataset(args) => dataset::run(args),
            Command::Generator(args) => generator::run(args),
            Command::Evaluate(args) => evaluate::run(args),
            Command::Tradeoff(args) => tradeoff::run(args),
            Command::Front(args) => front::run(args),
            Command::Tissues(args) => tissues::run(args),
            Command::Trackers(args) => trackers::run(args),
            Command::StationKeys(args) => station_keys::run(args),
        }
    }
}
