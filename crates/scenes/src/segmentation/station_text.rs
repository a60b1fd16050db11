//! Station file for a patient's scene, with a probe that fits the first view and the pose of the probe.

use std::fmt::Write as _;

use insonify_core::names::one_line;
use insonify_core::pose::Pose;

use super::gain::Gain;
use super::probe_choice::{CONVEX, LINEAR_WIDTH_MM, PHASED_FOV_DEG, ProbeChoice, ProbeKind};

/// Range from black to white, dB: usual for the abdomen, where haze in fluid is to be seen (assumed).
const DYNAMIC_RANGE_DB: f64 = 66.0;
/// What a probe's face returns of an echo, dB (assumed, as for a needle's echoes).
const FACE_REFLECTION_DB: f64 = -10.0;

/// Text of a station file for `scene`, a path relative to the station file. `what` names the content of the view, for a
/// comment in the file.
pub fn station_text(scene: &str, what: &str, probe: &ProbeChoice, pose: &Pose, gain: &Gain) -> String {
    let ProbeChoice { kind, frequency_mhz, depth_mm, focus_mm } = *probe;
    let mut out = String::new();
    let (radius_mm, fov_deg) = CONVEX;
    let kind = match kind {
        ProbeKind::Convex => format!(
            "kind = \"convex\"              # scanlines start on an arc\n\
             radius_mm = {radius_mm:?}             # radius of curvature of the face\n\
             fov_deg = {fov_deg:?}               # angle of the sector\n"
        ),
        ProbeKind::Linear => format!(
            "kind = \"linear\"              # parallel scanlines\n\
             width_mm = {LINEAR_WIDTH_MM:?}              # width of the face\n"
        ),
        ProbeKind::Phased => format!(
            "kind = \"phased\"              # scanlines start at one point\n\
             fov_deg = {PHASED_FOV_DEG:?}               # angle of the sector\n"
        ),
    };
    let Gain { gain_db, tgc_db_per_cm, tgc_sliders_db } = *gain;
    let p = pose.position_mm;
    let q = pose.orientation;
    let scene = toml::Value::String(scene.to_owned());
    // A comment must stay on one line, whatever characters the names have.
    let what = one_line(what);
    // Writing to a string cannot fail.
    let _ = write!(
        out,
        "# {what}\n# Made by `insonify scene`. Patient axes: x left, y posterior, z superior, mm.\n\n\
         [scene]\npath = {scene}\nbackground = \"gel\"           # tissue outside all surfaces\n\n\
         [probe]\n{kind}\
         frequency_mhz = {frequency_mhz:?}          # centre frequency\n\
         depth_mm = {depth_mm:?}             # image depth from the face\n\
         focus_mm = {focus_mm:?}             # depth of the transmit focus\n\
         elevational_focus_mm = {focus_mm:?} # focal depth of the elevational lens\n\n\
         [image]\nwidth = 1000                 # pixels\nheight = 800                 # pixels\n\
         dynamic_range_db = {DYNAMIC_RANGE_DB:?}      # range from black to white\n\
         gain_db = {gain_db:?}               # overall gain\n\
         tgc_db_per_cm = {tgc_db_per_cm:?}          # usual loss along this view, two ways\n\
         tgc_sliders_db = {tgc_sliders_db:?} # dB from the face to the full depth\n\n\
         [receiver]\nface_reflection_db = {FACE_REFLECTION_DB:?}   # what the face returns of an echo\n\n\
         [effects]\nmultiples = \"on\"             # echoes that the face reflects: A-lines, haze in fluid\n\n\
         [pose]\nposition_mm = [{:.3}, {:.3}, {:.3}]\nquaternion = [{:.9}, {:.9}, {:.9}, {:.9}]\n",
        p.x, p.y, p.z, q.w, q.x, q.y, q.z
    );
    out
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};
    use insonify_core::anatomy::analytic::sphere;

    use super::*;

    #[test]
    fn deep_organs_get_a_convex_probe_of_low_frequency_and_shallow_ones_a_linear_one() {
        let pose = Pose::looking(DVec3::new(0.0, -100.0, 0.0), DVec3::Y, DVec3::X);
        let choice = |name: &str, y: f32, radius: f32| {
            ProbeChoice::for_organ(&pose, name, &sphere(Vec3::new(0.0, y, 0.0), radius, 4))
        };
        let deep = choice("liver", 0.0, 50.0);
        assert!(
            deep.kind == ProbeKind::Convex && deep.frequency_mhz == 3.5 && (deep.depth_mm - 170.0).abs() < 1e-9,
            "{deep:?}"
        );
        let shallow = choice("thyroid_gland", -85.0, 10.0);
        let is_linear = shallow.kind == ProbeKind::Linear;
        assert!(is_linear && shallow.frequency_mhz == 9.0 && shallow.depth_mm == 40.0, "{shallow:?}");
        assert_eq!(choice("heart_ventricle_left", -50.0, 30.0).kind, ProbeKind::Phased);
        // The image ends 60 mm below a lung's pleura, which is 50 mm deep.
        assert_eq!(choice("lung_upper_lobe_left", 0.0, 50.0).depth_mm, 110.0);
        let gain =
            Gain { gain_db: 15.0, tgc_db_per_cm: 3.2, tgc_sliders_db: [0.0, 0.0, 0.0, 1.0, -2.0, 0.0, 0.0, 0.0] };
        let text = station_text("a \"b\".glb", "liver", &deep, &pose, &gain);
        let table: toml::Table = text.parse().unwrap();
        assert_eq!(table["scene"]["path"].as_str(), Some("a \"b\".glb"));
        assert_eq!(table["probe"]["depth_mm"].as_float(), Some(170.0));
        assert_eq!(table["image"]["tgc_db_per_cm"].as_float(), Some(3.2));
        assert_eq!(table["receiver"]["face_reflection_db"].as_float(), Some(FACE_REFLECTION_DB));
        assert_eq!(table["image"]["tgc_sliders_db"][4].as_float(), Some(-2.0));
        // Names of files and organs may have any characters.
        let text = station_text("a\n[b].glb", "li\nver = 3\r\u{1b}[31m\0\u{7f}\u{2028}", &deep, &pose, &gain);
        let table: toml::Table = text.parse().unwrap();
        assert_eq!(table["scene"]["path"].as_str(), Some("a\n[b].glb"));
        assert!(text.starts_with("# li ver = 3 [31m") && !table.contains_key("ver"), "{text}");
    }
}
