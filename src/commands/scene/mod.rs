//! `insonify scene`: makes scenes from patients' data, and repairs scenes.

mod files;
mod from_labels;
mod from_meshes;
mod pictures;
mod positions;
mod repair;

use clap::{Parser, Subcommand};

use super::Failure;

/// Make scenes from patients: from label maps of CT and MR, from meshes; repair scenes.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

const AFTER_HELP: &str = "\
Examples:
  insonify scene from-labels segmentation.nii.gz --out patient.glb --report patient.html
  insonify scene from-meshes liver.stl=liver ribs.obj=bone_adult --out patient.glb
  insonify scene repair scene.glb --out mended.glb

docs/patients.md leads from a CT to a tracked mannequin.";

#[derive(Debug, Subcommand)]
enum What {
    FromLabels(from_labels::Args),
    FromMeshes(from_meshes::Args),
    Repair(repair::Args),
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.what {
        What::FromLabels(args) => from_labels::run(args),
        What::FromMeshes(args) => from_meshes::run(args),
        What::Repair(args) => repair::run(args),
    }
}
