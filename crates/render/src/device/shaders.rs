//! Shaders of the passes. Each source consists of shared constants, imported files, and the file of the pass.
#![cfg_attr(not(feature = "test-hooks"), allow(unreachable_pub, reason = "public in tests"))]

use insonify_core::anatomy::bvh::STACK_DEPTH_MAX;
use insonify_core::settings::{ImageSettings, SettingsGroup, wgsl_readers};

use crate::aperture::MODE_NONE;
use crate::constants as shared;
use crate::params::IMAGE_QUADS;
use crate::texture::{SEPTUM_WIDTH, WAVE_VARIANCE, WAVES, waves};

/// WGSL source of every shader. Tests change one to make the comparison with its twin fail.
#[derive(Debug, Clone, PartialEq)]
pub struct ShaderSet {
    /// Sources in the order of [`Shader::ALL`].
    sources: Vec<String>,
    /// Whether the device checks every index; for tests.
    pub bounds_checks: bool,
    /// Whether a software device runs `echo` and `section` as a GPU does; for tests.
    pub as_gpu: bool,
    /// Largest segment buffer, bytes; replaces the device's choice in tests.
    pub segment_bytes_max: Option<u64>,
}

macro_rules! shaders {
    ($($(#[$doc:meta])* $shader:ident of $pass:literal: $($import:literal)*;)*) => {
        /// Shaders, named by their passes. `trace` and `echo` have two each.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(super) enum Shader {
            $($(#[$doc])* $shader,)*
        }

        impl Shader {
            const ALL: &[Self] = &[$(Self::$shader),*];

            /// Name of the pass, of its file, and of its time in [`FrameTimes`](crate::frame::FrameTimes).
            pub(super) fn pass(self) -> &'static str {
                match self {
                    $(Self::$shader => $pass,)*
                }
            }

            /// Name in errors and labels: the pass, and the variant if the pass has two.
            pub(super) fn label(self) -> &'static str {
                match self {
                    Self::TraceByLanes => "trace by lanes",
                    Self::EchoByLine => "echo by line",
                    _ => self.pass(),
                }
            }

            /// Imported files, then the file of the pass.
            fn text(self) -> &'static str {
                match self {
                    $(Self::$shader => concat!(
                        $(include_str!(concat!("../../shaders/shared/", $import, ".wgsl")),)*
                        include_str!(concat!("../../shaders/", $pass, ".wgsl")),
                    ),)*
                }
            }
        }
    };
}

shaders! {
    Displace of "displace": "phasor" "motion";
    Assemble of "assemble": "phasor" "motion";
    Refit of "refit": "phasor" "motion";
    Locate of "locate": "params" "bvh" "node_alone" "surfaces" "crossings" "collect" "collect_alone" "launch";
    /// `trace` with one thread per path.
    Trace of "trace": "params" "segment" "tissue" "hash" "lattice" "interface" "bvh" "node_alone" "surfaces" "crossings" "nearest"
        "nearest_alone" "collect" "collect_alone" "launch" "path_alone";
    /// `trace` with a few lanes per path; needs [`wgpu::Features::SUBGROUP`].
    TraceByLanes of "trace": "params" "segment" "tissue" "hash" "lattice" "interface" "bvh" "surfaces" "crossings" "nearest"
        "nearest_by_lanes" "collect" "collect_by_lanes" "launch" "path_by_lanes";
    Transmission of "transmission": "params" "segment" "aperture" "loss" "phasor" "launch";
    NeedleShadow of "needle_shadow": "params";
    Propagate of "propagate": "params" "aperture" "phasor";
    Beams of "beams": "params" "aperture" "phasor";
    Profiles of "profiles": "params" "aperture";
    Visibility of "visibility": "params" "segment" "aperture" "loss" "line_gain";
    March of "march": "params" "segment" "hash" "lattice" "phasor" "speckle" "texture" "aperture" "loss" "line_gain";
    /// `echo` with one workgroup per scanline.
    Echo of "echo": "params" "segment" "phasor" "aperture" "loss" "line_gain" "echo_by_group";
    /// `echo` with one thread per scanline, for software.
    EchoByLine of "echo": "params" "segment" "phasor" "aperture" "loss" "line_gain" "echo_by_line";
    Lateral of "lateral": "params" "aperture" "phasor";
    NeedleEcho of "needle_echo": "params" "segment" "phasor" "aperture" "loss" "line_gain";
    Multiples of "multiples": "params";
    Receive of "receive": "params" "segment" "hash" "lattice" "loss";
    Detect of "detect": "params";
    Section of "section": "params" "tissue" "bvh" "node_alone" "surfaces" "crossings" "collect" "collect_alone";
    Percentile of "percentile": "params";
    ScanConvert of "scan_convert": "params" "tissue";
    NeedleMap of "needle_map": "params";
}

