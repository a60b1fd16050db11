//! Key frames of a recorded session: rows of a contact sheet, with files and scores.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::{ReplayError, Timeline};
use crate::anatomy::{Bvh, Scene};
use crate::chooser::Translation;
use crate::needle::Needle;
use crate::pose::Pose;
use crate::quality::{Pair, Scores};
use crate::recording::Event;
use crate::render::{Backend, Effect, Frame, FrameQuality, RenderError, RenderSettings, Renderer};
use crate::report::contact_sheet::{Map, Panel};
use crate::report::{ContactSheet, TimeTable};
use crate::sink::{FrameFiles, FrameRecord, png, remove};
use crate::station::Station;
use crate::statistics::{evenly, mean};

/// Largest number of rows of the contact sheet.
const COUNT_MAX: usize = 6;
/// File of a key frame's translated image.
const TRANSLATED: &str = "translated.png";

/// A frame of the session that the contact sheet shows.
#[derive(Debug, Clone)]
pub struct KeyFrame {
    name: String,
    time_s: f64,
    /// Time of the scene, s.
    scene_s: f64,
    pose: Pose,
    /// The needle; none where it is unknown, and without a needle.
    needle: Option<Needle>,
}

impl KeyFrame {
    /// The key frame's name as part of a path: letters, digits and `_`.
    pub fn file_name(&self) -> String {
        self.name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect()
    }
}

/// Key frames of a session: the nearest frame of each event. Without events, frames spread evenly over the session.
pub fn key_frames(events: &[Event], timeline: &Timeline) -> Vec<KeyFrame> {
    let key = |name: String, frame: usize| {
        let pose = *timeline.poses.get(frame)?;
        let needle = timeline.needles.get(frame).copied().flatten();
        Some(KeyFrame { name, time_s: timeline.seconds(frame), scene_s: timeline.scene_s(frame), pose, needle })
    };
    if events.is_empty() {
        let frames = evenly(4, timeline.poses.len());
        return (1..).zip(frames).filter_map(|(number, frame)| key(format!("view {number}"), frame)).collect();
    }
    let named = events.iter().take(COUNT_MAX);
    named.filter_map(|event| key(event.name.clone(), timeline.nearest(event.host_time_ns))).collect()
}

/// Scores of a key frame against high quality.
#[derive(Debug, Serialize)]
pub struct KeyScores {
    name: String,
    lq: Scores,
    /// Scores of the translated image; none without a generator.
    #[serde(skip_serializing_if = "Option::is_none")]
    translated: Option<Scores>,
}

/// Mean scores of key frames before and after translation, as text.
pub struct Agreement<'a>(pub &'a [KeyScores]);

impl fmt::Display for Agreement<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mean_of = |of: &dyn Fn(&KeyScores) -> Option<f64>| mean(self.0.iter().filter_map(of)).unwrap_or(f64::NAN);
        let psnr = [mean_of(&|key| Some(key.lq.psnr_db)), mean_of(&|key| Some(key.translated?.psnr_db))];
        let ssim = [mean_of(&|key| Some(key.lq.ssim)), mean_of(&|key| Some(key.translated?.ssim))];
        write!(f, "PSNR {:.1} to {:.1} dB, SSIM {:.3} to {:.3}", psnr[0], psnr[1], ssim[0], ssim[1])
    }
}

/// A renderer at one quality, with its last frame and its frame times.
pub struct Stage {
    /// The renderer.
    pub renderer: Renderer,
    settings: RenderSettings,
    frame: Frame,
    /// Times of the rendered frames.
    pub times: TimeTable,
    /// Number of frames with hits or interactions that did not fit the buffers.
    pub overflowed: usize,
}

impl Stage {
    /// A stage that renders `station`'s scene at a quality.
    ///
    /// # Errors
    /// Errors of [`Renderer::with_bvh`].
    pub fn new(
        backend: &Backend,
        scene: &Scene,
        bvh: &Arc<Bvh>,
        station: &Station,
        quality: FrameQuality,
    ) -> Result<Self, RenderError> {
        let settings = settings(station, quality);
        let renderer = Renderer::with_bvh(backend, scene, bvh.clone(), &station.probe, &settings)?;
        Ok(Self { renderer, settings, frame: Frame::default(), times: TimeTable::default(), overflowed: 0 })
    }

    /// Changes the quality.
    ///
    /// # Errors
    /// Errors of [`Renderer::reconfigure`].
    pub fn reconfigure(&mut self, station: &Station, quality: FrameQuality) -> Result<(), RenderError> {
        self.settings = settings(station, quality);
        self.renderer.reconfigure(&station.probe, &self.settings)
    }

    /// Renders the scene at `time_s`.
    ///
    /// # Errors
    /// Errors of [`Renderer::render`].
    pub fn render(&mut self, pose: &Pose, time_s: f64) -> Result<&Frame, RenderError> {
        self.renderer.set_time_s(time_s);
        self.renderer.render(pose, &mut self.frame)?;
        self.times.push(&self.frame.times);
        self.overflowed += usize::from(self.frame.overflows > 0);
        Ok(&self.frame)
    }
}

/// The station's settings at a quality.
fn settings(station: &Station, quality: FrameQuality) -> RenderSettings {
    quality.apply(&station.settings, station.settings.effects.of(Effect::Aperture))
}

