//! How far a frame without an effect may be from the frame with it.

use std::fmt;

use serde::Serialize;

/// Grey levels of 255 that an effect may change at the most and still be left out.
pub const GREY_ALLOWED: f64 = 0.5;

/// The most by which leaving an effect out changes a frame, in any pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Bound {
    /// Nothing but rounding of f32.
    Exact,
    /// The level of any pixel.
    Level {
        /// Most that a level changes, dB.
        db: f64,
        /// The same, grey levels of 255.
        grey: f64,
    },
    /// Where edges lie; elsewhere nothing changes.
    Edges {
        /// Farthest that an edge moves, mm.
        mm: f64,
    },
    /// Where things lie.
    Displacement {
        /// Farthest that a thing moves, mm.
        mm: f64,
    },
    /// Speckle is another draw of the same distribution: its mean level and spread stay.
    Distribution {
        /// Most that the mean level changes, dB.
        db: f64,
    },
    /// There is none; what is missing.
    None {
        /// What a frame without it lacks.
        lacks: String,
    },
}

impl Bound {
    /// A change of level, dB, on a display of `dynamic_range_db`.
    pub(super) fn level(db: f64, dynamic_range_db: f64) -> Self {
        Self::Level { db, grey: db * 255.0 / dynamic_range_db }
    }

    /// Nothing bounds it.
    pub(super) fn none(lacks: impl Into<String>) -> Self {
        Self::None { lacks: lacks.into() }
    }

    /// Whether an effect of this bound may be left out.
    pub(super) fn negligible(&self) -> bool {
        match self {
            Self::Exact | Self::Edges { .. } | Self::Distribution { .. } => true,
            Self::Level { grey, .. } => *grey <= GREY_ALLOWED,
            Self::Displacement { .. } | Self::None { .. } => false,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exact => f.write_str("exact"),
            Self::Level { db, grey } => write!(f, "{db:.3} dB, {grey:.2} grey levels"),
            Self::Edges { mm } => write!(f, "edges within {mm:.2} mm"),
            Self::Displacement { mm } => write!(f, "{mm:.2} mm"),
            Self::Distribution { db } => write!(f, "another draw of the same speckle, mean within {db:.1} dB"),
            Self::None { lacks } => write!(f, "none: {lacks}"),
        }
    }
}
