//! The f64 twin of every pass: the reference that each pass is tested against, in plain code.
//!
//! A twin reads the device's inputs, f32 widened to f64, so the two differ by rounding only. It intersects triangles by
//! brute force, without the device's tree. Paths are in the device's order: rays fastest, then scanlines, then layers;
//! then the axial paths. Samples are `[scanlines × samples]`, without the device's padding.
//!
//! ```text
//! displace → assemble → refit ┐
//! locate → trace → transmission → needle_shadow → propagate → beams → profiles → visibility → march → echo → lateral
//!        → needle_echo → multiples → receive → detect ┐
//!                                section → percentile ┴→ scan_convert → needle_map
//! ```

mod aperture;
mod assemble;
mod beams;
mod detect;
mod displace;
mod echo;
pub mod hash;
mod inputs;
mod lateral;
pub mod lattice;
mod locate;
mod march;
mod medium;
mod motion;
mod multiples;
mod needle;
mod needle_table;
mod percentile;
mod profiles;
mod propagate;
mod receive;
mod refit;
mod scan_convert;
mod section;
mod segment;
mod speckle;
mod surfaces;
mod texture;
mod trace;
mod transmission;
mod visibility;

pub use aperture::Aperture;
pub use assemble::assemble;
pub use beams::{amplitudes, powers};
pub use detect::{Detected, detect};
pub use displace::displace;
pub use echo::echo;
pub use inputs::{Elevation, Inputs, Ray, SheetFamily, Triangle};
pub use lateral::lateral;
pub use locate::{Launched, locate};
pub use march::{march, reflected};
pub use medium::Medium;
pub use motion::{Below, Child, Motion, Node, Vertex};
pub use multiples::multiples;
pub use needle::{needle_echo, needle_map, needle_shadow};
pub use needle_table::{Needle, NeedleEcho};
pub use percentile::percentile;
pub use profiles::{Profile, profiles};
pub use propagate::propagate;
pub use receive::receive;
pub use refit::refit;
pub use scan_convert::{Maps, scan_convert};
pub use section::{RasterPoint, Run, Sections, section};
pub use segment::{Path, Segment, segment_at};
pub use surfaces::Membership;
#[cfg(test)]
pub(crate) use texture::texture_level_np;
pub use trace::trace;
pub use transmission::{Transmission, transmission};
pub use visibility::{BlockGain, Boundary, block_gains, visibility};

/// Runs all passes of a frame and returns its maps.
pub fn frame(inputs: &Inputs) -> Maps {
    let paths = trace(inputs, &locate(inputs));
    let beams = inputs.aperture.as_ref().map(|aperture| {
        let Transmission { mut mask, row_np } = transmission(inputs, aperture, &paths);
        needle_shadow(inputs, &mut mask);
        let amplitudes = amplitudes(aperture, &propagate(aperture, &mask));
        let powers = powers(aperture, &amplitudes);
        let profiles = profiles(inputs, aperture, 0, &amplitudes);
        (visibility(inputs, aperture, &paths, &powers, &row_np), profiles)
    });
    let (gains, profiles) = beams.unwrap_or_default();
    let mut baseband = march(inputs, &paths, &gains);
    echo(inputs, &paths, &gains, &mut baseband);
    let of_blocks =
        inputs.aperture.as_ref().map(|aperture| block_gains(inputs, aperture, &paths, &gains)).unwrap_or_default();
    let reflected = reflected(inputs, &paths, &gains);
    let mut focused = lateral(inputs, &of_blocks, &reflected, &profiles, &baseband);
    needle_echo(inputs, &paths, &gains, &mut focused);
    multiples(inputs, &mut focused);
    let received = receive(inputs, &paths, &focused);
    let detected = detect(inputs, &received);
    let sections = section(inputs);
    let percentile_np = percentile(inputs, &sections.runs);
    let mut maps = scan_convert(inputs, &detected.grey, &sections.raster, percentile_np);
    needle_map(inputs, &mut maps.segmentation);
    maps
}
