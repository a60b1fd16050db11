//! MP4 videos of grey frames, coded in H.264, which every browser plays.

use std::path::{Path, PathBuf};

use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Encoder, EncoderConfig, IntraFramePeriod, QpRange, RateControlMode, UsageType, VuiConfig,
};
use openh264::formats::YUVSlices;
use shiguredo_mp4::Uint;
use shiguredo_mp4::boxes::{Avc1Box, AvccBox, SampleEntry, VisualSampleEntryFields};

use super::error::check_shape;
use super::growing_mp4::{GrowingMp4, failed};
use super::{FrameRate, SinkError};

/// Bit rate that the encoder aims at, bits/s: high enough that speckle survives.
const BIT_RATE: u32 = 8_000_000;

/// Range of quantization parameters. The upper end bounds the loss at any bit rate.
const QUANTIZATION: QpRange = QpRange::new(12, 24);

/// Time between key frames, s. Players can jump only to key frames.
const KEY_FRAME_S: f64 = 2.0;

/// Smallest side that the encoder takes, pixels.
const SIDE_MIN: usize = 16;

/// Types of NAL units (ITU-T H.264, table 7-1): parameter sets and key pictures.
const SEQUENCE_PARAMETERS: u8 = 7;
const PICTURE_PARAMETERS: u8 = 8;
const KEY_PICTURE: u8 = 5;

/// A growing MP4 of grey frames in full range. Frames are written to disk every second; only their sizes stay in
/// memory.
///
/// The file is called `STEM.part.mp4` until [`Video::finish`]. After an interruption it stays, and plays up to its
/// last written second.
pub struct Video {
    path: PathBuf,
    file: GrowingMp4,
    encoder: Encoder,
    /// Height and width of the frames.
    shape: [usize; 2],
    /// Width and height of the video, pixels: even, and at least [`SIDE_MIN`].
    size: [usize; 2],
    luma: Vec<u8>,
    chroma: Vec<u8>,
    /// Buffer for a coded picture: NAL units with length prefixes.
    sample: Vec<u8>,
    has_entry: bool,
}

impl Video {
    /// Opens `stem` + `.mp4` for frames of `width` × `height` pixels. Odd sides are padded with black. The file of an
    /// interrupted video is replaced.
    ///
    /// # Errors
    /// The file cannot be created, another process writes it, or the encoder refuses the size.
    pub fn create(stem: &Path, width: u32, height: u32, rate: FrameRate) -> Result<Self, SinkError> {
        Self::open(stem, [width, height], rate, false)
    }

    /// Opens a video as [`create`](Self::create) does, except that the file of an interrupted video is kept. Its name
    /// is then `stem.recovered-1.mp4`, or the next free number.
    ///
    /// # Errors
    /// Errors of [`create`](Self::create).
    pub fn create_keeping(stem: &Path, width: u32, height: u32, rate: FrameRate) -> Result<Self, SinkError> {
        Self::open(stem, [width, height], rate, true)
    }

