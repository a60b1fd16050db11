//! Tests of the modules' order. A room is a top-level module of a crate. Within a crate, a room imports only rooms
//! below it, and the files of a folder do not import each other in a circle. Cargo enforces the order of the crates.
//! The last test is of the script that runs all tests.
//!
//! The tests read the tokens of the source: `use` trees, and inline paths that begin with `crate`, `super`, `self` or a
//! submodule's name. A name that a module re-exports counts for the file that it comes from. Code under `#[cfg(test)]`
//! is skipped. A folder's `mod.rs` is exempt, since it holds the folder's list of modules and their shared items.

// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// Rooms from the highest to the lowest. Rooms in one line do not import each other.
const ORDER: [&[&str]; 24] = [
    &["pipeline"],
    &["chooser"],
    &["measuring"],
    &["dataset"],
    &["report"],
    &["station"],
    &["sink"],
    &["presented"],
    &["generator"],
    &["selftest", "quality"],
    &["exam"],
    &["needle"],
    &["transducer"],
    &["phantom"],
    &["segmentation"],
    &["anatomy"],
    &["recording"],
    &["tracker"],
    &["pose"],
    &["acoustics"],
    &["settings"],
    &["simd"],
    &["instructions"],
    &["files", "statistics", "random", "suggest", "names", "lanes"],
];

type Module = Vec<String>;

/// Modules of a crate, and the paths that each of them names.
#[derive(Default)]
struct House {
    /// For each module, the absolute paths that it names.
    named: BTreeMap<Module, BTreeSet<Module>>,
    /// For each module, the names that it re-exports, with the paths behind them.
    exported: BTreeMap<Module, BTreeMap<String, Module>>,
}

impl House {
    /// Reads all files below `folder`, except those directly in it whose name is in `without`.
    fn read(folder: &str, without: &[&str]) -> Self {
        let folder = root().join(folder);
        let mut house = Self::default();
        for path in sources(&folder) {
            let place = path.strip_prefix(&folder).unwrap().with_extension("");
            let mut module: Vec<&str> = place.iter().map(|part| part.to_str().unwrap()).collect();
            if without.contains(&module[0]) {
                continue;
            }
            if matches!(module.last(), Some(&("mod" | "lib"))) {
                module.pop();
            }
            house.add(&module, &fs::read_to_string(&path).unwrap());
        }
        house
    }

    fn add(&mut self, module: &[&str], source: &str) {
        let module: Module = module.iter().map(|s| (*s).to_owned()).collect();
        let source: Vec<TokenTree> = source.parse::<TokenStream>().unwrap().into_iter().collect();
        let child = |three: &[TokenTree]| (is(&three[0], "mod") && is(&three[2], ";")).then(|| three[1].to_string());
        let children = source.windows(3).filter_map(child).collect();
        let mut file = File { module: module.clone(), children, named: BTreeSet::new(), exported: BTreeMap::new() };
        file.scan(source);
        self.named.insert(module.clone(), file.named);
        self.exported.insert(module, file.exported);
    }

    /// Module that contains the item at `path`: the longest prefix that is a module, with re-exports followed.
    fn holder(&self, path: &[String], depth: usize) -> Module {
        let mut module = Module::new();
        for name in path {
            let mut child = module.clone();
            child.push(name.clone());
            if self.named.contains_key(&child) {
                module = child;
                continue;
            }
            let exported = self.exported.get(&module).and_then(|names| names.get(name));
            return match exported {
                Some(target) if depth < 8 => self.holder(target, depth + 1),
                _ => module,
            };
        }
        module
    }

    /// Pairs of modules, the first of which names the second. Modules called `tests` are left out.
    fn edges(&self) -> impl Iterator<Item = (&Module, Module)> {
        let code = self.named.iter().filter(|(module, _)| !module.iter().any(|m| m.contains("tests")));
        code.flat_map(move |(module, paths)| paths.iter().map(move |path| (module, self.holder(path, 0))))
    }

    /// Edges to a room that is higher, or in the same line of `ORDER`, as text.
    fn upward(&self) -> BTreeSet<String> {
        let rank = |module: &[String]| {
            let top = module.first()?.as_str();
            ORDER.iter().position(|line| line.contains(&top))
        };
        let known = |module: &Module| module.is_empty() || rank(module).is_some();
        let mut wrong: BTreeSet<String> = self
            .named
            .keys()
            .filter(|m| !known(m))
            .map(|m| format!("{} has no place in ORDER", m.join("::")))
            .collect();
        for (who, whom) in self.edges() {
            let (Some(from), Some(to)) = (rank(who), rank(&whom)) else { continue };
            if to < from || (to == from && who.first() != whom.first()) {
                wrong.insert(format!("{} knows {}", who.join("::"), whom.join("::")));
            }
        }
        wrong
    }

