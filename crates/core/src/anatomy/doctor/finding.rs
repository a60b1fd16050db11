//! Findings about a scene.

use std::fmt;

use glam::Vec3;
use serde::Serialize;

use crate::anatomy::Bounds;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The scene is refused or simulated wrongly.
    Error,
    /// Repaired while loading, or wrong in parts; worth correcting in the file.
    Warning,
    /// Information that needs no correction.
    Note,
}

crate::names::named!(Severity { Error = "error", Warning = "warning", Note = "note" });

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

macro_rules! defects {
    ($($(#[doc = $doc:literal])+ $name:ident = $severity:ident, $remedy:literal;)*) => {
        /// Kind of defect of a scene.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        #[non_exhaustive]
        pub enum Defect {
            $($(#[doc = $doc])+ $name,)*
        }

        impl Defect {
            /// Severity of the defect.
            pub fn severity(self) -> Severity {
                match self { $(Self::$name => Severity::$severity,)* }
            }

            /// Advice for the user.
            pub fn remedy(self) -> &'static str {
                match self { $(Self::$name => $remedy,)* }
            }
        }
    };
}

defects! {
    /// A primitive that cannot be read: indices, accessors, compression.
    Unreadable = Error, "export the mesh again, uncompressed, with positions as 32-bit floats";
    /// Invalid extras, nodes or motion.
    Refused = Error, "correct the value that the message names (in Blender: the object's Custom Properties) and export again";
    /// More surfaces than can be traced.
    TooManySurfaces = Error, "join disjoint parts that share tissue and priority into one object (Blender: Ctrl-J)";
    /// No triangle in the whole scene.
    EmptyScene = Error, "export meshes with faces; check that the objects are visible and in the exported scene";
    /// Coordinates that are not finite or beyond ±1e5 mm.
    BadCoordinates = Error, "delete or move the named vertices; if all are far too large, correct the unit";
    /// Dimensions at least ten times beyond a body's.
    WrongUnit = Error, "glTF counts in metres: scale the objects (Blender: set Unit Scale, or S and the factor), apply the scale (Ctrl-A) and export again";
    /// The scene is far from the origin for its size.
    FarFromOrigin = Warning, "move the scene to the origin (Blender: Object > Set Origin, then Alt-G), so that 32-bit coordinates resolve it";
    /// Neither extras nor a material name the tissue.
    NoTissue = Error, "name the material as the tissue, or give the object the custom property `tissue`; `insonify tissues` lists them";
    /// A tissue that no table contains.
    UnknownTissue = Error, "correct the name, or define `[tissues.NAME]` in the station file; `insonify tissues` lists them";
    /// A tissue of the station that no surface uses.
    UnusedTissue = Note, "name it in a surface, or remove its table from the station file";
    /// A primitive without triangles of nonzero area.
    Empty = Warning, "delete the object, or give it faces and a scale that is not 0";
    /// Points or lines.
    NotTriangles = Note, "convert curves and wires to meshes (Blender: Object > Convert > Mesh), or delete them";
    /// Surplus indices that form no triangle.
    LeftOver = Warning, "triangulate and export the mesh again";
    /// A skin, which is not applied.
    Skin = Warning, "apply the armature (Blender: Modifiers > Armature > Apply) and export again";
    /// Meshes of other scenes.
    NotInScene = Note, "move the objects into the exported scene if they are to be scanned";
    /// Edges with only one triangle: the surface has no inside.
    Open = Error, "fill the hole (Blender: Edit Mode, Select > All by Trait > Non Manifold, then F or Alt-F), or give a sheet a thickness (Solidify)";
    /// An object whose faces have several materials: each becomes a separate surface, which is not closed.
    SplitByMaterial = Error, "use one material for the whole object, or separate the parts and close each (Blender: P > By Material, then F or Alt-F)";
    /// Coincident rims that are not joined.
    Unwelded = Error, "join the rims (Blender: Edit Mode, A, then Mesh > Merge > By Distance)";
    /// Edges of more than two triangles.
    NonManifold = Warning, "delete inner faces (Blender: Select > All by Trait > Interior Faces), or separate what touches along an edge";
    /// The whole surface faces inward.
    Inverted = Warning, "turn the faces outward (Blender: Edit Mode, A, Shift-N) so that other programs agree, too";
    /// Some triangles or parts face the wrong way.
    MixedOrientation = Error, "let all faces look outward (Blender: Edit Mode, A, Shift-N); a cavity faces into the cavity";
    /// A part within another part of the same surface.
    NestedPart = Error, "delete the inner part, turn it over if it is a cavity, or make it an object of its own with a higher priority";
    /// Triangles without an area.
    Degenerate = Warning, "dissolve them (Blender: Mesh > Clean Up > Degenerate Dissolve)";
    /// Triangles too narrow to be hit.
    Sliver = Note, "nothing, if the picture is right; else remesh or Degenerate Dissolve with a distance of 0.001 mm";
    /// Triangles that occur more than once.
    Duplicate = Warning, "remove the copy (Blender: Merge > By Distance removes doubled faces); look for an object duplicated in place";
    /// Triangles of a surface that intersect each other.
    SelfIntersection = Error, "unite the parts (Blender: Boolean > Union with Self Intersection, or Remesh), or make them objects of their own";
    /// Many neighbouring triangles that fold through each other.
    Crumpled = Warning, "smooth or remesh it (Blender: Sculpt > Remesh, or Smooth), or decimate it less";
    /// Walls thinner than the tracer resolves.
    ThinSheet = Warning, "make it thicker (Blender: Solidify): nothing thinner than 0.001 mm is seen";
    /// Overlapping surfaces of different tissues and equal priority.
    PriorityTie = Warning, "give the one that is to win a higher `priority` (an integer custom property)";
    /// A surface that is never the medium.
    Hidden = Warning, "raise its `priority` above that of what hides it, lower the other's, or delete it";
    /// More memory than some GPUs can bind.
    TooLarge = Warning, "reduce triangles (Blender: Decimate): below 2.6 million in all fit every GPU";
    /// An organ whose volume few or no humans have.
    UnusualVolume = Warning, "look whether it is that organ: `scene from-labels --names` chooses what numbers mean, `--map` what one means; whole scenes may have the wrong unit";
    /// Organs whose relative position few or no humans have.
    UnusualPosition = Warning, "look whether the names are right, and whether the segmentation is mirrored (3D Slicer shows both over the image)";
    /// The probe starts in bone or gas, where it sees nothing else.
    StartsInside = Warning, "move `[pose]` of the station file onto the skin";
    /// The image is empty at the start.
    StartsFar = Warning, "move `[pose]` of the station file to the scene, or correct the scene's unit";
}

impl Defect {
    /// Name of the defect in JSON.
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    }
}

/// Region of a scene that has a defect: centre and size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Region {
    /// Centre, scene frame, mm.
    pub at_mm: [f32; 3],
    /// Size, mm: the diagonal of the region's bounds.
    pub size_mm: f32,
}

impl Region {
    pub(crate) fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        let bounds = Bounds::of(points).filter(|bounds| bounds.min.is_finite());
        let Bounds { min, max } = bounds.unwrap_or(Bounds::around(Vec3::ZERO, Vec3::ZERO));
        Self { at_mm: (0.5 * (min + max)).to_array(), size_mm: (max - min).length() }
    }
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.at_mm;
        write!(f, "({x:.2}, {y:.2}, {z:.2}) mm")?;
        if self.size_mm > 0.0 { write!(f, ", {:.2} mm across", self.size_mm) } else { Ok(()) }
    }
}

