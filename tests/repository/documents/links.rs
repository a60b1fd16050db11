//! Relative links and pictures of documents, with their anchors.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use super::markdown::{prose, spans};

/// Links of a document that lead nowhere.
pub(crate) fn broken(root: &Path, document: &Path, text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    for (line, target) in targets(text) {
        let is_elsewhere = ["http://", "https://", "mailto:"].iter().any(|scheme| target.starts_with(scheme));
        if is_elsewhere {
            continue;
        }
        let mut fault = |reason: String| faults.push(format!("{}:{line}: {target}: {reason}", document.display()));
        let (path, anchor) = target.split_once('#').map_or((target.as_str(), None), |(path, a)| (path, Some(a)));
        let own = path.is_empty();
        let Some(path) = resolved(document, path) else {
            fault("leads out of the repository".into());
            continue;
        };
        if !own && !is_there(root, &path) {
            fault("there is no such file".into());
            continue;
        }
        let Some(anchor) = anchor else { continue };
        let other = if own { Ok(text.to_owned()) } else { std::fs::read_to_string(root.join(&path)) };
        match other {
            Ok(other) if anchors(&other).contains(anchor) => {}
            Ok(_) => fault(format!("{} has no heading with this anchor", path.display())),
            Err(error) => fault(error.to_string()),
        }
    }
    faults
}

/// Line and target of each link and picture.
fn targets(text: &str) -> Vec<(usize, String)> {
    let mut prose = prose(text);
    for span in spans(&prose) {
        // Same length, so that places stay; brackets in code are no links.
        let blank: String = prose[span.range.clone()].bytes().map(|b| if b == b'\n' { '\n' } else { '_' }).collect();
        prose.replace_range(span.range, &blank);
    }
    let mut found = Vec::new();
    for (opening, closing) in [("](", ')'), ("src=\"", '"'), ("href=\"", '"')] {
        for (at, _) in prose.match_indices(opening) {
            let rest = &prose[at + opening.len()..];
            // A title may follow the target.
            let target = rest.split(closing).next().unwrap_or_default().split_whitespace().next().unwrap_or_default();
            found.push((prose[..at].matches('\n').count() + 1, target.trim_matches(['<', '>']).to_owned()));
        }
    }
    found
}

/// The path in the repository of a link in `document`.
fn resolved(document: &Path, link: &str) -> Option<PathBuf> {
    let mut path = document.parent()?.to_owned();
    for part in Path::new(link).components() {
        match part {
            Component::ParentDir => {
                if !path.pop() {
                    return None;
                }
            }
            Component::Normal(name) => path.push(name),
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(path)
}

/// Whether a file is there under this name, upper and lower case included, and not where git ignores it.
fn is_there(root: &Path, path: &Path) -> bool {
    let mut folder = root.to_owned();
    path.components().all(|part| {
        let name = part.as_os_str();
        let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let found = entries.into_iter().any(|entry| entry.file_name() == name);
        folder.push(name);
        found
    }) && !["target", "out", "third_party", "runs"].iter().any(|ignored| path.starts_with(ignored))
}

/// Anchors of the headings, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut found = BTreeSet::new();
    for line in prose(text).lines() {
        let level = line.bytes().take_while(|&byte| byte == b'#').count();
        let Some(title) = line[level..].strip_prefix(' ').filter(|_| (1..=6).contains(&level)) else { continue };
        let slug = slug(title);
        let count = seen.entry(slug.clone()).or_default();
        found.insert(if *count == 0 { slug } else { format!("{slug}-{count}") });
        *count += 1;
    }
    found
}

/// Lower case, without punctuation and the targets of links; blanks become hyphens.
fn slug(title: &str) -> String {
    let mut title = title.trim().trim_end_matches('#').trim_end().to_lowercase();
    while let Some(middle) = title.find("](") {
        let end = title[middle..].find(')').map_or(title.len(), |end| middle + end + 1);
        title.replace_range(middle..end, "");
    }
    title
        .chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

#[test]
fn anchors_are_those_of_github() {
    let text = "# What accuracy costs in time\n## `Renderer::submit`, and *more*\n### A [link](b.md) – 2 × 3\n## Again\n## Again\n\
        ```\n# a comment\n```\n";
    let expected = ["a-link--2--3", "again", "again-1", "renderersubmit-and-more", "what-accuracy-costs-in-time"];
    assert_eq!(anchors(text), expected.map(str::to_owned).into());
}

#[test]
fn broken_links_are_found() {
    let root = super::root();
    let document = Path::new("docs/broken.md");
    let wrong = [
        "[gone](gone.md)",
        "![gone](images/gone.png)",
        "[case](Commands.md)",
        "[anchor](commands.md#qualities)",
        "[own](#nowhere)\n\n## Somewhere",
        "[out](../../elsewhere.md)",
        "[ignored](../target/release/insonify)",
        "[absolute](/docs/commands.md)",
        "[two\nlines](gone.md)",
        "<img src=\"images/gone.png\">",
        "[an anchor of a folder](images#x)",
    ];
    for text in wrong {
        assert_eq!(broken(root, document, text).len(), 1, "{text}");
    }
    let right = "[a](commands.md#quality), ![b](images/live.webp), [c](../README.md), [d](#e), [e](images \"title\"), `[f](gone.md)`\n\n\
        ## E\n```\n[g](gone.md)\n```\n[h](https://example.org/x)";
    assert_eq!(broken(root, document, right), [""; 0]);
}
