//! Text output to stderr: one format for warnings, and progress bars that stay intact below the text.

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::sync::LazyLock;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt as _;

/// All progress bars of the process.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Adds a bar, if stderr is a terminal; otherwise returns `None`. Text from [`say`] and from the log appears above the
/// bar.
pub(crate) fn show(bar: ProgressBar, template: &str) -> Option<ProgressBar> {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    io::stderr().is_terminal().then(|| BARS.add(bar.with_style(style)))
}

/// Prints a line above the bars. If the terminal is closed, the line is lost.
pub(crate) fn say(text: &str) {
    // `eprintln` would panic if the terminal is closed, and a session's files would stay unfinished.
    let _ = BARS.suspend(|| writeln!(io::stderr(), "{text}"));
}

/// Starts logging to stderr. `RUST_LOG` selects what is logged. Without it, warnings are logged, and more for each
/// count of `verbose`.
pub(crate) fn start_log(verbose: u8) {
    let filter = log_filter(std::env::var("RUST_LOG").ok().as_deref(), verbose);
    // Colour codes are written only to terminals.
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let log = tracing_subscriber::fmt::layer().with_ansi(!plain && io::stderr().is_terminal());
    tracing_subscriber::registry().with(log.with_writer(|| AboveBars).event_format(Line)).with(filter).init();
}

/// Filter of the log from the user's text `wanted`: `TARGET=LEVEL` or `LEVEL`, several separated by commas. A target
/// matches all targets that begin with it, so `insonify` matches all crates of insonify.
///
/// An empty or invalid text must not silence the log; `verbose` decides then.
fn log_filter(wanted: Option<&str>, verbose: u8) -> Targets {
    let warnings = Targets::new().with_default(Level::WARN);
    let own = match verbose {
        0 => warnings,
        1 => warnings.with_target("insonify", Level::INFO),
        _ => warnings.with_target("insonify", Level::DEBUG),
    };
    wanted.filter(|text| !text.is_empty()).and_then(|text| text.parse().ok()).unwrap_or(own)
}

/// Writer to stderr, above the progress bars.
struct AboveBars;

impl Write for AboveBars {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // Must not fail if the terminal is closed: the log would panic while it reports the error.
        Ok(BARS.suspend(|| io::stderr().write(bytes)).unwrap_or(bytes.len()))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Log format `warning: text`; debug events also name their spans.
struct Line;

impl<S, N> FormatEvent<S, N> for Line
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut writer: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let level = *event.metadata().level();
        let word = match level {
            Level::ERROR => "error",
            Level::WARN => "warning",
            Level::INFO => "info",
            Level::DEBUG => "debug",
            Level::TRACE => "trace",
        };
        write!(writer, "{word}: ")?;
        if level >= Level::DEBUG {
            for span in context.event_scope().into_iter().flat_map(|scope| scope.from_root()) {
                write!(writer, "{}: ", span.name())?;
            }
        }
        context.field_format().format_fields(writer.by_ref(), event)?;
        writeln!(writer)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    #[test]
    fn the_log_holds_what_is_wanted() {
        let logs = |wanted, verbose, target: &str, level| log_filter(wanted, verbose).would_enable(target, &level);
        assert!(logs(None, 0, "insonify::sink", Level::WARN) && !logs(None, 0, "insonify::sink", Level::INFO));
        for wanted in [None, Some(""), Some("insonify=loud")] {
            assert!(logs(wanted, 1, "insonify_render::device", Level::INFO), "{wanted:?}");
            assert!(!logs(wanted, 1, "wgpu_core", Level::INFO), "{wanted:?}");
            assert!(logs(wanted, 2, "insonify::sink", Level::DEBUG), "{wanted:?}");
        }
        let own = Some("insonify=debug,wgpu_core=error");
        assert!(logs(own, 0, "insonify_core::anatomy", Level::DEBUG) && !logs(own, 0, "wgpu_core", Level::WARN));
        assert!(logs(Some("trace"), 0, "wgpu_core", Level::TRACE));
    }

    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_warning_is_a_line_for_people() {
        let kept = Kept::default();
        let writer = kept.clone();
        let log = tracing_subscriber::fmt()
            .with_max_level(Level::DEBUG)
            .with_ansi(false)
            .with_writer(move || writer.clone())
            .event_format(Line)
            .finish();
        tracing::subscriber::with_default(log, || {
            let _span = tracing::debug_span!("receive", frame = 7).entered();
            tracing::warn!("the tracker sent {}", "nothing");
            tracing::warn!(scene = "a.glb", "a hole");
            tracing::debug!("detail");
        });
        let text = String::from_utf8(kept.0.lock().unwrap().clone()).unwrap();
        assert_eq!(
            text,
            "warning: the tracker sent nothing\nwarning: a hole scene=\"a.glb\"\ndebug: receive: detail\n"
        );
    }
}
