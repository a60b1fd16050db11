//! Correction of labels whose surfaces would have edges of four faces.
//!
//! If a label has just two opposite corners of a square of four neighbouring voxels, its surface has an edge of four
//! faces. A well-composed image has no such squares (Latecki 1997). They are removed voxel by voxel.

use rayon::prelude::*;

/// Pairs of axes that span the planes of the squares.
const PLANES: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Changes `labels` until no label has just two opposite corners of a square. Returns the number of changes.
///
/// `rank` orders the labels. A voxel changes only to a neighbour's label of higher rank, so the changes come to an end.
pub fn make_well_composed(labels: &mut [u16], size: [usize; 3], rank: &(dyn Fn(u16) -> u64 + Sync)) -> usize {
    let squares = Squares { size, strides: [1, size[0], size[0] * size[1]] };
    let layer = squares.strides[2];
    let shared: &[u16] = labels;
    let mut stack: Vec<(usize, u8)> = (0..size[2])
        .into_par_iter()
        .flat_map_iter(|k| {
            let squares = &squares;
            (k * layer..(k + 1) * layer).flat_map(move |first| {
                (0..3u8)
                    .filter(move |&plane| squares.corners(first, plane).is_some_and(|c| crossed(c.map(|i| shared[i]))))
                    .map(move |plane| (first, plane))
            })
        })
        .collect();
    let mut changed = 0;
    while let Some((first, plane)) = stack.pop() {
        let Some(corners) = squares.corners(first, plane) else { continue };
        let found = corners.map(|i| labels[i]);
        if !crossed(found) {
            continue;
        }
        let Some((voxel, label)) = best_change(&squares, labels, corners, rank) else { continue };
        labels[voxel] = label;
        changed += 1;
        squares.each_around(voxel, |first, plane, corners| {
            if crossed(corners.map(|i| labels[i])) {
                stack.push((first, plane));
            }
        });
        stack.push((first, plane));
    }
    changed
}

/// Whether a label has just two opposite corners of a square with these labels, given in order around the square.
fn crossed([p, q, r, s]: [u16; 4]) -> bool {
    (p == r && q != p && s != p) || (q == s && p != q && r != q)
}

/// Voxel and new label of the change that leaves the fewest [`crossed`] squares around the voxel; `None` if no change
/// helps.
fn best_change(
    squares: &Squares,
    labels: &mut [u16],
    corners: [usize; 4],
    rank: &(dyn Fn(u16) -> u64 + Sync),
) -> Option<(usize, u16)> {
    let mut best: Option<(usize, usize, u16)> = None;
    for (n, &voxel) in corners.iter().enumerate() {
        let before = labels[voxel];
        for next in [corners[(n + 1) % 4], corners[(n + 3) % 4]] {
            let label = labels[next];
            if rank(label) <= rank(before) {
                continue;
            }
            labels[voxel] = label;
            let solved = !crossed(corners.map(|i| labels[i]));
            let mut left = 0;
            squares.each_around(voxel, |_, _, c| left += usize::from(crossed(c.map(|i| labels[i]))));
            labels[voxel] = before;
            if solved && best.is_none_or(|(fewest, ..)| left < fewest) {
                best = Some((left, voxel, label));
            }
        }
    }
    best.map(|(_, voxel, label)| (voxel, label))
}

struct Squares {
    size: [usize; 3],
    strides: [usize; 3],
}

impl Squares {
    /// Corners, in order, of the square in `plane` with its lowest corner at voxel `first`; `None` beyond the grid.
    fn corners(&self, first: usize, plane: u8) -> Option<[usize; 4]> {
        let (u, v) = PLANES[usize::from(plane)];
        let at = |axis: usize| first / self.strides[axis] % self.size[axis];
        (at(u) + 1 < self.size[u] && at(v) + 1 < self.size[v]).then(|| {
            let (u, v) = (self.strides[u], self.strides[v]);
            [first, first + u, first + u + v, first + v]
        })
    }

    /// Calls `visit` with the first corner, plane and corners of each square that contains the voxel.
    fn each_around(&self, voxel: usize, mut visit: impl FnMut(usize, u8, [usize; 4])) {
        for (plane, (u, v)) in (0u8..).zip(PLANES) {
            let at = |axis: usize| voxel / self.strides[axis] % self.size[axis];
            for (du, dv) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                if at(u) >= du && at(v) >= dv {
                    let first = voxel - du * self.strides[u] - dv * self.strides[v];
                    if let Some(corners) = self.corners(first, plane) {
                        visit(first, plane, corners);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_labels_become_well_composed_and_sound_ones_stay() {
        let size = [13, 11, 12];
        let mut state = 1u64;
        let mut labels: Vec<u16> = (0..size.iter().product::<usize>())
            .map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (state >> 60) as u16 % 5
            })
            .collect();
        let changed = make_well_composed(&mut labels, size, &|label| u64::from(label));
        assert!(changed > 0);
        let squares = Squares { size, strides: [1, 13, 143] };
        let left = (0..labels.len()).flat_map(|i| (0..3).map(move |p| (i, p)));
        let count = left.filter(|&(i, p)| squares.corners(i, p).is_some_and(|c| crossed(c.map(|i| labels[i])))).count();
        assert_eq!(count, 0);
        assert_eq!(make_well_composed(&mut labels, size, &|label| u64::from(label)), 0);
    }
}
