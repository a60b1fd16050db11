//! Station file for a patient's scene, with a probe that fits the first view and the pose of the probe.

use std::fmt::Write as _;

use insonify_core::anatomy::Mesh;
use insonify_core::names::one_line;
use insonify_core::pose::Pose;

/// Smallest and largest image depth, mm.
const DEPTHS_MM: [f64; 2] = [40.0, 220.0];
/// Distance from the organ's deepest point to the bottom of the image, mm.
const BELOW_MM: f64 = 15.0;
/// Largest image depth for which a linear probe is chosen, mm.
const LINEAR_MM: f64 = 60.0;

/// Probe for a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeChoice {
    /// Whether the probe is convex; otherwise it is linear.
    pub is_convex: bool,
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Image depth, mm.
    pub depth_mm: f64,
    /// Depth of the focus, mm.
    pub focus_mm: f64,
}

impl ProbeChoice {
    /// Probe at `pose` that shows all of `target`: a linear probe if the target is near the skin, else a convex one.
    pub fn for_target(pose: &Pose, target: &Mesh) -> Self {
        let probe_from_scene = pose.inverse();
        let depth = |v: &glam::Vec3| probe_from_scene.transform_point(v.as_dvec3()).z;
        let deepest_mm = target.vertices_mm.iter().map(depth).fold(0.0, f64::max);
        Self::of_depth(deepest_mm + BELOW_MM)
    }

    /// Probe for an image depth of `depth_mm`, rounded up to whole cm, within 40 to 220 mm.
    pub fn of_depth(depth_mm: f64) -> Self {
        let depth_mm = (10.0 * (depth_mm / 10.0).ceil()).clamp(DEPTHS_MM[0], DEPTHS_MM[1]);
        let is_convex = depth_mm > LINEAR_MM;
        let frequency_mhz = match depth_mm {
            d if d <= LINEAR_MM => 9.0,
            d if d <= 110.0 => 5.0,
            _ => 3.5,
        };
        Self { is_convex, frequency_mhz, depth_mm, focus_mm: (0.55 * depth_mm).round() }
    }
}

/// Text of a station file for `scene`, a path relative to the station file. `what` names the content of the view, for a
/// comment in the file.
pub fn station_text(scene: &str, what: &str, probe: &ProbeChoice, pose: &Pose) -> String {
    let ProbeChoice { is_convex, frequency_mhz, depth_mm, focus_mm } = *probe;
    let mut out = String::new();
    let kind = if is_convex {
        "kind = \"convex\"              # scanlines start on an arc\n\
         radius_mm = 60.0             # radius of curvature of the face\n\
         fov_deg = 60.0               # angle of the sector\n"
    } else {
        "kind = \"linear\"              # parallel scanlines\n\
         width_mm = 40.0              # width of the face\n"
    };
    // Two-way loss of soft tissue and muscle at the probe's frequency, dB/cm.
    let tgc = (10.0 * 1.3 * frequency_mhz).round() / 10.0;
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
         gain_db = 12.0               # overall gain\n\
         tgc_db_per_cm = {tgc:?}          # loss of soft tissue, two ways\n\n\
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
        let choice = |y: f32, radius: f32| ProbeChoice::for_target(&pose, &sphere(Vec3::new(0.0, y, 0.0), radius, 4));
        let deep = choice(0.0, 50.0);
        assert!(deep.is_convex && deep.frequency_mhz == 3.5 && (deep.depth_mm - 170.0).abs() < 1e-9, "{deep:?}");
        let shallow = choice(-85.0, 10.0);
        assert!(!shallow.is_convex && shallow.frequency_mhz == 9.0 && shallow.depth_mm == 40.0, "{shallow:?}");
        let text = station_text("a \"b\".glb", "liver", &deep, &pose);
        let table: toml::Table = text.parse().unwrap();
        assert_eq!(table["scene"]["path"].as_str(), Some("a \"b\".glb"));
        assert_eq!(table["probe"]["depth_mm"].as_float(), Some(170.0));
        // Names of files and organs may have any characters.
        let text = station_text("a\n[b].glb", "li\nver = 3\r\u{1b}[31m\0\u{7f}\u{2028}", &deep, &pose);
        let table: toml::Table = text.parse().unwrap();
        assert_eq!(table["scene"]["path"].as_str(), Some("a\n[b].glb"));
        assert!(text.starts_with("# li ver = 3 [31m") && !table.contains_key("ver"), "{text}");
    }
}
