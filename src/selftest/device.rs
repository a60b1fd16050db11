//! Device checks: repeatability of a frame, and comparison with the f64 twins (reference implementations of the
//! passes).

use glam::{DQuat, DVec2, DVec3};

use super::bench::{Bench, grainy, linear, silent, slab, small};
use super::{Check, Family, Rig};
use crate::anatomy::{Tissue, analytic};
use crate::pose::Pose;
use crate::render::{Frame, RenderError, RenderSettings, twin};

/// Position of a specimen with tissues of each kind: grainy, rough, strongly reflecting, absorbing.
pub(super) struct Device {
    place: DVec2,
}

impl Device {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let place = bench.place();
        let grain = Tissue { attenuation_db_cm_mhz: 0.4, roughness: 0.2, ..grainy(0.002, 0.02) };
        let block = bench.tissue(grain.clone());
        let bone = bench.tissue(Tissue { attenuation_db_cm_mhz: 5.0, roughness: 0.1, ..silent(3200.0, 5.5) });
        let inner = bench.tissue(Tissue { speed_m_s: 1450.0, scatterer_deviation: 0.05, ..grain });
        bench.add(block, 1, slab(place, 40.0, -20.3, 70.04));
        bench.add(inner, 2, analytic::sphere(place.extend(24.0).as_vec3(), 9.0, 2));
        bench.add(bone, 3, slab(place + DVec2::new(13.0, 0.0), 6.0, 31.03, 34.02));
        Self { place }
    }

    fn pose(&self) -> Pose {
        let orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.02, 0.05, 0.1);
        Pose { position_mm: self.place.extend(0.0) + DVec3::new(0.3, 0.2, 0.1), orientation }
    }
}

fn settings() -> RenderSettings {
    let mut settings = small(4, 3);
    // With nonzero gain and distinct TGC sliders, every term of the level counts.
    settings.image.gain_db = 7.0;
    settings.image.tgc_sliders_db = [3.0, -4.0, 6.0, 0.5, -5.0, 4.0, -2.0, 5.0];
    settings
}

/// All values of a frame, floats as their bits.
fn words(frame: &Frame) -> Vec<u32> {
    let reals = frame.lines.iter().flatten().chain(&frame.attenuation).chain([&frame.attenuation_p98]);
    let bytes = frame.bmode.iter().chain(&frame.segmentation).map(|&b| u32::from(b));
    reals.map(|v| v.to_bits()).chain(bytes).collect()
}

impl Family for Device {
    fn groups(&self) -> &'static [&'static str] {
        &["Twin", "Determinism"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let probe = linear(64, 0.5, 512, 50.0);
        let pose = self.pose();
        // Settings with several paths per scanline, and with the single path of low quality.
        let (mut differ, mut of) = (0, 0);
        for settings in [settings(), small(1, 1)] {
            let first = words(rig.frame(&probe, &settings, &pose)?);
            let again = words(rig.frame(&probe, &settings, &pose)?);
            differ += first.iter().zip(&again).filter(|(a, b)| a != b).count() + first.len().abs_diff(again.len());
            of += first.len();
        }

        let snapshot = rig.snapshot(&probe, &settings(), &pose)?;
        let twin = twin::frame(&snapshot.inputs);
        let inside: Vec<usize> = (0..twin.grey.len()).filter(|&i| snapshot.inputs.pixels[i].is_some()).collect();
        let share = 1.0 / inside.len() as f64;
        let grey = inside.iter().map(|&i| (f64::from(snapshot.bmode[i]) - twin.grey[i]).abs()).sum::<f64>() * share;
        let other = inside.iter().filter(|&&i| snapshot.segmentation[i] != twin.segmentation[i]).count() as f64 * share;
        let level = inside.iter().map(|&i| (snapshot.attenuation[i] - twin.attenuation[i]).abs()).sum::<f64>() * share;
        Ok(vec![
            Check::zero("Determinism", format!("words of {of} that differ in a second frame"), differ as f64, 0.0),
            Check::zero("Twin", "mean distance of grey levels from f64, of 255", grey, 1.0),
            Check::new("Twin", "pixels of another tissue", "%", 0.0, 100.0 * other, 0.5),
            Check::zero("Twin", "mean distance of the attenuation map", level, 1e-3),
        ])
    }
}
