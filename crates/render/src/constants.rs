//! Constants shared by the shaders, the host renderer and the f64 twin; `device::shaders` writes them into each shader.
#![cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "shaders take all of them"))]

pub(crate) use insonify_core::acoustics::HARD_SPEED;
use insonify_core::anatomy::{bvh, motion};
use insonify_core::settings::{BEAM_TAPS_MAX, PULSE_TAPS_MAX};

/// Samples that share one lateral kernel, one scatterer gain and one gain of the aperture.
pub(crate) const DEPTH_BLOCK: u32 = 16;
/// Straight segments of a path, at most.
pub(crate) const SEGMENTS: u32 = 40;
/// Runs of one medium along a map ray, at most.
pub(crate) const ENTRIES: u32 = 96;
/// Stride of a path's segment starts: one more than segments, for a range beyond every sample, padded to 16 bytes.
pub(crate) const STARTS: u32 = SEGMENTS + 4;
/// Samples per segment hint.
pub(crate) const HINT_BLOCK: u32 = 64;
/// Greatest numbers of tissues, samples and pulse taps: sizes of the uniform tables.
pub(crate) const TISSUES_MAX: u32 = 255;
pub(crate) const SAMPLES_MAX: u32 = 8192;
pub(crate) const BLOCK_QUADS: u32 = SAMPLES_MAX / DEPTH_BLOCK / 4;
pub(crate) const PULSE_QUADS: u32 = (2 * AXIAL_HALF_MAX + 1 + 2 * PULSE_PAD).div_ceil(4);
/// Rows of samples are padded to a multiple of this.
pub(crate) const ROW_ALIGN: u32 = 16;
const _: () = assert!(ROW_ALIGN == DEPTH_BLOCK, "rows are whole blocks");
/// Zeros before and after the pulse, so that eight outputs share one loop.
pub(crate) const PULSE_PAD: u32 = 8;
/// Half width of the widest lateral kernel, scanlines.
pub(crate) const LATERAL_HALF_MAX: u32 = BEAM_TAPS_MAX / 2;
/// Half width of the widest axial kernel, samples.
pub(crate) const AXIAL_HALF_MAX: u32 = PULSE_TAPS_MAX / 2;

/// Hits this close along a ray are one place, mm: touching surfaces, or one edge hit twice.
pub(crate) const TOUCH_MM: f64 = 1.0e-3;
/// Capacities for crossings: at one place, along a path up to its first reflection, behind the face, and along a map ray.
pub(crate) const CROSSINGS_AT_A_PLACE: u32 = 16;
pub(crate) const CROSSINGS_OF_A_PATH: u32 = 96;
pub(crate) const CROSSINGS_BEHIND: u32 = 64;
pub(crate) const CROSSINGS_OF_A_MAP_RAY: u32 = 160;
/// Most places that one path may cross. Few of them change the medium.
pub(crate) const PLACES_MAX: u32 = 192;
/// Speed of the media in which a path finds all its crossings by one traversal, over the assumed speed. In faster ones it is
/// longer than that traversal.
pub(crate) const FAST_MEDIA: f64 = 1.05;
/// Range beyond every sample, mm.
pub(crate) const BEYOND_MM: f64 = 3.0e38;

/// Side of a cell of the scatterer lattice, and the least side of a sheet's cell, mm.
pub(crate) const CELL_MM: f64 = 0.15;
/// Largest side of a sheet's cell, mm.
pub(crate) const SHEET_CELL_MAX_MM: f64 = 0.6;
/// Side of a sheet's cell over the distance of neighbouring scanlines at the focus.
pub(crate) const SHEET_CELL_PER_SPACING: f64 = 1.15;
/// Most scatterers of a sheet's cell, one in each quarter.
pub(crate) const CELL_QUARTERS: u32 = 4;
/// Odd factor that makes places and amplitudes of a cell's scatterers independent of each other (2³² over the golden ratio).
pub(crate) const SCATTERER_STRIDE: u32 = 0x9e37_79b1;
/// Sheets of scatterers across the slice that reach a sample, at most.
pub(crate) const SHEETS: u32 = 3;
/// Families of sheets that reach a frame, at most.
pub(crate) const SHEET_FAMILIES: u32 = 3;
/// Factor of the family's number in the hash of a sheet.
pub(crate) const FAMILY_SALT: u32 = 100_003;
/// Packed density of 1: it is compared with 17 random bits.
pub(crate) const DENSITY_ONE: f64 = 131_072.0;
/// Least sum of scaled powers that is divided by.
pub(crate) const LEAST_POWER: f64 = 1.5e-38;
/// Offset of the lattice that spreads echoes, mm. Without it, planes at round coordinates would be on cell faces, and
/// rounding would choose the cell.
pub(crate) const OFF_THE_GRID_MM: f64 = 0.0077;
/// Echoes of a scanline at one face that add in power, at most. The beam covers about so many cells of that lattice, and
/// echoes of one cell are in phase: with more paths, they add in amplitude.
pub(crate) const CELLS_OF_A_BEAM: f64 = 96.0;
/// Factor of the surface number in that lattice's hash.
pub(crate) const SURFACE_SALT: u32 = 7919;
/// Normalises the sum of four nibbles, of mean 30, to a mean square of ½.
pub(crate) const DEVIATE_SCALE: f64 = 0.07669649888;

