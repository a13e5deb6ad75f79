//! A log written again by the `mcap` crate: other chunks, edited messages, and every checksum right.

use std::borrow::Cow;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use mcap::records::{Metadata, Record};
use mcap::{Message, MessageStream, WriteOptions};

/// What becomes of the messages.
pub(crate) struct Rewrite {
    /// Size of a chunk, bytes; without one there are no chunks.
    pub(crate) chunk_size: Option<u64>,
    /// Metadata behind the messages, as a writer may put them.
    pub(crate) metadata_last: bool,
    /// Whether messages are put into the order of their times, as readers give them.
    pub(crate) sorted: bool,
}

impl Default for Rewrite {
    fn default() -> Self {
        Self { chunk_size: Some(1 << 16), metadata_last: false, sorted: false }
    }
}

/// Writes the log at `path` again. `edit` gets topic, tick (the low half of it) and body of each message and
/// says whether it stays.
pub(crate) fn rewrite(
    path: &Path,
    how: &Rewrite,
    mut edit: impl FnMut(&str, u32, &mut Vec<u8>) -> bool,
) {
    let bytes = fs::read(path).expect("a log");
    let mut messages: Vec<Message<'_>> =
        MessageStream::new(&bytes).expect("a log").map(|m| m.expect("whole")).collect();
    if how.sorted {
        messages.sort_by_key(|m| m.log_time);
    }
    let mut tables: Vec<Metadata> = Vec::new();
    for record in mcap::read::LinearReader::new(&bytes).expect("a log") {
        if let Record::Metadata(m) = record.expect("whole") {
            tables.push(m);
        }
    }
    let options = WriteOptions::new().use_chunks(how.chunk_size.is_some());
    let options = options.chunk_size(how.chunk_size);
    let mut out = options.create(Cursor::new(Vec::new())).expect("room");
    let put_tables = |out: &mut mcap::Writer<Cursor<Vec<u8>>>, now: bool| {
        for m in tables.iter().filter(|_| now) {
            out.write_metadata(m).expect("room");
        }
    };
    put_tables(&mut out, !how.metadata_last);
    for mut m in messages {
        let mut data = m.data.into_owned();
        if edit(&m.channel.topic, m.sequence, &mut data) {
            m.data = Cow::Owned(data);
            out.write(&m).expect("room");
        }
    }
    put_tables(&mut out, how.metadata_last);
    out.finish().expect("room");
    fs::write(path, out.into_inner().into_inner()).expect("room");
}

/// Multiplies the number at this place of a message.
#[allow(dead_code, reason = "not every test edits")]
pub(crate) fn scale(data: &mut [u8], at: usize, factor: f64) {
    let x = f64::from_le_bytes(data[at..at + 8].try_into().expect("8 bytes"));
    data[at..at + 8].copy_from_slice(&(x * factor).to_le_bytes());
}
