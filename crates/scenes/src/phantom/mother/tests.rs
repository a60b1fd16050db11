//! The mother's anatomy over a grid of parameters.

#![allow(clippy::unwrap_used, clippy::panic)]

use glam::Vec3;
use insonify_core::anatomy::sdf::{bisect, sphere};
use rayon::prelude::*;

use super::*;
use crate::phantom::meshing;
use crate::phantom::parameters::{Lie, PlacentaSite};
use crate::phantom::tests::cast;

/// A solid far away from everything.
fn nowhere() -> Solid {
    sphere(Vec3::splat(5000.0), 1.0)
}

/// The cord of `parameters`.
fn cord(parameters: &Parameters) -> Cord {
    let (fetus, navel) = fetus_in_scene(&Attitude::of(parameters));
    Afterbirth::of(parameters, &fetus, navel).cord
}

/// Parameters that vary in age, lie, placental site, fluid and seed; each lie and each site occurs.
fn grid() -> Vec<Parameters> {
    use {Lie::*, PlacentaSite::*};
    let sets = [
        (22.0, Cephalic, Anterior, 140.0, 0),
        (22.0, Cephalic, Posterior, 50.0, 1),
        (22.0, Breech, Fundal, 140.0, 2),
        (22.0, Breech, Left, 250.0, 3),
        (22.0, TransverseHeadLeft, Right, 140.0, 4),
        (22.0, TransverseHeadRight, Anterior, 90.0, 5),
        (16.0, Breech, Anterior, 140.0, 6),
        (16.0, TransverseHeadLeft, Posterior, 180.0, 7),
        (34.0, Cephalic, Fundal, 110.0, 8),
        (34.0, TransverseHeadRight, Left, 140.0, 9),
        (28.0, Breech, Right, 200.0, 10),
        (28.0, Cephalic, Anterior, 140.0, 11),
    ];
    let of = |(gestational_weeks, lie, placenta, fluid_index_mm, seed)| Parameters {
        gestational_weeks,
        lie,
        placenta,
        fluid_index_mm,
        seed,
        ..Parameters::default()
    };
    sets.into_iter().map(of).collect()
}

/// Faults of the cord of `parameters`; empty if there are none.
fn faults(parameters: &Parameters) -> Vec<String> {
    let (fetus, navel) = fetus_in_scene(&Attitude::of(parameters));
    let Afterbirth { placenta, body, root, cord } = Afterbirth::of(parameters, &fetus, navel);
    let (line, radius) = (&cord.line, cord.radius_mm);
    let mut faults = Vec::new();
    let mut expect = |good: bool, what: String| {
        if !good {
            faults.push(what);
        }
    };
    expect(body.distance_mm(line[0]) < 0.0, format!("begins {} mm off the placenta", body.distance_mm(line[0])));
    expect(fetus.distance_mm(line[line.len() - 1]) < 0.0, "does not reach the fetus".into());
    let cavity = &placenta.cavity;
    let (mut skin, mut plate, mut wall) = (f32::MAX, f32::MAX, f32::MAX);
    for &p in &line[1..line.len() - 1] {
        if p.distance(navel.at) > 2.0 * radius {
            skin = skin.min(fetus.distance_mm(p));
        }
        if p.distance(root.at) > 2.0 * radius {
            plate = plate.min(body.distance_mm(p));
        }
        if p.distance(root.at).min(p.distance(navel.at)) > 2.0 * radius {
            wall = wall.min(-cavity.distance_mm(p));
        }
    }
    expect(skin > 0.5 * radius, format!("{skin:.1} mm from its middle to the fetal skin, radius {radius:.1}"));
    expect(plate > 0.3 * radius, format!("{plate:.1} mm to the placenta, radius {radius:.1}"));
    expect(wall > 0.5 * radius, format!("{wall:.1} mm to the wall, radius {radius:.1}"));
    let mut arc = vec![0.0f32];
    for pair in line.windows(2) {
        arc.push(arc[arc.len() - 1] + pair[0].distance(pair[1]));
    }
    let mut own = f32::MAX;
    for i in 0..line.len() {
        for k in i + 1..line.len() {
            if arc[k] - arc[i] > 6.0 * radius {
                own = own.min(line[i].distance(line[k]));
            }
        }
    }
    expect(own > 1.85 * radius, format!("comes within {own:.1} mm of itself, radius {radius:.1}"));
    // Turn of the cord's direction over an arc as long as the cord's diameter.
    for i in 0..line.len() - 1 {
        let k = arc.partition_point(|&a| a < arc[i] + 2.0 * radius).min(line.len() - 2);
        let turn = (line[i + 1] - line[i]).angle_between(line[k + 1] - line[k]).to_degrees();
        expect(turn < 125.0, format!("turns by {turn:.0}° at {:.0} of {:.0} mm", arc[i], arc[arc.len() - 1]));
    }
    let length = arc[arc.len() - 1];
    expect(length > 12.0 * radius, format!("only {length:.0} mm long"));
    faults
}

