//! Names of the fetus's surfaces, for pictures that treat mother and fetus differently.

/// Surface that encloses the fetus.
pub const FETAL_SKIN: &str = "fetal_skin";

/// Every surface of the fetus.
pub const FETAL_SURFACES: [&str; 43] = [
    FETAL_SKIN,
    "adrenals",
    "airway",
    "belly",
    "brain",
    "cartilage",
    "cerebellum",
    "choroid_plexus",
    "deep_brain",
    "diaphragm_and_belly_wall",
    "eyes",
    "face_and_skull_base",
    "falx_and_tentorium",
    "fetal_bladder",
    "fetal_body",
    "fetal_bowel",
    "fetal_vessel_walls",
    "fetal_vessels",
    "gall_bladder",
    "hand_and_foot_bones",
    "heart",
    "heart_chambers",
    "heart_valves",
    "kidneys",
    "lenses",
    "limb_girdles",
    "liver",
    "long_bones",
    "lungs",
    "renal_pelves",
    "renal_pyramids",
    "ribs",
    "skull",
    "spinal_canal",
    "spinal_cartilage",
    "spinal_cord",
    "spleen",
    "stomach",
    "subarachnoid_space",
    "sutures",
    "ventricles",
    "vermis",
    "vertebrae",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::{Body, Parameters, organs};

    #[test]
    fn they_are_those_of_the_phantom() {
        let organs = organs(&Parameters::default());
        let mut names: Vec<&str> = organs.iter().filter(|o| o.body == Body::Fetus).map(|o| o.name).collect();
        names.sort_unstable();
        let mut listed = FETAL_SURFACES.to_vec();
        listed.sort_unstable();
        assert_eq!(listed, names);
    }
}