/// Declaration of a frame's parameters. The passes that move the scene have none.
pub(super) const PARAMS: &str = "var<uniform> params: Params;";

/// Address space and name of the variable that `source` declares for a binding; `None` if there is none.
pub(super) fn declaration(source: &str, binding: u32) -> Option<(&str, &str)> {
    let (_, declaration) = source.split_once(&format!("@binding({binding}) var<"))?;
    let (space, named) = declaration.split_once('>')?;
    let (name, _) = named.split_once(':')?;
    Some((space, name.trim()))
}

/// Declares constants of [`crate::constants`] in WGSL.
macro_rules! declarations {
    ($($kind:ident: $($name:ident)*;)*) => {
        [$($(concat!("const ", stringify!($name), ": ", stringify!($kind), " = ").to_owned()
            + &literal::$kind(shared::$name),)*)*].join(";\n")
    };
}

/// Formats numbers as WGSL literals.
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

/// Constants that precede the source of every pass.
fn preamble() -> String {
    let declarations = declarations! {
        u32: SEGMENTS ENTRIES STARTS DEPTH_BLOCK HINT_BLOCK TISSUES_MAX BLOCK_QUADS PULSE_QUADS DELAY_STEPS
            CROSSINGS_OF_A_PATH CROSSINGS_BEHIND CROSSINGS_OF_A_MAP_RAY PLACES_MAX PERCENTILE_STEPS FIRST_TISSUE TAG
            TAG_DENSITY HAS_REFLECTED CELLS_MAX FIELDS_MAX MOTION_GROUP PATH_LANES BEAM_CELLS_OF_A_GROUP LATERAL_HALF_MAX TISSUE_MASK MOVES WHOLE ACROSS_BITS OUTSIDE SHEETS SHEET_FAMILIES SCATTERER_STRIDE
            TEXTURE_SHIFT TEXTURE_MASK TEXTURE_SAMPLES MULTIPLE_SAMPLES MULTIPLE_FIRST;
        i32: PULSE_PAD SURFACE_SALT;
        f32: TOUCH_MM FAST_MEDIA BEYOND_MM CELL_MM OFF_THE_GRID_MM CELLS_OF_A_BEAM DEVIATE_SCALE REFLECTION_FOLLOWED LN_GIVEN_UP LN_SILENT
            LN_SPECKLE_SILENT LN_SCALE UNSCALED DIFFUSE DIFFUSE_HALF_ROUGHNESS2 APERTURE_HALF_ANGLE
            APERTURE_HALF_ANGLE_MIN APERTURE_HALF_ANGLE_MAX FACET_COS_MIN DB_A_DOUBLING ONE_WAY BRIGHTEST_PART
            CONTRAST_MIN_NP_MM TRACKED_NP EVEN_NP SPREAD_NP VISIBLE_MIN VISIBLE_MAX_NP NEIGHBOUR_GAIN_MAX
            TRANSMISSION_MIN DELAY_MIN HARD_SPEED UNLIKE PROFILE_CUT DENSITY_ONE LEAST_POWER GAP_NP_MM GAP_MAX_MM LN_UNCOUPLED REFLECTED_MAX PROJECTION_MIN COUPLED_MIN VISIBLE_MIN_NP FADE OUTER_WALL ATRIA EDGE_TOLERANCE_PER_MM ROOT_STEPS MULTIPLE_GAIN_MAX;
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
        // WGSL functions that read the image settings from the frame's parameters.
        let readers = wgsl_readers("image_", "params.image", ImageSettings::settings());
        let source = |shader: &Shader| {
            let text = shader.text();
            let readers = if text.contains(PARAMS) { &readers[..] } else { "" };
            format!("{preamble}{readers}{text}")
        };
        let sources = Shader::ALL.iter().map(source).collect();
        Self { sources, bounds_checks: false, as_gpu: false, segment_bytes_max: None }
    }
}

impl ShaderSet {
    /// WGSL source of a shader.
    pub(super) fn source(&self, shader: Shader) -> &str {
        &self.sources[shader as usize]
    }

    /// Replaces `from` by `to` in the shaders of a pass; returns false if `from` doesn't occur.
    #[cfg(feature = "test-hooks")]
    pub fn replace(&mut self, pass: &str, from: &str, to: &str) -> bool {
        let mut occurs = false;
        for (shader, source) in Shader::ALL.iter().zip(&mut self.sources) {
            if shader.pass() == pass && source.contains(from) {
                *source = source.replace(from, to);
                occurs = true;
            }
        }
        occurs
    }
}
