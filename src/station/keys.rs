//! All keys of station files, for the parser and for documentation.
//!
//! Keys of settings come from [`settings`](crate::settings); the others are defined here.

use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

use super::accepts::{AXES, Accepts, HOST_NAME, LISTEN_ADDRESS, ORIGIN, TOKEN};
use crate::anatomy::Tissue;
use crate::exam::needle::Approach;
use crate::render::Preset;
use crate::settings::{
    BackendSettings, BrowserSettings, ChoiceSettings, ContactSettings, Effect, FAT_RANGE_MM, FilterSettings,
    GeneratorSettings, ImageSettings, LookBase, LookSettings, NeedleSettings, PipelineSettings, Probe, ProbeKind,
    Quality, ReceiverSettings, RenderSettings, SceneSettings, Setting, SettingsGroup as _, TrackerSettings,
    WindowSettings,
};
use crate::sink::{LiveSinkKind, openigtlink};
use crate::tracker::{BAUD_RANGE, Protocol, TransportKind, mock};

/// A key of a station file.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyDoc {
    /// Name of the table; `tissues.NAME` stands for the table of any tissue.
    pub table: &'static str,
    /// Key without its table.
    pub key: &'static str,
    /// Unit; empty for a number without unit.
    pub unit: &'static str,
    /// Default as TOML, or in words.
    pub default: Cow<'static, str>,
    /// Accepted values.
    pub range: Accepts,
    /// Meaning, as a phrase.
    pub meaning: Cow<'static, str>,
}

/// Table name used for the keys of all tissues.
const TISSUE: &str = "tissues.NAME";

/// Required keys of a new tissue.
pub(super) const PHYSICAL: [&str; 4] = ["speed_m_s", "density_kg_m3", "attenuation_db_cm_mhz", "attenuation_exponent"];

const fn number(min: f64, max: f64) -> Accepts {
    Accepts::Number { min, max }
}

const fn integer(min: i64, max: i64) -> Accepts {
    Accepts::Integer { min, max }
}

const fn doc(
    table: &'static str,
    key: &'static str,
    unit: &'static str,
    default: &'static str,
    range: Accepts,
    meaning: &'static str,
) -> KeyDoc {
    KeyDoc { table, key, unit, default: Cow::Borrowed(default), range, meaning: Cow::Borrowed(meaning) }
}

#[rustfmt::skip]
const SCENE: &[KeyDoc] = &[
    doc("scene", "path", "", "required, unless phantom is given", Accepts::Text("a path"), "glTF file (.glb or .gltf), relative to the station file"),
    doc("scene", "phantom", "", "none", Accepts::OneOf(&["obstetric"]), "generated scene in place of path"),
    doc("scene", "phantom_fat_mm", "mm", "13.5", number(*FAT_RANGE_MM.start(), *FAT_RANGE_MM.end()), "the mother's subcutaneous fat over the belly; 24 with phantom_wall = \"hard\" unless given"),
    doc("scene", "background", "", "\"gel\"", Accepts::Text("the name of a tissue"), "tissue outside of every surface"),
];

#[rustfmt::skip]
const PROBE: &[KeyDoc] = &[
    doc("probe", "kind", "", "\"convex\"", Accepts::OneOf(&["convex", "linear", "phased"]), "shape of the face"),
];

#[rustfmt::skip]
const QUALITY: &[KeyDoc] = &[
    doc("quality", "preset", "", "none", Accepts::OneOf(Preset::NAMES), "rays and layers by name: 1x1, 2x3, 32x3, 128x3"),
    doc("quality", "frame_budget_ms", "ms", "none", number(1.0, 10_000.0), "time to render and generate a frame: a live session chooses rays, layers, angles, samples and generator within it, stills choose rays and layers"),
];

#[rustfmt::skip]
const POSE: &[KeyDoc] = &[
    doc("pose", "position_mm", "mm", "[0.0, 0.0, 0.0]", Accepts::Numbers { count: 3, limit: 1e5 }, "centre of the probe's face in the scene [x, y, z]"),
    doc("pose", "quaternion", "", "[1.0, 0.0, 0.0, 0.0]", Accepts::Numbers { count: 4, limit: 2.0 }, "unit quaternion [qw, qx, qy, qz] that turns probe axes into scene axes"),
];

