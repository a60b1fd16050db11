use glam::{DAffine3, DVec3};
use proptest::prelude::*;

use super::super::volume::Modality;
use super::*;

mod faults;

const SIZE: [usize; 3] = [72, 56, 40];

/// Distance of neighbouring voxels, mm.
const STEP_MM: f64 = 5.0;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Is {
    Air,
    Fat,
    Muscle,
    Liver,
    Spleen,
    Kidney,
    Cortex,
    Marrow,
    Lung,
}

/// Tissue and label of a voxel of a trunk.
fn trunk([i, j, k]: [usize; 3]) -> (Is, u16) {
    let p = DVec3::new(i as f64 - 35.5, j as f64 - 27.5, k as f64 - 19.5);
    let within =
        |centre: [f64; 3], radii: [f64; 3]| ((p - DVec3::from(centre)) / DVec3::from(radii)).length_squared() <= 1.0;
    let trunk = |x: f64, y: f64| (p.x / x).powi(2) + (p.y / y).powi(2) <= 1.0;
    match () {
        () if within([-12.0, -4.0, 2.0], [11.0, 9.0, 9.0]) => (Is::Liver, 1),
        () if within([17.0, 4.0, 4.0], [5.0, 6.0, 5.0]) => (Is::Spleen, 2),
        () if within([-11.0, 10.0, -9.0], [4.0, 4.0, 6.0]) => (Is::Kidney, 3),
        () if within([11.0, 10.0, -9.0], [4.0, 4.0, 6.0]) => (Is::Kidney, 4),
        () if within([0.0, 13.0, 0.0], [4.5, 4.5, 30.0]) => {
            (if within([0.0, 13.0, 0.0], [3.2, 3.2, 30.0]) { Is::Marrow } else { Is::Cortex }, 5)
        }
        () if p.z > 12.0 && within([-12.0, 0.0, 22.0], [10.0, 11.0, 12.0]) => (Is::Lung, 6),
        () if trunk(27.0, 19.0) => (Is::Muscle, 0),
        () if trunk(31.0, 23.0) => (Is::Fat, 0),
        () => (Is::Air, 0),
    }
}

fn hu(is: Is) -> f32 {
    match is {
        Is::Air => -1000.0,
        Is::Lung => -830.0,
        Is::Fat => -105.0,
        Is::Muscle => 50.0,
        Is::Liver => 60.0,
        Is::Spleen => 50.0,
        Is::Kidney => 35.0,
        Is::Marrow => 170.0,
        Is::Cortex => 600.0,
    }
}

/// Brightness of a tissue in a T1-weighted MR image without fat suppression.
fn t1(is: Is) -> f32 {
    match is {
        Is::Air => 8.0,
        Is::Lung => 15.0,
        Is::Fat => 620.0,
        Is::Muscle => 170.0,
        Is::Liver => 260.0,
        Is::Spleen => 190.0,
        Is::Kidney => 180.0,
        Is::Marrow => 310.0,
        Is::Cortex => 30.0,
    }
}

/// Brightness of a tissue in a T2-weighted MR image with fat suppression. As in a CT, fat is darker than organs.
fn t2_fat_suppressed(is: Is) -> f32 {
    match is {
        Is::Air => 4.0,
        Is::Lung => 9.0,
        Is::Fat => 90.0,
        Is::Muscle => 120.0,
        Is::Liver => 160.0,
        Is::Spleen => 420.0,
        Is::Kidney => 480.0,
        Is::Marrow => 210.0,
        Is::Cortex => 20.0,
    }
}

/// Approximately normal noise of standard deviation 1.
fn noise(index: usize) -> f32 {
    let mut state = index as u64 ^ 0x9e37_79b9_7f4a_7c15;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    next();
    ((0..12).map(|_| next()).sum::<f32>()) - 6.0
}

fn grid() -> Grid {
    let affine = DAffine3::from_scale_rotation_translation(
        DVec3::splat(STEP_MM),
        glam::DQuat::IDENTITY,
        DVec3::new(-180.0, -140.0, 900.0),
    );
    Grid { size: SIZE, lps_from_voxel: affine }
}

