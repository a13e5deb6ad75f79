//! The messages of a log, put together into ticks and held against their digests. Chunks play no part: a
//! tick may begin in one and end in another.

use std::collections::{BTreeMap, VecDeque};

use docktwin_core::{Digest, SimTime, Tick};
use mcap::records::{Channel, MessageHeader};

use crate::chain::{EventChain, Link, RowChain};
use crate::column::{CONTACTS_TOPIC, Cell, DIGEST_TOPIC, EVENTS_TOPIC, OWN_TOPICS, TICK_TOPIC};
use crate::flaw::{Flaw, Stop};
use crate::layout::{self, Topic};
use crate::tick::TickRecord;
use crate::{Column, Event};

/// Ticks that wait for a digest at most; the recorder writes one after 50.
const MOST_WAITING: usize = 10_000;

/// What a channel of the file carries.
#[derive(Clone, Copy)]
enum Role {
    Tick,
    Contacts,
    Events,
    Digest,
    Columns(usize),
}

/// What becomes of rows that do not fit their digest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reading {
    /// Reading stops before them.
    Stops,
    /// They are left out, and reading goes on behind them.
    GoesOn,
    /// They are given as they are, and what is wrong is noted.
    TakesAll,
}

/// A tick whose messages are still coming.
struct Open {
    tick: TickRecord,
    seen: Vec<bool>,
}

/// Rows that were left out, or noted, because they do not fit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Misfit {
    pub(crate) why: String,
    /// Ticks before and behind; `None` where there is none.
    pub(crate) after: Option<u64>,
    pub(crate) before: Option<u64>,
}

pub(crate) struct Assembly {
    columns: usize,
    topics: Vec<Topic>,
    roles: BTreeMap<u16, Role>,
    pub(crate) reading: Reading,
    /// Whether rows and events are followed by digests.
    digests: bool,
    open: Option<Open>,
    /// Whole ticks that wait for their digest.
    waiting: Vec<TickRecord>,
    pub(crate) ready: VecDeque<TickRecord>,
    /// Digest after the last whole tick.
    rows: RowChain,
    start: Digest,
    /// Digest at the last link; `None` behind a hole.
    base: Option<Digest>,
    events: EventChain,
    /// Whether all events so far were seen.
    events_known: bool,
    /// What the log says of events that are still to come.
    claims: Vec<EventChain>,
    /// Digest after so many events, of those that are known.
    event_digests: BTreeMap<u64, Digest>,
    /// Events so far.
    pub(crate) logged: Vec<Event>,
    /// How many of them fit their digest.
    logged_right: usize,
    /// The last tick that began.
    last_begun: Option<u64>,
    /// The last tick that was given.
    pub(crate) last: Option<(Tick, SimTime)>,
    pub(crate) misfits: Vec<Misfit>,
    /// Ticks given whose digest was lost.
    pub(crate) unverified: u64,
}

impl Assembly {
    pub(crate) fn new(columns: &[Column], rows: RowChain, digests: bool) -> Self {
        let start = rows.digest();
        Self {
            columns: columns.len(),
            topics: layout::topics(columns),
            roles: BTreeMap::new(),
            reading: Reading::Stops,
            digests,
            open: None,
            waiting: Vec::new(),
            ready: VecDeque::new(),
            rows,
            start,
            base: Some(start),
            events: EventChain::default(),
            events_known: true,
            claims: Vec::new(),
            event_digests: BTreeMap::new(),
            logged: Vec::new(),
            logged_right: 0,
            last_begun: None,
            last: None,
            misfits: Vec::new(),
            unverified: 0,
        }
    }

    /// Back to the beginning of the log.
    pub(crate) fn rewind(&mut self) {
        let start = self.start;
        self.rows.set(start);
        self.base = Some(start);
        self.open = None;
        self.waiting.clear();
        self.ready.clear();
        self.events = EventChain::default();
        self.events_known = true;
        self.claims.clear();
        self.event_digests.clear();
        self.logged.clear();
        self.logged_right = 0;
        self.last_begun = None;
        self.last = None;
        self.misfits.clear();
        self.unverified = 0;
    }

    /// Digests of all rows and of all events so far.
    pub(crate) const fn digests(&self) -> (Digest, Digest) {
        (self.rows.digest(), self.events.digest)
    }

    pub(crate) const fn has_digests(&self) -> bool {
        self.digests
    }

    /// Whether it is known what the channels carry.
    pub(crate) fn knows_channels(&self) -> bool {
        self.roles.values().any(|r| matches!(r, Role::Tick))
    }

    pub(crate) fn channel(&mut self, id: u16, topic: &str) {
        let column_topic = || self.topics.iter().position(|t| t.topic == topic);
        let role = match topic {
            TICK_TOPIC => Some(Role::Tick),
            CONTACTS_TOPIC => Some(Role::Contacts),
            EVENTS_TOPIC => Some(Role::Events),
            DIGEST_TOPIC => Some(Role::Digest),
            _ => column_topic().map(Role::Columns),
        };
        if let Some(role) = role {
            self.roles.insert(id, role);
        }
    }