#[rustfmt::skip]
const CALIBRATION: &[KeyDoc] = &[
    doc("calibration", "path", "", "none", Accepts::Text("a path"), "calibration file of `insonify calibrate`, relative to the station file"),
    doc("calibration", "sensor_from_probe_mm", "mm", "none", Accepts::Numbers { count: 3, limit: 1e5 }, "centre of the probe's face in the frame of its sensor [x, y, z], where no calibration file says it"),
    doc("calibration", "sensor_from_probe_quaternion", "", "none", Accepts::Numbers { count: 4, limit: 2.0 }, "unit quaternion [qw, qx, qy, qz] that turns probe axes into sensor axes"),
];

#[rustfmt::skip]
const TRACKER: &[KeyDoc] = &[
    doc("tracker", "transport", "", "\"none\"", Accepts::OneOf(TransportKind::NAMES), "how the tracker's bytes come; none: the probe stays at [pose]"),
    doc("tracker", "protocol", "", "required, but for hid (spacemouse) and mock (ascii-line)", Accepts::OneOf(Protocol::NAMES), "what the bytes mean; a recording knows its own"),
    doc("tracker", "port", "", "required for serial; for hid the first SpaceMouse", Accepts::Text("a path, or vendor:product or vendor:product:serial,"), "serial port or HID device; `insonify trackers` lists them"),
    doc("tracker", "baud", "baud", "115200", integer(*BAUD_RANGE.start(), *BAUD_RANGE.end()), "speed of the serial port; an NDI device is met at 9600 and switched to it"),
    doc("tracker", "address", "", "required for tcp; for udp \"127.0.0.1:4242\"", Accepts::Text("host:port"), "server to connect to (tcp), or address to listen at (udp)"),
    doc("tracker", "sensor", "", "none: 1 of Polhemus devices, else the only one heard", integer(0, 65_535), "station or port handle that is the probe (openigtlink: `tool`); of several that are heard, none is chosen by itself"),
    doc("tracker", "tool", "", "none: the only one heard", Accepts::Text("the name of a tool"), "tool that is the probe, by its OpenIGTLink name, as in \"ProbeToTracker\"; `insonify trackers` lists the names"),
    doc("tracker", "hemisphere", "", "[0, 0, 1]", Accepts::Numbers { count: 3, limit: 1.0 }, "axis of a Polhemus source that points to where the sensor moves"),
    doc("tracker", "ndi_roms", "", "[]", Accepts::Texts("a path"), "definitions (.rom) of wireless NDI tools, relative to the station file; their handles are asked for in this order"),
    doc("tracker", "axis_map", "", "\"x, y, z, rx, ry, rz\"", Accepts::Text("x, y, z, rx, ry, rz in another order and with signs,"), "device axis that each axis of a puck's motion comes from, as in \"x, -z, y, rx, -rz, ry\""),
    doc("tracker", "recording", "", "required for recording", Accepts::Text("a path"), "recording (.mcap), relative to the station file"),
    doc("tracker", "schedule", "", "\"move 10, hold 2\"", Accepts::Text("acts and seconds"), "what the mock does, again and again: move, hold, jump, drop, corrupt or unplug, each with its seconds; about [pose]"),
];

#[rustfmt::skip]
const NEEDLE: &[KeyDoc] = &[
    doc("needle", "sensor", "", "required for a tracked needle; mock: 1", integer(0, 65_535), "station or port handle of the sensor on the needle (openigtlink: `tool`); a recording knows its own"),
    doc("needle", "tool", "", "required for a tracked needle", Accepts::Text("the name of a tool"), "tool that is the needle, by its OpenIGTLink name, as in \"NeedleToTracker\""),
    doc("needle", "position_mm", "mm", "none", Accepts::Numbers { count: 3, limit: 1e5 }, "tip in the scene [x, y, z], for stills and for sessions that don't track the needle; a mock inserts its needle up to there"),
    doc("needle", "quaternion", "", "[1.0, 0.0, 0.0, 0.0]", Accepts::Numbers { count: 4, limit: 2.0 }, "unit quaternion [qw, qx, qy, qz] that turns needle axes into scene axes; z points along the shaft to the tip, x to the side that the bevel faces"),
];

