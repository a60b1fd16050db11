//! Signals that end a session in order.

use std::io;

use super::shutdown::Stop;

/// Handles Ctrl-C, and on Unix SIGTERM and SIGHUP: the first signal requests `stop`, a second one calls `at_once`. A
/// shell repeats the SIGHUP of a closed terminal, so repeated SIGHUPs count once.
///
/// # Errors
/// The handler cannot be installed, or its thread cannot be started.
pub fn on_ctrl_c(stop: &Stop, at_once: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let (stop, (ready, installed)) = (stop.clone(), std::sync::mpsc::sync_channel(1));
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        runtime.block_on(async {
            let mut signals = match StopSignals::new() {
                Ok(signals) => signals,
                Err(error) => {
                    let _ = ready.send(Err(error));
                    return;
                }
            };
            let _ = ready.send(Ok(()));
            let reason = signals.next().await;
            stop.request(reason);
            while signals.next().await == HANGUP {}
            at_once();
        });
    })?;
    installed.recv().unwrap_or_else(|_| Err(io::Error::other("the signal thread ended")))
}

const HANGUP: &str = "SIGHUP: the terminal was closed";

/// The signals that end a session.
#[cfg(unix)]
pub struct StopSignals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
    /// SIGHUP; none if the program was started to outlive its terminal.
    hangup: Option<tokio::signal::unix::Signal>,
}

#[cfg(unix)]
impl StopSignals {
    /// Handles the signals from this call on. SIGHUP stays ignored if it already is, for example by `nohup`.
    ///
    /// # Errors
    /// A handler cannot be installed.
    pub fn new() -> io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        let hangup = if hangup_is_ignored() { None } else { Some(signal(SignalKind::hangup())?) };
        Ok(Self { interrupt: signal(SignalKind::interrupt())?, terminate: signal(SignalKind::terminate())?, hangup })
    }

    /// Waits for the next signal and returns its name.
    pub async fn next(&mut self) -> &'static str {
        let hangup = async {
            match &mut self.hangup {
                Some(hangup) => hangup.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => "Ctrl-C",
            _ = self.terminate.recv() => "SIGTERM",
            _ = hangup => HANGUP,
        }
    }
}

/// Whether this process ignores SIGHUP; known on Linux only.
#[cfg(unix)]
fn hangup_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // The lowest bit is signal 1.
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// The signals that end a session.
#[cfg(windows)]
pub struct StopSignals(tokio::signal::windows::CtrlC);

#[cfg(windows)]
impl StopSignals {
    /// Handles Ctrl-C from this call on.
    ///
    /// # Errors
    /// The handler cannot be installed.
    pub fn new() -> io::Result<Self> {
        tokio::signal::windows::ctrl_c().map(Self)
    }

    /// Waits for the next signal and returns its name.
    pub async fn next(&mut self) -> &'static str {
        self.0.recv().await;
        "Ctrl-C"
    }
}
