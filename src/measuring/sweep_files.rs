//! Files of a sweep.

use std::path::{Path, PathBuf};

use super::figure::{self, Figure};
use super::sweep::Machine;
use super::{MeasuringError, SweepReport, csv, effects_csv, effects_markdown, markdown};
use crate::names::counted;
use crate::sink::{png, write_json, write_text};

/// Names of a sweep's files in its directory; `*` stands for any text.
pub const SWEEP_FILES: [&str; 8] = [
    "tradeoff.csv",
    "tradeoff.json",
    "tradeoff.svg",
    "tradeoff.png",
    "tradeoff.md",
    "effects.csv",
    "looks.csv",
    "points/*",
];

impl SweepReport {
    /// Operating points, effects and post-processing steps as Markdown tables.
    pub fn tables(&self) -> String {
        let both = [&self.effects[..], &self.looks].concat();
        format!("{}\n{}", markdown(&self.points), effects_markdown(&both))
    }

    /// Writes tables, figure and JSON below `out`. Returns the paths of the files.
    ///
    /// # Errors
    /// A file that can't be written, or a figure that can't be drawn.
    pub fn write(&self, out: &Path) -> Result<Vec<PathBuf>, MeasuringError> {
        let Self { station, machine, poses, points, effects, looks, reference, .. } = self;
        let Machine { device, processor, threads } = machine;
        let converged = reference.converged;
        let not = if converged { "" } else { " (reference not converged)" };
        let title = format!("{}{not}, {}, on {device}, {threads} threads", station.display(), counted(*poses, "pose"));
        write_text(&out.join("tradeoff.csv"), &csv(points))?;
        write_text(&out.join("effects.csv"), &effects_csv(effects))?;
        write_text(&out.join("looks.csv"), &effects_csv(looks))?;
        let tables = self.tables();
        write_text(&out.join("tradeoff.md"), &format!("{title} of {processor}. {reference}\n\n{tables}"))?;
        write_json(&out.join("tradeoff.json"), self)?;
        let both = [&effects[..], looks].concat();
        let drawing = Figure { points, effects: &both, title: &title, converged };
        let svg = figure::svg(&drawing).map_err(MeasuringError::Figure)?;
        write_text(&out.join("tradeoff.svg"), &svg)?;
        let (width, height, rgb) = figure::rgb(&drawing).map_err(MeasuringError::Figure)?;
        png::write_rgb(&out.join("tradeoff.png"), width, height, &rgb)?;
        let names = ["csv", "json", "svg", "png", "md"].map(|end| format!("tradeoff.{end}"));
        Ok(names
            .into_iter()
            .chain(["effects.csv", "looks.csv"].map(str::to_owned))
            .map(|name| out.join(name))
            .collect())
    }
}
