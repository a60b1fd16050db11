//! Layers of a scene: surfaces that a picture of the scene shows, hides and fades together.
//!
//! A body with skin has anatomical layers. Layers that enclose the organs or the fetus are transparent or hidden at
//! first. Other scenes have one layer for each tissue; their large surfaces are more transparent, because they
//! enclose small ones.

use serde::Serialize;

use super::colour;
use crate::anatomy::{Mesh, Scene, Surface};
use crate::phantom::{FETAL_SKIN, FETAL_SURFACES};

/// Anatomical layers, from the outside inward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Anatomy {
    Skin,
    Fat,
    Muscle,
    SoftTissue,
    Bones,
    Organs,
    Vessels,
    Uterus,
    Placenta,
    Fetus,
    FetalOrgans,
    FetalBones,
    Other,
}

impl Anatomy {
    /// All layers, in order.
    const ALL: [Self; 13] = [
        Self::Skin,
        Self::Fat,
        Self::Muscle,
        Self::SoftTissue,
        Self::Bones,
        Self::Organs,
        Self::Vessels,
        Self::Uterus,
        Self::Placenta,
        Self::Fetus,
        Self::FetalOrgans,
        Self::FetalBones,
        Self::Other,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Skin => "skin",
            Self::Fat => "fat",
            Self::Muscle => "muscle",
            Self::SoftTissue => "soft_tissue",
            Self::Bones => "bones",
            Self::Organs => "organs",
            Self::Vessels => "vessels",
            Self::Uterus => "uterus",
            Self::Placenta => "placenta",
            Self::Fetus => "fetus",
            Self::FetalOrgans => "fetal_organs",
            Self::FetalBones => "fetal_bones",
            Self::Other => "other",
        }
    }
}

/// A layer of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Layer {
    /// Name, with underscores.
    pub(crate) name: String,
    /// Opacity of the layer's most opaque surface, 0..=1.
    pub(crate) opacity: f32,
    /// Whether it is shown when the scene is opened.
    pub(crate) is_shown: bool,
}

/// Membership of a surface in a layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Member {
    /// Index of the layer.
    pub(crate) layer: usize,
    /// Opacity relative to the layer's opacity, 0..=1.
    pub(crate) part: f32,
}

/// Layers of some surfaces of a scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layers {
    /// Layers with surfaces, from the outside inward.
    pub(crate) layers: Vec<Layer>,
    /// Membership of each surface, in the order of the surfaces.
    pub(crate) members: Vec<Member>,
}

impl Layers {
    /// Layers of `surfaces`, which belong to `scene`. Each surface is paired with the mesh that is shown for it.
    pub(crate) fn of(scene: &Scene, surfaces: &[(&Surface, &Mesh)]) -> Self {
        let tissue = |surface: &Surface| tissue_of(scene, surface);
        if !scene.surfaces.iter().any(|surface| tissue(surface) == "skin") {
            return Self::of_tissues(scene, surfaces);
        }
        let has_fetus = scene.surfaces.iter().any(|surface| surface.name == FETAL_SKIN);
        let anatomy: Vec<Anatomy> = surfaces.iter().map(|(s, _)| anatomy(&s.name, tissue(s), has_fetus)).collect();
        let kinds: Vec<Anatomy> = Anatomy::ALL.into_iter().filter(|kind| anatomy.contains(kind)).collect();
        let layers = kinds.iter().map(|kind| {
            let (opacity, is_shown) = at_first(*kind, has_fetus);
            Layer { name: kind.name().to_owned(), opacity, is_shown }
        });
        let members = anatomy.iter().zip(surfaces).map(|(kind, (surface, _))| Member {
            layer: kinds.iter().position(|other| other == kind).unwrap_or_default(),
            part: part(&surface.name, tissue(surface)),
        });
        Self { layers: layers.collect(), members: members.collect() }
    }

    /// One layer for each tissue.
    fn of_tissues(scene: &Scene, surfaces: &[(&Surface, &Mesh)]) -> Self {
        let meshes: Vec<&Mesh> = surfaces.iter().map(|(_, mesh)| *mesh).collect();
        let opacities = colour::opacities(&meshes);
        let mut layers: Vec<Layer> = Vec::new();
        let mut members = Vec::new();
        for ((surface, _), &opacity) in surfaces.iter().zip(&opacities) {
            let name = tissue_of(scene, surface);
            let index = layers.iter().position(|layer| layer.name == name).unwrap_or_else(|| {
                layers.push(Layer { name: name.to_owned(), opacity: 0.0, is_shown: true });
                layers.len() - 1
            });
            if let Some(layer) = layers.get_mut(index) {
                layer.opacity = layer.opacity.max(opacity);
            }
            members.push(Member { layer: index, part: 1.0 });
        }
        for (member, opacity) in members.iter_mut().zip(opacities) {
            member.part = layers.get(member.layer).map_or(1.0, |layer| opacity / layer.opacity);
        }
        Self { layers, members }
    }

