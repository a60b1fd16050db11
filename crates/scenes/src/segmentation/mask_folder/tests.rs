use std::fs;

use super::*;

const SIZE: [usize; 3] = [6, 5, 4];

/// A NRRD file of bytes in LPS, with voxels of 2 mm that begin at `origin`.
fn mask(size: [usize; 3], origin: f64, value_at: impl Fn(usize) -> u8) -> Vec<u8> {
    let [x, y, z] = size;
    let header = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: left-posterior-superior\nsizes: {x} {y} {z}\n\
         space directions: (2,0,0) (0,2,0) (0,0,2)\nkinds: domain domain domain\nencoding: raw\n\
         space origin: ({origin},0,0)\n\n"
    );
    let voxels: Vec<u8> = (0..x * y * z).map(value_at).collect();
    [header.into_bytes(), voxels].concat()
}

/// A mask of the voxels with indices from `low` to below `high`.
fn between(low: usize, high: usize) -> Vec<u8> {
    mask(SIZE, 0.0, |i| u8::from((low..high).contains(&i)))
}

fn folder(files: &[(&str, Vec<u8>)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, bytes)| fs::write(folder.path().join(name), bytes).unwrap());
    folder
}

fn read_with(files: &[(&str, Vec<u8>)], maps: &[&str], leave_out: bool) -> Result<MaskFolder, MaskFolderError> {
    let mut table = ClassTable::builtin("total-v2").unwrap();
    maps.iter().for_each(|map| table.add(map).unwrap());
    read_mask_folder(folder(files).path(), &table, ReadOptions::default(), leave_out, &|_, _| ())
}

fn read(files: &[(&str, Vec<u8>)]) -> Result<MaskFolder, MaskFolderError> {
    read_with(files, &[], false)
}

fn refusal(files: &[(&str, Vec<u8>)]) -> String {
    read(files).unwrap_err().to_string()
}

#[test]
fn masks_become_one_map_with_the_names_of_the_files() {
    let files = [
        ("liver.nrrd", between(0, 40)),
        ("aorta.nrrd", between(30, 50)),
        ("spleen.nrrd", between(35, 60)),
        ("colon.nrrd", between(0, 0)),
        ("body.nrrd", between(0, 100)),
        ("statistics.json", b"{}".to_vec()),
        ("._liver.nrrd", b"macOS".to_vec()),
    ];
    let MaskFolder { labels, names, left_out, remarks } = read(&files).unwrap();
    let of = |name: &str| labels.segments.iter().find(|s| s.name.as_deref() == Some(name)).unwrap();
    let count = |name: &str| labels.layers[of(name).layer].iter().filter(|label| **label == of(name).value).count();
    // The vessel keeps the shared voxels. Liver and spleen have equal priority, and the liver comes first.
    assert_eq!(["aorta", "liver", "spleen", "body"].map(count), [20, 30, 10, 100]);
    assert_ne!(of("body").layer, of("liver").layer);
    assert_eq!((labels.segments.len(), labels.size, left_out.len()), (4, SIZE, 0));
    assert_eq!(names, NamesFrom::Folder { files: 5, without: String::new() });
    assert!(remarks[0].starts_with("1 mask without a voxel") && remarks[1].starts_with("25 voxels"), "{remarks:?}");
}

#[test]
fn a_mask_of_which_others_hold_all_is_named() {
    let files = [("liver.nrrd", between(0, 40)), ("spleen.nrrd", between(0, 40)), ("aorta.nrrd", between(50, 60))];
    let remarks = read(&files).unwrap().remarks;
    let [shared, covered] = &remarks[..] else { panic!("{remarks:?}") };
    assert!(shared.starts_with("40 voxels in several masks"), "{shared}");
    assert!(covered.starts_with("no voxel of `spleen` is left"), "{covered}");
}

#[test]
fn names_are_known_without_the_words_that_all_files_share() {
    let files = [("smith_liver.nrrd", between(0, 9)), ("smith_spleen.nrrd", between(9, 20))];
    let found = read(&files).unwrap();
    assert_eq!(found.names.to_string(), "names from the names of 2 files, without `smith`");
    assert_eq!(found.labels.segments[1].name.as_deref(), Some("spleen"));
    let found = read(&[("smithLiver.nrrd", between(0, 9)), ("smithSpleen.nrrd", between(9, 20))]).unwrap();
    assert_eq!(found.names.to_string(), "names from the names of 2 files, without `smith`");
}

#[test]
fn unknown_names_are_refused_mapped_or_left_out() {
    let files = [("liver.nrrd", between(0, 9)), ("spleeen.nrrd", between(9, 20)), ("ct.nrrd", between(0, 1))];
    let error = refusal(&files);
    for word in ["`spleeen` is no known class (did you mean `spleen`", "`ct`", "--map", "--leave-out-unknown"] {
        assert!(error.contains(word), "{word}: {error}");
    }
    let found = read_with(&files, &["spleeen=spleen", "ct=ignore"], false).unwrap();
    assert_eq!((found.labels.segments.len(), found.left_out.len()), (2, 0));
    let found = read_with(&files, &[], true).unwrap();
    assert_eq!((found.labels.segments.len(), found.left_out.len()), (1, 2));
}

