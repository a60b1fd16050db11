//! Checks of a manifest: ranges of values, and consistency between its tables.

use std::path::Path;

use super::{BeamGrid, Channel, Kind, Manifest, Quantised, Variant};

impl Manifest {
    pub(super) fn check(&self) -> Result<(), String> {
        if self.format != 1 {
            return Err(format!("format is {}; this version of insonify reads 1", self.format));
        }
        if self.name.is_empty() || self.name.len() > 40 {
            return Err("name must have 1..=40 letters".to_owned());
        }
        if !is_sha256(&self.sha256) {
            return Err(format!("sha256 is `{}`; it must be 64 hexadecimal digits", self.sha256));
        }
        if !(1..=1024).contains(&self.padding_multiple) {
            return Err(format!("padding_multiple is {}; it must be 1..=1024", self.padding_multiple));
        }
        self.beam.as_ref().map_or(Ok(()), BeamGrid::check)?;
        self.check_channels()?;
        self.check_segmentation()?;
        if !(self.output.scale.is_finite() && self.output.offset.is_finite()) || self.output.scale == 0.0 {
            return Err("output.scale must be finite and not 0, output.offset finite".to_owned());
        }
        if !(self.parity.tolerance > 0.0 && self.parity.tolerance <= 16.0) {
            return Err(format!("parity.tolerance is {}; it must be above 0 and at most 16", self.parity.tolerance));
        }
        for file in [&self.parity.input, &self.parity.output] {
            if !is_file_name(file) {
                return Err(format!("parity file `{file}` must be the name of a file beside the manifest"));
            }
        }
        self.precisions.iter().try_for_each(Quantised::check)?;
        if let Some((_, twice)) =
            self.precisions.iter().enumerate().find(|(i, one)| self.precisions[..*i].iter().any(|o| o.name == one.name))
        {
            return Err(format!("precision `{}` is given twice", twice.name));
        }
        match (self.kind, &self.training) {
            (Kind::Trained, None) => Err("a trained generator must say on what, in [training]".to_owned()),
            (Kind::FixedFilter, Some(_)) => Err("[training] does not apply to a fixed filter".to_owned()),
            (_, Some(training)) if !is_sha256(&training.data_sha256) => {
                Err(format!("training.data_sha256 is `{}`; it must be 64 hexadecimal digits", training.data_sha256))
            }
            _ => Ok(()),
        }
    }

    fn check_channels(&self) -> Result<(), String> {
        let channels = &self.input.channels;
        for channel in [Channel::Image, Channel::Mask, Channel::Segmentation, Channel::Attenuation] {
            let name = format!("{channel:?}").to_lowercase();
            match (channels.iter().filter(|c| **c == channel).count(), self.affine(channel)) {
                (0, None) => (),
                (0, Some(_)) => return Err(format!("input.{name} is given, but {name} is not in input.channels")),
                (1, None) => {
                    return Err(format!("input.{name} is missing: say {{ scale = 1.0, offset = 0.0 }} or other"));
                }
                (1, Some(affine)) if affine.scale.is_finite() && affine.offset.is_finite() => {
                    let roots: &[f32] = if channel == Channel::Attenuation { &[1.0, 0.5, 0.25] } else { &[1.0] };
                    if !roots.contains(&affine.power) {
                        let power = affine.power;
                        return Err(format!("input.{name}.power is {power}; it must be one of {roots:?}"));
                    }
                }
                (1, Some(_)) => return Err(format!("input.{name} must be finite")),
                (n, _) => return Err(format!("input.channels holds {name} {n} times")),
            }
        }
        let has = |channel| channels.contains(&channel);
        if !has(Channel::Mask) {
            return Err("input.channels must hold mask".to_owned());
        }
        let found = match [Channel::Image, Channel::Segmentation, Channel::Attenuation].map(has) {
            [true, false, false] => Variant::M,
            [true, true, false] => Variant::MS,
            [true, true, true] => Variant::MSA,
            [false, true, true] => Variant::Maps,
            [true, false, true] => return Err("input.channels holds attenuation without segmentation".to_owned()),
            [false, ..] => {
                return Err("input.channels must hold image, or segmentation and attenuation without it".to_owned());
            }
        };
        if found != self.variant {
            return Err(format!("variant is {:?}, but input.channels are those of {found:?}", self.variant));
        }
        Ok(())
    }

