//! Every key of a station file: the parser reads by this table and documentation is printed from it.

use std::fmt;

use crate::anatomy::phantom::parameters::{
    FAT_RANGE_MM, FLEXION_RANGE, FLUID_INDEX_RANGE_MM, ROLL_RANGE_DEG, WEEKS_RANGE,
};
use crate::anatomy::phantom::{Lie, PlacentaSite};
use crate::generator::{Provider, Settings};
use crate::render::{BEAM_TAPS_MAX, BackendChoice, Choice, PULSE_TAPS_MAX, Preset, REFLECTIONS_MAX};
use crate::sink::LiveSinkKind;

/// Values that a key takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Accepts {
    /// A number.
    Number {
        /// Least.
        min: f64,
        /// Greatest.
        max: f64,
    },
    /// A whole number.
    Integer {
        /// Least.
        min: i64,
        /// Greatest.
        max: i64,
    },
    /// Numbers in brackets.
    Numbers {
        /// How many.
        count: usize,
        /// Greatest magnitude of each.
        limit: f64,
    },
    /// One of some words.
    OneOf(&'static [&'static str]),
    /// Any of some words, in brackets.
    AnyOf(&'static [&'static str]),
    /// Any text, with what it says.
    Text(&'static str),
    /// Texts in brackets, with what each says.
    Texts(&'static str),
    /// true or false.
    Bool,
    /// A table.
    Table,
}

impl fmt::Display for Accepts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { min, max } => write!(f, "a number in {min}..={max}"),
            Self::Integer { min, max } => write!(f, "a whole number in {min}..={max}"),
            Self::Numbers { count, limit } => write!(f, "[{count} numbers within ±{limit}]"),
            Self::OneOf(words) => write!(f, "one of \"{}\"", words.join("\", \"")),
            Self::AnyOf(words) => write!(f, "[any of \"{}\"]", words.join("\", \"")),
            Self::Text(what) => write!(f, "{what} in quotes"),
            Self::Texts(what) => write!(f, "[{what} each, in quotes]"),
            Self::Bool => write!(f, "true or false"),
            Self::Table => write!(f, "a table"),
        }
    }
}

/// A key of a station file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyDoc {
    /// Its table; `tissues.NAME` for any tissue.
    pub table: &'static str,
    /// The key.
    pub key: &'static str,
    /// Unit, or empty.
    pub unit: &'static str,
    /// Default as TOML, or a word on what happens without it.
    pub default: &'static str,
    /// Values that it takes.
    pub range: Accepts,
    /// What it means.
    pub meaning: &'static str,
}

/// Table of every tissue's keys.
pub(super) const TISSUE: &str = "tissues.NAME";

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
    KeyDoc { table, key, unit, default, range, meaning }
}