#[test]
fn masks_that_do_not_fit_are_refused_by_name() {
    let liver = || ("liver.nrrd", between(0, 9));
    let several = mask(SIZE, 0.0, |i| (i % 3) as u8);
    for (file, words) in [
        (
            ("spleen.nrrd", mask([6, 5, 3], 0.0, |_| 1)),
            &["spleen.nrrd has 6 × 5 × 3 voxels", "liver.nrrd has 6 × 5 × 4"][..],
        ),
        (("spleen.nrrd", mask(SIZE, 0.5, |_| 1)), &["spleen.nrrd has", "from (0.5, 0.0, 0.0)", "one grid"]),
        (("spleen.nrrd", several), &["spleen.nrrd has the labels 1, 2", "one organ each"]),
        (("spleen.nrrd", between(0, 9)[..250].to_vec()), &["spleen.nrrd: truncated"]),
        (("spleen.nrrd", b"hello".to_vec()), &["spleen.nrrd: neither"]),
        (("case1_liver.nrrd", between(0, 9)), &["`case1_liver.nrrd` and `liver.nrrd` are both `liver`", "--map"]),
    ] {
        let error = refusal(&[liver(), file]);
        words.iter().for_each(|word| assert!(error.contains(word), "{word}: {error}"));
    }
    // The same grid, apart from rounding to 32 bits.
    assert!(read(&[liver(), ("spleen.nrrd", mask(SIZE, 1e-4, |_| 1))]).is_ok());
    assert!(refusal(&[("liver.nrrd", between(0, 0))]).contains("its one mask is empty"));
    let empty = refusal(&[("liver.nrrd", between(0, 0)), ("spleen.nrrd", between(0, 0))]);
    assert!(empty.contains("all 2 masks are empty"), "{empty}");
}

#[test]
fn masks_that_are_all_left_out_are_refused_with_the_reason() {
    let ignored = |files: &[(&str, Vec<u8>)], maps: &[&str]| read_with(files, maps, true).unwrap_err().to_string();
    let liver = || ("liver.nrrd", between(0, 9));
    let error = ignored(&[liver()], &["liver=ignore"]);
    assert!(error.contains("its one mask is ignored"), "{error}");
    let error = ignored(&[liver(), ("spleen.nrrd", between(9, 20))], &["liver=ignore", "spleen=ignore"]);
    assert!(error.contains("all 2 masks are ignored"), "{error}");
    let error = ignored(&[liver(), ("spleeen.nrrd", between(9, 20))], &["liver=ignore"]);
    assert!(error.contains("`spleeen` is no known class (did you mean `spleen`"), "{error}");
}

#[test]
fn a_folder_without_masks_says_what_it_has() {
    let mut dicom = vec![0; 128];
    dicom.extend(b"DICM");
    let error = refusal(&[("IM0001", dicom)]);
    assert!(error.contains("1 file of DICOM") && error.contains("dcm2niix") && error.contains("--ml"), "{error}");
    assert!(refusal(&[]).contains("it is empty") && refusal(&[("a.txt", vec![1])]).contains("of other kinds"));
    let outer = tempfile::tempdir().unwrap();
    let within = outer.path().join("segmentations");
    fs::create_dir(&within).unwrap();
    fs::write(within.join("liver.nii.gz"), b"").unwrap();
    let table = ClassTable::builtin("total-v2").unwrap();
    let error =
        read_mask_folder(outer.path(), &table, ReadOptions::default(), false, &|_, _| ()).unwrap_err().to_string();
    assert!(error.contains("segmentations has some"), "{error}");
}

#[test]
fn what_is_left_out_of_a_folder_with_a_body_is_said() {
    let table = ClassTable::builtin("total-v2").unwrap();
    let files = [("body.nrrd", between(5, 90)), ("skin.nrrd", between(0, 0)), ("spleeen.nrrd", between(0, 9))];
    let body = read_body_folder(folder(&files).path(), &table, ReadOptions::default(), &|_, _| ()).unwrap();
    let [empty, unknown] = &body.remarks[..] else { panic!("{:?}", body.remarks) };
    assert!(empty == "1 mask without a voxel" && unknown.starts_with("left out: the name of `spleeen`"), "{unknown}");
}

#[test]
fn bodies_are_read_from_a_folder_of_masks() {
    let table = ClassTable::builtin("total-v2").unwrap();
    let files = [("body_trunc.nrrd", between(5, 90)), ("skin.nrrd", between(0, 20)), ("liver.nrrd", between(100, 110))];
    let body = read_body_folder(folder(&files).path(), &table, ReadOptions::default(), &|_, _| ()).unwrap();
    let is_body = |i: usize| body.layers.iter().any(|layer| layer[i] != 0);
    assert!(is_body(0) && is_body(89) && !is_body(95) && !is_body(105));
    let error = read_body_folder(folder(&files[2..]).path(), &table, ReadOptions::default(), &|_, _| ()).unwrap_err();
    assert!(error.to_string().contains("no mask that is called body or skin; it has liver"), "{error}");
}
