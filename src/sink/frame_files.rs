//! Files of one frame in a directory, for other programs to read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::png::{self, Effort};
use super::{FrameRecord, SinkError, create_dir, npy, remove, write_json};
use crate::anatomy::TissueTable;
use crate::render::Frame;

/// A frame with its tissues and its record.
#[derive(Debug, Clone, Copy)]
pub struct FrameFiles<'a> {
    /// The frame.
    pub frame: &'a Frame,
    /// Tissues of the segmentation numbers.
    pub tissues: &'a TissueTable,
    /// Record of its inputs and times.
    pub record: &'a FrameRecord,
}

impl FrameFiles<'_> {
    /// Names of the files.
    pub const NAMES: [&'static str; 7] =
        ["bmode.png", "segmentation.png", "tissues.json", "attenuation.npy", "mask.png", "lines.npy", "frame.json"];

    /// Writes the frame into `dir`, which is made if missing, and returns the files in the order written:
    ///
    /// | file | content |
    /// |---|---|
    /// | `bmode.png` | 8-bit grey levels |
    /// | `segmentation.png` | 8-bit tissue numbers |
    /// | `tissues.json` | number → name; 0 is `outside` |
    /// | `attenuation.npy` | float32 [height, width], 0..=1 |
    /// | `mask.png` | 255 inside the sector |
    /// | `lines.npy` | complex64 [scanlines, samples], baseband; positions: `lines` in `frame.json`. Optional |
    /// | `frame.json` | the record; written last, so that its presence marks a complete directory |
    ///
    /// Without lines, `lines.npy` is missing; without maps, `segmentation.png`, `tissues.json` and `attenuation.npy`.
    ///
    /// # Errors
    /// A map that does not have the frame's size, or a file that cannot be written.
    pub fn write(&self, dir: &Path) -> Result<Vec<PathBuf>, SinkError> {
        create_dir(dir)?;
        // The record of an earlier frame would mark the directory as complete before the new files are.
        remove(&dir.join("frame.json"))?;
        let Self { frame, tissues, record } = *self;
        let (width, height) = (frame.width, frame.height);
        let mut written = Vec::with_capacity(7);
        let mut file = |name: &str| {
            written.push(dir.join(name));
            dir.join(name)
        };
        png::write_grey(&file("bmode.png"), width, height, &frame.bmode, Effort::Small)?;
        if frame.segmentation.is_empty() && frame.attenuation.is_empty() {
            // Rendered without maps: removes the maps of an earlier frame.
            for name in ["segmentation.png", "tissues.json", "attenuation.npy"] {
                remove(&dir.join(name))?;
            }
        } else {
            png::write_grey(&file("segmentation.png"), width, height, &frame.segmentation, Effort::Small)?;
            write_json(&file("tissues.json"), &tissue_numbers(tissues))?;
            npy::write_f32(&file("attenuation.npy"), [height as usize, width as usize], &frame.attenuation)?;
        }
        png::write_grey(&file("mask.png"), width, height, &frame.mask, Effort::Small)?;
        if !frame.lines.is_empty() {
            let probe = record.probe.sampled(record.quality.coarse_samples);
            let shape = [probe.scanlines as usize, probe.sample_count() as usize];
            npy::write_complex64(&file("lines.npy"), shape, &frame.lines)?;
        }
        write_json(&file("frame.json"), record)?;
        Ok(written)
    }
}

