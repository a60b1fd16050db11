//! BVH trees of the moving triangles, one per group of triangles that move together.

use std::collections::HashMap;
use std::ops::Range;

use glam::{DVec3, Vec3};
use obvhs::cwbvh::CwBvh;
use rayon::prelude::*;

use super::refit;
use super::{Changed, PackedTriangle, local};
use crate::anatomy::motion::Motion;
use crate::anatomy::{Bounds, Scene};

/// Smallest number of vertices, triangles or nodes in a parallel task.
const TOGETHER: usize = 512;

/// Triangles that share a tree: all static ones, or all with the same first motion field.
#[derive(Debug)]
pub(super) struct Group {
    /// Indices of the triangles, counted through all surfaces.
    pub(super) triangles: Vec<u32>,
    /// Bit set of all motion fields that move any of these triangles.
    pub(super) fields: u32,
    /// Indices of the triangles' surfaces, each once.
    surfaces: Vec<usize>,
}

/// A moving vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex {
    /// Rest position, scene frame, mm.
    rest_mm: Vec3,
    /// Bit set of the motion fields that move the vertex.
    pub(super) fields: u32,
    /// Rest position and current position, both relative to the tree's centre, mm.
    pub(super) rest: Vec3,
    pub(super) now: Vec3,
}

/// Tree of a group.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    pub(super) fields: u32,
    /// Indices of the tree's nodes except its root.
    nodes: Range<usize>,
    pub(super) triangles: Range<usize>,
    vertices: Range<usize>,
    /// Bounds of the triangles at all times, scene frame, mm.
    swept_mm: Bounds,
    /// Number of the body: trees that hold parts of one surface have the same number.
    body: usize,
    /// Bit set of the fields that have changed since the last refit of the tree.
    stale: u32,
    /// Indices of the tree's nodes by level, the lowest first. Children of a node are in lower levels only.
    pub(super) levels: Vec<Vec<u32>>,
}

/// State for moving and refitting the trees without allocation.
#[derive(Debug, Clone)]
pub(super) struct Moving {
    pub(super) motion: Motion,
    /// Current amounts of movement of each motion field.
    pub(super) amounts: Vec<[f32; 2]>,
    pub(super) trees: Vec<Tree>,
    pub(super) vertices: Vec<Vertex>,
    /// Indices in `vertices` of each moving triangle's corners, in leaf order.
    pub(super) corners: Vec<[u32; 3]>,
    /// Displacement of each triangle, moving or static, from its rest position, mm.
    pub(super) displacements: Vec<[f32; 4]>,
    /// Index of the first moving triangle in leaf order.
    pub(super) first_triangle: usize,
    /// Exact (unquantised) box of each node.
    extents: Vec<Bounds>,
    /// Scratch memory: the refitted nodes of one level, with their boxes.
    fitted: Vec<([u32; 20], Bounds)>,
    /// Ranges modified by the last call of [`Moving::set_time_s`].
    pub(super) changed: Vec<Changed>,
}

/// Groups the triangles by the first motion field that ever moves one of their corners: static triangles first, then
/// one group per field. A static scene has one group.
pub(super) fn groups(scene: &Scene) -> Vec<Group> {
    let motion = &scene.motion;
    let mut groups: Vec<Group> =
        (0..=motion.fields.len()).map(|_| Group { triangles: Vec::new(), fields: 0, surfaces: Vec::new() }).collect();
    let mut first = 0u32;
    for (number, surface) in scene.surfaces.iter().enumerate() {
        let mesh = &surface.mesh;
        let mask = motion.mask_of(&surface.name);
        let moved: Vec<u32> =
            if mask == 0 { Vec::new() } else { mesh.vertices_mm.iter().map(|&v| motion.fields_at(v, mask)).collect() };
        for (triangle, index) in mesh.triangles.iter().zip(first..) {
            let fields = if mask == 0 { 0 } else { triangle.iter().fold(0, |all, &v| all | moved[v as usize]) };
            let group = if fields == 0 { 0 } else { fields.trailing_zeros() as usize + 1 };
            groups[group].triangles.push(index);
            groups[group].fields |= fields;
            if groups[group].surfaces.last() != Some(&number) {
                groups[group].surfaces.push(number);
            }
        }
        first += mesh.triangles.len() as u32;
    }
    groups.retain(|group| !group.triangles.is_empty());
    groups
}

