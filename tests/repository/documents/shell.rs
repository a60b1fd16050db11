//! Commands in documents, split into words as a shell would.

use super::markdown::{blocks, prose, spans};

/// A command of a document.
#[derive(Debug, PartialEq)]
pub(crate) struct Command {
    /// Number of its line, from 1.
    pub(crate) line: usize,
    /// Whether it stands in running text, where a command's name alone may stand for it.
    pub(crate) inline: bool,
    /// Its words.
    pub(crate) words: Vec<String>,
}

/// Languages of blocks that are typed into a shell.
const SHELLS: [&str; 6] = ["", "sh", "bash", "shell", "console", "text"];
/// Languages of blocks without commands.
const NO_SHELLS: [&str; 6] = ["toml", "rust", "python", "json", "wgsl", "js"];

/// The commands of a document: of its blocks, and its inline code.
pub(crate) fn commands(text: &str) -> Vec<Command> {
    let mut found = Vec::new();
    for block in blocks(text) {
        let mut lines = (block.line..).zip(block.lines.iter());
        while let Some((line, part)) = lines.next() {
            let mut whole = (*part).to_owned();
            while whole.ends_with('\\') {
                whole.pop();
                whole += lines.next().map_or("", |(_, part)| part);
            }
            if SHELLS.contains(&block.language) {
                found.extend(split(&whole).into_iter().map(|words| Command { line, inline: false, words }));
            } else if !NO_SHELLS.contains(&block.language) {
                // A command as a string of another language.
                let quoted = whole.split('"').skip(1).step_by(2).filter(|part| part.starts_with("insonify "));
                let words = quoted.flat_map(split);
                found.extend(words.map(|words| Command { line, inline: false, words }));
            }
        }
    }
    for span in spans(&prose(text)) {
        let words = split(&span.code).into_iter();
        found.extend(words.map(|words| Command { line: span.line, inline: true, words }));
    }
    found
}

/// The simple commands of a line: without comments, redirections and operators between them.
fn split(line: &str) -> Vec<Vec<String>> {
    let mut all = Vec::new();
    let mut words: Vec<String> = Vec::new();
    let mut word: Option<String> = None;
    let mut chars = line.chars().peekable();
    // A word after a redirection is a file.
    let mut redirected = false;
    let mut before = ' ';
    while let Some(c) = chars.next() {
        let next = chars.peek().copied().unwrap_or(' ');
        match c {
            '\'' | '"' => {
                let word = word.get_or_insert_default();
                word.extend(chars.by_ref().take_while(|&inner| inner != c));
            }
            '$' if next == '(' => {
                let mut depth = 0;
                let word = word.get_or_insert_default();
                word.push(c);
                for inner in chars.by_ref() {
                    depth += i32::from(inner == '(') - i32::from(inner == ')');
                    word.push(inner);
                    if depth == 0 {
                        break;
                    }
                }
            }
            '#' if word.is_none() => break,
            '>' | '<' => {
                word.take();
                redirected = true;
            }
            // `A|B` without spaces are alternatives.
            '|' if !before.is_whitespace() && !next.is_whitespace() && next != '|' && before != '|' => {
                word.get_or_insert_default().push(c);
            }
            '|' | ';' | '&' => {
                words.extend(word.take().filter(|_| !redirected));
                redirected = false;
                all.push(std::mem::take(&mut words));
            }
            c if c.is_whitespace() => {
                if let Some(word) = word.take() {
                    if !redirected {
                        words.push(word);
                    }
                    redirected = false;
                }
            }
            c => word.get_or_insert_default().push(c),
        }
        before = c;
    }
    words.extend(word.filter(|_| !redirected));
    all.push(words);
    all.retain(|words| !words.is_empty());
    all
}
