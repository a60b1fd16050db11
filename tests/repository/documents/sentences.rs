//! Test of the lengths of sentences in documents.

use pulldown_cmark::{Event, Tag, TagEnd};

use super::markdown::events;

/// Documents whose sentences must be short.
pub(crate) const SHORT: [&str; 2] = ["README.md", "ARCHITECTURE.md"];
/// Largest number of words in a sentence.
pub(crate) const WORDS_MAX: usize = 30;
/// Abbreviations whose full stop ends no sentence.
const ABBREVIATIONS: [&str; 4] = ["e.g.", "i.e.", "cf.", "vs."];

/// Messages on sentences with too many words.
pub(crate) fn too_long(name: &str, text: &str) -> Vec<String> {
    let long = sentences(text).into_iter().filter(|(_, words)| words.len() > WORDS_MAX);
    let said = |(line, words): (usize, Vec<String>)| {
        let (count, start) = (words.len(), words[..8].join(" "));
        format!("{name}:{line}: a sentence of {count} words, at most {WORDS_MAX} are allowed: {start} ...")
    };
    long.map(said).collect()
}

/// First line and words of each sentence in paragraphs, headings, list items and table cells. Inline code counts as one
/// word, a link as its text.
fn sentences(text: &str) -> Vec<(usize, Vec<String>)> {
    let mut found = Vec::new();
    // Line breaks stay, so that a sentence is found.
    let (mut block, mut first_line) = (String::new(), 0);
    let mut skipped = false;
    for (line, event) in events(text) {
        if block.is_empty() {
            first_line = line;
        }
        match event {
            Event::Start(Tag::Image { .. } | Tag::CodeBlock(_)) => skipped = true,
            Event::End(TagEnd::Image | TagEnd::CodeBlock) => skipped = false,
            Event::Text(text) if !skipped => block.push_str(&text),
            Event::Code(text) => {
                let word = |c: char| if c.is_whitespace() { '_' } else { c };
                block.extend(["`", &text.chars().map(word).collect::<String>(), "`"]);
            }
            Event::SoftBreak | Event::HardBreak => block.push('\n'),
            Event::Start(Tag::Emphasis | Tag::Strong | Tag::Link { .. })
            | Event::End(TagEnd::Emphasis | TagEnd::Strong | TagEnd::Link) => {}
            // Another block begins.
            Event::Start(_) | Event::End(_) => split(&std::mem::take(&mut block), first_line, &mut found),
            _ => {}
        }
    }
    split(&block, first_line, &mut found);
    found
}

/// Adds the sentences of a block to `found`.
fn split(block: &str, first_line: usize, found: &mut Vec<(usize, Vec<String>)>) {
    let words = (first_line..).zip(block.lines());
    let words = words.flat_map(|(line, text)| text.split_whitespace().map(move |word| (line, word)));
    // Dashes and other signs are no words.
    let words: Vec<_> = words.filter(|(_, word)| word.contains(char::is_alphanumeric)).collect();
    let mut ended = true;
    for (i, &(line, word)) in words.iter().enumerate() {
        if ended {
            found.push((line, Vec::new()));
        }
        found.last_mut().into_iter().for_each(|(_, sentence)| sentence.push(word.to_owned()));
        let last = word.trim_end_matches([')', '"', '”', '’']);
        let next = words.get(i + 1).and_then(|(_, next)| next.chars().next());
        ended =
            last.ends_with(['.', '!', '?']) && !ABBREVIATIONS.contains(&last) && !next.is_some_and(char::is_lowercase);
    }
}

#[test]
fn sentences_of_all_blocks_are_counted() {
    let text = "# A heading\n\nOne [two\nthree](four) `five six`. Next, e.g. this – v1.2 at `a.b`!\n\n- An item\n  - within\n\n\
        | a cell | another |\n|---|---|\n| one. Two | ![picture](a.png) |\n\n```\ncode\n```\n";
    let found: Vec<(usize, usize)> = sentences(text).iter().map(|(line, words)| (*line, words.len())).collect();
    let cells = [(9, 2), (9, 1), (11, 1), (11, 1)];
    assert_eq!(found, [&[(1, 2), (3, 4), (4, 6), (6, 2), (7, 1)][..], &cells].concat());
}

#[test]
fn a_long_sentence_is_found_with_its_line() {
    let long = "word ".repeat(WORDS_MAX);
    assert_eq!(too_long("a.md", &long), [""; 0]);
    for (text, line) in [
        (format!("Short.\n\nShort, too.\nThe {long}"), 4),
        (format!("- item\n- The {long}"), 2),
        (format!("| head |\n|---|\n| The {long}|"), 3),
        (format!("The `code` {}.", "word\n".repeat(WORDS_MAX - 1)), 1),
    ] {
        let found = too_long("a.md", &text);
        assert_eq!(found.len(), 1, "{text}");
        assert!(found[0].starts_with(&format!("a.md:{line}: a sentence of 31 words")), "{found:?}");
    }
}
