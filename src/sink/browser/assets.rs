//! The page's files, embedded in the program.

/// A file of the page.
#[derive(Debug)]
pub(super) struct Asset {
    pub(super) path: &'static str,
    pub(super) content_type: &'static str,
    pub(super) bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

macro_rules! asset {
    ($path:literal, $file:literal, $content_type:expr) => {
        Asset {
            path: $path,
            content_type: $content_type,
            bytes: include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/browser/", $file)),
        }
    };
}

/// Every file of the page.
pub(super) const ASSETS: &[Asset] = &[
    asset!("/", "index.html", HTML),
    asset!("/style.css", "style.css", STYLE),
    asset!("/app.js", "app.js", SCRIPT),
    asset!("/accessibility.js", "accessibility.js", SCRIPT),
    asset!("/annotations.js", "annotations.js", SCRIPT),
    asset!("/calipers.js", "calipers.js", SCRIPT),
    asset!("/cine.js", "cine.js", SCRIPT),
    asset!("/clip.js", "clip.js", SCRIPT),
    asset!("/clip_duration.js", "clip_duration.js", SCRIPT),
    asset!("/connection.js", "connection.js", SCRIPT),
    asset!("/console.js", "console.js", SCRIPT),
    asset!("/controls.js", "controls.js", SCRIPT),
    asset!("/dragging.js", "dragging.js", SCRIPT),
    asset!("/keys.js", "keys.js", SCRIPT),
    asset!("/mark_list.js", "mark_list.js", SCRIPT),
    asset!("/marking.js", "marking.js", SCRIPT),
    asset!("/marks.js", "marks.js", SCRIPT),
    asset!("/needle.js", "needle.js", SCRIPT),
    asset!("/picture.js", "picture.js", SCRIPT),
    asset!("/scene.js", "scene.js", SCRIPT),
    asset!("/scene_gl.js", "scene_gl.js", SCRIPT),
    asset!("/scene_layers.js", "scene_layers.js", SCRIPT),
    asset!("/status.js", "status.js", SCRIPT),
    asset!("/view.js", "view.js", SCRIPT),
    asset!("/wire.js", "wire.js", SCRIPT),
    asset!("/icon.svg", "icon.svg", "image/svg+xml"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_refers_to_its_own_files_only() {
        for asset in ASSETS {
            let text = std::str::from_utf8(asset.bytes).unwrap();
            for line in text.lines() {
                let local = line.replace("http://www.w3.org/2000/svg", "");
                assert!(!local.contains("http://") && !local.contains("https://"), "{}: {line}", asset.path);
                for part in line.split("from \"./").skip(1) {
                    let name = part.split('"').next().unwrap();
                    assert!(ASSETS.iter().any(|a| a.path[1..] == *name), "{}: {line}", asset.path);
                }
            }
        }
    }
}