/// A defect found in a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Severity of the finding.
    pub severity: Severity,
    /// Kind of defect.
    pub defect: Defect,
    /// Name of the surface; `None` if the finding concerns the whole scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Tissue of the surface, as named in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tissue: Option<String>,
    /// Description.
    pub what: String,
    /// Regions with the defect, largest first; at most [`REGIONS_MAX`].
    #[serde(rename = "places", skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<Region>,
    /// Advice for the modelling program or the station file.
    pub remedy: &'static str,
}

/// Largest number of regions in a finding.
pub const REGIONS_MAX: usize = 3;

impl Finding {
    pub(super) fn new(defect: Defect, what: impl Into<String>) -> Self {
        let (severity, remedy) = (defect.severity(), defect.remedy());
        Self { severity, defect, surface: None, tissue: None, what: what.into(), regions: Vec::new(), remedy }
    }

    pub(super) fn at(mut self, regions: impl IntoIterator<Item = Region>) -> Self {
        self.regions = regions.into_iter().collect();
        self.regions.sort_by(|a, b| b.size_mm.total_cmp(&a.size_mm));
        self.regions.truncate(REGIONS_MAX);
        self
    }

    pub(super) fn of(mut self, surface: &str, tissue: Option<&str>) -> Self {
        self.surface = Some(surface.to_owned());
        self.tissue = tissue.map(str::to_owned);
        self
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.surface, &self.tissue) {
            (Some(surface), Some(tissue)) => write!(f, "`{surface}` ({tissue}): ")?,
            (Some(surface), None) => write!(f, "`{surface}`: ")?,
            _ => {}
        }
        f.write_str(&self.what)?;
        for (i, region) in self.regions.iter().enumerate() {
            write!(f, "{}{region}", if i == 0 { " at " } else { "; at " })?;
        }
        Ok(())
    }
}
