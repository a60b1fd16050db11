//! Scene properties that decide which effects are needed.

use insonify_core::anatomy::{Scene, Tissue};

/// A medium that paths may enter: a tissue and its name.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Medium {
    pub(super) name: String,
    pub(super) tissue: Tissue,
}

impl Medium {
    /// Speed (m/s) and impedance (MRayl), rounded to f32. An interface of media that agree in both neither echoes nor
    /// refracts.
    pub(super) fn acoustic(&self) -> (f32, f32) {
        (self.tissue.speed_m_s as f32, self.tissue.impedance_mrayl() as f32)
    }

    pub(super) fn scatters(&self) -> bool {
        self.tissue.scatterer_density > 0.0
            && (self.tissue.scatterer_mean != 0.0 || self.tissue.scatterer_deviation > 0.0)
    }
}

/// Scene properties that decide which effects are needed. Any two of its media are assumed to meet: surfaces may
/// overlap, move and be open, so only tracing would show which do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SceneFacts {
    /// Tissues of the surfaces that have triangles, the background, and the air around a body.
    pub(super) media: Vec<Medium>,
    /// Names of the surfaces that move.
    pub(super) moving: Vec<String>,
    /// Whether the whole scene drifts.
    pub(super) drifts: bool,
    /// Whether a surface is skin, which makes the scene a body in air.
    pub(super) skin: bool,
    /// The tissue `air`; `None` if the scene's table lacks it.
    air: Option<Medium>,
}

/// Name of the tissue around a body.
pub(crate) const AIR: &str = "air";
/// Name of the tissue that makes a scene a body.
pub(crate) const SKIN: &str = "skin";

impl SceneFacts {
    pub(crate) fn new(scene: &Scene) -> Self {
        let there = || scene.surfaces.iter().filter(|s| !s.mesh.triangles.is_empty());
        let mut indices: Vec<usize> = there().map(|s| s.tissue).chain([scene.background]).collect();
        let skin = there().any(|s| scene.tissues.index_of(SKIN) == Some(s.tissue));
        let air = scene.tissues.index_of(AIR);
        indices.extend(air.filter(|_| skin));
        indices.sort_unstable();
        indices.dedup();
        let (names, tissues) = (scene.tissues.names(), scene.tissues.tissues());
        let medium = |i: usize| Some(Medium { name: names.get(i)?.clone(), tissue: tissues.get(i)?.clone() });
        Self {
            media: indices.into_iter().filter_map(medium).collect(),
            moving: there().map(|s| &s.name).filter(|name| scene.motion.moves(name)).cloned().collect(),
            drifts: scene.motion.drift.is_some(),
            skin,
            air: air.and_then(medium),
        }
    }

    /// Copy of these facts with air among the media.
    pub(super) fn in_air(&self) -> Self {
        let mut facts = self.clone();
        facts.media.extend(self.air.clone().filter(|air| !self.media.contains(air)));
        facts
    }

    /// All pairs of different media.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (&Medium, &Medium)> {
        self.media.iter().enumerate().flat_map(|(i, a)| self.media[i + 1..].iter().map(move |b| (a, b)))
    }

    /// The slowest and the fastest medium; `None` if there are no media.
    pub(super) fn speeds(&self) -> Option<(&Medium, &Medium)> {
        let by = |a: &&Medium, b: &&Medium| a.tissue.speed_m_s.total_cmp(&b.tissue.speed_m_s);
        Some((self.media.iter().min_by(by)?, self.media.iter().max_by(by)?))
    }
}
