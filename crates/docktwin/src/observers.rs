//! Who looks on at the terminal while a run happens: a pilot's line, a progress bar, the operator.

use core::fmt;
use std::io::{BufRead as _, IsTerminal as _, Write as _};

use docktwin_core::{Euler, Wrench};
use docktwin_hil::{
    realtime::{Termination, catch_termination},
    scheduler::Check,
};
use docktwin_physics::reduced::Inputs;
use docktwin_run::{
    Control, RunError, Sink, SinkError, Situation,
    progress::Progress,
    rig_place::{Operator, RigPlace},
    sink::{Header, TickView},
};

/// Ends a run when the terminal or the system asks for it, as control beside all others.
#[derive(Clone, Copy)]
pub(crate) struct Interrupt(Termination);

impl Interrupt {
    /// From here on a signal closes the run instead of killing it.
    pub(crate) fn catch() -> Self {
        Self(catch_termination())
    }
}

impl Control for Interrupt {
    fn wrenches(&mut self, _now: &Situation) -> Inputs {
        Inputs::default()
    }

    fn stopped(&self) -> Option<&'static str> {
        self.0.signal()
    }
}

/// Between two lines to a pilot, ns of the run's time.
const PILOT_LINE_NS: u64 = 100_000_000;

/// What a pilot without a window flies by: one line that replaces itself.
#[derive(Default)]
pub(crate) struct PilotLine {
    tick_nanos: u64,
    ticks: u64,
}

impl PilotLine {
    /// Whether a line is due with this tick.
    fn due(&mut self) -> bool {
        let every = (PILOT_LINE_NS / self.tick_nanos.max(1)).max(1);
        let due = self.ticks.is_multiple_of(every);
        self.ticks += 1;
        due
    }
}

impl Sink for PilotLine {
    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        self.tick_nanos = header.scenario.run.tick_nanos;
        Ok(())
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        if self.due() {
            let when = format!("t {:7.2} s", t.time.seconds());
            write_line(&when, &Flight { now: t.situation, control: &t.control.chaser });
        }
        Ok(())
    }

    fn approach(&mut self, phase: &'static str, situation: &Situation) {
        if self.due() {
            let flight = Flight { now: situation, control: &Wrench::ZERO };
            write_line(&format!("{phase:8}"), &flight);
        }
    }
}

fn write_line(when: &str, flight: &Flight<'_>) {
    // A terminal that has gone ends the run by its keyboard.
    let _ = std::io::stderr().write_all(format!("\r{when}  {flight}\x1b[K").as_bytes());
}

struct Flight<'a> {
    now: &'a Situation,
    /// F1, M1 in `e1`.
    control: &'a Wrench,
}

impl fmt::Display for Flight<'_> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (p, e) = (self.now.x_34.p, Euler::from_quat(self.now.x_34.q));
        let Wrench { f, m } = self.control;
        write!(
            to,
            "x {:+.3} y {:+.3} z {:+.3} m  closing {:+.3} m/s  roll {:+.2} pitch {:+.2} yaw {:+.2} °  \
             contact {:.0} N  F1 {:+.0} {:+.0} {:+.0} N  M1 {:+.0} {:+.0} {:+.0} N·m",
            p.x,
            p.y,
            p.z,
            self.now.closing_m_s(),
            e.roll.to_degrees(),
            e.pitch.to_degrees(),
            e.yaw.to_degrees(),
            self.now.port4.f.length(),
            f.x,
            f.y,
            f.z,
            m.x,
            m.y,
            m.z,
        )
    }
}

/// A progress bar on stderr, where that is a terminal.
pub(crate) struct Bar(indicatif::ProgressBar);

impl Bar {
    /// `hidden` where stderr is somebody else's.
    pub(crate) fn new(hidden: bool) -> Self {
        Self(progress(1, hidden))
    }
}

/// A bar of so many steps.
pub(crate) fn progress(steps: u64, hidden: bool) -> indicatif::ProgressBar {
    if hidden || !std::io::stderr().is_terminal() {
        return indicatif::ProgressBar::hidden();
    }
    let style = indicatif::ProgressStyle::with_template("{bar:40} {percent}% {eta} left")
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar());
    indicatif::ProgressBar::new(steps).with_style(style)
}

impl Progress for Bar {
    fn at(&mut self, done: u64, of: u64) {
        self.0.set_length(of);
        self.0.set_position(done);
    }

    fn done(&mut self) {
        self.0.finish_and_clear();
    }
}

/// The person at the terminal, or `--yes`.
pub(crate) struct AtTerminal {
    /// Confirmed beforehand.
    pub(crate) yes: bool,
    /// Whether anything is printed beside the result.
    pub(crate) quiet: bool,
}

impl Operator for AtTerminal {
    fn confirm(&mut self, _place: &RigPlace) -> Result<(), RunError> {
        if self.yes {
            return Ok(());
        }
        let refused = |what: &str, remedy: &str| {
            Err(RunError::Usage { what: what.to_owned(), remedy: remedy.to_owned() })
        };
        let stdin = std::io::stdin();
        if !stdin.is_terminal() {
            return refused(
                "nobody is there to confirm that the rig may move",
                "run it in a terminal, or add --yes when the emergency stop has been tested \
                 and nobody is near the rig",
            );
        }
        eprint!("Emergency stop tested, nobody near the rig? Type `arm`: ");
        let _ = std::io::stderr().flush();
        let mut line = String::new();
        let read = stdin.lock().read_line(&mut line);
        if read.is_ok() && line.trim() == "arm" {
            return Ok(());
        }
        refused(
            "not confirmed: nothing has moved",
            "test the emergency stop, see that nobody is near the rig, and type `arm`",
        )
    }

    fn checklist(&mut self, checks: &[Check]) {
        if !self.quiet {
            for c in checks {
                eprintln!("{} {:14} {}", if c.passed { "ok  " } else { "FAIL" }, c.name, c.found);
            }
        }
    }

    fn note(&mut self, text: &str) {
        eprintln!("{text}");
    }
}
