//! Whether the body's outline and the image contain the labelled organs.

use std::path::Path;

use insonify_core::names::listed;
use rayon::prelude::*;

use super::gather_error::GatherError;
use super::grid::Grid;
use super::image;
use super::inputs::Organ;
use super::volume::LabelMap;

/// Smallest share of the labelled voxels that a body or an image must contain, %.
const COVERED_PERCENT: f64 = 80.0;
/// Smallest share of the labelled voxels, %, that a body must contain to pass without a remark.
const HELD_PERCENT: f64 = 99.0;
/// Shares of an organ's voxels outside the body, %: above `NAMED_PERCENT`, a message names the organ; above
/// `MOSTLY_PERCENT`, the body is refused.
const NAMED_PERCENT: f64 = 10.0;
const MOSTLY_PERCENT: f64 = 50.0;
/// Fewest voxels of an organ that is checked on its own.
const LEAST_VOXELS: usize = 100;
/// A body counts as the labelled organs alone if its number of voxels, relative to that of the labelled voxels, is in
/// this range.
const ONLY_ORGANS: std::ops::RangeInclusive<f64> = 0.99..=1.01;
/// Most organs in a message.
const LISTED_MAX: usize = 6;

/// Labels of the voxels of a grid: 0, or 1 + index of the organ.
pub(super) struct Labelled<'a> {
    pub(super) path: &'a Path,
    pub(super) labels: &'a [u16],
    pub(super) grid: &'a Grid,
    pub(super) organs: &'a [Organ],
}

