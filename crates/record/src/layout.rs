//! The wire format of the messages: CDR little-endian, as ROS 2 writes it, and the schema text that
//! tells other tools how to read it.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use crate::chain::{EventChain, Link, parse_digest};
use crate::column::{Cell, Column, ColumnKind, ContactRow};

/// CDR's encapsulation header: plain CDR, little-endian.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Where a column stands in its topic's message.
struct Field {
    /// Index of the column, and of its cell in a row.
    cell: usize,
    /// First byte in the message, header included.
    offset: usize,
    kind: ColumnKind,
}

/// The fixed-size message of one topic.
pub(crate) struct Topic {
    pub(crate) topic: String,
    /// `docktwin_msgs/msg/ChaserTruth`.
    pub(crate) schema_name: String,
    /// The `ros2msg` text.
    pub(crate) schema: String,
    fields: Vec<Field>,
    size: usize,
}

impl Topic {
    /// Writes the message of this row into `buf`, replacing what was there.
    pub(crate) fn encode(&self, row: &[Cell], buf: &mut Vec<u8>) {
        buf.clear();
        buf.resize(self.size, 0);
        buf[..4].copy_from_slice(&ENCAPSULATION);
        for f in &self.fields {
            let at = f.offset;
            match f.kind {
                ColumnKind::F64 | ColumnKind::U64 => {
                    buf[at..at + 8].copy_from_slice(&row[f.cell].bits().to_le_bytes());
                }
                ColumnKind::Bool => buf[at] = u8::from(row[f.cell].as_bool()),
            }
        }
    }

    /// Reads a message into its cells of `row`; `None` when it is not of this topic's layout.
    pub(crate) fn decode(&self, data: &[u8], row: &mut [Cell]) -> Option<()> {
        if data.len() != self.size || data[..4] != ENCAPSULATION {
            return None;
        }
        for f in &self.fields {
            let at = f.offset;
            row[f.cell] = match f.kind {
                ColumnKind::F64 | ColumnKind::U64 => {
                    Cell::from_bits(u64::from_le_bytes(data[at..at + 8].try_into().ok()?))
                }
                ColumnKind::Bool => Cell::from(data[at] != 0),
            };
        }
        Some(())
    }
}

/// Groups the columns by topic, topics in order of first appearance.
pub(crate) fn topics(columns: &[Column]) -> Vec<Topic> {
    let mut out: Vec<Topic> = Vec::new();
    let mut names = BTreeSet::new();
    for (cell, column) in columns.iter().enumerate() {
        let at = out.iter().position(|t| t.topic == column.topic).unwrap_or_else(|| {
            // Distinct topics may give one name (`/a_b`, `/a/b`); a number keeps them apart.
            let base = camel_case(&column.topic);
            let name = (1..)
                .map(|n| if n == 1 { base.clone() } else { format!("{base}Topic{n}") })
                .find(|n| names.insert(n.clone()))
                .unwrap_or(base);
            out.push(Topic {
                topic: column.topic.clone(),
                schema_name: format!("docktwin_msgs/msg/{name}"),
                schema: String::new(),
                fields: Vec::new(),
                size: ENCAPSULATION.len(),
            });
            out.len() - 1
        });
        let topic = &mut out[at];
        let offset = align(topic.size, column.kind.size());
        topic.fields.push(Field { cell, offset, kind: column.kind });
        topic.size = offset + column.kind.size();
        let _ = writeln!(topic.schema, "{} {}", column.kind.name(), column.name);
    }
    out
}

/// The next offset fit for a value of `size` bytes; CDR counts from behind its header.
fn align(offset: usize, size: usize) -> usize {
    (offset - ENCAPSULATION.len()).next_multiple_of(size) + ENCAPSULATION.len()
}

/// `/chaser/body_a` becomes `ChaserBodyA`.
fn camel_case(topic: &str) -> String {
    topic
        .split(['/', '_'])
        .filter_map(|w| {
            let mut c = w.chars();
            c.next().map(|first| first.to_ascii_uppercase().to_string() + c.as_str())
        })
        .collect()
}

pub(crate) const TICK_SCHEMA: (&str, &str) = (
    "docktwin_msgs/msg/TickStamp",
    "# Number of the tick and its simulated time.\nuint64 tick\nfloat64 time_s\n",
);

