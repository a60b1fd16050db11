//! Error bounds of frames rendered without an effect, relative to frames with it.

use std::fmt;

use serde::Serialize;

/// Largest change of any pixel for which an effect may be left out, grey levels of 255.
pub const GREY_ALLOWED: f64 = 0.5;

/// Bound on how much a frame changes if an effect is left out, in any pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Bound {
    /// The frame is the same except for rounding in f32. Rounding may choose another cell if a scanline runs within a
    /// face of the scatterer lattice.
    Exact,
    /// No bound is needed: the effect is simulated only if the station switches it on. The scene does not call for it.
    OnRequest,
    /// Bound on the change of any pixel's level. If media of different loss meet, it excludes speckle nulls 26 dB below
    /// the mean.
    Level {
        /// Largest change of a level, dB.
        db: f64,
        /// The same change in grey levels of 255.
        grey: f64,
    },
    /// Bound on the lateral shift at which a sample's medium is looked up, within a scanline's share of the sector.
    /// Edges shift by no more.
    Aside {
        /// Largest shift, mm.
        mm: f64,
        /// Largest invisible shift, mm: half a pixel or a quarter of the lateral beam's σ, whichever is larger.
        allowed_mm: f64,
    },
    /// Bound on the displacement of the anatomy.
    Displacement {
        /// Largest displacement, mm.
        mm: f64,
    },
    /// No bound: part of the image is missing.
    None {
        /// Missing part of a frame without the effect, in words.
        lacks: String,
    },
}

impl Bound {
    /// Bound from a change of level in dB, on a display of `dynamic_range_db`.
    pub(super) fn level(db: f64, dynamic_range_db: f64) -> Self {
        Self::Level { db, grey: db * 255.0 / dynamic_range_db }
    }

    /// No bound: the frame lacks `lacks`.
    pub(super) fn none(lacks: impl Into<String>) -> Self {
        Self::None { lacks: lacks.into() }
    }

    /// Whether an effect with this bound may be left out.
    pub(super) fn negligible(&self) -> bool {
        match self {
            Self::Exact | Self::OnRequest => true,
            Self::Aside { mm, allowed_mm } => mm <= allowed_mm,
            Self::Level { grey, .. } => *grey <= GREY_ALLOWED,
            Self::Displacement { .. } | Self::None { .. } => false,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exact => f.write_str("exact"),
            Self::OnRequest => f.write_str("only on request"),
            Self::Level { db, grey } if *grey >= 255.0 => write!(f, "{db:.0} dB, all grey levels"),
            Self::Level { db, grey } => write!(f, "{db:.3} dB, {grey:.2} grey levels"),
            Self::Aside { mm, allowed_mm } => {
                write!(f, "edges within {mm:.3} mm of their place; {allowed_mm:.3} mm is not seen")
            }
            Self::Displacement { mm } => write!(f, "{mm:.2} mm"),
            Self::None { lacks } => write!(f, "none: {lacks}"),
        }
    }
}
