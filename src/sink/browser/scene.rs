//! The scene's surfaces for the page's 3-D view, as one answer over HTTP at `/scene`.
//!
//! Little-endian: `INSV`, u32 version 3, u32 length of the JSON that follows (padded with spaces to a multiple of 4).
//! Then follow the vertices (f32 × 3, mm) and triangles (u32 × 3) of each entry in the JSON's `surfaces`. A surface
//! with a layer belongs to the scene. The others follow a tool, in its frame: the probe's housing with the bead on the
//! image's left, and the needle's shaft with its planned path.

use std::sync::Arc;

use serde::Serialize;

use crate::anatomy::tissue::NEEDLE;
use crate::anatomy::{Axes, Mesh, Scene, decimate};
use crate::pose::Pose;
use crate::settings::NeedleSettings;
use crate::sink::colour::{self, Rgb};
use crate::sink::layers::{Layer, Layers};
use crate::transducer::{Probe, housing};

/// Largest number of triangles in a packet; larger scenes are decimated.
pub(crate) const TRIANGLES_MAX: usize = 150_000;

const VERSION: u32 = 3;

/// Length of the planned path beyond the needle's tip, and radius of its line, mm.
const PLANNED_MM: [f64; 2] = [60.0, 0.15];
/// Smallest radius of a shaft that is drawn, mm: a thinner one would hardly be visible.
const SHAFT_RADIUS_MIN_MM: f64 = 0.5;
/// Corners of the shaft's cross-section.
const SHAFT_CORNERS: u32 = 12;

/// Surfaces and probe, encoded once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenePacket(Arc<[u8]>);

#[derive(Serialize)]
struct Header<'a> {
    axes: &'static str,
    probe: ProbeEntry,
    /// Number of triangles before decimation.
    triangles_of_scene: usize,
    layers: Vec<Layer>,
    surfaces: Vec<Entry<'a>>,
}

#[derive(Serialize)]
struct ProbeEntry {
    /// Radius of the face, mm; null for a linear probe.
    face_radius_mm: Option<f64>,
    /// Half of the face's extent: radians, or mm for a linear probe.
    half_extent: f64,
}

#[derive(Serialize)]
struct Entry<'a> {
    name: &'a str,
    tissue: &'a str,
    colour: Rgb,
    /// Index of the layer; null for tools.
    layer: Option<usize>,
    /// Tool in whose frame the surface is; null for surfaces of the scene.
    tool: Option<&'static str>,
    /// Opacity relative to the layer's opacity, 0..=1; absolute for tools, which are in no layer.
    part: f32,
    vertices: usize,
    triangles: usize,
}

