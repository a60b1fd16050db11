//! The shared constants in single precision, and constants of the passes that a test may change.

use crate::constants::{self as shared, BRIGHTEST_PART, FIRST_TISSUE, ONE_WAY, SCATTERER_STRIDE, SHEETS};

pub(super) const TOUCH_MM: f32 = shared::TOUCH_MM as f32;
pub(super) const LN_GIVEN_UP: f32 = shared::LN_GIVEN_UP as f32;
pub(super) const LN_SILENT: f32 = shared::LN_SILENT as f32;
pub(super) const LN_SPECKLE_SILENT: f32 = shared::LN_SPECKLE_SILENT as f32;
pub(super) const LN_SCALE: f32 = shared::LN_SCALE as f32;
pub(super) const UNSCALED: f32 = shared::UNSCALED as f32;
pub(super) const DEVIATE_SCALE: f32 = shared::DEVIATE_SCALE as f32;
pub(super) const DENSITY_ONE: f32 = shared::DENSITY_ONE as f32;
pub(super) const LEAST_POWER: f32 = shared::LEAST_POWER as f32;
pub(super) const BEYOND_MM: f32 = shared::BEYOND_MM as f32;
pub(super) const DIFFUSE_HALF_ROUGHNESS2: f32 = shared::DIFFUSE_HALF_ROUGHNESS2 as f32;
pub(super) const APERTURE_HALF_ANGLE: f32 = shared::APERTURE_HALF_ANGLE as f32;
pub(super) const APERTURE_HALF_ANGLE_MIN: f32 = shared::APERTURE_HALF_ANGLE_MIN as f32;
pub(super) const APERTURE_HALF_ANGLE_MAX: f32 = shared::APERTURE_HALF_ANGLE_MAX as f32;
pub(super) const FACET_COS_MIN: f32 = shared::FACET_COS_MIN as f32;
pub(super) const TRANSMISSION_MIN: f32 = shared::TRANSMISSION_MIN as f32;
pub(super) const TRACKED_NP: f32 = shared::TRACKED_NP as f32;
pub(super) const EVEN_NP: f32 = shared::EVEN_NP as f32;
pub(super) const SPREAD_NP: f32 = shared::SPREAD_NP as f32;
pub(super) const VISIBLE_MIN: f32 = shared::VISIBLE_MIN as f32;
pub(super) const VISIBLE_MIN_NP: f32 = shared::VISIBLE_MIN_NP as f32;
pub(super) const NEIGHBOUR_GAIN_MAX: f32 = shared::NEIGHBOUR_GAIN_MAX as f32;
pub(super) const GAP_NP_MM: f32 = shared::GAP_NP_MM as f32;
pub(super) const GAP_MAX_MM: f32 = shared::GAP_MAX_MM as f32;
pub(super) const REFLECTED_MAX: f32 = shared::REFLECTED_MAX as f32;
pub(super) const LN_UNCOUPLED: f32 = shared::LN_UNCOUPLED as f32;
pub(super) const COUPLED_MIN: f32 = shared::COUPLED_MIN as f32;
pub(super) const CONTRAST_MIN_NP_MM: f32 = shared::CONTRAST_MIN_NP_MM as f32;

/// Defines a set of constants: fields that a test may change with the feature `test-hooks`, compile-time constants
/// without it.
macro_rules! changeable {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty = $value:expr;)* }) => {
        $(#[$doc])*
        #[cfg(feature = "test-hooks")]
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: $kind,)*
        }

        #[cfg(feature = "test-hooks")]
        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $value,)* }
            }
        }

        $(#[$doc])*
        #[cfg(not(feature = "test-hooks"))]
        #[derive(Debug, Clone, Copy, Default)]
        pub(in crate) struct $name;

        impl $name {
            $(
                $(#[$field_doc])*
                #[inline(always)]
                pub(super) fn $field(self) -> $kind {
                    #[cfg(feature = "test-hooks")]
                    return self.$field;
                    #[cfg(not(feature = "test-hooks"))]
                    $value
                }
            )*
        }
    };
}

changeable! {
    /// Constants of the host's `locate` and `trace`.
    TraceConstants {
        /// Fraction of the way back through the scene in which `locate` searches for the surfaces around a path's
        /// start.
        reach: f32 = 1.0;
        /// Least returned fraction of the energy, within the aperture, for which a reflection is followed.
        reflection_followed: f32 = shared::REFLECTION_FOLLOWED as f32;
        /// Offset of the lattice whose cells shift echoes in range, mm.
        off_the_grid_mm: f32 = shared::OFF_THE_GRID_MM as f32;
        /// Fraction of the energy that a very rough surface returns diffusely at normal incidence.
        diffuse: f32 = shared::DIFFUSE as f32;
    }
}

changeable! {
    /// Constants of the host's other passes.
    ImageConstants {
        /// `march`: factor that makes positions and amplitudes of a cell's scatterers independent.
        scatterer_stride: u32 = SCATTERER_STRIDE;
        /// `march`: sheets of scatterers looked up to one side of a sample.
        sheets_to_a_side: f32 = 0.5 * SHEETS as f32;
        /// `echo`: index of the first segment that begins at an interface.
        first_interface: usize = 1;
        /// `transmission`: greatest loss of an interval, nepers.
        loss_max_np: f32 = 80.0;
        /// `propagate`: a row of cells whose transmissions differ by less counts as unobstructed.
        contrast_min: f32 = 1.0e-5;
        /// `propagate`: a row of cells whose delays differ by less, radians, counts as even.
        phase_min: f32 = 1.0e-3;
        /// `beams`: lower bound of an unobstructed beam's power, by which powers are divided.
        unobstructed_min: f32 = 1.0e-30;
        /// `visibility`: most gain by diffraction at an edge, nepers of amplitude.
        visible_max_np: f32 = shared::VISIBLE_MAX_NP as f32;
        /// `lateral`: least weight that counts; smaller weights are denormal.
        least_weight: f32 = f32::MIN_POSITIVE;
        /// `needle_shadow`: factor of the amplitude that passes the needle.
        needle_transmission: f32 = 1.0;
        /// `needle_echo`: factor of the echoes.
        needle_amplitude: f32 = 1.0;
        /// `needle_map`: factor of the radius.
        needle_radius: f32 = 1.0;
        /// `multiples`: factor of the amplitude that the face reflects.
        face_reflected: f32 = 1.0;
        /// `receive`: factor of the noise, clutter and reverberation that are added.
        added: f32 = 1.0;
        /// `detect`: decibels of a doubling of power.
        db_a_doubling: f32 = shared::DB_A_DOUBLING as f32;
        /// `section`: one-way part of the two-way attenuation.
        one_way: f32 = ONE_WAY as f32;
        /// `percentile`: fraction of the sector's area that is brighter than the percentile.
        brightest_part: f32 = BRIGHTEST_PART as f32;
        /// `scan_convert`: number of the first tissue.
        first_number: u32 = FIRST_TISSUE;
    }
}
