//! The needle's passes: shadow in the scan plane, echoes on the focused lines, outline in the segmentation.

pub(super) mod echo;
pub(super) mod map;
pub(super) mod shadow;