/// Joins the nodes of all trees under one root, and prepares the motion of the trees. `order` lists the triangles of
/// all trees in leaf order. The root's boxes are still empty.
pub(super) fn join(
    scene: &Scene,
    groups: &[Group],
    trees: &[(CwBvh, &[u32])],
    order: &[u32],
    centre_mm: DVec3,
) -> (Vec<[u32; 20]>, Moving) {
    let mut nodes = vec![refit::joint(trees.len())];
    nodes.resize(1 + trees.len(), [0; 20]);
    let mut moving = Moving {
        motion: scene.motion.clone(),
        amounts: vec![[0.0; 2]; scene.motion.fields.len()],
        trees: Vec::new(),
        vertices: Vec::new(),
        corners: Vec::new(),
        displacements: vec![[0.0; 4]; order.len()],
        first_triangle: order.len(),
        extents: Vec::new(),
        fitted: Vec::new(),
        changed: Vec::with_capacity(trees.len() + 1),
    };
    let mut first_triangle = 0;
    for (i, ((tree, _), group)) in trees.iter().zip(groups).enumerate() {
        // The roots of all trees directly follow the joint root; node k > 0 of this tree is at `start + k - 1`.
        let start = nodes.len() as u32;
        let shifted = tree.nodes.iter().map(|node| {
            let mut node = *node;
            node.child_base_idx = (node.child_base_idx + start).saturating_sub(1);
            node.primitive_base_idx += first_triangle as u32;
            bytemuck::cast::<_, [u32; 20]>(node)
        });
        let mut shifted = shifted.collect::<Vec<_>>().into_iter();
        if let Some(root) = shifted.next() {
            nodes[1 + i] = root;
        }
        nodes.extend(shifted);
        let triangles = first_triangle..first_triangle + tree.primitive_indices.len();
        first_triangle = triangles.end;
        if group.fields != 0 {
            moving.first_triangle = moving.first_triangle.min(triangles.start);
            let first_vertex = moving.vertices.len();
            moving.add_corners(scene, &order[triangles.clone()], centre_mm);
            let at_rest = moving.vertices[first_vertex..].iter().fold(Bounds::EMPTY, |all, v| all.with(v.rest_mm));
            let reach_mm = scene.motion.reach_mm(group.fields) as f32;
            moving.trees.push(Tree {
                fields: group.fields,
                nodes: start as usize..nodes.len(),
                triangles,
                vertices: first_vertex..moving.vertices.len(),
                swept_mm: at_rest.grown(reach_mm),
                body: 0,
                stale: 0,
                levels: levels(&nodes, 1 + i),
            });
        }
    }
    moving.extents = vec![Bounds::EMPTY; nodes.len()];
    let moved: Vec<&Group> = groups.iter().filter(|group| group.fields != 0).collect();
    for (tree, body) in moving.trees.iter_mut().zip(bodies(&moved)) {
        tree.body = body;
    }
    (nodes, moving)
}

/// Indices of a tree's nodes by level, the lowest level first.
fn levels(nodes: &[[u32; 20]], root: usize) -> Vec<Vec<u32>> {
    let mut levels: Vec<Vec<u32>> = Vec::new();
    let order = super::parents_first(nodes, root as u32);
    let mut heights: HashMap<u32, usize> = HashMap::with_capacity(order.len());
    for &node in order.iter().rev() {
        let below = super::children(&nodes[node as usize]).filter_map(|child| heights.get(&child)).max();
        let height = below.map_or(0, |height| height + 1);
        heights.insert(node, height);
        levels.resize_with(levels.len().max(height + 1), Vec::new);
        levels[height].push(node);
    }
    // Sorted, so that neighbours in memory are fitted together.
    levels.iter_mut().for_each(|level| level.sort_unstable());
    levels
}

/// Number of each group's body. Groups that share a surface, also by way of other groups, are one body.
fn bodies(groups: &[&Group]) -> Vec<usize> {
    let mut bodies: Vec<usize> = (0..groups.len()).collect();
    for (at, group) in groups.iter().enumerate() {
        for before in (0..at).filter(|&before| groups[before].surfaces.iter().any(|s| group.surfaces.contains(s))) {
            let (kept, joined) = (bodies[before].min(bodies[at]), bodies[before].max(bodies[at]));
            bodies.iter_mut().filter(|body| **body == joined).for_each(|body| *body = kept);
        }
    }
    bodies
}

