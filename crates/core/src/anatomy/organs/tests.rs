use super::*;
use glam::DVec3;

fn fact(name: &str, volume_ml: f64, centre_mm: [f64; 3]) -> OrganFact {
    OrganFact { name: name.to_owned(), volume_ml, centre_mm: DVec3::from_array(centre_mm), is_cut: false }
}

/// Organs of an adult, LPS, mm.
fn adult() -> Vec<OrganFact> {
    vec![
        fact("liver", 1500.0, [-60.0, 0.0, 0.0]),
        fact("spleen", 200.0, [100.0, 45.0, 10.0]),
        fact("stomach", 300.0, [50.0, -10.0, 10.0]),
        fact("gallbladder", 30.0, [-50.0, -40.0, -40.0]),
        fact("kidney_left", 160.0, [70.0, 60.0, -50.0]),
        fact("kidney_right", 150.0, [-65.0, 60.0, -60.0]),
        fact("aorta", 150.0, [10.0, 50.0, 20.0]),
        fact("vertebrae_T12", 40.0, [0.0, 80.0, 0.0]),
        fact("vertebrae_L3", 60.0, [0.0, 75.0, -90.0]),
        fact("urinary_bladder", 250.0, [0.0, -20.0, -260.0]),
        fact("heart", 600.0, [25.0, -40.0, 120.0]),
        fact("lung_upper_lobe_left", 900.0, [80.0, 0.0, 170.0]),
    ]
}

fn turned(facts: Vec<OrganFact>, by: DVec3) -> Vec<OrganFact> {
    facts.into_iter().map(|fact| OrganFact { centre_mm: fact.centre_mm * by, ..fact }).collect()
}

/// Descriptions of findings of one certainty.
fn said(facts: &[OrganFact], certainty: Certainty) -> Vec<String> {
    check_organs(facts).into_iter().filter(|f| f.certainty == certainty).map(|f| f.what).collect()
}

#[test]
fn an_adult_has_no_finding() {
    assert_eq!(check_organs(&adult()), []);
    assert_eq!(check_organs(&[]), []);
}

#[test]
fn a_mirrored_patient_is_told_from_situs_inversus_and_exchanged_names() {
    let mirrored = said(&turned(adult(), DVec3::new(-1.0, 1.0, 1.0)), Certainty::Impossible);
    assert!(mirrored.iter().any(|w| w.starts_with("left and right are exchanged")), "{mirrored:?}");
    assert!(mirrored.iter().any(|w| w.starts_with("the names of left and right")), "{mirrored:?}");
    // Situs inversus of all organs except the kidneys.
    let mut situs = adult();
    for fact in situs.iter_mut().filter(|fact| !fact.name.contains("kidney")) {
        fact.centre_mm.x = -fact.centre_mm.x;
    }
    let found = said(&situs, Certainty::Impossible);
    assert!(found.len() == 1 && found[0].starts_with("left and right are exchanged"), "{found:?}");
    assert!(found[0].contains("mm to the ") && found[0].contains("more"), "{found:?}");
    let mut exchanged = adult();
    for fact in exchanged.iter_mut().filter(|fact| fact.name.contains("kidney")) {
        fact.centre_mm.x = -fact.centre_mm.x;
    }
    let found = said(&exchanged, Certainty::Impossible);
    assert!(found.len() == 1 && found[0].starts_with("the names of left and right"), "{found:?}");
}

#[test]
fn upside_down_and_back_to_front_are_named() {
    let found = said(&turned(adult(), DVec3::new(1.0, 1.0, -1.0)), Certainty::Impossible);
    assert!(found.len() == 1 && found[0].starts_with("head and feet are exchanged"), "{found:?}");
    let found = said(&turned(adult(), DVec3::new(1.0, -1.0, 1.0)), Certainty::Impossible);
    assert!(found.len() == 1 && found[0].starts_with("front and back are exchanged"), "{found:?}");
}

#[test]
fn volumes_are_impossible_unlikely_or_usual() {
    let of = |name: &str, ml: f64| check_organs(&[fact(name, ml, [0.0; 3])]).pop().map(|f| (f.certainty, f.what));
    let (certainty, what) = of("spleen", 20_000.0).unwrap();
    assert_eq!(certainty, Certainty::Impossible);
    assert_eq!(what, "`spleen` has 20,000 ml: no human's has more than 12,000 ml");
    let (certainty, what) = of("spleen", 902.0).unwrap();
    assert_eq!((certainty, what.as_str()), (Certainty::Unlikely, "`spleen` has 902 ml: more than 800 ml is unusual"));
    let (certainty, what) = of("liver", 82.0).unwrap();
    assert_eq!((certainty, what.as_str()), (Certainty::Unlikely, "`liver` has 82 ml: less than 300 ml is unusual"));
    // A child's liver, and a class that no table has.
    assert_eq!((of("liver", 330.0), of("gallstone", 1e6)), (None, None));
    // The scan cuts this liver.
    let cut = OrganFact { is_cut: true, ..fact("liver", 5.0, [0.0; 3]) };
    assert_eq!(check_organs(&[cut]), []);
    // Volumes of bones are assumed: a large bone is unlikely, not impossible.
    let blob = check_organs(&[fact("vertebrae_L3", 364.0, [0.0, 75.0, -90.0])]);
    let told: Vec<_> = blob.iter().map(|finding| (finding.certainty, finding.what.as_str())).collect();
    assert_eq!(told, [(Certainty::Unlikely, "`vertebrae_L3` has 364 ml: more than 150 ml is unusual")]);
}

