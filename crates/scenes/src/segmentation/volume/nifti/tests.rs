use std::path::Path;

use glam::DVec3;
use proptest::prelude::*;

use super::super::fixtures::{Nifti, SIZE, gzipped, labels};
use super::super::{LabelMap, NiftiForm, PatientAxes, Segment, read_image, read_labels};
use glam::{DAffine3, DMat3};

use super::*;

fn decode(file: &Nifti) -> Result<RawVolume, VolumeFault> {
    let voxels = file.pair.then(|| file.voxels());
    decode_nifti(&file.bytes(), voxels.as_deref(), ReadOptions::default())
}

fn map(file: &Nifti) -> LabelMap {
    decode(file).unwrap().into_labels(Path::new("a.nii")).unwrap()
}

fn refusal(file: &Nifti) -> String {
    decode(file).and_then(|raw| raw.into_labels(Path::new("a.nii"))).unwrap_err().to_string()
}

/// Transform with these LPS columns and origin.
fn placed(columns: [[f64; 3]; 3], origin: [f64; 3]) -> DAffine3 {
    let [x, y, z] = columns.map(DVec3::from);
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin.into())
}

#[test]
fn all_types_byte_orders_and_versions_give_the_same_map() {
    let expected = map(&Nifti::default());
    assert_eq!(expected.size, SIZE);
    assert_eq!(expected.layers, [labels()]);
    let lps = placed([[-2.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, 4.0]], [10.0, 20.0, 30.0]);
    assert_eq!(expected.lps_from_voxel, lps);
    assert_eq!(expected.segments.len(), 23);
    for datatype in [2, 256, 4, 512, 8, 768, 1024, 1280, 16, 64] {
        for (version, big_endian, pair) in [
            (1, false, false),
            (1, true, false),
            (2, false, false),
            (2, true, false),
            (1, true, true),
            (2, false, true),
        ] {
            let file = Nifti { datatype, version, big_endian, pair, ..Nifti::default() };
            assert_eq!(map(&file), expected, "{datatype} {version} {big_endian} {pair}");
        }
    }
}

#[test]
fn files_and_pairs_are_read_by_path_compressed_or_not() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let (file, pair) = (Nifti::default(), Nifti { pair: true, ..Nifti::default() });
    let plain = write("a.nii", &file.bytes());
    let packed = write("b.nii.gz", &gzipped(&file.bytes()));
    let header = write("c.hdr", &pair.bytes());
    let image = write("c.img", &pair.voxels());
    let packed_header = write("d.hdr.gz", &gzipped(&pair.bytes()));
    write("d.img.gz", &gzipped(&pair.voxels()));
    for path in [plain, packed, header, image, packed_header] {
        let read = read_labels(&path, ReadOptions::default()).unwrap();
        assert_eq!(read.path, path);
        assert_eq!(LabelMap { path: "a.nii".into(), ..read }, map(&file));
    }
    let alone = write("e.hdr", &pair.bytes());
    let error = read_labels(&alone, ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("e.hdr: a NIfTI header without its .img file"), "{error}");
    write("f.hdr", &pair.bytes());
    let cut = write("f.img", &pair.voxels()[..40]);
    let error = read_labels(&cut, ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("f.img: ") && error.contains("48 bytes expected, 40 found"), "{error}");
}

#[test]
fn the_qform_places_voxels_with_either_handedness() {
    // A quarter turn about z in RAS: i runs to anterior, j to the patient's left (-x).
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let qform = Some([0.0, 0.0, half, 5.0, 6.0, 7.0]);
    let file = Nifti { version: 2, sform: None, qform, ..Nifti::default() };
    let expected = placed([[0.0, -2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 4.0]], [-5.0, -6.0, 7.0]);
    assert!(map(&file).lps_from_voxel.abs_diff_eq(expected, 1e-9));
    let left = Nifti { pixdim: [-1.0, 2.0, 3.0, 4.0], ..file };
    let expected = placed([[0.0, -2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, -4.0]], [-5.0, -6.0, 7.0]);
    assert!(map(&left).lps_from_voxel.abs_diff_eq(expected, 1e-9));
    // Half a turn about y. The stored quaternion is slightly longer than 1, as by rounding.
    let turned = Nifti { qform: Some([0.0, 1.0 + 1e-7, 0.0, 0.0, 0.0, 0.0]), sform: None, ..Nifti::default() };
    let expected = placed([[2.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, -4.0]], [0.0; 3]);
    assert!(map(&turned).lps_from_voxel.abs_diff_eq(expected, 1e-5));
}