    /// Opacity of a surface when the scene is opened, 0..=1.
    pub(crate) fn opacity(&self, surface: usize) -> f32 {
        self.member(surface).map_or(1.0, |(layer, part)| if layer.is_shown { layer.opacity * part } else { 0.0 })
    }

    /// Opacity of a surface if its layer is shown, 0..=1.
    pub(crate) fn opacity_if_shown(&self, surface: usize) -> f32 {
        self.member(surface).map_or(1.0, |(layer, part)| layer.opacity * part)
    }

    fn member(&self, surface: usize) -> Option<(&Layer, f32)> {
        let member = self.members.get(surface)?;
        Some((self.layers.get(member.layer)?, member.part))
    }
}

/// Name of the tissue inside a surface.
fn tissue_of<'a>(scene: &'a Scene, surface: &Surface) -> &'a str {
    scene.tissues.names().get(surface.tissue).map_or("", String::as_str)
}

/// Anatomical layer of a surface in a body.
fn anatomy(name: &str, tissue: &str, has_fetus: bool) -> Anatomy {
    if has_fetus && FETAL_SURFACES.contains(&name) {
        return match tissue {
            "skin" | "soft_tissue" if name.starts_with("fetal_") => Anatomy::Fetus,
            "bone_fetal" | "calvaria_fetal" | "cartilage" | "fascia" if name != "lenses" => Anatomy::FetalBones,
            _ => Anatomy::FetalOrgans,
        };
    }
    match tissue {
        _ if name.starts_with("cord") || name.starts_with("placenta") => Anatomy::Placenta,
        _ if name.starts_with("prostate") => Anatomy::Organs,
        _ if name == "vagina" => Anatomy::Uterus,
        "skin" => Anatomy::Skin,
        "fat" | "septum" => Anatomy::Fat,
        // Walls of hollow organs.
        "muscle" if name.ends_with("_wall") => Anatomy::Organs,
        "muscle" | "fascia" | "peritoneum" => Anatomy::Muscle,
        "soft_tissue" | "soft_tissue_maternal" => Anatomy::SoftTissue,
        "bone_adult" | "cartilage" => Anatomy::Bones,
        "blood" | "vessel_wall" | "portal_tract" => Anatomy::Vessels,
        "uterus_wall" | "cervix" | "cervical_mucosa" | "amnion" | "amniotic_fluid" => Anatomy::Uterus,
        "placenta" | "placental_plate" | "placental_bed" | "cord_jelly" => Anatomy::Placenta,
        "liver" | "kidney" | "renal_cortex" | "renal_medulla" | "renal_sinus" | "pancreas" | "thyroid" | "prostate"
        | "capsule" | "heart" | "pericardium" | "valve" | "spleen" | "brain" | "brain_deep" | "lung_aerated"
        | "lung_air" | "pleura" | "bowel" | "submucosa" | "mucosa" | "air" | "urine" | "bile" | "gallbladder_wall"
        | "gallstone" | "csf" => Anatomy::Organs,
        _ => Anatomy::Other,
    }
}

/// Opacity of an anatomical layer when the scene is opened, 0..=1, and whether it is shown.
fn at_first(layer: Anatomy, has_fetus: bool) -> (f32, bool) {
    match (layer, has_fetus) {
        (Anatomy::Skin, _) => (0.08, true),
        (Anatomy::Fat, _) => (0.25, false),
        (Anatomy::Muscle, true) => (0.25, false),
        (Anatomy::Muscle, false) => (0.2, true),
        (Anatomy::SoftTissue, _) => (0.15, false),
        (Anatomy::Bones, true) => (0.18, true),
        (Anatomy::Bones, false) => (0.55, true),
        (Anatomy::Organs, true) => (0.1, true),
        (Anatomy::Organs, false) => (0.8, true),
        (Anatomy::Vessels, true) => (0.2, true),
        (Anatomy::Vessels, false) => (0.9, true),
        (Anatomy::Uterus, _) => (0.08, true),
        (Anatomy::Placenta, _) => (0.4, true),
        (Anatomy::Fetus, _) => (0.8, true),
        (Anatomy::FetalOrgans, _) => (0.7, true),
        (Anatomy::FetalBones, _) => (1.0, true),
        (Anatomy::Other, _) => (0.6, true),
    }
}