fn labels() -> Vec<u16> {
    let grid = grid();
    (0..grid.len()).map(|i| trunk(grid.at(i)).1).collect()
}

fn organs() -> Vec<Organ> {
    let named = [
        ("liver", "liver"),
        ("spleen", "spleen"),
        ("kidney_right", "kidney"),
        ("kidney_left", "kidney"),
        ("vertebrae_L3", "bone_adult"),
        ("lung", "lung_aerated"),
    ];
    let organ = |(name, tissue): (&str, &str)| Organ {
        name: name.to_owned(),
        tissue: tissue.to_owned(),
        priority: 50,
        wall: Vec::new(),
        gas: None,
    };
    named.map(organ).to_vec()
}

fn image(level: impl Fn(Is) -> f32, deviation: f32) -> Image {
    let grid = grid();
    let value = |i: usize| level(trunk(grid.at(i)).0) + deviation * noise(i);
    Image {
        path: "ct.nii.gz".into(),
        size: SIZE,
        lps_from_voxel: grid.lps_from_voxel,
        values: (0..grid.len()).map(value).collect(),
        stated: None,
        remarks: Vec::new(),
    }
}

fn ct() -> Image {
    image(hu, 18.0)
}

fn mapped(mut image: Image, map: impl Fn(f32) -> f32) -> Image {
    image.values.iter_mut().for_each(|value| *value = map(*value));
    image
}

/// The same image with voxels mirrored along `axis`, its affine unchanged.
fn mirrored(image: &Image, axis: usize) -> Image {
    let grid = grid();
    let value = |i: usize| {
        let mut at = grid.at(i);
        at[axis] = SIZE[axis] - 1 - at[axis];
        image.values[(at[2] * SIZE[1] + at[1]) * SIZE[0] + at[0]]
    };
    Image { values: (0..grid.len()).map(value).collect(), ..image.clone() }
}

fn check(image: &Image) -> Result<Checked, ImageError> {
    checked(image, &grid(), &labels(), &organs())
}

#[track_caller]
fn accepted(image: &Image, is_ct: bool, says: &str) -> Checked {
    let checked = check(image).unwrap();
    assert!(checked.is_ct == is_ct && checked.remarks[0].contains(says), "{:?}", checked.remarks);
    assert_eq!(checked.remarks.len(), 1, "{:?}", checked.remarks);
    checked
}

#[track_caller]
fn refused(image: &Image, says: &[&str]) {
    let error = check(image).map(|checked| checked.remarks).unwrap_err().to_string();
    assert!(says.iter().all(|says| error.contains(says)), "{error}");
}

/// Share of the voxels of tissue `is` that the mask contains.
fn share(mask: &[bool], is: Is) -> f64 {
    let grid = grid();
    let of: Vec<bool> = (0..grid.len()).filter(|&i| trunk(grid.at(i)).0 == is).map(|i| mask[i]).collect();
    of.iter().filter(|&&inside| inside).count() as f64 / of.len() as f64
}

#[test]
fn a_ct_in_hu_is_a_ct_with_or_without_air_padding_and_contrast_agent() {
    accepted(&ct(), true, "a CT in HU: air -1000, lungs -830, soft tissue ");
    let padded = mapped(ct(), |hu| if hu < -1040.0 { -3024.0 } else { hu });
    accepted(&padded, true, "a CT in HU");
    let contrast =
        image(|is| if is == Is::Kidney { 230.0 } else { hu(is) + if is == Is::Liver { 60.0 } else { 0.0 } }, 18.0);
    accepted(&contrast, true, "a CT in HU");
    // The region that wasn't scanned is padded, and there is no air.
    for padding in [-3024.0, -2000.0] {
        let grid = grid();
        let values = ct().values.into_iter().enumerate();
        let values = values.map(|(i, v)| if trunk(grid.at(i)).0 == Is::Air { padding } else { v }).collect();
        accepted(&Image { values, ..ct() }, true, &format!("padded with {padding:.0}: lungs -830, soft tissue "));
    }
    // The image is cropped to the organs, so that no value is as low as air.
    let grid = grid();
    let values = ct().values.into_iter().enumerate();
    let cropped = values
        .map(|(i, v)| if matches!(trunk(grid.at(i)).0, Is::Air | Is::Lung) { -100.0 + 18.0 * noise(i) } else { v });
    let mut cropped = Image { values: cropped.collect(), ..ct() };
    cropped.values.iter_mut().for_each(|value| *value = value.max(-180.0));
    let labels: Vec<u16> = labels().into_iter().map(|label| if label == 6 { 0 } else { label }).collect();
    let checked = checked(&cropped, &grid, &labels, &organs()).unwrap();
    assert!(checked.is_ct && checked.remarks[0].contains("holds no air"), "{:?}", checked.remarks);
}

