//! The MCAP container (<https://mcap.dev/spec>), as far as a recording needs it.
//!
//! Written here, not with `mcap::Writer`, for speed: that one hands every message to the compressor
//! in seven small pieces, each with two checksums, and starts a new compressor for every chunk.
//! Files are read with the `mcap` crate, which thereby checks what stands here.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mcap::MAGIC;
use mcap::records::op;

/// Numbers of a simulation hardly shrink further at higher levels; at this one a chunk costs half
/// the time of level 1 for 7 % more bytes.
const ZSTD_LEVEL: i32 = -3;

/// Writes whole chunks to `out`, each in a single call, and never touches a byte again: a file cut
/// anywhere is whole up to its last complete chunk.
pub(crate) struct Container<W> {
    out: W,
    /// Whole records on their way to `out`.
    pending: Vec<u8>,
    /// Offset in the file of the end of `pending`.
    at: u64,
    compressor: zstd::bulk::Compressor<'static>,
    compressed: Vec<u8>,
    /// Records of the open chunk.
    chunk: Vec<u8>,
    /// Per channel: time and offset of each message of the open chunk.
    index: Vec<Vec<(u64, u64)>>,
    /// Earliest and latest time in the open chunk, ns.
    bounds: Option<(u64, u64)>,
    summary: SummaryParts,
}

/// Records of the summary section, encoded as they come up.
#[derive(Default)]
struct SummaryParts {
    schemas: Vec<u8>,
    channels: Vec<u8>,
    chunk_notes: Vec<ChunkNote>,
    /// Offset of the first chunk.
    chunks_at: u64,
    metadata_indexes: Vec<u8>,
    metadata: u32,
    messages: Vec<u64>,
    bounds: Option<(u64, u64)>,
}

/// What the index of a chunk is made of at the end; some forty bytes, so that a long run needs little.
struct ChunkNote {
    /// Earliest and latest time, ns.
    bounds: (u64, u64),
    /// Of the whole record, bytes.
    length: u64,
    uncompressed: u64,
    /// Numbers of messages by channel: how many channels in a row have how many.
    counts: Box<[(u16, u16)]>,
}

/// Of a chunk record beside its compressed content: opcode and length, times, size, checksum, `zstd`,
/// length of the content.
const CHUNK_OVERHEAD: u64 = 9 + 8 + 8 + 8 + 4 + 8 + 8;

/// Length of the record that holds the index of so many messages of one channel.
const fn message_index_length(messages: u16) -> u64 {
    9 + 2 + 4 + 16 * messages as u64
}

impl ChunkNote {
    /// Channel and number of messages, of those that have any.
    fn messages(&self) -> impl Iterator<Item = (u16, u16)> + '_ {
        let by_channel = self.counts.iter().flat_map(|(channels, n)| (0..*channels).map(|_| *n));
        (1u16..).zip(by_channel).filter(|(_, n)| *n > 0)
    }

    /// The index record of the chunk at `at`, and where the next one begins.
    fn index(&self, at: u64, out: &mut Vec<u8>) -> u64 {
        let indexes_at = at + self.length;
        let mut end = indexes_at;
        out.record(op::CHUNK_INDEX, |b| {
            b.u64(self.bounds.0);
            b.u64(self.bounds.1);
            b.u64(at);
            b.u64(self.length);
            b.sized(|b| {
                for (id, n) in self.messages() {
                    b.u16(id);
                    b.u64(end);
                    end += message_index_length(n);
                }
            });
            b.u64(end - indexes_at);
            b.text("zstd");
            b.u64(self.length - CHUNK_OVERHEAD);
            b.u64(self.uncompressed);
        });
        end
    }
}

/// Neighbours with the same number, counted.
fn run_lengths(numbers: impl Iterator<Item = u16>) -> Box<[(u16, u16)]> {
    let mut out: Vec<(u16, u16)> = Vec::new();
    for n in numbers {
        match out.last_mut() {
            Some((count, same)) if *same == n => *count += 1,
            _ => out.push((1, n)),
        }
    }
    out.into_boxed_slice()
}

/// Appends MCAP's little-endian values.
trait Put {
    fn u16(&mut self, x: u16);
    fn u32(&mut self, x: u32);
    fn u64(&mut self, x: u64);
    fn text(&mut self, s: &str);
    /// A value with its length in bytes, 32 bits, before it.
    fn sized(&mut self, f: impl FnOnce(&mut Self));
    /// A record: its opcode, its length in bytes, 64 bits, its body.
    fn record(&mut self, opcode: u8, f: impl FnOnce(&mut Self));
}

