use glam::{DAffine3, DVec3};

use super::super::volume::Segment;
use super::*;

/// Organs of an adult: class, volume in ml, and centre (LPS, mm).
const ADULT: [(&str, f64, [f64; 3]); 61] = [
    ("liver", 1500.0, [-60.0, 0.0, 0.0]),
    ("liver_tumour", 25.0, [-80.0, 10.0, 20.0]),
    ("spleen", 200.0, [100.0, 45.0, 10.0]),
    ("kidney_left", 160.0, [70.0, 60.0, -50.0]),
    ("kidney_right", 150.0, [-65.0, 60.0, -60.0]),
    ("kidney", 310.0, [4.0, 60.0, -55.0]),
    ("kidney_tumour", 15.0, [-70.0, 55.0, -40.0]),
    ("kidney_cyst", 4.0, [-60.0, 60.0, -80.0]),
    ("gallbladder", 30.0, [-50.0, -40.0, -40.0]),
    ("stomach", 300.0, [50.0, -10.0, 10.0]),
    ("pancreas", 75.0, [15.0, 10.0, -20.0]),
    ("adrenal_gland_left", 4.5, [45.0, 50.0, -5.0]),
    ("adrenal_gland_right", 4.0, [-40.0, 50.0, -5.0]),
    ("adrenal_gland", 8.5, [4.0, 50.0, -5.0]),
    ("esophagus", 35.0, [8.0, 50.0, 120.0]),
    ("aorta", 180.0, [12.0, 48.0, 60.0]),
    ("inferior_vena_cava", 70.0, [-18.0, 40.0, -40.0]),
    ("portal_vein_and_splenic_vein", 30.0, [5.0, 20.0, -10.0]),
    ("duodenum", 60.0, [-25.0, 10.0, -50.0]),
    ("small_bowel", 700.0, [10.0, -20.0, -130.0]),
    ("colon", 800.0, [5.0, -10.0, -110.0]),
    ("rectum", 60.0, [0.0, 50.0, -270.0]),
    ("urinary_bladder", 250.0, [0.0, -20.0, -260.0]),
    ("prostate", 30.0, [0.0, 0.0, -300.0]),
    ("heart", 650.0, [25.0, -40.0, 120.0]),
    ("heart_myocardium", 120.0, [35.0, -40.0, 115.0]),
    ("heart_atrium_left", 80.0, [15.0, 0.0, 130.0]),
    ("heart_ventricle_left", 130.0, [45.0, -40.0, 115.0]),
    ("heart_atrium_right", 90.0, [-20.0, -30.0, 125.0]),
    ("heart_ventricle_right", 150.0, [15.0, -60.0, 110.0]),
    ("pulmonary_artery", 70.0, [10.0, -10.0, 160.0]),
    ("trachea", 40.0, [0.0, 30.0, 220.0]),
    ("lung_upper_lobe_left", 1100.0, [80.0, -5.0, 170.0]),
    ("lung_lower_lobe_left", 1000.0, [80.0, 50.0, 110.0]),
    ("lung_upper_lobe_right", 1000.0, [-75.0, 0.0, 190.0]),
    ("lung_middle_lobe_right", 400.0, [-75.0, -40.0, 110.0]),
    ("lung_lower_lobe_right", 1200.0, [-75.0, 50.0, 110.0]),
    ("lung_left", 2100.0, [80.0, 20.0, 140.0]),
    ("lung_right", 2600.0, [-75.0, 15.0, 140.0]),
    ("vertebrae_L5", 65.0, [0.0, 70.0, -180.0]),
    ("vertebrae_L3", 62.0, [0.0, 70.0, -100.0]),
    ("vertebrae_L1", 55.0, [0.0, 75.0, -30.0]),
    ("vertebrae_T12", 48.0, [0.0, 80.0, 0.0]),
    ("vertebrae_T6", 28.0, [0.0, 95.0, 150.0]),
    ("sacrum", 220.0, [0.0, 80.0, -230.0]),
    ("iliac_artery_left", 12.0, [35.0, 30.0, -220.0]),
    ("iliac_artery_right", 12.0, [-35.0, 30.0, -220.0]),
    ("hip_left", 380.0, [90.0, 30.0, -250.0]),
    ("hip_right", 380.0, [-90.0, 30.0, -250.0]),
    ("femur_left", 150.0, [110.0, 20.0, -320.0]),
    ("femur_right", 150.0, [-110.0, 20.0, -320.0]),
    ("cerebral_white_matter_left", 230.0, [28.0, 0.0, 500.0]),
    ("cerebral_white_matter_right", 230.0, [-28.0, 0.0, 500.0]),
    ("cerebral_cortex_left", 260.0, [35.0, 0.0, 500.0]),
    ("cerebral_cortex_right", 260.0, [-35.0, 0.0, 500.0]),
    ("lateral_ventricle_left", 8.0, [12.0, 0.0, 500.0]),
    ("lateral_ventricle_right", 8.0, [-12.0, 0.0, 500.0]),
    ("cerebellum_cortex_left", 52.0, [25.0, 60.0, 440.0]),
    ("cerebellum_cortex_right", 52.0, [-25.0, 60.0, 440.0]),
    ("thalamus_left", 7.0, [12.0, 10.0, 490.0]),
    ("brain_stem", 21.0, [0.0, 30.0, 440.0]),
];

