//! Test that clap parses every command line of the documents.

use std::path::Path;

use clap::Parser;
use clap::error::ErrorKind;

use super::Cli;

#[path = "markdown.rs"]
mod markdown;
#[path = "shell.rs"]
mod shell;

use shell::Command;

/// Programs and shell words after which a command may stand.
const BEFORE: [&str; 12] =
    ["do", "then", "else", "exec", "nice", "nohup", "parallel", "sudo", "time", "/usr/bin/time", "timeout", "xargs"];
/// Values that are tried in place of a placeholder after an option.
const VALUES: [&str; 7] = ["lq", "1", "1x1", "64x64", "page.html", "host", "0,0,0,1,0,0,0"];

/// Words of the command from `insonify` on; `None` if it doesn't run the program.
fn arguments(command: &Command) -> Option<Vec<String>> {
    let is_program = |word: &str| Path::new(word).file_name().is_some_and(|name| name == "insonify");
    let is_variable = |word: &str| {
        word.split_once('=').is_some_and(|(name, _)| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
    };
    let mut words: Vec<&str> = command.words.iter().map(String::as_str).collect();
    words.drain(..words.iter().take_while(|&&word| word == "$" || is_variable(word)).count());
    if words.starts_with(&["cargo", "run"]) && !words.contains(&"--example") {
        words.drain(..words.iter().position(|&word| word == "--")?);
        words[0] = "insonify";
    } else if BEFORE.contains(words.first()?) {
        words.drain(..words.iter().position(|word| is_program(word))?);
    }
    if !is_program(words.first()?) {
        return None;
    }
    let words = words.into_iter().take_while(|&word| word != ":::");
    let words = words.map(|word| word.trim_end_matches("...").trim_end_matches('…')).filter(|word| !word.is_empty());
    Some(words.map(|word| word.split('|').next().unwrap_or(word)).map(filled).collect())
}

/// The word, with a number in place of what a shell would substitute.
fn filled(word: &str) -> String {
    let mut text = word.replace("{}", "1");
    while let Some(start) = text.find('$') {
        let rest = &text[start + 1..];
        let end = match rest.bytes().next() {
            Some(b'(') => {
                let mut depth = 0;
                let closes = |c: char| {
                    depth += i32::from(c == '(') - i32::from(c == ')');
                    depth == 0
                };
                rest.find(closes).map_or(rest.len(), |end| end + 1)
            }
            Some(b'{') => rest.find('}').map_or(rest.len(), |end| end + 1),
            _ => rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len()),
        };
        text.replace_range(start..start + 1 + end, "1");
    }
    text
}

/// Whether the word is a placeholder for a value.
fn is_placeholder(word: &str) -> bool {
    word.len() <= 12 && word.chars().all(|c| c.is_ascii_uppercase() || c == '_')
}

/// Fault of a command line; `None` if it is right.
fn fault(words: &[String], inline: bool) -> Option<String> {
    let error = Cli::try_parse_from(words).err()?;
    let named = inline
        && words[1..]
            .iter()
            .all(|word| word.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !word.starts_with('-'));
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => return None,
        // In running text, a name stands for the command.
        ErrorKind::MissingRequiredArgument
        | ErrorKind::MissingSubcommand
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
            if named =>
        {
            return None;
        }
        _ => {}
    }
    let with = |value: &str| -> Vec<String> {
        let values = words.iter().zip(std::iter::once(&words[0]).chain(words));
        let of_option = |word: &str, before: &str| before.starts_with("--") && is_placeholder(word);
        values.map(|(word, before)| if of_option(word, before) { value.to_owned() } else { word.clone() }).collect()
    };
    let fits = VALUES.iter().any(|value| Cli::try_parse_from(with(value)).is_ok());
    (!fits).then(|| error.to_string().lines().take(2).map(str::trim).collect::<Vec<_>>().join(" "))
}

/// Number of command lines in a document, and the faults among them.
fn check(name: &str, text: &str) -> (usize, Vec<String>) {
    let mut count = 0;
    let mut faults = Vec::new();
    for command in shell::commands(text) {
        let Some(words) = arguments(&command) else { continue };
        count += 1;
        if let Some(fault) = fault(&words, command.inline) {
            faults.push(format!("{name}:{}: {}: {fault}", command.line, words.join(" ")));
        }
    }
    (count, faults)
}

#[test]
fn every_command_line_of_the_documents_parses() {
    let documents = markdown::documents(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let mut total = 0;
    let mut all = Vec::new();
    for document in documents.iter().filter(|document| !document.path.ends_with("CHANGELOG.md")) {
        let (count, faults) = check(&document.path.to_string_lossy(), &document.text);
        total += count;
        all.extend(faults);
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
    assert!(total > 80, "only {total} command lines were found");
}

#[test]
fn wrong_command_lines_are_found_wherever_they_stand() {
    let wrong = [
        "```\ninsonify rendr configs/sphere.toml\n```",
        "```\n$ insonify render\n```",
        "```sh\nINSONIFY_BACKEND=host target/release/insonify render a.toml --qualty lq # comment\n```",
        "```\nmake demo && insonify demo --fps N --speed 2\n```",
        "```\ninsonify render a.toml --quality lq \\\n  --gain 2\n```",
        "```\nparallel -j 4 insonify dataset a.toml --shards {}/16 ::: $(seq 16)\n```",
        "```\ncargo run --release -- demo --onec\n```",
        "```yaml\nargs: [\"insonify dataset a.toml --frames many\"]\n```",
        "The command `insonify tradeof` measures.",
        "The command `insonify run STATION\n--metrik F` writes.",
        "| `insonify doctor SCENE.glb\\|STATION --mend` | mends |",
        "`insonify render STATION --frames N`",
        "`insonify dataset STATION --frames x`",
        "`insonify calibrate wrist`",
    ];
    for text in wrong {
        let (count, faults) = check("broken.md", text);
        assert_eq!((count, faults.len()), (1, 1), "{text}: {faults:?}");
    }
}

#[test]
fn placeholders_alternatives_and_bare_names_parse() {
    let right = [
        "```\n$ ls\ninsonify run STATION... --duration S > out.txt 2>&1\n```",
        "```\ninsonify generator MODEL.onnx --size SIZE\n```",
        "`insonify doctor SCENE.glb|STATION`",
        "`insonify render a.toml --quality QUALITY`",
        "`insonify evaluate` judges; `insonify calibrate` and `insonify calibrate pivot` register; `insonify --version`.",
        "```\n#SBATCH --time=1\ninsonify dataset a.toml --out d --shard \"$SLURM_ARRAY_TASK_ID/64\"\n```",
        "```toml\npath = \"c.toml\" # by insonify calibrat\n```",
    ];
    for text in right {
        let (count, faults) = check("right.md", text);
        assert!(faults.is_empty(), "{text}: {faults:?}");
        assert_eq!(count == 0, text.contains("```toml"), "{text}");
    }
}