    /// A channel that was not declared yet.
    pub(crate) fn channel_if_new(&mut self, id: u16, topic: &str) {
        if !self.roles.contains_key(&id) {
            self.channel(id, topic);
        }
    }

    /// The channels as the recorder numbers them, for a log whose first chunk is lost.
    pub(crate) fn own_channels(&mut self) {
        let own = OWN_TOPICS.iter().filter(|t| self.digests || **t != DIGEST_TOPIC);
        let own = own.map(|t| (*t).to_owned());
        let names: Vec<String> = own.chain(self.topics.iter().map(|t| t.topic.clone())).collect();
        for (id, topic) in (1u16..).zip(&names) {
            self.channel(id, topic);
        }
    }

    pub(crate) fn declared(&mut self, c: &Channel) {
        self.channel(c.id, &c.topic);
    }

    /// Takes a message in; false when its channel is not one of ours.
    pub(crate) fn message(&mut self, header: &MessageHeader, data: &[u8]) -> Result<bool, Stop> {
        let damaged = || Stop::Cut(Flaw::Edited, "a message is not as its columns say".into());
        match self.roles.get(&header.channel_id).copied() {
            Some(Role::Tick) => {
                self.close_tick()?;
                self.begin_tick(header, data)?;
            }
            Some(Role::Columns(i)) => {
                // Behind a hole the rest of a tick may come whose beginning is lost.
                let Some(open) = &mut self.open else { return self.stray(damaged) };
                if core::mem::replace(&mut open.seen[i], true) {
                    return Err(damaged());
                }
                self.topics[i].decode(data, &mut open.tick.row).ok_or_else(damaged)?;
            }
            Some(Role::Contacts) => {
                let Some(open) = &mut self.open else { return self.stray(damaged) };
                let (number, contacts) = layout::decode_contacts(data).ok_or_else(damaged)?;
                if number != open.tick.tick.0 {
                    return Err(damaged());
                }
                open.tick.contacts = contacts;
            }
            Some(Role::Events) => {
                let e = layout::decode_event(data).ok_or_else(damaged)?;
                self.events.add(data);
                self.logged.push(e);
                self.check_events()?;
            }
            Some(Role::Digest) => {
                let link = layout::decode_link(data).ok_or_else(damaged)?;
                self.close_tick()?;
                self.link(&link)?;
            }
            None => return Ok(false),
        }
        Ok(true)
    }

    fn stray(&self, damaged: impl Fn() -> Stop) -> Result<bool, Stop> {
        if self.base.is_none() { Ok(true) } else { Err(damaged()) }
    }

    fn begin_tick(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), Stop> {
        let number = layout::decode_tick(data)
            .ok_or_else(|| Stop::Cut(Flaw::Edited, "a tick has no number".into()))?;
        if let Some(last) = self.last_begun.filter(|last| number <= *last) {
            let why = format!("tick {number} comes behind tick {last}: twice, or out of order");
            return Err(Stop::Cut(Flaw::Edited, why));
        }
        self.last_begun = Some(number);
        self.open = Some(Open {
            tick: TickRecord {
                tick: Tick(number),
                time: SimTime::from_nanos(header.log_time),
                row: vec![Cell::default(); self.columns],
                contacts: Vec::new(),
                recorded_unix_ns: (header.publish_time != header.log_time)
                    .then_some(header.publish_time),
            },
            seen: vec![false; self.topics.len()],
        });
        Ok(())
    }

    /// Every topic must have come once.
    fn close_tick(&mut self) -> Result<(), Stop> {
        let Some(open) = self.open.take() else { return Ok(()) };
        if !open.seen.iter().all(|s| *s) {
            let why = format!("tick {} lacks some of its columns", open.tick.tick.0);
            return Err(Stop::Cut(Flaw::Edited, why));
        }
        let t = open.tick;
        self.rows.add(t.tick, t.time, &t.row, &t.contacts);
        self.waiting.push(t);
        if !self.digests {
            self.release();
        } else if self.waiting.len() > MOST_WAITING {
            return self.misfit("the digests of the rows are missing".into(), false);
        }
        Ok(())
    }

    fn release(&mut self) {
        self.last = self.waiting.last().map(|t| (t.tick, t.time)).or(self.last);
        self.ready.extend(self.waiting.drain(..));
    }

