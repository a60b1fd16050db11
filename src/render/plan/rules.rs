//! Rules: whether a scene calls for an effect, and the error of a frame without it. All hold for any pose of the probe.

use super::bound::Bound;
use super::facts::{Medium, SceneFacts};
use crate::acoustics::ASSUMED_SPEED_M_S;
use crate::acoustics::decibel::db_from_amplitude;
use crate::render::aperture::ApertureTables;
use crate::render::constants::{REFLECTION_FOLLOWED, SEGMENTS};
use crate::render::elevation::elevations;
use crate::settings::RenderSettings;
use crate::settings::{Choice, Effect, EffectSet};
use crate::transducer::{Probe, Sector};

/// Invisible lateral shift of an edge, fraction of the lateral beam's σ.
const ASIDE_OF_BEAM: f64 = 0.25;

/// Largest ratio of returned pressure to reflected pressure, with lobe and diffuse floor together.
const RETURNING_MAX: f64 = 1.01;

/// Thickness of an obstacle in reasons, mm.
const SHADOWED_MM: f64 = 3.0;

/// Why a probe has no aperture.
const NO_APERTURE: &str = "not simulated for phased arrays, whose beams leave one place, and for very wide faces";

/// Result of a rule: the reason, and the error bound of a frame without the effect.
pub(super) struct Finding {
    pub(super) reason: String,
    pub(super) bound: Bound,
}

pub(super) fn finding(reason: impl Into<String>, bound: Bound) -> Finding {
    Finding { reason: reason.into(), bound }
}

/// Inputs of the rules.
pub(super) struct Rules<'a> {
    pub(super) facts: &'a SceneFacts,
    pub(super) probe: &'a Probe,
    pub(super) settings: &'a RenderSettings,
    /// Effects decided on so far.
    pub(super) on: EffectSet,
}

