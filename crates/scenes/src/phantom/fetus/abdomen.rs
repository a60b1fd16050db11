//! Liver, gall bladder, stomach, spleen, kidneys, adrenals, bowel and bladder of the fetus.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Isometry, Solid, ellipsoid, smooth_sweep, smooth_union, sweep, union};

use super::thorax;
use crate::phantom::attitude::Attitude;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Semi-axes of a kidney, mm as drawn; the longest is scaled to half the length that biometry gives.
const KIDNEY_SEMI: Vec3 = Vec3::new(5.4, 10.8, 5.6);

/// `(level, centre)` of the kidney on `side`, mm as drawn: the right one is lower.
fn kidney_position(side: f32) -> (f32, Vec3) {
    (20.3 - 0.15 * side, Vec3::new(side * 10.0, 0.0, 4.0))
}

/// Abdominal organs.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let scale = attitude.biometry.trunk_scale();
    let cavity = thorax::belly(attitude, -0.2);
    let v = Vec3::new;
    let at = |level: f32, centre: Vec3, semi: Vec3| attitude.in_trunk_ellipsoid(level, centre, semi);
    let liver = smooth_union(
        [
            at(17.3, v(-8.5, 0.0, 20.0), v(17.5, 13.0, 18.5)),
            at(16.8, v(6.0, 0.0, 28.0), v(15.0, 9.0, 11.5)),
            at(18.8, v(-14.0, 0.0, 15.0), v(9.0, 11.0, 13.0)),
        ],
        5.0 * scale,
    )
    .smooth_intersect(cavity.clone(), 1.0);
    let spleen = at(17.7, v(16.5, 0.0, 7.5), v(3.6, 6.0, 5.5)).smooth_intersect(cavity.clone(), 1.5);
    let gall = sweep(&[
        attitude.knot(19.0, -9.0, 24.0, 1.2),
        attitude.knot(19.2, -10.5, 29.0, 2.3),
        attitude.knot(19.3, -11.0, 32.0, 2.5),
    ]);
    let bladder = at(BLADDER_LEVEL, v(0.0, 0.0, BLADDER_VENTRAL_MM), v(5.0, 6.0, 5.2));
    // Adrenals: caps on the kidneys, hypoechoic in the fetus.
    let adrenals = union([1.0, -1.0].map(|side| {
        let (level, centre) = kidney_position(side);
        at(level, centre + v(-1.5 * side, 10.0, 0.5), v(3.4, 2.6, 3.0))
    }));
    vec![
        Fetus.organ("fetal_bowel", "bowel", 109, 0.95, 2.6 * scale, bowel(attitude).smooth_intersect(cavity, 1.5)),
        Fetus.organ("liver", "liver", 110, 0.95, 5.0 * scale, liver),
        Fetus.organ("spleen", "spleen", 111, 0.8, 2.6 * scale, spleen),
        Fetus.organ("adrenals", "spleen", 111, 0.7, 2.2 * scale, adrenals),
        Fetus.organ("kidneys", "kidney", 112, 0.75, 3.5 * scale, kidneys(attitude)),
        Fetus.organ("renal_pyramids", "renal_medulla", 113, 0.55, 0.95 * scale, pyramids(attitude)),
        Fetus.organ("renal_pelves", "urine", 114, 0.5, 1.2 * scale, pelves(attitude)),
        Fetus.organ("gall_bladder", "urine", 114, 0.55, 1.6 * scale, gall),
        Fetus.organ("stomach", "amniotic_fluid", 115, 0.65, 2.4 * scale, stomach(attitude)),
        Fetus.organ("fetal_bladder", "urine", 115, 0.65, 2.6 * scale, bladder),
    ]
}

fn on_kidneys(attitude: &Attitude, part: impl Fn(f32) -> Solid) -> Solid {
    union([1.0, -1.0].map(|side| {
        let (level, centre) = kidney_position(side);
        let moved = Isometry { translation: centre, ..Isometry::IDENTITY };
        attitude.in_trunk(level, part(side).placed(moved))
    }))
}

