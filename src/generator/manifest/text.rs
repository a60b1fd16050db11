//! Description of a manifest for the user, in lines of text.

use std::fmt;

use super::{Kind, Manifest};

impl fmt::Display for Manifest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Kind::Trained => "trained",
            Kind::FixedFilter => "a fixed filter, not trained",
        };
        writeln!(f, "generator  {}: {}", self.name, self.description)?;
        let channels: Vec<_> = self.input.channels.iter().map(|c| format!("{c:?}").to_lowercase()).collect();
        let (variant, channels, multiple) = (self.variant, channels.join(", "), self.padding_multiple);
        writeln!(f, "kind       {kind}; {variant:?} ({channels}), padded to {multiple}")?;
        if let Some(training) = &self.training {
            let start = training.data_sha256.get(..12).unwrap_or_default();
            writeln!(f, "training   {} iterations on data {start}…", training.iterations)?;
        }
        if let Some(quality) = &self.quality {
            let optional = |name: &str, v: Option<f64>| v.map_or(String::new(), |v| format!(", {name} {v:.4}"));
            let more = optional("pKL", quality.pkl) + &optional("FID", quality.fid);
            writeln!(f, "quality    PSNR {:.2} dB, SSIM {:.4}{more}", quality.psnr_db, quality.ssim)?;
        }
        Ok(())
    }
}