/// Tissue name of each segmentation number, 0 included.
pub(crate) fn tissue_numbers(tissues: &TissueTable) -> BTreeMap<usize, &str> {
    let names = tissues.names().iter().map(String::as_str);
    std::iter::once("outside").chain(names).enumerate().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::analytic;
    use crate::pose::Pose;
    use crate::render::{EffectPlan, PassTime, Quality, RenderSettings};
    use crate::sink::frame_record::AdapterRecord;
    use crate::transducer::{Probe, Sector};

    fn frame() -> Frame {
        let mut frame = Frame { width: 4, height: 3, attenuation_p98: 0.5, ..Frame::default() };
        frame.bmode = (0..12).map(|i| i * 20).collect();
        frame.segmentation = vec![0, 1, 2, 2, 0, 1, 1, 1, 2, 2, 2, 0];
        frame.attenuation = (0u8..12).map(|i| f32::from(i) / 12.0).collect();
        frame.mask = frame.segmentation.iter().map(|&s| if s > 0 { 255 } else { 0 }).collect();
        frame.lines = vec![[1.0, -1.0]; 10];
        frame.times.total_ms = 21.5;
        frame.times.passes = vec![PassTime { name: "march", ms: 12.25 }];
        frame
    }

    fn tissues() -> TissueTable {
        let tissue = crate::anatomy::Tissue::default();
        TissueTable::new([("liver".to_owned(), tissue.clone()), ("blood".to_owned(), tissue)]).unwrap()
    }

    /// Plan for 32 rays and 1 layer in liver alone.
    fn plan(probe: &Probe) -> EffectPlan {
        let scene = analytic::scene(Vec::new(), &tissues(), "liver").unwrap();
        EffectPlan::new(&scene, probe, &settings())
    }

    fn settings() -> RenderSettings {
        RenderSettings { quality: Quality { rays: 32, ..Quality::LQ }, ..RenderSettings::default() }
    }

    /// Record of `frame` at `pose`, for a probe with 2 scanlines of 5 samples.
    fn record(frame: &Frame, pose: [f64; 7]) -> FrameRecord {
        let probe = Probe { scanlines: 2, samples: 5.into(), ..Probe::default() };
        let adapter = AdapterRecord { name: "llvmpipe".into(), driver: "Mesa".into(), trace: None };
        let (pose, sector) = (Pose::from_components(pose).unwrap(), Sector::fit(&probe, 4, 3));
        FrameRecord::new(frame, &pose, &probe, &settings(), &plan(&probe), &sector, adapter)
    }

    #[test]
    fn every_file_holds_what_it_promises() {
        let dir = tempfile::tempdir().unwrap();
        let frame = frame();
        let record = record(&frame, [1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0]);
        let files = FrameFiles { frame: &frame, tissues: &tissues(), record: &record };
        let written = files.write(&dir.path().join("new")).unwrap();
        let read = |name: &str| std::fs::read(dir.path().join("new").join(name)).unwrap();
        assert_eq!(written.len(), 7);
        assert!(written.iter().all(|p| p.is_file()));
        assert_eq!(image::load_from_memory(&read("segmentation.png")).unwrap().into_bytes(), frame.segmentation);
        assert_eq!(image::load_from_memory(&read("mask.png")).unwrap().into_bytes(), *frame.mask);
        let names: BTreeMap<usize, String> = serde_json::from_slice(&read("tissues.json")).unwrap();
        assert_eq!(names, [(0, "outside".into()), (1, "blood".into()), (2, "liver".into())].into());
        let attenuation = read("attenuation.npy");
        let npy = npyz::NpyFile::new(&attenuation[..]).unwrap();
        assert_eq!(npy.shape(), &[3, 4]);
        assert_eq!(npy.into_vec::<f32>().unwrap(), frame.attenuation);
        assert_eq!(npyz::NpyFile::new(&read("lines.npy")[..]).unwrap().shape(), &[2, 5]);
        let json: serde_json::Value = serde_json::from_slice(&read("frame.json")).unwrap();
        assert_eq!(json["pose"]["position_mm"], serde_json::json!([1.0, 2.0, 3.0]));
        assert_eq!(json["pose"]["orientation_wxyz"], serde_json::json!([0.0, 1.0, 0.0, 0.0]));
        assert_eq!(json["times"]["passes"][0]["name"], "march");
        assert_eq!((&json["probe"]["kind"], &json["probe"]["width_mm"]), (&"convex".into(), &serde_json::Value::Null));
        assert_eq!(json["adapter"]["driver"], "Mesa");
        // Liver without scatterers: one of the requested rays suffices.
        assert_eq!((&json["quality"]["rays"], &json["simulated"]["rays"]), (&32.into(), &1.into()));
        assert_eq!(json["simulated"]["effects"], serde_json::json!(["attenuation", "maps"]));
    }

    #[test]
    fn a_map_of_the_wrong_size_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let frame = Frame { lines: vec![[0.0; 2]; 9], ..frame() };
        let record = record(&frame, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        std::fs::write(dir.path().join("frame.json"), "of an earlier frame").unwrap();
        let error = FrameFiles { frame: &frame, tissues: &tissues(), record: &record }.write(dir.path()).unwrap_err();
        assert!(error.to_string().contains("lines.npy"), "{error}");
        assert!(!dir.path().join("frame.json").exists());
    }
}
