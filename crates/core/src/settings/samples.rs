//! Number of samples per scanline: chosen, or from the pulse.

use serde::{Serialize, Serializer};

use super::setting::AUTO;
use super::{Kind, Stored};

/// Number of complex baseband samples per scanline.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Samples {
    /// As many as the pulse's bandwidth needs over the image's depth: see
    /// [`Probe::sample_count`](super::Probe::sample_count).
    #[default]
    Auto,
    /// This many, at least 1.
    Number(u32),
}

impl From<u32> for Samples {
    /// `samples`, or [`Samples::Auto`] for 0.
    fn from(samples: u32) -> Self {
        if samples == 0 { Self::Auto } else { Self::Number(samples) }
    }
}

impl Stored for Samples {
    fn kind(&self) -> Kind {
        Kind::WholeOrAuto
    }

    fn get(&self, _index: usize) -> f64 {
        match *self {
            Self::Auto => 0.0,
            Self::Number(samples) => samples.into(),
        }
    }

    fn set(&mut self, _index: usize, value: f64) {
        *self = Self::from(value as u32);
    }
}

impl Serialize for Samples {
    /// A number, or "auto".
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str(AUTO),
            Self::Number(samples) => serializer.serialize_u32(*samples),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Probe, SettingsGroup as _};

    #[test]
    fn samples_come_back_from_json_and_from_their_stored_number() {
        let setting = Probe::setting("samples").unwrap();
        for samples in [Samples::Auto, Samples::Number(3072)] {
            let (mut read, mut stored) = (Samples::Number(1), Samples::Number(1));
            let json = setting.to_json(&samples);
            assert_eq!(json, serde_json::to_value(samples).unwrap());
            setting.read_json(&json, &mut read).unwrap();
            stored.set(0, samples.get(0));
            assert_eq!((read, stored), (samples, samples));
        }
        for wrong in ["0", "-1", "1.5", "\"all\"", "true"] {
            let mut kept = Samples::Number(7);
            let error = setting.read_json(&serde_json::from_str(wrong).unwrap(), &mut kept).unwrap_err();
            assert!(error.contains("\"auto\"") && kept == Samples::Number(7), "{wrong}: {error}");
        }
    }
}
