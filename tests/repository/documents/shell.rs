//! Commands in documents, split into words as a shell would.

use shlex::Shlex;

use super::markdown::code;

/// A command of a document.
#[derive(Debug, PartialEq)]
pub(crate) struct Command {
    /// Number of the command's line, from 1.
    pub(crate) line: usize,
    /// Whether the command stands in running text, where its name alone may stand for it.
    pub(crate) inline: bool,
    /// Words of the command.
    pub(crate) words: Vec<String>,
}

/// Languages of code blocks that are typed into a shell.
const SHELLS: [&str; 6] = ["", "sh", "bash", "shell", "console", "text"];
/// Languages of blocks without commands.
const NO_SHELLS: [&str; 7] = ["toml", "rust", "python", "json", "wgsl", "js", "mermaid"];

/// Operators between two commands.
const OPERATORS: [&str; 5] = ["|", "||", "&", "&&", ";"];

/// The commands in a document, from its code blocks and its inline code.
pub(crate) fn commands(text: &str) -> Vec<Command> {
    let mut found = Vec::new();
    for code in code(text) {
        let mut lines = (code.line..).zip(code.text.lines());
        while let Some((line, part)) = lines.next() {
            let mut whole = part.to_owned();
            while whole.ends_with('\\') {
                whole.pop();
                whole += lines.next().map_or("", |(_, part)| part);
            }
            let all: Vec<Vec<String>> = if SHELLS.contains(&code.language.as_str()) {
                split(&whole)
            } else if NO_SHELLS.contains(&code.language.as_str()) {
                Vec::new()
            } else {
                // A command as a string of another language.
                let quoted = whole.split('"').skip(1).step_by(2).filter(|part| part.starts_with("insonify "));
                quoted.flat_map(split).collect()
            };
            found.extend(all.into_iter().map(|words| Command { line, inline: code.inline, words }));
        }
    }
    found
}

/// The simple commands of a line, without comments, redirections and the operators between them.
fn split(line: &str) -> Vec<Vec<String>> {
    let mut all: Vec<Vec<String>> = Vec::new();
    let mut words: Vec<String> = Vec::new();
    // A word after a redirection is a file; `$(...)` is one word.
    let (mut redirected, mut open) = (false, 0_usize);
    for word in Shlex::new(line) {
        let count = |mark: char| word.matches(mark).count();
        let ends = open == 0 && (OPERATORS.contains(&word.as_str()) || word.ends_with(';'));
        if open > 0 {
            let last = words.last_mut().map(|last| *last += &format!(" {word}"));
            open = if last.is_some() { (open + count('(')).saturating_sub(count(')')) } else { 0 };
        } else if redirected {
            redirected = false;
        } else if word.contains(['<', '>']) {
            redirected = word.ends_with(['<', '>']);
        } else if !OPERATORS.contains(&word.as_str()) {
            if word.contains("$(") {
                open = count('(').saturating_sub(count(')'));
            }
            words.push(word.trim_end_matches(';').to_owned());
        }
        if ends {
            redirected = false;
            all.push(std::mem::take(&mut words));
        }
    }
    all.push(words);
    all.retain(|words| !words.is_empty());
    all
}
