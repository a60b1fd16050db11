//! Drafts of meshes, for use while a file is read.

use std::collections::HashMap;

use glam::DVec3;
use insonify_core::names::printable;

use super::{MeshPart, NamedMesh};

/// Draft of a mesh: triangles of one mesh of a file, or of a part of a mesh. Drafts may share vertices.
#[derive(Debug, Default)]
pub(super) struct Draft {
    pub(super) name: Option<String>,
    /// Name of the part, such as a material; may be empty.
    pub(super) part: Option<String>,
    /// Number of the mesh that this draft is a part of; `None` if the draft is a whole mesh.
    pub(super) whole: Option<usize>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Draft {
    /// A draft without triangles.
    pub(super) fn named(name: impl Into<String>) -> Self {
        let name = name.into();
        Self { name: (!name.is_empty()).then_some(name), ..Self::default() }
    }

    /// The draft with `triangles` instead of its own.
    pub(super) fn with(self, triangles: Vec<[u32; 3]>) -> Self {
        Self { triangles, ..self }
    }

    /// Adds a polygon, divided into triangles. A polygon of fewer than three corners adds nothing.
    pub(super) fn polygon(&mut self, corners: &[u32], vertices: &[DVec3]) {
        match *corners {
            [a, b, c] => self.triangles.push([a, b, c]),
            [_, _, _, _, ..] => {
                let at = |i: &u32| vertices.get(*i as usize).copied().unwrap_or_default();
                let points: Vec<DVec3> = corners.iter().map(at).collect();
                self.triangles.extend(divided(&points).into_iter().map(|t| t.map(|i| corners[i])));
            }
            _ => {}
        }
    }

    /// Adds a triangle strip: each vertex makes a triangle with the two vertices before it.
    pub(super) fn strip(&mut self, corners: &[u32]) {
        let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
        self.triangles.extend(corners.windows(3).enumerate().map(turned));
    }
}

/// Drafts that have triangles, grouped by mesh, in the order of first appearance.
pub(super) fn by_mesh(drafts: Vec<Draft>) -> Vec<Vec<Draft>> {
    let mut meshes: Vec<Vec<Draft>> = Vec::new();
    let mut index_of: HashMap<usize, usize> = HashMap::new();
    for draft in drafts.into_iter().filter(|draft| !draft.triangles.is_empty()) {
        let known = draft.whole.and_then(|whole| index_of.get(&whole).copied());
        if let Some(index) = known {
            meshes[index].push(draft);
            continue;
        }
        index_of.extend(draft.whole.map(|whole| (whole, meshes.len())));
        meshes.push(vec![draft]);
    }
    meshes
}

/// Converter of drafts to meshes; the drafts share the vertices of a file.
pub(super) struct Finisher<'v> {
    vertices: &'v [DVec3],
    /// For each vertex of the file: number of the mesh that last used it, and its index in that mesh.
    known: Vec<[u32; 2]>,
    /// Number of the current mesh, counted from 1; 0 before the first mesh.
    mesh: u32,
}

impl<'v> Finisher<'v> {
    pub(super) fn new(vertices: &'v [DVec3]) -> Self {
        Self { vertices, known: vec![[0; 2]; vertices.len()], mesh: 0 }
    }

