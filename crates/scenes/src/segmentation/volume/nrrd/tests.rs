use proptest::prelude::*;

use super::super::fixtures::{SIZE, gzipped, labels};
use super::super::{LabelMap, Segment, read_image, read_labels};
use super::*;

const PLACED: &str =
    "space: left-posterior-superior\nspace directions: (2,0,0) (0,3,0) (0,0,4)\nspace origin: (10,20,30)\n";

/// A header of the test volume with `lines` at its end.
fn header(kind: &str, encoding: &str, lines: &str) -> String {
    format!("NRRD0004\n# comment\ntype: {kind}\ndimension: 3\nsizes: 4 3 2\nencoding: {encoding}\n{lines}\n")
}

fn bytes() -> Vec<u8> {
    labels().into_iter().map(|label| label as u8).collect()
}

fn decode(header: &str, data: &[u8]) -> Result<LabelMap, VolumeFault> {
    decode_with(header, data, ReadOptions::default())
}

fn decode_with(header: &str, data: &[u8], options: ReadOptions) -> Result<LabelMap, VolumeFault> {
    decode_nrrd(header.as_bytes(), data, options)?.into_labels(Path::new("a.nrrd"))
}

fn refusal(header: &str, data: &[u8]) -> String {
    decode(header, data).unwrap_err().to_string()
}

fn expected() -> LabelMap {
    decode(&header("uchar", "raw", PLACED), &bytes()).unwrap()
}

#[test]
fn the_affine_and_labels_are_those_of_the_header() {
    let map = expected();
    assert_eq!((map.size, &map.layers), (SIZE, &vec![labels()]));
    let affine = DAffine3::from_scale_rotation_translation(
        DVec3::new(2.0, 3.0, 4.0),
        glam::DQuat::IDENTITY,
        DVec3::new(10.0, 20.0, 30.0),
    );
    assert_eq!(map.lps_from_voxel, affine);
}

#[test]
fn all_types_encodings_and_byte_orders_give_the_same_map() {
    let encode = |width: usize, big: bool| -> Vec<u8> {
        let number = |label: u16| {
            let mut number = u64::from(label).to_le_bytes()[..width].to_vec();
            if big {
                number.reverse();
            }
            number
        };
        labels().into_iter().flat_map(number).collect()
    };
    let text: String = labels().iter().map(|label| format!("{label} ")).collect();
    for (names, width) in [
        (&["signed char", "int8", "int8_t", "uchar", "unsigned char", "uint8", "uint8_t"][..], 1),
        (&["short", "short int", "signed short", "int16_t", "ushort", "unsigned short int", "uint16"], 2),
        (&["int", "signed int", "int32", "uint", "unsigned int", "uint32_t"], 4),
        (&["longlong", "long long int", "int64", "ulonglong", "unsigned long long", "uint64_t"], 8),
    ] {
        for name in names {
            for big in [false, true] {
                let endian = if big { "endian: big\n" } else { "endian: little\n" };
                let data = encode(width, big);
                let lines = format!("{PLACED}{endian}");
                assert_eq!(decode(&header(name, "raw", &lines), &data).unwrap(), expected(), "{name}");
                assert_eq!(decode(&header(name, "gzip", &lines), &gzipped(&data)).unwrap(), expected(), "{name}");
            }
            assert_eq!(decode(&header(name, "ascii", PLACED), text.as_bytes()).unwrap(), expected(), "{name}");
        }
    }
    let floats: Vec<u8> = labels().iter().flat_map(|label| f32::from(*label).to_be_bytes()).collect();
    let lines = format!("{PLACED}endian: big\n");
    assert_eq!(decode(&header("float", "raw", &lines), &floats).unwrap(), expected());
    let doubles: Vec<u8> = labels().iter().flat_map(|label| f64::from(*label).to_le_bytes()).collect();
    let lines = format!("{PLACED}endian: little\n");
    assert_eq!(decode(&header("double", "gz", &lines), &gzipped(&doubles)).unwrap(), expected());
}

