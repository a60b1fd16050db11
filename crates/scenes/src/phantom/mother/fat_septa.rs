//! Septa of the subcutaneous fat: a slab of connective tissue over the front of the belly, filled with lobules of fat.
//!
//! The gaps between lobules are sheets half a millimetre thin. The lobules form a lattice. They are distributed over
//! eight surfaces by the parity of their three lattice indices. Two lobules of one surface thus have another lobule
//! between them, so a coarse mesh keeps them separate.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Bounds, Solid};

use super::abdominal_wall::{AbdominalWall, SKIN_MM};
use super::vary::random;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Thickness of a septum, mm.
const SEPTUM_MM: f32 = 0.5;
/// Number of lobules across and along the belly.
const LOBULES: [i32; 2] = [7, 9];
/// Approximate depth of a lobule, mm.
const LOBULE_DEPTH_MM: f32 = 6.5;
/// Largest number of layers of lobules; in thick fat the lobules are larger instead.
const LAYERS_MAX: i32 = 3;
/// z coordinate of the axis about which angles across the belly are measured, mm.
const AXIS_Z_MM: f32 = -40.0;
/// Largest displacement of the bent lattice from a straight one for fat up to [`MODERATE_FAT_MM`], mm.
const BENT_MM: f32 = 24.0;
/// Fat thickness, mm, up to which the lattice's bounds have a fixed margin. Per further mm of fat, the margin grows by
/// 1 mm across and along the belly, and by `DEPTH_PER_MM_OF_FAT` in depth, as the belly slopes at its ends.
const MODERATE_FAT_MM: f32 = 14.0;
const DEPTH_PER_MM_OF_FAT: f32 = 2.5;
/// Depth of the slab's outer side under the skin, mm. The lobules begin slightly above it, so they hide that side.
const SLAB_UNDER_SKIN_MM: f32 = 0.6;

/// Distance of the deepest lobules from the fascia, mm. Below them lies the fat of `muscle_border`.
const ABOVE_FASCIA_MM: f32 = 0.6;
/// Depth by which the deepest lobules cover the slab's inner side, mm.
const COVER_MM: f32 = 0.3;

/// Lattice of the lobules. Its coordinates are distances across and along the belly, and depth under the skin's outer
/// side.
#[derive(Clone)]
struct Lattice {
    skin: Solid,
    /// Half extent of the septa across and along the belly, mm.
    half_mm: [f32; 2],
    /// Radius that converts the angle about the axis to a length across the belly, mm.
    radius_mm: f32,
    layers: i32,
    fat_mm: f32,
    phases: [f32; 6],
}

impl Lattice {
    fn of(parameters: &Parameters, wall: &AbdominalWall) -> Self {
        let top = wall.belly_top_mm();
        let radius_mm = top - AXIS_Z_MM;
        let layers = (wall.fat_mm / LOBULE_DEPTH_MM).round().clamp(1.0, LAYERS_MAX as f32) as i32;
        Self {
            skin: wall.under_skin(0.0),
            half_mm: [0.74 * radius_mm, 1.2 * top],
            radius_mm,
            layers,
            fat_mm: wall.fat_mm,
            phases: std::array::from_fn(|i| std::f32::consts::TAU * random(parameters.seed, 900 + i as u64)),
        }
    }

    fn bounds(&self) -> Bounds {
        let [across, along] = self.half_mm;
        let more = (self.fat_mm - MODERATE_FAT_MM).max(0.0);
        let bent = BENT_MM + more;
        let side = self.radius_mm * (across / self.radius_mm).sin() + bent;
        let low = AXIS_Z_MM + self.radius_mm * (across / self.radius_mm).cos() * 0.6
            - self.fat_mm
            - DEPTH_PER_MM_OF_FAT * more;
        Bounds {
            min: Vec3::new(-side, -along - bent, low),
            max: Vec3::new(side, along + bent, self.radius_mm + AXIS_Z_MM),
        }
    }

    /// Coordinates of a point in the scene: across and along the belly, and depth, mm.
    fn coordinates(&self, p: Vec3) -> Vec3 {
        Vec3::new(self.radius_mm * p.x.atan2(p.z - AXIS_Z_MM), p.y, -self.skin.distance_mm(p))
    }