    /// Circles of imports among the files and folders directly in `folder`, as text: for each file in a circle, the way
    /// back to itself.
    fn circles(&self, folder: &[String]) -> Vec<String> {
        let child = |module: &[String]| module.strip_prefix(folder).and_then(|rest| rest.first().cloned());
        let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (who, whom) in self.edges() {
            if let (Some(a), Some(b)) = (child(who), child(&whom))
                && a != b
            {
                graph.entry(a).or_default().insert(b);
            }
        }
        graph.keys().filter_map(|start| way_back(&graph, start)).map(|way| way.join(" -> ")).collect()
    }
}

/// Shortest path of edges from `start` back to itself.
fn way_back(graph: &BTreeMap<String, BTreeSet<String>>, start: &str) -> Option<Vec<String>> {
    let mut ways = vec![vec![start.to_owned()]];
    let mut seen = BTreeSet::new();
    while let Some(way) = (!ways.is_empty()).then(|| ways.remove(0)) {
        for next in graph.get(way.last()?).into_iter().flatten() {
            let mut longer = way.clone();
            longer.push(next.clone());
            if next == start {
                return Some(longer);
            }
            if seen.insert(next.clone()) {
                ways.push(longer);
            }
        }
    }
    None
}

/// Whether a token is this word or punctuation mark.
fn is(token: &TokenTree, text: &str) -> bool {
    !matches!(token, TokenTree::Group(_) | TokenTree::Literal(_)) && token.to_string() == text
}

/// The token's group, if it has these delimiters.
fn group(token: &TokenTree, delimiter: Delimiter) -> Option<&proc_macro2::Group> {
    match token {
        TokenTree::Group(group) if group.delimiter() == delimiter => Some(group),
        _ => None,
    }
}

/// Paths that one file names.
struct File {
    module: Module,
    /// Submodules that have files of their own.
    children: BTreeSet<String>,
    named: BTreeSet<Module>,
    exported: BTreeMap<String, Module>,
}

impl File {
    /// `path` from the crate's root; `None` for paths into other crates and for local names.
    fn absolute(&self, path: &[String]) -> Option<Module> {
        let (mut at, mut rest) = (self.module.clone(), path);
        match path.first()?.as_str() {
            "crate" => (at, rest) = (Module::new(), &path[1..]),
            "self" => rest = &path[1..],
            "super" => {}
            name if self.children.contains(name) => {}
            _ => return None,
        }
        while rest.first().is_some_and(|name| name == "super") {
            at.pop()?;
            rest = &rest[1..];
        }
        at.extend_from_slice(rest);
        Some(at)
    }

    /// Records the paths in code that is not a test, including those in macros.
    fn scan(&mut self, tokens: impl IntoIterator<Item = TokenTree>) {
        let mut tokens = tokens.into_iter().peekable();
        let (mut path, mut colons, mut public) = (Module::new(), 0, false);
        while let Some(token) = tokens.next() {
            match &token {
                TokenTree::Punct(mark) if mark.as_char() == ':' => {
                    colons += 1;
                    continue;
                }
                TokenTree::Ident(word) if colons == 2 => path.push(word.to_string()),
                _ => {
                    self.name(&mut path);
                    path.extend(matches!(token, TokenTree::Ident(_)).then(|| token.to_string()));
                }
            }
            colons = 0;
            let cfg = tokens.peek().filter(|_| is(&token, "#")).and_then(|next| group(next, Delimiter::Bracket));
            if cfg.is_some_and(|cfg| cfg.stream().to_string().replace(' ', "") == "cfg(test)") {
                // Skips the item.
                tokens.find(|token| is(token, ";") || group(token, Delimiter::Brace).is_some());
            } else if is(&token, "use") && !tokens.peek().is_some_and(|next| is(next, "<")) {
                let tree: Vec<TokenTree> = tokens.by_ref().take_while(|token| !is(token, ";")).collect();
                self.import(&[], &tree, public);
            }
            public = is(&token, "pub") || group(&token, Delimiter::Parenthesis).is_some();
            if let TokenTree::Group(group) = token {
                self.scan(group.stream());
            }
        }
        self.name(&mut path);
    }

