use std::collections::BTreeMap;
use std::path::PathBuf;

use super::super::Role;
use super::*;

/// Numbers and names of TotalSegmentator's classes, by task. `scripts/check-label-names` compares them with the
/// package.
fn package() -> BTreeMap<String, BTreeMap<u16, String>> {
    let path =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/segmentation/totalsegmentator_classes.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn names_and_numbers_are_those_of_the_package() {
    let package = package();
    let mut tasks = 0;
    for (name, task) in [
        ("total-v2", "total"),
        ("total-v1", "total_v1"),
        ("total-mr", "total_mr"),
        ("body", "body"),
        ("body", "body_mr"),
        ("tissue-types", "tissue_4_types"),
    ] {
        let table = ClassTable::builtin(name).unwrap();
        let numbered = table.by_value.iter().map(|(value, index)| (*value, table.classes[*index].name.clone()));
        assert_eq!(&numbered.collect::<BTreeMap<_, _>>(), &package[task], "{name}");
        tasks += 1;
        for (value, class) in &package[task] {
            assert_eq!(&table.numbered(*value).unwrap().name, class);
            assert_eq!(&table.named(class).unwrap().name, class);
        }
    }
    let fewer = ["tissue_types", "tissue_types_mr"];
    for task in fewer {
        assert!(package[task].iter().all(|(value, name)| package["tissue_4_types"][value] == *name));
    }
    assert_eq!(tasks + fewer.len(), package.len());
}

#[test]
fn every_tissue_is_built_in() {
    assert!(TISSUES.names().len() > 40);
    for (name, text) in BUILTIN {
        // Unknown tissues, double names and double numbers are errors.
        let table = ClassTable::parse(name, text).unwrap();
        assert!(table.classes.iter().all(|class| class.tissue.is_some() != (class.role == Role::Ignore)), "{name}");
    }
}

#[test]
fn a_name_has_the_same_properties_in_every_table() {
    let mut first: HashMap<String, Class> = HashMap::new();
    for (name, text) in BUILTIN {
        for class in ClassTable::parse(name, text).unwrap().classes {
            let class = Class { value: None, ..class };
            assert_eq!(first.entry(class.name.clone()).or_insert_with(|| class.clone()), &class, "{name}");
        }
    }
}

#[test]
fn priorities_follow_the_order_of_tissues() {
    let table = ClassTable::builtin("total-v2").unwrap();
    let priority = |name: &str| table.named(name).unwrap().priority.unwrap();
    let order = ["body_trunc", "lung_left", "autochthon_left", "colon", "liver", "gallbladder", "aorta", "sacrum"];
    assert!(order.map(priority).windows(2).all(|pair| pair[0] < pair[1]), "{:?}", order.map(priority));
}

#[test]
fn names_of_slicer_and_of_coded_terms_are_found() {
    let table = ClassTable::builtin("total-v2").unwrap();
    for (name, class) in [
        ("right kidney", "kidney_right"),
        ("Kidney right", "kidney_right"),
        ("Kidney, Right", "kidney_right"),
        ("Structure of liver", "liver"),
        ("Liver", "liver"),
        ("Adrenal gland, Left", "adrenal_gland_left"),
        ("Common iliac vein, Right", "iliac_vena_right"),
        ("Deep muscle of back, Left", "autochthon_left"),
        ("Second rib, Right", "rib_right_2"),
        ("T12 vertebra", "vertebrae_T12"),
        ("Cyst, Kidney, Left", "kidney_cyst_left"),
        ("Middle lobe of right lung", "lung_middle_lobe_right"),
        ("Left ventricle of heart", "heart_ventricle_left"),
        ("ribs", "rib"),
        ("cervical vertebral column", "cervical_vertebral_column"),
        ("left lung", "lung_left"),
        ("IVC", "inferior_vena_cava"),
        ("SKIN", "skin"),
    ] {
        assert_eq!(table.named(name).map(|found| found.name.as_str()), Some(class), "{name}");
    }
    assert_eq!(table.named("Segment_1"), None);
    assert_eq!(table.named(""), None);
    assert_eq!(table.named("face").unwrap().role, Role::Ignore);
    assert_eq!(table.named("skin").unwrap().role, Role::Skin);
    assert_eq!(table.named("subcutaneous fat").unwrap().role, Role::Fat);
}

#[test]
fn numbers_are_those_of_the_chosen_table_alone() {
    let v1 = ClassTable::builtin("total-v1").unwrap();
    assert_eq!(v1.numbered(7).unwrap().name, "aorta");
    assert_eq!(v1.numbered(117), None);
    assert_eq!(v1.named("costal_cartilages").unwrap().value, None);
    let error = ClassTable::builtin("total").unwrap_err().to_string();
    assert!(error.contains("did you mean `total-") && error.contains("tissue-types"), "{error}");
}

fn load(text: &str) -> Result<ClassTable, ClassError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, text).unwrap();
    ClassTable::load(&path)
}

