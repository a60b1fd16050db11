//! Text messages between page and station, JSON in both directions.

use serde::{Deserialize, Serialize};

use super::{MeasureInfo, SceneInfo};
use crate::look::grey_table;
use crate::settings::{
    Assignment, Display, GreyMap, HotKey, Kind, LiveControl, Mark, Preset, QUALITY_POINTS, QualityPointKey, Setting,
    Slider, exams, hot_keys, live_settings, looks, mark,
};
use crate::sink::colour;

/// Messages of a page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Request {
    /// New values of live settings, set together.
    Set {
        /// The values.
        assignments: Vec<Assignment>,
    },
    /// Maps to send in addition to the image.
    Overlays {
        /// Whether to send tissue numbers.
        segmentation: bool,
        /// Whether to send attenuation.
        attenuation: bool,
    },
    /// The page has drawn the frame of this number, and has room for another.
    Drawn {
        /// Number of the frame.
        number: u64,
    },
    /// A mark on a picture was set or changed.
    Mark(Box<Mark>),
    /// Marks were removed from pictures.
    Unmark {
        /// Identifiers of the marks.
        ids: Vec<String>,
    },
}

/// Reads a message.
///
/// # Errors
/// Description of the fault, for the page to show.
pub(super) fn read(text: &str) -> Result<Request, String> {
    let message = serde_json::from_str(text).map_err(|e| format!("not a message of this page: {e}"))?;
    match message {
        Request::Set { assignments } => {
            assignments.iter().try_for_each(|assignment| assignment.check().map(|_| ())).map_err(|e| e.to_string())?;
            Ok(Request::Set { assignments })
        }
        Request::Mark(mark) => Ok(Request::Mark(Box::new(mark.checked().map_err(|e| e.to_string())?))),
        Request::Unmark { ids } => {
            mark::check_removed(&ids).map_err(|e| e.to_string())?;
            Ok(Request::Unmark { ids })
        }
        message => Ok(message),
    }
}

/// Messages to a page.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum ToPage<'a> {
    /// The first message.
    Hello {
        version: &'static str,
        /// Identifier of the session, for pages that connect again.
        session: String,
        /// Tissue of each number in the segmentation.
        tissues: Vec<TissueEntry<'a>>,
        /// Colours of the attenuation's levels 0..=255.
        attenuation_colours: Vec<colour::Rgb>,
        /// Live settings, in the order of their values in the frames' messages.
        settings: Vec<SettingEntry>,
        /// Grey maps: for each, the displayed level of every grey level 0..=255.
        grey_maps: Vec<Vec<u8>>,
        /// Presets of post-processing and of exams, each with a button.
        looks: &'static [Preset],
        exams: &'static [Preset],
        /// Qualities that have a button.
        qualities: &'static [QualityPointKey],
        /// Hot keys of the page.
        keys: Vec<&'static HotKey>,
        /// Caliper measures of the scene's standard planes.
        measures: &'a [MeasureInfo],
    },
    /// Counts of frames sent and dropped and of connected pages, every second.
    Stats { sent: u64, dropped: u64, clients: usize },
    /// A request that could not be followed.
    Error { message: &'a str },
}

/// Tissue of a number in the segmentation.
#[derive(Debug, Serialize)]
pub(super) struct TissueEntry<'a> {
    number: usize,
    name: &'a str,
    colour: colour::Rgb,
}

/// A live setting and its control.
#[derive(Debug, Serialize)]
pub(super) struct SettingEntry {
    key: &'static str,
    /// Number of values.
    count: usize,
    /// Accepted range.
    range: [f64; 2],
    label: &'static str,
    caption: &'static str,
    unit: &'static str,
    scale: f64,
    digits: usize,
    slider: Option<Slider>,
    /// Names of the values 0, 1, …; empty for numbers.
    words: &'static [&'static str],
}

impl SettingEntry {
    fn new(setting: &'static Setting) -> Option<Self> {
        let &LiveControl { label, caption, slider, unit, scale, digits, .. } = setting.control.as_ref()?;
        let words = if let Kind::Word(words) = setting.kind { words } else { &[] };
        let (key, count, range) = (setting.key, setting.count(), [setting.min, setting.max]);
        Some(Self {
            key,
            count,
            range,
            label,
            caption,
            unit: unit.unwrap_or(setting.unit),
            scale,
            digits,
            slider,
            words,
        })
    }
}

/// The first message.
pub(super) fn hello(scene: &SceneInfo) -> ToPage<'_> {
    ToPage::Hello {
        version: env!("CARGO_PKG_VERSION"),
        session: format!("{:x}", crate::tracker::host_time_ns()),
        tissues: (1..)
            .zip(&scene.tissues)
            .map(|(number, name)| TissueEntry { number, name, colour: colour::tissue(name) })
            .collect(),
        attenuation_colours: (0..=255_u8).map(|a| colour::viridis(f32::from(a) / 255.0)).collect(),
        settings: live_settings().filter_map(SettingEntry::new).collect(),
        grey_maps: GreyMap::ALL.into_iter().map(|map| grey_table(map).to_vec()).collect(),
        looks: looks(),
        exams: exams(),
        qualities: &QUALITY_POINTS,
        keys: hot_keys().iter().filter(|hot| hot.works_on(Display::Page)).collect(),
        measures: &scene.measures,
    }
}