/// Least returned fraction of the energy, within the aperture, for which a reflection is followed. Below it a path
/// continues with the transmitted energy: a rough surface scatters and never forms a mirror image.
pub(crate) const REFLECTION_FOLLOWED: f64 = 0.05;
/// ln of the two-way amplitude at which a path ends: 10⁻¹³, −260 dB.
pub(crate) const LN_GIVEN_UP: f64 = -30.0;
/// ln of an amplitude that no display shows: −695 dB.
pub(crate) const LN_SILENT: f64 = -80.0;
/// The same for scatterers: −651 dB.
pub(crate) const LN_SPECKLE_SILENT: f64 = -75.0;
/// ln of the scale of scatterer amplitudes: the squares of all audible ones become normal numbers.
pub(crate) const LN_SCALE: f64 = 40.0;
/// e⁻⁴⁰.
pub(crate) const UNSCALED: f64 = 4.248354255e-18;

/// Fraction of the energy that a very rough surface returns diffusely at normal incidence.
pub(crate) const DIFFUSE: f64 = 0.02;
/// Squared roughness at which half of that returns.
pub(crate) const DIFFUSE_HALF_ROUGHNESS2: f64 = 0.1;
/// Ratio of the accepted half angle to aperture/range, and bounds of that angle, radians.
pub(crate) const APERTURE_HALF_ANGLE: f64 = 0.25;
pub(crate) const APERTURE_HALF_ANGLE_MIN: f64 = 0.06;
pub(crate) const APERTURE_HALF_ANGLE_MAX: f64 = 0.5;
/// Least cosine of a path's incidence on a facet; below it, the mean surface replaces the facet.
pub(crate) const FACET_COS_MIN: f64 = 0.02;

