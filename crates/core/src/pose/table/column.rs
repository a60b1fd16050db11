//! Meaning of a table's column, from its name.

/// Names of each length unit, and the unit in mm.
const LENGTHS: [(&[&str], f64); 5] = [
    (&["mm", "millimetre", "millimetres", "millimeter", "millimeters"], 1.0),
    (&["cm", "centimetre", "centimetres", "centimeter", "centimeters"], 10.0),
    (&["m", "metre", "metres", "meter", "meters"], 1000.0),
    (&["um", "µm", "μm", "micron", "microns"], 1e-3),
    (&["in", "inch", "inches"], 25.4),
];

/// Names of each time unit, and the unit in seconds.
const TIMES: [(&[&str], f64); 4] = [
    (&["s", "sec", "second", "seconds"], 1.0),
    (&["ms", "millisecond", "milliseconds"], 1e-3),
    (&["us", "µs", "μs"], 1e-6),
    (&["ns"], 1e-9),
];

const QUATERNION_ORDER: &str =
    "whether the scalar part is the first or the last of the four isn't said; name them qw, qx, qy and qz";
const ANGLES: &str =
    "the order and the axes of angles differ between programs; give the rotation as a quaternion in qw, qx, qy and qz";
const MATRIX: &str = "rotation matrices aren't read; give the rotation as a quaternion in qw, qx, qy and qz";
const FRAMES: &str =
    "it doesn't say whose axis it is; name the scene's or a pose's coordinates x, y and z, the tracker's tx, ty and tz";
const VOXELS: &str =
    "voxel indices need their image; give mm along the patient's axes as r,a,s or l,p,s, or the scene's x,y,z";

/// Names of columns that programs write with points, but that are no part of the position.
const UNUSED: [&str; 19] = [
    "id",
    "index",
    "number",
    "description",
    "desc",
    "selected",
    "sel",
    "visible",
    "vis",
    "visibility",
    "locked",
    "lock",
    "associatednodeid",
    "ow",
    "ox",
    "oy",
    "oz",
    "orientation",
    "comment",
];

/// Frame of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// `x`, `y`, `z`: the frame of the table.
    Own,
    /// `r`, `a`, `s` or `l`, `p`, `s`: the patient's axes.
    Patient,
    /// `tx`, `ty`, `tz`: the tracker's frame.
    Tracker,
}

/// Meaning of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Meaning {
    /// A coordinate. For the patient's axes, axes 0, 1 and 2 are left, posterior and superior.
    Length {
        /// Frame of the coordinate.
        frame: Frame,
        /// Axis x, y or z as 0, 1 or 2.
        axis: usize,
        /// −1 if the column points opposite to the axis, else 1.
        sign: f64,
        /// Millimetres per unit; `None` if the name has no unit.
        unit_mm: Option<f64>,
    },
    /// Component of a quaternion: w, x, y, z as 0 to 3.
    Quaternion(usize),
    /// A time.
    Time {
        /// Seconds per unit; `None` if the name has no unit.
        unit_s: Option<f64>,
    },
    /// Name of the row.
    Name,
    /// Whether the row has a pose: `ok`, `invalid` or empty.
    Status,
    /// Name of an event.
    Event,
    /// Whether the row has a position (3D Slicer).
    Defined,
    /// Content that is not needed.
    Unused,
    /// An ambiguous name; the text has the reason and advice.
    Ambiguous(&'static str),
    /// An unknown name.
    Unknown,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name of the column as written in the file.
    pub(crate) name: String,
    /// Meaning of the name.
    pub(crate) meaning: Meaning,
}

impl Column {
    /// Column called `name`. Case, brackets, spaces and full stops don't matter: `X [mm]` is `x_mm`.
    pub(crate) fn of(name: &str) -> Self {
        let name = name.trim().trim_matches(['"', '\'']).trim();
        Self { name: name.to_owned(), meaning: meaning(name) }
    }

    /// Whether the name has a known meaning.
    pub(crate) fn is_known(&self) -> bool {
        !matches!(self.meaning, Meaning::Unknown)
    }
}

