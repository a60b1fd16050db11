//! Events along the way of a needle's tip: surfaces that it enters, leaves and enters again.
//!
//! The tip is followed in straight steps from pose to pose. A step is intersected with the scene's triangles, so events
//! have their exact place and order even if a step is long.
//!
//! A surface is **entered** when it becomes the medium at the tip: the tip is inside it, and inside no surface of
//! higher priority. It is **left** when the tip is outside its mesh. So a surface inside another one, as blood inside a
//! vessel wall, is entered and left without an event of the outer one; and a surface that is hidden by others where the
//! tip crosses it has no event.

use std::sync::Arc;

use glam::DVec3;

use crate::anatomy::{Bounds, Bvh, BvhError, Scene, SegmentSearch};

/// Longest time between two poses of one step, s. After a longer gap the tip is placed anew, without events.
pub const GAP_S: f64 = 0.25;

/// Distance by which the tip must have left a surface for a return to count as another puncture, mm. It exceeds the
/// tremor of a hand and the noise of a tracker (assumed).
pub const REPEAT_MM: f64 = 0.5;

/// Hits within this distance of each other coincide, mm.
const TOUCH_MM: f64 = 1e-3;

/// Offset of the point that is followed from the tip, mm. It is in no plane of symmetry, so a tip that rests or slides
/// exactly on a surface is on one side of it, always the same.
const OFFSET_MM: DVec3 = DVec3::new(1.3e-3, 0.7e-3, 1.1e-3);

/// Margin of the box around a step, mm. It exceeds the rounding of positions to f32.
const MARGIN_MM: f32 = 0.1;

/// Kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TipEventKind {
    /// The tip entered a surface.
    Entered,
    /// The tip entered a surface that it had left by more than [`REPEAT_MM`]: a double puncture.
    ReEntered,
    /// The tip left a surface.
    Left,
}

crate::names::named!(TipEventKind { Entered = "entered", ReEntered = "re-entered", Left = "left" });

/// Crossing of a surface by the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipEvent {
    /// Time, on the clock of [`TipWatch::advance`], s.
    pub time_s: f64,
    /// Place of the crossing in the scene, mm.
    pub position_mm: DVec3,
    /// Index of the surface in the scene.
    pub surface: usize,
    /// Kind of the event.
    pub kind: TipEventKind,
    /// Number of punctures of this surface so far.
    pub punctures: u32,
}

/// State of a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Watched {
    /// Winding number of the surface about the tip: 0 outside.
    winding: i32,
    /// Whether the tip has entered the surface, and not left it.
    entered: bool,
    punctures: u32,
    /// Place where the tip left the surface last, in the scene without drift, mm.
    left_mm: Option<DVec3>,
    /// Largest distance of the tip from that place since then, mm.
    away_mm: f64,
}

/// Position of the followed point after a step, in the scene without drift.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    time_s: f64,
    position_mm: DVec3,
}

/// Follows the tip of a needle through the surfaces of a scene.
#[derive(Debug, Clone)]
pub struct TipWatch {
    /// Tree of the scene, which others may share until it moves.
    bvh: Arc<Bvh>,
    surfaces: Vec<Watched>,
    last: Option<Place>,
    /// Scene time of the next position, s; `None` for scenes without motion, and before the first time is set.
    scene_time_s: Option<f64>,
    search: SegmentSearch,
}

impl TipWatch {
    /// Watch of the tip in `scene`, whose surfaces are at rest.
    ///
    /// # Errors
    /// Errors of [`Bvh::build`].
    pub fn new(scene: &Scene) -> Result<Self, BvhError> {
        Ok(Self::with_bvh(scene, Arc::new(Bvh::build(scene)?)))
    }

    /// Watch of the tip in `scene`, whose tree exists already. If the scene moves, the watch copies the tree.
    pub fn with_bvh(scene: &Scene, bvh: Arc<Bvh>) -> Self {
        Self {
            bvh,
            surfaces: vec![Watched::default(); scene.surfaces.len()],
            last: None,
            scene_time_s: None,
            search: SegmentSearch::default(),
        }
    }

    /// Sets the scene time of the next position. Surfaces, which must be closed, move in [`TipWatch::advance`]. If one moves
    /// over the tip, it is entered or left in that step.
    pub fn set_scene_time_s(&mut self, time_s: f64) {
        if self.bvh.moves() {
            Arc::make_mut(&mut self.bvh).set_drift(time_s);
            self.scene_time_s = Some(time_s);
        }
    }

    /// Forgets the position of the tip. The next position starts a new way; the numbers of punctures are kept.
    pub fn lose(&mut self) {
        self.last = None;
    }

    /// Moves the tip to `tip_mm` in the scene at `time_s`. Returns the events on the way, in order.
    ///
    /// The first position, and a position more than [`GAP_S`] after the last one or before it, has no events. A position
    /// that is not finite counts as [lost](TipWatch::lose).
    pub fn advance(&mut self, time_s: f64, tip_mm: DVec3) -> Vec<TipEvent> {
        if !tip_mm.is_finite() || !time_s.is_finite() {
            self.lose();
            return Vec::new();
        }
        let tip = Place { time_s, position_mm: tip_mm + OFFSET_MM - self.bvh.drift_mm() };
        let last = self.last.filter(|last| (0.0..=GAP_S).contains(&(time_s - last.time_s)));
        self.move_scene(last, tip);
        let Some(last) = last else {
            self.place(tip);
            return Vec::new();
        };
        let mut events = Vec::new();
        if self.bvh.moves() {
            self.settle_at(last, &mut events);
        }
        self.step(last, tip, &mut events);
        self.settle_at(tip, &mut events);
        for surface in &mut self.surfaces {
            if let Some(left_mm) = surface.left_mm {
                surface.away_mm = surface.away_mm.max(left_mm.distance(tip.position_mm));
            }
        }
        self.last = Some(tip);
        events
    }

