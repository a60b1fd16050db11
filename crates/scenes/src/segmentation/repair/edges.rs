//! Edges of a mesh, neighbours of triangles over them, and connected components.

use rayon::slice::ParallelSliceMut;

use insonify_core::anatomy::groups::Groups;

/// Index that means no triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Edge of a triangle, with its vertices in order of index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    pub(super) low: u32,
    pub(super) high: u32,
    pub(super) triangle: u32,
    /// Position of the edge in its triangle: from corner `side` to the next one.
    pub(super) side: u8,
    /// Whether the triangle runs along the edge from `high` to `low`.
    pub(super) back: bool,
}

impl Edge {
    /// Start and end of the edge in the direction of its triangle.
    pub(super) fn directed(self) -> [u32; 2] {
        if self.back { [self.high, self.low] } else { [self.low, self.high] }
    }
}

/// The three edges of a triangle, each in the triangle's direction.
pub(super) fn of([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The edge with its lower vertex first.
pub(super) fn undirected([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Edges of all triangles, sorted by their vertices, so that coincident edges are adjacent.
pub(super) fn sorted(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
    for (&triangle, index) in triangles.iter().zip(0u32..) {
        edges.extend(of(triangle).into_iter().zip(0u8..).map(|([from, to], side)| Edge {
            low: from.min(to),
            high: from.max(to),
            triangle: index,
            side,
            back: from > to,
        }));
    }
    edges.par_sort_unstable_by_key(|e| ((u64::from(e.low) << 32) | u64::from(e.high), e.triangle, e.side));
    edges
}

/// Groups of coincident edges, in the sorted list `edges`.
pub(super) fn groups(edges: &[Edge]) -> impl Iterator<Item = &[Edge]> {
    edges.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high))
}

/// Open edges (edges of a single triangle), in the direction of that triangle.
pub(super) fn open(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = sorted(triangles);
    groups(&edges).filter(|group| group.len() == 1).map(|group| group[0].directed()).collect()
}

/// For each triangle, the number of its component. Edges of exactly two triangles connect components.
pub(super) fn components(triangles: usize, edges: &[Edge]) -> Vec<u32> {
    let mut joined = Groups::new(triangles);
    for group in groups(edges) {
        if let [a, b] = group {
            joined.join(a.triangle, b.triangle);
        }
    }
    joined.numbered()
}

/// For each triangle, the neighbours over its three edges; [`NONE`] at an edge that does not have exactly two
/// triangles.
pub(super) fn neighbours(triangles: usize, edges: &[Edge]) -> Vec<[u32; 3]> {
    let mut next = vec![[NONE; 3]; triangles];
    for group in groups(edges) {
        if let [a, b] = group {
            next[a.triangle as usize][usize::from(a.side)] = b.triangle;
            next[b.triangle as usize][usize::from(b.side)] = a.triangle;
        }
    }
    next
}
