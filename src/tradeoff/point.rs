//! A measured point.

use serde::{Deserialize, Serialize};

use super::Knobs;

/// One setting, measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Name, unlike all others.
    pub name: String,
    /// The knob that was turned, or `generator`.
    pub sweep: String,
    /// The neighbour that it is compared with.
    pub against: Option<String>,
    /// Values.
    pub knobs: Knobs,
    /// Generator that enhanced its frames, if one did.
    pub generator: Option<String>,
    /// Time of a frame.
    pub time: Time,
    /// Distance from the reference.
    pub error: Errors,
    /// Tissue by tissue.
    pub classes: Vec<ClassError>,
    /// Whether no other point is both faster and nearer to the reference.
    #[serde(default)]
    pub on_front: bool,
    /// Whether its time differs from its neighbour's by no more than repeats of one point do.
    #[serde(default)]
    pub time_is_noise: bool,
    /// Whether its error differs from its neighbour's by no more than another seed makes.
    #[serde(default)]
    pub error_is_noise: bool,
}

/// Time of a frame with its maps, from the call until it lies in memory, ms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Frames measured.
    pub frames: usize,
    /// Median.
    pub median_ms: f64,
    /// 95th percentile.
    pub p95_ms: f64,
    /// Distance between the quartiles of the times less the median of their pose: what repeats differ by, without what poses
    /// do.
    pub spread_ms: f64,
    /// Median of each pass on the device, in order; empty where it has no timestamps.
    pub passes: Vec<PassMs>,
}

/// Time of a pass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassMs {
    /// Pass, that of its shader; or `generator`.
    pub name: String,
    /// Median, ms.
    pub median_ms: f64,
}

/// Distance from the reference, within the sector, means over poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Root of the mean square difference of mean levels over patches of 32 × 32, grey levels: what is left where speckle
    /// is averaged out. Points are ranked by it.
    pub level_rmse: f64,
    /// Difference of that value between two seeds, grey levels.
    pub level_rmse_spread: f64,
    /// Root of the mean square difference of pixels, grey levels. Other samples, scanlines and kernels are other
    /// speckle: it compares points that have those of the reference, and no others.
    pub rmse: f64,
    /// Difference of that value between two seeds, grey levels.
    pub rmse_spread: f64,
    /// PSNR, dB, mean over poses whose image differs from the reference; infinite, in JSON `null`, where none does.
    #[serde(with = "crate::quality::infinite_is_null")]
    pub psnr_db: f64,
    /// Poses whose image is the reference's, which have no finite PSNR.
    #[serde(default)]
    pub identical: usize,
    /// SSIM.
    pub ssim: f64,
    /// pKL, nats.
    pub pkl: Option<f64>,
    /// Envelope SNR less that of the reference, mean over tissues that have one.
    pub snr_difference: Option<f64>,
    /// Mean magnitude of a tissue's difference of mean grey levels, weighed by its pixels.
    pub grey_difference: f64,
    /// Share of the contrast of borders that is lost.
    pub contrast_lost: Option<f64>,
}

/// One tissue's errors, means over the poses that show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassError {
    /// Name.
    pub tissue: String,
    /// Pixels over all poses.
    pub pixels: usize,
    /// Mean grey level less the reference's.
    pub grey_difference: f64,
    /// Envelope SNR.
    pub envelope_snr: Option<f64>,
    /// Envelope SNR of the reference.
    pub reference_snr: Option<f64>,
    /// Share of its borders' contrast that is lost.
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
