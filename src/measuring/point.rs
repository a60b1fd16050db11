//! Measured operating points, their Pareto front of time and error, and differences that are noise.

use serde::{Deserialize, Serialize};

use super::Knobs;
use crate::quality::SeenError;

/// An operating point with its measured time and errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Unique name.
    pub name: String,
    /// Name of the varied knob, or `generator`.
    pub sweep: String,
    /// Name of the neighbouring point of the noise test, if any.
    pub against: Option<String>,
    /// Knob values.
    pub knobs: Knobs,
    /// Generator that translated the frames, if any.
    pub generator: Option<String>,
    /// Time of a frame.
    pub time: Time,
    /// Error relative to the reference.
    pub error: Errors,
    /// Errors by tissue.
    pub classes: Vec<ClassError>,
    /// True if no other point is at least as fast and as accurate, and better in one of the two.
    #[serde(default)]
    pub on_front: bool,
    /// True if the time differs from the neighbour's by at most the spread of repeats.
    #[serde(default)]
    pub time_is_noise: bool,
    /// True if the error differs from the neighbour's by at most the spread between seeds.
    #[serde(default)]
    pub error_is_noise: bool,
}

/// Time of a frame with its maps, from the call until the result is in memory, ms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Number of measured frames.
    pub frames: usize,
    /// Median of the times.
    pub median_ms: f64,
    /// 95th percentile of the times.
    pub p95_ms: f64,
    /// Interquartile range of the times after subtracting the median of each pose: the spread of repeats, not of poses.
    pub spread_ms: f64,
    /// Median time of each pass on the device, in order; empty without timestamps.
    pub passes: Vec<PassMs>,
}

/// Time of a pass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassMs {
    /// Name of the pass's shader, or `generator`.
    pub name: String,
    /// Median, ms.
    pub median_ms: f64,
}

/// Errors relative to the reference, within the sector, averaged over poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Seen error and its parts, grey levels: the error of the Pareto front.
    pub seen: SeenError,
    /// Difference of the seen error between two seeds, grey levels.
    pub seen_spread: f64,
    /// RMS difference of pixels, grey levels. Other samples, scanlines and kernels change the speckle, so it is valid
    /// only for points with the reference's values of them.
    pub rmse: f64,
    /// PSNR, dB, mean over poses whose image differs from the reference; infinite, in JSON `null`, if all are equal.
    #[serde(with = "crate::quality::infinite_is_null")]
    pub psnr_db: f64,
    /// Poses whose image equals the reference; their PSNR is infinite.
    #[serde(default)]
    pub identical: usize,
    /// SSIM.
    pub ssim: f64,
    /// pKL, nats; `None` if no image has a patch.
    pub pkl: Option<f64>,
    /// Envelope SNR minus the reference's, mean over the tissues whose SNR is known.
    pub snr_difference: Option<f64>,
    /// Difference of a tissue's mean grey level from the reference's: mean magnitude, weighted by the tissue's pixels.
    pub grey_difference: f64,
    /// Lost share of the contrast at tissue borders.
    pub contrast_lost: Option<f64>,
}

/// Errors of one tissue, averaged over the poses that show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassError {
    /// Name of the tissue.
    pub tissue: String,
    /// Number of the tissue's pixels over all poses.
    pub pixels: usize,
    /// Mean grey level minus the reference's.
    pub grey_difference: f64,
    /// Median envelope SNR of the tissue's patches, mean over poses; `None` if unknown.
    pub envelope_snr: Option<f64>,
    /// Envelope SNR in the reference; `None` if unknown.
    pub reference_snr: Option<f64>,
    /// Lost share of the contrast at the tissue's borders.
    pub contrast_lost: Option<f64>,
}

/// Marks the Pareto-optimal points: no other point is at least as fast and as accurate, and better in one of the two.
///
/// Accuracy is the seen error.
pub(crate) fn mark_front(points: &mut [Point]) {
    let all: Vec<[f64; 2]> = points.iter().map(|p| [p.time.median_ms, p.error.seen.whole]).collect();
    for (point, mine) in points.iter_mut().zip(&all) {
        let beats = |other: &[f64; 2]| other[0] <= mine[0] && other[1] <= mine[1] && other != mine;
        point.on_front = mine.iter().all(|v| v.is_finite()) && !all.iter().any(beats);
    }
}

