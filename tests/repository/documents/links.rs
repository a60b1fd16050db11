//! Tests of relative links and pictures in documents, with their anchors.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use pulldown_cmark::{Event, LinkType, Tag, TagEnd};

use super::markdown::events;

/// Messages on the links of a document that lead nowhere.
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
    let mut found = Vec::new();
    for (line, event) in events(text) {
        match event {
            Event::Start(Tag::Link { link_type: LinkType::Email, .. }) => {}
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                found.push((line, dest_url.into_string()));
            }
            Event::Html(html) | Event::InlineHtml(html) => {
                for attribute in ["src=\"", "href=\""] {
                    let values = html.split(attribute).skip(1).filter_map(|rest| rest.split('"').next());
                    found.extend(values.map(|value| (line, value.to_owned())));
                }
            }
            _ => {}
        }
    }
    found
}

/// Path in the repository to which a link in `document` leads; `None` if it leads outside.
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

/// Whether a file with this exact name exists, case included, and git does not ignore it.
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

/// Anchors of a document's headings, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut found = BTreeSet::new();
    let mut title: Option<String> = None;
    for (_, event) in events(text) {
        match event {
            Event::Start(Tag::Heading { .. }) => title = Some(String::new()),
            Event::Text(text) | Event::Code(text) => title.iter_mut().for_each(|title| title.push_str(&text)),
            Event::End(TagEnd::Heading(_)) => {
                let slug = slug(&title.take().unwrap_or_default());
                let count = seen.entry(slug.clone()).or_default();
                found.insert(if *count == 0 { slug } else { format!("{slug}-{count}") });
                *count += 1;
            }
            _ => {}
        }
    }
    found
}

/// Anchor of a heading: lower case, without punctuation, with hyphens for blanks.
fn slug(title: &str) -> String {
    let letters = title.trim().to_lowercase();
    let letters = letters.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    letters.map(|c| if c == ' ' { '-' } else { c }).collect()
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