fn meaning(name: &str) -> Meaning {
    let lower = name.to_lowercase();
    let mut words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    while words.len() > 1 && ["pose", "field", "transform"].contains(&words[0]) {
        words.remove(0);
    }
    let key = words.join("_");
    if let Some(found) = without_unit(&key) {
        return found;
    }
    let Some((unit, key)) = words.split_last().filter(|(_, rest)| !rest.is_empty()) else {
        return Meaning::Unknown;
    };
    let per_unit =
        |table: &[(&[&str], f64)]| table.iter().find(|(names, _)| names.contains(unit)).map(|(_, factor)| *factor);
    match without_unit(&key.join("_")) {
        Some(Meaning::Length { frame, axis, sign, .. }) => match per_unit(&LENGTHS) {
            Some(mm) => Meaning::Length { frame, axis, sign, unit_mm: Some(mm) },
            None => Meaning::Unknown,
        },
        Some(Meaning::Time { .. }) => match per_unit(&TIMES) {
            Some(s) => Meaning::Time { unit_s: Some(s) },
            None => Meaning::Unknown,
        },
        Some(Meaning::Ambiguous(reason)) => Meaning::Ambiguous(reason),
        _ => Meaning::Unknown,
    }
}

/// Meaning of the column name `key`, from which a unit has been removed; `None` if unknown.
fn without_unit(key: &str) -> Option<Meaning> {
    if let Some(meaning) = coordinate(key) {
        return Some(meaning);
    }
    let quaternion = |letter: &str| "wxyz".find(letter).filter(|_| letter.len() == 1).map(Meaning::Quaternion);
    for prefix in ["q", "q_", "quat_", "quaternion_", "orientation_", "rotation_", "rot_"] {
        if let Some(found) = key.strip_prefix(prefix).and_then(quaternion) {
            return Some(found);
        }
    }
    let is_matrix = |key: &str| key.len() == 3 && ["m", "r"].iter().any(|m| key.starts_with(m)) && digits(&key[1..]);
    Some(match key {
        "time" | "timestamp" | "t" | "time_stamp" | "stamp" => Meaning::Time { unit_s: None },
        "name" | "label" | "landmark" | "point" | "fiducial" => Meaning::Name,
        "status" => Meaning::Status,
        "event" => Meaning::Event,
        "defined" => Meaning::Defined,
        // NDI's q0 is the scalar part. Next to q1 to q3, q0 could also mean x, so names from q1 on are refused.
        "q0" => Meaning::Quaternion(0),
        "q1" | "q2" | "q3" | "q4" | "w" => Meaning::Ambiguous(QUATERNION_ORDER),
        "roll" | "pitch" | "yaw" | "heading" | "azimuth" | "elevation" | "az" | "el" | "ro" | "rx" | "ry" | "rz"
        | "r_x" | "r_y" | "r_z" | "euler_x" | "euler_y" | "euler_z" | "alpha" | "beta" | "gamma" => {
            Meaning::Ambiguous(ANGLES)
        }
        "j" | "k" => Meaning::Ambiguous(VOXELS),
        _ if is_matrix(key) => Meaning::Ambiguous(MATRIX),
        _ if UNUSED.contains(&key) => Meaning::Unused,
        _ => return None,
    })
}

fn digits(text: &str) -> bool {
    text.bytes().all(|b| b.is_ascii_digit())
}

