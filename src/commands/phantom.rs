//! `insonify phantom`: writes the obstetric phantom as a glTF file.

use std::path::PathBuf;

use clap::Parser;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use insonify::anatomy::export::write_moving_glb;
use insonify::anatomy::planes;
use insonify::files::Outputs;
use insonify::phantom::{self, Lie, Parameters, PhantomOptions, PlacentaSite, SurfaceList, Wall, build, movement};
use insonify::sink::write_json;

use super::progress::Progress;
use super::{Failure, output};

/// Make the obstetric phantom: a pregnant belly, as closed surfaces in a .glb file.
///
/// Its standard planes go into a file beside it (.planes.json). The same options give the same files, byte for byte. At scale 1 the fetus has 400 000 triangles and the mother 275 000.
#[derive(Debug, Parser)]
#[command(
    after_help = "Example:\n  insonify phantom --out out/phantom.glb --weeks 28 --lie breech --placenta posterior --scale 0.25"
)]
pub(crate) struct Args {
    /// File to write (.glb)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Replace FILE and its planes if they are there
    #[arg(long)]
    force: bool,

    /// Number of triangles relative to the full phantom, 0.01..=20; refused if fine parts would be lost (below ~0.24)
    #[arg(long, value_name = "S", default_value_t = 1.0, allow_negative_numbers = true)]
    scale: f64,

    /// Gestational age in weeks, 16..=34
    #[arg(long, value_name = "WEEKS", default_value_t = Parameters::default().gestational_weeks, allow_negative_numbers = true)]
    weeks: f64,

    /// Fetal lie: head down, head up, or across
    #[arg(long, value_name = "LIE", default_value = Parameters::default().lie.name(), value_parser = lie())]
    lie: Lie,

    /// Roll of the fetus about its long axis, degrees, -180..=180; 0 is left side up
    #[arg(long, value_name = "DEG", default_value_t = Parameters::default().roll_deg, allow_negative_numbers = true)]
    roll: f64,

    /// Flexion of the fetus, 0..=1: 0 is stretched, 1 tightly curled
    #[arg(long, value_name = "F", default_value_t = Parameters::default().flexion, allow_negative_numbers = true)]
    flexion: f64,

    /// Placental site on the uterine wall
    #[arg(long, value_name = "SITE", default_value = Parameters::default().placenta.name(), value_parser = site())]
    placenta: PlacentaSite,

    /// Amniotic fluid index in mm: oligohydramnios to polyhydramnios, 50..=250
    #[arg(long, value_name = "MM", default_value_t = Parameters::default().fluid_index_mm, allow_negative_numbers = true)]
    fluid_index: f64,

    /// The mother's subcutaneous fat over the belly in mm, 5..=60 [default: 13.5; 24 with a hard wall]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    fat: Option<f64>,

    /// Aberration by the abdominal wall: a median of 13, 45 or 71 ns RMS over 30 mm of aperture
    #[arg(long, value_name = "WALL", default_value = Parameters::default().wall.name(), value_parser = wall())]
    wall: Wall,

    /// Fill the gap between the rectus muscles with fat: a lens that doubles structures behind the midline
    #[arg(long)]
    recti_lens: bool,

    /// Seed of the variation between individuals
    #[arg(long, value_name = "N", default_value_t = Parameters::default().seed)]
    seed: u64,

    /// Print the table of surfaces as JSON
    #[arg(long)]
    json: bool,
}

fn lie() -> impl TypedValueParser<Value = Lie> {
    PossibleValuesParser::new(Lie::NAMES).try_map(|word| Lie::named(&word).ok_or("no such lie"))
}

fn site() -> impl TypedValueParser<Value = PlacentaSite> {
    PossibleValuesParser::new(PlacentaSite::NAMES).try_map(|word| PlacentaSite::named(&word).ok_or("no such site"))
}

fn wall() -> impl TypedValueParser<Value = Wall> {
    PossibleValuesParser::new(Wall::NAMES).try_map(|word| Wall::named(&word).ok_or("no such wall"))
}

impl Args {
    fn options(&self) -> PhantomOptions {
        let parameters = Parameters {
            gestational_weeks: self.weeks,
            lie: self.lie,
            roll_deg: self.roll,
            flexion: self.flexion,
            placenta: self.placenta,
            fluid_index_mm: self.fluid_index,
            maternal_fat_mm: self.fat.unwrap_or(self.wall.fat_mm()),
            wall: self.wall,
            recti_lens: self.recti_lens,
            seed: self.seed,
        };
        PhantomOptions { scale: self.scale, parameters }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let planes_file = planes::planes_path(&args.out);
    Outputs::default().file("--out", &args.out, args.force)?.file("--out", &planes_file, args.force)?;
    let progress = Progress::new("phantom", 0);
    let surfaces = build(&args.options(), &|p| progress.set(p.done, p.total))?;
    drop(progress);
    output::make_parent(&args.out)?;
    let parameters = args.options().parameters;
    write_moving_glb(&surfaces, &movement(&parameters), &args.out)?;
    write_json(&planes_file, &phantom::planes(&parameters))?;
    let list = SurfaceList::new(args.out.clone(), args.scale, &surfaces);
    if args.json { output::json(&list) } else { output::text(&list) }
}
