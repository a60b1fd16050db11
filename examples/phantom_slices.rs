//! Cuts the obstetric phantom along the usual scan planes and writes each cut as a PNG, coloured by tissue.
//!
//! `cargo run --release --example phantom_slices -- OUT_DIR [weeks=28] [lie=breech] [roll=90] [flexion=0.8]
//! [placenta=posterior] [fluid=90] [fat=30] [seed=7] [only=head]`

use std::error::Error;
use std::path::PathBuf;

use glam::Vec3;
use image::{Rgb, RgbImage};
use insonify::anatomy::export::tissue_colour;
use insonify::phantom::{Lie, Organ, Parameters, PlacentaSite, Wall, landmarks, organs};
use rayon::prelude::*;

/// A cut: file name, centre, right and up axes of the picture, half width and half height, mm.
struct Cut {
    name: &'static str,
    centre: Vec3,
    right: Vec3,
    up: Vec3,
    half_mm: [f32; 2],
}

/// Side of a picture's pixel, mm.
const PIXEL_MM: f32 = 0.25;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("give a folder to write to")?);
    std::fs::create_dir_all(&folder)?;
    let mut parameters = Parameters::default();
    let mut only = String::new();
    for argument in std::env::args().skip(2) {
        let (key, value) = argument.split_once('=').ok_or("options are KEY=VALUE")?;
        match key {
            "weeks" => parameters.gestational_weeks = value.parse()?,
            "lie" => parameters.lie = Lie::named(value).ok_or("no such lie")?,
            "roll" => parameters.roll_deg = value.parse()?,
            "flexion" => parameters.flexion = value.parse()?,
            "placenta" => parameters.placenta = PlacentaSite::named(value).ok_or("no such site")?,
            "fluid" => parameters.fluid_index_mm = value.parse()?,
            "fat" => parameters.maternal_fat_mm = value.parse()?,
            "wall" => parameters.wall = Wall::named(value).ok_or("no such wall")?,
            "recti_lens" => parameters.recti_lens = value.parse()?,
            "seed" => parameters.seed = value.parse()?,
            "only" => value.clone_into(&mut only),
            _ => return Err(format!("no option {key}").into()),
        }
    }
    parameters.validate()?;
    let mut organs = organs(&parameters);
    organs.sort_by_key(|o| o.priority);
    for cut in cuts(&parameters).into_iter().filter(|cut| cut.name.contains(&only)) {
        let image = slice(&organs, &cut);
        image.save(folder.join(format!("{}.png", cut.name)))?;
    }
    Ok(())
}