/// Bean-shaped kidneys with a hilum towards the spine.
fn kidneys(attitude: &Attitude) -> Solid {
    let length = 0.5 * attitude.biometry.kidney_mm / attitude.biometry.trunk_scale();
    on_kidneys(attitude, |side| {
        let bean = ellipsoid(Vec3::ZERO, KIDNEY_SEMI.with_y(length));
        bean.smooth_subtract(ellipsoid(Vec3::new(-side * 6.8, 0.0, 0.8), Vec3::new(2.6, 3.6, 2.0)), 1.5)
    })
}

/// Hypoechoic pyramids in two rows about the sinus.
fn pyramids(attitude: &Attitude) -> Solid {
    on_kidneys(attitude, |side| {
        let rows = [2.4, -2.4].into_iter().flat_map(|ventral| {
            [-6.6, -3.4, 0.0, 3.4, 6.6].map(|up: f32| {
                let narrow = (1.0 - (up / 11.0).powi(2)).sqrt();
                ellipsoid(Vec3::new(side * 1.6 * narrow, up, ventral * narrow), Vec3::new(1.35, 1.2, 1.15))
            })
        });
        union(rows)
    })
}

/// Renal pelves with a little fluid, open to the hilum.
fn pelves(attitude: &Attitude) -> Solid {
    on_kidneys(attitude, |side| {
        let body = ellipsoid(Vec3::new(-side * 1.6, 0.0, 0.4), Vec3::new(1.9, 4.4, 1.3));
        let neck = ellipsoid(Vec3::new(-side * 4.2, -0.6, 0.6), Vec3::new(2.0, 1.5, 1.1));
        smooth_union([body, neck], 0.8)
    })
}

const BLADDER_LEVEL: f32 = 27.2;
const BLADDER_VENTRAL_MM: f32 = 18.0;

/// Centre of the bladder, fetal frame, mm.
pub(in crate::phantom) fn bladder_centre(attitude: &Attitude) -> Vec3 {
    attitude.trunk(BLADDER_LEVEL, 0.0, BLADDER_VENTRAL_MM)
}

/// Centre of the stomach's body, fetal frame, mm.
pub(in crate::phantom) fn stomach_centre(attitude: &Attitude) -> Vec3 {
    attitude.trunk(18.0, 13.0, 17.0)
}

/// Centre, upper and lower pole of the left and right kidney, fetal frame, mm.
pub(in crate::phantom) fn kidney_poles(attitude: &Attitude) -> [[Vec3; 3]; 2] {
    [1.0, -1.0].map(|side| {
        let (level, centre) = kidney_position(side);
        let frame = attitude.vertebra(level);
        let half = 0.5 * attitude.biometry.kidney_mm;
        let middle = frame.point(centre * attitude.biometry.trunk_scale());
        [middle, middle + frame.vector(Vec3::Y) * half, middle - frame.vector(Vec3::Y) * half]
    })
}

/// Stomach bubble: fundus at the left back, body, and the bend to the pylorus.
fn stomach(attitude: &Attitude) -> Solid {
    let knots = [
        attitude.knot(17.4, 13.2, 12.5, 4.2),
        attitude.knot(18.0, 13.0, 17.0, 5.3),
        attitude.knot(18.5, 10.0, 21.5, 4.0),
        attitude.knot(18.8, 5.0, 22.5, 2.4),
    ];
    smooth_sweep(&knots, 6)
}

/// Coils of small bowel between liver and bladder.
fn bowel(attitude: &Attitude) -> Solid {
    let coils = (0..3).map(|row| {
        let level = 21.2 + 1.35 * row as f32;
        let knots: Vec<(Vec3, f32)> = (0..9)
            .map(|i| {
                let left = -14.0 + 3.5 * i as f32;
                let ventral = if i % 2 == 0 { 17.0 } else { 33.0 } - 2.2 * row as f32;
                attitude.knot(level + 0.2 * (i % 3) as f32, left * (1.0 - 0.14 * row as f32), ventral, 2.5)
            })
            .collect();
        smooth_sweep(&knots, 5)
    });
    union(coils)
}
