//! Order of the modules: each imports only modules below it, and files of a folder do not import each other in a
//! circle. Last, the script that runs all tests.
//!
//! The source text is read, not compiled: `use` trees and inline paths that begin with `crate`, `super`, `self` or the name
//! of a submodule. A name that a module re-exports counts for the file that it comes from. Code under `#[cfg(test)]` is
//! skipped. A folder's `mod.rs` is exempt: it holds the folder's list of modules and their shared items.

// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Modules from the highest to the lowest. Those of one line do not import each other.
const ORDER: [&[&str]; 21] = [
    &["pipeline"],
    &["chooser"],
    &["evaluation"],
    &["dataset", "tradeoff"],
    &["report"],
    &["station"],
    &["sink"],
    &["generator"],
    &["selftest", "quality"],
    &["exam"],
    &["render"],
    &["transducer"],
    &["phantom"],
    &["segmentation"],
    &["anatomy"],
    &["recording"],
    &["tracker"],
    &["pose"],
    &["acoustics"],
    &["settings"],
    &["files", "statistics", "random", "suggest", "names", "simd", "lanes"],
];

type Module = Vec<String>;

/// Modules of a crate and the paths that each names.
#[derive(Default)]
struct House {
    /// Paths named by a module, absolute.
    named: BTreeMap<Module, BTreeSet<Module>>,
    /// Names that a module re-exports, and the paths behind them.
    exported: BTreeMap<Module, BTreeMap<String, Module>>,
}

impl House {
    fn add(&mut self, module: &[&str], source: &str) {
        let module: Module = module.iter().map(|s| (*s).to_owned()).collect();
        let file = File::read(&module, &tokens(source));
        self.named.insert(module.clone(), file.named);
        self.exported.insert(module, file.exported);
    }

    /// The module that holds what `path` names: the longest prefix that is a module, re-exports followed.
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

    /// Pairs (who, whom) of modules of which the first names the second, without modules of `tests`.
    fn edges(&self) -> impl Iterator<Item = (&Module, Module)> {
        let code = self.named.iter().filter(|(module, _)| !module.iter().any(|m| m.contains("tests")));
        code.flat_map(move |(module, paths)| paths.iter().map(move |path| (module, self.holder(path, 0))))
    }

    /// Edges that point upward or sideways in `ORDER`.
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

