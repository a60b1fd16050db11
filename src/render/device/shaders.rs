//! WGSL sources: one file a pass, with the shared files it imports put before it.

use crate::render::host::{ImageConstants, TraceConstants};
use crate::render::tables::{
    ACROSS_BITS, BLOCK_QUADS, CELL_MM, DEPTH_BLOCK, ENTRIES, HINT_BLOCK, LAYERS_MAX, PULSE_PAD, PULSE_QUADS, SEGMENTS,
    STARTS, TISSUES_MAX,
};

/// Sources of every pass. A test may damage one, to see the comparison with its twin fail.
#[derive(Debug, Clone)]
pub struct ShaderSet {
    sources: Vec<(&'static str, String)>,
    /// Whether a source is not the shipped one.
    replaced: bool,
    /// Whether the device checks every index; for tests.
    pub bounds_checks: bool,
    /// Numbers of `trace` where the host follows the paths; other than the default ones for tests.
    pub host: TraceConstants,
    /// Numbers of the other passes where the host makes the image; other than the default ones for tests.
    pub image: ImageConstants,
}

macro_rules! pass {
    ($name:literal $(, $shared:literal)*) => {
        ($name, concat!(
            include_str!("../../../shaders/shared/params.wgsl"),
            $(include_str!(concat!("../../../shaders/shared/", $shared, ".wgsl")),)*
            include_str!(concat!("../../../shaders/", $name, ".wgsl")),
        ))
    };
}

const PASSES: [(&str, &str); 9] = [
    pass!("locate", "bvh", "surfaces", "collect", "launch"),
    pass!("trace", "tissue", "hash", "lattice", "interface", "bvh", "surfaces", "nearest", "collect", "launch"),
    pass!("march", "tissue", "hash", "lattice", "phasor"),
    pass!("echo", "phasor"),
    pass!("lateral"),
    pass!("detect"),
    pass!("section", "tissue", "bvh", "surfaces", "collect"),
    pass!("percentile"),
    pass!("scan_convert", "tissue"),
];

impl Default for ShaderSet {
    fn default() -> Self {
        let constants = format!(
            "const SEGMENTS: u32 = {SEGMENTS}u;\nconst ENTRIES: u32 = {ENTRIES}u;\nconst DEPTH_BLOCK: u32 = {DEPTH_BLOCK}u;\nconst CELL_MM: f32 = {CELL_MM:?};\nconst STARTS: u32 = {STARTS}u;\nconst HINT_BLOCK: u32 = {HINT_BLOCK}u;\nconst PULSE_PAD: i32 = {PULSE_PAD};\nconst HINT_SHIFT: u32 = {}u;\nconst BLOCK_SHIFT: u32 = {}u;\nconst TISSUES_MAX: u32 = {TISSUES_MAX}u;\nconst LAYERS_MAX: u32 = {LAYERS_MAX}u;\nconst BLOCK_QUADS: u32 = {BLOCK_QUADS}u;\nconst PULSE_QUADS: u32 = {PULSE_QUADS}u;\nconst ACROSS_BITS: u32 = {ACROSS_BITS}u;\n",
            HINT_BLOCK.trailing_zeros(),
            DEPTH_BLOCK.trailing_zeros()
        );
        Self {
            sources: PASSES.map(|(name, body)| (name, format!("{constants}{body}"))).to_vec(),
            replaced: false,
            bounds_checks: false,
            host: TraceConstants::default(),
            image: ImageConstants::default(),
        }
    }
}

impl ShaderSet {
    /// Source of the pass `name`; empty for an unknown one.
    pub(crate) fn source(&self, name: &str) -> &str {
        self.sources.iter().find(|(n, _)| *n == name).map_or("", |(_, source)| source)
    }

    /// Whether the host's passes can stand for them: they are the shipped ones, as they are shipped.
    pub(crate) fn host_may(&self) -> bool {
        !self.replaced && !self.bounds_checks
    }

    /// Replaces `from` by `to` in the pass `name`; false where it doesn't occur.
    pub fn replace(&mut self, name: &str, from: &str, to: &str) -> bool {
        match self.sources.iter_mut().find(|(n, source)| *n == name && source.contains(from)) {
            Some((_, source)) => {
                *source = source.replace(from, to);
                self.replaced = true;
                true
            }
            None => false,
        }
    }
}
