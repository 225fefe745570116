//! What is heard during the work: log lines, the progress bar and Ctrl-C.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use indicatif::ProgressStyle;
use rosarium::transport;
use tracing::level_filters::LevelFilter;
use tracing_indicatif::IndicatifLayer;
use tracing_indicatif::span_ext::IndicatifSpanExt;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::{Layer, fmt};

use crate::Global;

/// Set by the first Ctrl-C; the second ends the process.
static STOP: AtomicBool = AtomicBool::new(false);

/// Shortest time between two changes of the bar.
const REFRESH: Duration = Duration::from_millis(100);

/// Sends log lines and bars to standard error. Bars are shown on terminals only.
pub(crate) fn start_logging(global: Global) {
    let style =
        ProgressStyle::with_template("{msg} [{bar:32}] {percent:>3} %  {elapsed} elapsed, {eta} left");
    let bars = IndicatifLayer::new();
    let bars = match style {
        Ok(style) => bars.with_progress_style(style.progress_chars("=> ")),
        Err(_) => bars,
    };
    let level = match global.verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        _ => LevelFilter::DEBUG,
    };
    let lines = fmt::layer()
        .with_writer(bars.get_stderr_writer())
        .with_target(false)
        .with_timer(fmt::time::uptime())
        .with_filter(if global.quiet { LevelFilter::ERROR } else { level });
    let bars = (!global.quiet).then_some(bars);
    // Fails only where a logger is set already.
    let _ = tracing::subscriber::set_global_default(tracing_subscriber::registry().with(lines).with(bars));
}

/// A line on standard error, unless the user wants quiet.
pub(crate) fn say(global: Global, line: &str) {
    if !global.quiet {
        tracing_indicatif::suspend_tracing_indicatif(|| {
            // Nothing is left to do where standard error is closed.
            let _ = writeln!(std::io::stderr(), "{line}");
        });
    }
}

/// Was Ctrl-C pressed?
pub(crate) fn stopped() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// From now on the first Ctrl-C asks the work to stop.
pub(crate) fn listen_for_ctrl_c() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let set = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
        if let Err(e) = set {
            tracing::warn!("Ctrl-C will end the program without writing: {e}");
        }
    });
}

/// A progress bar with the time left; gone when dropped.
pub(crate) struct Bar {
    span: tracing::Span,
    started: Instant,
    /// Milliseconds from `started` to the last change that was shown.
    shown_ms: AtomicU64,
}

impl Bar {
    /// A bar that is called `name`.
    pub(crate) fn new(name: &str) -> Self {
        listen_for_ctrl_c();
        let span = tracing::error_span!("work");
        span.pb_set_message(name);
        Self { span, started: Instant::now(), shown_ms: AtomicU64::new(0) }
    }

    /// Shows `done` of `total`.
    pub(crate) fn show(&self, done: u64, total: u64) {
        let now_ms = self.started.elapsed().as_millis() as u64;
        let shown_ms = self.shown_ms.load(Ordering::Relaxed);
        if now_ms < shown_ms + REFRESH.as_millis() as u64 {
            return;
        }
        // One of the threads that come here at once shows it.
        if self.shown_ms.compare_exchange(shown_ms, now_ms, Ordering::Relaxed, Ordering::Relaxed).is_ok() {
            self.span.pb_set_length(total);
            self.span.pb_set_position(done);
            self.span.pb_start();
        }
    }

    /// [`Bar::show`], and whether to go on.
    pub(crate) fn step(&self, done: u64, total: u64) -> ControlFlow<()> {
        self.show(done, total);
        if stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl transport::Progress for Bar {
    fn advance(&self, done: u64, total: u64) {
        self.show(done, total);
    }

    fn cancelled(&self) -> bool {
        stopped()
    }
}

/// Largest memory that the process has used, bytes, where the system tells.
pub(crate) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    kib.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|k| k * 1024)
}
