//! Media along straight rays: the cross-section of the surfaces, and the attenuation from the face.

use rayon::prelude::*;

use super::inputs::Inputs;
use super::locate::coupling;
use super::surfaces::{Membership, coincident, crossings};
use crate::constants::{COUPLED_MIN, ONE_WAY};

/// A stretch of one medium on a map ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// Depth at which the run begins, mm.
    pub start_mm: f64,
    /// One-way attenuation from the face to the run's start, Σμ in nepers.
    pub sum_np: f64,
    /// One-way attenuation in the run, nepers/mm.
    pub rate_np_mm: f64,
    /// Index of the run's tissue.
    pub tissue: usize,
}

/// A point of a map ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RasterPoint {
    /// One-way attenuation from the face, Σμ in nepers.
    pub sum_np: f64,
    /// Index of the tissue.
    pub tissue: usize,
}

/// Media along the map rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Sections {
    /// Runs of each map ray, nearest first; at least one each.
    pub runs: Vec<Vec<Run>>,
    /// Points at every `map_step_mm` of depth [map rays × map_depths].
    pub raster: Vec<RasterPoint>,
}

/// The media along every map ray. Rays are straight: maps show the anatomy in the scan plane, without refraction. A ray
/// whose part of the face is not coupled is all air.
pub fn section(inputs: &Inputs) -> Sections {
    let runs: Vec<Vec<Run>> = (0..inputs.map_rays.len()).into_par_iter().map(|ray| runs_of(inputs, ray)).collect();
    let depths = || (0..inputs.map_depths).map(|i| i as f64 * inputs.map_step_mm);
    let raster = runs.iter().flat_map(|runs| depths().map(|depth| point_of(runs, depth))).collect();
    Sections { runs, raster }
}

fn runs_of(inputs: &Inputs, ray: usize) -> Vec<Run> {
    let ray = inputs.in_scene(&inputs.map_rays[ray]);
    let mut inside = Membership::default();
    // The first run begins at the face.
    let mut runs: Vec<Run> = Vec::new();
    let begin = |runs: &mut Vec<Run>, start_mm: f64, tissue: usize| {
        let sum_np = runs.last().map_or(0.0, |last| last.sum_np + last.rate_np_mm * (start_mm - last.start_mm));
        if runs.last().is_none_or(|last| last.tissue != tissue) {
            runs.push(Run { start_mm, sum_np, rate_np_mm: ONE_WAY * inputs.media[tissue].attenuation_np_mm, tissue });
        }
    };
    let found = crossings(inputs, &ray, -inputs.reach_mm, inputs.depth_mm);
    let all: Vec<_> = coincident(&found).collect();
    let (behind, ahead) = all.split_at(all.partition_point(|coincident| coincident[0].t_mm <= 0.0));
    behind.iter().for_each(|coincident| inside.cross(coincident));
    if coupling(inputs, &ray, &inside, ahead.first().map(|coincident| &coincident[0])) < COUPLED_MIN {
        begin(&mut runs, 0.0, inputs.beyond);
        return runs;
    }
    begin(&mut runs, 0.0, inside.medium(inputs, ray.origin_mm));
    for coincident in ahead {
        inside.cross(coincident);
        begin(&mut runs, coincident[0].t_mm, inside.medium(inputs, ray.origin_mm + ray.direction * coincident[0].t_mm));
    }
    runs
}

fn point_of(runs: &[Run], depth_mm: f64) -> RasterPoint {
    let run = &runs[runs.partition_point(|run| run.start_mm <= depth_mm).saturating_sub(1)];
    RasterPoint { sum_np: run.sum_np + run.rate_np_mm * (depth_mm - run.start_mm), tissue: run.tissue }
}