#[test]
fn the_sform_is_preferred_to_the_qform() {
    let both = Nifti { qform: Some([0.05, 0.0, 0.0, 1.0, 2.0, 3.0]), ..Nifti::default() };
    assert_eq!(map(&both).lps_from_voxel, map(&Nifti::default()).lps_from_voxel);
}

#[test]
fn a_file_without_axes_needs_them_assumed() {
    let file = Nifti { sform: None, ..Nifti::default() };
    let error = refusal(&file);
    assert!(error.contains("qform_code and sform_code are 0") && error.contains("--assume-axes lps"), "{error}");
    for (axes, sign) in [(PatientAxes::Lps, 1.0), (PatientAxes::Ras, -1.0)] {
        let raw = decode_nifti(&file.bytes(), None, ReadOptions { assume_axes: Some(axes), ..ReadOptions::default() })
            .unwrap();
        let expected = placed([[2.0 * sign, 0.0, 0.0], [0.0, 3.0 * sign, 0.0], [0.0, 0.0, 4.0]], [0.0; 3]);
        assert_eq!(raw.lps_from_voxel, expected);
    }
    let stated = decode_nifti(
        &Nifti::default().bytes(),
        None,
        ReadOptions { assume_axes: Some(PatientAxes::Lps), ..ReadOptions::default() },
    );
    assert_eq!(stated.unwrap().lps_from_voxel, map(&Nifti::default()).lps_from_voxel);
}

#[test]
fn units_are_converted_to_mm() {
    for (units, factor) in [(0, 1.0), (2 | 8, 1.0), (1, 0.001), (3, 1000.0)] {
        let rows = Nifti::default().sform.unwrap().map(|row| row.map(|value| value * factor));
        let file = Nifti { version: 2, units, sform: Some(rows), ..Nifti::default() };
        assert!(map(&file).lps_from_voxel.abs_diff_eq(map(&Nifti::default()).lps_from_voxel, 1e-9), "{units}");
    }
    let wrong = refusal(&Nifti { units: 1, ..Nifti::default() });
    assert!(wrong.contains("2000 mm apart along axis i") && wrong.contains("(metres)"), "{wrong}");
    assert!(refusal(&Nifti { units: 5, ..Nifti::default() }).contains("code 5"));
}

#[test]
fn scaled_values_are_read_as_hounsfield_units() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ct.nii");
    let file = Nifti { datatype: 4, scale: [2.0, -1024.0], ..Nifti::default() };
    std::fs::write(&path, file.bytes()).unwrap();
    let image = read_image(&path, ReadOptions::default()).unwrap();
    assert_eq!(image.values[..3], [-1024.0, -1022.0, -1020.0]);
    assert!(refusal(&file).contains("voxel [0, 0, 0] is -1024"));
    assert_eq!(map(&Nifti { scale: [1.0, 0.0], ..Nifti::default() }), map(&Nifti::default()));
    assert_eq!(map(&Nifti { scale: [0.0, 7.0], ..Nifti::default() }), map(&Nifti::default()));
    assert_eq!(map(&Nifti { scale: [2.0, 1.0], ..Nifti::default() }).layers[0][3], 7);
}

#[test]
fn values_that_are_no_labels_are_refused_with_their_place() {
    let mut file = Nifti { datatype: 16, ..Nifti::default() };
    file.values[1 + 4 * 2 + 12] = 3.5;
    let error = refusal(&file);
    assert!(error.contains("voxel [1, 2, 1] is 3.5") && error.contains("--image"), "{error}");
    let mut file = Nifti { datatype: 8, ..Nifti::default() };
    file.values[2] = 70_000.0;
    assert!(refusal(&file).contains("voxel [2, 0, 0] has the label 70000"));
}

