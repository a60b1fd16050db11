//! Traversal of nodes to collect the primitives that become surfaces.

use glam::{DMat4, DQuat, DVec3, Vec3};
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Node, Primitive, Scene};
use serde::Deserialize;
use serde_json::Value;

use super::document::File;
use super::{Finding, FindingKind};
use crate::anatomy::SceneError;

/// Tolerance for the norm of a node's quaternion: largest accepted deviation from 1.
const ROTATION_NORM_TOLERANCE: f64 = 1e-2;

/// A triangle primitive of a node.
pub(super) struct Part<'a> {
    /// Name of the node, with the primitive's number if its mesh has several.
    pub(super) name: String,
    /// Index of the node.
    pub(super) node: usize,
    /// Tissue as named by the extras or the material; `None` if neither names one.
    pub(super) tissue: Option<String>,
    pub(super) priority: i32,
    /// Transform from mesh to scene, both in metres.
    pub(super) scene_from_mesh: DMat4,
    pub(super) primitive: Primitive<'a>,
}

/// Tissue and priority as named by extras.
#[derive(Clone, Default)]
struct Labels {
    tissue: Option<String>,
    priority: Option<i32>,
}

impl Labels {
    /// These labels; missing ones are taken from `others`.
    fn or(self, others: &Self) -> Self {
        let tissue = self.tissue.or_else(|| others.tissue.clone());
        Self { tissue, priority: self.priority.or(others.priority) }
    }
}

/// Triangle primitives in depth-first order. Adds findings about skipped content, and problems that make the scene
/// unusable.
pub(super) fn parts<'a>(file: &'a File, findings: &mut Vec<Finding>, problems: &mut Vec<SceneError>) -> Vec<Part<'a>> {
    let mut seen = vec![false; file.document.nodes().len()];
    let mut stack: Vec<_> =
        roots(file).into_iter().rev().map(|node| (node, DMat4::IDENTITY, Labels::default())).collect();
    let mut parts = Vec::new();
    while let Some((node, scene_from_parent, above)) = stack.pop() {
        // A second visit means a node with two parents, or a cycle.
        if std::mem::replace(&mut seen[node.index()], true) {
            let name = node_name(&node);
            problems.push(file.format_error(format!("node `{name}` is reached twice; nodes must form trees")));
            continue;
        }
        let scene_from_node = match local_transform(&node) {
            Ok(parent_from_node) => scene_from_parent * parent_from_node,
            Err(reason) => {
                problems.push(file.format_error(format!("node `{}`: {reason}", node_name(&node))));
                continue;
            }
        };
        let own = labels(file, &node, node.extras(), problems);
        if let Some(mesh) = node.mesh() {
            // trimesh stores a mesh's metadata in its extras, and Blender the custom properties of an object's data.
            // They apply only to this mesh.
            let of_mesh = labels(file, &node, mesh.extras(), problems);
            let labels = own.clone().or(&of_mesh).or(&above);
            push_parts(&node, &mesh, scene_from_node, &labels, &mut parts, findings);
        }
        let inherited = own.or(&above);
        let children: Vec<_> = node.children().collect();
        stack.extend(children.into_iter().rev().map(|child| (child, scene_from_node, inherited.clone())));
    }
    let elsewhere = file.document.nodes().filter(|node| node.mesh().is_some() && !seen[node.index()]).count();
    if let Some(scene) = chosen_scene(file).filter(|_| elsewhere > 0) {
        let surface = scene.name().map_or_else(|| format!("scene {}", scene.index()), str::to_owned);
        findings.push(Finding { surface, kind: FindingKind::NotInScene { nodes: elsewhere } });
    }
    parts
}

/// Default scene of the file, or its first scene if none is marked as the default.
pub(super) fn chosen_scene(file: &File) -> Option<Scene<'_>> {
    file.document.default_scene().or_else(|| file.document.scenes().next())
}

fn roots(file: &File) -> Vec<Node<'_>> {
    if let Some(scene) = chosen_scene(file) {
        return scene.nodes().collect();
    }
    let mut is_child = vec![false; file.document.nodes().len()];
    for child in file.document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    file.document.nodes().filter(|node| !is_child[node.index()]).collect()
}