    /// Index of the surface that is the medium at the tip; `None` in the background, or without a position.
    pub fn medium(&self) -> Option<usize> {
        self.last?;
        self.surfaces.iter().rposition(|surface| surface.winding != 0)
    }

    /// Whether the tip is inside the closed mesh of a surface, which need not be the medium.
    pub fn is_inside(&self, surface: usize) -> bool {
        self.last.is_some() && self.surfaces.get(surface).is_some_and(|surface| surface.winding != 0)
    }

    /// Moves the surfaces near the step from `last` to `tip` to the scene time.
    fn move_scene(&mut self, last: Option<Place>, tip: Place) {
        let Some(time_s) = self.scene_time_s else { return };
        let ends = [last.unwrap_or(tip), tip].map(|place| place.position_mm.as_vec3());
        if let Some(way) = Bounds::of(ends) {
            Arc::make_mut(&mut self.bvh).set_time_near(time_s, way.grown(MARGIN_MM));
        }
    }

    /// Puts the tip at its first position, or at its first one after a gap.
    fn place(&mut self, tip: Place) {
        let windings = self.search.windings(&self.bvh, tip.position_mm, self.surfaces.len());
        for (surface, &winding) in self.surfaces.iter_mut().zip(windings) {
            let entered = winding != 0;
            let punctures = surface.punctures.max(u32::from(entered));
            *surface = Watched { winding, entered, punctures, left_mm: None, away_mm: 0.0 };
        }
        self.last = Some(tip);
    }

    /// Follows the straight way from `last` to `tip`.
    fn step(&mut self, last: Place, tip: Place, events: &mut Vec<TipEvent>) {
        let way_mm = tip.position_mm - last.position_mm;
        let length_mm = way_mm.length();
        let Some(direction) = way_mm.try_normalize() else { return };
        let mut search = std::mem::take(&mut self.search);
        let mut rest = search.hits(&self.bvh, last.position_mm, direction, 0.0, length_mm);
        while let Some(first) = rest.first() {
            let at_mm = first.distance_mm;
            let (group, others) = rest.split_at(rest.partition_point(|hit| hit.distance_mm <= at_mm + TOUCH_MM));
            for (index, hit) in group.iter().enumerate() {
                // An edge that is shared by two triangles is crossed once; a silhouette is only touched.
                let is_first = group.iter().position(|other| other.surface == hit.surface) == Some(index);
                let any = |leaves: bool| group.iter().any(|h| h.surface == hit.surface && h.leaves == leaves);
                if let Some(surface) = self.surfaces.get_mut(hit.surface as usize)
                    && is_first
                    && any(true) != any(false)
                {
                    surface.winding += if hit.leaves { -1 } else { 1 };
                }
            }
            let time_s = last.time_s + (tip.time_s - last.time_s) * at_mm / length_mm;
            self.settle(Place { time_s, position_mm: last.position_mm + direction * at_mm }, events);
            rest = others;
        }
        self.search = search;
    }

    /// Updates the winding numbers to those about a place, and adds the events of the change.
    fn settle_at(&mut self, place: Place, events: &mut Vec<TipEvent>) {
        let windings = self.search.windings(&self.bvh, place.position_mm, self.surfaces.len());
        let changed = self.surfaces.iter().zip(windings).any(|(surface, winding)| surface.winding != *winding);
        if changed {
            self.surfaces.iter_mut().zip(windings).for_each(|(surface, &winding)| surface.winding = winding);
            self.settle(place, events);
        }
    }

    /// Adds the events that follow from the present winding numbers.
    fn settle(&mut self, place: Place, events: &mut Vec<TipEvent>) {
        let Place { time_s, position_mm } = place;
        let drift_mm = self.bvh.drift_mm();
        let mut add = |surface: usize, kind, punctures| {
            events.push(TipEvent { time_s, position_mm: position_mm - OFFSET_MM + drift_mm, surface, kind, punctures });
        };
        for (index, surface) in self.surfaces.iter_mut().enumerate().rev() {
            if surface.entered && surface.winding == 0 {
                surface.entered = false;
                (surface.left_mm, surface.away_mm) = (Some(position_mm), 0.0);
                add(index, TipEventKind::Left, surface.punctures);
            }
        }
        let medium = self.surfaces.iter().rposition(|surface| surface.winding != 0);
        let Some((index, surface)) = medium.and_then(|index| Some((index, self.surfaces.get_mut(index)?))) else {
            return;
        };
        if surface.entered {
            return;
        }
        let away_mm =
            surface.left_mm.map_or(f64::INFINITY, |left_mm| surface.away_mm.max(left_mm.distance(position_mm)));
        let is_puncture = away_mm > REPEAT_MM;
        surface.punctures += u32::from(is_puncture);
        (surface.entered, surface.left_mm, surface.away_mm) = (true, None, 0.0);
        let is_repeat = is_puncture && surface.punctures > 1;
        add(index, if is_repeat { TipEventKind::ReEntered } else { TipEventKind::Entered }, surface.punctures);
    }
}

#[cfg(test)]
mod tests;