impl ScenePacket {
    /// Encodes `scene`, `probe` and the station's needle.
    pub fn new(scene: &Scene, probe: &Probe, needle: Option<&NeedleSettings>, axes: Axes) -> Self {
        let meshes: Vec<&Mesh> = scene.surfaces.iter().map(|s| &s.mesh).collect();
        let (fewer, _) = decimate::cluster_to(&meshes, TRIANGLES_MAX);
        let housing = housing(probe, &Pose::IDENTITY);
        let whole: Vec<_> = scene.surfaces.iter().zip(meshes.iter().copied()).collect();
        let layers = Layers::of(scene, &whole);
        let mut surfaces = Vec::new();
        for ((surface, mesh), member) in scene.surfaces.iter().zip(&fewer).zip(&layers.members) {
            let tissue = scene.tissues.names().get(surface.tissue).map_or("", String::as_str);
            let (name, colour) = (surface.name.as_str(), colour::tissue(tissue));
            let (layer, part) = (Some(member.layer), member.part);
            surfaces.push((Entry { name, tissue, colour, layer, tool: None, part, vertices: 0, triangles: 0 }, mesh));
        }
        let needle = needle.map(needle_meshes);
        let mut add = |name, tool, colour, part, mesh| {
            let entry =
                Entry { name, tissue: "", colour, layer: None, tool: Some(tool), part, vertices: 0, triangles: 0 };
            surfaces.push((entry, mesh));
        };
        add("probe", "probe", [158, 168, 184], 1.0, &housing[0]);
        add("bead", "probe", [255, 158, 26], 1.0, &housing[1]);
        if let Some([shaft, planned]) = &needle {
            add("needle", "needle", colour::tissue(NEEDLE), 1.0, shaft);
            add("planned path", "needle", colour::tissue(NEEDLE), 0.4, planned);
        }
        let mut body = Vec::new();
        let mut entries = Vec::new();
        for (mut entry, mesh) in surfaces {
            (entry.vertices, entry.triangles) = (mesh.vertices_mm.len(), mesh.triangles.len());
            body.extend(mesh.vertices_mm.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes));
            body.extend(mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
            entries.push(entry);
        }
        let header = Header {
            axes: axes.name(),
            probe: ProbeEntry { face_radius_mm: probe.face_radius_mm(), half_extent: probe.half_extent() },
            triangles_of_scene: scene.triangle_count(),
            layers: layers.layers,
            surfaces: entries,
        };
        // Numbers and strings always serialise. If they did not, the page would refuse the empty header.
        let mut json = serde_json::to_vec(&header).unwrap_or_default();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut packet = b"INSV".to_vec();
        packet.extend(VERSION.to_le_bytes());
        packet.extend((json.len() as u32).to_le_bytes());
        packet.extend(json);
        packet.extend(body);
        Self(packet.into())
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// The bytes, shared with a pending response.
    #[cfg(feature = "browser")]
    pub(super) fn shared(&self) -> bytes::Bytes {
        bytes::Bytes::from_owner(self.0.clone())
    }
}

/// The needle's shaft, and the line from its tip that it points to, in the needle's frame.
fn needle_meshes(needle: &NeedleSettings) -> [Mesh; 2] {
    let tube = |radius_mm: f64, from_mm: f64, to_mm: f64| {
        let ring = |z: f64, scale: f64| {
            (0..SHAFT_CORNERS).map(move |i| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(SHAFT_CORNERS)).sin_cos();
                glam::DVec3::new(scale * radius_mm * cos, scale * radius_mm * sin, z).as_vec3()
            })
        };
        // The end narrows over four radii.
        let shoulder_mm = to_mm - (4.0 * radius_mm).min(to_mm - from_mm);
        let vertices_mm = ring(from_mm, 1.0).chain(ring(shoulder_mm, 1.0)).chain(ring(to_mm, 0.05)).collect();
        let quads = (0..2).flat_map(|row| (0..SHAFT_CORNERS).map(move |i| (row * SHAFT_CORNERS, i)));
        let triangles = quads.flat_map(|(row, i)| {
            let next = (i + 1) % SHAFT_CORNERS;
            let [a, b] = [row + i, row + next];
            let [c, d] = [a + SHAFT_CORNERS, b + SHAFT_CORNERS];
            [[a, b, d], [a, d, c]]
        });
        Mesh { vertices_mm, triangles: triangles.collect() }
    };
    let [planned_mm, line_mm] = PLANNED_MM;
    [tube(needle.radius_mm().max(SHAFT_RADIUS_MIN_MM), -needle.length_mm, 0.0), tube(line_mm, 0.0, planned_mm)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{TissueTable, analytic};

    #[test]
    fn a_packet_holds_every_surface_and_the_probe() {
        let table = TissueTable::builtin().unwrap();
        let scene = analytic::scene(analytic::cyst(), &table, "liver").unwrap();
        let packet = ScenePacket::new(&scene, &Probe::default(), Some(&NeedleSettings::default()), Axes::Depth);
        let bytes = packet.bytes();
        assert_eq!(&bytes[..8], b"INSV\x03\0\0\0");
        let length = u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize;
        let header: serde_json::Value = serde_json::from_slice(&bytes[12..12 + length]).unwrap();
        let surfaces = header["surfaces"].as_array().unwrap();
        assert_eq!((surfaces.len(), &surfaces[0]["tissue"]), (5, &"amniotic_fluid".into()));
        assert_eq!((&header["layers"][0]["name"], &surfaces[0]["layer"]), (&"amniotic_fluid".into(), &0.into()));
        assert!(surfaces[1]["layer"].is_null() && surfaces[0]["tool"].is_null());
        assert_eq!((&surfaces[2]["tool"], &surfaces[3]["tool"]), (&"probe".into(), &"needle".into()));
        let size = |s: &serde_json::Value| 12 * (s["vertices"].as_u64().unwrap() + s["triangles"].as_u64().unwrap());
        assert_eq!(bytes.len() as u64, 12 + length as u64 + surfaces.iter().map(size).sum::<u64>());
    }
}
