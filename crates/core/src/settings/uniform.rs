//! Settings as uniforms for the GPU: 32-bit words, and the WGSL functions that read them.

use super::{Kind, Setting};

/// Type of a setting that converts to 32-bit words.
pub trait Uniform {
    /// One word, or an array of words.
    type Words: bytemuck::Pod;

    /// The value as words; numbers are rounded to f32, switches become 0 or 1.
    fn words(&self) -> Self::Words;
}

impl Uniform for f64 {
    type Words = f32;

    fn words(&self) -> f32 {
        *self as f32
    }
}

impl Uniform for u32 {
    type Words = u32;

    fn words(&self) -> u32 {
        *self
    }
}

impl Uniform for bool {
    type Words = u32;

    fn words(&self) -> u32 {
        (*self).into()
    }
}

impl<const N: usize> Uniform for [f64; N]
where
    [f32; N]: bytemuck::Pod,
{
    type Words = [f32; N];

    fn words(&self) -> [f32; N] {
        self.map(|number| number as f32)
    }
}

/// WGSL functions that read the `settings` of a group. `words` is the WGSL expression of an array of four-component
/// vectors.
///
/// A function's name is `prefix` followed by the setting's key, such as `image_gain_db()`. Functions of lists take an
/// index.
pub fn wgsl_readers(prefix: &str, words: &str, settings: &[Setting]) -> String {
    let mut first = 0;
    let reader = |setting: &Setting| {
        let word = format!("{words}[{}u].{}", first / 4, ["x", "y", "z", "w"][first % 4]);
        let (argument, kind, value) = match setting.kind {
            Kind::Number => ("", "f32", format!("bitcast<f32>({word})")),
            Kind::Whole | Kind::WholeOrAuto | Kind::Word(_) => ("", "u32", word),
            Kind::Switch => ("", "bool", format!("{word} != 0u")),
            Kind::Numbers(_) => {
                let at = format!("({first}u + index)");
                ("index: u32", "f32", format!("bitcast<f32>({words}[{at} >> 2u][{at} & 3u])"))
            }
        };
        first += setting.count();
        format!("fn {prefix}{}({argument}) -> {kind} {{ return {value}; }}\n", setting.key)
    };
    settings.iter().map(reader).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{ImageSettings, ImageUniforms, SettingsGroup};

    #[test]
    fn words_follow_the_order_of_the_blocks() {
        let mut image = ImageSettings::default();
        let mut next = 17.0;
        for setting in ImageSettings::settings() {
            for index in 0..setting.count() {
                image.stored_mut(setting.key).unwrap().set(index, next);
                next += 1.0;
            }
        }
        let uniforms = ImageUniforms::from(&image);
        let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(&uniforms));
        let numbers = words.iter().map(|&word| if word < 1000 { word as f32 } else { f32::from_bits(word) });
        assert_eq!(numbers.collect::<Vec<_>>(), (17..17 + words.len()).map(|n| n as f32).collect::<Vec<_>>());
    }

    #[test]
    fn readers_name_each_setting_and_its_word() {
        let text = wgsl_readers("image_", "params.image", ImageSettings::settings());
        assert_eq!(text.lines().count(), ImageSettings::settings().len());
        for line in [
            "fn image_height() -> u32 { return params.image[0u].y; }",
            "fn image_tgc_db_per_cm() -> f32 { return bitcast<f32>(params.image[1u].x); }",
            "fn image_tgc_sliders_db(index: u32) -> f32 { return bitcast<f32>(params.image[(5u + index) >> 2u][(5u + index) & 3u]); }",
        ] {
            assert!(text.contains(line), "{text}");
        }
    }
}