/// A message as JSON text.
pub(super) fn write(message: &ToPage<'_>) -> String {
    // Strings, integers and enums always serialise; the fallback is an error message to the page.
    serde_json::to_string(message)
        .unwrap_or_else(|e| format!(r#"{{"type":"error","message":"the station could not write a message: {e}"}}"#))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::MarkContent;

    fn mark(content: &str) -> String {
        format!(r#"{{"type":"mark","id":"a-1","frame":7,"sampled_ms":3.5,"pose":null,"content":{content}}}"#)
    }

    #[test]
    fn messages_of_a_page_are_read() {
        let set = r#"{"type":"set","assignments":[{"key":"gain_db","value":-3.5},{"key":"tgc_sliders_db","index":7,"value":12}]}"#;
        let slider = Assignment { index: 7, ..Assignment::new("tgc_sliders_db", 12.0) };
        let assignments = vec![Assignment::new("gain_db", -3.5), slider];
        assert_eq!(read(set), Ok(Request::Set { assignments }));
        assert_eq!(read(r#"{"type":"drawn","number":5}"#), Ok(Request::Drawn { number: 5 }));
        let Ok(Request::Mark(mark)) = read(&mark(r#"{"kind":"text","text":" a\u001b b","at_mm":[1,2]}"#)) else {
            panic!()
        };
        assert_eq!(mark.content, MarkContent::Text { text: "a b".into(), at_mm: [1.0, 2.0] });
        assert_eq!(read(r#"{"type":"unmark","ids":["a-1"]}"#), Ok(Request::Unmark { ids: vec!["a-1".into()] }));
    }

    #[test]
    fn wrong_messages_say_what_is_wrong() {
        let set = |assignment: &str| format!(r#"{{"type":"set","assignments":[{{{assignment}}}]}}"#);
        let cases = [
            (String::new(), "not a message"),
            ("[]".to_owned(), "not a message"),
            (set(r#""key":"gain","value":1"#), "gain_db"),
            (set(r#""key":"width","value":100"#), "gain_db"),
            (set(r#""key":"gain_db""#), "value"),
            (set(r#""key":"gain_db","value":"3""#), "string"),
            (set(r#""key":"gain_db","value":1e999"#), "out of range"),
            (set(r#""key":"gain_db","value":900"#), "-200..=200"),
            (set(r#""key":"rays","value":1.5"#), "whole"),
            (set(r#""key":"gain_db","value":1,"more":2"#), "more"),
            (set(r#""key":"tgc_sliders_db","index":-1,"value":0"#), "-1"),
            (set(r#""key":"tgc_sliders_db","index":8,"value":0"#), "0..=7"),
            (r#"{"type":"quit"}"#.to_owned(), "quit"),
            (mark(r#"{"kind":"distance","measure":"","points_mm":[[1,2]]}"#), "2"),
            (mark(r#"{"kind":"distance","measure":"","points_mm":[[1,2],[3,1e9]]}"#), "points_mm"),
            (mark(r#"{"kind":"text","text":"\n","at_mm":[1,2]}"#), "empty"),
            (mark(r#"{"kind":"arrow"}"#), "arrow"),
            (r#"{"type":"unmark","ids":["a b"]}"#.to_owned(), "a b"),
        ];
        for (text, part) in cases {
            let error = read(&text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn a_page_gets_every_live_control_and_key() {
        let scene = SceneInfo::default();
        let hello: serde_json::Value = serde_json::from_str(&write(&hello(&scene))).unwrap();
        let settings = hello["settings"].as_array().unwrap();
        assert_eq!(settings.len(), live_settings().count());
        for (entry, setting) in settings.iter().zip(live_settings()) {
            assert_eq!((&entry["key"], &entry["count"]), (&setting.key.into(), &setting.count().into()));
            assert_eq!(entry["range"], serde_json::json!([setting.min, setting.max]));
        }
        let has_section =
            |id: &str| include_str!("../../../assets/browser/index.html").contains(&format!("id=\"{id}\""));
        let sections = settings.iter().filter_map(|entry| entry["slider"]["section"].as_str());
        assert!(sections.clone().count() > 4 && sections.into_iter().all(has_section));
        let app = include_str!("../../../assets/browser/app.js");
        let keys = hello["keys"].as_array().unwrap();
        let of_page: Vec<_> = keys.iter().filter_map(|key| key["action"]["page"].as_str()).collect();
        assert_eq!(of_page.len(), 15);
        assert!(of_page.iter().all(|name| app.contains(&format!("{name}:")) || app.contains(&format!("  {name},"))));
    }

    #[test]
    fn the_first_message_names_the_tissues_by_number() {
        let scene = SceneInfo { tissues: vec!["blood".into(), "a\"b".into()], ..SceneInfo::default() };
        let hello: serde_json::Value = serde_json::from_str(&write(&hello(&scene))).unwrap();
        assert_eq!(hello["type"], "hello");
        assert_eq!(hello["tissues"][1]["name"], "a\"b");
        assert_eq!(hello["tissues"][0]["number"], 1);
        assert_eq!(hello["attenuation_colours"].as_array().unwrap().len(), 256);
    }
}