#[test]
fn a_fourth_axis_of_one_is_dropped_and_a_longer_one_refused() {
    assert_eq!(map(&Nifti { dim: [5, 4, 3, 2, 1, 1, 1, 1], ..Nifti::default() }), map(&Nifti::default()));
    let error = refusal(&Nifti { dim: [4, 4, 3, 1, 2, 1, 1, 1], ..Nifti::default() });
    assert!(error.contains("4 axes (sizes [4, 3, 1, 2])"), "{error}");
}

#[test]
fn wrong_headers_are_refused_by_field() {
    for (file, says) in [
        (Nifti { dim: [3, 4, -3, 2, 1, 1, 1, 1], ..Nifti::default() }, "dim[2] is -3"),
        (Nifti { dim: [3, 4, 0, 2, 1, 1, 1, 1], ..Nifti::default() }, "each must be at least 1"),
        (Nifti { dim: [0, 4, 3, 2, 1, 1, 1, 1], ..Nifti::default() }, "dim[0] is 0"),
        (Nifti { dim: [9, 4, 3, 2, 1, 1, 1, 1], ..Nifti::default() }, "dim[0] is 9"),
        (Nifti { dim: [3, 30000, 30000, 30000, 1, 1, 1, 1], ..Nifti::default() }, "at most 1073741824"),
        (Nifti { dim: [3, 1000, 1000, 1000, 1, 1, 1, 1], ..Nifti::default() }, "2000000000 bytes expected, 48 found"),
        (Nifti { dim: [3, 1000, 1000, 1000, 1, 1, 1, 1], datatype: 64, ..Nifti::default() }, "at most 4294967296"),
    ] {
        for version in [1, 2] {
            let error = refusal(&Nifti { version, ..file.clone() });
            assert!(error.contains(says), "{version}: {error}");
        }
    }
    for (code, says) in [(128_i16, "colours"), (32, "complex"), (77, "datatype is 77")] {
        let mut bytes = Nifti::default().bytes();
        bytes[70..72].copy_from_slice(&code.to_le_bytes());
        let error = decode_nifti(&bytes, None, ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let mut bytes = Nifti::default().bytes();
    bytes[108..112].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = decode_nifti(&bytes, None, ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("vox_offset is NaN"), "{error}");
}

#[test]
fn a_truncated_file_is_refused_with_both_lengths() {
    let bytes = Nifti::default().bytes();
    for length in [0, 3, 347, 351, bytes.len() - 1] {
        let error = decode_nifti(&bytes[..length], None, ReadOptions::default()).unwrap_err().to_string();
        assert!(error.starts_with("truncated: "), "{length}: {error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.nii.gz");
    std::fs::write(&path, gzipped(&bytes[..bytes.len() - 8])).unwrap();
    let error = read_labels(&path, ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("cut.nii.gz: truncated: the voxels: 48 bytes expected, 40 found"), "{error}");
}

#[test]
fn damaged_gzip_data_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.nii.gz");
    let mut packed = gzipped(&Nifti::default().bytes());
    let checksum = packed.len() - 8;
    packed[checksum] ^= 1;
    std::fs::write(&path, packed).unwrap();
    let error = read_labels(&path, ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("damaged.nii.gz: the gzip data is damaged"), "{error}");
}

#[test]
fn names_of_a_caret_extension_become_segments() {
    let table = "<CaretExtension><VolumeInformation><LabelTable>\
                 <Label Key=\"5\" Red=\"1\" Green=\"0\" Blue=\"0\" Alpha=\"1\"><![CDATA[liver]]></Label>\
                 <Label Key=\"200\" Red=\"1\" Green=\"0\" Blue=\"0\" Alpha=\"1\"><![CDATA[absent]]></Label>\
                 </LabelTable></VolumeInformation></CaretExtension>";
    for (version, big_endian, pair) in [(1, false, false), (1, true, false), (2, true, false), (1, false, true)] {
        let extensions = vec![(6, b"comment".to_vec()), (0, table.as_bytes().to_vec())];
        let map = map(&Nifti { version, big_endian, pair, extensions, ..Nifti::default() });
        assert_eq!(map.layers, [labels()]);
        let named = |value, name: &str| Segment {
            layer: 0,
            value,
            name: Some(name.to_owned()),
            colour: Some([255, 0, 0]),
            terminology: None,
        };
        assert_eq!(map.segments[..2], [named(5, "liver"), named(200, "absent")]);
        assert_eq!(map.segments.len(), 24);
    }
}

/// The default test volume with an additional qform; `qfac` is the sign of its third axis.
fn with_qform(qform: [f64; 6], qfac: f64) -> Nifti {
    Nifti { qform: Some(qform), pixdim: [qfac, 2.0, 3.0, 4.0], ..Nifti::default() }
}

/// The qform that is equal to the default test volume's sform.
const SAME: [f64; 6] = [0.0, 0.0, 0.0, -10.0, -20.0, 30.0];

fn preferring(file: &Nifti, prefer: Option<NiftiForm>) -> Result<RawVolume, VolumeFault> {
    decode_nifti(&file.bytes(), None, ReadOptions { prefer, ..ReadOptions::default() })
}

#[test]
fn forms_that_agree_are_silent() {
    for (qform, qfac) in [(SAME, 1.0), ([0.001, 0.0, 0.0, -10.3, -20.2, 30.1], 1.0)] {
        let map = map(&with_qform(qform, qfac));
        assert_eq!((map.remarks, map.lps_from_voxel), (Vec::new(), self::map(&Nifti::default()).lps_from_voxel));
    }
}

#[test]
fn forms_of_opposite_sides_are_refused_unless_one_is_preferred() {
    // Half a turn about y and a reversed third axis mirror x alone.
    let mirrored = with_qform([0.0, 1.0, 0.0, -4.0, -20.0, 30.0], -1.0);
    for version in [1, 2] {
        let error = refusal(&Nifti { version, ..mirrored.clone() });
        for says in [
            "axis i runs to the patient's right by the sform (code 1, scanner)",
            "to the patient's left by the qform",
            "mirror image",
            "--prefer sform",
        ] {
            assert!(error.contains(says), "{error}");
        }
    }
    for (prefer, x) in [(NiftiForm::Sform, -2.0), (NiftiForm::Qform, 2.0)] {
        let map = preferring(&mirrored, Some(prefer)).unwrap().into_labels(Path::new("a.nii")).unwrap();
        assert_eq!(map.lps_from_voxel.matrix3.x_axis.x, x);
        assert!(map.remarks[0].contains("contradict") && map.remarks[0].contains(prefer.name()), "{:?}", map.remarks);
    }
    // Half a turn about z, as if LPS and RAS were confused.
    let turned = with_qform([0.0, 0.0, 1.0, 10.0, 20.0, 30.0], 1.0);
    let error = refusal(&turned);
    assert!(error.contains("contradict each other") && !error.contains("mirror image"), "{error}");
    let quarter = with_qform([0.0, 0.0, 0.5_f64.sqrt(), -10.0, -20.0, 30.0], 1.0);
    assert!(refusal(&quarter).contains("runs to the "));
}

#[test]
fn forms_with_voxels_of_other_sizes_are_refused() {
    let file = Nifti { qform: Some(SAME), pixdim: [1.0, 1.0, 1.0, 1.0], ..Nifti::default() };
    let error = refusal(&file);
    assert!(error.contains("voxels have 2.000 × 3.000 × 4.000 mm by the sform"), "{error}");
    assert!(error.contains("1.000 × 1.000 × 1.000 mm by pixdim"), "{error}");
    let alone = map(&Nifti { pixdim: [1.0, 1.0, 1.0, 1.0], ..Nifti::default() });
    assert!(alone.remarks[0].contains("by pixdim: the sform was taken"), "{:?}", alone.remarks);
}

#[test]
fn forms_that_are_apart_are_remarked_with_both_positions() {
    let map = map(&with_qform([0.0, 0.0, 0.0, 110.0, -20.0, 30.0], 1.0));
    assert_eq!(map.lps_from_voxel, self::map(&Nifti::default()).lps_from_voxel);
    assert_eq!(
        map.remarks,
        [
            "its sform (code 1, scanner) and qform (code 1, scanner) place it up to 120 mm apart, its centre at (7, 17, 32) and \
          at (-113, 17, 32) mm (LPS): the sform was taken"
        ]
    );
    let preferred = preferring(&with_qform([0.0, 0.0, 0.0, 110.0, -20.0, 30.0], 1.0), Some(NiftiForm::Qform)).unwrap();
    assert_eq!(preferred.into_image(Path::new("a.nii")).unwrap().lps_from_voxel.translation.x, -110.0);
}

#[test]
fn a_form_that_cannot_be_used_is_left_out_and_said() {
    let broken = Nifti { qform: Some(SAME), pixdim: [1.0, -2.0, 3.0, 4.0], ..Nifti::default() };
    let read = map(&broken);
    assert!(read.remarks[0].contains("qform can't be used (header: pixdim has negative"), "{:?}", read.remarks);
    assert!(preferring(&broken, Some(NiftiForm::Qform)).is_err());
    let flat = Some([[0.0; 4]; 3]);
    let file = Nifti { sform: flat, ..with_qform(SAME, 1.0) };
    assert!(preferring(&file, None).is_err());
    assert!(preferring(&file, Some(NiftiForm::Qform)).is_ok());
}

proptest! {
    /// A difference between the forms is never silent: either both forms place a voxel at nearly the same position, or
    /// a message reports the difference.
    #[test]
    fn any_difference_of_the_forms_is_said(
        rotation in [-1.0_f64..1.0, -1.0..1.0, -1.0..1.0],
        small in any::<bool>(),
        origin in [-300.0_f64..300.0, -300.0..300.0, -300.0..300.0],
        at_home in any::<bool>(),
        reversed in any::<bool>(),
    ) {
        let scale = if small { 0.01 } else { 0.57 };
        let [b, c, d] = rotation.map(|part| part * scale);
        let [x, y, z] = if at_home { [-10.0, -20.0, 30.0] } else { origin };
        let file = with_qform([b, c, d, x, y, z], if reversed { -1.0 } else { 1.0 });
        let as_qform = Nifti { sform: None, ..file.clone() };
        let corner = DVec3::new(3.0, 2.0, 1.0);
        let place = |file: &Nifti| {
            let image = decode(file).and_then(|raw| raw.into_image(Path::new("a.nii")));
            image.map(|image| (image.lps_from_voxel.transform_point3(corner), image.remarks))
        };
        let (by_qform, _) = place(&as_qform).unwrap();
        if let Ok((by_sform, remarks)) = place(&file) {
            prop_assert!(by_sform.distance(by_qform) <= 4.0 + 1e-6 || !remarks.is_empty());
        }
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..800), version in 0..3) {
        let mut bytes = bytes;
        let length = [0_u32, 348, 540][version as usize];
        if bytes.len() >= 12 && length > 0 {
            bytes[..4].copy_from_slice(&length.to_le_bytes());
            bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
        }
        let _ = decode_nifti(&bytes, None, ReadOptions { assume_axes: Some(PatientAxes::Ras), ..ReadOptions::default() });
    }

    #[test]
    fn changed_bytes_do_not_panic(
        changes in prop::collection::vec((0_usize..1000, any::<u8>()), 1..6),
        version in 1_u8..3,
        big_endian in any::<bool>(),
        sform in any::<bool>(),
        cut in 0_usize..1000,
    ) {
        let mut file = Nifti { version, big_endian, datatype: 16, ..Nifti::default() };
        file.extensions.push((0, b"<CaretExtension><LabelTable><Label Key='1'>a</Label></LabelTable></CaretExtension>".to_vec()));
        if !sform {
            (file.sform, file.qform) = (None, Some([0.1, 0.2, 0.3, 1.0, 2.0, 3.0]));
        }
        let mut bytes = file.bytes();
        for (at, value) in changes {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        bytes.truncate(bytes.len().saturating_sub(cut / 4));
        if let Ok(raw) = decode_nifti(&bytes, None, ReadOptions::default()) {
            if let Ok(map) = raw.clone().into_labels(Path::new("a.nii")) {
                prop_assert_eq!(map.layers[0].len(), map.size.iter().product::<usize>());
                let _ = map.canonical();
            }
            let image = raw.into_image(Path::new("a.nii")).unwrap();
            prop_assert_eq!(image.values.len(), image.size.iter().product::<usize>());
        }
    }
}