type Measures = BTreeMap<(usize, u16), Measure>;

fn label_map(segments: Vec<Segment>) -> LabelMap {
    LabelMap {
        path: "a.nii".into(),
        size: [1; 3],
        lps_from_voxel: DAffine3::IDENTITY,
        layers: Vec::new(),
        segments,
        remarks: Vec::new(),
    }
}

/// Label map without names, and its measures: the adult's organs that a table has and `only` accepts, with the table's
/// numbers. Centres are multiplied by `by`.
fn numbered(convention: &str, by: DVec3, only: impl Fn(&str) -> bool) -> (LabelMap, Measures) {
    let table = ClassTable::numbers_of(convention).unwrap();
    let (mut segments, mut measures) = (Vec::new(), Measures::new());
    for class in table.classes().iter().filter(|class| only(&class.name)) {
        let known = ADULT.iter().find(|(name, ..)| *name == class.name);
        let (Some((_, volume_ml, centre)), Some(value)) = (known, class.value) else { continue };
        let centre_mm = DVec3::from_array(*centre) * by;
        segments.push(Segment { layer: 0, value, name: None, colour: None, terminology: None });
        let voxels = (volume_ml * 1e3) as u64;
        measures.insert((0, value), Measure { voxels, volume_ml: *volume_ml, centre_mm, is_cut: false });
    }
    assert!(segments.len() >= 2, "{convention}");
    (label_map(segments), measures)
}

fn names(called: &str, is_chosen: bool) -> (NameTable, NamesFrom) {
    let table = ClassTable::builtin(called).unwrap();
    let from = NamesFrom::Numbers { table: called.to_owned(), is_chosen };
    (NameTable { table, called: called.to_owned(), is_chosen }, from)
}

#[test]
fn each_convention_fits_itself_and_the_default_refuses_all_others_by_name() {
    let (default, from) = names("total-v2", false);
    for convention in ClassTable::builtin_names().filter(|name| !BODY_TABLES.contains(name)) {
        let (labels, measures) = numbered(convention, DVec3::ONE, |_| true);
        let (own, own_from) = names(convention, true);
        let found = plausibility(&labels, &measures, &own, &own_from);
        assert_eq!((found.findings.as_slice(), found.likelier.as_slice()), (&[][..], &[][..]), "{convention}");
        assert!(found.check(&labels, &own, &own_from).is_ok());
        if convention == "total-v2" {
            continue;
        }
        let found = plausibility(&labels, &measures, &default, &from);
        let error = found.check(&labels, &default, &from).unwrap_err().to_string();
        assert_eq!(found.likelier.first(), Some(&convention), "{error}");
        for word in ["a.nii", "numbers of total-v2", &format!("fit --names {convention}"), "--allow-implausible"] {
            assert!(error.contains(word), "{word}: {error}");
        }
    }
}

#[test]
fn a_part_of_the_default_convention_is_taken() {
    let (default, from) = names("total-v2", false);
    let parts: [&[&str]; 5] = [
        &["spleen", "kidney_right", "kidney_left", "liver"],
        &["spleen", "kidney_right"],
        &["liver", "gallbladder"],
        &["urinary_bladder", "prostate", "sacrum", "hip_left", "hip_right"],
        &["vertebrae_L5", "vertebrae_L3", "aorta"],
    ];
    for part in parts {
        let (labels, measures) = numbered("total-v2", DVec3::ONE, |name| part.contains(&name));
        let found = plausibility(&labels, &measures, &default, &from);
        assert!(found.check(&labels, &default, &from).is_ok() && found.likelier.is_empty(), "{part:?}: {found:?}");
    }
}