    fn open(stem: &Path, [width, height]: [u32; 2], rate: FrameRate, keep: bool) -> Result<Self, SinkError> {
        let path = stem.with_extension("mp4");
        let shape = [height as usize, width as usize];
        let size = [shape[1], shape[0]].map(|side| side.next_multiple_of(2).max(SIDE_MIN));
        let key_frames = (rate.fps() * KEY_FRAME_S).ceil() as u32;
        let config = EncoderConfig::new()
            .max_frame_rate(openh264::encoder::FrameRate::from_hz(rate.fps() as f32))
            .bitrate(BitRate::from_bps(BIT_RATE))
            .rate_control_mode(RateControlMode::Bufferbased)
            .qp(QUANTIZATION)
            // The encoder must not treat dark speckle as background.
            .background_detection(false)
            .adaptive_quantization(false)
            .skip_frames(false)
            .usage_type(UsageType::CameraVideoRealTime)
            .intra_frame_period(IntraFramePeriod::from_num_frames(key_frames))
            .vui(VuiConfig::bt709_full());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config).map_err(failed(&path))?;
        let file = GrowingMp4::create(&path, rate, keep)?;
        let (luma, chroma) = (vec![0; size[0] * size[1]], vec![128; size[0] * size[1] / 4]);
        Ok(Self { path, file, encoder, shape, size, luma, chroma, sample: Vec::new(), has_entry: false })
    }

    /// Appends a frame, `grey` [height × width].
    ///
    /// # Errors
    /// `grey` does not have that size, the disk is full, or the encoder fails.
    pub fn push(&mut self, grey: &[u8]) -> Result<(), SinkError> {
        check_shape(&self.path, self.shape, grey.len())?;
        let [width, height] = self.size;
        for (row, from) in self.luma.chunks_exact_mut(width).zip(grey.chunks_exact(self.shape[1])) {
            row[..from.len()].copy_from_slice(from);
        }
        let strides = (width, width / 2, width / 2);
        let picture = YUVSlices::new((&self.luma, &self.chroma, &self.chroma), (width, height), strides);
        let coded = self.encoder.encode(&picture).map_err(failed(&self.path))?;

        self.sample.clear();
        let (mut parameters, mut is_key) = ([Vec::new(), Vec::new()], false);
        let layers = (0..coded.num_layers()).filter_map(|layer| coded.layer(layer));
        for layer in layers {
            for unit in (0..layer.nal_count()).filter_map(|unit| layer.nal_unit(unit)) {
                // Removes the start code (zeros and a one), because MP4 uses length prefixes.
                let unit = unit.iter().position(|byte| *byte != 0).map_or(&[][..], |one| &unit[one + 1..]);
                match unit.first().map(|header| header & 0x1f) {
                    Some(SEQUENCE_PARAMETERS) => parameters[0] = unit.to_vec(),
                    Some(PICTURE_PARAMETERS) => parameters[1] = unit.to_vec(),
                    Some(kind) => {
                        is_key |= kind == KEY_PICTURE;
                        self.sample.extend_from_slice(&(unit.len() as u32).to_be_bytes());
                        self.sample.extend_from_slice(unit);
                    }
                    None => {}
                }
            }
        }
        let entry = if self.has_entry { None } else { Some(sample_entry(parameters, self.size, &self.path)?) };
        self.has_entry = true;
        self.file.push(&self.sample, is_key, entry)
    }

    /// Completes the file, renames it to its final path, and returns the path.
    ///
    /// # Errors
    /// The disk is full, or the file cannot be renamed.
    pub fn finish(self) -> Result<PathBuf, SinkError> {
        self.file.finish()
    }
}

