//! The phantom's surfaces as a table.

use std::fmt;
use std::path::PathBuf;

use insonify_core::names::thousands;
use serde::Serialize;

use super::PhantomSurface;

/// Surfaces of a written phantom.
#[derive(Debug, Serialize)]
pub struct SurfaceList<'a> {
    path: PathBuf,
    scale: f64,
    triangles: usize,
    surfaces: Vec<Row<'a>>,
}

#[derive(Debug, Serialize)]
struct Row<'a> {
    name: &'a str,
    tissue: &'a str,
    priority: i32,
    triangles: usize,
    volume_ml: f64,
}

impl<'a> SurfaceList<'a> {
    /// List of the surfaces at `scale` in the file at `path`.
    pub fn new(path: PathBuf, scale: f64, surfaces: &'a [PhantomSurface]) -> Self {
        let row = |surface: &'a PhantomSurface| Row {
            name: &surface.name,
            tissue: &surface.tissue,
            priority: surface.priority,
            triangles: surface.mesh.triangles.len(),
            volume_ml: surface.mesh.signed_volume_mm3() * 1e-3,
        };
        let surfaces: Vec<_> = surfaces.iter().map(row).collect();
        Self { path, scale, triangles: surfaces.iter().map(|row| row.triangles).sum(), surfaces }
    }
}

impl fmt::Display for SurfaceList<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:24} {:22} {:>8} {:>10} {:>10}", "surface", "tissue", "priority", "triangles", "ml")?;
        for Row { name, tissue, priority, triangles, volume_ml } in &self.surfaces {
            let count = thousands(*triangles);
            writeln!(f, "{name:24} {tissue:22} {priority:>8} {count:>10} {volume_ml:>10.2}")?;
        }
        writeln!(f, "{} triangles in {} surfaces", thousands(self.triangles), self.surfaces.len())?;
        writeln!(f, "{}", self.path.display())
    }
}
