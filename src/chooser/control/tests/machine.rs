//! Simulated machines and sessions for the tests.

use super::super::{Candidate, FrameBudget, PointController};
use crate::pose::BySpeed;
use crate::random::SplitMix64;
use crate::render::FrameQuality;

pub(super) const PERIOD_S: f64 = 1.0 / 14.0;

/// Rendered points: rays, layers, error. Generators: name, layers of their input frames (1x1 or 1x3), error.
pub(super) const RAW: [(u32, u32, f64); 6] =
    [(1, 1, 22.0), (1, 3, 18.0), (2, 3, 17.0), (4, 3, 16.0), (8, 3, 15.5), (32, 3, 15.0)];
pub(super) const GENERATORS: [(&str, u32, f64); 3] =
    [("fast", 1, 14.0), ("fast_1x3", 3, 12.0), ("middle_1x3", 3, 11.0)];

/// Frame times along the recorded exam, every half second, relative to the first. They are medians of 2x3 frames of 9
/// angles on two cores, averaged over two sessions (2026-11-23).
#[rustfmt::skip]
pub(super) const EXAM: [f64; 48] = [
    1.00, 0.99, 1.07, 1.27, 1.32, 1.24, 1.27, 1.26, 1.28, 1.37, 1.37, 1.40, 1.06, 1.17, 1.08, 1.07, 1.37, 1.29,
    1.33, 1.08, 1.10, 1.09, 1.08, 1.10, 1.06, 1.06, 1.21, 1.22, 1.46, 1.43, 1.51, 1.49, 1.50, 1.51, 1.53, 1.41,
    1.37, 1.38, 1.41, 1.48, 1.39, 1.39, 1.41, 1.36, 1.45, 1.17, 1.17, 1.20,
];

/// Frame and run times of a simulated machine.
#[derive(Debug, Clone, Copy)]
pub(super) struct Machine {
    pub(super) frame_ms: f64,
    pub(super) path_ms: f64,
    /// Run times of the fast and of the middle network.
    pub(super) run_ms: [f64; 2],
    /// Ratio of the slowest times to the median.
    pub(super) spread: f64,
}

/// Machine with two cores, as measured.
pub(super) const TWO_CORES: Machine = Machine { frame_ms: 26.0, path_ms: 2.6, run_ms: [26.0, 50.0], spread: 1.15 };

impl Machine {
    pub(super) fn render_ms(&self, quality: FrameQuality) -> f64 {
        self.frame_ms + self.path_ms * f64::from(quality.paths())
    }

    pub(super) fn run_ms(&self, generator: Option<usize>) -> f64 {
        match generator {
            None => 0.0,
            Some(2) => self.run_ms[1],
            Some(_) => self.run_ms[0],
        }
    }

    pub(super) fn candidates(&self) -> Vec<Candidate> {
        let raw = RAW.map(|(rays, layers, error)| (FrameQuality::new(rays, layers), None, error));
        let generated = GENERATORS.iter().enumerate();
        let generated = generated.map(|(i, &(_, layers, error))| (FrameQuality::new(1, layers), Some(i), error));
        let times = |(quality, generator, error)| Candidate {
            quality,
            generator,
            error: BySpeed::all(error),
            render_ms: self.render_ms(quality),
            run_ms: self.run_ms(generator),
        };
        raw.into_iter().chain(generated).map(times).collect()
    }

    pub(super) fn controller(&self, frame_ms: f64) -> PointController {
        let budget = FrameBudget { frame_ms: Some(frame_ms), run_ms: f64::INFINITY, apart: false, spread: self.spread };
        let names = GENERATORS.map(|(name, ..)| name.to_owned()).into();
        PointController::new(self.candidates(), names, budget).unwrap()
    }
}

/// Record of a simulated session.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub(super) frames: usize,
    pub(super) over: usize,
    pub(super) longest_s: f64,
    pub(super) changes: Vec<(f64, String, String)>,
}

/// Runs a session of `seconds` on `machine`. `load` gives the factors by which its frames and runs take longer.
pub(super) fn session(
    controller: &mut PointController,
    machine: &Machine,
    from_s: f64,
    seconds: f64,
    mut load: impl FnMut(f64) -> (f64, f64),
) -> Seen {
    let (mut seen, mut now_s) = (Seen::default(), from_s);
    let mut random = SplitMix64::new(7);
    while now_s < from_s + seconds {
        if let Some(change) = controller.change(now_s) {
            assert_eq!(change.to, controller.point());
            seen.changes.push((now_s, controller.name(&change.to), change.reason));
        }
        let point = controller.point();
        let (render, run) = load(now_s);
        // Most frames are near the median; one in twenty takes `spread` times as long.
        let vary = |random: &mut SplitMix64| match random.unit() {
            u if u < 0.95 => 0.97 + 0.06 * u,
            _ => machine.spread,
        };
        let render_ms = render * machine.render_ms(point.quality) * vary(&mut random);
        controller.rendered(now_s + 1e-3 * render_ms, point.quality, render_ms);
        let run_ms = run * machine.run_ms(point.generator) * vary(&mut random);
        let busy_s = 1e-3 * (render_ms + run_ms);
        if let Some(generator) = point.generator {
            controller.ran(now_s + busy_s, generator, run_ms);
        }
        seen.frames += 1;
        seen.over += usize::from(1e3 * busy_s > controller.limit_ms());
        let step_s = busy_s.max(PERIOD_S);
        seen.longest_s = seen.longest_s.max(step_s);
        now_s += step_s;
    }
    seen
}

/// Least error of all candidates whose 95th percentile keeps the budget, found by trying each of them.
pub(super) fn best_of_all(machine: &Machine, frame_ms: f64, (render, run): (f64, f64)) -> f64 {
    let p95_ms = |c: &Candidate| machine.spread * (render * c.render_ms + run * c.run_ms);
    let fitting = machine.candidates().into_iter().filter(|c| p95_ms(c) <= frame_ms);
    fitting.map(|c| c.error.at_rest).fold(f64::INFINITY, f64::min)
}

/// Least time of all candidates, ms.
pub(super) fn least_ms(machine: &Machine) -> f64 {
    machine.candidates().iter().map(|c| c.render_ms + c.run_ms).fold(f64::INFINITY, f64::min)
}