    /// Circles among the files and folders directly in `folder`: each file in a circle with its way back to itself.
    fn circles(&self, folder: &str) -> Vec<String> {
        let folder: Module = folder.split("::").map(str::to_owned).collect();
        let child = |module: &[String]| module.strip_prefix(&folder[..]).and_then(|rest| rest.first().cloned());
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

/// Shortest way from `start` to itself.
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

/// Paths that one file names.
#[derive(Default)]
struct File {
    named: BTreeSet<Module>,
    exported: BTreeMap<String, Module>,
}

impl File {
    fn read(module: &[String], tokens: &[String]) -> Self {
        let mut file = Self::default();
        let token = |i: usize| tokens.get(i).map_or("", String::as_str);
        let children: BTreeSet<&str> =
            (0..tokens.len()).filter(|&i| token(i) == "mod" && token(i + 2) == ";").map(|i| token(i + 1)).collect();
        let absolute = |path: &[String]| -> Option<Module> {
            let mut at = module.to_vec();
            let mut rest = path;
            match path.first()?.as_str() {
                // The crate of the renderers is one module; its `look` is known by name alone.
                "crate" if module.first().is_some_and(|top| top == "render") => {
                    (at, rest) = (vec!["render".to_owned()], &path[1..]);
                }
                "crate" => (at, rest) = (Module::new(), &path[1..]),
                "insonify_render" => (at, rest) = (vec!["render".to_owned()], &path[1..]),
                name if name.starts_with("insonify_") => (at, rest) = (Module::new(), &path[1..]),
                "self" => rest = &path[1..],
                "super" => {}
                name if children.contains(name) => {}
                _ => return None,
            }
            while rest.first().is_some_and(|s| s == "super") {
                at.pop()?;
                rest = &rest[1..];
            }
            at.extend_from_slice(rest);
            Some(at)
        };
        let mut i = 0;
        while i < tokens.len() {
            if token(i) == "#" && (i + 2..i + 6).map(token).eq(["cfg", "(", "test", ")"]) {
                i = end_of_item(tokens, i + 7);
                continue;
            }
            if token(i) == "use" {
                let public = i > 0 && (token(i - 1) == "pub" || token(i - 1) == ")");
                let end = (i..tokens.len()).find(|&j| token(j) == ";").unwrap_or(tokens.len());
                for (path, name) in leaves(&tokens[i + 1..end]) {
                    let Some(path) = absolute(&path) else { continue };
                    if public {
                        file.exported.insert(name, path.clone());
                    }
                    file.named.insert(path);
                }
                i = end;
            } else if token(i + 1) == "::" && token(i.wrapping_sub(1)) != "::" {
                let mut path = vec![token(i).to_owned()];
                while token(i + 1) == "::" {
                    path.push(token(i + 2).to_owned());
                    i += 2;
                }
                file.named.extend(absolute(&path));
            }
            i += 1;
        }
        file
    }
}

/// Index behind the item that begins at `start`: behind its `;`, or its last brace.
fn end_of_item(tokens: &[String], start: usize) -> usize {
    let mut depth = 0_usize;
    for (i, token) in tokens.iter().enumerate().skip(start) {
        match token.as_str() {
            "{" => depth += 1,
            "}" => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return i + 1;
                }
            }
            ";" if depth == 0 => return i + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// Paths of a `use` tree, each with the name that it brings in.
fn leaves(tree: &[String]) -> Vec<(Module, String)> {
    let mut found = Vec::new();
    let mut prefixes: Vec<Module> = vec![Module::new()];
    let mut path = Module::new();
    let mut name = None;
    for (i, token) in tree.iter().enumerate() {
        match token.as_str() {
            "::" => {}
            "{" => prefixes.push(std::mem::take(&mut path)),
            "," | "}" => {
                push_leaf(&mut found, &prefixes, &mut path, &mut name);
                if token == "}" {
                    prefixes.pop();
                }
            }
            "as" => name = tree.get(i + 1).cloned(),
            _ if name.is_some() => {}
            _ => path.push(token.clone()),
        }
    }
    push_leaf(&mut found, &prefixes, &mut path, &mut name);
    found
}

fn push_leaf(found: &mut Vec<(Module, String)>, prefixes: &[Module], path: &mut Module, name: &mut Option<String>) {
    if let Some(last) = path.last().cloned() {
        let mut whole = prefixes.concat();
        whole.append(path);
        if last == "self" || last == "*" {
            whole.pop();
        }
        let name = name.take().or_else(|| whole.last().cloned()).unwrap_or_default();
        found.push((whole, name));
    }
}

/// Identifiers, `::` and single characters of punctuation, without comments, strings and character literals.
fn tokens(source: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let mut i = 0;
    while i < chars.len() {
        let c = at(i);
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
        } else if c == 'r' && (at(i + 1) == '"' || at(i + 1) == '#' && matches!(at(i + 2), '"' | '#')) {
            let hashes = (i + 1..).take_while(|&j| at(j) == '#').count();
            let close: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
            i += hashes + 2;
            while i < chars.len() && !chars[i..].starts_with(&close) {
                i += 1;
            }
            i += close.len();
        } else if c == '"' {
            i += 1;
            while i < chars.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && (at(i + 2) == '\'' || at(i + 1) == '\\') {
            i += 2;
            while i < chars.len() && at(i) != '\'' {
                i += 1;
            }
            i += 1;
        } else if c.is_alphanumeric() || c == '_' {
            let start = i;
            while at(i).is_alphanumeric() || at(i) == '_' {
                i += 1;
            }
            tokens.push(chars[start..i].iter().collect());
        } else if c == ':' && at(i + 1) == ':' {
            tokens.push("::".to_owned());
            i += 2;
        } else {
            if !c.is_whitespace() {
                tokens.push(c.to_string());
            }
            i += 1;
        }
    }
    tokens
}

/// The library of this repository; commands and `main` see it from outside.
fn library() -> House {
    read(&["main", "commands"])
}

/// The binary's files; the library is another crate to them.
fn commands() -> House {
    let mut house = read(&["main", "lib"]);
    house.named.retain(|module, _| module.first().is_some_and(|top| top == "commands"));
    house
}

/// All files of the program's and of the other crates' `src/` but those directly in it with a name in `without`.
fn read(without: &[&str]) -> House {
    let mut house = House::default();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![(root.join("src"), Module::new())];
    if !without.contains(&"lib") {
        folders.extend(
            ["core", "tracking", "scenes"].map(|name| (root.join("crates").join(name).join("src"), Module::new())),
        );
        folders.push((root.join("crates/render/src"), vec!["render".to_owned()]));
    }
    while let Some((folder, module)) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
            let mut child = module.clone();
            if module.is_empty() && without.contains(&stem.as_str()) {
                continue;
            }
            if path.is_dir() {
                child.push(stem);
                folders.push((path, child));
            } else if path.extension().is_some_and(|e| e == "rs") {
                if stem != "mod" && stem != "lib" {
                    child.push(stem);
                }
                let child: Vec<&str> = child.iter().map(String::as_str).collect();
                house.add(&child, &fs::read_to_string(&path).unwrap());
            }
        }
    }
    house
}

#[test]
fn no_module_knows_one_above_it() {
    let house = library();
    assert!(house.edges().count() > 500, "the source was not read");
    let wrong = house.upward();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Modules of [`ORDER`] that `text` names as `before NAME after`, from the top down.
fn listed(text: &str, before: &str, after: &str) -> Vec<String> {
    let names = text.match_indices(before).filter_map(|(at, _)| text[at + before.len()..].split_once(after));
    let known = |name: &&str| ORDER.iter().any(|line| line.contains(name));
    names.map(|(name, _)| name).filter(known).map(str::to_owned).collect()
}

#[test]
fn the_documents_list_the_modules_in_this_order() {
    let (table, _) = include_str!("../../ARCHITECTURE.md").split_once("\nBeside `src/`").unwrap();
    let architecture = listed(table, "`src/", "/`");
    let ranks = architecture.iter().map(|name| ORDER.iter().position(|line| line.contains(&name.as_str())));
    assert!(architecture.len() > 15 && ranks.is_sorted(), "{architecture:?}");
}

#[test]
fn no_files_of_a_folder_import_each_other_in_a_circle() {
    for house in [library(), commands()] {
        assert!(house.edges().count() > 200, "the source was not read");
        let folders = house.named.keys().map(|module| module.join("::"));
        let circles = folders.flat_map(|f| house.circles(&f).into_iter().map(move |c| format!("{f}: {c}")));
        let circles: Vec<String> = circles.collect();
        assert!(circles.is_empty(), "{circles:#?}");
    }
}

/// Files of subcommands, and those of other subcommands that name them.
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

/// Lines that a function may have.
const FUNCTION_LINES_MAX: usize = 100;

/// Functions that are tables, one entry after another.
const TABLES: [(&str, &str); 2] =
    [("crates/render/src/device/buffers.rs", "of_pass"), ("crates/render/src/twin/inputs.rs", "new")];

/// Name and lines of each function in formatted source.
fn functions(source: &str) -> Vec<(&str, usize)> {
    let lines: Vec<&str> = source.lines().collect();
    let mut found = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let indent = line.len() - line.trim_start().len();
        let Some((before, after)) = line.trim_start().split_once("fn ") else { continue };
        let is_item = before
            .split_whitespace()
            .all(|word| word.starts_with("pub") || word.ends_with(')') || ["const", "async", "unsafe"].contains(&word));
        let name = after.split(['(', '<']).next().unwrap();
        let end = lines[i..].iter().position(|l| l.len() == indent + 1 && l.ends_with('}'));
        // Without a body: a method of a trait, or all on one line.
        let has_body = lines[i..].iter().find(|l| l.ends_with('{') || l.ends_with(';') || l.ends_with('}'));
        if let (true, Some(end), Some(true)) = (is_item, end, has_body.map(|l| l.ends_with('{'))) {
            found.push((name, end + 1));
        }
    }
    found
}

#[test]
fn functions_have_at_most_so_many_lines() {
    assert_eq!(
        functions("impl A {\n    pub(super) fn b<T>(\n        t: T,\n    ) {\n        t()\n    }\n}\n"),
        [("b", 5)]
    );
    assert_eq!(functions("fn a();\nfn b() {}\nfn c() {\n}\n"), [("c", 2)]);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("src")];
    let (mut count, mut long) = (0, Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let source = fs::read_to_string(&path).unwrap();
                let file = path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
                for (name, lines) in functions(&source) {
                    count += 1;
                    if lines > FUNCTION_LINES_MAX && !TABLES.contains(&(file.as_str(), name)) {
                        long.push(format!("{file}: {name} has {lines} lines"));
                    }
                }
            }
        }
    }
    assert!(count > 2000, "{count} functions were read");
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
    assert!(house.circles("sink::browser").is_empty());
    for back in ["use super::{Host, super::Other};", "fn f() -> crate::sink::browser::server::X { }"] {
        house.add(&["sink", "browser", "wire"], back);
        let circles = house.circles("sink::browser");
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
    // tests with programs of others one fails.
    let text = r#"#!/bin/sh
case "$*" in check*gpu) echo "warning: unused" >&2; exit ;; check*generator) exit 101 ;; check*) echo "    Finished" >&2; exit ;; esac
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
    let check = "cargo check --release --lib --no-default-features --features";
    assert_eq!(lines[3..5], [format!("{check} gpu"), format!("{check} generator")]);
    assert_eq!(lines[5], "tests/tracking/interchange.rs: simple_itk_reads_our_sequences, with programs of others");
    // Browser and window may be installed or not.
    assert!(lines[6].starts_with("all: ") && lines[6].contains(" passed, 6 failed, "), "{said}");
}
