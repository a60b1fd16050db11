//! Constants shared by the shaders, the host renderer and the f64 twin; `device::shaders` writes them into each shader.
#![cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "shaders take all of them"))]

pub(crate) use insonify_core::acoustics::HARD_SPEED;
use insonify_core::anatomy::{bvh, motion};
pub(crate) use insonify_core::settings::SAMPLES_MAX;
use insonify_core::settings::{BEAM_TAPS_MAX, PULSE_TAPS_MAX};
use insonify_core::transducer::BLOCK_SAMPLES;

/// Samples of a block, which share one lateral kernel, one scatterer gain and one aperture gain.
pub(crate) const DEPTH_BLOCK: u32 = BLOCK_SAMPLES;
/// Most straight segments of a path.
pub(crate) const SEGMENTS: u32 = 40;
/// Most stretches of one medium along a map ray.
pub(crate) const ENTRIES: u32 = 96;
/// Numbers stored per path for the starts of its segments: one more than segments, for a last range beyond every
/// sample, padded to 16 bytes.
pub(crate) const STARTS: u32 = SEGMENTS + 4;
/// Samples of a block whose first segment is stored as a hint.
pub(crate) const HINT_BLOCK: u32 = 64;
/// Largest number of tissues. With those of samples and pulse taps, it sizes the uniform tables.
pub(crate) const TISSUES_MAX: u32 = 255;
pub(crate) const BLOCK_QUADS: u32 = SAMPLES_MAX / DEPTH_BLOCK / 4;
pub(crate) const PULSE_QUADS: u32 = (2 * AXIAL_HALF_MAX + 1 + 2 * PULSE_PAD).div_ceil(4);
/// Samples per row are padded to a multiple of this.
pub(crate) const ROW_ALIGN: u32 = 16;
const _: () = assert!(ROW_ALIGN == DEPTH_BLOCK, "rows are whole blocks");
/// Zeros before and after the pulse, so that one loop can compute eight output samples.
pub(crate) const PULSE_PAD: u32 = 8;
/// Steps between two samples for which the weights of an echo's place are stored.
pub(crate) const DELAY_STEPS: u32 = 32;
/// Half width of the widest lateral kernel, scanlines.
pub(crate) const LATERAL_HALF_MAX: u32 = BEAM_TAPS_MAX / 2;
/// Half width of the widest axial kernel, samples.
pub(crate) const AXIAL_HALF_MAX: u32 = PULSE_TAPS_MAX / 2;

/// Number of the strongest samples of a scanline whose echoes the face reflects.
pub(crate) const MULTIPLE_SAMPLES: u32 = 32;
/// First sample of a scanline whose echo the face reflects. So many samples of multiples are computed together.
pub(crate) const MULTIPLE_FIRST: u32 = 16;
/// Largest sum of the amplitudes that travel again. Multiples then decay in every scene.
pub(crate) const MULTIPLE_GAIN_MAX: f64 = 0.9;

/// Hits of a ray within this distance count as coincident, mm: touching surfaces, or one edge hit twice.
pub(crate) const TOUCH_MM: f64 = 1.0e-3;
/// Most crossings of surfaces: coincident crossings, along a path up to its first reflection, backwards from the face,
/// and along a map ray.
pub(crate) const CROSSINGS_AT_A_PLACE: u32 = 16;
pub(crate) const CROSSINGS_OF_A_PATH: u32 = 96;
pub(crate) const CROSSINGS_BEHIND: u32 = 64;
pub(crate) const CROSSINGS_OF_A_MAP_RAY: u32 = 160;
/// Most groups of coincident crossings along one path. Few of them change the medium.
pub(crate) const PLACES_MAX: u32 = 192;
/// Fastest medium, as c/c₀, in which one traversal of the tree finds all crossings of an unreflected path. In faster
/// media the path is longer than the traversed line.
pub(crate) const FAST_MEDIA: f64 = 1.05;
/// Range beyond every sample, mm.
pub(crate) const BEYOND_MM: f64 = 3.0e38;

