//! The scene's surfaces for the page's 3-D view, as one answer over HTTP at `/scene`.
//!
//! Little-endian: `INSV`, u32 version 2, u32 length of the JSON that follows (padded with spaces to a multiple of 4).
//! Then follow the vertices (f32 × 3, mm) and triangles (u32 × 3) of each entry in the JSON's `surfaces`. The last
//! two surfaces are the probe's housing and the bead on the image's left, in the probe frame. Every other surface
//! belongs to one of the JSON's `layers`.

use std::sync::Arc;

use serde::Serialize;

use crate::anatomy::{Axes, Mesh, Scene, decimate};
use crate::pose::Pose;
use crate::sink::colour::{self, Rgb};
use crate::sink::layers::{Layer, Layers};
use crate::transducer::{Probe, housing};

/// Largest number of triangles in a packet; larger scenes are decimated.
pub(crate) const TRIANGLES_MAX: usize = 150_000;

const VERSION: u32 = 2;

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
    /// Index of the layer; null for the probe.
    layer: Option<usize>,
    /// Opacity relative to the layer's opacity, 0..=1; absolute for the probe, which is in no layer.
    part: f32,
    vertices: usize,
    triangles: usize,
}

impl ScenePacket {
    /// Encodes `scene` and `probe`.
    pub fn new(scene: &Scene, probe: &Probe, axes: Axes) -> Self {
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
            surfaces.push((Entry { name, tissue, colour, layer, part, vertices: 0, triangles: 0 }, mesh));
        }
        let parts = [("probe", [158, 168, 184]), ("bead", [255, 158, 26])];
        for ((name, colour), mesh) in parts.into_iter().zip(&housing) {
            surfaces
                .push((Entry { name, tissue: "", colour, layer: None, part: 1.0, vertices: 0, triangles: 0 }, mesh));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{TissueTable, analytic};

    #[test]
    fn a_packet_holds_every_surface_and_the_probe() {
        let table = TissueTable::builtin().unwrap();
        let scene = analytic::scene(analytic::cyst(), &table, "liver").unwrap();
        let packet = ScenePacket::new(&scene, &Probe::default(), Axes::Depth);
        let bytes = packet.bytes();
        assert_eq!(&bytes[..8], b"INSV\x02\0\0\0");
        let length = u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize;
        let header: serde_json::Value = serde_json::from_slice(&bytes[12..12 + length]).unwrap();
        let surfaces = header["surfaces"].as_array().unwrap();
        assert_eq!((surfaces.len(), &surfaces[0]["tissue"]), (3, &"amniotic_fluid".into()));
        assert_eq!((&header["layers"][0]["name"], &surfaces[0]["layer"]), (&"amniotic_fluid".into(), &0.into()));
        assert!(surfaces[1]["layer"].is_null());
        let size = |s: &serde_json::Value| 12 * (s["vertices"].as_u64().unwrap() + s["triangles"].as_u64().unwrap());
        assert_eq!(bytes.len() as u64, 12 + length as u64 + surfaces.iter().map(size).sum::<u64>());
    }
}