#[test]
fn spaces_units_and_origins_are_converted() {
    for (lines, units) in [
        ("space: RAS\nspace directions: (-2,0,0) (0,-3,0) (0,0,4)\nspace origin: (-10,-20,30)\n", ""),
        ("space: LAS\nspace directions: (2,0,0) (0,-3,0) (0,0,4)\nspace origin: (10,-20,30)\n", ""),
        (
            "space: right-anterior-superior\nspace directions: (-2,0,0) (0,-3,0) (0,0,4)\nspace origin: (-10,-20,30)\n",
            "",
        ),
        (PLACED, "space units: \"mm\" \"mm\" \"mm\"\n"),
        (
            "space: LPS\nspace directions: (.002,0,0) (0,.003,0) (0,0,.004)\nspace origin: (.01,.02,.03)\n",
            "space units: \"m\" \"m\" \"m\"\n",
        ),
    ] {
        let map = decode(&header("uchar", "raw", &format!("{lines}{units}")), &bytes()).unwrap();
        assert!(map.lps_from_voxel.abs_diff_eq(expected().lps_from_voxel, 1e-9), "{lines}");
    }
    for (units, factor) in [("\"cm\" \"cm\" \"cm\"", 0.1), ("µm", 1000.0)] {
        let [x, y, z] = [2.0, 3.0, 4.0].map(|mm| mm * factor);
        let [a, b, c] = [10.0, 20.0, 30.0].map(|mm| mm * factor);
        let lines = format!(
            "space: LPS\nspace directions: ({x},0,0) (0,{y},0) (0,0,{z})\nspace origin: ({a},{b},{c})\nspace units: {units}\n"
        );
        let map = decode(&header("uchar", "raw", &lines), &bytes()).unwrap();
        assert!(map.lps_from_voxel.abs_diff_eq(expected().lps_from_voxel, 1e-9), "{lines}");
    }
    let mixed = format!("{PLACED}space units: \"mm\" \"mm\" \"cm\"\n");
    assert!(refusal(&header("uchar", "raw", &mixed), &bytes()).contains("differ among the axes: mm mm cm"));
    let units = format!("{PLACED}space units: \"furlong\"\n");
    assert!(refusal(&header("uchar", "raw", &units), &bytes()).contains("`furlong`"));
}

#[test]
fn files_without_patient_axes_need_them_assumed() {
    let spacings = header("uchar", "raw", "spacings: 2 3 4\n");
    let scanner = header(
        "uchar",
        "raw",
        "space: scanner-xyz\nspace directions: (2,0,0) (0,3,0) (0,0,4)\nspace origin: (10,20,30)\n",
    );
    let dimension = header("uchar", "raw", "space dimension: 3\nspace directions: (2,0,0) (0,3,0) (0,0,4)\n");
    for text in [&spacings, &scanner, &dimension] {
        let error = refusal(text, &bytes());
        assert!(error.contains("doesn't state where its axes point") && error.contains("--assume-axes"), "{error}");
    }
    assert!(refusal(&spacings, &bytes()).contains("(`spacings`, but no `space directions`)"));
    let neither = refusal(&header("uchar", "raw", ""), &bytes());
    assert!(neither.contains("(neither `space directions` nor `spacings`)"), "{neither}");
    assert!(neither.contains("--assume-axes las"), "{neither}");
    let assume = |text: &str| {
        decode_with(text, &bytes(), ReadOptions { assume_axes: Some(PatientAxes::Ras), ..ReadOptions::default() })
            .unwrap()
    };
    assert_eq!(assume(&spacings).lps_from_voxel, DAffine3::from_scale(DVec3::new(-2.0, -3.0, 4.0)));
    assert_eq!(assume(&scanner).lps_from_voxel.translation, DVec3::new(-10.0, -20.0, 30.0));
    assert!(refusal(&header("uchar", "raw", "space: up\n"), &bytes()).contains("`space: up`"));
}

#[test]
fn layers_of_a_list_axis_come_apart() {
    let data: Vec<u8> = bytes().into_iter().flat_map(|label| [label, 1]).collect();
    let text = "NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 2 4 3 2\n\
                space directions: none (2,0,0) (0,3,0) (0,0,4)\nkinds: list domain domain domain\nencoding: gzip\n\
                space origin: (10,20,30)\nSegment0_Name:=all\nSegment0_LabelValue:=1\nSegment0_Layer:=1\n\n";
    let map = decode(text, &gzipped(&data)).unwrap();
    assert_eq!(map.layers, [labels(), vec![1; 24]]);
    assert_eq!((map.size, map.lps_from_voxel), (SIZE, expected().lps_from_voxel));
    let all = Segment { layer: 1, value: 1, name: Some("all".into()), colour: None, terminology: None };
    assert_eq!((map.segments.len(), &map.segments[0]), (24, &all));
    let raw = decode_nrrd(text.as_bytes(), &gzipped(&data), ReadOptions::default()).unwrap();
    assert!(raw.into_image(Path::new("a")).unwrap_err().to_string().contains("2 values per voxel"));
    let third = text.replace("Segment0_Layer:=1", "Segment0_Layer:=2");
    assert!(refusal(&third, &gzipped(&data)).contains("segment `all` is in layer 2, and the file has 2"));
    let colours = text.replace("kinds: list", "kinds: vector").replace("Segment0_", "x_");
    assert!(refusal(&colours, &gzipped(&data)).contains("axis 0 of kind vector"));
    for (layers, says) in [(513, "it has 513 layers; at most 512 are read"), (512, "truncated")] {
        let many = text.replace("sizes: 2 4", &format!("sizes: {layers} 4"));
        assert!(refusal(&many, &gzipped(&data)).contains(says), "{layers}");
    }
    let movie = text.replace("none (2,0,0)", "(2,0,0) (2,0,0)");
    assert!(refusal(&movie, &gzipped(&data)).contains("4 axes of space"));
}