impl Rules<'_> {
    /// The rule of `effect`; those before it in [`Effect::ALL`] are decided.
    pub(super) fn of(&self, effect: Effect) -> Finding {
        match effect {
            Effect::Refraction => self.refraction(),
            Effect::SpeedDisplacement => self.speed_displacement(),
            Effect::InterfaceEchoes => self.interface_echoes(),
            Effect::Roughness => self.roughness(),
            Effect::Thickness => self.thickness(),
            Effect::Reflections => self.reflections(),
            Effect::Rays => self.rays(),
            Effect::Layers => self.layers(),
            Effect::Contact => self.contact(),
            Effect::Attenuation => self.attenuation(),
            Effect::FrequencyExponent => self.frequency_exponent(),
            Effect::Aperture => self.aperture(),
            Effect::Scatterers => self.scatterers(),
            Effect::Texture => self.texture(),
            Effect::ElevationalSpeckle => self.elevational_speckle(),
            Effect::Clutter => self.clutter(),
            Effect::Noise => self.noise(),
            Effect::Motion => self.motion(),
            Effect::Maps => self.maps(),
        }
    }

    /// Whether the probe lets an effect be simulated.
    pub(super) fn possible(&self, effect: Effect) -> bool {
        effect != Effect::Aperture || ApertureTables::possible(self.probe)
    }

    /// The slowest and the fastest medium, if their speeds differ. Any difference counts: at grazing incidence it
    /// reflects totally.
    fn two_speeds(&self) -> Option<(&Medium, &Medium)> {
        self.facts.speeds().filter(|(slow, fast)| slow.acoustic().0 != fast.acoustic().0)
    }

    /// Pairs of media that echo, bend or reflect where they meet.
    fn acting(&self) -> impl Iterator<Item = (&Medium, &Medium)> {
        self.facts.pairs().filter(|(a, b)| a.acoustic() != b.acoustic())
    }

    fn silent(&self) -> String {
        match &self.facts.media[..] {
            [] => "no medium".to_owned(),
            [only] => format!("{} is the only medium", only.name),
            _ => "all media have one impedance and one speed".to_owned(),
        }
    }

    fn refraction(&self) -> Finding {
        let Some((slow, fast)) = self.two_speeds() else {
            let reason = match &self.facts.media[..] {
                [some, _, ..] => format!("every medium has {} m/s", some.tissue.speed_m_s),
                _ => self.silent(),
            };
            return finding(reason, Bound::Exact);
        };
        let critical_deg = critical_deg(slow, fast);
        let reason = format!("{} and {}: nothing passes beyond {critical_deg:.1}°", speed(slow), speed(fast));
        let off = |effect| self.settings.effects.of(effect) == Choice::Off;
        if off(Effect::Aperture) || off(Effect::SpeedDisplacement) || !ApertureTables::possible(self.probe) {
            let reason = format!("{reason}; only reflected paths bend without aperture and speed_displacement");
            return finding(reason, Bound::none("bent reflections, and total reflection"));
        }
        finding(reason, Bound::none("bent beams, edge shadows and total reflection"))
    }

    fn speed_displacement(&self) -> Finding {
        let off = |m: &&Medium| (1.0 - ASSUMED_SPEED_M_S / m.tissue.speed_m_s).abs();
        let Some((off, medium)) = most(self.facts.media.iter(), off) else {
            return finding("no medium", Bound::Exact);
        };
        if self.facts.media.iter().all(|m| m.tissue.speed_m_s as f32 == ASSUMED_SPEED_M_S as f32) {
            return finding(format!("every medium has {ASSUMED_SPEED_M_S} m/s"), Bound::Exact);
        }
        let mm = off * self.probe.depth_mm;
        finding(format!("{}, the image's scale is of 1540 m/s", speed(medium)), Bound::Displacement { mm })
    }

    /// Largest pressure reflection of any interface at any angle, and its media.
    fn strongest(&self) -> Option<(f64, (&Medium, &Medium))> {
        most(self.acting(), |(a, b)| pressure_reflection(a, b))
    }

    fn interface_echoes(&self) -> Finding {
        let Some((r, (a, b))) = self.strongest() else {
            return finding(self.silent(), Bound::Exact);
        };
        // Every echo of every path in one pulse, all in phase.
        let paths = f64::from(self.settings.quality.rays * self.settings.quality.layers).sqrt();
        let amplitude = r * RETURNING_MAX * f64::from(SEGMENTS) * paths;
        let (gain_db, range_db) = (self.best_gain_db(), self.settings.image.dynamic_range_db);
        let above_black_db = db_from_amplitude(amplitude) + gain_db + range_db;
        // The most that an echo so far below black adds to a visible level.
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

    /// Largest net gain at any depth, dB: gain, TGC and sliders minus the least attenuation.
    fn best_gain_db(&self) -> f64 {
        let image = &self.settings.image;
        let least = self.facts.media.iter().map(|m| self.least_loss_db_mm(m)).fold(f64::INFINITY, f64::min);
        let loss_db_mm = if least.is_finite() { least } else { 0.0 };
        // Linear between the sliders, so the maximum is at one of them.
        let at = |(i, slider_db): (usize, &f64)| {
            let depth_mm = self.probe.depth_mm * i as f64 / 7.0;
            image.gain_db + slider_db + (image.tgc_db_per_cm / 10.0 - loss_db_mm) * depth_mm
        };
        image.tgc_sliders_db.iter().enumerate().map(at).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Length of path per mm of range in a medium; 1 without displacement by speed.
    pub(super) fn speed_ratio(&self, medium: &Medium) -> f64 {
        if self.on.has(Effect::SpeedDisplacement) { medium.tissue.speed_m_s / ASSUMED_SPEED_M_S } else { 1.0 }
    }

    fn roughness(&self) -> Finding {
        // Roughness weakens reflections, so those of smooth faces decide.
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

    fn thickness(&self) -> Finding {
        if !self.on.has(Effect::InterfaceEchoes) {
            return finding("no interface echoes", Bound::Exact);
        }
        match most(self.acting(), |(a, b)| a.tissue.thickness_mm.max(b.tissue.thickness_mm)) {
            Some((mm, (a, b))) if mm as f32 > 0.0 => {
                let thicker = if a.tissue.thickness_mm < mm { b } else { a };
                let reason = format!("faces of {} are {mm} mm thick", thicker.name);
                if self.settings.quality.rays * self.settings.quality.layers > 1 {
                    // Paths add in power on a thick face, in amplitude on a thin one.
                    return finding(reason, Bound::none("grain and place of thick faces"));
                }
                // Half of it to either side of the face, at the speed of the slowest medium if below the image's scale.
                let slowest = self.facts.speeds().map_or(1.0, |(slow, _)| self.speed_ratio(slow));
                finding(reason, Bound::Displacement { mm: 0.5 * mm / slowest.min(1.0) })
            }
            _ => finding("every interface is thin", Bound::Exact),
        }
    }

    fn reflections(&self) -> Finding {
        let rough = self.on.has(Effect::Roughness);
        self.reflections_of(|a, b| if rough { a.tissue.roughness.max(b.tissue.roughness) } else { 0.0 })
    }

    /// The rule of reflections, with the roughness of each interface from `roughness`.
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
        // Equal speeds: R is the same at every angle. The aperture accepts the most at the face.
        let aperture = (0.25 * self.probe.aperture_mm).clamp(0.06, 0.5).powi(2);
        let returned = |&(a, b): &(_, _)| {
            let rough = roughness(a, b);
            pressure_reflection(a, b).powi(2) * aperture / (aperture + rough * rough)
        };
        match most(self.acting(), returned) {
            None => finding(self.silent(), Bound::Exact),
            // A tolerance of 1 %, so that rounding doesn't decide.
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

    fn rays(&self) -> Finding {
        let asked = self.settings.quality.rays;
        if asked == 1 {
            return finding("the settings ask for one", Bound::Exact);
        }
        if self.on.has(Effect::InterfaceEchoes) || !self.reflections().bound.negligible() {
            let (rough, thick) = (self.on.has(Effect::Roughness), self.on.has(Effect::Thickness));
            let what = match (rough, thick) {
                (true, true) => "are rough and thick",
                (true, false) => "are rough",
                (false, true) => "are thick",
                (false, false) => "echo over the width of a scanline",
            };
            return finding(
                format!("{asked} asked for, and interfaces {what}"),
                Bound::none("smooth interfaces' echoes"),
            );
        }
        let layers = self.settings.quality.layers;
        if layers > 1 && self.settings.effects.of(Effect::Layers) != Choice::Off && !self.one_medium() {
            return finding(
                format!("{asked} asked for, to fill the slice of {layers} layers"),
                Bound::none("blur across the slice"),
            );
        }
        // Without chance, and with scatterers on the scanline's axis, rays differ only in where they cross edges: by up
        // to half a share to either side. Paths in fast media reach beyond the depth, where shares are wider.
        let ratio = self.facts.media.iter().map(|m| self.speed_ratio(m)).fold(1.0, f64::max);
        let half_share_mm = 0.5 * self.probe.line_spacing_mm(self.probe.depth_mm * ratio);
        let bound = if self.one_medium() {
            Bound::Exact
        } else {
            Bound::Aside { mm: half_share_mm, allowed_mm: self.aside_allowed_mm() }
        };
        if !bound.negligible() {
            return finding(format!("{asked} asked for, and scanlines lie {:.2} mm apart", 2.0 * half_share_mm), bound);
        }
        finding("no interface echoes, bends or reflects: one path a scanline", bound)
    }

    /// Largest invisible lateral shift of an edge, mm: half a pixel, or a fraction of the narrowest beam width.
    fn aside_allowed_mm(&self) -> f64 {
        let image = &self.settings.image;
        let focus_mm = self.probe.focus_mm.min(self.probe.depth_mm);
        let depths_mm = (0..=8).map(|i| self.probe.depth_mm * f64::from(i) / 8.0).chain([focus_mm]);
        let narrowest_mm = depths_mm.map(|z| self.probe.lateral_sigma_mm(z)).fold(f64::INFINITY, f64::min);
        (0.5 * Sector::fit(self.probe, image.width, image.height).pixel_mm).max(ASIDE_OF_BEAM * narrowest_mm)
    }

    /// Whether all media have the same speed, impedance, loss and scatterers.
    fn one_medium(&self) -> bool {
        let like = |m: &Medium| {
            let t = &m.tissue;
            let statistics = [t.scatterer_density, t.scatterer_mean, t.scatterer_deviation];
            (m.acoustic(), self.loss_db_mm(m) as f32, statistics.map(|v| v as f32))
        };
        self.facts.media.windows(2).all(|pair| like(&pair[0]) == like(&pair[1]))
    }

    fn layers(&self) -> Finding {
        let asked = self.settings.quality.layers;
        if asked == 1 {
            return finding("the settings ask for one", Bound::Exact);
        }
        if self.one_medium() {
            // Oblique layers lose more on their longer paths.
            let longer = elevations(self.probe, self.settings.quality.rays, asked, 1)
                .iter()
                .map(|&[.., stretch, _]| f64::from(stretch) - 1.0)
                .fold(0.0, f64::max);
            let loss_db_mm = self.facts.media.iter().map(|m| self.loss_db_mm(m)).fold(0.0, f64::max);
            let db = longer * loss_db_mm * self.probe.depth_mm;
            if db == 0.0 {
                return finding("one medium all across the slice", Bound::Exact);
            }
            let bound = if self.settings.lines {
                Bound::none("the loss of oblique layers in lines.npy")
            } else {
                Bound::level(db, self.settings.image.dynamic_range_db)
            };
            return finding(format!("one medium all across the slice; oblique layers lose {db:.3} dB more"), bound);
        }
        let sigma_mm = |depth: f64| self.probe.elevational_sigma_mm(depth);
        let widest = sigma_mm(0.0).max(sigma_mm(self.probe.depth_mm));
        let reason = format!("the slice is up to {:.1} mm thick (±2 σ), and media differ across it", 4.0 * widest);
        finding(reason, Bound::none("blur across the slice"))
    }

    fn aperture(&self) -> Finding {
        if !ApertureTables::possible(self.probe) {
            return finding(NO_APERTURE, Bound::none("what an aperture sees past obstacles"));
        }
        let loss = |m: &Medium| self.loss_db_mm(m) as f32;
        let differ = |(a, b): &(&Medium, &Medium)| loss(a) != loss(b) || a.acoustic() != b.acoustic();
        let most = most(self.facts.pairs().filter(differ), |(a, b)| {
            let loss_db_mm = (self.loss_db_mm(a) - self.loss_db_mm(b)).abs();
            let interface_db = -db_from_amplitude((1.0 - pressure_reflection(a, b).powi(2)).max(1.0e-3));
            loss_db_mm * SHADOWED_MM + interface_db
        });
        match most {
            None if self.facts.media.iter().any(|m| m.scatters()) => finding(
                "no medium casts a shadow, but the ends of the array cut beams",
                Bound::none("dimmer speckle below the ends of the array"),
            ),
            None => finding("all media lose alike: nothing casts a shadow", Bound::Exact),
            Some((db, (a, b))) => {
                let (strong, weak) = if self.loss_db_mm(a) < self.loss_db_mm(b) { (b, a) } else { (a, b) };
                let reason = format!("{} of {SHADOWED_MM} mm in {} loses {db:.0} dB", strong.name, weak.name);
                finding(reason, Bound::none("what an aperture sees past obstacles"))
            }
        }
    }

    fn scatterers(&self) -> Finding {
        let (loud, still): (Vec<_>, Vec<_>) = self.facts.media.iter().partition(|m| m.scatters());
        let Some(first) = loud.first() else {
            return finding("no medium scatters", Bound::Exact);
        };
        let names = |media: &[&Medium]| media.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
        let reason = match (&loud[..], &still[..]) {
            ([_], []) => format!("{} scatters", first.name),
            (_, []) => format!("all {} media scatter", loud.len()),
            _ => format!("{} of {} media scatter; none: {}", loud.len(), self.facts.media.len(), names(&still)),
        };
        finding(reason, Bound::none("speckle"))
    }

    fn motion(&self) -> Finding {
        let (moving, drifts) = (&self.facts.moving, self.facts.drifts);
        let reason = match (&moving[..], drifts) {
            ([], false) => return finding("nothing moves", Bound::Exact),
            ([], true) => "the whole scene drifts".to_owned(),
            ([only], _) => format!("{only} moves"),
            ([first, ..], _) => format!("{first} and {} more move", moving.len() - 1),
        };
        finding(reason, Bound::none("everything that moves"))
    }

    fn maps(&self) -> Finding {
        if self.settings.maps {
            finding("frames carry segmentation and attenuation", Bound::none("segmentation and attenuation"))
        } else {
            finding("no sink and no generator reads them", Bound::Exact)
        }
    }
}

/// The greatest value of the items, and its item.
pub(super) fn most<T>(items: impl Iterator<Item = T>, value: impl Fn(&T) -> f64) -> Option<(f64, T)> {
    items.map(|item| (value(&item), item)).max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Critical angle from the slow medium into the fast one, degrees.
fn critical_deg(slow: &Medium, fast: &Medium) -> f64 {
    (slow.tissue.speed_m_s / fast.tissue.speed_m_s).asin().to_degrees()
}

/// Whether an effect is on, from the user's choice and the scene's need.
pub(super) fn decided(choice: Choice, called_for: bool) -> bool {
    match choice {
        Choice::Auto => called_for,
        Choice::On => true,
        Choice::Off => false,
    }
}

/// Largest pressure reflection of two media at any angle: 1 at grazing incidence, unless their speeds are equal.
fn pressure_reflection(a: &Medium, b: &Medium) -> f64 {
    let one_speed = a.acoustic().0 == b.acoustic().0;
    if one_speed { at_normal_incidence(a, b) } else { 1.0 }
}

/// Magnitude of the pressure reflection of two media at normal incidence.
fn at_normal_incidence(a: &Medium, b: &Medium) -> f64 {
    let (z1, z2) = (a.tissue.impedance_mrayl(), b.tissue.impedance_mrayl());
    ((z2 - z1) / (z2 + z1)).abs()
}

fn speed(medium: &Medium) -> String {
    format!("{} has {} m/s", medium.name, medium.tissue.speed_m_s)
}
