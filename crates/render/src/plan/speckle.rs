//! Rules for the texture of tissues, and for speckle across the slice.

use insonify_core::settings::Effect;

use super::bound::Bound;
use super::facts::Medium;
use super::rules::{Finding, Rules, finding, most};
use crate::constants::CELL_MM;

impl Rules<'_> {
    /// Bodies have textures; specimens and phantoms of one tissue are uniform.
    pub(super) fn texture(&self) -> Finding {
        if !self.on.has(Effect::Scatterers) {
            return finding("nothing scatters", Bound::Exact);
        }
        let contrast_db = |m: &Medium| m.tissue.cloud_db.hypot(m.tissue.grain_db).max(m.tissue.septa_db.abs());
        let textured = self.facts.media.iter().filter(|m| m.scatters() && contrast_db(m) > 0.0);
        match (most(textured.clone(), |m| contrast_db(m)), self.facts.skin) {
            (None, _) => finding("every medium is uniform", Bound::Exact),
            (Some(_), false) => finding("no surface is skin: a specimen is shown uniform", Bound::OnRequest),
            (Some((db, medium)), true) => {
                let reason = format!("{} media have a texture, {} of {db:.1} dB", textured.count(), medium.name);
                finding(reason, Bound::none("the grain of tissues"))
            }
        }
    }

    /// Rule: needed wherever there is speckle. A pose then gives the same frame in a session, a still and a data set.
    pub(super) fn elevational_speckle(&self) -> Finding {
        if !self.on.has(Effect::Scatterers) {
            return finding("nothing scatters", Bound::Exact);
        }
        let scale_mm = self.probe.elevational_lens().scale_mm();
        let reason = format!("the lens's speckle changes over {scale_mm:.2} mm of a slide, a cell's over {CELL_MM} mm");
        finding(reason, Bound::none("speckle that changes gradually across the slice"))
    }
}