#[test]
fn organs_of_a_mouse_are_not_a_human() {
    let mouse = adult().into_iter().map(|f| OrganFact { volume_ml: f.volume_ml * 1e-3, ..f }).collect::<Vec<_>>();
    let found = said(&mouse, Certainty::Impossible);
    assert!(found.len() == 1 && found[0].contains("far too small for a human: `liver` has 1.5 ml"), "{found:?}");
    let child = adult().into_iter().map(|f| OrganFact { volume_ml: f.volume_ml * 0.25, ..f }).collect::<Vec<_>>();
    assert_eq!(said(&child, Certainty::Impossible), [""; 0]);
}

#[test]
fn fragments_next_to_a_cut_bone_of_usual_size_do_not_tell_the_unit() {
    let femur = OrganFact { is_cut: true, ..fact("femur_left", 400.0, [110.0, 20.0, -320.0]) };
    let fragments = [fact("liver", 0.5, [0.0; 3]), fact("spleen", 0.3, [20.0, 0.0, 0.0])];
    assert_eq!(said(&[&fragments[..], &[femur]].concat(), Certainty::Impossible), [""; 0]);
    let found = said(&fragments, Certainty::Impossible);
    assert!(found.len() == 1 && found[0].contains("far too small"), "{found:?}");
}

#[test]
fn several_organs_that_are_all_several_times_too_small_are_not_a_human() {
    // Organs segmented from voxels of 3 mm that were read as 1 mm; the bladder was full.
    let shrunk = |only: &dyn Fn(&str) -> bool| -> Vec<OrganFact> {
        let kept = adult().into_iter().filter(|fact| only(&fact.name));
        kept.map(|fact| OrganFact { volume_ml: fact.volume_ml / 27.0, ..fact }).collect()
    };
    let abdomen = |name: &str| !["heart", "lung_upper_lobe_left", "vertebrae_T12", "vertebrae_L3"].contains(&name);
    let found = said(&shrunk(&abdomen), Certainty::Impossible);
    assert!(found.len() == 1 && found[0].contains("whole organs are far too small"), "{found:?}");
    // Two small organs may be diseased, and a single small liver is.
    assert_eq!(said(&shrunk(&|name| ["liver", "spleen"].contains(&name)), Certainty::Impossible), [""; 0]);
    let mut ill = adult();
    ill[0].volume_ml = 60.0;
    assert_eq!(said(&ill, Certainty::Impossible), [""; 0]);
}

#[test]
fn a_trachea_in_the_pelvis_and_cysts_beside_the_spine_are_told() {
    let mut facts: Vec<OrganFact> = adult().into_iter().take(6).collect();
    facts.push(fact("trachea", 100.0, [0.0, -20.0, -260.0]));
    let found = said(&facts, Certainty::Impossible);
    assert!(found.len() == 1 && found[0].contains("the trachea lies 205 mm below the kidneys"), "{found:?}");
    let mut facts = adult();
    facts.push(fact("trachea", 40.0, [0.0, 30.0, 220.0]));
    facts.push(fact("kidney_cyst_right", 20.0, [-80.0, 70.0, -70.0]));
    assert_eq!(check_organs(&facts), []);
    facts.push(fact("kidney_cyst_left", 100.0, [12.0, 48.0, 0.0]));
    let told = said(&facts, Certainty::Unlikely);
    assert_eq!(told, ["`kidney_cyst_left` lies 58 mm to the right of the left kidney, which is unusual"]);
}

#[test]
fn plural_names_have_plural_verbs() {
    let mut facts = adult();
    facts.iter_mut().filter(|fact| fact.name.starts_with("kidney")).for_each(|fact| fact.centre_mm.y = -100.0);
    let told = said(&facts, Certainty::Unlikely);
    assert!(told.iter().any(|what| what.contains("the kidneys lie ")), "{told:?}");
}

#[test]
fn fragments_tell_no_position() {
    let mut facts = adult();
    facts.push(fact("pancreas", 0.5, [0.0, 0.0, -300.0]));
    assert!(check_organs(&facts).iter().all(|f| f.aspect == Aspect::Volume), "{:?}", check_organs(&facts));
}

#[test]
fn one_odd_relation_among_many_is_unlikely() {
    let mut facts = adult();
    // A vena cava to the left of the aorta occurs.
    facts.push(fact("inferior_vena_cava", 60.0, [40.0, 40.0, -20.0]));
    assert_eq!(said(&facts, Certainty::Impossible), [""; 0]);
    let unlikely = said(&facts, Certainty::Unlikely);
    assert!(
        unlikely.len() == 1 && unlikely[0].contains("the aorta lies 30 mm to the right of the vena cava"),
        "{unlikely:?}"
    );
}