    /// Mesh with these drafts as its parts, and with its own vertices; equal positions become one vertex. If no draft
    /// has a name, the mesh is called `otherwise`.
    pub(super) fn finish(&mut self, mut drafts: Vec<Draft>, otherwise: &str) -> NamedMesh {
        self.mesh += 1;
        let (mut index_at, mut own) = (HashMap::new(), Vec::new());
        let mut index = |vertex: u32| {
            let [mesh, known] = &mut self.known[vertex as usize];
            if *mesh != self.mesh {
                let at = self.vertices[vertex as usize];
                // Adding zero turns −0 into 0.
                let key = (at + DVec3::ZERO).to_array().map(f64::to_bits);
                *mesh = self.mesh;
                *known = *index_at.entry(key).or_insert_with(|| {
                    own.push(at);
                    own.len() as u32 - 1
                });
            }
            *known
        };
        // Names appear in messages, tables and station files, so they must fit on one line.
        let name = {
            let names = drafts.iter().filter_map(|draft| draft.name.as_deref()).chain([otherwise]);
            let mut names = names.map(|name| printable(name).into_owned());
            names.find(|name| !name.is_empty()).unwrap_or_else(|| "mesh".to_owned())
        };
        drafts.iter_mut().filter_map(|draft| draft.part.as_mut()).for_each(|part| *part = printable(part).into_owned());
        let mut order: HashMap<Option<String>, usize> = HashMap::new();
        for draft in &drafts {
            let count = order.len();
            order.entry(draft.part.clone()).or_insert(count);
        }
        drafts.sort_by_key(|draft| order.get(&draft.part).copied());
        let (mut triangles, mut parts) = (Vec::new(), Vec::<MeshPart>::new());
        for draft in drafts {
            let first = triangles.len();
            triangles.extend(draft.triangles.iter().map(|t| t.map(&mut index)));
            match (draft.part, parts.last_mut()) {
                (Some(name), Some(part)) if part.name == name => part.triangles.end = triangles.len(),
                (Some(name), _) => parts.push(MeshPart { name, triangles: first..triangles.len() }),
                (None, _) => {}
            }
        }
        NamedMesh { name, vertices: own, triangles, parts }
    }
}

/// Most corners of a polygon that is divided by ear clipping. Larger polygons are divided into a fan of triangles.
const EARS_MAX: usize = 256;

/// Triangles of a flat polygon, as indices of its points, by ear clipping (Meisters, Am Math Mon 82:648, 1975).
fn divided(points: &[DVec3]) -> Vec<[usize; 3]> {
    if points.len() > EARS_MAX {
        return (2..points.len()).map(|i| [0, i - 1, i]).collect();
    }
    let next = points.iter().cycle().skip(1);
    let normal: DVec3 = points.iter().zip(next).map(|(a, b)| (*a - points[0]).cross(*b - points[0])).sum();
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len());
    let side = |a: usize, b: usize, c: usize| (points[b] - points[a]).cross(points[c] - points[a]).dot(normal);
    while left.len() > 3 {
        let count = left.len();
        let around = |i: usize| [left[(i + count - 1) % count], left[i], left[(i + 1) % count]];
        let is_ear = |i: usize| {
            let [a, b, c] = around(i);
            let holds = |p: usize| side(a, b, p) >= 0.0 && side(b, c, p) >= 0.0 && side(c, a, p) >= 0.0;
            side(a, b, c) > 0.0 && !left.iter().any(|&p| p != a && p != b && p != c && holds(p))
        };
        // A polygon that crosses itself may have no ear left.
        let ear = (0..count).find(|i| is_ear(*i)).unwrap_or(0);
        triangles.push(around(ear));
        left.remove(ear);
    }
    if let [a, b, c] = left[..] {
        triangles.push([a, b, c]);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_with_a_notch_is_divided_inside_it() {
        // The diagonal from the first corner would leave the polygon.
        let points = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let mut draft = Draft::default();
        draft.polygon(&[3, 0, 1, 2], &points);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            0.5 * (b - a).cross(c - a).z
        };
        assert!(draft.triangles.iter().all(|t| area(t) > 0.0));
        assert!((draft.triangles.iter().map(area).sum::<f64>() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn equal_positions_become_one_vertex_and_unused_ones_go() {
        let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::X, -DVec3::ZERO];
        let draft = Draft::default().with(vec![[0, 1, 2], [5, 2, 4]]);
        let mesh = Finisher::new(&vertices).finish(vec![draft], "stem");
        assert_eq!((mesh.vertices.len(), mesh.name.as_str()), (3, "stem"));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 1]]);
    }
}
