//! Rules for interfaces: their echoes, and paths that reflect.

use insonify_core::acoustics::decibel::db_from_amplitude;
use insonify_core::settings::Effect;

use super::{Finding, RETURNING_MAX, Rules, critical_deg, decided, finding, most};
use crate::constants::{REFLECTION_FOLLOWED, SEGMENTS};
use crate::plan::bound::Bound;
use crate::plan::facts::Medium;

impl Rules<'_> {
    /// Largest pressure reflection of any interface at any angle, and its two media; `None` if no interface acts.
    pub(super) fn strongest(&self) -> Option<(f64, (&Medium, &Medium))> {
        most(self.acting(), |(a, b)| pressure_reflection(a, b))
    }

    pub(super) fn interface_echoes(&self) -> Finding {
        let Some((r, (a, b))) = self.strongest() else {
            return finding(self.silent(), Bound::Exact);
        };
        // The worst case: every echo of every path falls into one pulse, all in phase.
        let paths = f64::from(self.settings.quality.rays * self.settings.quality.layers).sqrt();
        let amplitude = r * RETURNING_MAX * f64::from(SEGMENTS) * paths;
        let (gain_db, range_db) = (self.best_gain_db(), self.settings.image.dynamic_range_db);
        let above_black_db = db_from_amplitude(amplitude) + gain_db + range_db;
        // Largest change of a visible level by an echo at `above_black_db`, relative to black.
        let bound = Bound::level(db_from_amplitude(1.0 + 10f64.powf(above_black_db / 20.0)), range_db);
        if bound.negligible() && !self.settings.lines {
            let reason = format!(
                "{} to {} reflects {:.1} dB at the most, {:.0} dB below black with all gain",
                a.name,
                b.name,
                db_from_amplitude(r),
                -above_black_db
            );
            return finding(reason, bound);
        }
        let lacks = Bound::none("bright faces of organs and bones");
        if self.two_speeds().is_none() {
            return finding(format!("{} to {} reflects {:.1} dB", a.name, b.name, db_from_amplitude(r)), lacks);
        }
        // The reason names the strongest reflection at normal incidence.
        let Some((r, (a, b))) = most(self.acting(), |(a, b)| at_normal_incidence(a, b)) else {
            return finding("speeds differ", lacks);
        };
        let level = if r > 0.0 { format!("{:.1} dB", db_from_amplitude(r)) } else { "nothing".to_owned() };
        let reason =
            format!("{} to {} reflects {level} at normal incidence, all of it at the critical angle", a.name, b.name);
        finding(reason, lacks)
    }

    /// Largest net gain at any depth, dB: image gain, TGC and sliders, minus the least attenuation.
    fn best_gain_db(&self) -> f64 {
        let image = &self.settings.image;
        let least = self.facts.media.iter().map(|m| self.least_loss_db_mm(m)).fold(f64::INFINITY, f64::min);
        let loss_db_mm = if least.is_finite() { least } else { 0.0 };
        // The gain is linear between the sliders, so its maximum is at one of them.
        let at = |(i, slider_db): (usize, &f64)| {
            let depth_mm = self.probe.depth_mm * i as f64 / 7.0;
            image.gain_db + slider_db + (image.tgc_db_per_cm / 10.0 - loss_db_mm) * depth_mm
        };
        image.tgc_sliders_db.iter().enumerate().map(at).fold(f64::NEG_INFINITY, f64::max)
    }

    pub(super) fn roughness(&self) -> Finding {
        // Roughness weakens reflections, so smooth interfaces decide whether there are any.
        let reflects = !self.reflections_of(|_, _| 0.0).bound.negligible();
        if !self.on.has(Effect::InterfaceEchoes) && !decided(self.settings.effects.of(Effect::Reflections), reflects) {
            return finding("no interface echoes or reflects", Bound::Exact);
        }
        match most(self.acting(), |(a, b)| a.tissue.roughness.max(b.tissue.roughness)) {
            Some((slope, (a, b))) if slope as f32 > 0.0 => {
                let rougher = if a.tissue.roughness < slope { b } else { a };
                let reason = format!("faces of {} have slopes of {slope}", rougher.name);
                finding(reason, Bound::none("echoes of tilted faces; smooth ones shine too much"))
            }
            _ => finding("every interface is a mirror", Bound::Exact),
        }
    }

    pub(super) fn thickness(&self) -> Finding {
        if !self.on.has(Effect::InterfaceEchoes) {
            return finding("no interface echoes", Bound::Exact);
        }
        match most(self.acting(), |(a, b)| a.tissue.thickness_mm.max(b.tissue.thickness_mm)) {
            Some((mm, (a, b))) if mm as f32 > 0.0 => {
                let thicker = if a.tissue.thickness_mm < mm { b } else { a };
                let reason = format!("faces of {} are {mm} mm thick", thicker.name);
                if self.settings.quality.rays * self.settings.quality.layers > 1 {
                    // Paths add in power at a thick interface, in amplitude at a thin one.
                    return finding(reason, Bound::none("grain and place of thick faces"));
                }
                // Echoes lie within half the thickness to either side. In media slower than the assumed speed, that is
                // more range.
                let slowest = self.facts.speeds().map_or(1.0, |(slow, _)| self.speed_ratio(slow));
                finding(reason, Bound::Displacement { mm: 0.5 * mm / slowest.min(1.0) })
            }
            _ => finding("every interface is thin", Bound::Exact),
        }
    }

    pub(super) fn reflections(&self) -> Finding {
        let rough = self.on.has(Effect::Roughness);
        self.reflections_of(|a, b| if rough { a.tissue.roughness.max(b.tissue.roughness) } else { 0.0 })
    }

    /// Rule for reflections, where `roughness` gives the roughness of an interface.
    fn reflections_of(&self, roughness: impl Fn(&Medium, &Medium) -> f64) -> Finding {
        let reflections_max = self.settings.reflections_max;
        if let Some((slow, fast)) = self.two_speeds() {
            let critical_deg = critical_deg(slow, fast);
            let reason = format!(
                "{} turns all back from {} beyond {critical_deg:.1}°; up to {reflections_max} a path",
                fast.name, slow.name
            );
            return finding(reason, Bound::none("mirror images and reverberation"));
        }
        // With equal speeds, the reflection is the same at every angle. The accepted angle is widest near the face.
        let aperture = (0.25 * self.probe.aperture_mm).clamp(0.06, 0.5).powi(2);
        let returned = |&(a, b): &(_, _)| {
            let rough = roughness(a, b);
            pressure_reflection(a, b).powi(2) * aperture / (aperture + rough * rough)
        };
        match most(self.acting(), returned) {
            None => finding(self.silent(), Bound::Exact),
            // A tolerance of 1 % keeps rounding from deciding.
            Some((most, (a, b))) if most >= 0.99 * REFLECTION_FOLLOWED => {
                let percent = 100.0 * most;
                let (a, b) = (&a.name, &b.name);
                let reason = format!("{a} to {b} returns {percent:.0} % of the energy; up to {reflections_max} a path");
                finding(reason, Bound::none("mirror images and reverberation"))
            }
            Some((most, (a, b))) => {
                let (a, b, percent, limit) = (&a.name, &b.name, 100.0 * most, 100.0 * REFLECTION_FOLLOWED);
                let reason =
                    format!("{a} to {b} returns {percent:.2} % of the energy at the most; {limit:.0} % are followed");
                finding(reason, Bound::Exact)
            }
        }
    }
}

/// Largest pressure reflection of two media at any angle: 1 at grazing incidence, unless their speeds are equal.
pub(super) fn pressure_reflection(a: &Medium, b: &Medium) -> f64 {
    let one_speed = a.acoustic().0 == b.acoustic().0;
    if one_speed { at_normal_incidence(a, b) } else { 1.0 }
}

/// Magnitude of the pressure reflection of two media at normal incidence.
fn at_normal_incidence(a: &Medium, b: &Medium) -> f64 {
    let (z1, z2) = (a.tissue.impedance_mrayl(), b.tissue.impedance_mrayl());
    ((z2 - z1) / (z2 + z1)).abs()
}