    /// Records an inline path and empties it. A single word is a local name and is left out.
    fn name(&mut self, path: &mut Module) {
        let path = std::mem::take(path);
        if path.len() > 1 {
            self.named.extend(self.absolute(&path));
        }
    }

    /// Records the paths of a `use` tree below `prefix`.
    fn import(&mut self, prefix: &[String], tree: &[TokenTree], public: bool) {
        for branch in tree.split(|token| is(token, ",")) {
            let words = branch.iter().filter(|token| matches!(token, TokenTree::Ident(_))).map(ToString::to_string);
            let mut path: Module = prefix.iter().cloned().chain(words).collect();
            if let Some(inner) = branch.last().and_then(|token| group(token, Delimiter::Brace)) {
                self.import(&path, &inner.stream().into_iter().collect::<Vec<_>>(), public);
                continue;
            }
            let mut name = path.iter().position(|word| word == "as").and_then(|at| path.drain(at..).next_back());
            path.pop_if(|last| last == "self");
            name = name.or_else(|| path.last().cloned());
            let (Some(whole), Some(name)) = (self.absolute(&path), name) else { continue };
            if public {
                self.exported.insert(name, whole.clone());
            }
            self.named.insert(whole);
        }
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Source folders of the crates, relative to the repository's root.
const CRATES: [&str; 5] = ["src", "crates/core/src", "crates/tracking/src", "crates/scenes/src", "crates/render/src"];

/// Paths of the Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// The libraries of this repository, without `main` and the commands, which use them from outside.
fn libraries() -> [House; 5] {
    CRATES.map(|folder| House::read(folder, &["main", "commands"]))
}

/// The files of the commands; to them, the library is another crate.
fn commands() -> House {
    let mut house = House::read("src", &["main", "lib"]);
    house.named.retain(|module, _| module.first().is_some_and(|top| top == "commands"));
    house
}

#[test]
fn no_module_knows_one_above_it() {
    let mut count = 0;
    // The renderers are one room.
    for (folder, house) in CRATES.into_iter().zip(libraries()).filter(|(folder, _)| *folder != "crates/render/src") {
        count += house.edges().count();
        let wrong = house.upward();
        assert!(wrong.is_empty(), "{folder}: {wrong:#?}");
    }
    assert!(count > 500, "the source was not read");
}

/// Rooms that occur in `text` between `before` and `after`, in order.
fn listed(text: &str, before: &str, after: &str) -> Vec<String> {
    let names = text.match_indices(before).filter_map(|(at, _)| text[at + before.len()..].split_once(after));
    let known = |name: &&str| ORDER.iter().any(|line| line.contains(name));
    names.map(|(name, _)| name).filter(known).map(str::to_owned).collect()
}

#[test]
fn the_documents_list_the_modules_in_this_order() {
    // Rows of the table of rooms.
    let rows = include_str!("../../ARCHITECTURE.md").lines().filter(|line| line.starts_with("| `"));
    let table: String = rows.map(|row| row.split(" | ").next().unwrap().to_owned() + "\n").collect();
    let mut count = 0;
    for folder in CRATES {
        let rooms = listed(&table, &format!("`{folder}/"), "/`");
        count += rooms.len();
        let ranks = rooms.iter().map(|name| ORDER.iter().position(|line| line.contains(&name.as_str())));
        assert!(ranks.is_sorted(), "{folder}: {rooms:?}");
    }
    assert!(count > 15, "{count} rooms are listed");
}

#[test]
fn every_room_of_the_order_is_a_room() {
    for room in ORDER.concat() {
        let known = |folder: &str| {
            [format!("{folder}/{room}"), format!("{folder}/{room}.rs")].iter().any(|p| root().join(p).exists())
        };
        assert!(CRATES.into_iter().any(known), "{room} is in ORDER and in no crate");
    }
}

#[test]
fn no_files_of_a_folder_import_each_other_in_a_circle() {
    for house in libraries().iter().chain([&commands(), &House::read("python/src", &[])]) {
        assert!(house.edges().count() > 40, "the source was not read");
        let folders = house.named.keys();
        let circles =
            folders.flat_map(|f| house.circles(f).into_iter().map(move |circle| format!("{}: {circle}", f.join("::"))));
        let circles: Vec<String> = circles.collect();
        assert!(circles.is_empty(), "{circles:#?}");
    }
}

/// Names of the subcommands' modules, and the imports of one subcommand's module by another's, as text.
fn subcommands_known_by_others(house: &House) -> (BTreeSet<String>, BTreeSet<String>) {
    let root = vec!["commands".to_owned()];
    let args = |path: &Module| (path.len() == 3 && path[2] == "Args").then(|| path[1].clone());
    let subcommands: BTreeSet<String> = house.named.get(&root).into_iter().flatten().filter_map(args).collect();
    let mut wrong = BTreeSet::new();
    for (who, whom) in house.edges() {
        let Some(known) = whom.get(1).filter(|name| subcommands.contains(*name)) else { continue };
        if who.get(1).is_some_and(|own| own != known) {
            wrong.insert(format!("{} knows {}", who.join("::"), whom.join("::")));
        }
    }
    (subcommands, wrong)
}

#[test]
fn only_the_list_of_commands_knows_a_subcommand() {
    let (subcommands, wrong) = subcommands_known_by_others(&commands());
    assert!(subcommands.len() > 20, "{subcommands:?}");
    assert!(wrong.is_empty(), "what two subcommands use has a file of its own: {wrong:#?}");
    let mut house = House::default();
    house.add(&["commands"], "mod render; mod replay; enum Command { Render(render::Args), Replay(replay::Args) }");
    house.add(&["commands", "render"], "pub struct Args;");
    house.add(&["commands", "replay"], "use super::render::Args as Others;");
    assert_eq!(subcommands_known_by_others(&house).1.len(), 1);
}

/// Largest number of lines of a function.
const FUNCTION_LINES_MAX: usize = 100;

/// Functions that are exempt because they are tables, one entry after another.
const TABLES: [(&str, &str); 1] = [("crates/render/src/twin/inputs.rs", "new")];

/// Functions with a body: their names, and their numbers of lines from `fn` on.
fn functions(tokens: TokenStream) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    // Line of the latest `fn`, and the name after it.
    let (mut start, mut name) = (None, None);
    for token in tokens {
        if let TokenTree::Group(inner) = &token {
            if group(&token, Delimiter::Brace).is_some()
                && let (Some(start), Some(name)) = (start, name.take())
            {
                found.push((name, inner.span_close().end().line + 1 - start));
            }
            // Without a name, the type of a function.
            start = start.filter(|_| name.is_some());
            found.extend(functions(inner.stream()));
        } else if is(&token, ";") {
            (start, name) = (None, None);
        } else if name.is_none() && is(&token, "fn") {
            start = Some(token.span().start().line);
        } else if name.is_none() && start.is_some() {
            name = Some(token.to_string());
        }
    }
    found
}

#[test]
fn functions_have_at_most_so_many_lines() {
    let lines = |source: &str| functions(source.parse().unwrap());
    let found =
        lines("impl A {\n    /// It.\n    pub(super) fn b<T>(\n        t: fn(T),\n    ) {\n        t()\n    }\n}\n");
    assert_eq!(found, [("b".to_owned(), 5)]);
    let found = lines("trait A { fn a(); }\nfn b() {}\nstruct D { e: fn(), f: F }\nfn c() {\n}\n");
    assert_eq!(found, [("b".to_owned(), 1), ("c".to_owned(), 2)]);
    let (mut count, mut long) = (0, Vec::new());
    for path in CRATES.iter().flat_map(|folder| sources(&root().join(folder))) {
        let file = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        for (name, lines) in lines(&fs::read_to_string(&path).unwrap()) {
            count += 1;
            if lines > FUNCTION_LINES_MAX && !TABLES.contains(&(file.as_str(), &name)) {
                long.push(format!("{file}: {name} has {lines} lines"));
            }
        }
    }
    assert!(count > 5000, "{count} functions were read");
    assert!(long.is_empty(), "split what does several things: {long:#?}");
}

#[test]
fn an_upward_import_is_found() {
    let mut house = House::default();
    house.add(&[], "pub mod pose; pub mod sink;");
    house.add(&["pose"], "use std::fmt; /* */ fn f() { let s = \"crate::sink\"; } // crate::sink");
    house.add(&["sink"], "pub mod png; pub use png::Writer; use crate::pose::Pose;");
    house.add(&["sink", "png"], "use super::Writer;");
    assert_eq!(house.upward(), BTreeSet::new());
    for upward in [
        "use crate::{fmt, sink::{Writer as W}};",
        "fn f() { crate::sink::png::write() }",
        "fn f() { println!(\"{}\", [crate::sink::png::DEPTH]) }",
        "use super::sink::*;",
        "pub use crate::sink::Writer;",
    ] {
        house.add(&["pose"], upward);
        assert_eq!(house.upward().len(), 1, "{upward}");
    }
    house.add(&["pose"], "#[cfg(test)] mod tests { use crate::sink::Writer; } #[cfg(test)] use crate::sink::Writer;");
    assert_eq!(house.upward(), BTreeSet::new());
    house.add(&["attic"], "");
    assert_eq!(house.upward().into_iter().collect::<Vec<_>>(), ["attic has no place in ORDER"]);
}

#[test]
fn a_circle_is_found_through_re_exports_and_inline_paths() {
    let mut house = House::default();
    house.add(&["sink"], "pub mod browser;");
    house.add(&["sink", "browser"], "mod client; mod server; mod wire; pub use server::Server as Host;");
    house.add(&["sink", "browser", "client"], "use super::wire::{self, Map};");
    house.add(&["sink", "browser", "server"], "use super::client::Client; const QUOTE: char = '\"';");
    house.add(&["sink", "browser", "wire"], "use crate::sink::SinkError;");
    let folder = ["sink".to_owned(), "browser".to_owned()];
    assert!(house.circles(&folder).is_empty());
    for back in ["use super::{Host, super::Other};", "fn f() -> crate::sink::browser::server::X { }"] {
        house.add(&["sink", "browser", "wire"], back);
        let circles = house.circles(&folder);
        assert_eq!(circles.len(), 3, "{back}: {circles:?}");
        assert_eq!(circles[0], "client -> wire -> server -> client");
    }
}

#[cfg(unix)]
#[test]
fn the_script_of_all_tests_goes_on_after_a_failure_and_names_all_that_failed() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let cargo = dir.path().join("cargo");
    // One binary fails, the next passes, the third crashes; one combination of features warns, one doesn't build; of the
    // tests with programs of others one fails, and one finds that it can't run.
    let text = r#"#!/bin/sh
case "$*" in *features*gpu) echo "warning: unused" >&2; exit ;; *features*generator) exit 101 ;; esac
case "$*" in fmt*|clippy*|build*|doc*|*--doc*|*--no-run*) echo "    Finished" >&2; exit ;; esac
case "$*" in *by_lanes*) echo "cannot run here: no lanes"; exit 101 ;; esac
case "$*" in *simple_itk*) echo "test result: FAILED. 0 passed; 1 failed; 0 ignored"; exit 101 ;; esac
case "$*" in *--exact*) echo "test result: ok. 1 passed; 0 failed; 0 ignored"; exit ;; esac
case "$*" in *--no-fail-fast*) ;; *) exit 3 ;; esac
printf '     Running unittests src/lib.rs (target/a)\nfailures:\n\n---- a::b stdout ----\n    panicked\n\n' >&2
printf 'failures:\n    a::b\n    a::c\n\ntest result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured\n'
printf '     Running tests/commands/cli.rs (target/b)\ntest result: ok. 5 passed; 0 failed; 7 ignored; 0 measured\n'
printf "     Running tests/c.rs (target/c)\n  process didn't exit successfully: \`c\` (signal: 11)\n" >&2
exit 101
"#;
    fs::write(&cargo, text).unwrap();
    fs::set_permissions(&cargo, fs::Permissions::from_mode(0o755)).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/test");
    let mut command = std::process::Command::new(script);
    // `true` has every Python package.
    let output = command.env("CARGO", &cargo).env("INSONIFY_PYTHON", "true").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let (_, failed) = said.split_once("\nfailed:\n").unwrap();
    let lines: Vec<&str> = failed.lines().map(str::trim).collect();
    let names = ["src/lib.rs: a::b", "src/lib.rs: a::c", "tests/c.rs: ended early (signal: 11)"];
    assert_eq!(lines[..3], names);
    let check = "cargo clippy --release -p insonify --lib --no-default-features --features";
    assert_eq!(lines[3..5], [format!("{check} gpu"), format!("{check} generator")]);
    assert_eq!(lines[5], "tests/tracking: interchange::simple_itk_reads_our_sequences, with programs of others");
    // Browser and window may be installed or not.
    assert!(lines[6].starts_with("all: ") && lines[6].contains(" passed, 6 failed, "), "{said}");
    let without_device = said.contains("there is no graphics device");
    assert!(said.contains("bit_for_bit ... ignored, cannot run here: no lanes") || without_device, "{said}");
    let (_, times) = said.split_once("\ntimes:\n").unwrap();
    assert!(times.lines().take_while(|line| line.contains(" s of processor time")).count() > 8, "{said}");
}