    /// Coordinates displaced such that the septa become wavy, and oblique at depth, mm.
    fn bent(&self, q: Vec3) -> Vec3 {
        let f = &self.phases;
        let part = ((q.z - SKIN_MM) / self.fat_mm).clamp(0.0, 1.0);
        let sway = (std::f32::consts::PI * part).sin();
        let oblique = 0.5 * (q.y / 37.0 + f[4]).sin() + 0.5 * (q.x / 41.0 + f[5]).sin();
        Vec3::new(
            q.x + 3.0 * (q.y / 21.0 + f[0]).sin() + oblique * q.z,
            q.y + 3.0 * (q.x / 24.0 + f[1]).sin() - oblique * q.z,
            q.z + 0.17 * self.layer_mm() * sway * (q.x / 14.0 + f[2]).sin() * (q.y / 17.0 + f[3]).sin()
                + 0.12 * self.layer_mm() * sway * (q.x / 8.0 + f[4]).sin(),
        )
    }

    fn layer_mm(&self) -> f32 {
        // The deepest lobules end half a septum above the end of their lattice cell.
        (self.fat_mm - ABOVE_FASCIA_MM - 0.2 + 0.5 * SEPTUM_MM) / self.layers as f32
    }

    /// Slab of connective tissue. The lobules replace most of the slab; the rest of it forms the septa.
    fn slab(&self) -> Solid {
        let lattice = self.clone();
        // The slab ends inside the outermost lobules, which thus cover its sides.
        let [across, along] = [0, 1].map(|i| self.half_mm[i] * (1.0 - 0.95 / LOBULES[i] as f32));
        Solid::new(self.bounds(), move |p| {
            let q = lattice.coordinates(p);
            // The slab ends inside the deepest lobules, so they hide its inner side.
            let deep = q.z - (SKIN_MM + lattice.fat_mm - ABOVE_FASCIA_MM - COVER_MM);
            let outside = (q.x.abs() - across).max(q.y.abs() - along);
            outside.max(deep).max(SKIN_MM + SLAB_UNDER_SKIN_MM - q.z)
        })
    }

    /// Lobules whose lattice indices have the given parities.
    fn lobules(&self, parity: [i32; 3]) -> Solid {
        let lattice = self.clone();
        let [across, along] = self.half_mm;
        let size = Vec3::new(2.0 * across / LOBULES[0] as f32, 2.0 * along / LOBULES[1] as f32, self.layer_mm());
        let rounding = 0.2 * size.z.min(10.0);
        let core = 0.5 * (size - SEPTUM_MM) - rounding;
        // Nearest lattice index of the given parity, within 0..count.
        let nearest = |x: f32, parity: i32, count: i32| {
            let i = 2 * ((x - 0.5 - parity as f32) * 0.5).round() as i32 + parity;
            let last = (count - 1) - (count - 1 - parity).rem_euclid(2);
            i.clamp(parity, last.max(parity))
        };
        Solid::new(self.bounds(), move |p| {
            let q = lattice.bent(lattice.coordinates(p));
            let j = nearest((q.y + along) / size.y, parity[1], LOBULES[1]);
            // Rows are offset against each other like bricks.
            let offset = if j % 2 == 0 { 0.25 } else { -0.25 };
            let i = nearest((q.x + across) / size.x - offset, parity[0], LOBULES[0]);
            let k = nearest((q.z - SKIN_MM - 0.2) / size.z, parity[2], lattice.layers);
            let centre = Vec3::new(
                (i as f32 + 0.5 + offset) * size.x - across,
                (j as f32 + 0.5) * size.y - along,
                (k as f32 + 0.5) * size.z + SKIN_MM + 0.2,
            );
            let away = (q - centre).abs() - core;
            away.max(Vec3::ZERO).length() + away.max_element().min(0.0) - rounding
        })
    }
}

/// Organs of the subcutaneous fat: the slab of the septa, and the lobules between them.
pub(super) fn organs(parameters: &Parameters, wall: &AbdominalWall) -> Vec<Organ> {
    const NAMES: [&str; 8] = [
        "fat_lobules_1",
        "fat_lobules_2",
        "fat_lobules_3",
        "fat_lobules_4",
        "fat_lobules_5",
        "fat_lobules_6",
        "fat_lobules_7",
        "fat_lobules_8",
    ];
    let lattice = Lattice::of(parameters, wall);
    let mut organs = vec![Mother.organ("fat_septa", "septum", 12, 5.0, 8.0, lattice.slab())];
    for (n, name) in NAMES.into_iter().enumerate() {
        let parity = [n & 1, n >> 1 & 1, n >> 2 & 1].map(|b| b as i32);
        if parity[2] < lattice.layers {
            organs.push(Mother.organ(name, "fat", 13, 2.6, 6.0, lattice.lobules(parity)));
        }
    }
    organs
}