impl Moving {
    /// Adds the vertices and corners of `triangles`, which are indices counted through all surfaces.
    fn add_corners(&mut self, scene: &Scene, triangles: &[u32], centre_mm: DVec3) {
        let starts: Vec<u32> = scene
            .surfaces
            .iter()
            .scan(0u32, |next, surface| {
                let start = *next;
                *next += surface.mesh.triangles.len() as u32;
                Some(start)
            })
            .collect();
        let mut known: HashMap<(usize, u32), u32> = HashMap::new();
        for &triangle in triangles {
            let surface = starts.partition_point(|&start| start <= triangle) - 1;
            let mesh = &scene.surfaces[surface].mesh;
            let mask = scene.motion.mask_of(&scene.surfaces[surface].name);
            let corners = mesh.triangles[(triangle - starts[surface]) as usize].map(|v| {
                *known.entry((surface, v)).or_insert_with(|| {
                    let rest_mm = mesh.vertices_mm[v as usize];
                    let fields = scene.motion.fields_at(rest_mm, mask);
                    let rest = local(rest_mm, centre_mm);
                    self.vertices.push(Vertex { rest_mm, fields, rest, now: rest });
                    self.vertices.len() as u32 - 1
                })
            });
            self.corners.push(corners);
        }
    }

    /// Bit set of the trees of all bodies that can move into a box: bit i stands for tree i.
    pub(super) fn trees_near(&self, near_mm: Bounds) -> u32 {
        let is_near = |body: usize| self.trees.iter().any(|tree| tree.body == body && tree.swept_mm.meets(near_mm));
        let trees = self.trees.iter().enumerate();
        trees.filter(|(_, tree)| is_near(tree.body)).fold(0, |trees, (i, _)| trees | 1 << i)
    }

