//! Comparison of the qualities that generators were trained for with the qualities of a data set.

use crate::dataset::Header;
use crate::generator::Training;
use crate::render::FrameQuality;

/// Quality of a data set's frames in words, such as `1x1 of 9 angles`.
fn words([rays, layers]: [u32; 2], angles: u32) -> String {
    match angles {
        0 | 1 => format!("{rays}x{layers}"),
        _ => format!("{rays}x{layers} of {angles} angles"),
    }
}

fn words_of(quality: &FrameQuality) -> String {
    words([quality.rays, quality.layers], quality.angles)
}

/// Remarks on a generator that was trained for another target or other inputs than the data set's. Empty if its
/// manifest does not record the training.
pub(super) fn notes(name: &str, training: &Training, header: &Header) -> Vec<String> {
    let mut notes = Vec::new();
    let target = words(header.hq, header.look.hq_angles);
    if let Some(hq) = training.hq.filter(|hq| words_of(hq) != target) {
        let trained = words_of(&hq);
        notes.push(format!(
            "{name} was trained to give {trained}, and this data set's target is {target}: its errors include the difference \
             between the two; `insonify dataset --hq {}x{} --angles {}` makes its target",
            hq.rays, hq.layers, hq.angles
        ));
    }
    let trained: Vec<String> = training.lq.iter().chain(&training.lq_more).map(words_of).collect();
    let given = [header.lq].into_iter().chain(header.lq_more.iter().copied());
    let other: Vec<String> =
        given.map(|lq| words(lq, header.look.lq_angles)).filter(|lq| !trained.contains(lq)).collect();
    if !trained.is_empty() && !other.is_empty() {
        notes.push(format!(
            "{name} was trained on frames of {}, and this data set's low quality has {}",
            trained.join(", "),
            other.join(", ")
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quality(rays: u32, layers: u32, angles: u32) -> FrameQuality {
        FrameQuality { angles, ..FrameQuality::new(rays, layers) }
    }

    fn header(lq_angles: u32, hq_angles: u32) -> Header {
        let text = r#"{"format": 1, "insonify": "0.1.0", "seed": 1, "frames": 2, "classes": ["outside"], "planes": [],
            "attenuation_power": 0.25, "lq": [1, 1], "lq_more": [[2, 3]], "hq": [32, 3], "phantoms": 0, "frames_per_exam": 1,
            "test_share": 0.5, "stations": []}"#;
        let mut header: Header = serde_json::from_str(text).unwrap();
        (header.look.lq_angles, header.look.hq_angles) = (lq_angles, hq_angles);
        header
    }

    fn training(lq: &[FrameQuality], hq: FrameQuality) -> Training {
        Training {
            data_sha256: String::new(),
            iterations: 1,
            lq: lq.first().copied(),
            lq_more: lq.get(1..).unwrap_or_default().to_vec(),
            hq: Some(hq),
        }
    }

    #[test]
    fn another_target_or_input_is_named() {
        let both = [quality(1, 1, 1), quality(2, 3, 1)];
        assert_eq!(notes("g", &training(&both, quality(32, 3, 9)), &header(1, 9)), Vec::<String>::new());

        let said = notes("g", &training(&both, quality(32, 3, 9)), &header(1, 1));
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].contains("g was trained to give 32x3 of 9 angles"), "{said:?}");
        assert!(said[0].contains("this data set's target is 32x3:"), "{said:?}");

        let said = notes("g", &training(&both[..1], quality(32, 3, 9)), &header(1, 9));
        assert_eq!(said, ["g was trained on frames of 1x1, and this data set's low quality has 2x3"]);

        let unknown = Training { lq: None, hq: None, ..training(&[], quality(1, 1, 1)) };
        assert_eq!(notes("g", &unknown, &header(9, 9)), Vec::<String>::new());
    }
}