    /// The rows that wait, held against their digest.
    fn link(&mut self, link: &Link) -> Result<(), Stop> {
        let whole = self.waiting.len() as u64 == link.ticks;
        let (from, to) = (self.base, self.rows.digest());
        self.base = Some(link.after);
        self.rows.set(link.after);
        if from == Some(link.before) && to == link.after {
            self.release();
        } else if from.is_none() && (self.waiting.len() as u64) < link.ticks {
            // Its first ticks lie in the hole.
            self.unverified += self.waiting.len() as u64;
            self.release();
        } else if self.rows.over(link.before, &self.waiting) != link.after || !whole {
            let why = if self.waiting.is_empty() {
                format!("ticks {} to {} are missing", link.first_tick, link.last_tick)
            } else {
                "rows do not fit their digest: edited or damaged".into()
            };
            self.misfit(why, true)?;
        } else if from.is_some() {
            // These are right; what stood before them is not what is there now.
            let why = if self.last.is_none() && self.misfits.is_empty() {
                "columns or metadata at the head of the log are not those it was recorded with: \
                 edited or damaged"
            } else {
                "the digests of the rows do not follow each other: rows are missing, or edited"
            };
            let (after, before) = (self.last.map(|l| l.0.0), self.first_waiting());
            self.note(why.into(), after, before)?;
            self.release();
        } else {
            self.release();
        }
        self.claim(link.events)
    }

    fn first_waiting(&self) -> Option<u64> {
        self.waiting.first().map(|t| t.tick.0)
    }

    /// What waits is not what was recorded (`wrong`), or nothing says whether it is.
    fn misfit(&mut self, why: String, wrong: bool) -> Result<(), Stop> {
        let after = self.last.map(|l| l.0.0);
        let named = match (self.waiting.first(), self.waiting.last()) {
            (Some(a), Some(b)) if a.tick != b.tick => {
                format!("ticks {} to {}: {why}", a.tick.0, b.tick.0)
            }
            (Some(a), _) => format!("tick {}: {why}", a.tick.0),
            _ => why,
        };
        let before = if wrong { None } else { self.first_waiting() };
        self.note(named, after, before)?;
        if wrong && self.reading == Reading::GoesOn {
            self.waiting.clear();
        } else {
            self.unverified += self.waiting.len() as u64;
            self.release();
        }
        Ok(())
    }

    fn note(&mut self, why: String, after: Option<u64>, before: Option<u64>) -> Result<(), Stop> {
        if self.reading == Reading::Stops {
            self.waiting.clear();
            return Err(Stop::Cut(Flaw::Edited, why));
        }
        self.misfits.push(Misfit { why, after, before });
        Ok(())
    }

    /// Events may stand before or behind the link that counts them, where a log was sorted.
    fn claim(&mut self, events: EventChain) -> Result<(), Stop> {
        if !self.events_known {
            // Behind a hole it counts from here.
            self.events = events;
            self.events_known = true;
            return Ok(());
        }
        self.claims.push(events);
        self.check_events()
    }

    fn check_events(&mut self) -> Result<(), Stop> {
        let now = self.events;
        self.event_digests.insert(now.count, now.digest);
        let Some(newest) = self.claims.last().copied() else { return Ok(()) };
        let known = &self.event_digests;
        let wrong = self.claims.iter().any(|c| known.get(&c.count).is_some_and(|d| *d != c.digest));
        self.claims.retain(|c| c.count > now.count);
        if wrong {
            // Which of the events since the last digest that fitted is not known.
            if self.reading != Reading::TakesAll {
                self.logged.truncate(self.logged_right);
            }
            self.events = newest;
            self.event_digests = [(newest.count, newest.digest)].into();
            self.claims.clear();
            let why = "events do not fit their digest: edited or damaged".to_owned();
            let at = self.last.map(|l| l.0.0);
            self.note(why, at, at)?;
        } else if self.claims.is_empty() {
            self.logged_right = self.logged.len();
        }
        Ok(())
    }

    /// Something is lost here; what waits has no digest any more, and is given as it is.
    pub(crate) fn hole(&mut self, flaw: Flaw) {
        if flaw == Flaw::Edited && self.reading != Reading::TakesAll {
            self.waiting.clear();
        }
        if let (false, Some(open)) = (self.digests, self.open.take())
            && open.seen.iter().all(|s| *s)
        {
            // Without digests nothing says that more was to come.
            self.waiting.push(open.tick);
        }
        if self.digests {
            self.unverified += self.waiting.len() as u64;
        }
        self.release();
        self.open = None;
        self.base = None;
        self.events_known = false;
        self.claims.clear();
        self.event_digests.clear();
    }

    /// The end mark was reached.
    pub(crate) fn end(&mut self) -> Result<(), Stop> {
        self.close_tick()?;
        if self.digests && !self.waiting.is_empty() {
            if self.base.is_none() {
                self.unverified += self.waiting.len() as u64;
                self.release();
            } else {
                let why = "the digest of the rows is missing: edited or damaged";
                self.misfit(why.into(), false)?;
            }
        }
        if self.events_known && !self.claims.is_empty() {
            let at = self.last.map(|l| l.0.0);
            self.note("events are missing, or do not fit their digest".into(), at, at)?;
        }
        Ok(())
    }
}
