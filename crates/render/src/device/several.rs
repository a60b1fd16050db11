//! Rewrites shaders so that one dispatch makes several frames; the frame's index is `workgroup_id.z`.
//!
//! Frames share tables and scene. A buffer that passes write has one part per frame, and each frame has its own
//! parameters. So only indices change: `segments[i]` becomes element i of the frame's part, and `params` becomes the
//! frame's parameters.

use std::fmt::Write as _;

use super::shaders::{PARAMS, declaration};

/// WGSL of a pass for `frames` frames. `bindings` are the numbers of the bindings whose buffers have a part per frame.
pub(super) fn source_of_frames(source: &str, bindings: &[u32], frames: u32) -> String {
    let names: Vec<&str> =
        bindings.iter().filter_map(|&binding| declaration(source, binding)).map(|(_, name)| name).collect();
    let several = format!("var<uniform> params_of: array<Params, {frames}>;\nvar<private> frame_index: u32;");
    let mut out = String::with_capacity(2 * source.len());
    for line in source.replace(PARAMS, &several).split_inclusive('\n') {
        // Comments are copied. Declarations contain no index.
        let (code, comment) = line.find("//").map_or((line, ""), |at| line.split_at(at));
        if code.contains("@group(0)") {
            out.push_str(code)
        } else {
            push_code(&mut out, code, &names, frames)
        }
        out.push_str(comment);
    }
    with_frame_index(&out)
}

/// Appends a line of code, with indices into the buffers `names` moved to the frame's part.
fn push_code(out: &mut String, code: &str, names: &[&str], frames: u32) {
    // For each open bracket, whether it belongs to a moved index.
    let mut moved = Vec::new();
    let mut rest = code;
    while let Some(first) = rest.chars().next() {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let length = if is_word(first) { rest.find(|c| !is_word(c)).unwrap_or(rest.len()) } else { first.len_utf8() };
        let (token, after) = rest.split_at(length);
        rest = after;
        match token {
            "params" if after.starts_with('.') => out.push_str("params_of[frame_index]"),
            name if names.contains(&name) && after.starts_with('[') => {
                // Writing to a string does not fail.
                let _ = write!(out, "{name}[frame_index * (arrayLength(&{name}) / {frames}u) + (");
                moved.push(true);
                rest = &after[1..];
            }
            "[" => {
                out.push('[');
                moved.push(false);
            }
            "]" => out.push_str(if moved.pop() == Some(true) { ")]" } else { "]" }),
            _ => out.push_str(token),
        }
    }
}

/// Makes `main` set `frame_index` first.
fn with_frame_index(source: &str) -> String {
    const MAIN: &str = "fn main(";
    let Some((before, main)) = source.split_once(MAIN) else { return source.to_owned() };
    let Some((arguments, body)) = main.split_once('{') else { return source.to_owned() };
    let group = "@builtin(workgroup_id) ";
    match arguments.split_once(group).and_then(|(_, named)| named.split_once(':')) {
        Some((name, _)) => format!("{before}{MAIN}{arguments}{{\n    frame_index = {}.z;{body}", name.trim()),
        None => format!("{before}{MAIN}{group}frame_of: vec3<u32>, {arguments}{{\n    frame_index = frame_of.z;{body}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = "\
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> table: array<u32>;
// Out: parts[i].
@group(0) @binding(2) var<storage, read_write> parts: array<atomic<u32>>;
fn of(i: u32) -> u32 { return parts_of[i] + atomicLoad(&parts[table[i] & 3u]); }
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = params.first + table[id.x];
}
";

    #[test]
    fn indices_are_moved_to_the_part_of_the_frame() {
        let several = source_of_frames(SOURCE, &[2], 4);
        let expected = "\
@group(0) @binding(0) var<uniform> params_of: array<Params, 4>;
var<private> frame_index: u32;
@group(0) @binding(1) var<storage, read> table: array<u32>;
// Out: parts[i].
@group(0) @binding(2) var<storage, read_write> parts: array<atomic<u32>>;
fn of(i: u32) -> u32 { return parts_of[i] + atomicLoad(&parts[frame_index * (arrayLength(&parts) / 4u) + (table[i] & 3u)]); }
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) frame_of: vec3<u32>, @builtin(global_invocation_id) id: vec3<u32>) {
    frame_index = frame_of.z;
    let at = params_of[frame_index].first + table[id.x];
}
";
        assert_eq!(several, expected);
    }

    #[test]
    fn a_group_that_has_a_name_keeps_it() {
        let source = SOURCE.replace("@builtin(global_invocation_id) id", "@builtin(workgroup_id) group");
        let several = source_of_frames(&source, &[2], 2);
        assert!(several.contains("fn main(@builtin(workgroup_id) group: vec3<u32>) {\n    frame_index = group.z;\n"));
    }
}
