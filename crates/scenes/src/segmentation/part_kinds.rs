//! Kinds of parts that no label shows, by the names that `--without` takes.

/// A kind of parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PartKind {
    /// Name, as `--without` takes it.
    pub name: &'static str,
    /// Tissue that tells surfaces of this kind, if they are layers of a wall.
    pub layer: Option<&'static str>,
    /// Beginnings of the names of segments that have such parts already.
    pub labelled: &'static [&'static str],
}

const fn layer(name: &'static str, tissue: &'static str) -> PartKind {
    PartKind { name, layer: Some(tissue), labelled: &[] }
}

const fn shape(name: &'static str, labelled: &'static [&'static str]) -> PartKind {
    PartKind { name, layer: None, labelled }
}

/// The kinds of parts.
pub const PART_KINDS: [PartKind; 9] = [
    layer("capsule", "capsule"),
    layer("gut_layers", "submucosa"),
    layer("pericardium", "pericardium"),
    layer("pleura", "pleura"),
    layer("fascia", "fascia"),
    shape("diaphragm", &["diaphragm"]),
    shape("valves", &["valve", "mitral_valve", "tricuspid_valve", "aortic_valve", "pulmonary_valve"]),
    shape("kidney", &["renal_medulla", "renal_pyramid", "renal_sinus"]),
    shape("liver_vessels", &["hepatic_vein", "liver_vessel"]),
];