pub(crate) const EVENT_SCHEMA: (&str, &str) = (
    "docktwin_msgs/msg/RunEvent",
    "# Something that happened; body is JSON.\n\
     uint64 tick\nfloat64 time_s\nstring kind\nstring text\nstring body\n",
);

pub(crate) const CONTACTS_SCHEMA: (&str, &str) = (
    "docktwin_msgs/msg/ContactPoints",
    "# All contact points of a tick; frame w is the world.\n\
     uint64 tick\n\
     ContactPoint[] contacts\n\
     ================================================================================\n\
     MSG: docktwin_msgs/ContactPoint\n\
     # Names of the pairs: metadata record docktwin.pairs.\n\
     uint16 pair\n\
     float64[3] point_w_m\n\
     float64[3] normal_w\n\
     float64 depth_m\n\
     float64 normal_force_n\n\
     float64[3] friction_w_n\n",
);

pub(crate) const DIGEST_SCHEMA: (&str, &str) = (
    "docktwin_msgs/msg/RecordDigest",
    "# Chained digest of the rows since the last such message, and of all events so far.\n\
     uint64 first_tick\nuint64 tick\nuint64 ticks\nuint64 events\n\
     string before\nstring after\nstring events_digest\n",
);

/// Writes CDR values one after the other.
struct CdrWriter<'a>(&'a mut Vec<u8>);

impl<'a> CdrWriter<'a> {
    fn new(buf: &'a mut Vec<u8>) -> Self {
        buf.clear();
        buf.extend_from_slice(&ENCAPSULATION);
        Self(buf)
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        self.0.resize(align(self.0.len(), N), 0);
        self.0.extend_from_slice(&bytes);
    }

    fn f64(&mut self, x: f64) {
        self.put(x.to_bits().to_le_bytes());
    }

    fn len(&mut self, n: usize) {
        // More than u32::MAX contacts or characters do not fit into memory beside the rest.
        self.put(u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes());
    }

    /// Length with its final zero, bytes, zero.
    fn string(&mut self, s: &str) {
        self.len(s.len() + 1);
        self.0.extend_from_slice(s.as_bytes());
        self.0.push(0);
    }
}

/// Reads CDR values one after the other; `None` where the message ends too early.
struct CdrReader<'a> {
    data: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    fn new(data: &'a [u8]) -> Option<Self> {
        (data.get(..4)? == ENCAPSULATION).then_some(Self { data, at: 4 })
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let at = align(self.at, N);
        self.at = at + N;
        self.data.get(at..at + N)?.try_into().ok()
    }

    fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits)
    }

    fn string(&mut self) -> Option<&'a str> {
        let len = usize::try_from(u32::from_le_bytes(self.take()?)).ok()?;
        let (at, end) = (self.at, self.at.checked_add(len)?);
        let bytes = self.data.get(at..end)?.strip_suffix(&[0])?;
        self.at = end;
        core::str::from_utf8(bytes).ok()
    }
}

pub(crate) fn encode_tick(tick: u64, time_s: f64, buf: &mut Vec<u8>) {
    let mut w = CdrWriter::new(buf);
    w.put(tick.to_le_bytes());
    w.f64(time_s);
}

pub(crate) fn decode_tick(data: &[u8]) -> Option<u64> {
    CdrReader::new(data)?.u64()
}

pub(crate) fn encode_event(e: &crate::Event, buf: &mut Vec<u8>) {
    let mut w = CdrWriter::new(buf);
    w.put(e.tick.to_le_bytes());
    w.f64(e.time_s);
    w.string(&e.kind);
    w.string(&e.text);
    w.string(&e.body.to_string());
}

pub(crate) fn decode_event(data: &[u8]) -> Option<crate::Event> {
    let mut r = CdrReader::new(data)?;
    let (tick, time_s) = (r.u64()?, r.f64()?);
    let (kind, text) = (r.string()?.to_owned(), r.string()?.to_owned());
    let body = serde_json::from_str(r.string()?).ok()?;
    (r.at == data.len()).then_some(crate::Event { tick, time_s, kind, text, body })
}

pub(crate) fn encode_link(l: &Link, buf: &mut Vec<u8>) {
    let mut w = CdrWriter::new(buf);
    for n in [l.first_tick, l.last_tick, l.ticks, l.events.count] {
        w.put(n.to_le_bytes());
    }
    [l.before, l.after, l.events.digest].into_iter().for_each(|d| w.string(&d.to_string()));
}