#[test]
fn cords_find_their_way_through_the_fluid() {
    let all: Vec<String> = grid()
        .par_iter()
        .flat_map_iter(|p| faults(p).into_iter().map(move |fault| format!("{p:?}: {fault}")))
        .collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn the_cord_is_reproducible_and_differs_by_seed() {
    let line = |seed: u64| cord(&Parameters { seed, ..Parameters::default() }).line;
    assert_eq!(line(3), line(3));
    assert_ne!(line(3), line(4));
}

#[test]
fn the_cord_has_two_arteries_and_a_vein_that_do_not_meet() {
    let organs = cord(&Parameters::default()).organs();
    let solid = |name: &str| organs.iter().find(|o| o.name == name).unwrap();
    let (vein, arteries, cord) = (solid("cord_vein"), solid("cord_arteries"), solid("cord"));
    let meshes = [vein, arteries].map(|o| meshing::mesh(&o.solid, 0.35));
    assert_eq!(meshes.each_ref().map(|mesh| mesh.pieces().1), [1, 2], "one vein and two arteries");
    // In tight bends, arteries are nearer to each other than their walls are thick.
    let wall_mm = 0.1;
    let apart = meshes[0].vertices_mm.iter().map(|&v| arteries.solid.distance_mm(v)).fold(f32::MAX, f32::min);
    assert!(apart > 2.0 * wall_mm, "{apart:.2} mm between vein and arteries");
    for mesh in &meshes {
        assert!(mesh.vertices_mm.iter().all(|&v| cord.solid.distance_mm(v) < -wall_mm), "vessels lie in the jelly");
    }
}

#[test]
fn the_fat_has_the_requested_thickness() {
    for fat in [5.0, 13.5, 30.0, 60.0] {
        let parameters = Parameters { maternal_fat_mm: fat, ..Parameters::default() };
        let organs = AbdominalWall::of(&parameters).organs();
        let mesh_of = |name: &str| {
            let organ = organs.iter().find(|o| o.name == name).unwrap();
            (organ.solid.clone(), meshing::mesh(&organ.solid, organ.grain_mm))
        };
        let ((_, fat_mesh), (fascia, fascia_mesh)) = (mesh_of("subcutaneous_fat"), mesh_of("abdominal_fascia"));
        for (x, y) in [(0.0, 0.0), (30.0, 10.0), (-25.0, 40.0), (10.0, -45.0), (50.0, -20.0)] {
            let above = Vec3::new(x, y, 300.0);
            let on_fascia = above - Vec3::Z * cast(&fascia_mesh, above, Vec3::NEG_Z);
            let thickness = cast(&fat_mesh, on_fascia, fascia.normal(on_fascia));
            assert!((thickness / fat as f32 - 1.0).abs() < 0.03, "{thickness:.2} mm of {fat} at {x}, {y}");
        }
    }
}

#[test]
fn the_placenta_is_as_many_mm_thick_as_weeks_old() {
    for weeks in [16.0, 22.0, 28.0, 34.0] {
        for site in PlacentaSite::ALL {
            let parameters = Parameters { gestational_weeks: weeks, placenta: site, ..Parameters::default() };
            let placenta = Placenta::of(&parameters);
            let body = placenta.body(&nowhere());
            let (centre, outward) = placenta.centre();
            let span = |direction: Vec3| bisect(0.0, 60.0, 30, |t| body.distance_mm(centre + direction * t) < 0.0);
            let thickness = span(outward) + span(-outward);
            assert!((thickness / weeks as f32 - 1.0).abs() < 0.2, "{thickness:.1} mm at {weeks} weeks, {site:?}");
            assert!(-placenta.cavity.distance_mm(centre) > 0.3 * thickness, "in the cavity");
        }
    }
}

#[test]
fn no_organ_is_empty_and_bones_are_in_the_body() {
    for parameters in [grid()[4], grid()[6], grid()[8]] {
        let organs = organs(&parameters, &Attitude::of(&parameters));
        let skin = &organs.iter().find(|o| o.name == "skin").unwrap().solid;
        for o in &organs {
            let mesh = meshing::mesh(&o.solid, (1.6 * o.grain_mm).min(o.coarsest_mm));
            assert!(!mesh.triangles.is_empty(), "{} of {parameters:?} is empty", o.name);
            assert!(mesh.signed_volume_mm3() > 0.0, "{} is inside out", o.name);
            let out = mesh.vertices_mm.iter().map(|&v| skin.distance_mm(v)).fold(f32::MIN, f32::max);
            assert!(out < 0.2, "{} of {parameters:?} sticks out of the skin by {out:.1} mm", o.name);
        }
    }
}
