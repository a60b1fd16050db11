//! Controls of live settings on the displays: slider, caption and keys.

use std::ops::RangeInclusive;

use serde::Serialize;

/// Control of a live setting on the displays.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveControl {
    /// Name of the setting next to the control.
    pub label: &'static str,
    /// Name in the caption under the picture; empty if the caption doesn't show the setting.
    pub caption: &'static str,
    /// Slider; `None` for a switch, or if only buttons and keys set the value.
    pub slider: Option<Slider>,
    /// Unit that is shown; `None` if it is the setting's own unit.
    pub unit: Option<&'static str>,
    /// Factor by which the setting's value is multiplied for display.
    pub scale: f64,
    /// Number of decimals shown.
    pub digits: usize,
    /// Keys that step the value.
    pub keys: Vec<StepKey>,
}

/// Slider on the page.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Slider {
    /// Section of the page that has the slider: the `id` of an element of `index.html`.
    pub section: &'static str,
    /// Value at the left end.
    pub min: f64,
    /// Value at the right end.
    pub max: f64,
    /// Distance between neighbouring values.
    pub step: f64,
}

/// A key that steps a setting, or toggles a switch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepKey {
    /// Name of the key as in the W3C's `KeyboardEvent.key`; letters in lower case.
    pub key: &'static str,
    /// Name of the key in lists, printable ASCII.
    pub shown: &'static str,
    /// Meaning of the key in lists, printable ASCII.
    pub meaning: &'static str,
    /// Step that one press adds to the value.
    pub by: f64,
    /// Limit that steps don't pass.
    pub until: f64,
}

const fn control(label: &'static str, caption: &'static str, slider: Option<Slider>) -> LiveControl {
    LiveControl { label, caption, slider, unit: None, scale: 1.0, digits: 0, keys: Vec::new() }
}

/// Control with a slider in a section of the page. The slider has the limits `ends` and the step `step`.
pub(super) const fn slider(
    label: &'static str,
    section: &'static str,
    ends: RangeInclusive<f64>,
    step: f64,
) -> LiveControl {
    control(label, label, Some(Slider { section, min: *ends.start(), max: *ends.end(), step }))
}

/// Control of a setting whose values are words: a slider over the words, in a section of the page.
pub(super) const fn choice(label: &'static str, section: &'static str, words: &[&str]) -> LiveControl {
    slider(label, section, 0.0..=(words.len() - 1) as f64, 1.0)
}

/// Control of a switch.
pub(super) const fn toggle(label: &'static str) -> LiveControl {
    control(label, "", None)
}

/// Control of a value that only buttons and keys set.
pub(super) const fn hidden(label: &'static str) -> LiveControl {
    control(label, "", None)
}

impl LiveControl {
    /// Sets the name shown in the caption; empty leaves the setting out.
    pub(super) fn caption(self, caption: &'static str) -> Self {
        Self { caption, ..self }
    }

    /// Sets the display of the value: `scale` times the value, in `unit`, with `digits` decimals.
    pub(super) fn shown(self, unit: &'static str, scale: f64, digits: usize) -> Self {
        Self { unit: Some(unit), scale, digits, ..self }
    }

    /// Adds a key that changes the value by `by`, up to the end of its range.
    pub(super) fn key(self, key: &'static str, shown: &'static str, meaning: &'static str, by: f64) -> Self {
        self.key_until(key, shown, meaning, by, by * f64::INFINITY)
    }

    /// Adds a key that changes the value by `by`, up to the limit `until`.
    pub(super) fn key_until(
        mut self,
        key: &'static str,
        shown: &'static str,
        meaning: &'static str,
        by: f64,
        until: f64,
    ) -> Self {
        self.keys.push(StepKey { key, shown, meaning, by, until });
        self
    }
}