/// Opacity of a surface relative to the layer's opacity, 0..=1. A surface that encloses others of its layer is more
/// transparent.
fn part(name: &str, tissue: &str) -> f32 {
    let encloses = name.ends_with("_wall") || name.ends_with("_walls") || tissue == "gallbladder_wall";
    match name {
        // The cord must be visible, and so must the fetus behind the placenta's nested parts.
        _ if name.starts_with("placenta") => 0.12,
        "fetal_body" | "membranes" => 0.5,
        _ if encloses => 0.5,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::analytic::{Part, scene, sphere};
    use crate::anatomy::{TissueTable, analytic};
    use crate::phantom::{Parameters, organs};

    fn layers_of(parts: &[(&'static str, &'static str, f32)]) -> (Scene, Layers) {
        let parts = parts.iter().enumerate().map(|(i, &(name, tissue, radius_mm))| Part {
            name,
            tissue,
            priority: i as i32,
            mesh: sphere(glam::Vec3::ZERO, radius_mm, 2),
        });
        let scene = scene(parts.collect(), &TissueTable::builtin().unwrap(), "gel").unwrap();
        let surfaces: Vec<_> = scene.surfaces.iter().map(|surface| (surface, &surface.mesh)).collect();
        let layers = Layers::of(&scene, &surfaces);
        (scene, layers)
    }

    #[test]
    fn the_fetus_is_seen_through_all_that_encloses_it() {
        let (scene, layers) = layers_of(&[
            ("skin", "skin", 200.0),
            ("fat_lobules_1", "fat", 190.0),
            ("fat_septa", "septum", 191.0),
            ("rectus_muscles", "muscle", 180.0),
            ("uterus", "uterus_wall", 150.0),
            ("maternal_pelvis", "bone_adult", 160.0),
            ("fetal_skin", "skin", 100.0),
            ("liver", "liver", 30.0),
            ("skull", "calvaria_fetal", 40.0),
        ]);
        let opacity = |name| layers.opacity(scene.surfaces.iter().position(|s| s.name == name).unwrap());
        for hidden in ["fat_lobules_1", "fat_septa", "rectus_muscles"] {
            assert_eq!(opacity(hidden), 0.0, "{hidden}");
        }
        for seen_through in ["skin", "uterus", "maternal_pelvis"] {
            assert!((0.05..=0.25).contains(&opacity(seen_through)), "{seen_through}");
        }
        assert!(opacity("fetal_skin") >= 0.5 && opacity("liver") >= 0.6 && opacity("skull") >= 0.9);
        let names: Vec<&str> = layers.layers.iter().map(|layer| layer.name.as_str()).collect();
        let expected = ["skin", "fat", "muscle", "bones", "uterus", "fetus", "fetal_organs", "fetal_bones"];
        assert_eq!(names, expected);
    }

    #[test]
    fn a_patient_without_a_fetus_shows_its_organs() {
        let parts =
            [("skin", "skin", 200.0), ("fat", "fat", 190.0), ("liver", "liver", 60.0), ("rib", "bone_adult", 20.0)];
        let (_, layers) = layers_of(&parts);
        let opacities: Vec<f32> = (0..4).map(|i| layers.opacity(i)).collect();
        assert!(opacities[0] < 0.2 && opacities[1] == 0.0 && opacities[2] > 0.6 && opacities[3] > 0.4, "{opacities:?}");
        assert!(layers.layers.iter().all(|layer| !layer.name.starts_with("fet")));
        assert!(layers.opacity_if_shown(1) > 0.1);
    }

    #[test]
    fn a_scene_without_skin_has_a_layer_for_each_tissue() {
        let scene = analytic::scene(analytic::cyst(), &TissueTable::builtin().unwrap(), "liver").unwrap();
        let surfaces: Vec<_> = scene.surfaces.iter().map(|surface| (surface, &surface.mesh)).collect();
        let meshes: Vec<&Mesh> = scene.surfaces.iter().map(|surface| &surface.mesh).collect();
        let layers = Layers::of(&scene, &surfaces);
        assert!(layers.layers.iter().all(|layer| layer.is_shown && scene.tissues.index_of(&layer.name).is_some()));
        for (i, opacity) in colour::opacities(&meshes).into_iter().enumerate() {
            assert!((layers.opacity(i) - opacity).abs() < 1e-6);
        }
    }

    #[test]
    fn every_surface_of_the_phantom_has_a_layer_of_its_anatomy() {
        for organ in organs(&Parameters::default()) {
            assert_ne!(anatomy(organ.name, organ.tissue, true), Anatomy::Other, "{}", organ.name);
        }
    }
}