/// Decibels of a doubling of power: 10·log₁₀ 2.
pub(crate) const DB_A_DOUBLING: f64 = 3.01029995664;
/// One-way part of the two-way attenuation.
pub(crate) const ONE_WAY: f64 = 0.5;
/// Loss of an interval, nepers, at which a scanline's place among the planes follows its loss and its depth alike.
pub(crate) const TRACKED_NP: f64 = 0.3;
/// Loss that counts as evenly spread over each interval, nepers: scanlines without loss advance with depth.
pub(crate) const SPREAD_NP: f64 = 0.1;
/// Loss by which an interval without loss is lost evenly over its depth, nepers.
pub(crate) const EVEN_NP: f64 = 1.0e-4;
/// Least power of a beam behind obstacles, over its power without them: −120 dB.
pub(crate) const VISIBLE_MIN: f64 = 1.0e-12;
/// The same in nepers of amplitude: ½ ln 10⁻¹².
pub(crate) const VISIBLE_MIN_NP: f64 = -13.815510558;
/// Most gain by diffraction at an edge, nepers of amplitude.
pub(crate) const VISIBLE_MAX_NP: f64 = 0.25;
/// Greatest ratio of a scanline's own gain to its neighbour's in `lateral`. Scatterers need no limit; echoes of reflected
/// paths don't carry the gain and must not be amplified.
pub(crate) const NEIGHBOUR_GAIN_MAX: f64 = 4.0;
/// Most amplitude that came by reflections, over the amplitude that the aperture sees.
pub(crate) const REFLECTED_MAX: f64 = 1.0e7;
/// Least part of a phased array's aperture that a scanline sees: the cosine of 78°.
pub(crate) const PROJECTION_MIN: f64 = 0.2;
/// Unlikeness of a beam's profile to an unobstructed one, 1 less their squared correlation, from which the profile alone
/// weighs a scanline's neighbours.
pub(crate) const UNLIKE: f64 = 0.02;
/// Amplitude of a profile over its greatest one below which its ends are cut: −26 dB.
pub(crate) const PROFILE_CUT: f64 = 0.05;
/// Least difference of range and depth that counts as a delay, mm per mm: 0.005 m/s.
pub(crate) const DELAY_MIN: f64 = 3.0e-6;
/// Least transmission of a row of cells, which the row's common loss is taken from.
pub(crate) const TRANSMISSION_MIN: f64 = 1.0e-20;
/// Most cells along the face of the aperture's grid.
pub(crate) const CELLS_MAX: u32 = 2048;
/// Cells of a workgroup of `beams`, times the beams of a period: 16 KiB of two complex fields.
pub(crate) const BEAM_CELLS_OF_A_GROUP: u32 = 1024;
/// Part of the sector's area that is brighter than the attenuation's percentile, and the steps of its bisection.
pub(crate) const BRIGHTEST_PART: f64 = 0.02;
pub(crate) const PERCENTILE_STEPS: u32 = 30;
/// Least difference of two attenuations for which the place of their boundary is computed, nepers/mm.
pub(crate) const CONTRAST_MIN_NP_MM: f64 = 1.0e-3;
/// Number of the first tissue in the segmentation; 0 is outside the sector.
pub(crate) const FIRST_TISSUE: u32 = 1;
/// Steps of the attenuation's square root as it leaves a device, 16 bits.
pub(crate) const ROOT_STEPS: f64 = 65_535.0;

pub(crate) use insonify_core::transducer::contact::{GAP_MAX_MM, GAP_NP_MM};
/// ln of the least coupling that is computed.
pub(crate) const LN_UNCOUPLED: f64 = -80.0;
/// Coupling below which the maps show air.
pub(crate) const COUPLED_MIN: f64 = 0.5;

/// Bit beside a small integer that travels as a float: some devices flush denormals.
pub(crate) const TAG: u32 = 0x4000_0000;
/// Bits of a scatterer density.
pub(crate) const TAG_DENSITY: u32 = 0x3_ffff;
/// First bit of the number of a texture beside a scatterer density: index of its tissue + 1, 0 if it is uniform.
pub(crate) const TEXTURE_SHIFT: u32 = 21;
/// Bits of the number of a texture.
pub(crate) const TEXTURE_MASK: u32 = 0xff;
/// Samples that share a texture's level.
pub(crate) const TEXTURE_SAMPLES: u32 = 4;
/// Bit beside the scatterer density of a segment that a path reached by a reflection.
pub(crate) const HAS_REFLECTED: u32 = 1 << 20;
/// Bits of a tissue in a word that may carry [`MOVES`] or [`TAG`].
pub(crate) const TISSUE_MASK: u32 = 0xffff;
/// Bit beside the tissue of a surface that moves.
pub(crate) const MOVES: u32 = 1 << 16;
/// Bit of a raster word whose run reaches the next depth; the bits below hold the tissue, those above Σμ.
pub(crate) const WHOLE: u32 = 1 << 8;
/// Bits of the fraction of the sector's width in a packed pixel; the bits above hold the fraction of its depth.
pub(crate) const ACROSS_BITS: u32 = 15;
/// Packed pixel outside the sector.
pub(crate) const OUTSIDE: u32 = u32::MAX;
/// Image rows of a tile.
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
/// Greatest number of displacement fields.
pub(crate) const FIELDS_MAX: u32 = motion::FIELDS_MAX as u32;
/// Tolerance of a triangle's edges, relative to its longest edge, per mm of distance.
pub(crate) const EDGE_TOLERANCE_PER_MM: f64 = bvh::EDGE_TOLERANCE_PER_MM as f64;
/// Lanes of a subgroup that share a path where `trace` runs by lanes: 4 or 8.
pub(crate) const PATH_LANES: u32 = 8;
/// Threads of a group that moves a part of the scene.
pub(crate) const MOTION_GROUP: u32 = 128;