impl Put for Vec<u8> {
    fn u16(&mut self, x: u16) {
        self.extend_from_slice(&x.to_le_bytes());
    }

    fn u32(&mut self, x: u32) {
        self.extend_from_slice(&x.to_le_bytes());
    }

    fn u64(&mut self, x: u64) {
        self.extend_from_slice(&x.to_le_bytes());
    }

    fn text(&mut self, s: &str) {
        self.sized(|b| b.extend_from_slice(s.as_bytes()));
    }

    fn sized(&mut self, f: impl FnOnce(&mut Self)) {
        let start = self.len();
        self.u32(0);
        f(self);
        // Texts and tables of a recording are far below 4 GiB.
        let len = u32::try_from(self.len() - start - 4).unwrap_or(u32::MAX);
        self[start..start + 4].copy_from_slice(&len.to_le_bytes());
    }

    fn record(&mut self, opcode: u8, f: impl FnOnce(&mut Self)) {
        self.push(opcode);
        let start = self.len();
        self.u64(0);
        f(self);
        let len = (self.len() - start - 8) as u64;
        self[start..start + 8].copy_from_slice(&len.to_le_bytes());
    }
}

fn put_map(b: &mut Vec<u8>, map: &BTreeMap<String, String>) {
    b.sized(|b| {
        for (k, v) in map {
            b.text(k);
            b.text(v);
        }
    });
}

fn widen(bounds: Option<(u64, u64)>, (from, to): (u64, u64)) -> (u64, u64) {
    bounds.map_or((from, to), |(a, b)| (a.min(from), b.max(to)))
}

impl<W: Write> Container<W> {
    pub(crate) fn new(out: W) -> io::Result<Self> {
        let mut pending = MAGIC.to_vec();
        pending.record(op::HEADER, |b| {
            b.text("");
            b.text(concat!("docktwin ", env!("CARGO_PKG_VERSION")));
        });
        Ok(Self {
            out,
            at: pending.len() as u64,
            pending,
            compressor: zstd::bulk::Compressor::new(ZSTD_LEVEL)?,
            compressed: Vec::new(),
            chunk: Vec::new(),
            index: Vec::new(),
            bounds: None,
            summary: SummaryParts::default(),
        })
    }

    fn record(&mut self, opcode: u8, f: impl FnOnce(&mut Vec<u8>)) -> (u64, u64) {
        let (offset, start) = (self.at, self.pending.len());
        self.pending.record(opcode, f);
        let length = (self.pending.len() - start) as u64;
        self.at += length;
        (offset, length)
    }

    /// A named table of texts; only before the first message.
    pub(crate) fn metadata(&mut self, name: &str, map: &BTreeMap<String, String>) {
        let (offset, length) = self.record(op::METADATA, |b| {
            b.text(name);
            put_map(b, map);
        });
        self.summary.metadata += 1;
        self.summary.metadata_indexes.record(op::METADATA_INDEX, |b| {
            b.u64(offset);
            b.u64(length);
            b.text(name);
        });
    }

    /// Declares a channel of `cdr` messages with its own `ros2msg` schema; returns its id.
    pub(crate) fn channel(&mut self, topic: &str, schema_name: &str, schema: &str) -> u16 {
        self.index.push(Vec::new());
        self.summary.messages.push(0);
        // Ids from 1, the schema's the same; 65 535 topics are more than any list of columns has.
        let id = u16::try_from(self.index.len()).unwrap_or(u16::MAX);
        let schema_start = self.summary.schemas.len();
        self.summary.schemas.record(op::SCHEMA, |b| {
            b.u16(id);
            b.text(schema_name);
            b.text("ros2msg");
            b.text(schema);
        });
        let channel_start = self.summary.channels.len();
        self.summary.channels.record(op::CHANNEL, |b| {
            b.u16(id);
            b.u16(id);
            b.text(topic);
            b.text("cdr");
            put_map(b, &BTreeMap::new());
        });
        self.chunk.extend_from_slice(&self.summary.schemas[schema_start..]);
        self.chunk.extend_from_slice(&self.summary.channels[channel_start..]);
        id
    }

