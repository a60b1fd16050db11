//! Cells of VTK files: polygons and triangle strips.

use glam::DVec3;

use super::draft::Draft;
use super::scanner::index;

/// Kind of the cells in a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cells {
    Polygons,
    Strips,
}

impl Cells {
    fn add(self, corners: &[f64], vertices: &[DVec3], draft: &mut Draft) -> Result<(), String> {
        let wrong = |value: f64| format!("a cell names point {value} of {}, counted from 0", vertices.len());
        let corners = corners.iter().map(|value| index(*value, vertices.len()).ok_or_else(|| wrong(*value)));
        let corners = corners.collect::<Result<Vec<u32>, _>>()?;
        match self {
            Self::Polygons => draft.polygon(&corners, vertices),
            Self::Strips => draft.strip(&corners),
        }
        Ok(())
    }

    /// Adds cells to `draft`. In `values`, each cell is a number of corners, followed by the vertex indices of the
    /// corners. `cells` is the required number of cells.
    pub(super) fn add_counted(
        self,
        cells: usize,
        values: &[f64],
        vertices: &[DVec3],
        draft: &mut Draft,
    ) -> Result<(), String> {
        let (mut rest, mut added) = (values, 0);
        while let [count, after @ ..] = rest {
            let count = index(*count, after.len() + 1).map(|count| count as usize);
            let Some((corners, next)) = count.and_then(|count| after.split_at_checked(count)) else {
                return Err("the last cell has fewer corners than it says".to_owned());
            };
            self.add(corners, vertices, draft)?;
            (rest, added) = (next, added + 1);
        }
        if added == cells { Ok(()) } else { Err(format!("the list has {added} cells, and {cells} are promised")) }
    }

    /// Adds cells to `draft`. `corners` are the vertex indices of all cells, one cell after the other. `ends` has
    /// the index in `corners` at which each cell ends; the last cell must end with the list.
    pub(super) fn add_by_ends(
        self,
        ends: &[f64],
        corners: &[f64],
        vertices: &[DVec3],
        draft: &mut Draft,
    ) -> Result<(), String> {
        let mut start = 0;
        for end in ends {
            let stop = index(*end, corners.len() + 1).map(|end| end as usize).filter(|stop| *stop >= start);
            let Some(stop) = stop else {
                return Err(format!("the offset {end} is not between {start} and {}", corners.len()));
            };
            self.add(&corners[start..stop], vertices, draft)?;
            start = stop;
        }
        if start != corners.len() {
            return Err(format!("the offsets end at {start} of {} corners", corners.len()));
        }
        Ok(())
    }
}
