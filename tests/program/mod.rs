//! The program as a child process, and its exit codes.

use std::process::{Command, Output};

/// Command that runs the program with these arguments in the repository's root.
pub(crate) fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(arguments).env_remove("RUST_LOG").current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

pub(crate) fn insonify(arguments: &[&str]) -> Output {
    program(arguments).output().unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asserts that the program refused its input: exit code 2, no panic, and a message that contains all of `words`.
#[track_caller]
pub(crate) fn refused(output: &Output, words: &[&str]) {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(output.stdout.is_empty(), "stdout holds results only");
    for word in words {
        assert!(message.contains(word), "`{word}` is missing: {message}");
    }
}

/// Asserts exit code 0; returns what the command printed.
#[track_caller]
pub(crate) fn succeeded(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}