#[rustfmt::skip]
const GENERATOR: &[KeyDoc] = &[
    doc("generator", "models", "", "[]", Accepts::Texts("a path"), "generators (.onnx, each with its manifest), the best first, relative to the station file; none shows what is rendered"),
];

#[rustfmt::skip]
const OPENIGTLINK: &[KeyDoc] = &[
    doc("openigtlink", "address", "", "\"127.0.0.1\"", Accepts::Text(LISTEN_ADDRESS), "where images and transforms are served; the protocol knows no password"),
    doc("openigtlink", "scene_axes", "", "\"RAS\"", Accepts::Text(AXES), "where the scene's x, y and z point in the patient"),
];

#[rustfmt::skip]
const BROWSER: &[KeyDoc] = &[
    doc("browser", "address", "", "\"127.0.0.1\"", Accepts::Text(LISTEN_ADDRESS), "where the page is served; beyond loopback a token is demanded"),
    doc("browser", "token", "", "none on loopback, else random", Accepts::Text(TOKEN), "token that pages must show; a random one is new at every start"),
    doc("browser", "host_name", "", "none", Accepts::Text(HOST_NAME), "name under which browsers reach the station, at any port, in addition to its addresses"),
    doc("browser", "origins", "", "[]", Accepts::Texts(ORIGIN), "further addresses of the page: of an HTTPS proxy, or under other names"),
];

#[rustfmt::skip]
const DISPLAY: &[KeyDoc] = &[
    doc("display", "sinks", "", "[\"null\"]", Accepts::AnyOf(LiveSinkKind::NAMES), "where frames go"),
];

#[rustfmt::skip]
const EXERCISE: &[KeyDoc] = &[
    doc("exercise", "name", "", "\"needle exercise\"", Accepts::Text("a title"), "title of the exercise on the report"),
    doc("exercise", "target", "", "required, unless target_mm is given", Accepts::Text("the name of a surface"), "surface of the scene that the tip is to reach"),
    doc("exercise", "target_mm", "mm", "none", Accepts::Numbers { count: 3, limit: 1e5 }, "centre of a ball that the tip is to reach instead, in the scene [x, y, z]"),
    doc("exercise", "radius_mm", "mm", "required with target_mm", number(0.1, 500.0), "radius of that ball"),
    doc("exercise", "entry", "", "none: anywhere", Accepts::Text("the name of a surface"), "surface that the tip must enter first"),
    doc("exercise", "entry_mm", "mm", "none", Accepts::Numbers { count: 3, limit: 1e5 }, "centre of a ball in which the tip must enter the first surface instead, in the scene [x, y, z]"),
    doc("exercise", "entry_radius_mm", "mm", "required with entry_mm", number(0.1, 500.0), "radius of that ball"),
    doc("exercise", "forbidden", "", "[]", Accepts::Texts("the name of a surface"), "surfaces that the tip must not enter; a * at the end matches any suffix"),
    doc("exercise", "approach", "", "\"any\"", Accepts::OneOf(Approach::NAMES), "required way of the needle relative to the image plane"),
    doc("exercise", "time_s", "s", "60.0", number(1.0, 3600.0), "time from the entry to the target that earns all points"),
];