/// Every key, table by table.
#[rustfmt::skip]
pub const KEYS: &[KeyDoc] = &[
    doc("scene", "path", "", "required, unless phantom is given", Accepts::Text("a path"), "glTF file (.glb or .gltf), relative to the station file"),
    doc("scene", "phantom", "", "none", Accepts::OneOf(&["obstetric"]), "generated scene in place of path"),
    doc("scene", "phantom_scale", "", "1.0", number(0.01, 20.0), "triangles of the phantom over those of the full one; below about 0.21 its finest parts are lost and it is refused"),
    doc("scene", "phantom_weeks", "weeks", "22.0", number(*WEEKS_RANGE.start(), *WEEKS_RANGE.end()), "gestational age of the phantom's fetus"),
    doc("scene", "phantom_lie", "", "\"cephalic\"", Accepts::OneOf(Lie::WORDS), "which way the fetus lies: head down, head up, or across"),
    doc("scene", "phantom_roll_deg", "°", "0.0", number(*ROLL_RANGE_DEG.start(), *ROLL_RANGE_DEG.end()), "turn of the fetus about its long axis from where its left side is up"),
    doc("scene", "phantom_flexion", "", "0.5", number(*FLEXION_RANGE.start(), *FLEXION_RANGE.end()), "0 is stretched, 1 tightly curled"),
    doc("scene", "phantom_placenta", "", "\"anterior\"", Accepts::OneOf(PlacentaSite::WORDS), "where on the uterine wall the placenta sits"),
    doc("scene", "phantom_fluid_index_mm", "mm", "140.0", number(*FLUID_INDEX_RANGE_MM.start(), *FLUID_INDEX_RANGE_MM.end()), "amniotic fluid index, from oligohydramnios to polyhydramnios"),
    doc("scene", "phantom_fat_mm", "mm", "13.5", number(*FAT_RANGE_MM.start(), *FAT_RANGE_MM.end()), "the mother's subcutaneous fat over the belly"),
    doc("scene", "phantom_seed", "", "0", integer(0, u32::MAX as i64), "seed of what differs from one individual to the next"),
    doc("scene", "motion", "", "true", Accepts::Bool, "whether what moves in the scene moves: hearts, breath, limbs; one frame shows time 0, at rest"),
    doc("scene", "background", "", "\"gel\"", Accepts::Text("the name of a tissue"), "tissue outside of every surface"),

    doc("probe", "kind", "", "\"convex\"", Accepts::OneOf(&["convex", "linear", "phased"]), "shape of the face"),
    doc("probe", "radius_mm", "mm", "40.0", number(1.0, 1000.0), "radius of curvature of the face (convex)"),
    doc("probe", "fov_deg", "degrees", "70.0", number(0.1, 180.0), "angle of the sector (convex, phased)"),
    doc("probe", "width_mm", "mm", "40.0", number(0.1, 1000.0), "width of the face (linear)"),
    doc("probe", "frequency_mhz", "MHz", "8.0", number(0.5, 40.0), "centre frequency"),
    doc("probe", "fractional_bandwidth", "", "0.6", number(0.05, 1.5), "two-way -6 dB bandwidth over the centre frequency"),
    doc("probe", "depth_mm", "mm", "150.0", number(1.0, 500.0), "image depth from the face, at 1540 m/s"),
    doc("probe", "scanlines", "", "256", integer(1, 1024), "scanlines"),
    doc("probe", "samples", "", "3072", integer(1, 8192), "complex baseband samples a scanline"),
    doc("probe", "focus_mm", "mm", "70.0", number(1.0, 1000.0), "depth of the transmit focus"),
    doc("probe", "aperture_mm", "mm", "20.0", number(0.5, 200.0), "widest active aperture"),
    doc("probe", "elevational_height_mm", "mm", "12.0", number(0.5, 100.0), "height of the elevational lens"),
    doc("probe", "elevational_focus_mm", "mm", "70.0", number(1.0, 1000.0), "focal depth of the elevational lens"),

    doc("image", "width", "pixels", "1386", integer(16, 4096), "image width"),
    doc("image", "height", "pixels", "1000", integer(16, 4096), "image height"),
    doc("image", "dynamic_range_db", "dB", "60.0", number(1.0, 200.0), "levels from black to white"),
    doc("image", "gain_db", "dB", "0.0", number(-200.0, 200.0), "level added everywhere; at 0 an unattenuated perfect reflector is white"),
    doc("image", "tgc_db_per_cm", "dB/cm", "8.0", number(0.0, 100.0), "time-gain compensation a cm of depth"),
    doc("image", "tgc_sliders_db", "dB", "[0, 0, 0, 0, 0, 0, 0, 0]", Accepts::Numbers { count: 8, limit: 100.0 }, "gain at eight depths evenly from the face to the full depth, added to it"),

    doc("quality", "preset", "", "none", Accepts::OneOf(Preset::NAMES), "rays and layers by name: 1x1, 2x3, 32x3, 128x3"),
    doc("quality", "budget_ms", "ms", "none", number(1.0, 10_000.0), "time to render a frame: the best rays and layers that keep it on this machine are measured at the start, and changed while a live session runs"),
    doc("quality", "rays", "", "1", integer(1, 256), "rays per scanline and layer"),
    doc("quality", "layers", "", "1", integer(1, 33), "elevational layers"),
    doc("quality", "reflections_max", "", "6", integer(0, REFLECTIONS_MAX as i64), "reflections that a path is followed through"),
    doc("quality", "beam_taps_max", "", "65", integer(3, BEAM_TAPS_MAX as i64), "most taps of the lateral beam; a wider one is cut, and its speckle narrower"),
    doc("quality", "pulse_taps_max", "", "257", integer(3, PULSE_TAPS_MAX as i64), "most taps of the pulse; likewise"),
    doc("quality", "seed", "", "0", integer(0, 4_294_967_295), "seed of every random choice"),

    doc("render", "backend", "", "\"auto\"", Accepts::OneOf(BackendChoice::WORDS), "where frames are made: on a device (a GPU, else software Vulkan), on the host's processors, or auto: on a GPU if there is one, else on the host; INSONIFY_BACKEND and --backend override it"),

    doc("effects", "refraction", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "paths bend where the speed of sound changes"),
    doc("effects", "speed_displacement", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "a slow or fast tissue displaces what lies behind it"),
    doc("effects", "interface_echoes", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "echoes of the places where the medium changes"),
    doc("effects", "roughness", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "microfacets of rough interfaces"),
    doc("effects", "thickness", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "echoes spread over the thickness of an interface"),
    doc("effects", "reflections", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "paths that reflect: mirror images, reverberation"),
    doc("effects", "rays", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "several rays a scanline and layer; off: one"),
    doc("effects", "layers", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "several elevational layers; off: one"),
    doc("effects", "attenuation", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "loss along the path, in the image and in its map"),
    doc("effects", "frequency_exponent", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "attenuation by a power of the frequency other than 1"),
    doc("effects", "scatterers", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "speckle"),
    doc("effects", "motion", "", "\"auto\"", Accepts::OneOf(Choice::WORDS), "parts that move, and drift of the whole scene"),
    doc("effects", "maps", "", "\"auto\"", Accepts::OneOf(&["auto", "on"]), "segmentation and attenuation beside the image; auto: where a sink or a generator reads them"),

    doc("pose", "position_mm", "mm", "[0.0, 0.0, 0.0]", Accepts::Numbers { count: 3, limit: 1e5 }, "centre of the probe's face in the scene [x, y, z]"),
    doc("pose", "quaternion", "", "[1.0, 0.0, 0.0, 0.0]", Accepts::Numbers { count: 4, limit: 2.0 }, "unit quaternion [qw, qx, qy, qz] that turns probe axes into scene axes"),

    doc("filter", "min_cutoff_hz", "Hz", "1.0", number(0.01, 1000.0), "cutoff of the position's One-Euro filter at rest; lower is steadier and lags more"),
    doc("filter", "beta", "Hz per mm/s", "0.5", number(0.0, 100.0), "what is added to that cutoff for the speed; higher lags less"),
    doc("filter", "rotation_min_cutoff_hz", "Hz", "1.0", number(0.01, 1000.0), "cutoff of the rotation's filter at rest"),
    doc("filter", "rotation_beta", "Hz per degree/s", "0.5", number(0.0, 100.0), "what is added to that cutoff for the angular speed"),
    doc("filter", "speed_cutoff_hz", "Hz", "1.5", number(0.01, 1000.0), "cutoff of the speeds' filters"),
    doc("filter", "prediction_ms", "ms", "30.0", number(0.0, 200.0), "longest prediction towards the time of display"),
    doc("filter", "held_ms", "ms", "100.0", number(1.0, 500.0), "age of the last measurement above which the pose is held"),
    doc("filter", "stale_ms", "ms", "500.0", number(500.0, 2000.0), "age above which it is stale"),
    doc("filter", "lost_ms", "ms", "2000.0", number(2000.0, 3_600_000.0), "age above which it is lost"),
    doc("filter", "stuck_ms", "ms", "2000.0", number(0.0, 3_600_000.0), "exactly equal readings for so long are noted as stuck; 0 notes nothing"),
    doc("filter", "max_speed_mm_s", "mm/s", "3000.0", number(1.0, 1e9), "fastest motion of a hand; a measurement beyond it is dropped unless the next one confirms it"),
    doc("filter", "max_speed_deg_s", "degrees/s", "2000.0", number(1.0, 1e9), "fastest turn of a hand"),
    doc("filter", "puck_mm_s", "mm/s", "80.0", number(0.0, 10_000.0), "speed at full push of a device that gives rates (SpaceMouse)"),
    doc("filter", "puck_deg_s", "degrees/s", "45.0", number(0.0, 10_000.0), "angular speed at its full twist"),

    doc("calibration", "path", "", "none", Accepts::Text("a path"), "calibration file of `insonify calibrate`, relative to the station file"),
    doc("calibration", "sensor_from_probe_mm", "mm", "none", Accepts::Numbers { count: 3, limit: 1e5 }, "centre of the probe's face in the frame of its sensor [x, y, z], where no calibration file says it"),
    doc("calibration", "sensor_from_probe_quaternion", "", "none", Accepts::Numbers { count: 4, limit: 2.0 }, "unit quaternion [qw, qx, qy, qz] that turns probe axes into sensor axes"),
    doc("tracker", "transport", "", "\"none\"", Accepts::OneOf(&["none", "serial", "tcp", "udp", "hid", "mock", "recording"]), "how the tracker's bytes come; none: the probe stays at [pose]"),
    doc("tracker", "protocol", "", "required, but for hid (spacemouse) and mock (ascii-line)", Accepts::Text("the name of a protocol"), "what the bytes mean: ascii-line, fastrak-ascii, fastrak-binary, liberty, patriot, ndi, spacemouse, bno08x, bno08x-roll-first, opentrack or openigtlink; a recording knows its own"),
    doc("tracker", "port", "", "required for serial; for hid the first SpaceMouse", Accepts::Text("a path, or vendor:product or vendor:product:serial,"), "serial port or HID device; `insonify trackers` lists them"),
    doc("tracker", "baud", "baud", "115200", integer(300, 4_000_000), "speed of the serial port; an NDI device is met at 9600 and switched to it"),
    doc("tracker", "address", "", "required for tcp; for udp \"127.0.0.1:4242\"", Accepts::Text("host:port"), "server to connect to (tcp), or address to listen at (udp)"),
    doc("tracker", "sensor", "", "none: 1 of Polhemus devices, else the first heard", integer(0, 65_535), "station, port handle or tool that is the probe"),
    doc("tracker", "silence_ms", "ms", "2000.0", number(10.0, 600_000.0), "silence after which the tracker is started anew"),
    doc("tracker", "reset_delay_ms", "ms", "20000.0", number(0.0, 120_000.0), "time that a Polhemus device takes to start after a reset"),
    doc("tracker", "hemisphere", "", "[0, 0, 1]", Accepts::Numbers { count: 3, limit: 1.0 }, "axis of a Polhemus source that points to where the sensor moves"),
    doc("tracker", "ndi_reply", "", "\"BX\"", Accepts::OneOf(&["BX", "TX"]), "what an NDI device is asked for: binary replies, or text, the only ones that older devices know"),
    doc("tracker", "ndi_roms", "", "[]", Accepts::Texts("a path"), "definitions (.rom) of wireless NDI tools, relative to the station file; their handles are asked for in this order"),
    doc("tracker", "ndi_out_of_volume", "", "true", Accepts::Bool, "whether an NDI tool outside of the characterised volume still gives poses"),
    doc("tracker", "puck_range", "", "350.0", number(1.0, 32_767.0), "what a SpaceMouse reports when it is pushed all the way; `[filter] puck_mm_s` and `puck_deg_s` are the speeds there"),
    doc("tracker", "axis_map", "", "\"x, y, z, rx, ry, rz\"", Accepts::Text("x, y, z, rx, ry, rz in another order and with signs,"), "device axis that each axis of a puck's motion comes from, as in \"x, -z, y, rx, -rz, ry\""),
    doc("tracker", "recording", "", "required for recording", Accepts::Text("a path"), "recording (.mcap), relative to the station file"),
    doc("tracker", "speed", "", "1.0", number(0.0, 1000.0), "how many times as fast as recorded; 0: as fast as it is taken"),
    doc("tracker", "repeat", "", "\"no\"", Accepts::OneOf(&["no", "yes"]), "whether the recording begins anew at its end"),
    doc("tracker", "schedule", "", "\"move 10, hold 2\"", Accepts::Text("acts and seconds"), "what the mock does, again and again: move, hold, jump, drop, corrupt or unplug, each with its seconds; about [pose]"),
    doc("tracker", "rate_hz", "Hz", "60.0", number(1.0, 1000.0), "records a second of the mock"),
    doc("tracker", "seed", "", "0", integer(0, 4_294_967_295), "seed of the mock's motion"),
    doc("openigtlink", "address", "", "\"127.0.0.1\"", Accepts::Text(super::values::LISTEN_ADDRESS), "where images and transforms are served; the protocol knows no password"),
    doc("openigtlink", "port", "", "18944", integer(0, 65_535), "its port; 0 takes any free one"),
    doc("openigtlink", "scene_axes", "", "\"RAS\"", Accepts::Text(super::openigtlink::AXES), "where the scene's x, y and z point in the patient"),
    doc("openigtlink", "slice_mm", "mm", "1.0", number(0.01, 100.0), "thickness of the image that receivers are told"),
    doc("openigtlink", "clients_max", "", "16", integer(1, 256), "receivers that may be connected at a time"),
    doc("generator", "enabled", "", "true", Accepts::Bool, "whether generators run at all"),
    doc("generator", "models", "", "[]", Accepts::Texts("a path"), "generators (.onnx, each with its manifest), the best first, relative to the station file; none shows what is rendered"),
    doc("generator", "provider", "", "\"cpu\"", Accepts::OneOf(Provider::NAMES), "what they run on; one that is not available is an error"),
    doc("generator", "threads", "", "0", integer(0, 256), "threads of one run; 0 is one a processor"),
    doc("generator", "budget_ms", "ms", "50.0", number(Settings::BUDGET_MS[0], Settings::BUDGET_MS[1]), "time that one run may take; a generator that cannot keep it is not started"),
    doc("browser", "address", "", "\"127.0.0.1\"", Accepts::Text(super::values::LISTEN_ADDRESS), "where the page is served; beyond loopback a token is demanded"),
    doc("browser", "port", "", "8790", integer(0, 65_535), "its port; 0 takes any free one"),
    doc("browser", "token", "", "none on loopback, else random", Accepts::Text(super::browser::TOKEN), "token that pages must show; a random one is new at every start"),
    doc("browser", "host_name", "", "none", Accepts::Text(super::browser::HOST_NAME), "name under which browsers reach the station, beside its addresses"),
    doc("browser", "clients_max", "", "8", integer(1, 64), "pages that may watch at a time"),

    doc("window", "full_screen", "", "false", Accepts::Bool, "whether the native window fills the screen; F changes it"),
    doc("pipeline", "frame_rate_hz", "Hz", "30.0", number(0.1, 1000.0), "frames a second; a slower device gives as many as it can"),
    doc("pipeline", "budget_ms", "ms", "100.0", number(0.0, 10_000.0), "from sampling a frame's pose until it is shown at the latest, whatever the generator does"),
    doc("pipeline", "hold_mm", "mm", "0.3", number(0.0, 100.0), "distance from the last generated frame up to which that is held"),
    doc("pipeline", "hold_deg", "degrees", "0.3", number(0.0, 180.0), "angle from the last generated frame up to which that is held"),
    doc("pipeline", "steady_frames", "", "8", integer(1, 256), "frames in a row that the generator must be ready for before its frames are shown"),
    doc("pipeline", "hang_ms", "ms", "5000.0", number(10.0, 600_000.0), "length of a generator run that counts as hanging"),
    doc("pipeline", "finish_ms", "ms", "10000.0", number(0.0, 600_000.0), "time that displays have to finish at the end"),

    doc("display", "sinks", "", "[\"null\"]", Accepts::AnyOf(LiveSinkKind::NAMES), "where frames go"),

    doc(TISSUE, "speed_m_s", "m/s", "built-in, else required", number(100.0, 10_000.0), "speed of sound"),
    doc(TISSUE, "density_kg_m3", "kg/m3", "built-in, else required", number(0.1, 25_000.0), "density"),
    doc(TISSUE, "attenuation_db_cm_mhz", "dB/cm", "built-in, else required", number(0.0, 100.0), "attenuation at 1 MHz, one way"),
    doc(TISSUE, "attenuation_exponent", "", "built-in, else required", number(0.0, 3.0), "power of the frequency in the attenuation"),
    doc(TISSUE, "scatterer_density", "", "built-in, else 0.0", number(0.0, 1.0), "part of the lattice's cells with a scatterer"),
    doc(TISSUE, "scatterer_mean", "", "built-in, else 0.0", number(-10.0, 10.0), "mean amplitude of a scatterer, relative to a perfect reflector"),
    doc(TISSUE, "scatterer_deviation", "", "built-in, else 0.0", number(0.0, 10.0), "standard deviation of a scatterer's amplitude"),
    doc(TISSUE, "roughness", "", "built-in, else 0.0", number(0.0, 2.0), "RMS slope of its surfaces' microfacets; 0 is a mirror"),
    doc(TISSUE, "thickness_mm", "mm", "built-in, else 0.0", number(0.0, 10.0), "thickness of the transition at its surfaces"),
];

/// The documented keys of a table; of any `tissues.…` those of a tissue.
pub(super) fn of_table(table: &str) -> impl Iterator<Item = &'static KeyDoc> {
    let table = if table.starts_with("tissues.") { TISSUE } else { table };
    KEYS.iter().filter(move |doc| doc.table == table)
}

/// Writes every key as commented TOML-like text, for `--help` and documentation.
///
/// # Errors
/// Those of `out`.
pub fn print_keys(out: &mut dyn fmt::Write) -> fmt::Result {
    let mut table = "";
    for doc in KEYS {
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
