//! Frames of a replay with an impossible placement of the probe, where no hand can hold it.

use crate::sink::FrameRate;
use crate::transducer::Misplacement;
use crate::transducer::placement::MISPLACED_FOR;

/// Frames of a replay with a misplaced probe, counted in runs of consecutive frames.
#[derive(Debug)]
pub(super) struct MisplacedFrames {
    /// Length of the shortest run that is reported, in frames. Shorter runs of misplaced frames are not reported.
    least: f64,
    /// Placement at the start of the current run of misplaced frames, and its number of frames so far; `None` outside a
    /// run.
    run: Option<(Misplacement, u32)>,
    /// Placement at the start of the first reported run, and the number of frames in all reported runs; `None` before
    /// one.
    reported: Option<(Misplacement, u32)>,
}

impl MisplacedFrames {
    /// A count for a replay at `rate`, before its first frame.
    pub(super) fn new(rate: FrameRate) -> Self {
        Self { least: MISPLACED_FOR.as_secs_f64() * rate.fps(), run: None, reported: None }
    }

    /// Takes the placement of the next frame; `None` if a hand can hold the probe there.
    pub(super) fn push(&mut self, placed: Option<Misplacement>) {
        let Some(placed) = placed else {
            self.run = None;
            return;
        };
        let (first, before) = self.run.unwrap_or((placed, 0));
        let count = before + 1;
        self.run = Some((first, count));
        let is_long = |count: u32| f64::from(count) >= self.least;
        if is_long(count) {
            let (_, frames) = self.reported.get_or_insert((first, 0));
            *frames += if is_long(before) { 1 } else { count };
        }
    }

    /// Placement at the start of the first reported run, and the number of frames in all reported runs; `None`
    /// without one.
    pub(super) fn reported(&self) -> Option<(Misplacement, u32)> {
        self.reported
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::placement::Fault;

    /// Number of frames in reported runs of a replay at 10 Hz whose probe is misplaced where `wrong` holds.
    fn reported(wrong: impl Fn(u32) -> bool) -> Option<u32> {
        let wrong_at = |depth_mm| Misplacement { fault: Fault::Deep { depth_mm }, likely: None };
        let mut frames = MisplacedFrames::new(FrameRate::new(10.0).unwrap());
        (0..100_u32).for_each(|i| frames.push(wrong(i).then(|| wrong_at(f64::from(i)))));
        let (first, count) = frames.reported()?;
        let Fault::Deep { depth_mm } = first.fault else { panic!() };
        assert!((0..20).all(|i| wrong(depth_mm as u32 + i)), "it begins the first long run");
        Some(count)
    }

    #[test]
    fn only_two_seconds_in_a_row_are_told() {
        assert_eq!(reported(|_| true), Some(100));
        assert_eq!(reported(|i| i % 20 < 19), None, "moments, of 9.5 s in all");
        assert_eq!(reported(|i| (5..15).contains(&i) || (30..50).contains(&i) || i >= 70), Some(50));
        assert_eq!(reported(|_| false), None);
    }

    #[test]
    fn slow_replays_tell_single_frames() {
        let mut frames = MisplacedFrames::new(FrameRate::new(0.1).unwrap());
        let outward = Misplacement { fault: Fault::LooksOut, likely: None };
        [Some(outward), None, Some(outward), Some(outward)].into_iter().for_each(|placed| frames.push(placed));
        assert_eq!(frames.reported(), Some((outward, 3)));
    }
}