impl Labelled<'_> {
    /// Refuses a volume (body or image) that contains too few of the labelled voxels. `inside(i)` tells whether the
    /// volume contains voxel `i` of the labels' grid; `holds(i)`, whether voxel `i` of `volume` is part of its content.
    pub(super) fn covered(
        &self,
        inside: &(dyn Fn(usize) -> bool + Sync),
        option: &'static str,
        path: &Path,
        volume: &Grid,
        holds: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<(), GatherError> {
        let labelled = self.labels.par_iter().enumerate().filter(|(_, label)| **label != 0);
        let (count, held) =
            labelled.map(|(i, _)| (1usize, usize::from(inside(i)))).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let percent = 100.0 * held as f64 / count.max(1) as f64;
        if percent >= COVERED_PERCENT {
            return Ok(());
        }
        let hint = image::turned_hint(self.labels, self.grid, volume, holds, COVERED_PERCENT);
        let (path, labels) = (path.to_owned(), self.path.to_owned());
        Err(GatherError::OtherScan { path, option, labels, percent, hint })
    }

    /// Mask, on the labels' grid, of the voxels that `map` labels as body, and a remark on organs outside the body.
    ///
    /// # Errors
    /// A map without a labelled voxel, or of another scan. Unless `is_allowed`: a map that leaves most of an organ
    /// outside the body, or that labels only the organs.
    pub(super) fn body(&self, map: LabelMap, is_allowed: bool) -> Result<(Vec<bool>, Option<String>), GatherError> {
        let map = map.canonical();
        if map.layers.iter().all(|layer| layer.par_iter().all(|&l| l == 0)) {
            return Err(GatherError::NoBody { path: map.path });
        }
        let volume = map.grid();
        let index = image::nearest(self.grid, &volume);
        let holds = |i: usize| map.layers.iter().any(|layer| layer[i] != 0);
        let body: Vec<bool> = (0..self.grid.len()).into_par_iter().map(|i| index(i).is_some_and(&holds)).collect();
        self.covered(&|i| body[i], "--body", &map.path, &volume, &holds)?;
        let remark = self.outside(&body, &map.path, is_allowed)?;
        Ok((body, remark))
    }

    /// A remark on organs outside the body. Refuses a body as [`body`](Self::body) does, unless `is_allowed`.
    fn outside(&self, body: &[bool], path: &Path, is_allowed: bool) -> Result<Option<String>, GatherError> {
        let mut organs = vec![(0usize, 0usize); self.organs.len() + 1];
        let mut voxels = 0usize;
        for (label, inside) in self.labels.iter().zip(body) {
            voxels += usize::from(*inside);
            if let Some((count, outside)) = organs.get_mut(usize::from(*label)).filter(|_| *label != 0) {
                *count += 1;
                *outside += usize::from(!*inside);
            }
        }
        let (count, outside) = organs.iter().fold((0usize, 0usize), |sum, organ| (sum.0 + organ.0, sum.1 + organ.1));
        let percent_of = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
        let is_only_organs = ONLY_ORGANS.contains(&(voxels as f64 / count.max(1) as f64));
        let outside_percent = percent_of(outside, count);
        if is_only_organs && outside_percent <= 100.0 - HELD_PERCENT && !is_allowed {
            return Err(GatherError::OnlyOrgans { path: path.to_owned(), labels: self.path.to_owned() });
        }
        let shares = self.organs.iter().zip(&organs[1..]).filter(|(_, (count, _))| *count >= LEAST_VOXELS);
        let mut named: Vec<(f64, &str)> =
            shares.map(|(organ, (count, outside))| (percent_of(*outside, *count), organ.name.as_str())).collect();
        named.retain(|(percent, _)| *percent > NAMED_PERCENT);
        named.sort_by(|a, b| b.0.total_cmp(&a.0));
        let words: Vec<String> = named.iter().map(|(percent, name)| format!("`{name}` {percent:.0} %")).collect();
        let words = listed(&words, LISTED_MAX, ", ");
        if !is_allowed && named.first().is_some_and(|(percent, _)| *percent > MOSTLY_PERCENT) {
            let (path, labels) = (path.to_owned(), self.path.to_owned());
            return Err(GatherError::OrganOutside { path, labels, organs: words });
        }
        if named.is_empty() && outside_percent <= 100.0 - HELD_PERCENT {
            return Ok(None);
        }
        let name = path.file_name().unwrap_or(path.as_os_str()).display();
        let of = if words.is_empty() { String::new() } else { format!(" ({words})") };
        Ok(Some(format!(
            "{name}: {outside_percent:.0} % of the labelled voxels lie outside the body{of}: is it of the same scan?"
        )))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;

    const SIZE: [usize; 3] = [20, 20, 8];

    /// A grid about the middle of the axes x and y.
    fn grid() -> Grid {
        Grid { size: SIZE, lps_from_voxel: DAffine3::from_translation(DVec3::new(-9.5, -9.5, 0.0)) }
    }

    /// A liver in columns 4 to 9 and a spleen in columns 12 and 13, each in rows 4 to 15.
    fn labels() -> Vec<u16> {
        let grid = grid();
        let label = |i: usize| match grid.at(i) {
            [4..=9, 4..=15, _] => 1,
            [12..=13, 4..=15, _] => 2,
            _ => 0,
        };
        (0..grid.len()).map(label).collect()
    }

    fn found(is_body: impl Fn([usize; 3]) -> bool, is_allowed: bool) -> Result<Option<String>, String> {
        let organ = |name: &str| Organ {
            name: name.to_owned(),
            tissue: name.to_owned(),
            priority: 50,
            wall: Vec::new(),
            gas: None,
        };
        let (grid, labels, organs) = (grid(), labels(), [organ("liver"), organ("spleen")]);
        let map = LabelMap {
            path: "a/body.nii".into(),
            size: SIZE,
            lps_from_voxel: grid.lps_from_voxel,
            layers: vec![(0..grid.len()).map(|i| u16::from(is_body(grid.at(i)))).collect()],
            segments: Vec::new(),
            remarks: Vec::new(),
        };
        let labelled = Labelled { path: Path::new("labels.nii"), labels: &labels, grid: &grid, organs: &organs };
        labelled.body(map, is_allowed).map(|(_, remark)| remark).map_err(|error| error.to_string())
    }

    #[test]
    fn organs_outside_the_body_are_named_or_refused() {
        let trunk = |[x, y, _]: [usize; 3]| (2..18).contains(&x) && (2..18).contains(&y);
        assert_eq!(found(trunk, false), Ok(None));
        let without = |at: [usize; 3], left: usize, back: usize| trunk(at) && !(at[0] > left && at[1] > back);
        let remark = found(|at| without(at, 11, 12), false).unwrap().unwrap();
        assert_eq!(
            remark,
            "body.nii: 6 % of the labelled voxels lie outside the body (`spleen` 25 %): is it of the same scan?"
        );
        let error = found(|at| without(at, 8, 0), false).unwrap_err();
        assert!(error.contains("holds only 6"), "{error}");
        assert!(found(|at| without(at, 11, 7), true).unwrap().unwrap().contains("`spleen` 67 %"));
        let error = found(|at| without(at, 11, 7), false).unwrap_err();
        assert!(error.contains("--body, leaves most of an organ of labels.nii outside: `spleen` 67 %"), "{error}");
        assert!(error.contains("--allow-implausible"), "{error}");
    }

    #[test]
    fn a_body_that_is_the_organs_alone_is_refused() {
        let organs = |[x, y, _]: [usize; 3]| ((4..=9).contains(&x) || (12..=13).contains(&x)) && (4..=15).contains(&y);
        let error = found(organs, false).unwrap_err();
        assert!(error.contains("holds only the organs that labels.nii labels, no body around them"), "{error}");
        assert_eq!(found(organs, true), Ok(None));
    }

    #[test]
    fn an_inverted_body_is_not_said_to_be_mirrored() {
        let inverted = |[x, y, _]: [usize; 3]| !((3..17).contains(&x) && (3..17).contains(&y));
        let error = found(inverted, false).unwrap_err();
        assert!(error.contains("holds only 0 %") && !error.contains("negated"), "{error}");
    }
}
