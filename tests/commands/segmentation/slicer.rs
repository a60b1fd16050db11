//! Test with a segmentation of 3D Slicer: `Segmentation.seg.nrrd` of the package slicerio.

use std::path::Path;

use glam::DVec3;
use insonify::segmentation::classes::ClassTable;
use insonify::segmentation::from_labels::{Options, make};
use insonify::segmentation::gather::gather;
use insonify::segmentation::measure::measure;
use insonify::segmentation::shape::Shape;
use insonify::segmentation::volume::{ReadOptions, read_labels};

#[test]
fn seven_segments_keep_their_volumes_and_places() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/segmentation/Segmentation.seg.nrrd");
    let labels = read_labels(&path, ReadOptions::default()).unwrap().canonical();
    let mut table = ClassTable::builtin("total-v2").unwrap();
    table.add("tissue=soft_tissue").unwrap();
    let measures = measure(&labels);
    let (inputs, unmapped) = gather(labels, &measures, &table, None, None, false, false).unwrap();
    assert!(unmapped.is_empty() && inputs.organs.len() == 7, "{:?}", inputs.organs);
    let grid = inputs.grid.clone();
    let voxel_mm = grid.voxel_mm().max_element();
    let mut sums = vec![(DVec3::ZERO, 0.0); 8];
    for (i, &label) in inputs.labels.iter().enumerate() {
        let at = grid.lps_from_voxel.transform_point3(DVec3::from_array(grid.at(i).map(|v| v as f64)));
        let (sum, count) = &mut sums[usize::from(label)];
        (*sum, *count) = (*sum + at, *count + 1.0);
    }
    let names: Vec<String> = inputs.organs.iter().map(|o| o.name.clone()).collect();
    let outcome = make(inputs, &Options::default(), &|_, _| ());
    for (name, (sum, count)) in names.iter().zip(&sums[1..]) {
        let made = outcome.surfaces.iter().find(|s| s.segment.as_ref() == Some(name)).unwrap();
        let shape = Shape::of(&made.mesh).unwrap();
        let off = shape.volume_mm3 / (count * grid.voxel_mm3()) - 1.0;
        let away = shape.centre_mm.distance(*sum / *count);
        assert!(off.abs() < 0.02 && away < 0.5 * voxel_mm, "{name}: {:.2} %, {away:.2} mm", 100.0 * off);
    }
}