fn coordinate(key: &str) -> Option<Meaning> {
    let length = |frame, axis, sign| Some(Meaning::Length { frame, axis, sign, unit_mm: None });
    match key {
        "l" => return length(Frame::Patient, 0, 1.0),
        "r" => return length(Frame::Patient, 0, -1.0),
        "p" => return length(Frame::Patient, 1, 1.0),
        "a" => return length(Frame::Patient, 1, -1.0),
        "s" => return length(Frame::Patient, 2, 1.0),
        "i" => return length(Frame::Patient, 2, -1.0),
        _ => {}
    }
    let axis = |letter: &str| "xyz".find(letter).filter(|_| letter.len() == 1);
    for (name, signs) in [("lps", [1.0, 1.0, 1.0]), ("ras", [-1.0, -1.0, 1.0])] {
        let last = key.strip_suffix(name).and_then(|rest| rest.strip_suffix('_'));
        let first = key.strip_prefix(name).and_then(|rest| rest.strip_prefix('_'));
        let letter = last.or(first);
        if let Some(axis) = letter.and_then(axis) {
            return length(Frame::Patient, axis, signs[axis]);
        }
    }
    let of = |prefixes: &[&str]| prefixes.iter().find_map(|prefix| key.strip_prefix(prefix).and_then(axis));
    if let Some(axis) = of(&["", "position_", "pos_", "scene_"]) {
        return length(Frame::Own, axis, 1.0);
    }
    // The abbreviation `s` may mean scene, sensor or stylus; `p` may mean position, point, patient, phantom or probe.
    if of(&["s", "s_", "p", "p_"]).is_some() {
        return Some(Meaning::Ambiguous(FRAMES));
    }
    of(&["t", "t_", "tracker_", "translation_", "trans_"]).and_then(|axis| length(Frame::Tracker, axis, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length(name: &str) -> (Frame, usize, f64, Option<f64>) {
        match Column::of(name).meaning {
            Meaning::Length { frame, axis, sign, unit_mm } => (frame, axis, sign, unit_mm),
            other => panic!("{name}: {other:?}"),
        }
    }

    #[test]
    fn names_give_frame_axis_sign_and_unit() {
        assert_eq!(length("x"), (Frame::Own, 0, 1.0, None));
        assert_eq!(length(" Z [mm]"), (Frame::Own, 2, 1.0, Some(1.0)));
        assert_eq!(length("y_cm"), (Frame::Own, 1, 1.0, Some(10.0)));
        assert_eq!(length("X (m)"), (Frame::Own, 0, 1.0, Some(1000.0)));
        assert_eq!(length("\"pose.position.y\""), (Frame::Own, 1, 1.0, None));
        assert_eq!(length("tx"), (Frame::Tracker, 0, 1.0, None));
        assert_eq!(length("Tracker z in"), (Frame::Tracker, 2, 1.0, Some(25.4)));
        assert_eq!(length("Scene X [mm]"), (Frame::Own, 0, 1.0, Some(1.0)));
        assert_eq!(length("tz_m"), (Frame::Tracker, 2, 1.0, Some(1000.0)));
        for (name, axis, sign) in
            [("r", 0, -1.0), ("A", 1, -1.0), ("s", 2, 1.0), ("l", 0, 1.0), ("p", 1, 1.0), ("i", 2, -1.0)]
        {
            assert_eq!(length(name), (Frame::Patient, axis, sign, None), "{name}");
        }
        assert_eq!(length("s_mm"), (Frame::Patient, 2, 1.0, Some(1.0)));
        assert_eq!(length("y_ras"), (Frame::Patient, 1, -1.0, None));
        assert_eq!(length("x_lps_m"), (Frame::Patient, 0, 1.0, Some(1000.0)));
    }

    #[test]
    fn other_names_are_understood_or_refused() {
        let of = |name: &str| Column::of(name).meaning;
        for (i, names) in
            [["qw", "q_w", "q0"], ["qx", "rotation.x", "Quat X"], ["qy", "qy", "qy"], ["qz", "qz", "orientation_z"]]
                .iter()
                .enumerate()
        {
            names.iter().for_each(|name| assert_eq!(of(name), Meaning::Quaternion(i), "{name}"));
        }
        assert_eq!(of("time_ms"), Meaning::Time { unit_s: Some(1e-3) });
        assert_eq!(of("t"), Meaning::Time { unit_s: None });
        assert_eq!((of("Label"), of("vis"), of("defined")), (Meaning::Name, Meaning::Unused, Meaning::Defined));
        for name in ["q1", "w", "roll_deg", "Yaw", "az", "rx_rad", "m00", "k", "sx", "Sy [mm]", "s_z", "px", "p_y_m"] {
            assert!(matches!(of(name), Meaning::Ambiguous(_)), "{name}: {:?}", of(name));
        }
        for name in ["", "xmm", "x_px", "x_s", "time_mm", "liver", "é", "qq", "xy", "x_mm_mm"] {
            assert_eq!(of(name), Meaning::Unknown, "{name}");
        }
    }
}
