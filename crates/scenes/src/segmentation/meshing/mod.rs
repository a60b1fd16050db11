//! Meshing of label volumes: closed surfaces of all labels on one grid, neighbours sharing their boundary.
//!
//! Surface nets (Gibson 1998) with one vertex for each cell of eight voxels that holds several labels. Vertices are
//! shared by all labels, so no gap lies between neighbours. Smoothing keeps each vertex within its cell and each label at
//! its volume. Edges are then collapsed by quadric error (Garland and Heckbert 1997).

mod collapse;
mod complex;
mod nets;
mod part;
mod quadric;
mod shell;
mod smooth;
mod volume;
mod well_composed;

pub use complex::{Complex, Triangle};
pub use nets::{Net, Quad};
pub use part::Part;

/// Label of what lies beyond the grid.
pub const BORDER: u16 = u16::MAX;

/// Meaning of the label 0: no segment.
pub const NONE: u16 = 0;
pub use well_composed::make_well_composed;
