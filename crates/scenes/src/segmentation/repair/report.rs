//! Report of a repair.

use std::fmt;

use serde::Serialize;

use insonify_core::anatomy::doctor::Region;
use insonify_core::names::{counted, thousands};

macro_rules! kinds {
    ($(#[doc = $type_doc:literal])+ $type:ident { $($(#[doc = $doc:literal])+ $name:ident = $noun:literal, $rest:literal;)* }) => {
        $(#[doc = $type_doc])+
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        #[non_exhaustive]
        pub enum $type {
            $($(#[doc = $doc])+ $name,)*
        }

        impl $type {
            /// Noun of the counted things, and the action done to them or still to do.
            fn words(self) -> (&'static str, &'static str) {
                match self { $(Self::$name => ($noun, $rest),)* }
            }
        }
    };
}

kinds! {
    /// Kind of an action of the repair.
    ActionKind {
        /// Joined vertices that coincided, exactly or nearly.
        Joined = "vertex|vertices", "joined with others in the same place";
        /// Removed triangles without area.
        Degenerate = "triangle|triangles", "without area removed";
        /// Removed copies of triangles.
        Duplicate = "copy|copies of triangles", "removed";
        /// Removed pairs of triangles back to back: both sides of a wall inside the surface.
        InnerWall = "triangle|triangles", "of walls inside the surface removed";
        /// Triangles that faced the other way than their neighbours, turned over.
        Turned = "triangle|triangles", "that faced the other way than their neighbours turned over";
        /// Removed parts just within another part that faces the same way: a surface drawn twice.
        Doubled = "part|parts", "just within another removed: the surface was there twice";
        /// Parts that faced inward, turned over.
        TurnedPart = "part|parts", "that faced inward turned over";
        /// Parts inside other parts that faced outward, turned over to be cavities.
        Cavity = "part|parts", "inside other parts turned over: they are cavities now (to keep one as tissue, make it a surface of its own)";
        /// Removed small parts: fragments.
        Crumb = "crumb|crumbs", "removed";
        /// Removed parts without thickness.
        Flat = "part|parts", "without thickness removed";
        /// Triangles of a surface that was open or crossed itself, made anew from what it encloses.
        Remeshed = "triangle|triangles", "made anew from what they enclose: the surface was open or passed through itself";
        /// Triangles within the solid, or of sheets that enclose nothing, left out.
        LeftOut = "triangle|triangles", "within the solid, or of sheets that enclose nothing, left out";
        /// Cuts along a plane, capped.
        PlanarCap = "cut|cuts", "along a plane closed by a flat cap";
        /// Small holes, filled.
        SmallHole = "small hole|small holes", "filled";
        /// Large holes that are not planar, filled: the shape there is a guess.
        Guess = "large hole|large holes", "filled: the shape there is a guess, check it";
    }
}

kinds! {
    /// Kind of a defect that remains.
    RemainingKind {
        /// Edges between triangles that face opposite ways.
        OneSided = "edge|edges", "where the surface has no two sides (as a Möbius strip): cut it there by hand";
        /// Triangles of parts that are thinner than the voxels of remeshing.
        Lost = "triangle|triangles", "of thin parts lost: a smaller --max-move-mm keeps more";
        /// A surface that passes through itself even after remeshing.
        Crossing = "surface|surfaces", "that still passes through itself: mend it by hand";
        /// A surface that moved farther than allowed.
        Moved = "surface|surfaces", "moved farther than --max-move-mm allows: allow more, or close the surface by hand";
        /// Vertices that are not finite.
        NotFinite = "vertex|vertices", "not finite: their triangles were removed";
        /// A surface without any part that encloses a volume.
        Nothing = "surface|surfaces", "without any part that encloses a volume: leave it out, or export it again";
    }
}

/// All actions of one kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Action {
    /// Kind of the action.
    pub kind: ActionKind,
    /// Number of things changed.
    pub count: usize,
    /// Regions with the largest changes, largest first; at most
    /// [`REGIONS_MAX`](insonify_core::anatomy::doctor::REGIONS_MAX).
    #[serde(rename = "places")]
    pub regions: Vec<Region>,
}

/// A defect that the repair could not mend.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Remaining {
    /// Kind of the defect.
    pub kind: RemainingKind,
    /// Number of defects.
    pub count: usize,
    /// Regions of the defect, largest first; at most [`REGIONS_MAX`](insonify_core::anatomy::doctor::REGIONS_MAX).
    #[serde(rename = "places")]
    pub regions: Vec<Region>,
}

/// Report of the repair of a surface.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SurfaceRepair {
    /// Name of the surface.
    pub surface: String,
    /// Number of triangles before and after.
    pub triangles: [usize; 2],
    /// Number of closed parts after the repair, cavities included.
    pub parts: usize,
    /// Enclosed volume after the repair, mm³.
    pub volume_mm3: f64,
    /// Actions, in order.
    pub actions: Vec<Action>,
    /// Defects that remain.
    pub remaining: Vec<Remaining>,
    /// Largest distance by which the surface was moved, mm, apart from caps and fills.
    pub largest_move_mm: f32,
    /// Regions of all caps of cuts.
    #[serde(skip)]
    pub cuts: Vec<Region>,
}

impl SurfaceRepair {
    /// Number of things changed by actions of one kind.
    pub fn count(&self, kind: ActionKind) -> usize {
        self.actions.iter().filter(|action| action.kind == kind).map(|action| action.count).sum()
    }

    /// Whether the surface needed no change and has no defect.
    pub fn was_sound(&self) -> bool {
        self.actions.is_empty() && self.remaining.is_empty()
    }

    /// Whether every defect was mended.
    pub fn is_mended(&self) -> bool {
        self.remaining.is_empty()
    }
}

/// Writes one line: a count with its noun, what was done, and the regions.
fn line(
    f: &mut fmt::Formatter<'_>,
    count: usize,
    (nouns, rest): (&'static str, &'static str),
    regions: &[Region],
) -> fmt::Result {
    let (one, many) = nouns.split_once('|').unwrap_or((nouns, nouns));
    write!(f, "{} {} {rest}", thousands(count), if count == 1 { one } else { many })?;
    for (i, region) in regions.iter().enumerate() {
        write!(f, "{}{region}", if i == 0 { "; at " } else { "; " })?;
    }
    Ok(())
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        line(f, self.count, self.kind.words(), &self.regions)
    }
}

