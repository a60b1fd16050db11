//! Reflection and transmission at an interface, in f32: `shaders/shared/interface.wgsl` and the functions of
//! `trace.wgsl`. Branch-free, so that the compiler vectorises over paths.

use insonify_core::simd::{at_least, at_most, exp, log2, phasor};

use crate::host::constants::{
    APERTURE_HALF_ANGLE, APERTURE_HALF_ANGLE_MAX, APERTURE_HALF_ANGLE_MIN, DIFFUSE_HALF_ROUGHNESS2,
};

pub(super) type Vector = [f32; 3];

#[inline(always)]
pub(super) fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn scaled(a: Vector, by: f32) -> Vector {
    [a[0] * by, a[1] * by, a[2] * by]
}

/// a + b · `times`.
#[inline(always)]
pub(super) fn plus(a: Vector, b: Vector, times: f32) -> Vector {
    [a[0] + b[0] * times, a[1] + b[1] * times, a[2] + b[2] * times]
}

#[inline(always)]
pub(super) fn normalised(a: Vector) -> Vector {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

/// `a` where the condition holds, else `b`.
#[inline(always)]
pub(super) fn pick(condition: bool, a: Vector, b: Vector) -> Vector {
    [if condition { a[0] } else { b[0] }, if condition { a[1] } else { b[1] }, if condition { a[2] } else { b[2] }]
}

/// ln of a normal positive number.
#[inline(always)]
pub(in crate::host) fn ln(x: f32) -> f32 {
    log2(x) * std::f32::consts::LN_2
}

/// Reflection and transmission between two fluids, by Snell's and Fresnel's laws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interface {
    pub(super) pressure_reflection: f32,
    pub(super) energy_reflection: f32,
    pub(super) cos_transmitted: f32,
}

/// The formulas of `acoustics::interface`.
#[inline(always)]
pub(super) fn interface_between(z1: f32, z2: f32, speed_ratio: f32, cos_incident: f32) -> Interface {
    // In factors, since 1 − cos² loses its digits as cos approaches 1.
    let sin2_incident = at_least((1.0 - cos_incident) * (1.0 + cos_incident), 0.0);
    let sin2_transmitted = speed_ratio * speed_ratio * sin2_incident;
    // Equal speeds: the reflection is the same at every angle, and there is no critical angle.
    let one_speed = speed_ratio == 1.0;
    let total = !one_speed & (sin2_transmitted >= 1.0);
    let bent = at_least(1.0 - sin2_transmitted, 0.0).sqrt();
    let a = if one_speed { z2 } else { z2 * cos_incident };
    let b = if one_speed { z1 } else { z1 * bent };
    let sum = a + b;
    let r = (a - b) / at_least(sum, 1.0e-30);
    let r = if total | (!one_speed & (sum <= 1.0e-30)) { 1.0 } else { r };
    let passed = if total { 0.0 } else { bent };
    Interface {
        pressure_reflection: r,
        energy_reflection: at_most(r * r, 1.0),
        cos_transmitted: if one_speed { cos_incident } else { passed },
    }
}

/// Normal of a microfacet on a surface of normal `n`: Beckmann's distribution of slopes, mean square `variance`. `u`
/// and `v` are random numbers in 0..1.
#[inline(always)]
pub(super) fn microfacet(n: Vector, variance: f32, u: f32, v: f32) -> Vector {
    let slope = at_least(-variance * ln(at_least(1.0 - u, 1.0e-7)), 0.0).sqrt();
    // y × n or x × n, whichever is not near 0.
    let tangent = normalised(pick(n[0].abs() > 0.7, [n[2], 0.0, -n[0]], [0.0, -n[2], n[1]]));
    let bitangent = [
        n[1] * tangent[2] - n[2] * tangent[1],
        n[2] * tangent[0] - n[0] * tangent[2],
        n[0] * tangent[1] - n[1] * tangent[0],
    ];
    let [cos, sin] = phasor(v);
    normalised(plus(plus(n, tangent, slope * cos), bitangent, slope * sin))
}

/// Mean square slope of the reflected rays that an aperture accepts from `range_mm`.
#[inline(always)]
fn aperture_variance(range_mm: f32, aperture_mm: f32) -> f32 {
    let half_angle = APERTURE_HALF_ANGLE * aperture_mm / at_least(range_mm, 1.0);
    let half_angle = at_most(at_least(half_angle, APERTURE_HALF_ANGLE_MIN), APERTURE_HALF_ANGLE_MAX);
    half_angle * half_angle
}

/// Fraction of a reflected beam's energy within the aperture, for a surface of slope variance `variance`.
#[inline(always)]
pub(super) fn acceptance(variance: f32, range_mm: f32, aperture_mm: f32) -> f32 {
    let aperture = aperture_variance(range_mm, aperture_mm);
    aperture / (aperture + variance)
}

/// Fraction of an echo's pressure that returns: a Gaussian lobe about the facet, and a diffuse floor. The lobe's
/// variance is the aperture's plus half of the squared roughness.
#[inline(always)]
pub(super) fn returning(cos_facet: f32, roughness: f32, range_mm: f32, aperture_mm: f32, diffuse: f32) -> f32 {
    let rough2 = roughness * roughness;
    let lobe2 = aperture_variance(range_mm, aperture_mm) + 0.5 * rough2;
    let cos2 = at_least(cos_facet * cos_facet, 1.0e-6);
    let tan2 = at_least(1.0 - cos2, 0.0) / cos2;
    let specular = acceptance(0.5 * rough2, range_mm, aperture_mm) * exp(-at_most(tan2 / lobe2, 80.0));
    (specular + diffuse * rough2 / (rough2 + DIFFUSE_HALF_ROUGHNESS2) * cos2).sqrt()
}
