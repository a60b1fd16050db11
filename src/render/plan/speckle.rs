//! Rule for speckle across the slice.

use super::bound::Bound;
use super::rules::{Finding, Rules, finding};
use crate::render::constants::CELL_MM;
use crate::settings::Effect;

impl Rules<'_> {
    /// Called for wherever speckle exists: a frame of a pose is the same frame in a session, a still and a data set.
    pub(super) fn elevational_speckle(&self) -> Finding {
        if !self.on.has(Effect::Scatterers) {
            return finding("nothing scatters", Bound::Exact);
        }
        let scale_mm = self.probe.elevational_lens().scale_mm();
        let reason = format!("the lens's speckle changes over {scale_mm:.2} mm of a slide, a cell's over {CELL_MM} mm");
        finding(reason, Bound::none("speckle that changes gradually across the slice"))
    }
}