    /// Moves the triangles of `chosen` trees, a bit set, and refits these trees: see [`super::Bvh::set_time_near`].
    pub(super) fn set_time_s(
        &mut self,
        time_s: f64,
        chosen: u32,
        centre_mm: DVec3,
        nodes: &mut [[u32; 20]],
        triangles: &mut [PackedTriangle],
    ) {
        self.changed.clear();
        let mut dirty = 0u32;
        for (i, field) in self.motion.fields.iter().enumerate() {
            let amounts = field.amounts(time_s);
            if amounts != self.amounts[i] {
                self.amounts[i] = amounts;
                dirty |= 1 << i;
            }
        }
        let (motion, amounts) = (&self.motion, &self.amounts);
        for (i, tree) in self.trees.iter_mut().enumerate() {
            tree.stale |= tree.fields & dirty;
            if tree.stale == 0 || chosen & 1 << i == 0 {
                continue;
            }
            let dirty = std::mem::take(&mut tree.stale);
            self.vertices[tree.vertices.clone()].par_iter_mut().with_min_len(TOGETHER).for_each(|vertex| {
                if vertex.fields & dirty != 0 {
                    vertex.now = local(motion.moved(vertex.rest_mm, vertex.fields, amounts), centre_mm);
                }
            });
            let first = tree.triangles.start - self.first_triangle;
            let corners = &self.corners[first..first + tree.triangles.len()];
            let moved = triangles[tree.triangles.clone()]
                .par_iter_mut()
                .zip(&mut self.displacements[tree.triangles.clone()])
                .zip(corners)
                .with_min_len(TOGETHER);
            let all = &self.vertices;
            moved.for_each(|((packed, displacement), corners)| {
                let vertices = corners.map(|v| all[v as usize]);
                *packed = PackedTriangle::new(vertices.map(|v| v.now), packed.surface, packed.triangle);
                *displacement = (vertices.map(|v| v.now - v.rest).iter().sum::<Vec3>() / 3.0).extend(0.0).to_array();
            });
            for level in &tree.levels {
                let (before, extents, triangles) = (&*nodes, &self.extents, &*triangles);
                let fitted = level.par_iter().with_min_len(TOGETHER);
                let fitted = fitted.map(|&node| refit::fit(before[node as usize], triangles, extents));
                fitted.collect_into_vec(&mut self.fitted);
                for (&node, &(words, extent)) in level.iter().zip(&self.fitted) {
                    (nodes[node as usize], self.extents[node as usize]) = (words, extent);
                }
            }
            self.changed.push(Changed { nodes: tree.nodes.clone(), triangles: tree.triangles.clone() });
        }
        if !self.changed.is_empty() {
            let roots = nodes[0][3] >> 24;
            let trees = roots.count_ones() as usize;
            refit::fit_root(nodes, trees);
            self.changed.push(Changed { nodes: 0..1 + trees, triangles: 0..0 });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::Vec3;
    use obvhs::cwbvh::node::CwBvhNode;

    use super::*;
    use crate::anatomy::motion::{Field, Rhythm, Shape};
    use crate::anatomy::{Bvh, SegmentSearch, TissueTable, analytic};
    use crate::random::SplitMix64;

    fn ball(name: &'static str, centre: Vec3, radius: f32) -> analytic::Part {
        analytic::Part { name, tissue: "soft_tissue", priority: 0, mesh: analytic::sphere(centre, radius, 3) }
    }

    fn scene() -> Scene {
        let parts = vec![
            ball("skin", Vec3::ZERO, 60.0),
            ball("heart", Vec3::new(10.0, 0.0, 5.0), 9.0),
            ball("arm", Vec3::new(-20.0, 10.0, 0.0), 12.0),
        ];
        let mut scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap();
        let field = |name: &str, shape, rhythm| Field { name: name.into(), surfaces: vec![name.into()], shape, rhythm };
        let (axis, radius_mm) = (Vec3::Z, 9.0);
        let heart = Shape::Beat { centre_mm: Vec3::new(10.0, 0.0, 5.0), axis, radius_mm, squeeze: 0.3, shorten: 0.2 };
        let [joint_mm, end_mm] = [Vec3::new(-20.0, 5.0, 0.0), Vec3::new(-20.0, 20.0, 0.0)];
        let arm = Shape::Swing { joint_mm, end_mm, axis, radius_mm: 10.0, angle_deg: 30.0 };
        scene.motion.fields = vec![
            field("heart", heart, Rhythm::Heart { beats_per_min: 150.0 }),
            field("arm", arm, Rhythm::Twitch { every_s: 2.0, lasts_s: 0.9, seed: 1 }),
        ];
        scene
    }

    /// Collects the triangles below a node; panics if one exceeds a box above it.
    fn check(bvh: &Bvh, index: u32, found: &mut BTreeMap<u32, PackedTriangle>) -> Bounds {
        let node: &CwBvhNode = bytemuck::cast_ref(&bvh.nodes[index as usize]);
        let mut all = Bounds::EMPTY;
        for slot in 0..8 {
            if node.is_child_empty(slot) {
                continue;
            }
            let extent = if node.is_leaf(slot) {
                let (first, count) = node.child_primitives(slot);
                let leaf = &bvh.triangles[first as usize..(first + count) as usize];
                for t in leaf {
                    assert!(found.insert(t.triangle, *t).is_none(), "triangle {} is in two leaves", t.triangle);
                }
                leaf.iter().fold(Bounds::EMPTY, |e, t| e.hull(refit::bounds_of(t)))
            } else {
                check(bvh, node.child_node_index(slot), found)
            };
            let held = node.child_aabb(slot);
            let held = Bounds { min: held.min.into(), max: held.max.into() }.grown(1e-4);
            assert!(held.holds(extent), "child {slot} of node {index}");
            all = all.hull(extent);
        }
        all
    }

    #[test]
    fn the_refitted_tree_holds_the_moved_triangles_at_any_time() {
        let scene = scene();
        let mut bvh = Bvh::build(&scene).unwrap();
        bvh.set_time_s(0.0);
        assert_eq!(bvh.changed(), &[], "all is at rest at time 0");
        let mut moved = 0;
        for step in 0..40 {
            let time_s = f64::from(step * 7 % 40) * 0.13;
            bvh.set_time_s(time_s);
            let mut found = BTreeMap::new();
            check(&bvh, 0, &mut found);
            let displaced = Scene { motion: Motion::default(), ..scene.displaced(time_s) };
            let fresh = Bvh::build(&displaced).unwrap();
            assert_eq!(fresh.centre_mm, bvh.centre_mm);
            let expected: BTreeMap<u32, PackedTriangle> = fresh.triangles.iter().map(|t| (t.triangle, *t)).collect();
            assert_eq!(found, expected, "at {time_s} s");
            moved += usize::from(displaced.surfaces != scene.surfaces);
        }
        assert!(moved > 20, "{moved} of 40 times differ from rest");
    }

    #[test]
    fn modified_ranges_are_listed_and_rest_restores_the_first_tree() {
        let scene = scene();
        let first = Bvh::build(&scene).unwrap();
        let mut bvh = first.clone();
        let before = bvh.clone();
        bvh.set_time_s(0.08);
        let changed = bvh.changed().to_vec();
        assert_eq!(changed.len(), 2, "the heart's tree and the root: {changed:?}");
        let covered = |i: usize, of: fn(&Changed) -> &Range<usize>| changed.iter().any(|c| of(c).contains(&i));
        for i in 0..bvh.nodes.len() {
            assert!(bvh.nodes[i] == before.nodes[i] || covered(i, |c| &c.nodes), "node {i}");
        }
        for i in 0..bvh.triangles.len() {
            assert!(bvh.triangles[i] == before.triangles[i] || covered(i, |c| &c.triangles), "triangle {i}");
        }
        bvh.set_time_s(0.0);
        assert_eq!(bvh.triangles, first.triangles);
    }

    /// A ball of two moving parts, and a heart far from it.
    fn split() -> Scene {
        let mut scene = scene();
        let (axis, angle_deg) = (Vec3::X, 25.0);
        let part = |name: &str, z: f32| Field {
            name: name.into(),
            surfaces: vec!["arm".into()],
            shape: Shape::Swing {
                joint_mm: Vec3::new(-20.0, 10.0, 2.0 * z),
                end_mm: Vec3::new(-20.0, 10.0, 12.0 * z),
                axis,
                radius_mm: 9.0,
                angle_deg,
            },
            rhythm: Rhythm::Breath { breaths_per_min: 60.0, bout_s: 1.0, pause_s: 0.0, seed: 0 },
        };
        scene.motion.fields.truncate(1);
        scene.motion.fields.extend([part("upper", 1.0), part("lower", -1.0)]);
        scene
    }

    #[test]
    fn windings_are_exact_near_the_box_of_a_partial_move() {
        for scene in [scene(), split()] {
            let mut random = SplitMix64::new(8);
            let (mut whole, mut near) = (Bvh::build(&scene).unwrap(), Bvh::build(&scene).unwrap());
            let rest = near.clone();
            let mut search = SegmentSearch::default();
            let (mut stayed, mut moved) = (0, 0);
            for step in 0..2000 {
                // Several points at the same time, most of them near the border of a moving ball.
                let time_s = 0.031 * f64::from(step / 3);
                let (centre, radius) =
                    [(DVec3::new(10.0, 0.0, 5.0), 9.0), (DVec3::new(-20.0, 10.0, 0.0), 12.0)][step as usize % 2];
                let toward = DVec3::from_array([0; 3].map(|_| random.between(-1.0, 1.0))).normalize_or(DVec3::X);
                let point = centre + toward * (radius + random.between(-3.0, 1.0));
                whole.set_time_s(time_s);
                near.set_time_near(time_s, Bounds::around(point.as_vec3(), Vec3::splat(0.1)));
                let expected = whole.windings(point, 3);
                assert_eq!(search.windings(&near, point, 3), expected, "{point} at {time_s} s");
                stayed += usize::from(near.triangles != whole.triangles);
                moved += usize::from(rest.windings(point, 3) != expected);
            }
            assert!(stayed > 200 && moved > 20, "triangles stayed {stayed} times, motion counted {moved} times");
            near.set_time_s(77.7);
            whole.set_time_s(77.7);
            assert_eq!(near.triangles, whole.triangles);
            assert_eq!(near.nodes, whole.nodes);
        }
    }

    #[test]
    fn trees_that_share_a_surface_are_one_body() {
        let bodies = |scene: &Scene| -> Vec<usize> {
            Bvh::build(scene).unwrap().moving.unwrap().trees.iter().map(|tree| tree.body).collect()
        };
        assert_eq!(bodies(&scene()), [0, 1]);
        assert_eq!(bodies(&split()), [0, 1, 1]);
        let moving = Bvh::build(&split()).unwrap().moving.unwrap();
        let above = Bounds::around(Vec3::new(-20.0, 10.0, 15.0), Vec3::splat(0.1));
        assert!(moving.trees[1].swept_mm.meets(above) && !moving.trees[2].swept_mm.meets(above));
        assert_eq!(moving.trees_near(above), 0b110, "the lower part moves with the upper one");
        assert_eq!(moving.trees_near(Bounds::around(Vec3::new(10.0, 0.0, 5.0), Vec3::splat(0.1))), 0b001);
        assert_eq!(moving.trees_near(Bounds::around(Vec3::splat(90.0), Vec3::splat(0.1))), 0);
    }
}