    /// Adds a message to the open chunk; `channel` is an id from [`Container::channel`].
    /// `nanos` is simulated time, `published` the wall clock's.
    pub(crate) fn message(
        &mut self,
        channel: u16,
        sequence: u32,
        nanos: u64,
        published: u64,
        data: &[u8],
    ) {
        let i = usize::from(channel) - 1;
        self.index[i].push((nanos, self.chunk.len() as u64));
        self.summary.messages[i] += 1;
        self.bounds = Some(widen(self.bounds, (nanos, nanos)));
        self.chunk.record(op::MESSAGE, |b| {
            b.u16(channel);
            b.u32(sequence);
            b.u64(nanos);
            b.u64(published);
            b.extend_from_slice(data);
        });
    }

    /// Ends the open chunk, if it has content, and writes all that is pending.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        if !self.chunk.is_empty() {
            self.end_chunk()?;
        }
        self.write_out()
    }

    /// Writes all that is pending and leaves the open chunk open.
    pub(crate) fn write_out(&mut self) -> io::Result<()> {
        self.out.write_all(&self.pending)?;
        self.pending.clear();
        self.out.flush()
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        let (first, last) = self.bounds.take().unwrap_or((0, 0));
        let uncompressed = self.chunk.len() as u64;
        let crc = crc32fast::hash(&self.chunk);
        let mut compressed = core::mem::take(&mut self.compressed);
        compressed.clear();
        compressed.reserve(zstd::zstd_safe::compress_bound(self.chunk.len()));
        self.compressor.compress_to_buffer(&self.chunk, &mut compressed)?;
        let (at, length) = self.record(op::CHUNK, |b| {
            b.u64(first);
            b.u64(last);
            b.u64(uncompressed);
            b.u32(crc);
            b.text("zstd");
            b.u64(compressed.len() as u64);
            b.extend_from_slice(&compressed);
        });

        let mut index = core::mem::take(&mut self.index);
        // A chunk has far fewer messages than 65 535 a channel.
        let count = |e: &Vec<(u64, u64)>| u16::try_from(e.len()).unwrap_or(u16::MAX);
        let counts = run_lengths(index.iter().map(count));
        let mut empty = true;
        for (id, entries) in (1u16..).zip(&mut index).filter(|(_, e)| !e.is_empty()) {
            empty = false;
            self.record(op::MESSAGE_INDEX, |b| {
                b.u16(id);
                b.sized(|b| {
                    for (time, offset) in entries.drain(..) {
                        b.u64(time);
                        b.u64(offset);
                    }
                });
            });
        }
        // A run without messages has one chunk, of channels alone, which has no time.
        if !empty {
            self.summary.bounds = Some(widen(self.summary.bounds, (first, last)));
        }
        if self.summary.chunk_notes.is_empty() {
            self.summary.chunks_at = at;
        }
        let note = ChunkNote { bounds: (first, last), length, uncompressed, counts };
        self.summary.chunk_notes.push(note);
        self.chunk.clear();
        self.index = index;
        self.compressed = compressed;
        Ok(())
    }

    /// Writes the summary section and the end mark.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        // 0: no checksum over the whole file; every chunk has its own.
        self.record(op::DATA_END, |b| b.u32(0));
        let summary_start = self.at;
        let base = self.pending.len();
        let parts = core::mem::take(&mut self.summary);
        let mut statistics = Vec::new();
        statistics.record(op::STATISTICS, |b| {
            let channels = parts.messages.len();
            let (first, last) = parts.bounds.unwrap_or((0, 0));
            b.u64(parts.messages.iter().sum());
            b.u16(u16::try_from(channels).unwrap_or(u16::MAX));
            b.u32(u32::try_from(channels).unwrap_or(u32::MAX));
            b.u32(0);
            b.u32(parts.metadata);
            b.u32(u32::try_from(parts.chunk_notes.len()).unwrap_or(u32::MAX));
            b.u64(first);
            b.u64(last);
            b.sized(|b| {
                for (id, n) in (1u16..).zip(&parts.messages) {
                    b.u16(id);
                    b.u64(*n);
                }
            });
        });
        // One chunk follows the other, each with the indexes of its messages behind it.
        let mut chunk_indexes = Vec::new();
        let mut at = parts.chunks_at;
        for note in &parts.chunk_notes {
            at = note.index(at, &mut chunk_indexes);
        }
        let mut groups = Vec::new();
        for (opcode, bytes) in [
            (op::SCHEMA, &parts.schemas),
            (op::CHANNEL, &parts.channels),
            (op::STATISTICS, &statistics),
            (op::CHUNK_INDEX, &chunk_indexes),
            (op::METADATA_INDEX, &parts.metadata_indexes),
        ] {
            if !bytes.is_empty() {
                groups.push((opcode, self.at, bytes.len() as u64));
                self.pending.extend_from_slice(bytes);
                self.at += bytes.len() as u64;
            }
        }
        let offsets_start = self.at;
        for (opcode, start, length) in groups {
            self.record(op::SUMMARY_OFFSET, |b| {
                b.push(opcode);
                b.u64(start);
                b.u64(length);
            });
        }
        self.record(op::FOOTER, |b| {
            b.u64(summary_start);
            b.u64(offsets_start);
            b.u32(0);
        });
        // The checksum covers the summary section and the footer up to the checksum itself.
        let end = self.pending.len() - 4;
        let crc = crc32fast::hash(&self.pending[base..end]);
        self.pending[end..].copy_from_slice(&crc.to_le_bytes());
        self.pending.extend_from_slice(MAGIC);
        self.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::MessageStream;

    #[test]
    fn oracle_the_mcap_crate_reads_the_whole_container() {
        let mut bytes = Vec::new();
        let mut c = Container::new(&mut bytes).unwrap();
        c.metadata("docktwin", &[("seed".to_owned(), "7".to_owned())].into());
        let a = c.channel("/a", "docktwin_msgs/msg/A", "float64 x\n");
        let b = c.channel("/b", "docktwin_msgs/msg/B", "bool y\n");
        c.write_out().unwrap();
        for i in 0..10u32 {
            c.message(a, i, u64::from(i) * 100, 7, &[i as u8; 12]);
            if i % 3 == 0 {
                c.message(b, i, u64::from(i) * 100 + 1, 7, b"b");
            }
            if i % 4 == 3 {
                c.flush().unwrap();
            }
        }
        c.finish().unwrap();

        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let stats = summary.stats.as_ref().unwrap();
        assert_eq!((stats.message_count, stats.chunk_count, stats.metadata_count), (14, 3, 1));
        assert_eq!((stats.message_start_time, stats.message_end_time), (0, 901));
        assert_eq!(stats.channel_message_counts, [(a, 10), (b, 4)].into());
        assert_eq!(summary.channels[&b].schema.as_ref().unwrap().name, "docktwin_msgs/msg/B");

        // In the order of the file, with chunk checksums …
        let linear: Vec<_> = MessageStream::new(&bytes)
            .unwrap()
            .map(|m| m.unwrap())
            .map(|m| (m.channel.topic.clone(), m.sequence, m.log_time, m.data.into_owned()))
            .collect();
        assert_eq!(linear.len(), 14);
        assert_eq!(linear[0], ("/a".into(), 0, 0, vec![0; 12]));
        assert_eq!(linear[1], ("/b".into(), 0, 1, b"b".to_vec()));
        // … and through the indexes.
        let mut indexed = Vec::new();
        for chunk in &summary.chunk_indexes {
            let found = summary.read_message_indexes(&bytes, chunk).unwrap().into_iter();
            for (channel, entries) in found.map(|(c, e)| (c.id, e)).collect::<BTreeMap<_, _>>() {
                for e in entries {
                    let m = summary.seek_message(&bytes, chunk, &e).unwrap();
                    assert_eq!((m.log_time, m.channel.id), (e.log_time, channel));
                    indexed.push((
                        m.channel.topic.clone(),
                        m.sequence,
                        m.log_time,
                        m.data.into_owned(),
                    ));
                }
            }
        }
        indexed.sort_by_key(|m| m.2);
        assert_eq!(indexed, linear);
        let at = &summary.metadata_indexes[0];
        let record = mcap::read::metadata(&bytes, at).unwrap();
        assert_eq!((record.name.as_str(), record.metadata["seed"].as_str()), ("docktwin", "7"));
    }

    #[test]
    fn invariant_a_container_without_messages_is_whole() {
        let mut bytes = Vec::new();
        Container::new(&mut bytes).unwrap().finish().unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, 0);
    }
}
