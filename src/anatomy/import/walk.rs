//! From nodes to the parts that become surfaces.

use glam::{DMat4, DQuat, DVec3, Vec3, Vec4};
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Node, Primitive};
use serde::Deserialize;
use serde_json::Value;

use super::document::File;
use super::{Finding, FindingKind};
use crate::anatomy::SceneError;

/// Largest accepted departure of a node's quaternion from norm one.
const ROTATION_NORM_TOLERANCE: f64 = 1e-2;

/// A triangle primitive of a node.
pub(super) struct Part<'a> {
    /// The node's name; with the primitive's number where its mesh has several.
    pub(super) name: String,
    /// As the extras or the material say.
    pub(super) tissue: Option<String>,
    pub(super) priority: i32,
    /// Metres of the scene from metres of the mesh.
    pub(super) scene_from_mesh: DMat4,
    pub(super) primitive: Primitive<'a>,
}

/// What a node hands down to its children.
#[derive(Clone)]
struct Inherited {
    scene_from_parent: DMat4,
    tissue: Option<String>,
    priority: Option<i32>,
}

/// Triangle primitives in depth-first order; findings about what is left out.
pub(super) fn parts<'a>(file: &'a File, findings: &mut Vec<Finding>) -> Result<Vec<Part<'a>>, SceneError> {
    let root = Inherited { scene_from_parent: DMat4::IDENTITY, tissue: None, priority: None };
    let mut seen = vec![false; file.document.nodes().len()];
    let mut stack: Vec<_> = roots(file).into_iter().rev().map(|node| (node, root.clone())).collect();
    let mut parts = Vec::new();
    while let Some((node, above)) = stack.pop() {
        // A second visit is a node with two parents, or a cycle.
        if std::mem::replace(&mut seen[node.index()], true) {
            let name = node_name(&node);
            return Err(file.format_error(format!("node `{name}` is reached twice; nodes must form trees")));
        }
        let here = inherit(file, &node, &above)?;
        push_parts(&node, &here, &mut parts, findings);
        let children: Vec<_> = node.children().collect();
        stack.extend(children.into_iter().rev().map(|child| (child, here.clone())));
    }
    Ok(parts)
}

fn roots(file: &File) -> Vec<Node<'_>> {
    if let Some(scene) = file.document.default_scene().or_else(|| file.document.scenes().next()) {
        return scene.nodes().collect();
    }
    let mut is_child = vec![false; file.document.nodes().len()];
    for child in file.document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    file.document.nodes().filter(|node| !is_child[node.index()]).collect()
}

fn push_parts<'a>(node: &Node<'a>, here: &Inherited, parts: &mut Vec<Part<'a>>, findings: &mut Vec<Finding>) {
    let Some(mesh) = node.mesh() else { return };
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
            tissue: here.tissue.clone().or_else(|| primitive.material().name().map(str::to_owned)),
            priority: here.priority.unwrap_or(0),
            scene_from_mesh: here.scene_from_parent,
            primitive,
        });
    }
}

fn inherit(file: &File, node: &Node<'_>, above: &Inherited) -> Result<Inherited, SceneError> {
    let parent_from_node =
        local_transform(node).map_err(|reason| file.format_error(format!("node `{}`: {reason}", node_name(node))))?;
    let extras = extras(file, node)?;
    Ok(Inherited {
        scene_from_parent: above.scene_from_parent * parent_from_node,
        tissue: extras.0.or_else(|| above.tissue.clone()),
        priority: extras.1.or(above.priority),
    })
}

/// A node's own `extras.tissue` and `extras.priority`; other extras are somebody else's.
fn extras(file: &File, node: &Node<'_>) -> Result<(Option<String>, Option<i32>), SceneError> {
    #[derive(Deserialize, Default)]
    struct Extras {
        tissue: Option<Value>,
        priority: Option<Value>,
    }
    // Extras may be any JSON: what is no object has none of our keys.
    let extras: Extras =
        node.extras().as_ref().and_then(|raw| serde_json::from_str(raw.get()).ok()).unwrap_or_default();
    let bad = |key, value: &Value, expected| SceneError::BadExtras {
        path: file.path.clone(),
        node: node_name(node),
        key,
        value: value.to_string(),
        expected,
    };
    let tissue = match extras.tissue {
        None => None,
        Some(Value::String(name)) => Some(name),
        Some(other) => return Err(bad("tissue", &other, "the name of a tissue")),
    };
    let priority = match extras.priority {
        None => None,
        Some(value) => {
            // Editors write whole numbers as 3.0, too.
            let whole = value.as_f64().filter(|v| v.fract() == 0.0 && v.abs() <= f64::from(i32::MAX));
            Some(whole.ok_or_else(|| bad("priority", &value, "a whole number within ±2147483647"))? as i32)
        }
    };
    Ok((tissue, priority))
}

fn local_transform(node: &Node<'_>) -> Result<DMat4, String> {
    let matrix = match node.transform() {
        Transform::Matrix { matrix: [x, y, z, w] } => DMat4::from_cols(column(x), column(y), column(z), column(w)),
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

fn column(c: [f32; 4]) -> glam::DVec4 {
    Vec4::from(c).as_dvec4()
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

    /// A vertex of the mesh (metres) in the scene, mm.
    pub(super) fn scene_mm(&self, [x, y, z]: [f32; 3]) -> Vec3 {
        let metres = DVec3::new(x.into(), y.into(), z.into());
        (self.scene_from_mesh.transform_point3(metres) * 1000.0).as_vec3()
    }
}