#[test]
fn few_organs_of_the_table_for_mr_are_refused_by_its_name() {
    let (default, from) = names("total-v2", false);
    let parts: [&[&str]; 2] = [&["urinary_bladder", "aorta", "inferior_vena_cava"], &["urinary_bladder"]];
    for more in parts {
        let usual = ["spleen", "kidney_right", "kidney_left", "gallbladder", "liver"];
        let (labels, measures) = numbered("total-mr", DVec3::ONE, |name| usual.contains(&name) || more.contains(&name));
        let found = plausibility(&labels, &measures, &default, &from);
        let error = found.check(&labels, &default, &from).unwrap_err().to_string();
        assert_eq!(found.likelier.first(), Some(&"total-mr"), "{error}");
        assert!(error.contains("--names total-mr") && !error.contains("Mirrored?"), "{error}");
    }
}

#[test]
fn a_chosen_table_is_doubted_and_used() {
    // As spleen and kidney, the labels would be unusually large and small. Liver and liver tumour are likelier.
    let (labels, measures) = numbered("lits", DVec3::ONE, |_| true);
    let (chosen, from) = names("total-v2", true);
    let found = plausibility(&labels, &measures, &chosen, &from);
    assert!(found.check(&labels, &chosen, &from).is_ok(), "{found:?}");
    let remarks = found.remarks(&chosen, false);
    assert!(remarks.len() == 1 && remarks[0].starts_with("the numbers fit --names lits"), "{remarks:?}");
}

/// Label map with the labels 1, 2 and so on without names, and its measures: volumes (ml) and centres.
fn numbers(measured: &[(f64, [f64; 3])]) -> (LabelMap, Measures) {
    let (mut segments, mut measures) = (Vec::new(), Measures::new());
    for (value, (volume_ml, centre)) in (1..).zip(measured) {
        segments.push(Segment { layer: 0, value, name: None, colour: None, terminology: None });
        let centre_mm = DVec3::from_array(*centre);
        measures.insert((0, value), Measure { voxels: 1000, volume_ml: *volume_ml, centre_mm, is_cut: false });
    }
    (label_map(segments), measures)
}

#[test]
fn a_liver_and_its_large_tumour_are_refused_as_spleen_and_kidney() {
    let (labels, measures) = numbers(&[(1400.0, [-60.0, 0.0, 0.0]), (60.0, [-80.0, 10.0, 20.0])]);
    let (default, from) = names("total-v2", false);
    let found = plausibility(&labels, &measures, &default, &from);
    assert!(found.likelier.contains(&"lits") && found.as_likely.is_empty(), "{found:?}");
    let error = found.check(&labels, &default, &from).unwrap_err().to_string();
    assert!(error.contains("lits"), "{error}");
    assert!(found.findings.iter().all(|finding| finding.certainty == Certainty::Unlikely), "{found:?}");
    assert!(error.contains("the labels are unlikely: ") && !error.contains("not those of a human"), "{error}");
}

#[test]
fn few_numbers_that_other_tables_fit_as_well_are_told_unless_the_table_was_chosen() {
    // Either both kidneys and a tumour of the right one, or a spleen and a right kidney.
    let (labels, measures) = numbers(&[(310.0, [4.0, 60.0, -55.0]), (40.0, [-70.0, 55.0, -40.0])]);
    let (default, from) = names("total-v2", false);
    let found = plausibility(&labels, &measures, &default, &from);
    assert!(found.check(&labels, &default, &from).is_ok(), "{found:?}");
    // Tables that give the numbers the same meanings are not listed.
    let same = found.as_likely.iter().any(|name| ["total-v1", "btcv", "amos"].contains(name));
    assert!(found.as_likely.contains(&"kits") && !same, "{found:?}");
    let told = format!("the numbers fit --names {} as well: --names says which", found.as_likely.join(" or "));
    assert_eq!(found.remarks(&default, false), [told]);
    let (chosen, from) = names("total-v2", true);
    assert_eq!(plausibility(&labels, &measures, &chosen, &from).remarks(&chosen, false), [""; 0]);
    // Four labels suffice to recognise the table.
    let part = ["spleen", "kidney_right", "kidney_left", "liver"];
    let (labels, measures) = numbered("total-v2", DVec3::ONE, |name| part.contains(&name));
    let (default, from) = names("total-v2", false);
    assert_eq!(plausibility(&labels, &measures, &default, &from).remarks(&default, false), [""; 0]);
}