/// All keys, grouped by table.
pub fn keys() -> &'static [KeyDoc] {
    static KEYS: LazyLock<Vec<KeyDoc>> = LazyLock::new(|| {
        let mut all = Vec::new();
        let mut add = |others: &[KeyDoc], settings: &[&'static [Setting]]| {
            all.extend_from_slice(others);
            all.extend(settings.iter().copied().flatten().map(KeyDoc::from));
        };
        add(SCENE, &[SceneSettings::settings()]);
        add(PROBE, &[ProbeKind::settings(), Probe::settings()]);
        add(&[], &[ContactSettings::settings()]);
        add(&[], &[ImageSettings::settings()]);
        add(&[], &[ReceiverSettings::settings()]);
        add(&[], &[LookBase::settings(), LookSettings::settings()]);
        add(QUALITY, &[Quality::settings(), RenderSettings::settings()]);
        add(&[], &[BackendSettings::settings()]);
        add(&Effect::ALL.map(KeyDoc::from), &[]);
        add(POSE, &[]);
        add(&[], &[FilterSettings::settings()]);
        add(CALIBRATION, &[]);
        add(TRACKER, &[TrackerSettings::settings(), mock::Settings::settings()]);
        add(NEEDLE, &[NeedleSettings::settings()]);
        add(GENERATOR, &[GeneratorSettings::settings()]);
        add(OPENIGTLINK, &[openigtlink::Settings::settings()]);
        add(BROWSER, &[BrowserSettings::settings()]);
        add(&[], &[WindowSettings::settings()]);
        add(&[], &[PipelineSettings::settings(), ChoiceSettings::settings()]);
        add(EXERCISE, &[]);
        add(DISPLAY, &[]);
        all.extend(Tissue::settings().iter().map(of_tissue));
        all
    });
    &KEYS
}

/// Names of all tables, in order; `tissues` for the tissue tables.
pub(super) fn tables() -> Vec<&'static str> {
    let mut tables: Vec<_> = keys().iter().filter_map(|doc| doc.table.split('.').next()).collect();
    tables.dedup();
    tables
}

impl From<&'static Setting> for KeyDoc {
    fn from(setting: &'static Setting) -> Self {
        let &Setting { table, key, unit, doc, .. } = setting;
        Self { table, key, unit, default: setting.default_toml().into(), range: setting.into(), meaning: phrase(doc) }
    }
}

/// Documentation of a tissue's key. Without the key, a built-in tissue keeps its value.
fn of_tissue(setting: &'static Setting) -> KeyDoc {
    let required = PHYSICAL.contains(&setting.key);
    let default = if required { "built-in, else required" } else { "built-in, else 0.0" };
    KeyDoc { default: default.into(), ..KeyDoc::from(setting) }
}

impl From<Effect> for KeyDoc {
    fn from(effect: Effect) -> Self {
        let range = Accepts::OneOf(effect.words());
        let (key, default) = (effect.name(), "\"auto\"".into());
        Self { table: "effects", key, unit: "", default, range, meaning: phrase(effect.doc()) }
    }
}

/// A sentence turned into a phrase, without its initial capital and full stop.
fn phrase(sentence: &str) -> Cow<'static, str> {
    let sentence = sentence.trim_end_matches('.');
    let (first, rest) = sentence.split_at(sentence.chars().next().map_or(0, char::len_utf8));
    let is_word = rest.chars().next().is_some_and(char::is_lowercase);
    if is_word { format!("{}{rest}", first.to_lowercase()).into() } else { sentence.to_owned().into() }
}

/// Keys of a table. All tables `tissues.…` have the same keys.
pub(super) fn of_table(table: &str) -> impl Iterator<Item = &'static KeyDoc> {
    let table = if table.starts_with("tissues.") { TISSUE } else { table };
    keys().iter().filter(move |doc| doc.table == table)
}

/// Writes all keys as commented TOML-like text, for `--help` and documentation.
///
/// # Errors
/// Writing to `out` fails.
pub fn print_keys(out: &mut dyn fmt::Write) -> fmt::Result {
    let mut table = "";
    for doc in keys() {
        if doc.table != table {
            let gap = if table.is_empty() { "" } else { "\n" };
            writeln!(out, "{gap}[{}]", doc.table)?;
            table = doc.table;
        }
        let unit = if doc.unit.is_empty() { String::new() } else { format!(", {}", doc.unit) };
        writeln!(out, "  {:<22} {}{unit}", doc.key, doc.meaning)?;
        writeln!(out, "  {:<22} {}; default: {}", "", doc.range, doc.default)?;
    }
    Ok(())
}