#[test]
fn a_window_that_holds_the_fat_keeps_it_and_says_so() {
    for (low, high) in [(-160.0, 240.0), (-175.0, 250.0), (-200.0, 300.0), (-135.0, 215.0), (-250.0, 1000.0)] {
        let clipped = mapped(ct(), |hu| hu.clamp(low, high).round());
        let checked = accepted(&clipped, true, &format!("clipped to {low:.0} to "));
        let body = crate::segmentation::body::from_image(&checked.values, &grid(), true);
        let whole = crate::segmentation::body::from_image(&ct().values, &grid(), true);
        let differs = body.iter().zip(&whole).filter(|(a, b)| a != b).count();
        assert!(share(&body, Is::Fat) > 0.97 && share(&body, Is::Air) < 0.02, "{low}: {}", share(&body, Is::Fat));
        assert!(differs * 200 < whole.iter().filter(|&&b| b).count(), "{low}: {differs} voxels differ");
    }
    // With contrast agent, the upper end of the window, where bone lies, is nearer to the organs than the lower end.
    let contrast = |is| if matches!(is, Is::Liver | Is::Spleen | Is::Kidney) { 110.0 } else { hu(is) };
    accepted(&mapped(image(contrast, 18.0), |hu| hu.clamp(-160.0, 240.0)), true, "clipped to -160 to 240 HU");
}

#[test]
fn a_ct_that_is_not_in_hu_is_refused_with_its_likely_cause() {
    refused(
        &mapped(ct(), |hu| (hu + 1024.0).max(0.0)),
        &["isn't in HU", "shifted by about 10", "dcm2niix", "--image-type mr"],
    );
    refused(&mapped(ct(), |hu| hu - 1024.0), &["shifted by about -10"]);
    refused(&mapped(ct(), |hu| hu * 4.0), &["isn't in HU", "rescaled"]);
    // Fat is still recognised. Much air has the lowest value, so the lowest value is no padding.
    refused(&mapped(ct(), |hu| hu.max(-1000.0) * 1.4), &["isn't in HU", "rescaled"]);
    for (low, high, to) in
        [(-1000.0, 1000.0, 255.0), (-1000.0, 1000.0, 1.0), (-160.0, 240.0, 255.0), (-160.0, 240.0, 1.0)]
    {
        let rescaled = mapped(ct(), |hu| (hu.clamp(low, high) - low) / (high - low) * to);
        refused(&rescaled, &["isn't in HU", "air 0.00", "fat", "rescaled or clipped", "--body"]);
    }
    // Values are normalized by mean and standard deviation, as for neural networks.
    refused(&mapped(ct(), |hu| (hu.clamp(-160.0, 240.0) - 40.0) / 120.0), &["rescaled or clipped"]);
    // Values are clipped above those of fat.
    refused(&mapped(ct(), |hu| hu.clamp(-100.0, 300.0)), &["clipped to -100 to 300 HU", "fat can't be told from air"]);
    refused(&mapped(ct(), |hu| hu.clamp(0.0, 400.0)), &["isn't in HU", "air 0.00"]);
}

