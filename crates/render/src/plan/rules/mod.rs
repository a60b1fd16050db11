//! Rules that decide whether a scene calls for an effect, and how wrong a frame without it is. They hold for any pose.

mod interfaces;

use insonify_core::acoustics::ASSUMED_SPEED_M_S;
use insonify_core::acoustics::decibel::db_from_amplitude;
use insonify_core::settings::RenderSettings;
use insonify_core::settings::{Choice, Effect, EffectSet};
use insonify_core::transducer::{Probe, Sector};

use super::bound::Bound;
use super::facts::{Medium, SceneFacts};
use crate::aperture::ApertureTables;
use crate::elevation::elevations;
use interfaces::pressure_reflection;

/// Largest invisible lateral shift of an edge, as a fraction of the lateral beam's σ.
const ASIDE_OF_BEAM: f64 = 0.25;

/// Largest ratio of returned to reflected pressure, for the lobe and the diffuse part together.
const RETURNING_MAX: f64 = 1.01;

/// Thickness of the obstacles that reasons quote, mm.
const SHADOWED_MM: f64 = 3.0;

/// Reason why the effect `aperture` is not simulated for a probe.
const NO_APERTURE: &str = "not simulated for very wide faces, and for phased arrays narrower than 8 wavelengths";

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
    /// Effects that are already decided to be on.
    pub(super) on: EffectSet,
}

impl Rules<'_> {
    /// Applies the rule of `effect`. Effects before it in [`Effect::ALL`] must be decided.
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
            Effect::Multiples => self.multiples(),
            Effect::Noise => self.noise(),
            Effect::Needle => self.needle(),
            Effect::Motion => self.motion(),
            Effect::Maps => self.maps(),
        }
    }

    /// Whether `effect` can be simulated for this probe and these settings.
    pub(super) fn possible(&self, effect: Effect) -> bool {
        match effect {
            Effect::Aperture => ApertureTables::possible(self.probe),
            Effect::Needle => self.settings.needle.is_some_and(|needle| needle.echoes()),
            _ => true,
        }
    }

    /// The slowest and the fastest medium; `None` if all speeds are equal. Any difference counts: at grazing incidence
    /// it causes total reflection.
    fn two_speeds(&self) -> Option<(&Medium, &Medium)> {
        self.facts.speeds().filter(|(slow, fast)| slow.acoustic().0 != fast.acoustic().0)
    }

    /// Pairs of media whose interfaces echo, bend or reflect.
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

    /// Length of path per mm of range in a medium; 1 without the effect `speed_displacement`.
    pub(super) fn speed_ratio(&self, medium: &Medium) -> f64 {
        if self.on.has(Effect::SpeedDisplacement) { medium.tissue.speed_m_s / ASSUMED_SPEED_M_S } else { 1.0 }
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
        // Without random choices, and with scatterers on the scanline's axis, rays differ only in where they cross
        // edges: by up to half a scanline's share. In fast media paths go deeper than the image, where shares are
        // wider.
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

    /// Largest invisible lateral shift of an edge, mm: half a pixel, or [`ASIDE_OF_BEAM`] of the narrowest σ, if
    /// larger.
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
            // Oblique layers have longer paths, which lose more.
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

/// The greatest `value` of any item, and that item; `None` if there are no items.
pub(super) fn most<T>(items: impl Iterator<Item = T>, value: impl Fn(&T) -> f64) -> Option<(f64, T)> {
    items.map(|item| (value(&item), item)).max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Critical angle from the slow medium into the fast one, degrees.
fn critical_deg(slow: &Medium, fast: &Medium) -> f64 {
    (slow.tissue.speed_m_s / fast.tissue.speed_m_s).asin().to_degrees()
}

/// Whether an effect is on, by the user's choice or else by the scene's need.
pub(super) fn decided(choice: Choice, called_for: bool) -> bool {
    match choice {
        Choice::Auto => called_for,
        Choice::On => true,
        Choice::Off => false,
    }
}

fn speed(medium: &Medium) -> String {
    format!("{} has {} m/s", medium.name, medium.tissue.speed_m_s)
}
