//! Tests of the documents: links, pictures, placeholders, make targets, lengths of sentences, and tables of figures;
//! also the size of what git tracks. The command lines in documents are tested in `command_lines.rs`, with the program.

// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod figures;
mod links;
mod markdown;
mod picture;
mod sentences;
mod shell;
mod weight;

use std::path::Path;

use markdown::documents;

/// Root of the repository.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Messages on lines with a placeholder that should have been replaced.
fn placeholders(name: &str, text: &str) -> Vec<String> {
    let is_word = |word: &str| ["TODO", "TBD", "FIXME", "XXX"].contains(&word);
    let is_marked = |line: &str| {
        line.match_indices("@@").any(|(at, _)| line[at + 2..].starts_with(|c: char| c.is_ascii_uppercase()))
    };
    let numbered = (1..).zip(text.lines());
    let left = numbered.filter(|(_, line)| is_marked(line) || line.split(|c: char| !c.is_alphanumeric()).any(is_word));
    left.map(|(number, line)| format!("{name}:{number}: a placeholder: {line}")).collect()
}

/// Messages on `make` targets that the Makefile lacks.
fn targets(name: &str, text: &str, makefile: &str) -> Vec<String> {
    let mut faults = Vec::new();
    for command in shell::commands(text).iter().filter(|command| command.words[0] == "make") {
        for target in command.words[1..].iter().filter(|word| !word.starts_with('-') && !word.contains('=')) {
            let defined = |line: &str| line.strip_prefix(target.as_str()).is_some_and(|rest| rest.starts_with(':'));
            if !makefile.lines().any(defined) {
                faults.push(format!("{name}:{}: the Makefile has no target {target}", command.line));
            }
        }
    }
    faults
}

#[track_caller]
fn none(faults: &[String]) {
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn no_document_holds_a_placeholder() {
    let all = documents(root()).unwrap();
    assert!(all.len() > 20, "only {} documents were found", all.len());
    none(&all.iter().flat_map(|d| placeholders(&d.path.to_string_lossy(), &d.text)).collect::<Vec<_>>());
}

#[test]
fn placeholders_are_found() {
    for broken in ["| @@PASSES |", "TODO: measure", "a figure (TBD)", "```\nXXX\n```"] {
        assert_eq!(placeholders("broken.md", broken).len(), 1, "{broken}");
    }
    assert_eq!(placeholders("right.md", "a diff begins with @@ -1 and TODOS are a word"), [""; 0]);
}

#[test]
fn every_link_and_picture_exists() {
    let faults: Vec<_> =
        documents(root()).unwrap().iter().flat_map(|d| links::broken(root(), &d.path, &d.text)).collect();
    none(&faults);
}

#[test]
fn every_make_target_exists() {
    let makefile = std::fs::read_to_string(root().join("Makefile")).unwrap();
    let all = documents(root()).unwrap();
    none(&all.iter().flat_map(|d| targets(&d.path.to_string_lossy(), &d.text, &makefile)).collect::<Vec<_>>());
}

#[test]
fn missing_make_targets_are_found() {
    let makefile = "CARGO ?= cargo\n.PHONY: demo dem\ndemo: setup\n\tcargo run\n";
    for broken in ["```\nmake dem\n```", "run `make -j2 ARGS=x live`", "```\ncd a && make demos # all\n```"] {
        assert_eq!(targets("broken.md", broken, makefile).len(), 1, "{broken}");
    }
    assert_eq!(
        targets("right.md", "`make demo ARGS=\"--out DIR\"`; we make pictures\n```\nmake demo\n```", makefile),
        [""; 0]
    );
}

#[test]
fn readme_and_architecture_have_no_long_sentence() {
    let text = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
    none(&sentences::SHORT.iter().flat_map(|name| sentences::too_long(name, &text(name))).collect::<Vec<_>>());
}

#[test]
fn no_tracked_file_is_large_without_a_reason() {
    let files = weight::tracked(root()).unwrap();
    assert!(files.len() > 500, "git lists {} files", files.len());
    none(&weight::faults(&files, &weight::LISTED));
}

#[test]
fn large_files_and_needless_reasons_are_found() {
    let files = |bytes| [("a.png".to_owned(), bytes)];
    assert_eq!(weight::faults(&files(weight::LARGEST), &[]), [""; 0]);
    assert!(weight::faults(&files(weight::LARGEST + 1), &[])[0].starts_with("a.png has 1000001 bytes"));
    assert_eq!(weight::faults(&files(weight::LARGEST + 1), &[("a.png", "a film")]), [""; 0]);
    for (bytes, listed) in [(9, ("a.png", "a film")), (weight::LARGEST + 1, ("a.png", "")), (9, ("gone.png", "a film"))]
    {
        assert_eq!(weight::faults(&files(bytes), &[listed]).len(), 1, "{listed:?}");
    }
}
