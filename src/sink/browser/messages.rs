//! Text messages, JSON both ways.

use serde::{Deserialize, Serialize};

use super::SceneInfo;
use crate::sink::colour;
use crate::sink::live::Control;

/// What a page says.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum FromPage {
    Freeze {
        on: bool,
    },
    GainDb {
        value: f64,
    },
    DynamicRangeDb {
        value: f64,
    },
    TgcDbPerCm {
        value: f64,
    },
    TgcSlider {
        index: u32,
        db: f64,
    },
    DepthMm {
        value: f64,
    },
    FocusMm {
        value: f64,
    },
    Quality {
        rays: u32,
        layers: u32,
    },
    Enhance {
        on: bool,
    },
    /// Which maps to send beside the image.
    Overlays {
        segmentation: bool,
        attenuation: bool,
    },
    /// The frame of this number is drawn: there is room for another.
    Drawn {
        number: u64,
    },
}

/// What a message is for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Request {
    Control(Control),
    Overlays { segmentation: bool, attenuation: bool },
    Drawn { number: u64 },
}

/// Reads a message.
///
/// # Errors
/// What is wrong with it, for the page to show.
pub(super) fn read(text: &str) -> Result<Request, String> {
    let message: FromPage = serde_json::from_str(text).map_err(|e| format!("not a message of this page: {e}"))?;
    let control = match message {
        FromPage::Overlays { segmentation, attenuation } => {
            return Ok(Request::Overlays { segmentation, attenuation });
        }
        FromPage::Drawn { number } => return Ok(Request::Drawn { number }),
        FromPage::Freeze { on } => Control::Freeze(on),
        FromPage::GainDb { value } => Control::GainDb(value),
        FromPage::DynamicRangeDb { value } => Control::DynamicRangeDb(value),
        FromPage::TgcDbPerCm { value } => Control::TgcDbPerCm(value),
        FromPage::TgcSlider { index, db } => Control::TgcSlider { index: index as usize, db },
        FromPage::DepthMm { value } => Control::DepthMm(value),
        FromPage::FocusMm { value } => Control::FocusMm(value),
        FromPage::Quality { rays, layers } => Control::Quality { rays, layers },
        FromPage::Enhance { on } => Control::Enhance(on),
    };
    control.validate().map_err(|e| e.to_string())?;
    Ok(Request::Control(control))
}

/// What a page is told.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum ToPage<'a> {
    /// First of all.
    Hello {
        version: &'static str,
        /// What the numbers of the segmentation mean.
        tissues: Vec<TissueEntry<'a>>,
        /// Colours of attenuation 0..=255.
        attenuation_colours: Vec<colour::Rgb>,
    },
    /// Every second.
    Stats { sent: u64, dropped: u64, clients: usize },
    /// A message could not be followed.
    Error { message: &'a str },
}

/// A tissue of the segmentation.
#[derive(Debug, Serialize)]
pub(super) struct TissueEntry<'a> {
    number: usize,
    name: &'a str,
    colour: colour::Rgb,
}

/// The first message.
pub(super) fn hello(scene: &SceneInfo) -> ToPage<'_> {
    ToPage::Hello {
        version: env!("CARGO_PKG_VERSION"),
        tissues: (1..)
            .zip(&scene.tissues)
            .map(|(number, name)| TissueEntry { number, name, colour: colour::tissue(name) })
            .collect(),
        attenuation_colours: (0..=255_u8).map(|a| colour::viridis(f32::from(a) / 255.0)).collect(),
    }
}

/// A message as text.
pub(super) fn write(message: &ToPage<'_>) -> String {
    // Strings, integers and enums always serialise; were that to change, the page hears of it.
    serde_json::to_string(message)
        .unwrap_or_else(|e| format!(r#"{{"type":"error","message":"the station could not write a message: {e}"}}"#))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_become_controls() {
        let cases = [
            (r#"{"type":"freeze","on":true}"#, Control::Freeze(true)),
            (r#"{"type":"gain_db","value":-3.5}"#, Control::GainDb(-3.5)),
            (r#"{"type":"tgc_slider","index":7,"db":12}"#, Control::TgcSlider { index: 7, db: 12.0 }),
            (r#"{"type":"quality","rays":32,"layers":3}"#, Control::Quality { rays: 32, layers: 3 }),
            (r#"{"type":"enhance","on":false}"#, Control::Enhance(false)),
        ];
        for (text, control) in cases {
            assert_eq!(read(text), Ok(Request::Control(control)));
        }
        assert_eq!(read(r#"{"type":"drawn","number":5}"#), Ok(Request::Drawn { number: 5 }));
    }

    #[test]
    fn wrong_messages_say_what_is_wrong() {
        let cases = [
            ("", "not a message"),
            ("[]", "not a message"),
            (r#"{"type":"gain","value":1}"#, "gain_db"),
            (r#"{"type":"gain_db"}"#, "value"),
            (r#"{"type":"gain_db","value":"3"}"#, "string"),
            (r#"{"type":"gain_db","value":1e999}"#, "out of range"),
            (r#"{"type":"gain_db","value":900}"#, "-200..=200"),
            (r#"{"type":"gain_db","value":1,"more":2}"#, "more"),
            (r#"{"type":"tgc_slider","index":-1,"db":0}"#, "-1"),
            (r#"{"type":"tgc_slider","index":8,"db":0}"#, "0..=7"),
            (r#"{"type":"quit"}"#, "quit"),
        ];
        for (text, part) in cases {
            let error = read(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn the_first_message_names_the_tissues_by_number() {
        let scene = SceneInfo { tissues: vec!["blood".into(), "a\"b".into()], surfaces: None };
        let hello: serde_json::Value = serde_json::from_str(&write(&hello(&scene))).unwrap();
        assert_eq!(hello["type"], "hello");
        assert_eq!(hello["tissues"][1]["name"], "a\"b");
        assert_eq!(hello["tissues"][0]["number"], 1);
        assert_eq!(hello["attenuation_colours"].as_array().unwrap().len(), 256);
    }
}
