//! Markdown documents of the repository, and the code in them.

use std::fs;
use std::path::{Path, PathBuf};

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

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

/// Markdown elements of a document, each with the number of its line, from 1.
pub(crate) fn events(text: &str) -> impl Iterator<Item = (usize, Event<'_>)> {
    let line = |at: usize| text[..at].matches('\n').count() + 1;
    let parts = Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter();
    parts.map(move |(event, range)| (line(range.start), event))
}

/// A block of code, or inline code.
pub(crate) struct Code {
    /// Language stated after the fence of a block.
    pub(crate) language: String,
    /// Whether the code stands in running text.
    pub(crate) inline: bool,
    /// Number of the first line, from 1.
    pub(crate) line: usize,
    /// Text of the code; inline code is one line.
    pub(crate) text: String,
}

/// The code of a document.
pub(crate) fn code(text: &str) -> Vec<Code> {
    let mut found = Vec::new();
    let mut open: Option<Code> = None;
    for (line, event) in events(text) {
        match event {
            Event::Code(text) => {
                found.push(Code { language: String::new(), inline: true, line, text: text.into_string() });
            }
            Event::Start(Tag::CodeBlock(kind)) => {
                let language = match kind {
                    CodeBlockKind::Fenced(language) => language.into_string(),
                    CodeBlockKind::Indented => String::new(),
                };
                open = Some(Code { language, inline: false, line, text: String::new() });
            }
            Event::Text(text) => {
                if let Some(block) = &mut open {
                    if block.text.is_empty() {
                        block.line = line;
                    }
                    block.text.push_str(&text);
                }
            }
            Event::End(TagEnd::CodeBlock) => found.extend(open.take()),
            _ => {}
        }
    }
    found
}
