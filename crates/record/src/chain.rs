//! The chained digest of a recording: each row's digest is made from the digest before it and the row, so
//! that no row can be edited, left out or put in twice without every later digest being another.
//!
//! `D₀` is over the columns, the names of the pairs and the metadata; `Dₙ` over `Dₙ₋₁`, the number of the
//! tick, its time in ns, the number of contacts, the bits of all cells and of all contacts, each as 8 bytes,
//! little-endian. It does not depend on how ticks are put into chunks. Events have a chain of their own.

use std::collections::BTreeMap;

use docktwin_core::{Digest, SimTime, Tick};

use crate::column::{Cell, Column, ColumnKind, ContactRow};
use crate::keys::{RECOVERED_KEY, STARTED_KEY};
use crate::tick::TickRecord;

/// The digest of rows so far.
#[derive(Clone, Debug)]
pub(crate) struct RowChain {
    digest: Digest,
    kinds: Vec<ColumnKind>,
    bytes: Vec<u8>,
}

impl RowChain {
    /// Before the first row. Of the metadata the date and what `recover` adds do not count.
    pub(crate) fn begin(
        columns: &[Column],
        pair_names: &[String],
        metadata: &BTreeMap<String, String>,
    ) -> Self {
        let mut bytes = Vec::new();
        let mut text = |t: &str| {
            bytes.extend_from_slice(&(t.len() as u64).to_le_bytes());
            bytes.extend_from_slice(t.as_bytes());
        };
        for c in columns {
            [c.kind.name(), &c.topic, &c.name].into_iter().for_each(&mut text);
        }
        text("pairs");
        pair_names.iter().for_each(|n| text(n));
        text("metadata");
        for (k, v) in metadata {
            if ![RECOVERED_KEY, STARTED_KEY].contains(&k.as_str()) {
                text(k);
                text(v);
            }
        }
        let kinds = columns.iter().map(|c| c.kind).collect();
        Self { digest: Digest::of_bytes(&bytes), kinds, bytes }
    }

    pub(crate) const fn digest(&self) -> Digest {
        self.digest
    }

    /// Goes on from another digest.
    pub(crate) const fn set(&mut self, digest: Digest) {
        self.digest = digest;
    }

    pub(crate) fn add(
        &mut self,
        tick: Tick,
        time: SimTime,
        row: &[Cell],
        contacts: &[ContactRow],
    ) -> Digest {
        let b = &mut self.bytes;
        b.clear();
        b.extend_from_slice(&self.digest.0);
        let mut put = |x: u64| b.extend_from_slice(&x.to_le_bytes());
        put(tick.0);
        put(time.nanos());
        put(contacts.len() as u64);
        for (cell, kind) in row.iter().zip(&self.kinds) {
            // Of yes or no a message keeps nothing else.
            put(if *kind == ColumnKind::Bool { u64::from(cell.as_bool()) } else { cell.bits() });
        }
        for c in contacts {
            put(u64::from(c.pair));
            c.numbers().into_iter().for_each(|x| put(x.to_bits()));
        }
        self.digest = Digest::of_bytes(b);
        self.digest
    }

    /// Where rows lead from a digest; the chain itself stays where it is.
    pub(crate) fn over<'a>(
        &self,
        from: Digest,
        rows: impl IntoIterator<Item = &'a TickRecord>,
    ) -> Digest {
        let mut chain = self.clone();
        chain.set(from);
        for t in rows {
            chain.add(t.tick, t.time, &t.row, &t.contacts);
        }
        chain.digest
    }
}

/// The digest of events so far, and how many they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EventChain {
    pub(crate) count: u64,
    pub(crate) digest: Digest,
}

impl EventChain {
    /// Adds an event as its message has it.
    pub(crate) fn add(&mut self, message: &[u8]) {
        let bytes = [&self.digest.0, message].concat();
        *self = Self { count: self.count + 1, digest: Digest::of_bytes(&bytes) };
    }
}

/// A message on `/record_digest`: what stands between the one before it and itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Link {
    /// First and last tick; of no meaning without ticks.
    pub(crate) first_tick: u64,
    pub(crate) last_tick: u64,
    pub(crate) ticks: u64,
    /// Digest before the first of these ticks, and after the last.
    pub(crate) before: Digest,
    pub(crate) after: Digest,
    /// All events so far.
    pub(crate) events: EventChain,
}

