//! Primitive solids. Formulas after I. Quilez, "Distance functions" (iquilezles.org/articles/distfunctions).

use glam::Vec3;

use super::{Bounds, Solid};

/// A sphere.
pub fn sphere(centre: Vec3, radius: f32) -> Solid {
    Solid::new(Bounds::around(centre, Vec3::splat(radius)), move |p| p.distance(centre) - radius)
}

/// Axis-aligned ellipsoid with semi-axes `semi`; accurate to first order near its surface.
pub fn ellipsoid(centre: Vec3, semi: Vec3) -> Solid {
    let least = semi.min_element();
    Solid::new(Bounds::around(centre, semi), move |p| {
        let q = (p - centre) / semi;
        let k0 = q.length();
        let k1 = (q / semi).length();
        // At the centre the quotient is 0/0; the nearest surface is at the smallest semi-axis.
        if k1 < 1e-6 { -least } else { k0 * (k0 - 1.0) / k1 }
    })
}

/// Solid of the points within `radius` of the segment from `a` to `b`.
pub fn capsule(a: Vec3, b: Vec3, radius: f32) -> Solid {
    round_cone(a, b, radius, radius)
}

/// Convex hull of two spheres.
pub fn round_cone(a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> Solid {
    let bounds = Bounds::around(a, Vec3::splat(radius_a)).hull(Bounds::around(b, Vec3::splat(radius_b)));
    Solid::new(bounds, move |p| round_cone_distance(p, a, b, radius_a, radius_b))
}

/// Distance to the convex hull of two spheres, exact outside.
pub(super) fn round_cone_distance(p: Vec3, a: Vec3, b: Vec3, ra: f32, rb: f32) -> f32 {
    let ba = b - a;
    let l2 = ba.length_squared();
    let rr = ra - rb;
    let a2 = l2 - rr * rr;
    // One sphere contains the other.
    if a2 <= 1e-9 {
        return (p.distance(a) - ra).min(p.distance(b) - rb);
    }
    let il2 = 1.0 / l2;
    let pa = p - a;
    let y = pa.dot(ba);
    let z = y - l2;
    let x2 = (pa * l2 - ba * y).length_squared();
    let y2 = y * y * l2;
    let z2 = z * z * l2;
    let k = rr.signum() * rr * rr * x2;
    if z.signum() * a2 * z2 > k {
        (x2 + z2).sqrt() * il2 - rb
    } else if y.signum() * a2 * y2 < k {
        (x2 + y2).sqrt() * il2 - ra
    } else {
        ((x2 * a2 * il2).sqrt() + y * rr) * il2 - ra
    }
}

/// Box of half extents `half` (rounding included) with edges rounded by `rounding`.
pub fn rounded_box(centre: Vec3, half: Vec3, rounding: f32) -> Solid {
    let core = half - rounding;
    Solid::new(Bounds::around(centre, half), move |p| {
        let q = (p - centre).abs() - core;
        q.max(Vec3::ZERO).length() + q.max_element().min(0.0) - rounding
    })
}

/// Half-space bounded by the plane through `point`; the unit `normal` points out of it.
pub fn half_space(point: Vec3, normal: Vec3) -> Solid {
    Solid::new(Bounds::EVERYWHERE, move |p| (p - point).dot(normal))
}

/// Slab within `half_thickness` of the plane through `point` with the unit `normal`.
pub fn plate(point: Vec3, normal: Vec3, half_thickness: f32) -> Solid {
    Solid::new(Bounds::EVERYWHERE, move |p| (p - point).dot(normal).abs() - half_thickness)
}
