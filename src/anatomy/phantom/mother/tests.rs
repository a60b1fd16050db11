//! Tests over a grid of parameters.