/// Marks points whose time or error differs from their neighbour's by at most the larger of both spreads.
pub(crate) fn mark_noise(points: &mut [Point]) {
    let all: Vec<(String, [f64; 2], [f64; 2])> = points
        .iter()
        .map(|p| {
            let values = [p.time.median_ms, p.error.seen.whole];
            (p.name.clone(), values, [p.time.spread_ms, p.error.seen_spread])
        })
        .collect();
    for (point, (_, mine, spread)) in points.iter_mut().zip(&all) {
        let neighbour = all.iter().find(|(name, ..)| Some(name) == point.against.as_ref());
        let within = |i: usize| {
            neighbour.is_some_and(|(_, theirs, other)| (mine[i] - theirs[i]).abs() <= spread[i].max(other[i]))
        };
        (point.time_is_noise, point.error_is_noise) = (within(0), within(1));
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::render::RenderSettings;
    use crate::transducer::Probe;

    pub(in crate::measuring) fn point(name: &str, median_ms: f64, seen: f64, against: Option<&str>) -> Point {
        Point {
            name: name.into(),
            sweep: "rays x layers".into(),
            against: against.map(Into::into),
            knobs: Knobs::of(&Probe::default(), &RenderSettings::default()),
            generator: None,
            time: Time {
                frames: 6,
                median_ms,
                p95_ms: 1.25 * median_ms,
                spread_ms: 2.0,
                passes: vec![PassMs { name: "trace".into(), median_ms: 0.5 * median_ms }],
            },
            error: Errors {
                seen: SeenError { whole: seen, levels: 0.75 * seen, texture: 0.5 * seen },
                seen_spread: 0.5,
                rmse: 25.5,
                psnr_db: 20.0,
                identical: 0,
                ssim: 0.5,
                pkl: Some(0.25),
                snr_difference: None,
                grey_difference: 1.5,
                contrast_lost: Some(0.125),
            },
            classes: vec![ClassError {
                tissue: "liver".into(),
                pixels: 10,
                grey_difference: -1.0,
                envelope_snr: Some(1.8),
                reference_snr: Some(1.9),
                contrast_lost: None,
            }],
            on_front: false,
            time_is_noise: false,
            error_is_noise: false,
        }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let values =
            [(10.0, 30.0), (20.0, 20.0), (21.0, 20.0), (25.0, 25.0), (90.0, 5.0), (90.0, 5.0), (9.0, f64::NAN)];
        let mut points: Vec<Point> = values.iter().map(|&(ms, level)| point("", ms, level, None)).collect();
        // The error of pixels does not count.
        points[3].error.rmse = 0.0;
        mark_front(&mut points);
        let front: Vec<bool> = points.iter().map(|p| p.on_front).collect();
        assert_eq!(front, [true, true, false, false, true, true, false]);
    }

    #[test]
    fn differences_within_the_spread_are_noise() {
        let mut points = [
            point("a", 10.0, 30.0, None),
            point("b", 11.5, 29.0, Some("a")),
            point("c", 20.0, 28.75, Some("b")),
            point("d", 20.0, 28.75, Some("who")),
        ];
        mark_noise(&mut points);
        let noise: Vec<_> = points.iter().map(|p| (p.time_is_noise, p.error_is_noise)).collect();
        assert_eq!(noise, [(false, false), (true, false), (false, true), (false, false)]);
    }

    #[test]
    fn points_come_back_as_they_were_written() {
        let mut points = [point("1x1", 10.0, 2.0, None), point("black", 5.0, 0.0, Some("1x1"))];
        points[1].error = Errors { psnr_db: f64::INFINITY, identical: 3, rmse: 0.0, ..points[1].error };
        let json = serde_json::to_string(&points).unwrap();
        assert_eq!(serde_json::from_str::<[Point; 2]>(&json).unwrap(), points);
    }
}
