//! `--quality`.

use std::str::FromStr;

use insonify::render::Quality;

/// Rays and layers as given on the command line: `lq`, `hq` or `RxL`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RaysLayers {
    rays: u32,
    layers: u32,
}

impl RaysLayers {
    /// These rays and layers with a seed.
    pub(crate) fn with_seed(self, seed: u32) -> Quality {
        Quality { rays: self.rays, layers: self.layers, seed }
    }
}

impl FromStr for RaysLayers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let of = |q: Quality| Self { rays: q.rays, layers: q.layers };
        match text.to_ascii_lowercase().as_str() {
            "lq" => Ok(of(Quality::LQ)),
            "hq" => Ok(of(Quality::HQ)),
            other => {
                let parsed = other.split_once('x').and_then(|(r, l)| Some((r.parse().ok()?, l.parse().ok()?)));
                let in_range = parsed.filter(|(r, l)| (1..=256).contains(r) && (1..=33).contains(l));
                in_range.map(|(rays, layers)| Self { rays, layers }).ok_or_else(|| {
                    "expected `lq` (1x1), `hq` (32x3) or rays x layers such as `8x1`, with 1..=256 rays and 1..=33 layers"
                        .to_owned()
                })
            }
        }
    }
}

/// The quality's short name in captions and tables.
pub(crate) fn name(quality: &Quality) -> String {
    let of = |q: Quality| (q.rays, q.layers);
    match of(*quality) {
        pair if pair == of(Quality::LQ) => "LQ".to_owned(),
        pair if pair == of(Quality::HQ) => "HQ".to_owned(),
        (rays, layers) => format!("{rays}x{layers}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_products_are_understood() {
        let quality = |text: &str| text.parse::<RaysLayers>().map(|q| q.with_seed(7));
        assert_eq!(quality("lq"), Ok(Quality { seed: 7, ..Quality::LQ }));
        assert_eq!(quality("HQ"), Ok(Quality { seed: 7, ..Quality::HQ }));
        assert_eq!(quality("8x2"), Ok(Quality { rays: 8, layers: 2, seed: 7 }));
        for wrong in ["", "x", "8", "8x", "0x1", "1x0", "257x1", "1x34", "-1x1", "8x2x1", "mq"] {
            assert!(quality(wrong).is_err(), "{wrong}");
        }
        assert_eq!(name(&Quality { rays: 32, layers: 3, seed: 1 }), "HQ");
        assert_eq!(name(&Quality { rays: 8, layers: 1, seed: 0 }), "8x1");
    }
}
