//! Code blocks and inline code of Markdown documents.

use std::fs;
use std::path::{Path, PathBuf};

/// A document of the repository.
pub(crate) struct Document {
    /// Path in the repository.
    pub(crate) path: PathBuf,
    /// Its text.
    pub(crate) text: String,
}

/// Folders that git ignores, and those of other programs.
const IGNORED: [&str; 7] = ["target", "out", "third_party", "runs", "node_modules", "__pycache__", "build"];

/// All Markdown documents below `root`, in order of their paths.
pub(crate) fn documents(root: &Path) -> std::io::Result<Vec<Document>> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if path.is_dir() {
                if !name.starts_with('.') && !IGNORED.contains(&name.as_str()) {
                    folders.push(path);
                }
            } else if name.ends_with(".md") {
                let text = fs::read_to_string(&path)?;
                found.push(Document { path: path.strip_prefix(root).unwrap_or(&path).to_owned(), text });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// A fenced block of code.
pub(crate) struct Block<'a> {
    /// Language after the fence.
    pub(crate) language: &'a str,
    /// Number of its first line, from 1.
    pub(crate) line: usize,
    /// Its lines.
    pub(crate) lines: Vec<&'a str>,
}

/// The fenced blocks of a document.
pub(crate) fn blocks(text: &str) -> Vec<Block<'_>> {
    let mut found = Vec::new();
    let mut open: Option<(&str, Block<'_>)> = None;
    for (number, line) in (1..).zip(text.lines()) {
        let trimmed = line.trim_start();
        let fence = ["```", "~~~"].into_iter().find(|fence| trimmed.starts_with(fence));
        match (&mut open, fence) {
            (None, Some(fence)) => {
                let language = trimmed.trim_start_matches(['`', '~']).trim();
                open = Some((fence, Block { language, line: number + 1, lines: Vec::new() }));
            }
            (Some((with, _)), Some(fence)) if *with == fence => found.extend(open.take().map(|(_, block)| block)),
            (Some((_, block)), _) => block.lines.push(line),
            (None, None) => {}
        }
    }
    found.extend(open.map(|(_, block)| block));
    found
}

/// The document without its fenced blocks, line by line as before.
pub(crate) fn prose(text: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    for block in blocks(text) {
        // With the fences.
        let end = (block.line + block.lines.len()).min(lines.len());
        lines[block.line - 2..end].fill("");
    }
    lines.join("\n")
}

/// Inline code.
pub(crate) struct Span {
    /// Number of its line, from 1.
    pub(crate) line: usize,
    /// Its place in the text of [`prose`], with the backticks.
    pub(crate) range: std::ops::Range<usize>,
    /// The code; line breaks are spaces, and `\|` of tables is `|`.
    pub(crate) code: String,
}

/// The inline code of [`prose`].
pub(crate) fn spans(prose: &str) -> Vec<Span> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(offset) = prose[at..].find('`') {
        let start = at + offset;
        let ticks = prose[start..].bytes().take_while(|&byte| byte == b'`').count();
        let inner = start + ticks;
        // A paragraph ends at an empty line.
        let paragraph = prose[inner..].find("\n\n").map_or(prose.len(), |end| inner + end);
        at = inner;
        if let Some(end) = closing(&prose[inner..paragraph], ticks) {
            let code = prose[inner..inner + end].replace('\n', " ").replace("\\|", "|").trim().to_owned();
            at = inner + end + ticks;
            found.push(Span { line: prose[..start].matches('\n').count() + 1, range: start..at, code });
        }
    }
    found
}

/// Place of the next run of exactly `ticks` backticks.
fn closing(text: &str, ticks: usize) -> Option<usize> {
    let mut at = 0;
    while let Some(offset) = text[at..].find('`') {
        let run = text[at + offset..].bytes().take_while(|&byte| byte == b'`').count();
        if run == ticks {
            return Some(at + offset);
        }
        at += offset + run;
    }
    None
}