fn push_parts<'a>(
    node: &Node<'a>,
    mesh: &gltf::Mesh<'a>,
    scene_from_mesh: DMat4,
    labels: &Labels,
    parts: &mut Vec<Part<'a>>,
    findings: &mut Vec<Finding>,
) {
    let several = mesh.primitives().len() > 1;
    for primitive in mesh.primitives() {
        let mut name = node_name(node);
        if several {
            name = format!("{name}/{}", primitive.index());
        }
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            findings.push(Finding { surface: name, kind: FindingKind::NotTriangles });
            continue;
        }
        if node.skin().is_some() {
            findings.push(Finding { surface: name.clone(), kind: FindingKind::Skin });
        }
        parts.push(Part {
            name,
            node: node.index(),
            tissue: labels.tissue.clone().or_else(|| primitive.material().name().map(str::to_owned)),
            priority: labels.priority.unwrap_or(0),
            scene_from_mesh,
            primitive,
        });
    }
}

/// `tissue` and `priority` from the extras of a node or its mesh; other extras are ignored.
fn labels(file: &File, node: &Node<'_>, extras: &gltf::json::Extras, problems: &mut Vec<SceneError>) -> Labels {
    #[derive(Deserialize, Default)]
    struct Extras {
        tissue: Option<Value>,
        priority: Option<Value>,
    }
    // Extras may be any JSON; a value that is not an object has none of our keys.
    let extras: Extras = extras.as_ref().and_then(|raw| serde_json::from_str(raw.get()).ok()).unwrap_or_default();
    let mut bad = |key, value: &Value, expected| {
        let (path, node) = (file.path.clone(), node_name(node));
        problems.push(SceneError::BadExtras { path, node, key, value: value.to_string(), expected });
    };
    let tissue = match extras.tissue {
        None => None,
        Some(Value::String(name)) => Some(name),
        Some(other) => {
            bad("tissue", &other, "the name of a tissue");
            None
        }
    };
    let priority = extras.priority.and_then(|value| {
        // Some editors write integers as 3.0.
        let whole = value.as_f64().filter(|v| v.fract() == 0.0 && v.abs() <= f64::from(i32::MAX));
        if whole.is_none() {
            bad("priority", &value, "a whole number within ±2147483647");
        }
        whole.map(|v| v as i32)
    });
    Labels { tissue, priority }
}

fn local_transform(node: &Node<'_>) -> Result<DMat4, String> {
    let matrix = match node.transform() {
        Transform::Matrix { matrix } => DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from))),
        Transform::Decomposed { translation, rotation: [x, y, z, w], scale } => {
            let rotation = DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into());
            let norm = rotation.length();
            if !norm.is_finite() || (norm - 1.0).abs() > ROTATION_NORM_TOLERANCE {
                return Err(format!("its rotation has norm {norm}; it must be a unit quaternion"));
            }
            let (scale, translation) = (Vec3::from(scale).as_dvec3(), Vec3::from(translation).as_dvec3());
            DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation)
        }
    };
    if !matrix.is_finite() {
        return Err("its transform is not finite".to_owned());
    }
    if matrix.row(3) != glam::DVec4::W {
        return Err("the last row of its matrix is not 0 0 0 1".to_owned());
    }
    Ok(matrix)
}

fn node_name(node: &Node<'_>) -> String {
    let own = node.name().map(str::to_owned);
    own.or_else(|| node.mesh().and_then(|m| m.name().map(str::to_owned)))
        .unwrap_or_else(|| format!("node {}", node.index()))
}

impl Part<'_> {
    /// Whether the transform turns surfaces inside out.
    pub(super) fn mirrors(&self) -> bool {
        self.scene_from_mesh.determinant() < 0.0
    }

    /// Scene position of a vertex of the mesh (given in metres), mm.
    pub(super) fn scene_mm(&self, [x, y, z]: [f32; 3]) -> Vec3 {
        let metres = DVec3::new(x.into(), y.into(), z.into());
        (self.scene_from_mesh.transform_point3(metres) * 1000.0).as_vec3()
    }
}
