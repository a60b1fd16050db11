//! What each effect, or step of a look, does to the error against theory, and its cost.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::table::csv_field;
use crate::selftest::TruthError;

/// Errors of an effect, or of a step of a look, and its cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectTruth {
    /// Errors with and without the effect.
    #[serde(flatten)]
    pub error: TruthError,
    /// False if the effect can't be simulated with the station's probe.
    pub possible: bool,
    /// Time that the effect adds to a frame, and the spread of its measurement, ms; `None` if it only changes tables.
    pub cost_ms: Option<[f64; 2]>,
}

impl EffectTruth {
    /// The cost as text.
    pub fn cost(&self) -> String {
        match self.cost_ms {
            _ if !self.possible => "not simulated".to_owned(),
            None => "no time".to_owned(),
            Some([cost, spread]) if cost <= spread => format!("< {:.1} ms", spread.max(0.1)),
            Some([cost, _]) => format!("{cost:.1} ms"),
        }
    }

    /// An error with its unit. Small errors get more digits.
    pub fn with_unit(&self, error: f64) -> String {
        let digits = if self.error.tolerance < 1.0 { 3 } else { 1 };
        let unit = if self.error.unit.is_empty() { String::new() } else { format!(" {}", self.error.unit) };
        format!("{error:.digits$}{unit}")
    }
}

/// Errors of effects as CSV.
pub fn effects_csv(effects: &[EffectTruth]) -> String {
    let mut text = "effect,quantity,unit,values,tolerance,without,with,cost_ms,cost_spread_ms\n".to_owned();
    for row in effects {
        let e = &row.error;
        let [cost, spread] = row.cost_ms.map_or_else(Default::default, |cost| cost.map(|ms| ms.to_string()));
        // Writing to a String can't fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{cost},{spread}",
            csv_field(&e.effect),
            csv_field(&e.quantity),
            csv_field(&e.unit),
            e.values,
            e.tolerance,
            e.without,
            e.with
        );
    }
    text
}

/// Errors of effects as a Markdown table.
pub fn effects_markdown(effects: &[EffectTruth]) -> String {
    let mut text = "| effect | costs | compared with theory | values | error without it | with it | tolerance |\n\
                    |---|---:|---|---:|---:|---:|---:|\n"
        .to_owned();
    for row in effects {
        let e = &row.error;
        let [without, with, tolerance] = [e.without, e.with, e.tolerance].map(|error| row.with_unit(error));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {without} | {with} | {tolerance} |",
            e.effect,
            row.cost(),
            e.quantity,
            e.values
        );
    }
    text
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::tradeoff) fn effects() -> Vec<EffectTruth> {
        let error = |effect: &str, unit: &str, tolerance, without, with| TruthError {
            effect: effect.into(),
            quantity: "speckle behind a rod, \"dark\"".into(),
            unit: unit.into(),
            values: 8,
            tolerance,
            without,
            with,
        };
        vec![
            EffectTruth { error: error("aperture", "dB", 4.0, 18.25, 1.5), possible: true, cost_ms: Some([6.5, 0.5]) },
            EffectTruth {
                error: error("refraction", "mm", 0.1, 1.25, 0.0375),
                possible: true,
                cost_ms: Some([0.25, 0.5]),
            },
            EffectTruth { error: error("speed_displacement", "mm", 0.1, 0.75, 0.0125), possible: true, cost_ms: None },
        ]
    }

    #[test]
    fn tables_hold_every_effect() {
        let csv = effects_csv(&effects());
        assert!(csv.contains("\naperture,\"speckle behind a rod, \"\"dark\"\"\",dB,8,4,18.25,1.5,6.5,0.5\n"), "{csv}");
        assert!(csv.ends_with(",mm,8,0.1,0.75,0.0125,,\n"), "{csv}");
        let table = effects_markdown(&effects());
        assert!(table.contains("| aperture | 6.5 ms | speckle"), "{table}");
        assert!(table.contains("| refraction | < 0.5 ms |") && table.contains("| no time |"), "{table}");
        assert!(
            table.contains("| 18.2 dB | 1.5 dB | 4.0 dB |") && table.contains("| 1.250 mm | 0.037 mm |"),
            "{table}"
        );
    }
}
