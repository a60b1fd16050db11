//! Scenes of insonify, a real-time ultrasound simulator: an obstetric phantom, and scenes of patients.
//!
//! ```
//! use insonify_scenes::phantom::Biometry;
//! use insonify_scenes::segmentation::classes::ClassTable;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Sizes of a fetus of 22 weeks, from published growth curves.
//! let biometry = Biometry::at_weeks(22.0);
//! assert!((38.0..39.0).contains(&biometry.femur_mm));
//!
//! // The tissue of a label of TotalSegmentator.
//! let table = ClassTable::builtin("total-v2")?;
//! let liver = table.named("Liver").ok_or("there is no liver")?;
//! assert_eq!((liver.value, liver.tissue.as_deref()), (Some(5), Some("liver")));
//! # Ok(())
//! # }
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`phantom`] | the obstetric phantom: mother, uterus and fetus from a table of parameters |
//! | [`segmentation`] | scenes from a patient's label maps and meshes |

pub mod phantom;

pub mod segmentation;
