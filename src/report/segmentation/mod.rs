//! Report on a scene made from a segmentation: one HTML file with its pictures.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::html::{escape, head};
use crate::anatomy::export::tissue_colour;
use crate::names::thousands;
use crate::segmentation::summary::{Row, Summary};
use crate::sink::{SinkError, write_text};

const STYLE: &str = include_str!("style.css");

/// A picture in the report.
#[derive(Debug, Clone, PartialEq)]
pub struct Plate {
    /// Caption.
    pub caption: String,
    /// Picture as a PNG file.
    pub png: Vec<u8>,
}

/// Writes the report about `summary` to `path`, with pictures of the scene and of B-mode views.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, summary: &Summary, scene: &[Plate], bmode: &[Plate]) -> Result<(), SinkError> {
    write_text(path, &page(summary, scene, bmode))
}

fn plates(out: &mut String, title: &str, plates: &[Plate]) {
    if plates.is_empty() {
        return;
    }
    // Writing to a string cannot fail.
    let _ = writeln!(out, "<h2>{title}</h2>\n<div class=\"pictures\">");
    for Plate { caption, png } in plates {
        let (data, caption) = (STANDARD.encode(png), escape(caption));
        let _ = writeln!(
            out,
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
        );
    }
    out.push_str("</div>\n");
}

fn list(out: &mut String, title: &str, class: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(out, "<h2>{title}</h2>\n<ul class=\"{class}\">");
    for line in lines {
        let _ = writeln!(out, "<li>{}</li>", escape(line));
    }
    out.push_str("</ul>\n");
}

/// Text of the page. Writing to a string cannot fail.
fn page(summary: &Summary, scene: &[Plate], bmode: &[Plate]) -> String {
    let name = summary.scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut out = head(&format!("{}: a patient's scene", escape(&name)), STYLE);
    let ml: f64 = summary.surfaces.first().map_or(0.0, |row| row.mesh_ml);
    let _ = write!(
        out,
        "<h1>{}</h1>\n<dl><dt>Made from</dt><dd>{}</dd><dt>Surfaces</dt><dd>{}</dd><dt>Triangles</dt><dd>{}</dd>\
         <dt>Outermost surface</dt><dd>{:.1} l</dd></dl>\n",
        escape(&name),
        escape(&summary.source.display().to_string()),
        summary.surfaces.len(),
        thousands(summary.triangles()),
        ml * 1e-3,
    );
    list(&mut out, "Notes", "", &summary.remarks);
    list(&mut out, "Left out: no known name", "bad", &summary.unmapped);
    plates(&mut out, "The scene", scene);
    plates(&mut out, "B-mode", bmode);
    if !summary.windows.is_empty() {
        out.push_str(
            "<h2>Windows</h2>\n<table><thead><tr><th>name<th>view<th>depth, mm<th>shadowed by bone or gas<th>face without contact</tr></thead><tbody>\n",
        );
        for window in &summary.windows {
            let _ = writeln!(
                out,
                "<tr><td>{}<td>{}<td>{:.0}<td>{:.0} %<td>{:.0} %</tr>",
                escape(&window.name),
                escape(&window.title),
                window.depth_mm,
                100.0 * window.hidden,
                100.0 * (1.0 - window.touching)
            );
        }
        out.push_str("</tbody></table>\n");
    }
    out.push_str(
        "<h2>Surfaces</h2>\n<table><thead><tr><th>surface<th>tissue<th>priority<th>triangles<th>voxels, ml<th>mesh, ml\
         <th>difference</tr></thead><tbody>\n",
    );
    for row in &summary.surfaces {
        surface_row(&mut out, row);
    }
    out.push_str("</tbody></table>\n");
    list(&mut out, "Repairs", "soft", &summary.repairs);
    out.push_str(
        "<p class=\"soft\">Volumes of voxels are counted after the labels were cleaned; those of meshes are within the \
         surfaces. Where surfaces overlap, the one of the highest priority is the medium.</p>\n</body></html>\n",
    );
    out
}

fn surface_row(out: &mut String, row: &Row) {
    let Row { name, tissue, priority, triangles, mesh_ml, voxels_ml } = row;
    let [r, g, b, _] = tissue_colour(tissue);
    let (voxels, difference) = match voxels_ml {
        Some(ml) if *ml > 0.0 => (format!("{ml:.2}"), format!("{:+.2} %", 100.0 * (mesh_ml / ml - 1.0))),
        _ => (String::new(), String::new()),
    };
    let _ = writeln!(
        out,
        "<tr><td><i style=\"background:rgb({r},{g},{b})\"></i>{}<td>{}<td>{priority}<td>{}<td>{voxels}<td>{mesh_ml:.2}\
         <td>{difference}</tr>",
        escape(name),
        escape(tissue),
        thousands(*triangles),
    );
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::segmentation::windows::WindowRow;

    #[test]
    fn the_page_stands_alone_and_shows_rows_windows_and_what_was_left_out() {
        let row = Row {
            name: "liver".into(),
            tissue: "liver".into(),
            priority: 600,
            triangles: 12_345,
            mesh_ml: 1500.0,
            voxels_ml: Some(1505.0),
        };
        let window = WindowRow {
            name: "aorta".into(),
            title: "abdominal aorta".into(),
            depth_mm: 71.0,
            hidden: 0.4,
            touching: 0.9,
        };
        let summary = Summary {
            scene: PathBuf::from("a/b.glb"),
            source: PathBuf::from("b.nii.gz"),
            surfaces: vec![row],
            facts: None,
            unmapped: vec!["`<livr>` is no known class".into()],
            repairs: vec![],
            windows: vec![window],
            remarks: vec!["the scan ends at: head".into()],
            files: vec![],
        };
        let plate = Plate { caption: "front".into(), png: vec![1, 2, 3] };
        let page = page(&summary, &[plate], &[]);
        for part in ["12,345", "-0.33 %", "&lt;livr&gt;", "40 %", "ends at: head", "base64,AQID", "b.nii.gz"] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("http") && !page.contains("<script") && !page.contains("B-mode</h2>"));
    }
}
