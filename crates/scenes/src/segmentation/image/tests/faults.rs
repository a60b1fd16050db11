//! Tests of constant images, and of a CT that is shifted against its labels.

use super::*;

#[test]
fn an_image_of_one_value_is_refused() {
    refused(&image(|_| 0.0, 0.0), &["ct.nii.gz, given as --image, has the value 0 in all voxels"]);
    refused(&image(|_| -1000.0, 0.0), &["has the value -1000 in all voxels"]);
}

#[test]
fn bone_of_which_most_is_as_soft_as_muscle_is_told() {
    let grid = grid();
    let value = |i: usize| {
        let (at, is) = (grid.at(i), trunk(grid.at(i)).0);
        let is_beside = matches!(is, Is::Marrow | Is::Cortex) && at[0] <= 37;
        (if is_beside { 53.0 } else { hu(is) }) + 18.0 * noise(i)
    };
    let shifted = Image { values: (0..grid.len()).map(value).collect(), ..ct() };
    let remarks = check(&shifted).unwrap().remarks;
    assert!(remarks.iter().any(|remark| remark.starts_with("half of the labelled bone has less than")), "{remarks:?}");
}

#[test]
fn an_mr_whose_bone_is_bright_and_whose_fat_is_brighter_is_no_ct() {
    let bright = |is| match is {
        Is::Air => 0.0,
        Is::Lung => 15.0,
        Is::Fat => 700.0,
        Is::Muscle => 190.0,
        Is::Liver | Is::Spleen | Is::Kidney => 227.0,
        Is::Marrow | Is::Cortex => 360.0,
    };
    accepted(&mapped(image(bright, 6.0), f32::abs), false, "fat under the skin is brighter than organs");
}
