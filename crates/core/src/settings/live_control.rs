//! Control of a live setting on the displays: slider, caption and keys.

use std::ops::RangeInclusive;

use serde::Serialize;

/// Control of a live setting.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveControl {
    /// Name next to the control.
    pub label: &'static str,
    /// Name in the caption under the picture; empty if the caption doesn't show it.
    pub caption: &'static str,
    /// Slider; none for a switch, or if buttons and keys set the value.
    pub slider: Option<Slider>,
    /// Unit shown; none if it is the setting's unit.
    pub unit: Option<&'static str>,
    /// Factor from the setting's value to the number shown.
    pub scale: f64,
    /// Number of decimals shown.
    pub digits: usize,
    /// Keys that step the value.
    pub keys: Vec<StepKey>,
}

/// Slider of the page.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Slider {
    /// Section of the page with the slider: the `id` of an element of `index.html`.
    pub section: &'static str,
    /// Value at the left end.
    pub min: f64,
    /// Value at the right end.
    pub max: f64,
    /// Distance between two values.
    pub step: f64,
}

/// A key that steps a setting, or toggles a switch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepKey {
    /// Name of the key as in the W3C's `KeyboardEvent.key`; letters in lower case.
    pub key: &'static str,
    /// Name of the key in lists, printable ASCII.
    pub shown: &'static str,
    /// Meaning in lists.
    pub meaning: &'static str,
    /// Step that is added to the value.
    pub by: f64,
    /// Limit of the value.
    pub until: f64,
}

const fn control(label: &'static str, caption: &'static str, slider: Option<Slider>) -> LiveControl {
    LiveControl { label, caption, slider, unit: None, scale: 1.0, digits: 0, keys: Vec::new() }
}

/// A slider in a section of the page, with its ends and its step.
pub(super) const fn slider(
    label: &'static str,
    section: &'static str,
    ends: RangeInclusive<f64>,
    step: f64,
) -> LiveControl {
    control(label, label, Some(Slider { section, min: *ends.start(), max: *ends.end(), step }))
}

/// A slider over the words of a setting, in a section of the page.
pub(super) const fn choice(label: &'static str, section: &'static str, words: &[&str]) -> LiveControl {
    slider(label, section, 0.0..=(words.len() - 1) as f64, 1.0)
}

/// A switch.
pub(super) const fn toggle(label: &'static str) -> LiveControl {
    control(label, "", None)
}

/// A value that only buttons and keys set.
pub(super) const fn hidden(label: &'static str) -> LiveControl {
    control(label, "", None)
}

impl LiveControl {
    /// Changes the name in the caption; empty hides it there.
    pub(super) fn caption(self, caption: &'static str) -> Self {
        Self { caption, ..self }
    }

    /// Shows `scale` times the value, in `unit`, with `digits` decimals.
    pub(super) fn shown(self, unit: &'static str, scale: f64, digits: usize) -> Self {
        Self { unit: Some(unit), scale, digits, ..self }
    }

    /// Adds a key that changes the value by `by`.
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