#[test]
fn detached_data_is_found_beside_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let read = |lines: &str, encoding: &str, data: &[u8]| {
        std::fs::write(folder.path().join("a.raw"), data).unwrap();
        let path = folder.path().join("a.nhdr");
        let text = header("uchar", encoding, &format!("{PLACED}{lines}data file: a.raw\n"));
        std::fs::write(&path, text.trim_end()).unwrap();
        read_labels(&path, ReadOptions::default()).map(|map| map.layers)
    };
    assert_eq!(read("", "raw", &bytes()).unwrap(), [labels()]);
    assert_eq!(read("byte skip: 3\n", "raw", &[&[9; 3], &bytes()[..]].concat()).unwrap(), [labels()]);
    assert_eq!(read("byteskip: -1\n", "raw", &[&[9; 300], &bytes()[..]].concat()).unwrap(), [labels()]);
    assert_eq!(read("line skip: 2\n", "raw", &[b"a\nbcd\n", &bytes()[..]].concat()).unwrap(), [labels()]);
    let packed = gzipped(&[&[9; 3], &bytes()[..]].concat());
    let skips = "line skip: 1\nbyte skip: 3\n";
    assert_eq!(read(skips, "gzip", &[b"a\n", &packed[..]].concat()).unwrap(), [labels()]);
    let error = read("", "raw", &bytes()[..20]).unwrap_err().to_string();
    assert!(error.contains("a.nhdr: data file ") && error.contains("a.raw: truncated: the voxels"), "{error}");
    let error = read("line skip: 99\n", "raw", &bytes()).unwrap_err().to_string();
    assert!(error.contains("line skip is 99"), "{error}");
    let missing = folder.path().join("b.nhdr");
    std::fs::write(&missing, header("uchar", "raw", &format!("{PLACED}data file: none.raw\n"))).unwrap();
    let error = read_labels(&missing, ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("none.raw: can't be read"), "{error}");
}

#[test]
fn a_data_file_out_of_the_folder_is_refused_and_nothing_of_it_is_quoted() {
    let folder = tempfile::tempdir().unwrap();
    let secret = folder.path().join("secret");
    std::fs::write(&secret, "hunter2 hunter3").unwrap();
    let own = folder.path().join("own");
    std::fs::create_dir(&own).unwrap();
    let read = |name: &str, encoding: &str| {
        let path = own.join("a.nhdr");
        std::fs::write(&path, header("uchar", encoding, &format!("{PLACED}data file: {name}\n"))).unwrap();
        read_labels(&path, ReadOptions::default()).unwrap_err().to_string()
    };
    let absolute = secret.to_str().unwrap();
    for encoding in ["text", "raw", "gzip"] {
        for name in ["../secret", absolute, "./../secret"] {
            let error = read(name, encoding);
            assert!(error.contains("leads out of the folder; copy the file into it"), "{error}");
            assert!(!error.contains("hunter"), "{error}");
        }
    }
    // Files in the folder may be links to private files, so errors don't quote their content.
    std::fs::write(own.join("notes"), "hunter2").unwrap();
    let error = read("notes", "text");
    assert!(error.contains("value 0 of the text data is not a number") && !error.contains("hunter"), "{error}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&secret, own.join("link")).unwrap();
        assert!(read("link", "text").contains("a link leads out of the folder"));
        nix::unistd::mkfifo(&own.join("pipe"), nix::sys::stat::Mode::S_IRWXU).unwrap();
        // Opening the pipe would block.
        assert!(read("pipe", "raw").contains("pipe: not a file"));
        assert!(read("/dev/zero", "raw").contains("leads out of the folder"));
    }
}