    fn check_segmentation(&self) -> Result<(), String> {
        let needed = self.input.channels.contains(&Channel::Segmentation);
        let segmentation = match (&self.segmentation, needed) {
            (Some(segmentation), true) => segmentation,
            (None, false) => return Ok(()),
            (None, true) => return Err("[segmentation] is missing: it names the classes".to_owned()),
            (Some(_), false) => return Err("[segmentation] is given, but is not in input.channels".to_owned()),
        };
        let classes = &segmentation.classes;
        if !(2..=255).contains(&classes.len()) || !classes.iter().any(|c| c == "outside") {
            return Err("segmentation.classes must be 2..=255 names, `outside` among them".to_owned());
        }
        if let Some((i, twice)) = classes.iter().enumerate().find(|(i, c)| classes[..*i].contains(c)) {
            return Err(format!("segmentation.classes holds `{twice}` again at {i}"));
        }
        for (tissue, class) in &segmentation.of {
            if !classes.contains(class) {
                return Err(format!(
                    "segmentation.of.{tissue} is `{class}`, which is not in segmentation.classes: {}",
                    classes.join(", ")
                ));
            }
            if tissue != class && classes.contains(tissue) {
                return Err(format!("segmentation.of.{tissue} is `{class}`, but `{tissue}` is a class itself"));
            }
        }
        match &segmentation.other {
            Some(other) if !classes.contains(other) => {
                Err(format!("segmentation.other is `{other}`, which is not in segmentation.classes"))
            }
            _ => Ok(()),
        }
    }
}

/// Whether `name` is a plain file name without folders.
pub(super) fn is_file_name(name: &str) -> bool {
    Path::new(name).file_name().and_then(|n| n.to_str()) == Some(name)
}

pub(super) fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = include_str!("../../../tests/data/generators/weighted_maps.toml");

    #[test]
    fn contradictions_are_told() {
        let with = |from: &str, to: &str| {
            assert!(TEXT.contains(from), "{from}");
            Manifest::parse(&TEXT.replacen(from, to, 1)).unwrap_err()
        };
        let precision = |name: &str, model: &str, tolerance: f32| {
            format!(
                "[[precision]]\nname = \"{name}\"\nmodel = \"{model}\"\nsha256 = \"{}\"\noutput = \"o.npy\"\n\
                 tolerance = {tolerance:?}\npsnr_db = 20.0\n\n",
                "0".repeat(64)
            )
        };
        let one = |name: &str, model: &str, tolerance: f32| precision(name, model, tolerance) + "[parity]";
        let twice = precision("int8", "q.onnx", 1.0).repeat(2) + "[parity]";
        for (from, to, word) in [
            ("format = 1", "format = 2", "format is 2"),
            ("name = \"weighted_maps\"", "nam = \"x\"", "unknown field `nam`"),
            ("sha256 = \"", "sha256 = \"0", "64 hexadecimal digits"),
            ("padding_multiple = 1", "padding_multiple = 0", "1..=1024"),
            ("[input]", "[beam]\nscanlines = 8\ncell_mm = 0.2\n\n[input]", "beam.scanlines is 8"),
            ("[input]", "[beam]\nscanlines = 256\ncell_mm = 0.0\n\n[input]", "beam.cell_mm is 0"),
            ("variant = \"MSA\"", "variant = \"M\"", "MSA"),
            ("\"attenuation\", ", "", "input.attenuation is given"),
            ("\"image\", \"mask\"]", "\"image\", \"image\", \"mask\"]", "image 2 times"),
            ("attenuation = { scale = 1.0, offset = 0.0 }\n", "", "input.attenuation is missing"),
            ("attenuation = { scale = 1.0", "attenuation = { scale = inf", "finite"),
            ("attenuation = { scale = 1.0", "attenuation = { power = 0.3, scale = 1.0", "[1.0, 0.5, 0.25]"),
            ("mask = { scale = 1.0", "mask = { power = 0.5, scale = 1.0", "input.mask.power is 0.5"),
            ("\"outside\", ", "", "`outside`"),
            ("\"placenta\"", "\"outside\"", "again"),
            ("encoding = \"map\"", "encoding = \"map\"\nother = \"gas\"", "`gas`"),
            ("encoding = \"map\"", "encoding = \"map\"\nof = { calvaria = \"bone\" }", "of.calvaria is `bone`"),
            ("encoding = \"map\"", "encoding = \"map\"\nof = { placenta = \"skull\" }", "a class itself"),
            ("scale = 1.0\noffset = 0.0\n", "scale = 0.0\noffset = 0.0\n", "output.scale"),
            ("tolerance = 0.01", "tolerance = 0.0", "parity.tolerance"),
            ("input = \"speckle", "input = \"../speckle", "beside the manifest"),
            ("[parity]", &one("int4", "q.onnx", 1.0), "it must be int8"),
            ("[parity]", &one("int8", "../q.onnx", 1.0), "`../q.onnx` must be the name"),
            ("[parity]", &one("int8", "q.onnx", 17.0), "precision.tolerance is 17"),
            ("[parity]", &twice, "`int8` is given twice"),
            ("kind = \"fixed-filter\"", "kind = \"trained\"", "[training]"),
            ("kind = \"fixed-filter\"", "kind = \"magic\"", "magic"),
        ] {
            let error = with(from, to);
            assert!(error.contains(word), "`{word}`: {error}");
        }
    }
}
