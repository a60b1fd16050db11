//! The placenta: its site, its body between basal and chorionic plate, its lobes and blood lakes, and the bed in the
//! wall.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use insonify_core::anatomy::sdf::{Bounds, Solid, bisect, smooth_union, sphere};

use super::cord_path::End;
use super::proportions::growth;
use super::vary::{random, vary};
use super::{cavity, cavity_semi_mm};
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::{Parameters, PlacentaSite};

/// Radius at 22 weeks, mm.
const RADIUS_22_MM: f32 = 72.0;
/// Largest thickness, mm.
const THICKNESS_MAX_MM: f32 = 40.0;
/// Depth to which the placenta extends into the uterine wall, mm; thus no film of fluid remains between them.
const SEATED_MM: f32 = 1.0;
/// Thickness of the chorionic and the basal plate, mm.
const PLATE_MM: f32 = 0.8;
/// Width of a lobe at 22 weeks, mm.
const LOBE_22_MM: f32 = 29.0;
/// Height of the lobes' bulges on the fetal side, mm.
const LOBES_MM: f32 = 1.7;
/// Smallest layer of fluid between fetus and placenta, mm.
const FETAL_GAP_MM: f32 = 2.5;
/// Thickness of the placenta's bed, mm: hypoechoic decidua and myometrium in the adjacent wall.
const BED_MM: f32 = 5.0;

/// Site and size of a placenta.
#[derive(Clone)]
pub(super) struct Placenta {
    pub(super) parameters: Parameters,
    pub(super) cavity: Solid,
    /// Point of the wall at the placenta's centre.
    wall: Vec3,
    /// Outward normal of the wall at that point.
    outward: Vec3,
    /// Centres of the lobes in the plane tangent to the wall at `wall`, mm.
    lobes: std::sync::Arc<[Vec2]>,
}