/// Side of a cell of the scatterer lattice, and least side of a cell of the scatterer sheets, mm.
pub(crate) const CELL_MM: f64 = 0.15;
/// Largest side of a cell of the scatterer sheets, mm.
pub(crate) const SHEET_CELL_MAX_MM: f64 = 0.6;
/// Side of a cell of the scatterer sheets over the spacing of scanlines at the focus.
pub(crate) const SHEET_CELL_PER_SPACING: f64 = 1.15;
/// Most scatterers in a cell of a sheet: one in each quarter.
pub(crate) const CELL_QUARTERS: u32 = 4;
/// Odd factor (2³² over the golden ratio) that makes positions and amplitudes of a cell's scatterers independent.
pub(crate) const SCATTERER_STRIDE: u32 = 0x9e37_79b1;
/// Most sheets of scatterers of one family that contribute to a sample.
pub(crate) const SHEETS: u32 = 3;
/// Most families of sheets that contribute to a frame.
pub(crate) const SHEET_FAMILIES: u32 = 3;
/// Factor of a family's number in the hash of its sheets.
pub(crate) const FAMILY_SALT: u32 = 100_003;
/// Integer that stands for a scatterer density of 1; densities are compared with 17 random bits.
pub(crate) const DENSITY_ONE: f64 = 131_072.0;
/// Least divisor for sums of scaled powers.
pub(crate) const LEAST_POWER: f64 = 1.5e-38;
/// Offset of the lattice whose cells shift interface echoes in range, mm. Without it, surfaces at round coordinates
/// would lie on cell faces, where rounding decides the cell.
pub(crate) const OFF_THE_GRID_MM: f64 = 0.0077;
/// Most echoes of a scanline at one surface that add in power. The beam covers about as many lattice cells, and echoes
/// of one cell are in phase: more paths add in amplitude.
pub(crate) const CELLS_OF_A_BEAM: f64 = 96.0;
/// Factor of the surface's index in the hash that shifts interface echoes.
pub(crate) const SURFACE_SALT: u32 = 7919;
/// Scales the sum of four random nibbles, less its mean of 30, to a mean square of ½.
pub(crate) const DEVIATE_SCALE: f64 = 0.07669649888;

/// Least fraction of the energy, returned within the aperture, for which a reflection is followed. Below it a path
/// continues with the transmitted energy: a rough surface scatters and never forms a mirror image.
pub(crate) const REFLECTION_FOLLOWED: f64 = 0.05;
/// ln of the two-way amplitude at which a path ends: 10⁻¹³, −260 dB.
pub(crate) const LN_GIVEN_UP: f64 = -30.0;
/// ln of an amplitude below any display: −695 dB.
pub(crate) const LN_SILENT: f64 = -80.0;
/// ln of a scatterer amplitude below any display: −651 dB.
pub(crate) const LN_SPECKLE_SILENT: f64 = -75.0;
/// ln of the factor on scatterer amplitudes. It makes the squares of all audible amplitudes normal f32 numbers.
pub(crate) const LN_SCALE: f64 = 40.0;
/// Inverse of that factor: e⁻⁴⁰.
pub(crate) const UNSCALED: f64 = 4.248354255e-18;

/// Fraction of the energy that a very rough surface returns diffusely at normal incidence.
pub(crate) const DIFFUSE: f64 = 0.02;
/// Squared roughness at which half of `DIFFUSE` returns.
pub(crate) const DIFFUSE_HALF_ROUGHNESS2: f64 = 0.1;
/// Half angle, radians, within which the aperture accepts reflected rays: its ratio to aperture/range, and its bounds.
pub(crate) const APERTURE_HALF_ANGLE: f64 = 0.25;
pub(crate) const APERTURE_HALF_ANGLE_MIN: f64 = 0.06;
pub(crate) const APERTURE_HALF_ANGLE_MAX: f64 = 0.5;
/// Least cosine of a path's incidence on a microfacet; below it, the mean surface replaces the facet.
pub(crate) const FACET_COS_MIN: f64 = 0.02;

/// Decibels of a doubling of power: 10·log₁₀ 2.
pub(crate) const DB_A_DOUBLING: f64 = 3.01029995664;
/// Factor from the two-way to the one-way attenuation.
pub(crate) const ONE_WAY: f64 = 0.5;
/// Own loss of a scanline in an interval, nepers, at which its position among the depth planes follows loss and depth
/// equally.
pub(crate) const TRACKED_NP: f64 = 0.3;
/// Loss added evenly over each interval, nepers, so that scanlines without loss advance with depth.
pub(crate) const SPREAD_NP: f64 = 0.1;
/// Tiny loss added evenly over each interval, nepers, so that the fraction lost is defined even without loss.
pub(crate) const EVEN_NP: f64 = 1.0e-4;
/// Least power of a beam behind obstacles, relative to the unobstructed beam: −120 dB.
pub(crate) const VISIBLE_MIN: f64 = 1.0e-12;
/// `VISIBLE_MIN` in nepers of amplitude: ½ ln 10⁻¹².
pub(crate) const VISIBLE_MIN_NP: f64 = -13.815510558;
/// Largest gain by diffraction at an edge, nepers of amplitude.
pub(crate) const VISIBLE_MAX_NP: f64 = 0.25;
/// Largest ratio of a scanline's aperture gain to its neighbour's in `lateral`. Scatterers need no limit; echoes of
/// reflected paths don't carry the gain and must not be amplified.
pub(crate) const NEIGHBOUR_GAIN_MAX: f64 = 4.0;
/// Largest ratio of the scatterers' amplitude on reflected paths to their amplitude with the aperture's gain.
pub(crate) const REFLECTED_MAX: f64 = 1.0e7;
/// Least fraction of a phased array's aperture, projected on the scanline: the cosine of 78°.
pub(crate) const PROJECTION_MIN: f64 = 0.2;
/// Dissimilarity (1 − squared correlation) of a beam's profile to the unobstructed profile, from which on the beam's
/// profile alone weighs a scanline's neighbours.
pub(crate) const UNLIKE: f64 = 0.02;
/// Amplitude, relative to a profile's greatest, below which the profile's ends are cut: −26 dB.
pub(crate) const PROFILE_CUT: f64 = 0.05;
/// Least deviation of path length from range, mm per mm, that counts as a delay: 0.005 m/s.
pub(crate) const DELAY_MIN: f64 = 3.0e-6;
/// Least value of a depth plane's greatest transmission, from which the loss that the plane's cells share is taken.
pub(crate) const TRANSMISSION_MIN: f64 = 1.0e-20;
/// Most cells of the aperture's grid along the face.
pub(crate) const CELLS_MAX: u32 = 2048;
/// Cells of a workgroup of `beams` times the beams of a period: two complex fields of these take 16 KiB.
pub(crate) const BEAM_CELLS_OF_A_GROUP: u32 = 1024;
/// Fraction of the sector's area above the attenuation's percentile, and number of bisection steps that find the
/// percentile.
pub(crate) const BRIGHTEST_PART: f64 = 0.02;
pub(crate) const PERCENTILE_STEPS: u32 = 30;
/// Least difference of the attenuation of two media for which the position of their boundary is computed, nepers/mm.
pub(crate) const CONTRAST_MIN_NP_MM: f64 = 1.0e-3;
/// Number of the first tissue in the segmentation; 0 is outside the sector.
pub(crate) const FIRST_TISSUE: u32 = 1;
/// Number of steps of the attenuation's square root, which leaves a device in 16 bits.
pub(crate) const ROOT_STEPS: f64 = 65_535.0;