/// Renderers and generator that make the rows of the sheet.
pub struct KeyFrames<'a> {
    /// Low quality.
    pub lq: Stage,
    /// High quality: the reference for the scores.
    pub hq: Stage,
    /// Generator with its buffers; none: frames are not translated.
    pub translation: Option<Translation>,
    /// The station.
    pub station: &'a Station,
    /// Backend that renders the frames.
    pub backend: &'a Backend,
}

impl KeyFrames<'_> {
    /// Renders a key frame at both qualities, translates it and writes its files. Returns its row of the sheet with its
    /// scores.
    ///
    /// # Errors
    /// A frame that can't be rendered or translated, or a file that can't be written.
    pub fn render(
        &mut self,
        key: &KeyFrame,
        directory: &Path,
        sheet: &ContactSheet<'_>,
    ) -> Result<(Vec<Panel>, KeyScores), ReplayError> {
        let Self { lq, hq, translation, station, backend } = self;
        let bmode = Map::BMode { dynamic_range_db: station.settings.image.dynamic_range_db };
        lq.renderer.set_needle(key.needle);
        hq.renderer.set_needle(key.needle);
        lq.render(&key.pose, key.scene_s)?;
        hq.render(&key.pose, key.scene_s)?;
        let (low, high) = (&lq.frame, &hq.frame);
        let size = [low.width, low.height];
        let score = |image: &[u8]| -> Result<Scores, ReplayError> {
            Ok(Scores::of(&Pair::new(size.map(|n| n as usize), image, &high.bmode, Some(&high.mask))?))
        };
        let write = |name: &str, image: &[u8]| {
            png::write_grey(&directory.join(name), size[0], size[1], image, png::Effort::Small)
        };
        let mut scores = KeyScores { name: key.name.clone(), lq: score(&low.bmode)?, translated: None };
        write("lq.png", &low.bmode)?;
        let caption = format!("{:.1} s  {}  LQ  {:.0} ms", key.time_s, key.name, low.times.total_ms);
        let mut row = vec![sheet.panel(caption, low, bmode)?.with_note(note(&scores.lq))];
        if let Some(translation) = translation {
            let ms = translation.run(low)?;
            lq.times.push_generator(ms);
            let image = &translation.image;
            let translated = score(image)?;
            write(TRANSLATED, image)?;
            let panel = sheet.grey_panel(format!("translated from LQ  +{ms:.0} ms"), image, size, bmode)?;
            row.push(panel.with_note(note(&translated)));
            scores.translated = Some(translated);
        } else {
            // An earlier demo may have left this file.
            remove(&directory.join(TRANSLATED))?;
        }
        row.push(sheet.panel(format!("HQ  {:.0} ms", high.times.total_ms), high, bmode)?);
        row.push(sheet.panel("segmentation", high, Map::Segmentation)?);
        let attenuation = sheet.panel("attenuation", high, Map::Attenuation)?;
        row.push(attenuation.with_note(format!("1 = {:.3}", high.attenuation_p98)));
        let (adapter, sector) = ((*backend).into(), hq.renderer.sector());
        let plan = hq.renderer.plan();
        let mut record = FrameRecord::new(&hq.frame, &key.pose, &station.probe, &hq.settings, plan, sector, adapter);
        record.set_needle(key.needle.as_ref());
        FrameFiles { frame: &hq.frame, tissues: sheet.tissues, record: &record }.write(directory)?;
        Ok((row, scores))
    }
}

/// Scores as a line below a picture's caption.
fn note(scores: &Scores) -> String {
    format!("PSNR {:.1} dB  SSIM {:.3}", scores.psnr_db, scores.ssim)
}

/// Lines below the sheet's title that explain its columns. `generator` is the generator's name.
pub fn legend(target: FrameQuality, generator: Option<&str>) -> Vec<String> {
    let FrameQuality { rays, layers, angles, .. } = target;
    let compounded = if angles > 1 { format!(", mean of {angles} steering angles") } else { String::new() };
    let translated = generator.map(|name| format!("   translated: by {name}, trained to give HQ from LQ"));
    vec![
        format!(
            "LQ: 1 ray x 1 layer{}   HQ: {rays} rays x {layers} layers{compounded}",
            translated.unwrap_or_default()
        ),
        "PSNR and SSIM: against HQ, inside the sector".to_owned(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sheet_says_what_hq_is_and_names_the_generator_only_where_it_has_one() {
        let target = FrameQuality { angles: 9, ..FrameQuality::new(32, 3) };
        let with = legend(target, Some("fast_msa"));
        assert_eq!(
            with[0],
            "LQ: 1 ray x 1 layer   translated: by fast_msa, trained to give HQ from LQ   \
             HQ: 32 rays x 3 layers, mean of 9 steering angles"
        );
        assert_eq!(legend(FrameQuality::new(32, 3), None)[0], "LQ: 1 ray x 1 layer   HQ: 32 rays x 3 layers");
        assert!(with.iter().all(|line| line.is_ascii()));
    }

    #[test]
    fn agreement_is_the_mean_over_key_frames() {
        let scores = |psnr_db, ssim| Scores { psnr_db, ssim, pkl: None, seen: None };
        let key = |lq, translated| KeyScores { name: String::new(), lq, translated: Some(translated) };
        let keys = [key(scores(20.0, 0.5), scores(24.0, 0.7)), key(scores(21.0, 0.52), scores(25.0, 0.73))];
        assert_eq!(Agreement(&keys).to_string(), "PSNR 20.5 to 24.5 dB, SSIM 0.510 to 0.715");
    }
}
