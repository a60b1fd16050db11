//! A measured point.

use serde::{Deserialize, Serialize};

use super::Knobs;

/// One setting, measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Unique name.
    pub name: String,
    /// Varied knob, or `generator`.
    pub sweep: String,
    /// Name of its neighbour.
    pub against: Option<String>,
    /// Knob values.
    pub knobs: Knobs,
    /// Generator that translated its frames, if any.
    pub generator: Option<String>,
    /// Time of a frame.
    pub time: Time,
    /// Error relative to the reference.
    pub error: Errors,
    /// Errors by tissue.
    pub classes: Vec<ClassError>,
    /// True if no other point is at least as fast and as accurate, and better in one of both.
    #[serde(default)]
    pub on_front: bool,
    /// True if its time differs from its neighbour's by at most the spread of repeats.
    #[serde(default)]
    pub time_is_noise: bool,
    /// True if its error differs from its neighbour's by at most the spread between seeds.
    #[serde(default)]
    pub error_is_noise: bool,
}

/// Time of a frame with its maps, from the call until the result is in memory, ms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Frames measured.
    pub frames: usize,
    /// Median.
    pub median_ms: f64,
    /// 95th percentile.
    pub p95_ms: f64,
    /// Interquartile range of the times minus the median of their pose: the spread of repeats, without that of poses.
    pub spread_ms: f64,
    /// Median of each pass on the device, in order; empty without timestamps.
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
    /// RMS difference of mean levels over patches of 32 × 32, grey levels: speckle is averaged out. Points are ranked
    /// by it.
    pub level_rmse: f64,
    /// Difference of that value between two seeds, grey levels.
    pub level_rmse_spread: f64,
    /// RMS difference of pixels, grey levels. Other samples, scanlines and kernels change the speckle: valid only for
    /// points that share those of the reference.
    pub rmse: f64,
    /// Difference of that value between two seeds, grey levels.
    pub rmse_spread: f64,
    /// PSNR, dB, mean over poses whose image differs from the reference; infinite, in JSON `null`, if all are equal.
    #[serde(with = "crate::quality::infinite_is_null")]
    pub psnr_db: f64,
    /// Poses whose image equals the reference; their PSNR is infinite.
    #[serde(default)]
    pub identical: usize,
    /// SSIM.
    pub ssim: f64,
    /// pKL, nats.
    pub pkl: Option<f64>,
    /// Envelope SNR minus that of the reference, mean over tissues with one.
    pub snr_difference: Option<f64>,
    /// Mean magnitude of a tissue's difference of mean grey levels, weighted by its pixels.
    pub grey_difference: f64,
    /// Lost share of the borders' contrast.
    pub contrast_lost: Option<f64>,
}

/// Errors of one tissue, averaged over the poses that show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassError {
    /// Name.
    pub tissue: String,
    /// Pixels over all poses.
    pub pixels: usize,
    /// Mean grey level minus the reference's.
    pub grey_difference: f64,
    /// Envelope SNR.
    pub envelope_snr: Option<f64>,
    /// Envelope SNR of the reference.
    pub reference_snr: Option<f64>,
    /// Lost share of its borders' contrast.
    pub contrast_lost: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::super::front::tests::point;
    use super::*;

    #[test]
    fn points_come_back_as_they_were_written() {
        let mut points = [point("1x1", 10.0, 2.0, None), point("black", 5.0, 0.0, Some("1x1"))];
        points[1].error = Errors { psnr_db: f64::INFINITY, identical: 3, rmse: 0.0, ..points[1].error };
        let json = serde_json::to_string(&points).unwrap();
        assert_eq!(serde_json::from_str::<[Point; 2]>(&json).unwrap(), points);
    }
}