pub(crate) fn decode_link(data: &[u8]) -> Option<Link> {
    let mut r = CdrReader::new(data)?;
    let (first_tick, last_tick, ticks, count) = (r.u64()?, r.u64()?, r.u64()?, r.u64()?);
    let mut digest = || parse_digest(r.string()?);
    let (before, after, digest) = (digest()?, digest()?, digest()?);
    let events = EventChain { count, digest };
    (r.at == data.len()).then_some(Link { first_tick, last_tick, ticks, before, after, events })
}

pub(crate) fn encode_contacts(tick: u64, contacts: &[ContactRow], buf: &mut Vec<u8>) {
    let mut w = CdrWriter::new(buf);
    w.put(tick.to_le_bytes());
    w.len(contacts.len());
    for c in contacts {
        w.put(c.pair.to_le_bytes());
        c.numbers().into_iter().for_each(|x| w.f64(x));
    }
}

pub(crate) fn decode_contacts(data: &[u8]) -> Option<(u64, Vec<ContactRow>)> {
    let mut r = CdrReader::new(data)?;
    let tick = r.u64()?;
    let n = u32::from_le_bytes(r.take()?);
    let contacts = (0..n)
        .map(|_| {
            let pair = u16::from_le_bytes(r.take()?);
            let mut x = [0.0; 11];
            for x in &mut x {
                *x = r.f64()?;
            }
            Some(ContactRow::from_numbers(pair, x))
        })
        .collect::<Option<_>>()?;
    (r.at == data.len()).then_some((tick, contacts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_alignment_is_that_of_cdr() {
        // By the rules of CDR: bool at 0, float64 at 8, bool at 16, uint64 at 24, then the end.
        let columns = [
            Column::bool("/a", "p"),
            Column::f64("/a", "q"),
            Column::bool("/a", "r"),
            Column::u64("/a", "s"),
        ];
        let t = &topics(&columns)[0];
        let row = [true.into(), 1.0.into(), true.into(), 0x0102_0304_0506_0708_u64.into()];
        let mut buf = Vec::new();
        t.encode(&row, &mut buf);
        let mut want = vec![0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
        want.extend([0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
        want.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        want.extend([8, 7, 6, 5, 4, 3, 2, 1]);
        assert_eq!(buf, want);
        assert_eq!(t.schema, "bool p\nfloat64 q\nbool r\nuint64 s\n");
    }

    #[test]
    fn invariant_topics_never_share_a_schema_name() {
        let columns =
            [Column::f64("/a/b", "x"), Column::f64("/a_b", "y"), Column::f64("/a/b", "z")];
        let names: Vec<_> = topics(&columns).into_iter().map(|t| t.schema_name).collect();
        assert_eq!(names, ["docktwin_msgs/msg/AB", "docktwin_msgs/msg/ABTopic2"]);
    }

    #[test]
    fn invariant_events_come_back_and_cut_ones_are_refused() {
        let e = crate::Event {
            tick: 9,
            time_s: 0.1 + 0.2,
            kind: "contact_begin".into(),
            text: "petal 1 · ring".into(),
            body: serde_json::json!({ "depth_m": 1e-9 }),
        };
        let mut buf = Vec::new();
        encode_event(&e, &mut buf);
        assert_eq!(decode_event(&buf), Some(e));
        assert!((0..buf.len()).all(|n| decode_event(&buf[..n]).is_none()));
    }

    #[test]
    fn invariant_a_digest_comes_back_and_a_cut_one_is_refused() {
        let digest = |n: u8| docktwin_core::Digest([n; 16]);
        let link = Link {
            first_tick: 50,
            last_tick: 99,
            ticks: 50,
            before: digest(1),
            after: digest(0xab),
            events: EventChain { count: 3, digest: digest(7) },
        };
        let mut buf = Vec::new();
        encode_link(&link, &mut buf);
        assert_eq!(decode_link(&buf), Some(link));
        assert!((0..buf.len()).all(|n| decode_link(&buf[..n]).is_none()));
    }

    #[test]
    fn invariant_a_message_cut_anywhere_is_refused() {
        let mut buf = Vec::new();
        encode_contacts(7, &[ContactRow::default(), ContactRow::default()], &mut buf);
        assert_eq!(decode_contacts(&buf).unwrap().1.len(), 2);
        for n in 0..buf.len() {
            assert!(decode_contacts(&buf[..n]).is_none(), "{n} bytes were read as a message");
        }
    }
}
