//! What is printed. Texts from files may hold terminal commands, and a reader of stdout may leave.

use core::fmt;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use docktwin_model::input::plain;
use docktwin_pilot::has_terminal;

/// Whether output was lost other than by a reader that has gone, which was then reported.
static LOST: AtomicBool = AtomicBool::new(false);

/// Whether output was lost: then the exit code is not that of success.
pub(crate) fn lost() -> bool {
    LOST.load(Ordering::Relaxed)
}

/// Prints a line. A reader that has gone (`docktwin … | head`) is no error of ours; a full disk
/// behind `>` is told once on stderr, and the run goes on.
pub(crate) fn line(mut to: impl Write, text: fmt::Arguments<'_>) {
    let mut text = plain(&text.to_string()) + "\n";
    // While a pilot has the terminal, it begins no line by itself.
    if has_terminal() {
        text = text.replace('\n', "\r\n");
    }
    let said = to.write_all(text.as_bytes()).and_then(|()| to.flush());
    if let Err(e) = said
        && e.kind() != ErrorKind::BrokenPipe
        && !LOST.swap(true, Ordering::Relaxed)
    {
        // Nothing can be done when stderr is gone too.
        let _ = writeln!(std::io::stderr(), "the output could not be written: {e}");
    }
}

/// Shadows that of `std` in this crate: nothing reaches a terminal unescaped, and no closed pipe
/// panics.
macro_rules! println {
    () => { $crate::terminal::line(std::io::stdout().lock(), format_args!("")) };
    ($($text:tt)*) => { $crate::terminal::line(std::io::stdout().lock(), format_args!($($text)*)) };
}

/// As `println`, on stderr.
macro_rules! eprintln {
    () => { $crate::terminal::line(std::io::stderr().lock(), format_args!("")) };
    ($($text:tt)*) => { $crate::terminal::line(std::io::stderr().lock(), format_args!($($text)*)) };
}
