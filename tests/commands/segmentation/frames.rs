//! Comparison of frames' segmentation maps with the label map in the scan planes.

use glam::{DQuat, DVec3};
use insonify::anatomy::{Scene, TissueTable};
use insonify::pose::Pose;
use insonify::render::{Backend, BackendChoice, Frame, RenderSettings, Renderer};
use insonify::segmentation::classes::ClassTable;
use insonify::transducer::{Probe, ProbeKind};

use super::files::Volume;
use super::labels::made;
use super::shapes::{CENTRE, MAPS, volume};

/// Label at a position, if the voxel there and the 26 around it are on the grid and have equal labels.
fn certain(volume: &Volume, lps_mm: DVec3) -> Option<u8> {
    let at = volume.lps_from_voxel.inverse().transform_point3(lps_mm).round();
    let label = |d: DVec3| {
        let p = at + d;
        let within = (0..3).all(|n| (0.0..volume.size[n] as f64).contains(&p[n]));
        within.then(|| volume.labels[(p.z as usize * volume.size[1] + p.y as usize) * volume.size[0] + p.x as usize])
    };
    let first = label(DVec3::ZERO)?;
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                if label(DVec3::new(x, y, z))? != first {
                    return None;
                }
            }
        }
    }
    Some(first)
}

#[test]
fn maps_equal_the_labels_in_twenty_planes_except_beside_borders() {
    let labels = volume(DQuat::IDENTITY);
    let outcome = made(&labels.nifti(), "a.nii", 200_000);
    let tissues = TissueTable::builtin().unwrap();
    let table = ClassTable::builtin("total-v2").unwrap();
    let mut scene = Scene::new(tissues.clone(), "gel").unwrap();
    for s in outcome.surfaces {
        scene.add(&s.name, &s.tissue, s.priority, s.mesh).unwrap();
    }
    let probe = Probe {
        kind: ProbeKind::Phased { fov_deg: 90.0 },
        scanlines: 64,
        samples: 256.into(),
        depth_mm: 100.0,
        frequency_mhz: 3.0,
        ..Probe::default()
    };
    let mut settings = RenderSettings::default();
    (settings.image.width, settings.image.height, settings.maps) = (180, 200, true);
    let backend = Backend::open(BackendChoice::Host).unwrap();
    let mut renderer = Renderer::new(&backend, &scene, &probe, &settings).unwrap();
    let sector = *renderer.sector();
    let mut frame = Frame::default();
    let (mut compared, mut seen) = (0usize, [0usize; 7]);
    for n in 0..20 {
        let turn =
            DQuat::from_euler(glam::EulerRot::XYZ, 0.31 * f64::from(n), 0.57 * f64::from(n), 0.83 * f64::from(n));
        let aside = DVec3::new(f64::from(n % 5) - 2.0, f64::from(n % 3) - 1.0, f64::from(n % 4) - 1.5) * 4.0;
        // The face is within the body: outside there is no contact.
        let pose = Pose { position_mm: CENTRE + aside - turn * DVec3::Z * 14.0, orientation: turn };
        renderer.render(&pose, &mut frame).unwrap();
        for row in 0..200 {
            for column in 0..180 {
                let number = frame.segmentation[(row * 180 + column) as usize];
                let at = sector.pixel_centre_mm(column, row);
                let Some(label) = certain(&labels, pose.transform_point(DVec3::new(at.x, 0.0, at.y))) else { continue };
                // Label 0 is soft tissue, fat or skin by its depth.
                if number == 0 || label == 0 {
                    continue;
                }
                let tissue = &tissues.names()[usize::from(number) - 1];
                let class = table.named(MAPS[usize::from(label) - 1].split_once('=').unwrap().1).unwrap();
                assert_eq!(Some(tissue), class.tissue.as_ref(), "pose {n}, pixel ({column}, {row})");
                compared += 1;
                seen[usize::from(label)] += 1;
            }
        }
    }
    assert!(compared > 10_000 && seen[1..].iter().filter(|&&n| n > 20).count() >= 5, "{compared}: {seen:?}");
}
