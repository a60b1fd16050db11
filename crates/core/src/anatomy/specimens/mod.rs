//! Layouts of measured scenes. `examples/make_scenes` writes the scenes themselves.

pub mod qa;