/// Description of the coded stream, from the parameter sets of sequence (SPS) and picture (PPS).
fn sample_entry([sps, pps]: [Vec<u8>; 2], size: [usize; 2], path: &Path) -> Result<SampleEntry, SinkError> {
    let [profile, compatibility, level] = match sps.get(1..4) {
        Some(&[profile, compatibility, level]) => [profile, compatibility, level],
        _ => return Err(failed(path)("the encoder began without its parameters")),
    };
    let [width, height] = size.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
    Ok(SampleEntry::Avc1(Avc1Box {
        visual: VisualSampleEntryFields {
            data_reference_index: VisualSampleEntryFields::DEFAULT_DATA_REFERENCE_INDEX,
            width,
            height,
            horizresolution: VisualSampleEntryFields::DEFAULT_HORIZRESOLUTION,
            vertresolution: VisualSampleEntryFields::DEFAULT_VERTRESOLUTION,
            frame_count: VisualSampleEntryFields::DEFAULT_FRAME_COUNT,
            compressorname: [0; 32],
            depth: VisualSampleEntryFields::DEFAULT_DEPTH,
        },
        avcc_box: AvccBox {
            avc_profile_indication: profile,
            profile_compatibility: compatibility,
            avc_level_indication: level,
            length_size_minus_one: Uint::new(3),
            sps_list: vec![sps],
            pps_list: vec![pps],
            chroma_format: None,
            bit_depth_luma_minus8: None,
            bit_depth_chroma_minus8: None,
            sps_ext_list: Vec::new(),
        },
        unknown_boxes: Vec::new(),
    }))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use openh264::decoder::Decoder;
    use openh264::formats::YUVSource as _;
    use shiguredo_mp4::demux::{DemuxError, Fmp4FileDemuxer, Input, Mp4FileDemuxer};

    /// A coded picture: its byte range in the file, whether it is a key frame, and the description of the stream
    /// (first picture only).
    type Coded = (std::ops::Range<usize>, bool, Option<SampleEntry>);

    fn coded(sample: &shiguredo_mp4::demux::Sample<'_>) -> Coded {
        let start = sample.data_offset as usize;
        (start..start + sample.data_size, sample.keyframe, sample.sample_entry.cloned())
    }

    /// Frames [height × width] of coded pictures.
    fn frames(bytes: &[u8], pictures: &[Coded]) -> Vec<Vec<u8>> {
        let mut decoder = Decoder::new().unwrap();
        let mut frames = Vec::new();
        for (range, _, entry) in pictures {
            let mut stream = Vec::new();
            let mut unit = |bytes: &[u8]| stream.extend([&[0, 0, 0, 1], bytes].concat());
            if let Some(SampleEntry::Avc1(entry)) = entry.as_ref().filter(|_| frames.is_empty()) {
                entry.avcc_box.sps_list.iter().chain(&entry.avcc_box.pps_list).for_each(|set| unit(set));
            }
            let mut data = &bytes[range.clone()];
            while let Some((length, rest)) = data.split_first_chunk::<4>() {
                let (one, rest) = rest.split_at(u32::from_be_bytes(*length) as usize);
                unit(one);
                data = rest;
            }
            let picture = decoder.decode(&stream).unwrap().unwrap();
            let ((width, height), (stride, ..)) = (picture.dimensions(), picture.strides());
            frames.push(picture.y().chunks(stride).take(height).flat_map(|row| row[..width].to_vec()).collect());
        }
        frames
    }

    /// Frames [height × width] of the video at `path`, whether each is a key frame, and the duration, s.
    pub(in crate::sink) fn decode(path: &Path) -> (Vec<Vec<u8>>, Vec<bool>, f64) {
        let bytes = std::fs::read(path).unwrap();
        let mut demuxer = Mp4FileDemuxer::new();
        demuxer.handle_input(Input { position: 0, data: &bytes });
        let track = demuxer.tracks().unwrap()[0].clone();
        let pictures: Vec<_> = std::iter::from_fn(|| demuxer.next_sample().unwrap().as_ref().map(coded)).collect();
        let keys = pictures.iter().map(|(_, is_key, _)| *is_key).collect();
        (frames(&bytes, &pictures), keys, track.duration as f64 / f64::from(track.timescale.get()))
    }

    /// Frames of an interrupted video, up to the point where the file is cut.
    pub(in crate::sink) fn decode_interrupted(bytes: &[u8]) -> Vec<Vec<u8>> {
        let (mut demuxer, mut pictures) = (Fmp4FileDemuxer::new(), Vec::new());
        while let Some(required) = demuxer.required_input() {
            let data = bytes.get(required.position as usize..).unwrap_or_default();
            let data = &data[..required.size.map_or(data.len(), |size| size.min(data.len()))];
            demuxer.handle_input(Input { position: required.position, data });
            loop {
                match demuxer.next_sample() {
                    Ok(Some(sample)) => pictures.push(coded(&sample)),
                    Ok(None) | Err(DemuxError::InputRequired(_)) => break,
                    Err(_) => return frames(bytes, &pictures),
                }
            }
        }
        frames(bytes, &pictures)
    }

    /// Boxes of a file, each with its name and the position of its end.
    fn boxes(bytes: &[u8]) -> Vec<(String, usize)> {
        let (mut found, mut at) = (Vec::new(), 0);
        while at < bytes.len() {
            let name = String::from_utf8_lossy(&bytes[at + 4..at + 8]).into_owned();
            let size = u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
            at += match size {
                1 => u64::from_be_bytes(bytes[at + 8..at + 16].try_into().unwrap()) as usize,
                size => size as usize,
            };
            found.push((name, at));
        }
        assert_eq!(at, bytes.len());
        found
    }

    /// Test picture with speckle that drifts by one pixel per frame: Rayleigh amplitudes, log-compressed, under a
    /// ramp.
    fn speckle(width: usize, height: usize, frame: usize) -> Vec<u8> {
        let amplitude = |x: usize, y: usize| {
            let hash = |n: usize| (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
            let blocks = hash((x / 3) * 7919 + (y / 2) * 104_729 + 1) as f64 / (1 << 24) as f64;
            110.0 + 20.0 * (-2.0 * (1.0 - blocks).ln()).sqrt().log10() * 3.0 - 40.0 * y as f64 / height as f64
        };
        (0..width * height).map(|i| amplitude(i % width + frame, i / width) as u8).collect()
    }

    fn psnr(a: &[u8], b: &[u8]) -> f64 {
        let squares: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
        10.0 * (255.0 * 255.0 * a.len() as f64 / squares.max(1e-9)).log10()
    }

    #[test]
    fn a_video_has_its_frames_duration_and_key_frames_and_speckle_survives() {
        let dir = tempfile::tempdir().unwrap();
        let (width, height) = (346, 250);
        let mut video = Video::create(&dir.path().join("v"), 346, 250, FrameRate::new(10.0).unwrap()).unwrap();
        let sent: Vec<_> = (0..45).map(|n| speckle(width, height, n)).collect();
        sent.iter().for_each(|frame| video.push(frame).unwrap());
        assert!(video.push(&[0]).is_err());
        assert!(!dir.path().join("v.mp4").exists(), "the name appears only when the file is whole");
        let path = video.finish().unwrap();
        assert_eq!(path, dir.path().join("v.mp4"));
        let (found, keys, duration_s) = decode(&path);
        assert_eq!((found.len(), duration_s), (45, 4.5));
        assert_eq!((0..45).filter(|&n| keys[n]).collect::<Vec<_>>(), [0, 20, 40]);
        let worst = sent.iter().zip(&found).map(|(a, b)| psnr(a, b)).fold(f64::MAX, f64::min);
        assert!(worst > 35.0, "{worst:.1} dB");
    }

    #[test]
    fn the_file_has_the_boxes_of_a_plain_mp4() {
        let dir = tempfile::tempdir().unwrap();
        let mut video = Video::create(&dir.path().join("v"), 33, 21, FrameRate::new(29.97).unwrap()).unwrap();
        (0..3).for_each(|_| video.push(&[90; 33 * 21]).unwrap());
        let bytes = std::fs::read(video.finish().unwrap()).unwrap();
        let mut names: Vec<_> = boxes(&bytes).into_iter().map(|(name, _)| name).collect();
        names.retain(|name| name != "free");
        assert_eq!(names, ["ftyp", "mdat", "moov"]);
        let (found, ..) = decode(&dir.path().join("v.mp4"));
        assert_eq!(found[0].len(), 34 * 22, "odd sides are padded");
        assert!(found[0][..33].iter().all(|grey| grey.abs_diff(90) < 4), "{:?}", &found[0][..33]);
    }

    #[test]
    fn an_interrupted_video_plays_up_to_its_last_whole_second_wherever_it_is_cut() {
        let dir = tempfile::tempdir().unwrap();
        let (width, height) = (64, 48);
        let part = dir.path().join("v.part.mp4");
        let mut video = Video::create(&dir.path().join("v"), 64, 48, FrameRate::new(10.0).unwrap()).unwrap();
        let sent: Vec<_> = (0..45).map(|n| speckle(width, height, n)).collect();
        sent.iter().for_each(|frame| video.push(frame).unwrap());
        let on_disk = std::fs::read(&part).unwrap();
        drop(video);
        let whole = std::fs::read(&part).unwrap();
        assert!(whole.starts_with(&on_disk) && !dir.path().join("v.mp4").exists());
        let ends: Vec<usize> = boxes(&whole).iter().filter(|(name, _)| name == "mdat").map(|(_, end)| *end).collect();
        assert_eq!(ends.len(), 5, "five seconds, the last one from the end of the program");
        assert_eq!(ends[3], on_disk.len(), "a killed program leaves four seconds");
        let cuts = (ends[0]..whole.len()).step_by(2999).chain(ends.iter().flat_map(|end| [end - 1, *end]));
        for cut in cuts {
            let found = decode_interrupted(&whole[..cut]);
            let seconds = ends.iter().filter(|end| **end <= cut).count();
            assert_eq!(found.len(), (10 * seconds).min(45), "cut at {cut} of {ends:?}");
            assert!(found.iter().zip(&sent).all(|(a, b)| psnr(a, b) > 35.0), "cut at {cut}");
        }
    }

    #[test]
    fn interrupted_videos_are_replaced_or_kept_and_never_written_by_two() {
        let dir = tempfile::tempdir().unwrap();
        let (stem, rate) = (dir.path().join("v"), FrameRate::new(20.0).unwrap());
        let names = || {
            let mut names: Vec<_> = std::fs::read_dir(&dir).unwrap().map(|e| e.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let mut video = Video::create(&stem, 4, 2, rate).unwrap();
        video.push(&[0; 8]).unwrap();
        assert!(matches!(Video::create(&stem, 4, 2, rate), Err(SinkError::Busy { .. })));
        drop(video);
        assert_eq!(names(), ["v.part.mp4"]);
        drop(Video::create(&stem, 4, 2, rate).unwrap());
        assert_eq!(names(), [""; 0], "without a picture nothing stays");
        for _ in 0..3 {
            let mut video = Video::create_keeping(&stem, 4, 2, rate).unwrap();
            video.push(&[0; 8]).unwrap();
            drop(video);
        }
        assert_eq!(names(), ["v.part.mp4", "v.recovered-1.mp4", "v.recovered-2.mp4"]);
        let mut video = Video::create(&stem, 4, 2, rate).unwrap();
        video.push(&[0; 8]).unwrap();
        video.finish().unwrap();
        assert_eq!(names(), ["v.mp4", "v.recovered-1.mp4", "v.recovered-2.mp4"]);
    }
}