#[test]
fn an_mr_is_taken_as_one_and_the_reason_is_said() {
    for scale in [0.1, 1.0, 4.0] {
        let checked =
            accepted(&mapped(image(t1, 6.0), |v| v.abs() * scale), false, "an MR, fat under the skin is brighter");
        assert!(checked.remarks[0].contains("its fat isn't used"));
    }
    accepted(&mapped(image(t2_fat_suppressed, 6.0), f32::abs), false, "an MR, bone has dark parts");
    // Values are normalized; or slightly negative, as from the ringing of an interpolation.
    accepted(&mapped(image(t1, 6.0), |v| (v - 120.0) / 150.0), false, "an MR");
    accepted(&mapped(image(t1, 6.0), |v| v - 20.0), false, "an MR");
    // The labels have no bones, and soft tissue is as far from air as in a CT.
    let labels: Vec<u16> = labels().into_iter().map(|label| if label > 4 { 0 } else { label }).collect();
    let bright = mapped(image(t1, 6.0), |v| v.abs() * 5.0);
    let checked = checked(&bright, &grid(), &labels, &organs()).unwrap();
    assert!(!checked.is_ct, "{:?}", checked.remarks);
}

#[test]
fn what_the_user_states_overrides_the_values() {
    let shifted = mapped(ct(), |hu| hu + 1024.0);
    let as_mr = Image { stated: Some(Modality::Mr), ..shifted.clone() };
    accepted(&as_mr, false, "as --image-type says");
    let as_ct = |image: Image| Image { stated: Some(Modality::Ct), ..image };
    accepted(&as_ct(ct()), true, "as --image-type says");
    // A missing rescale intercept, or one applied twice, would make everything body or air.
    for wrong in [shifted.clone(), mapped(shifted, |value| value.max(0.0)), mapped(ct(), |hu| hu - 1024.0)] {
        refused(&as_ct(wrong), &["isn't in HU", "dcm2niix", "--image-type ct doesn't convert values"]);
    }
    // Organs with much contrast agent are accepted.
    let bright = |is| hu(is) + if matches!(is, Is::Liver | Is::Spleen | Is::Kidney) { 450.0 } else { 0.0 };
    accepted(&as_ct(image(bright, 18.0)), true, "as --image-type says");
    // A clipped CT counts as a CT; otherwise everything would be body.
    let window = as_ct(mapped(ct(), |hu| hu.clamp(-160.0, 240.0)));
    let checked = accepted(&window, true, "clipped to -160 to 240 HU");
    let body = crate::segmentation::body::from_image(&checked.values, &grid(), true);
    assert!(share(&body, Is::Fat) > 0.97 && share(&body, Is::Air) < 0.02, "{}", share(&body, Is::Air));
    let narrow = as_ct(mapped(ct(), |hu| hu.clamp(-50.0, 350.0)));
    refused(&narrow, &["clipped to -50 to 350 HU", "fat can't be told from air"]);
}

#[test]
fn a_mirrored_image_is_refused_with_its_direction() {
    for (axis, says) in [(0, "left to right"), (1, "front to back"), (2, "head to feet")] {
        for whole in [ct(), mapped(ct(), |hu| hu.clamp(-160.0, 240.0)), mapped(image(t1, 6.0), f32::abs)] {
            let found = check(&mirrored(&whole, axis)).map(|checked| checked.remarks).map_err(|e| e.to_string());
            let fits =
                found.as_ref().is_err_and(|e| e.contains(&format!("irrored {says}")) && e.contains("its affine"));
            assert!(fits, "{says}: {found:?}");
        }
    }
}

#[test]
fn a_mirror_image_that_fits_one_or_two_organs_better_is_a_remark() {
    let contrast = |is| hu(is) + if matches!(is, Is::Liver | Is::Spleen | Is::Kidney) { 100.0 } else { 0.0 };
    let turned = mirrored(&image(contrast, 18.0), 0);
    let found = |most: u16| {
        let labels: Vec<u16> = labels().into_iter().map(|label| if label > most { 0 } else { label }).collect();
        checked(&turned, &grid(), &labels, &organs()).map(|checked| checked.remarks)
    };
    for organs in [1, 2] {
        let remarks = found(organs).unwrap();
        let says = "the image would fit better mirrored left to right: check its axes";
        assert!(remarks.len() == 2 && remarks[1] == says, "{organs}: {remarks:?}");
    }
    let error = found(3).unwrap_err();
    assert!(matches!(&error, ImageError::Mirrored { direction, .. } if direction == "left to right"), "{error}");
}

