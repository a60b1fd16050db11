//! Layouts of scenes that are measured. `examples/make_scenes` writes the scenes themselves.

pub mod qa;
