//! `run.mcap`: what is written, in which order, without threads.

use std::collections::BTreeMap;
use std::io::{self, Write};

use crate::chain::{EventChain, Link, RowChain};
use crate::column::{
    CONTACTS_TOPIC, Cell, Column, ContactRow, DIGEST_TOPIC, EVENTS_TOPIC, TICK_TOPIC,
};
use crate::container::Container;
use crate::keys::{
    DIGEST_KEY, DIGEST_KIND, METADATA, METADATA_COLUMNS, METADATA_PAIRS, SCHEMA_KEY,
};
use crate::layout::{self, Topic};
use crate::{Event, RECORD_SCHEMA};
use docktwin_core::{Digest, SimTime, Tick};

/// Writes ticks into chunks, which hold whole ticks only.
pub(crate) struct McapLog<W> {
    container: Container<W>,
    topics: Vec<(u16, Topic)>,
    tick_channel: u16,
    contacts_channel: u16,
    events_channel: u16,
    buf: Vec<u8>,
    /// Ticks in the open chunk.
    open_ticks: usize,
    contacts_shown: bool,
    /// Wall clock of the last tick, ns since 1970.
    wall: Option<u64>,
    digest_channel: u16,
    rows: RowChain,
    events: EventChain,
    /// What the next digest is about.
    link: Link,
    /// Time of the last tick, ns.
    nanos: u64,
}

/// Digests at the end of a log.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LogDigests {
    pub(crate) rows: Digest,
    pub(crate) events: Digest,
}

impl<W: Write> McapLog<W> {
    pub(crate) fn create(
        out: W,
        columns: &[Column],
        pair_names: &[String],
        metadata: &BTreeMap<String, String>,
    ) -> io::Result<Self> {
        let mut c = Container::new(out)?;
        let mut run = metadata.clone();
        run.insert(SCHEMA_KEY.into(), RECORD_SCHEMA.to_string());
        run.insert(DIGEST_KEY.into(), DIGEST_KIND.into());
        let numbered = |items: &mut dyn Iterator<Item = String>| {
            items.enumerate().map(|(i, s)| (format!("{i:05}"), s)).collect()
        };
        let as_text = |c: &Column| format!("{} {} {}", c.kind.name(), c.topic, c.name);
        c.metadata(METADATA, &run);
        c.metadata(METADATA_COLUMNS, &numbered(&mut columns.iter().map(as_text)));
        c.metadata(METADATA_PAIRS, &numbered(&mut pair_names.iter().cloned()));

        let mut own = |topic, (name, schema)| c.channel(topic, name, schema);
        let tick_channel = own(TICK_TOPIC, layout::TICK_SCHEMA);
        let contacts_channel = own(CONTACTS_TOPIC, layout::CONTACTS_SCHEMA);
        let events_channel = own(EVENTS_TOPIC, layout::EVENT_SCHEMA);
        let digest_channel = own(DIGEST_TOPIC, layout::DIGEST_SCHEMA);
        let topics = layout::topics(columns)
            .into_iter()
            .map(|t| (c.channel(&t.topic, &t.schema_name, &t.schema), t))
            .collect();
        // The head can be read at once. The channels wait in the first chunk: tools stumble over
        // chunks without messages.
        c.write_out()?;
        let rows = RowChain::begin(columns, pair_names, &run);
        let link = next_link(&rows, EventChain::default());
        Ok(Self {
            container: c,
            topics,
            tick_channel,
            contacts_channel,
            events_channel,
            buf: Vec::new(),
            open_ticks: 0,
            contacts_shown: false,
            wall: None,
            digest_channel,
            rows,
            events: EventChain::default(),
            link,
            nanos: 0,
        })
    }

    /// Adds a tick to the open chunk. `row` has a cell per column; `wall` is the wall clock when the
    /// tick was handed over, ns since 1970.
    pub(crate) fn tick(
        &mut self,
        tick: Tick,
        time: SimTime,
        row: &[Cell],
        contacts: &[ContactRow],
        wall: Option<u64>,
    ) {
        let (c, buf, nanos) = (&mut self.container, &mut self.buf, time.nanos());
        self.wall = wall;
        let published = wall.unwrap_or(nanos);
        layout::encode_tick(tick.0, time.seconds(), buf);
        c.message(self.tick_channel, sequence(tick.0), nanos, published, buf);
        for (channel, topic) in &self.topics {
            topic.encode(row, buf);
            c.message(*channel, sequence(tick.0), nanos, published, buf);
        }
        // An empty list is written once, so that a viewer takes the last contacts away.
        if !contacts.is_empty() || self.contacts_shown {
            self.contacts_shown = !contacts.is_empty();
            layout::encode_contacts(tick.0, contacts, buf);
            c.message(self.contacts_channel, sequence(tick.0), nanos, published, buf);
        }
        if self.link.ticks == 0 {
            self.link.first_tick = tick.0;
        }
        self.link.last_tick = tick.0;
        self.link.ticks += 1;
        self.rows.add(tick, time, row, contacts);
        self.nanos = nanos;
        self.open_ticks += 1;
    }

    /// Adds an event to the open chunk.
    pub(crate) fn event(&mut self, e: &Event) {
        layout::encode_event(e, &mut self.buf);
        // Saturates: a negative or non-finite time becomes 0.
        let nanos = (e.time_s * 1e9).round() as u64;
        let published = self.wall.unwrap_or(nanos);
        let channel = self.events_channel;
        self.container.message(channel, sequence(e.tick), nanos, published, &self.buf);
        self.events.add(&self.buf);
    }

    pub(crate) const fn open_ticks(&self) -> usize {
        self.open_ticks
    }

    /// Ends the open chunk and hands it to the operating system.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.end_link();
        self.open_ticks = 0;
        self.container.flush()
    }

    /// Puts the digest of what the open chunk holds behind it.
    fn end_link(&mut self) {
        let link = Link { after: self.rows.digest(), events: self.events, ..self.link };
        if link == self.link {
            return;
        }
        layout::encode_link(&link, &mut self.buf);
        let published = self.wall.unwrap_or(self.nanos);
        let (channel, sequence) = (self.digest_channel, sequence(link.last_tick));
        self.container.message(channel, sequence, self.nanos, published, &self.buf);
        self.link = next_link(&self.rows, self.events);
    }

    /// Writes the index and the end mark.
    pub(crate) fn finish(mut self) -> io::Result<LogDigests> {
        self.end_link();
        self.container.finish()?;
        Ok(LogDigests { rows: self.rows.digest(), events: self.events.digest })
    }
}

const fn next_link(rows: &RowChain, events: EventChain) -> Link {
    let (before, after) = (rows.digest(), rows.digest());
    Link { first_tick: 0, last_tick: 0, ticks: 0, before, after, events }
}

/// The tick's low half; it wraps after 49 days of 1 ms ticks.
fn sequence(tick: u64) -> u32 {
    (tick & u64::from(u32::MAX)) as u32
}