#[test]
fn a_volume_beyond_the_memory_is_refused_by_its_header() {
    let sizes =
        |text: &str| text.replace("sizes: 4 3 2", "sizes: 1024 1024 1024").replace("type: uchar", "type: float");
    let text = sizes(&header("uchar", "gzip", &format!("{PLACED}endian: little\n")));
    // The header of a file of a few bytes announces 4 GiB of voxels.
    let error = refusal(&text, &gzipped(&[0; 1000]));
    let is_short = error.contains("truncated: the voxels: 4294967296 bytes expected, 1000 found");
    assert!(is_short || error.contains("it needs about 8.6 GB of memory"), "{error}");
}

#[test]
fn stand_ins_and_pointers_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (name, content, says) in [
        ("a.nrrd", "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n", "git lfs pull"),
        ("a.nii.gz", "<!DOCTYPE html>\n<html>", "web page (HTML)"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        for error in [
            read_labels(&path, ReadOptions::default()).map(|_| ()).unwrap_err(),
            read_image(&path, ReadOptions::default()).map(|_| ()).unwrap_err(),
        ] {
            assert!(error.to_string().contains(says), "{error}");
        }
    }
}

#[test]
fn vectors_of_nan_are_axes_that_are_not_of_space() {
    let data: Vec<u8> = bytes().into_iter().flat_map(|label| [label, 1]).collect();
    let text = "NRRD0005\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 2 4 3 2\n\
                space directions: (nan,NaN,nan) (2,0,0) (0,3,0) (0,0,4)\nkinds: list domain domain domain\nencoding: raw\n\
                space origin: (10,20,30)\n\n";
    let map = decode(text, &data).unwrap();
    assert_eq!(map.layers, [labels(), vec![1; 24]]);
    let some = text.replace("(nan,NaN,nan)", "(nan,0,1)").replace("sizes: 2", "sizes: 1").replace("list", "domain");
    assert!(decode(&some, &bytes()).is_err());
}

#[test]
fn a_header_in_latin_1_is_read_and_said() {
    let mut text =
        header("uchar", "raw", &format!("{PLACED}Segment0_Name:=Leber X\nSegment0_LabelValue:=5\n")).into_bytes();
    let at = text.windows(7).position(|part| part == b"Leber X").unwrap() + 6;
    text[at] = 0xf6;
    let map = decode_nrrd(&text, &bytes(), ReadOptions::default()).unwrap().into_labels(Path::new("a")).unwrap();
    assert_eq!(map.segments[0].name.as_deref(), Some("Leber ö"));
    assert_eq!(map.remarks, [format!("its header isn't UTF-8 (byte {at}): names were read as Latin-1")]);
}

#[test]
fn a_field_that_stands_twice_is_refused_where_its_values_differ() {
    let twice = header("uchar", "raw", &format!("{PLACED}sizes: 2 3 4\n"));
    assert!(refusal(&twice, &bytes()).contains("`sizes` stands there twice, as `4 3 2` and as `2 3 4`"));
    let same = header("uchar", "raw", &format!("{PLACED}sizes: 4 3 2\n"));
    assert_eq!(decode(&same, &bytes()).unwrap(), expected());
}

#[test]
fn missing_and_surplus_bytes_are_refused_with_the_expected_count() {
    let text = header("uchar", "raw", PLACED);
    assert!(refusal(&text, &bytes()[..23]).contains("the voxels: 24 bytes expected, 23 found"));
    assert!(refusal(&text, &[&bytes()[..], &[0]].concat()).contains("longer than the 24 bytes"));
    let packed = header("uchar", "gzip", PLACED);
    assert!(refusal(&packed, &gzipped(&bytes()[..23])).contains("24 bytes expected, 23 found"));
    assert!(refusal(&packed, &gzipped(&[&bytes()[..], &[0]].concat())).contains("longer than the 24 bytes"));
    assert!(refusal(&packed, b"these bytes are not gzip data").contains("gzip data is damaged"));
    let text = header("uchar", "ascii", PLACED);
    assert!(refusal(&text, b"1 2 3").contains("3 values, and `sizes` make 24"));
    assert!(refusal(&text, b"1 2 x").contains("value 2 of the text data is `x`"));
}