impl fmt::Display for Remaining {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        line(f, self.count, self.kind.words(), &self.regions)
    }
}

impl fmt::Display for SurfaceRepair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &self.surface;
        if self.was_sound() {
            return write!(f, "`{name}`: sound, {}", counted(self.triangles[1], "triangle"));
        }
        write!(f, "`{name}`: {}, ", counted(self.triangles[1], "triangle"))?;
        write!(f, "{}, {:.1} ml", counted(self.parts, "part"), self.volume_mm3 * 1e-3)?;
        if self.largest_move_mm > 0.0 {
            write!(f, "; nothing moved by more than {:.4} mm", self.largest_move_mm)?;
        }
        for action in &self.actions {
            write!(f, "\n  mended: {action}")?;
        }
        for defect in &self.remaining {
            write!(f, "\n  remains: {defect}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_reads_as_sentences_with_places() {
        let region = Region { at_mm: [1.0, 2.0, 3.0], size_mm: 4.0 };
        let report = SurfaceRepair {
            surface: "liver".to_owned(),
            triangles: [1000, 1024],
            parts: 1,
            volume_mm3: 1.5e6,
            actions: vec![Action { kind: ActionKind::PlanarCap, count: 1, regions: vec![region] }],
            remaining: vec![Remaining { kind: RemainingKind::OneSided, count: 2, regions: vec![] }],
            largest_move_mm: 0.01,
            cuts: Vec::new(),
        };
        let text = report.to_string();
        assert!(
            text.starts_with("`liver`: 1,024 triangles, 1 part, 1500.0 ml; nothing moved by more than 0.0100 mm"),
            "{text}"
        );
        assert!(
            text.contains("mended: 1 cut along a plane closed by a flat cap; at (1.00, 2.00, 3.00) mm, 4.00 mm across"),
            "{text}"
        );
        assert!(text.contains("remains: 2 edges where the surface has no two sides"), "{text}");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["actions"][0]["kind"], "planar_cap");
    }
}
