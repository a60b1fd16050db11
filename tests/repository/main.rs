//! Tests of the repository itself: its documents and the order of its modules.

mod documents;
mod house;