#[test]
fn a_mirrored_map_is_refused_with_its_axes_and_can_be_allowed() {
    let (mut labels, measures) = numbered("total-v2", DVec3::new(-1.0, 1.0, 1.0), |_| true);
    labels.lps_from_voxel = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 2.0));
    let (default, from) = names("total-v2", false);
    let found = plausibility(&labels, &measures, &default, &from);
    let error = found.check(&labels, &default, &from).unwrap_err().to_string();
    for word in ["Mirrored?", "right (i), back (j) and head (k)", "left and right are exchanged", "situs inversus"] {
        assert!(error.contains(word), "{word}: {error}");
    }
    assert!(error.contains("the labels are not those of a human: "), "{error}");
    // The label numbers fit the table that was used.
    assert!(!error.contains("No built-in table"), "{error}");
    let remarks = found.remarks(&default, true);
    assert!(remarks[0].starts_with("--allow-implausible: ") && remarks[0].contains("exchanged"), "{remarks:?}");
}

#[test]
fn mapped_names_are_compared_as_the_organs_they_mean() {
    let named = |value: u16, name: &str| Segment {
        layer: 0,
        value,
        name: Some(name.to_owned()),
        colour: None,
        terminology: None,
    };
    let labels = label_map(vec![named(1, "Segment_1"), named(2, "Segment_2")]);
    let (mut mapped, _) = names("total-v2", false);
    mapped.table.add("Segment_1=liver").unwrap();
    // A mapping to a name that a mapping defined means the same organ.
    mapped.table.add("mine=spleen").unwrap();
    mapped.table.add("Segment_2=mine").unwrap();
    let from = NamesFrom::File { part: "the file's segments" };
    let found = |liver_ml: f64, by: f64| {
        let at = |x: f64| DVec3::new(x * by, 0.0, 0.0);
        let measure = |volume_ml: f64, x: f64| Measure { voxels: 1000, volume_ml, centre_mm: at(x), is_cut: false };
        let measures = Measures::from([((0, 1), measure(liver_ml, -60.0)), ((0, 2), measure(200.0, 100.0))]);
        let found = plausibility(&labels, &measures, &mapped, &from);
        found.check(&labels, &mapped, &from).map_err(|error| error.to_string())
    };
    assert_eq!(found(1500.0, 1.0), Ok(()));
    let error = found(1500.0, -1.0).unwrap_err();
    assert!(error.contains("left and right are exchanged"), "{error}");
    let error = found(200_000.0, 1.0).unwrap_err();
    assert!(error.contains("`liver` has 200,000 ml: no human's has more than 16,000 ml"), "{error}");
}

#[test]
fn names_of_the_file_are_compared_too_and_the_voxels_size_is_asked_for() {
    let named =
        |name: &str| Segment { layer: 0, value: 1, name: Some(name.to_owned()), colour: None, terminology: None };
    let mut labels = label_map(vec![named("Liver")]);
    labels.lps_from_voxel = DAffine3::from_scale(DVec3::new(8.0, 8.0, 25.0));
    let measure = Measure { voxels: 1, volume_ml: 1.5e6, centre_mm: DVec3::ZERO, is_cut: true };
    let measures = Measures::from([((0, 1), measure)]);
    let (default, _) = names("total-v2", false);
    let from = NamesFrom::File { part: "the file's label extension" };
    let found = plausibility(&labels, &measures, &default, &from);
    assert_eq!(found.likelier, [""; 0]);
    let error = found.check(&labels, &default, &from).unwrap_err().to_string();
    for word in ["`liver` has 1,500,000 ml: no human's has more than 16,000 ml", "8 × 8 × 25 mm"] {
        assert!(error.contains(word), "{word}: {error}");
    }
    assert!(!error.contains("--names"), "{error}");
}
