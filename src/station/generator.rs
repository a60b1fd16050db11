//! `[generator]`: models that translate frames.

use std::path::Path;

use super::values::Values;
use crate::generator::Settings;

/// Settings from checked values; paths are relative to `dir`.
pub(super) fn settings(values: &Values, dir: &Path) -> Settings {
    let mut settings = Settings::default();
    values.set_group(&mut settings);
    settings.models = values.texts("models").unwrap_or_default().into_iter().map(|path| dir.join(path)).collect();
    settings
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use crate::generator::{Precision, Provider, Settings};
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn a_station_names_its_generators() {
        assert_eq!(parse("").unwrap().generator, Settings::default());
        let table = "[generator]\nenabled = false\nmodels = [\"best.onnx\", \"/fast.onnx\"]\nprovider = \"cuda\"\n\
                     threads = 2\nrun_budget_ms = 33\nprecision = \"float32\"";
        let expected = Settings {
            enabled: false,
            models: vec![PathBuf::from("/station/best.onnx"), PathBuf::from("/fast.onnx")],
            provider: Provider::Cuda,
            threads: 2,
            run_budget_ms: 33.0,
            precision: Precision::Float32,
        };
        assert_eq!(parse(table).unwrap().generator, expected);
    }

    #[test]
    fn a_run_may_not_hang_within_its_budget() {
        let models = "models = [\"a.onnx\"]";
        let station = |lines: &str| parse(&format!("{lines}\n[generator]\n{models}"));
        for lines in ["[quality]\nframe_budget_ms = 64\n[pipeline]\nhang_ms = 64", "[quality]\nframe_budget_ms = 6000"]
        {
            let error = station(lines).unwrap_err().to_string();
            let words = ["pipeline.hang_ms", "5000 by default", "generator.run_budget_ms", "quality.frame_budget_ms"];
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
        let kept = |lines: &str| station(lines).unwrap().pipeline.hang_ms;
        assert_eq!(kept("[quality]\nframe_budget_ms = 64"), 5000.0);
        assert_eq!(kept("[quality]\nframe_budget_ms = 64\n[pipeline]\nhang_ms = 65"), 65.0);
        // A station without generators accepts any `hang_ms`.
        assert_eq!(parse("[quality]\nframe_budget_ms = 64\n[pipeline]\nhang_ms = 50").unwrap().pipeline.hang_ms, 50.0);
    }

    #[test]
    fn mistakes_are_named_with_what_would_be_right() {
        let lines = [
            ("precision = \"int4\"", ["generator.precision", "int8"]),
            ("provider = \"cuba\"", ["generator.provider", "did you mean `cuda`?"]),
            ("models = \"a.onnx\"", ["generator.models", "in quotes"]),
            ("models = [\"\"]", ["generator.models", "in quotes"]),
            ("models = [1]", ["generator.models", "in quotes"]),
            ("enabled = 1", ["generator.enabled", "true or false"]),
            ("run_budget_ms = 0", ["generator.run_budget_ms", "1..=10000"]),
            ("run_budget_ms = nan", ["generator.run_budget_ms", "1..=10000"]),
            ("threads = -1", ["generator.threads", "0..=256"]),
            ("run_budget = 5", ["run_budget_ms", "did you mean"]),
        ];
        assert_refused("generator", &lines);
    }
}