fn cuts(parameters: &Parameters) -> Vec<Cut> {
    let l = landmarks(parameters);
    let head = |name, offset: f32| Cut {
        name,
        centre: l.head_centre_mm + l.head_vertex * offset,
        right: l.head_face,
        up: l.fetus_left,
        half_mm: [48.0, 40.0],
    };
    let cerebellum = 0.5 * (l.cerebellum_mm[0] + l.cerebellum_mm[1]);
    let transcerebellar = Cut {
        name: "head_transcerebellar",
        centre: 0.5 * (cerebellum + l.cavum_mm),
        right: (l.cavum_mm - cerebellum).normalize(),
        up: l.fetus_left,
        half_mm: [48.0, 40.0],
    };
    let [eye, other] = l.eyes_mm;
    let orbits = Cut {
        name: "head_orbits",
        centre: 0.5 * (eye + other) - l.head_face * 22.0,
        right: l.head_face,
        up: l.fetus_left,
        half_mm: [40.0, 32.0],
    };
    let profile = Cut {
        name: "head_profile",
        centre: l.head_centre_mm - l.head_vertex * 6.0,
        right: l.head_face,
        up: l.head_vertex,
        half_mm: [48.0, 42.0],
    };
    let lips = Cut {
        name: "head_nose_lips",
        centre: l.nose_tip_mm - l.head_face * 6.0 - l.head_vertex * 4.0,
        right: l.fetus_left,
        up: l.head_vertex,
        half_mm: [30.0, 30.0],
    };
    let trunk = |name, centre, cranial: Vec3| Cut {
        name,
        centre,
        right: l.abdomen_ventral,
        up: l.abdomen_ventral.cross(cranial) * -1.0,
        half_mm: [60.0, 50.0],
    };
    let femur = l.left_femur_mm;
    let along = (femur[1] - femur[0]).normalize();
    vec![
        head("head_transthalamic", 0.0),
        head("head_transventricular", 3.0),
        transcerebellar,
        orbits,
        profile,
        lips,
        Cut {
            name: "head_coronal",
            centre: l.head_centre_mm,
            right: l.fetus_left,
            up: l.head_vertex,
            half_mm: [45.0, 45.0],
        },
        trunk("abdomen", l.abdomen_centre_mm, l.abdomen_cranial),
        trunk("heart", l.heart_centre_mm, l.heart_cranial),
        trunk("kidneys", 0.5 * (l.kidneys_mm[0][0] + l.kidneys_mm[1][0]) + l.abdomen_ventral * 10.0, l.abdomen_cranial),
        trunk("bladder", l.fetal_bladder_mm, (l.spine_mm[6] - l.spine_mm[7]).normalize()),
        Cut {
            name: "fetus_sagittal",
            centre: l.head_centre_mm + l.head_face * 18.0 - l.head_vertex * 38.0,
            right: l.head_face.cross(l.fetus_left).cross(l.fetus_left) * -1.0,
            up: l.head_vertex,
            half_mm: [95.0, 110.0],
        },
        Cut {
            name: "fetus_coronal_spine",
            centre: l.spine_mm[4],
            right: l.fetus_left,
            up: (l.spine_mm[2] - l.spine_mm[5]).normalize(),
            half_mm: [50.0, 70.0],
        },
        Cut {
            name: "femur",
            centre: 0.5 * (femur[0] + femur[1]),
            right: along,
            up: (Vec3::Z - along * along.z).normalize(),
            half_mm: [60.0, 50.0],
        },
        Cut {
            name: "mother_axial",
            centre: Vec3::new(0.0, 20.0, -10.0),
            right: Vec3::X,
            up: Vec3::Z,
            half_mm: [150.0, 105.0],
        },
        Cut {
            name: "mother_axial_head",
            centre: Vec3::new(0.0, -58.0, -10.0),
            right: Vec3::X,
            up: Vec3::Z,
            half_mm: [150.0, 105.0],
        },
        Cut {
            name: "mother_sagittal",
            centre: Vec3::new(0.0, 0.0, -10.0),
            right: Vec3::NEG_Y,
            up: Vec3::Z,
            half_mm: [180.0, 105.0],
        },
        Cut {
            name: "mother_sagittal_placenta",
            centre: Vec3::new(25.0, 0.0, -10.0),
            right: Vec3::NEG_Y,
            up: Vec3::Z,
            half_mm: [180.0, 105.0],
        },
        Cut {
            name: "mother_coronal",
            centre: Vec3::new(0.0, 0.0, -12.0),
            right: Vec3::X,
            up: Vec3::Y,
            half_mm: [150.0, 180.0],
        },
    ]
}

fn slice(organs: &[Organ], cut: &Cut) -> RgbImage {
    let [width, height] = cut.half_mm.map(|h| (2.0 * h / PIXEL_MM) as u32);
    let rows: Vec<Vec<Rgb<u8>>> = (0..height)
        .into_par_iter()
        .map(|row| {
            (0..width)
                .map(|column| {
                    let u = (column as f32 + 0.5) * PIXEL_MM - cut.half_mm[0];
                    let v = cut.half_mm[1] - (row as f32 + 0.5) * PIXEL_MM;
                    colour(organs, cut.centre + cut.right * u + cut.up * v)
                })
                .collect()
        })
        .collect();
    RgbImage::from_fn(width, height, |x, y| rows[y as usize][x as usize])
}

/// Colour of the tissue at `p`: of the organ with the highest priority that contains `p`.
fn colour(organs: &[Organ], p: Vec3) -> Rgb<u8> {
    let inside = |o: &&Organ| o.solid.bounds().distance_mm(p) <= 0.0 && o.solid.distance_mm(p) < 0.0;
    let Some(organ) = organs.iter().rev().find(inside) else { return Rgb([0, 0, 0]) };
    let [r, g, b, _] = tissue_colour(organ.tissue);
    Rgb([r, g, b])
}
