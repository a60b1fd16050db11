//! Analytic scenes.
