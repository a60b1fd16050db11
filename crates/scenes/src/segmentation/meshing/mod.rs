//! Meshing of label volumes: closed surfaces of all labels on one grid. Neighbouring labels share their boundary.
//!
//! Surface nets (Gibson 1998) have one vertex for each cell of eight voxels that contains several labels. All labels
//! share these vertices, so neighbours have no gap between them. Smoothing keeps each vertex within its cell and each
//! label at its volume. Edges are then collapsed by quadric error (Garland and Heckbert 1997).

mod bucket_queue;
mod collapse;
mod complex;
pub mod contour;
mod nets;
mod part;
mod quadric;
mod shell;
pub mod shrunk;
mod smooth;
mod volume;
mod well_composed;
pub mod winding;

pub use complex::{Complex, Triangle};
pub use nets::{Net, Quad};
pub use part::Part;
pub use well_composed::make_well_composed;

/// Label of everything outside the grid.
pub const BORDER: u16 = u16::MAX;

/// Label of voxels without a segment.
pub const NONE: u16 = 0;
