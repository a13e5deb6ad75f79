//! What can be wrong with a log, and why reading stops.

use core::fmt;
use std::io;

use docktwin_core::{SimTime, Tick};

/// What is wrong with a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// It ends before its end mark, as when its process dies; what was read is right.
    Ends,
    /// It is damaged, and goes on behind the damage.
    Damaged,
    /// Rows, events or metadata are not those that were recorded, by their digests.
    Edited,
    /// Whole in itself, but `summary.json` is that of another run, or edited.
    Foreign,
    /// It was recovered and lacks ticks of its run.
    Recovered,
}

/// A log that is not what it should be: cut, damaged or edited.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Everything before this byte was read.
    pub at_byte: u64,
    /// Length of the file, bytes.
    pub file_bytes: u64,
    /// The last tick that was read.
    pub last: Option<(Tick, SimTime)>,
    /// What was found there.
    pub why: String,
    /// Of which kind it is.
    pub flaw: Flaw,
}

impl Cut {
    /// Whether it merely ends too early, so that what was read is as good as that of a whole one.
    #[must_use]
    pub fn merely_ends(&self) -> bool {
        self.flaw == Flaw::Ends
    }
}

impl fmt::Display for Cut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at_byte, file_bytes, last, why, flaw } = self;
        match flaw {
            Flaw::Ends => write!(f, "the log stops at byte {at_byte} of {file_bytes} ({why}); ")?,
            Flaw::Damaged => {
                write!(f, "the log is damaged at byte {at_byte} of {file_bytes} ({why}); ")?;
            }
            Flaw::Edited => write!(f, "the log is not what was recorded ({why}); ")?,
            Flaw::Foreign | Flaw::Recovered => return f.write_str(why),
        }
        match last {
            Some((tick, time)) => {
                write!(f, "recovered up to tick {} ({:.3} s)", tick.0, time.seconds())
            }
            None => f.write_str("no tick was recovered"),
        }
    }
}

/// A place of a log that was passed over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hole {
    /// The last tick before it; `None` at the beginning.
    pub after: Option<u64>,
    /// The first tick behind it; `None` at the end.
    pub before: Option<u64>,
    /// What was found there.
    pub why: String,
}

impl Hole {
    /// First and last tick that are not there; `None` when none is known to lack.
    #[must_use]
    pub fn ticks(&self) -> Option<(u64, Option<u64>)> {
        let first = self.after.map_or(0, |t| t.saturating_add(1));
        match self.before {
            Some(before) if before <= first => None,
            before => Some((first, before.map(|t| t - 1))),
        }
    }
}

impl fmt::Display for Hole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.ticks() {
            None => write!(f, "no tick is missing ({})", self.why),
            Some((first, Some(last))) if first == last => {
                write!(f, "tick {first} is missing ({})", self.why)
            }
            Some((first, Some(last))) => {
                write!(f, "ticks {first} to {last} are missing ({})", self.why)
            }
            Some((first, None)) => {
                write!(f, "all from tick {first} on are missing ({})", self.why)
            }
        }
    }
}

/// Why reading stops, short of an error of the system.
pub(crate) enum Stop {
    Cut(Flaw, String),
    Failed(io::Error),
}

impl From<io::Error> for Stop {
    fn from(e: io::Error) -> Self {
        match e.kind() {
            io::ErrorKind::UnexpectedEof => {
                Self::Cut(Flaw::Ends, "the file ends within a record".into())
            }
            _ => Self::Failed(e),
        }
    }
}

impl From<mcap::McapError> for Stop {
    fn from(e: mcap::McapError) -> Self {
        match e {
            mcap::McapError::Io(e) => Self::Cut(Flaw::Damaged, e.to_string()),
            other => Self::Cut(Flaw::Damaged, other.to_string()),
        }
    }
}
