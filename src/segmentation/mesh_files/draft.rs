//! A mesh while it is read.

use std::collections::HashMap;

use glam::DVec3;

use super::NamedMesh;

/// Triangles of one mesh of a file, over vertices that it may share with others.
#[derive(Debug, Default)]
pub(super) struct Draft {
    pub(super) name: Option<String>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Draft {
    /// A draft without triangles.
    pub(super) fn named(name: impl Into<String>) -> Self {
        let name = name.into();
        Self { name: (!name.is_empty()).then_some(name), triangles: Vec::new() }
    }

    /// Adds a polygon, divided into triangles. Fewer than three corners add nothing.
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

    /// Adds a strip: each vertex makes a triangle with the two before.
    pub(super) fn strip(&mut self, corners: &[u32]) {
        let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
        self.triangles.extend(corners.windows(3).enumerate().map(turned));
    }

    /// The mesh with its own vertices, each position once.
    pub(super) fn finish(self, vertices: &[DVec3], otherwise: &str) -> NamedMesh {
        let mut index_at = HashMap::new();
        let mut own = Vec::new();
        let mut index_of = vec![u32::MAX; vertices.len()];
        let mut index = |vertex: u32| {
            let known = &mut index_of[vertex as usize];
            if *known == u32::MAX {
                let at = vertices[vertex as usize];
                // Adding zero turns −0 into 0.
                let key = (at + DVec3::ZERO).to_array().map(f64::to_bits);
                *known = *index_at.entry(key).or_insert_with(|| {
                    own.push(at);
                    own.len() as u32 - 1
                });
            }
            *known
        };
        let triangles = self.triangles.iter().map(|t| t.map(&mut index)).collect();
        NamedMesh { name: self.name.unwrap_or_else(|| otherwise.to_owned()), vertices: own, triangles }
    }
}

/// Most corners of a polygon whose ears are sought; larger ones are divided as a fan.
const EARS_MAX: usize = 256;

/// Triangles of a flat polygon, by cutting off ears (Meisters, Am Math Mon 82:648, 1975).
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
        // A polygon that crosses itself has no ears left at some time.
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
        let draft = Draft { name: None, triangles: vec![[0, 1, 2], [5, 2, 4]] };
        let mesh = draft.finish(&vertices, "stem");
        assert_eq!((mesh.vertices.len(), mesh.name.as_str()), (3, "stem"));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 1]]);
    }
}
