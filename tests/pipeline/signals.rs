//! Tests of signals to the program.

use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::process::Child;
use std::time::Instant;

use nix::sys::signal::{SigHandler, Signal, kill, signal};
use nix::unistd::Pid;

use super::program::{insonify, small_station};
use super::*;

/// Time limit for a program that hangs; far longer than it takes to end.
const LIMIT: Duration = Duration::from_secs(60);

/// Starts the program with a mock tracker, with SIGHUP handled by `hangup`. Waits until the program has printed `word`.
fn started(arguments: &[&str], hangup: SigHandler, word: &str) -> (Child, impl Iterator<Item = String> + use<>) {
    let mut command = insonify(arguments);
    // SAFETY: `signal` is safe to call between fork and exec, and it installs no function.
    unsafe { command.pre_exec(move || signal(Signal::SIGHUP, hangup).map(|_| ()).map_err(Into::into)) };
    command.env("RUST_LOG", "insonify=info").stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(said.by_ref().any(|line| line.contains(word)));
    (child, said)
}

fn send(child: &Child, signal: Signal) {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), signal).unwrap();
}

fn ended(child: &mut Child) -> std::process::ExitStatus {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if started.elapsed() > LIMIT {
            child.kill().unwrap();
            panic!("it did not end");
        }
        std::thread::sleep(MS);
    }
}

#[test]
fn a_closed_terminal_ends_run_and_record_in_order() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "[tracker]\ntransport = 'mock'\nschedule = 'move 100'\n");
    for reads_on in [true, false] {
        let [of_run, of_record] = ["run", "record"].map(|name| dir.path().join(format!("{name}_{reads_on}.mcap")));
        let (run, record) = (of_run.to_str().unwrap(), of_record.to_str().unwrap());
        let commands: [(&[&str], _); 2] = [
            (&["run", &station, "--sink", "null", "--record", run], &of_run),
            (&["record", &station, "--out", record], &of_record),
        ];
        for (arguments, file) in commands {
            let (mut child, said) = started(arguments, SigHandler::SigDfl, "connected to a mock");
            let said = reads_on.then_some(said);
            if !reads_on {
                drop(child.stdout.take());
            }
            // Until there are records: without one, `record` ends with exit code 1.
            std::thread::sleep(SECOND);
            // A shell repeats the kernel's.
            send(&child, Signal::SIGHUP);
            send(&child, Signal::SIGHUP);
            let rest: Vec<String> = said.into_iter().flatten().collect();
            let status = ended(&mut child);
            assert!(status.success(), "{arguments:?}: {status}, {rest:?}");
            // An unfinished recording keeps the name of its part.
            let part = file.with_extension("mcap.part");
            assert!(file.is_file() && !part.exists(), "{arguments:?}: {rest:?}");
        }
    }
}

#[test]
fn a_program_that_was_started_to_outlive_its_terminal_does() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    // "tracking" is logged at the first frame.
    let (mut child, said) = started(&["run", &station, "--sink", "null"], SigHandler::SigIgn, "tracking");
    send(&child, Signal::SIGHUP);
    send(&child, Signal::SIGTERM);
    let rest: Vec<String> = said.collect();
    assert!(ended(&mut child).success());
    assert!(rest.iter().any(|line| line.contains("SIGTERM")), "{rest:?}");
}
