//! WGSL sources: one file per pass, preceded by the shared constants and its imports.
#![cfg_attr(not(feature = "test-hooks"), allow(unreachable_pub, reason = "public in tests"))]

use insonify_core::anatomy::bvh::STACK_DEPTH_MAX;
use insonify_core::settings::{ImageSettings, SettingsGroup, wgsl_readers};

use crate::aperture::MODE_NONE;
use crate::constants as shared;
use crate::params::IMAGE_QUADS;
use crate::texture::{SEPTUM_WIDTH, WAVE_VARIANCE, WAVES, waves};

/// Sources of every pass. Tests change one to make the comparison with its twin fail.
#[derive(Debug, Clone, PartialEq)]
pub struct ShaderSet {
    sources: Vec<(&'static str, String)>,
    /// Whether the device checks every index; for tests.
    pub bounds_checks: bool,
    /// Whether software runs `echo` and `section` as a GPU does; for tests.
    pub as_gpu: bool,
    /// Largest buffer of segments, bytes, instead of the device's choice; for tests.
    pub segment_bytes_max: Option<u64>,
}

macro_rules! pass {
    ($name:literal $(, $shared:literal)*) => { pass!($name of $name $(, $shared)*) };
    ($name:literal of $file:literal $(, $shared:literal)*) => {
        ($name, concat!(
            include_str!("../../shaders/shared/params.wgsl"),
            include_str!("../../shaders/shared/segment.wgsl"),
            $(include_str!(concat!("../../shaders/shared/", $shared, ".wgsl")),)*
            include_str!(concat!("../../shaders/", $file, ".wgsl")),
        ))
    };
}

/// A pass that moves the scene, without the parameters of a frame.
macro_rules! motion_pass {
    ($name:literal) => {
        (
            $name,
            concat!(
                include_str!("../../shaders/shared/phasor.wgsl"),
                include_str!("../../shaders/shared/motion.wgsl"),
                include_str!(concat!("../../shaders/", $name, ".wgsl"))
            ),
        )
    };
}

/// Sources of the pass `trace`: a path by one thread, and by a few lanes, which need [`wgpu::Features::SUBGROUP`].
pub(super) const TRACE: &str = "trace";
pub(super) const TRACE_BY_LANES: &str = "trace_by_lanes";

/// Passes that move the scene, in their order.
pub(super) const MOTION_PASSES: [&str; 3] = ["displace", "assemble", "refit"];

/// Sources of the pass `echo`: a scanline by one workgroup, and by one thread, for software.
pub(super) const ECHO: &str = "echo";
pub(super) const ECHO_BY_LINE: &str = "echo_by_line";

/// Name and source of each pass; `trace` and `echo` have two.
pub(super) const PASSES: [(&str, &str); 20] = [
    motion_pass!("displace"),
    motion_pass!("assemble"),
    motion_pass!("refit"),
    pass!("locate", "bvh", "node_alone", "surfaces", "crossings", "collect", "collect_alone", "launch"),
    pass!(
        "trace",
        "tissue",
        "hash",
        "lattice",
        "interface",
        "bvh",
        "node_alone",
        "surfaces",
        "crossings",
        "nearest",
        "nearest_alone",
        "collect",
        "collect_alone",
        "launch",
        "path_alone"
    ),
    pass!(
        "trace_by_lanes" of "trace", "tissue", "hash", "lattice", "interface", "bvh", "surfaces", "crossings", "nearest",
        "nearest_by_lanes", "collect", "collect_by_lanes", "launch", "path_by_lanes"
    ),
    pass!("transmission", "aperture", "loss", "phasor", "launch"),
    pass!("propagate", "aperture", "phasor"),
    pass!("beams", "aperture", "phasor"),
    pass!("profiles", "aperture"),
    pass!("visibility", "aperture", "loss", "line_gain"),
    pass!("march", "hash", "lattice", "phasor", "speckle", "texture", "aperture", "loss", "line_gain"),
    pass!("echo", "phasor", "aperture", "loss", "line_gain", "echo_by_group"),
    pass!("echo_by_line" of "echo", "phasor", "aperture", "loss", "line_gain", "echo_by_line"),
    pass!("lateral", "aperture", "phasor"),
    pass!("receive", "hash", "lattice", "loss"),
    pass!("detect"),
    pass!("section", "tissue", "bvh", "node_alone", "surfaces", "crossings", "collect", "collect_alone"),
    pass!("percentile"),
    pass!("scan_convert", "tissue"),
];

/// Name of the pass that a source is of.
pub(super) fn pass_of(source: &str) -> &str {
    match source {
        TRACE_BY_LANES => TRACE,
        ECHO_BY_LINE => ECHO,
        source => source,
    }
}

/// WGSL declarations of shared constants.
macro_rules! declarations {
    ($($kind:ident: $($name:ident)*;)*) => {
        [$($(concat!("const ", stringify!($name), ": ", stringify!($kind), " = ").to_owned()
            + &literal::$kind(shared::$name),)*)*].join(";\n")
    };
}

/// Literals of WGSL.
mod literal {
    pub(super) fn u32(value: u32) -> String {
        format!("{value}u")
    }