#[test]
fn organs_in_air_are_refused() {
    // The body of the image lies 120 mm to the left.
    let grid = grid();
    let value = |i: usize| {
        let [x, y, z] = grid.at(i);
        if x < 44 { -1000.0 } else { hu(trunk([x - 44, y, z]).0) }
    };
    let shifted = Image { values: (0..grid.len()).map(value).collect(), ..ct() };
    refused(&shifted, &["doesn't fit the labels", "% of the soft tissue lies in air"]);
    let dark = |is| match is {
        Is::Air => 900.0,
        Is::Fat => 400.0,
        _ => 1.0,
    };
    refused(&image(dark, 0.0), &["lies in the dark background"]);
}

#[test]
fn a_volume_whose_affine_has_other_signs_is_told_so() {
    let (grid, labels) = (grid(), labels());
    let turned = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * grid.lps_from_voxel;
    let hint = turned_hint(&labels, &grid, &Grid { size: SIZE, lps_from_voxel: turned }, &|_| true, 80.0);
    assert!(hint.contains("With x and y of its affine negated it would hold 100 %"), "{hint}");
    let far = DAffine3::from_translation(DVec3::splat(5000.0)) * grid.lps_from_voxel;
    assert_eq!(turned_hint(&labels, &grid, &Grid { size: SIZE, lps_from_voxel: far }, &|_| true, 80.0), "");
    // An inverted mask covers the right box, but not the labelled voxels.
    let inverted = |i: usize| labels[i] == 0;
    assert_eq!(turned_hint(&labels, &grid, &Grid { size: SIZE, lps_from_voxel: turned }, &inverted, 80.0), "");
}

#[test]
fn an_image_of_another_grid_is_judged_alike() {
    // This image has half as many voxels along x, and a smaller field.
    let whole = grid();
    let affine = whole.lps_from_voxel
        * DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 1.0, 1.0),
            glam::DQuat::IDENTITY,
            DVec3::new(0.5, 2.0, 1.0),
        );
    let size = [36, 52, 38];
    let small = Grid { size, lps_from_voxel: affine };
    let value = |i: usize| {
        let [x, y, z] = small.at(i);
        hu(trunk([2 * x, y + 2, z + 1]).0)
    };
    let coarse = Image { size, lps_from_voxel: affine, values: (0..small.len()).map(value).collect(), ..ct() };
    let checked = check(&coarse).unwrap();
    assert!(checked.is_ct, "{:?}", checked.remarks);
    // Outside the image's field is air.
    assert_eq!(checked.values[0], OUTSIDE);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn linear_functions_of_a_ct_are_hu_or_refused(slope in 0.001_f32..5.0, intercept in -3000.0_f32..3000.0) {
        let (air, soft) = (intercept - 1000.0 * slope, intercept + 58.0 * slope);
        let near_hu = (air + 1000.0).abs() < 200.0 && (850.0..1350.0).contains(&(soft - air));
        match check(&mapped(ct(), |hu| slope * hu + intercept)) {
            Ok(checked) => prop_assert!(near_hu && checked.is_ct, "{:?}", checked.remarks),
            Err(error) => prop_assert!(!matches!(error, ImageError::Mirrored { .. }), "{error}"),
        }
    }

    #[test]
    fn arbitrary_values_do_not_panic(values in prop::collection::vec(any::<f32>(), 24), label in 0_u16..4) {
        let size = [4, 3, 2];
        let affine = DAffine3::IDENTITY;
        let image = Image { path: "a".into(), size, lps_from_voxel: affine, values, stated: None, remarks: Vec::new() };
        let labels: Vec<u16> = (0..24).map(|i| if i % 2 == 0 { label } else { 5 }).collect();
        let _ = checked(&image, &Grid { size, lps_from_voxel: affine }, &labels, &organs());
    }
}