impl Placenta {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let semi = cavity_semi_mm(parameters);
        let cavity = cavity(parameters);
        let seed = parameters.seed;
        // Directions in units of the cavity's semi-axes.
        let towards = match parameters.placenta {
            PlacentaSite::Anterior => Vec3::new(0.34, 0.44, 0.83),
            PlacentaSite::Posterior => Vec3::new(-0.22, 0.38, -0.90),
            PlacentaSite::Fundal => Vec3::new(0.12, 0.97, 0.20),
            PlacentaSite::Left => Vec3::new(0.93, 0.28, 0.22),
            PlacentaSite::Right => Vec3::new(-0.93, 0.28, 0.22),
        };
        let about = Vec3::new(vary(seed, 701), vary(seed, 702), vary(seed, 703)) * 0.12;
        let direction = ((towards + about) * semi).normalize();
        // The cavity is convex about the origin, so bisection along the ray finds its wall.
        let far = 2.0 * semi.max_element();
        let wall = direction * bisect(0.0, far, 40, |t| cavity.distance_mm(direction * t) < 0.0);
        let outward = cavity.normal(wall);
        let mut placenta = Self { parameters: *parameters, cavity, wall, outward, lobes: [].into() };
        placenta.lobes = placenta.lobe_centres().into();
        placenta
    }

    /// Radius of the placenta from centre to rim along the wall, mm. It grows less than the fetus does.
    pub(super) fn radius_mm(&self) -> f32 {
        RADIUS_22_MM * growth(&self.parameters).powf(0.55) * (1.0 + 0.05 * vary(self.parameters.seed, 704))
    }

    /// Thickness at the centre of the placenta, mm: about as many mm as weeks (Hoddick et al., J Ultrasound Med 4:479,
    /// 1985).
    pub(super) fn thickness_mm(&self) -> f32 {
        let weeks = self.parameters.gestational_weeks as f32;
        (1.08 * weeks * (1.0 + 0.06 * vary(self.parameters.seed, 705))).min(THICKNESS_MAX_MM)
    }

    /// Centre of the placenta in the middle of its thickness, and the direction from there to the wall.
    pub(super) fn centre(&self) -> (Vec3, Vec3) {
        (self.wall - self.outward * (0.5 * self.thickness_mm()), self.outward)
    }

    /// A point of the wall slightly outside the placenta's rim.
    pub(super) fn outside_rim(&self) -> Vec3 {
        let turn = TAU * random(self.parameters.seed, 706);
        self.on_wall(Vec2::from_angle(turn) * 1.25 * self.radius_mm())
    }

    /// Two perpendicular unit directions along the wall at the placenta's centre.
    fn tangents(&self) -> [Vec3; 2] {
        let across = self.outward.any_orthonormal_vector();
        [across, self.outward.cross(across)]
    }

    /// Point of the wall nearest to the point `at` of the tangent plane, mm.
    pub(super) fn on_wall(&self, at: Vec2) -> Vec3 {
        let [a, b] = self.tangents();
        self.under_wall(self.wall + a * at.x + b * at.y, 0.0)
    }

    /// Point near `p` in the cavity, `depth_mm` from its wall; within the wall for negative depths.
    pub(super) fn under_wall(&self, p: Vec3, depth_mm: f32) -> Vec3 {
        (0..10).fold(p, |p, _| p - self.cavity.normal(p) * (self.cavity.distance_mm(p) + depth_mm))
    }

    /// Unit direction from a point of the wall into the cavity.
    pub(super) fn inward(&self, on_wall: Vec3) -> Vec3 {
        -self.cavity.normal(on_wall)
    }

    /// Point where the inward normal at `on_wall` leaves `body` on the fetal side; `None` beyond the placenta's rim.
    pub(super) fn fetal_side(&self, body: &Solid, on_wall: Vec3) -> Option<Vec3> {
        let inward = self.inward(on_wall);
        let is_inside = |depth: f32| body.distance_mm(on_wall + inward * depth) < 0.0;
        is_inside(1.0).then(|| on_wall + inward * bisect(1.0, 1.6 * self.thickness_mm(), 30, is_inside))
    }

    /// Centres of lobes in the tangent plane, mm: a hexagonal lattice with random displacements.
    fn lobe_centres(&self) -> Vec<Vec2> {
        let width = LOBE_22_MM * growth(&self.parameters).powf(0.55);
        let seed = self.parameters.seed;
        let mut centres = Vec::new();
        for j in -5i32..=5 {
            for i in -5i32..=5 {
                let key = 800 + 2 * (11 * (j + 5) + i + 5) as u64;
                let jitter = Vec2::new(random(seed, key) - 0.5, random(seed, key + 1) - 0.5) * 0.55;
                let lattice = Vec2::new(i as f32 + 0.5 * (j & 1) as f32, 0.87 * j as f32);
                let centre = (lattice + jitter) * width;
                if centre.length() < self.radius_mm() + width {
                    centres.push(centre);
                }
            }
        }
        centres
    }

    /// Approximate distance of `p` from the nearest border between two lobes, mm, within the tangent plane.
    fn lobe_border_distance(&self, p: Vec3) -> f32 {
        let at = self.tangent_position(p);
        let (mut nearest, mut second) = (f32::MAX, f32::MAX);
        for centre in self.lobes.iter() {
            let d = at.distance(*centre);
            (nearest, second) = if d < nearest { (d, nearest) } else { (nearest, second.min(d)) };
        }
        0.5 * (second - nearest)
    }

    /// Approximate distance of `p` from the placenta's centre along the wall, mm: the straight distance corrected for
    /// depth.
    fn along_mm(&self, p: Vec3) -> f32 {
        let depth = self.cavity.distance_mm(p);
        (p.distance_squared(self.wall) - depth * depth).max(0.0).sqrt()
    }

    /// Solid of the whole placenta, from just inside the wall to its fetal side, indented where the `fetus` is near.
    pub(super) fn body(&self, fetus: &Solid) -> Solid {
        let seated = self.cavity.grown(SEATED_MM);
        let reach = Vec3::splat(1.25 * self.radius_mm() + self.thickness_mm());
        let bounds = seated.bounds().overlap(Bounds::around(self.wall, reach));
        let (radius, thickness) = (self.radius_mm(), self.thickness_mm());
        let own = self.clone();
        let lens = Solid::new(bounds, move |p| {
            let depth = -own.cavity.distance_mm(p);
            let (u, v) = (own.along_mm(p) / radius, depth.max(0.0) / thickness);
            let k = u.hypot(v);
            // Distance from an ellipse in (distance along the wall, depth), to first order.
            let slope = (u / radius).hypot(v / thickness);
            if slope < 1e-6 { -thickness } else { k * (k - 1.0) / slope }
        });
        let own = self.clone();
        let lobed = lens.displaced(LOBES_MM, move |p| {
            LOBES_MM * (own.lobe_border_distance(p) * (2.0 / LOBE_22_MM)).clamp(0.0, 1.0).sqrt() - 0.6 * LOBES_MM
        });
        lobed.smooth_intersect(seated, 3.0).smooth_subtract(fetus.grown(FETAL_GAP_MM), 5.0)
    }

    /// Parenchyma between the plates, partly divided by septa from the basal plate.
    fn parenchyma(&self, body: &Solid) -> Solid {
        let own = self.clone();
        let within = body.grown(-PLATE_MM);
        let reach = 0.6 * self.thickness_mm();
        Solid::new(within.bounds(), move |p| {
            let d = within.distance_mm(p);
            if d > 2.0 {
                return d;
            }
            let depth = -own.cavity.distance_mm(p);
            // A septum is a wedge, widest at the basal plate.
            let half_width = 0.85 * (1.0 - depth / reach);
            if half_width < -2.0 { d } else { d.max(0.9 * (half_width - own.lobe_border_distance(p))) }
        })
    }

    /// Small blood lakes between the villi, more of them later in pregnancy; `None` in a thin placenta.
    fn lakes(&self, body: &Solid) -> Option<Solid> {
        let seed = self.parameters.seed;
        let count = 5 + (0.4 * (self.parameters.gestational_weeks as f32 - 16.0)) as u64;
        let lakes: Vec<Solid> = (0..count)
            .filter_map(|i| {
                let r = |k: u64| random(seed, 1200 + 10 * i + k);
                let at = Vec2::from_angle(TAU * r(0)) * self.radius_mm() * (0.15 + 0.6 * r(1));
                let on_wall = self.on_wall(at);
                let fetal = self.fetal_side(body, on_wall)?;
                let middle = on_wall.lerp(fetal, 0.35 + 0.4 * r(2));
                let size = 2.0 + 1.8 * r(3);
                let [a, b] = self.tangents();
                let aside = (a * (r(4) - 0.5) + b * (r(5) - 0.5)) * 2.6 * size;
                // A lake too near to a plate would break through it.
                (body.distance_mm(middle) < -size - 2.0)
                    .then(|| smooth_union([sphere(middle, size), sphere(middle + aside, 0.7 * size)], 1.5))
            })
            .collect();
        // A thin placenta may have no lake.
        (!lakes.is_empty()).then(|| smooth_union(lakes, 1.0).intersect(body.grown(-2.0)))
    }

    /// Decidua and adjacent myometrium: a dark band within the wall.
    fn bed(&self) -> Solid {
        let own = self.clone();
        let radius = 0.92 * self.radius_mm();
        let bounds = self.cavity.bounds().grown(BED_MM).overlap(Bounds::around(self.wall, Vec3::splat(1.2 * radius)));
        Solid::new(bounds, move |p| {
            let d = own.cavity.distance_mm(p);
            let u = own.along_mm(p) / radius;
            // The bed thins towards the rim. Where its solid extends into the cavity, the placenta hides it.
            (d - BED_MM * (1.0 - u * u * u * u)).max(-4.0 - d).max((u - 1.0) * radius)
        })
    }

    /// Veins of the bed.
    fn bed_veins(&self) -> Solid {
        let seed = self.parameters.seed;
        smooth_union(
            (0..9u64).map(|i| {
                let r = |k: u64| random(seed, 1500 + 10 * i + k);
                let at = Vec2::from_angle(TAU * r(0)) * self.radius_mm() * 0.8 * r(1).sqrt();
                let turn = Vec2::from_angle(TAU * r(2)) * 4.0;
                let ball = |at: Vec2| sphere(self.under_wall(self.on_wall(at), -2.9), 1.35);
                smooth_union(
                    [ball(at - turn), ball(at - turn * 0.5), ball(at), ball(at + turn * 0.5), ball(at + turn)],
                    1.0,
                )
            }),
            0.5,
        )
    }

    /// Insertion of the cord on the fetal side of `body`, with the direction into the cavity. It lies off the
    /// placenta's centre, where the `fetus` leaves most room.
    pub(super) fn insertion(&self, body: &Solid, fetus: &Solid) -> End {
        let fallback = End { at: self.wall - self.outward * self.thickness_mm(), away: -self.outward };
        let mut best = (f32::MIN, fallback);
        for ring in 0..7 {
            for step in 0..16u64 {
                let turn = TAU * (step as f32 + 0.5 * (ring % 2) as f32) / 16.0;
                let off = 0.13 * ring as f32;
                let on_wall = self.on_wall(Vec2::from_angle(turn) * off * self.radius_mm());
                let Some(fetal) = self.fetal_side(body, on_wall) else { continue };
                let inward = self.inward(on_wall);
                let thick = on_wall.distance(fetal);
                // Space directly in front of the insertion and farther away; a thin rim can't hold a cord.
                let clearance = |mm: f32| {
                    let p = fetal + inward * mm;
                    fetus.distance_mm(p).min(-self.cavity.distance_mm(p)).min(mm + 6.0)
                };
                let score = clearance(7.0) + clearance(14.0) - 8.0 * off
                    + thick.min(12.0)
                    + 3.0 * random(self.parameters.seed, 1700 + 16 * ring + step);
                if score > best.0 {
                    best = (score, End { at: fetal, away: inward });
                }
            }
        }
        best.1
    }

    /// Plates, parenchyma, lakes, bed and the `vessels` on the chorionic plate.
    pub(super) fn organs(&self, body: &Solid, vessels: Solid) -> Vec<Organ> {
        let lakes = self.lakes(body).map(|lakes| Mother.organ("placental_lakes", "blood", 63, 1.0, 2.6, lakes));
        let parts = [
            Mother.organ("placental_bed", "placental_bed", 45, 2.6, 9.0, self.bed()),
            Mother.organ("placental_bed_veins", "blood", 46, 1.2, 2.0, self.bed_veins()),
            Mother.organ("placental_plates", "placental_plate", 60, 1.9, 9.0, body.clone()),
            Mother.organ("placenta", "placenta", 61, 1.7, 10.0, self.parenchyma(body)),
            Mother.organ("placental_vessels", "blood", 64, 0.9, 1.85, vessels),
        ];
        parts.into_iter().chain(lakes).collect()
    }

    /// Position of `p` in the tangent plane, mm.
    pub(super) fn tangent_position(&self, p: Vec3) -> Vec2 {
        let [a, b] = self.tangents();
        Vec2::new((p - self.wall).dot(a), (p - self.wall).dot(b))
    }
}

/// Centre of the placenta in the middle of its thickness, and the direction to the wall that bears it.
pub(in crate::phantom) fn placenta_centre(parameters: &Parameters) -> (Vec3, Vec3) {
    Placenta::of(parameters).centre()
}