    pub(super) fn i32(value: u32) -> String {
        format!("{value}")
    }

    pub(super) fn f32(value: f64) -> String {
        format!("{value:?}")
    }
}

/// Constants before every pass.
fn preamble() -> String {
    let declarations = declarations! {
        u32: SEGMENTS ENTRIES STARTS DEPTH_BLOCK HINT_BLOCK TISSUES_MAX BLOCK_QUADS PULSE_QUADS
            CROSSINGS_OF_A_PATH CROSSINGS_BEHIND CROSSINGS_OF_A_MAP_RAY PLACES_MAX PERCENTILE_STEPS FIRST_TISSUE TAG
            TAG_DENSITY HAS_REFLECTED CELLS_MAX FIELDS_MAX MOTION_GROUP PATH_LANES BEAM_CELLS_OF_A_GROUP LATERAL_HALF_MAX TISSUE_MASK MOVES WHOLE ACROSS_BITS OUTSIDE SHEETS SHEET_FAMILIES SCATTERER_STRIDE
            TEXTURE_SHIFT TEXTURE_MASK TEXTURE_SAMPLES;
        i32: PULSE_PAD SURFACE_SALT;
        f32: TOUCH_MM FAST_MEDIA BEYOND_MM CELL_MM OFF_THE_GRID_MM CELLS_OF_A_BEAM DEVIATE_SCALE REFLECTION_FOLLOWED LN_GIVEN_UP LN_SILENT
            LN_SPECKLE_SILENT LN_SCALE UNSCALED DIFFUSE DIFFUSE_HALF_ROUGHNESS2 APERTURE_HALF_ANGLE
            APERTURE_HALF_ANGLE_MIN APERTURE_HALF_ANGLE_MAX FACET_COS_MIN DB_A_DOUBLING ONE_WAY BRIGHTEST_PART
            CONTRAST_MIN_NP_MM TRACKED_NP EVEN_NP SPREAD_NP VISIBLE_MIN VISIBLE_MAX_NP NEIGHBOUR_GAIN_MAX
            TRANSMISSION_MIN DELAY_MIN HARD_SPEED UNLIKE PROFILE_CUT DENSITY_ONE LEAST_POWER GAP_NP_MM GAP_MAX_MM LN_UNCOUPLED REFLECTED_MAX PROJECTION_MIN COUPLED_MIN VISIBLE_MIN_NP FADE OUTER_WALL ATRIA EDGE_TOLERANCE_PER_MM ROOT_STEPS;
    };
    format!(
        "{declarations};\nconst IMAGE_QUADS: u32 = {IMAGE_QUADS}u;\nconst STACK_DEPTH: u32 = {STACK_DEPTH_MAX}u;\nconst MODE_NONE: i32 = {MODE_NONE};\nconst HINT_SHIFT: u32 = {}u;\nconst BLOCK_SHIFT: u32 = {}u;\nconst KRONECKER = array<u32, 16>({});\nconst WAVES: u32 = {WAVES}u;\nconst WAVE_VARIANCE: f32 = {WAVE_VARIANCE:?};\nconst SEPTUM_WIDTH: f32 = {SEPTUM_WIDTH:?};\nconst TEXTURE_WAVES = array<vec4<f32>, WAVES>({});\n",
        shared::HINT_BLOCK.trailing_zeros(),
        shared::DEPTH_BLOCK.trailing_zeros(),
        shared::KRONECKER.map(literal::u32).join(", "),
        waves().map(|[x, y, z, w]| format!("vec4<f32>({x:?}, {y:?}, {z:?}, {w:?})")).join(", "),
    )
}

impl Default for ShaderSet {
    fn default() -> Self {
        let preamble = preamble();
        // Functions that read the settings of the image, which passes that move the scene don't have.
        let readers = wgsl_readers("image_", "params.image", ImageSettings::settings());
        let source = |(name, body)| {
            let readers = if MOTION_PASSES.contains(&name) { "" } else { &readers };
            (name, format!("{preamble}{readers}{body}"))
        };
        Self { sources: PASSES.map(source).to_vec(), bounds_checks: false, as_gpu: false, segment_bytes_max: None }
    }
}

impl ShaderSet {
    /// Source of the pass `name`; empty for an unknown one.
    pub(super) fn source(&self, name: &str) -> &str {
        self.sources.iter().find(|(n, _)| *n == name).map_or("", |(_, source)| source)
    }

    /// Replaces `from` by `to` in the sources of the pass `name`; false if it doesn't occur.
    #[cfg(feature = "test-hooks")]
    pub fn replace(&mut self, name: &str, from: &str, to: &str) -> bool {
        let is_of = |source: &str| pass_of(source) == name;
        let mut occurs = false;
        for (_, source) in self.sources.iter_mut().filter(|(source, text)| is_of(source) && text.contains(from)) {
            *source = source.replace(from, to);
            occurs = true;
        }
        occurs
    }
}