#[test]
fn a_file_defines_classes_beside_the_built_in_names() {
    let table = load(
        "[[class]]\nname = \"liver\"\nvalue = 9\ntissue = \"spleen\"\npriority = 33\n\
         [[class]]\nname = \"Tumour A\"\nvalue = 10\ntissue = \"soft_tissue\"\npriority = 70\naliases = [\"lesion\"]\n\
         wall = { tissue = \"fascia\", mm = 0.5 }\ngas = { tissue = \"air\", share = 0.1 }\ngroup = \"lesions\"\n",
    )
    .unwrap();
    assert_eq!(table.named("Liver").unwrap().tissue.as_deref(), Some("spleen"));
    assert_eq!(table.numbered(10), table.named("lesion"));
    assert_eq!(table.numbered(1), None);
    assert_eq!(table.named("kidney_left").unwrap().tissue.as_deref(), Some("renal_cortex"));
}

#[test]
fn faults_of_a_file_are_named_with_their_class() {
    let class = |lines: &str| format!("[[class]]\nname = \"a\"\n{lines}\n");
    let sound = "tissue = \"liver\"\npriority = 50\n";
    for (text, says) in [
        (
            class("tissue = \"livr\"\npriority = 50"),
            "class `a`: `tissue` is `livr`, which is no tissue (did you mean `liver`?)",
        ),
        (class("tissue = \"liver\""), "`priority` is missing"),
        (class("tissue = \"liver\"\npriority = 5"), "`priority` is 5; it must lie in 10..=99"),
        (class("priority = 50"), "`tissue` is missing"),
        (class(&format!("{sound}value = 0")), "`value` is 0"),
        (class(&format!("{sound}wall = {{ tissue = \"liver\", mm = 0.0 }}")), "`wall.mm` is 0"),
        (class(&format!("{sound}gas = {{ tissue = \"air\", share = 1.5 }}")), "`gas.share` is 1.5"),
        (class(&format!("{sound}gas = {{ tissue = \"aether\", share = 0.5 }}")), "`gas.tissue` is `aether`"),
        (class(&format!("{sound}colour = 3")), "unknown field `colour`"),
        (class(&format!("{sound}role = \"bone\"")), "unknown variant `bone`"),
        (class(&format!("{sound}aliases = [\"-\"]")), "the name `-` has no letter"),
        (class(sound) + &class(sound), "the name `a` is one of `a` as well"),
        (
            class(&format!("{sound}value = 3")) + &format!("[[class]]\nname = \"b\"\nvalue = 3\n{sound}"),
            "that of `a` as well",
        ),
    ] {
        let error = load(&text).unwrap_err().to_string();
        assert!(error.contains("mine.toml: ") && error.contains(says), "{says}: {error}");
    }
    let error = ClassTable::load(Path::new("/nowhere/mine.toml")).unwrap_err().to_string();
    assert!(error.contains("/nowhere/mine.toml: can't be read"), "{error}");
}

#[test]
fn faults_of_a_mapping_are_named() {
    let mut table = ClassTable::builtin("total-v2").unwrap();
    for mapping in ["spleen", "=liver", "a=", "0=liver", ""] {
        let error = table.add(mapping).unwrap_err().to_string();
        assert!(error.contains(&format!("`{mapping}` must be NAME=TISSUE")), "{error}");
    }
    let error = table.add("a=livver").unwrap_err().to_string();
    assert!(error.contains("`livver` is neither a class nor a tissue (did you mean `liver`?)"), "{error}");
    table.add("spleen=spleen").unwrap();
    table.add("a=b=Liver").unwrap();
    assert_eq!(table.named("a=b").unwrap().tissue.as_deref(), Some("liver"));
}

#[test]
fn a_wall_has_one_layer_or_a_list_and_wrong_layers_are_named() {
    let class = |wall: &str| {
        load(&format!("[[class]]\nname = \"x\"\nvalue = 1\ntissue = \"liver\"\npriority = 50\nwall = {wall}\n"))
    };
    let layers = |wall: &str| class(wall).unwrap().numbered(1).unwrap().wall.clone();
    let one = layers("{ tissue = \"fascia\", mm = 0.5 }");
    assert_eq!(one, layers("[{ tissue = \"fascia\", mm = 0.5 }]"));
    let two = layers("[{ tissue = \"fascia\", mm = 0.5 }, { part = \"gut_layers\", tissue = \"muscle\", mm = 2.0 }]");
    assert_eq!((two.len(), two[1].part.as_deref()), (2, Some("gut_layers")));
    let many = format!("[{}]", ["{ tissue = \"fascia\", mm = 0.5 }"; 6].join(", "));
    for (wall, said) in [
        ("{ tissue = \"fascia\", m = 0.5 }", "unknown field `m`"),
        ("[{ tissue = \"fascia\" }]", "missing field `mm`"),
        ("3.0", "a layer, as { tissue"),
        ("[{ tissue = \"fascia\", mm = 0.5 }, { tissue = \"musle\", mm = 1.0 }]", "did you mean `muscle`"),
        ("[{ tissue = \"fascia\", mm = 0.5 }, { tissue = \"muscle\", mm = 30.0 }]", "`wall.mm` is 30"),
        ("{ part = \"capsul\", tissue = \"fascia\", mm = 0.5 }", "`wall.part` is `capsul`"),
        (
            "[{ part = \"capsule\", tissue = \"fascia\", mm = 0.5 }, { part = \"pleura\", tissue = \"fascia\", mm = 0.5 }]",
            "two layers",
        ),
        (&many, "6 layers"),
    ] {
        let error = format!("{:#}", class(wall).unwrap_err());
        assert!(error.contains(said), "{wall}: {error}");
    }
}