pub(crate) use insonify_core::transducer::contact::{GAP_MAX_MM, GAP_NP_MM};
/// ln of the least coupling of the face that is computed, one-way amplitude.
pub(crate) const LN_UNCOUPLED: f64 = -80.0;
/// Coupling of the face below which the maps show air.
pub(crate) const COUPLED_MIN: f64 = 0.5;

/// Bit set in a small integer that is stored in a float: without it the float is a denormal, which some devices flush.
pub(crate) const TAG: u32 = 0x4000_0000;
/// Bits of a word that hold a scatterer density.
pub(crate) const TAG_DENSITY: u32 = 0x3_ffff;
/// First bit of a texture's number, stored above a scatterer density. The number is the tissue's index + 1; 0 is no
/// texture.
pub(crate) const TEXTURE_SHIFT: u32 = 21;
/// Bits of a texture's number, after the shift.
pub(crate) const TEXTURE_MASK: u32 = 0xff;
/// Samples that share one value of a texture.
pub(crate) const TEXTURE_SAMPLES: u32 = 4;
/// Bit, stored above a scatterer density, of a segment behind a path's first reflection.
pub(crate) const HAS_REFLECTED: u32 = 1 << 20;
/// Bits of a tissue index in a word that may carry [`MOVES`] or [`TAG`].
pub(crate) const TISSUE_MASK: u32 = 0xffff;
/// Bit, stored with a surface's tissue index, of a surface that moves.
pub(crate) const MOVES: u32 = 1 << 16;
/// Bit of a raster word whose medium reaches to the next depth. The lower bits hold the tissue, the higher bits Σμ.
pub(crate) const WHOLE: u32 = 1 << 8;
/// Bits of a packed pixel position that hold the fraction of the sector's width; the higher bits hold the fraction of
/// its depth.
pub(crate) const ACROSS_BITS: u32 = 15;
/// Packed position of a pixel outside the sector.
pub(crate) const OUTSIDE: u32 = u32::MAX;
/// Rows of a tile of the image.
pub(crate) const TILE_ROWS: u32 = 16;

/// Generators of Kronecker sequences: 2³² times the fractional parts of the golden ratio and of the square roots of 2,
/// 3, 7, 11, 13, 19, 22, 29, 31, 43, 33, 53, 58, 71, 73. They are badly approximable, so neighbouring scanlines differ.
pub(crate) const KRONECKER: [u32; 16] = [
    2654435769, 1779033703, 3144134277, 2773480763, 1359893119, 2600822925, 1541459225, 2965313109, 1654270251,
    2438529371, 2394180231, 3197872217, 1203062813, 2644725351, 1830299339, 2336478295,
];

/// Constants of displacement fields: see `anatomy::motion::shape`.
pub(crate) const FADE: f64 = motion::FADE as f64;
pub(crate) const OUTER_WALL: f64 = motion::OUTER_WALL as f64;
pub(crate) const ATRIA: f64 = motion::ATRIA as f64;
/// Most displacement fields.
pub(crate) const FIELDS_MAX: u32 = motion::FIELDS_MAX as u32;
/// Outward extension of a triangle's edges, relative to its longest edge, per mm of distance from the ray's origin.
pub(crate) const EDGE_TOLERANCE_PER_MM: f64 = bvh::EDGE_TOLERANCE_PER_MM as f64;
/// Lanes of a subgroup that share a path if `trace` runs by lanes: 4 or 8.
pub(crate) const PATH_LANES: u32 = 8;
/// Threads of a workgroup in the passes that move the scene.
pub(crate) const MOTION_GROUP: u32 = 128;