#[test]
fn wrong_headers_are_refused_by_field() {
    let usual = header("uchar", "raw", PLACED);
    for (from, to, says) in [
        ("(0,0,4)", "(0,0,4", "it must be vectors of three numbers, as (1,0,0)"),
        ("type: uchar", "type: quaternion", "`type: quaternion`"),
        ("type: uchar\n", "", "the field `type` is missing"),
        ("type: uchar", "type: short", "`endian` is missing"),
        ("type: uchar", "type: block", "`type: block`"),
        ("encoding: raw", "encoding: bzip2", "raw or gzip"),
        ("encoding: raw\n", "encoding: gzip\nbyte skip: -1\n", "`byte skip: -1`"),
        ("encoding: raw\n", "encoding: raw\nbyte skip: -2\n", "`byte skip: -2`"),
        ("sizes: 4 3 2", "sizes: 4 3", "`sizes` has 2 numbers"),
        ("sizes: 4 3 2", "sizes: 4 3 -2", "`sizes: 4 3 -2` can't be read"),
        ("sizes: 4 3 2", "sizes: 99999 99999 99999", "at most 1073741824"),
        ("(0,0,4)", "(0,0,0.004)", "0.004 mm apart along axis k"),
        ("(0,0,4)", "(0,3,0)", "in one plane"),
        ("(0,0,4)", "", "`space directions` has 2"),
        ("space origin: (10,20,30)", "space origin: none", "`space origin` needs one vector"),
        ("encoding: raw\n", "encoding: raw\ndata file: LIST\n", "one .nrrd file"),
    ] {
        let text = usual.replace(from, to);
        assert_ne!(text, usual, "{from}");
        let length = text.len() as u64 + 24;
        let whole = [text.as_bytes(), &bytes()[..]].concat();
        let read = read_nrrd(&whole[..], length, Path::new(""), ReadOptions::default());
        let error = read.unwrap_err().to_string();
        assert!(error.contains(says), "{says}: {error}");
    }
}

#[test]
fn slicerios_example_is_read() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/segmentation/Segmentation.seg.nrrd");
    let map = read_labels(&path, ReadOptions::default()).unwrap();
    assert_eq!(map.size, [128, 128, 34]);
    let named: Vec<_> = map.segments.iter().filter_map(|s| Some((s.value, s.name.as_deref()?))).collect();
    assert_eq!(named.len(), map.segments.len(), "every label in the voxels has a name");
    assert_eq!(named[..2], [(1, "ribs"), (2, "cervical vertebral column")]);
    assert_eq!(map.segments[0].terminology.as_deref(), Some("Rib"));
    assert_eq!(map.segments[0].colour, Some([253, 232, 158]));
    let origin = DVec3::new(193.095_993_042, 216.395_996_094, -340.25);
    assert!(map.lps_from_voxel.translation.abs_diff_eq(origin, 1e-9));
    let image = read_image(&path, ReadOptions::default()).unwrap().canonical();
    assert!((0..3).all(|axis| image.lps_from_voxel.matrix3.col(axis)[axis] > 0.0));
}

proptest! {
    #[test]
    fn arbitrary_headers_do_not_panic(text in "NRRD0004\n([a-z ]{0,12}(: |:=)[0-9a-z(), .-]{0,20}\n){0,8}", data in any::<[u8; 32]>()) {
        let _ = decode_with(&text, &data, ReadOptions { assume_axes: Some(PatientAxes::Ras), ..ReadOptions::default() });
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let whole = [b"NRRD0004\n", &bytes[..]].concat();
        let _ = read_nrrd(&whole[..], whole.len() as u64, Path::new("/nowhere"), ReadOptions::default());
    }

    #[test]
    fn changed_bytes_do_not_panic(
        changes in prop::collection::vec((0_usize..1000, 32_u8..127), 1..5),
        gzip in any::<bool>(),
        cut in 0_usize..40,
    ) {
        let lines = format!("{PLACED}kinds: domain domain domain\nbyte skip: 0\nSegment0_Name:=a\nSegment0_Layer:=0\n");
        let mut text = header("uchar", if gzip { "gzip" } else { "raw" }, &lines).into_bytes();
        for (at, value) in changes {
            let at = at % text.len();
            text[at] = value;
        }
        let data = if gzip { gzipped(&bytes()) } else { bytes() };
        let data = &data[..data.len().saturating_sub(cut / 2)];
        if let Ok(raw) = decode_nrrd(&text, data, ReadOptions::default())
            && let Ok(map) = raw.into_labels(Path::new("a.nrrd")) {
            prop_assert!(map.layers.iter().all(|layer| layer.len() == map.size.iter().product::<usize>()));
            let _ = map.canonical();
        }
    }
}
