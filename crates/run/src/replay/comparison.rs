//! What a replay gives, held against what was recorded.

use docktwin_record::{Cell, Column, ColumnKind, ContactRow, RunReader, TickRecord};

use super::{Difference, Replayed};
use crate::{
    error::SinkError,
    sink::{Header, Sink, TickView},
};

/// The column that tells whether the state itself differs.
pub(super) const DIGEST: &str = "state_digest";

/// A sink that looks for the first difference.
pub(super) struct Comparison {
    recorded: Vec<Column>,
    /// Columns that both have: name, kind, place in the replay and in the recording; the digest first.
    both: Vec<(Column, usize, usize)>,
    unknown: Vec<String>,
    /// The recorded tick that comes next.
    next: Option<TickRecord>,
    ticks: u64,
    first: Option<Difference>,
}

impl Comparison {
    pub(super) fn with(reader: &RunReader) -> Self {
        Self {
            recorded: reader.columns().to_vec(),
            both: Vec::new(),
            unknown: Vec::new(),
            next: None,
            ticks: 0,
            first: None,
        }
    }

    /// What the tick to come was when it was recorded.
    pub(super) fn expect(&mut self, tick: TickRecord) {
        self.next = Some(tick);
    }

    /// Whether what was expected has come: a loop on its way to the initial condition is not recorded.
    pub(super) const fn has_come(&self) -> bool {
        self.next.is_none()
    }

    pub(super) const fn differs(&self) -> bool {
        self.first.is_some()
    }

    /// What was found.
    pub(super) fn give(&mut self, found: &mut Replayed) {
        found.ticks = self.ticks;
        found.signals = self.both.len();
        found.unknown = core::mem::take(&mut self.unknown);
        found.first_difference = self.first.take();
    }

    fn difference(&self, now: &TickView<'_>, then: &TickRecord) -> Option<[String; 3]> {
        let texts = |signal: &str, recorded: String, replayed: String| {
            Some([signal.to_owned(), recorded, replayed])
        };
        if now.tick != then.tick {
            return texts("tick", then.tick.0.to_string(), now.tick.0.to_string());
        }
        if now.time != then.time {
            let ns = |t: docktwin_core::SimTime| format!("{} ns", t.nanos());
            return texts("time", ns(then.time), ns(now.time));
        }
        for (column, here, there) in &self.both {
            let (replayed, recorded) = (now.row[*here], then.row[*there]);
            if replayed != recorded {
                let text = |c: Cell| {
                    if column.name == DIGEST {
                        format!("{:016x}", c.bits())
                    } else {
                        c.describe(column.kind)
                    }
                };
                return texts(&column.name, text(recorded), text(replayed));
            }
        }
        if now.contacts.len() != then.contacts.len() {
            let places = |n: usize| format!("{n} places");
            return texts("contacts", places(then.contacts.len()), places(now.contacts.len()));
        }
        let pairs = then.contacts.iter().zip(now.contacts).enumerate();
        pairs.into_iter().find_map(|(i, (p, q))| contact_difference(i, p, q))
    }
}

fn contact_difference(i: usize, then: &ContactRow, now: &ContactRow) -> Option<[String; 3]> {
    if then.pair != now.pair {
        return Some([format!("contacts[{i}].pair"), then.pair.to_string(), now.pair.to_string()]);
    }
    let mut numbers = ContactRow::NUMBERS.iter().zip(then.numbers().into_iter().zip(now.numbers()));
    let (name, (p, q)) = numbers.find(|(_, (p, q))| p.to_bits() != q.to_bits())?;
    let text = |x: f64| Cell::from(x).describe(ColumnKind::F64);
    Some([format!("contacts[{i}].{name}"), text(p), text(q)])
}

impl Sink for Comparison {
    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        for (there, c) in self.recorded.iter().enumerate() {
            let here = header.columns.iter().position(|d| d.name == c.name && d.kind == c.kind);
            match here {
                Some(here) => self.both.push((c.clone(), here, there)),
                None => self.unknown.push(c.name.clone()),
            }
        }
        self.both.sort_by_key(|(c, here, _)| (c.name != DIGEST, *here));
        Ok(())
    }

    fn tick(&mut self, tick: &TickView<'_>) -> Result<(), SinkError> {
        let Some(then) = self.next.take() else { return Ok(()) };
        self.ticks += 1;
        if let Some([signal, recorded, replayed]) = self.difference(tick, &then) {
            let (tick, time_s) = (then.tick.0, then.time.seconds());
            self.first.get_or_insert(Difference { tick, time_s, signal, recorded, replayed });
        }
        Ok(())
    }
}