/// Reads a digest as it is shown.
pub(crate) fn parse_digest(text: &str) -> Option<Digest> {
    let digits = text.as_bytes();
    let mut out = [0; 16];
    if digits.len() != 32 || !digits.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    for (b, pair) in out.iter_mut().zip(digits.chunks_exact(2)) {
        *b = u8::from_str_radix(core::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(Digest(out))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_every_bit_of_a_row_counts_and_chunks_do_not() {
        let columns = [Column::f64("/a", "x"), Column::bool("/a", "y")];
        let begin = || RowChain::begin(&columns, &["p".into()], &BTreeMap::new());
        let row = [Cell::from(0.0), Cell::from(true)];
        let one = |tick, nanos, row: &[Cell], contacts: &[ContactRow]| {
            begin().add(Tick(tick), SimTime::from_nanos(nanos), row, contacts)
        };
        let digest = one(1, 2, &row, &[]);
        assert_eq!(digest, one(1, 2, &row, &[]));
        // Whatever is not zero is yes.
        assert_eq!(digest, one(1, 2, &[row[0], Cell::from_bits(7)], &[]));
        let deep = ContactRow { depth_m: -0.0, ..ContactRow::default() };
        for other in [
            one(2, 2, &row, &[]),
            one(1, 3, &row, &[]),
            one(1, 2, &[Cell::from(-0.0), row[1]], &[]),
            one(1, 2, &[row[0], Cell::from(false)], &[]),
            one(1, 2, &row, &[ContactRow::default()]),
            one(1, 2, &row, &[deep]),
        ] {
            assert_ne!(digest, other);
        }
        assert_ne!(one(1, 2, &row, &[deep]), one(1, 2, &row, &[ContactRow::default()]));
    }

    #[test]
    fn invariant_the_head_counts_but_for_date_and_recovery() {
        let columns = [Column::f64("/a", "x")];
        let begin = |metadata: &[(&str, &str)]| {
            let metadata = metadata.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
            RowChain::begin(&columns, &[], &metadata).digest()
        };
        let plain = begin(&[("seed", "1")]);
        assert_eq!(plain, begin(&[("seed", "1"), (STARTED_KEY, "5"), (RECOVERED_KEY, "cut")]));
        assert_ne!(plain, begin(&[("seed", "2")]));
        assert_ne!(
            plain,
            RowChain::begin(&[], &[], &[("seed".into(), "1".into())].into()).digest()
        );
    }

    /// What a row costs, printed (`--nocapture`), never asserted.
    #[test]
    fn invariant_the_digest_of_any_row_differs_from_the_last() {
        let columns: Vec<Column> = (0..231).map(|i| Column::f64("/a", format!("c{i}"))).collect();
        let mut chain = RowChain::begin(&columns, &[], &BTreeMap::new());
        let row: Vec<Cell> = (0..231u64).map(|i| Cell::from((i as f64).sin())).collect();
        // Processor time of this thread, ns, which other work on the machine does not change.
        let spent = || -> Option<u64> {
            std::fs::read_to_string("/proc/thread-self/schedstat")
                .ok()?
                .split(' ')
                .next()?
                .parse()
                .ok()
        };
        let begin = spent();
        const N: u64 = 10_000;
        for i in 0..N {
            let before = chain.digest();
            assert_ne!(chain.add(Tick(i), SimTime::from_nanos(i), &row, &[]), before);
        }
        if let (Some(begin), Some(end)) = (begin, spent()) {
            let each = (end - begin) as f64 * 1e-3 / N as f64;
            println!("{each:.2} µs for the digest of a row of {} columns", columns.len());
        }
    }

    #[test]
    fn oracle_a_digest_is_read_as_it_is_shown() {
        let d = Digest::of_bytes(b"x");
        assert_eq!(parse_digest(&d.to_string()), Some(d));
        for bad in ["", "00", &"g".repeat(32), &"0".repeat(33), &"é".repeat(16)] {
            assert_eq!(parse_digest(bad), None, "{bad}");
        }
    }
}
