//! Parsing records of strangers: a length within a record is checked against the record before the
//! `mcap` crate asks for that much memory, and no more of a chunk is unpacked than it may hold.

use std::borrow::Cow;
use std::io;

use mcap::McapError;
use mcap::records::{Record, op};

/// A field whose length matters.
#[derive(Clone, Copy)]
enum Field {
    /// So many bytes.
    Fixed(usize),
    /// A length of 32 bits and as many bytes.
    Sized,
    /// The same, and within it texts with lengths of their own.
    Texts,
    /// A length of 64 bits and as many bytes.
    Long,
}

/// Fields of a record up to the last with a length (<https://mcap.dev/spec>).
fn fields(opcode: u8) -> Option<&'static [Field]> {
    use Field::{Fixed, Long, Sized, Texts};
    Some(match opcode {
        op::HEADER => &[Sized, Sized],
        op::FOOTER => &[Fixed(20)],
        op::SCHEMA => &[Fixed(2), Sized, Sized, Sized],
        op::CHANNEL => &[Fixed(4), Sized, Sized, Texts],
        op::MESSAGE => &[Fixed(22)],
        op::CHUNK => &[Fixed(28), Sized, Long],
        op::MESSAGE_INDEX => &[Fixed(2), Sized],
        op::CHUNK_INDEX => &[Fixed(32), Sized, Fixed(8), Sized, Fixed(16)],
        op::ATTACHMENT => &[Fixed(16), Sized, Sized, Long, Fixed(4)],
        op::ATTACHMENT_INDEX => &[Fixed(40), Sized, Sized],
        op::STATISTICS => &[Fixed(42), Sized],
        op::METADATA => &[Sized, Texts],
        op::METADATA_INDEX => &[Fixed(16), Sized],
        op::SUMMARY_OFFSET => &[Fixed(17)],
        op::DATA_END => &[Fixed(4)],
        _ => return None,
    })
}

/// The first `n` bytes and the rest.
fn split(data: &[u8], n: u64) -> Option<(&[u8], &[u8])> {
    data.split_at_checked(usize::try_from(n).ok()?)
}

fn sized(data: &[u8]) -> Option<(&[u8], &[u8])> {
    let (n, rest) = data.split_first_chunk::<4>()?;
    split(rest, u32::from_le_bytes(*n).into())
}

fn fits(opcode: u8, mut body: &[u8]) -> Option<()> {
    for field in fields(opcode)? {
        body = match field {
            Field::Fixed(n) => split(body, *n as u64)?.1,
            Field::Sized => sized(body)?.1,
            Field::Texts => {
                let (mut texts, rest) = sized(body)?;
                while !texts.is_empty() {
                    texts = sized(texts)?.1;
                }
                rest
            }
            Field::Long => {
                let (n, rest) = body.split_first_chunk::<8>()?;
                split(rest, u64::from_le_bytes(*n))?.1
            }
        };
    }
    Some(())
}

fn wrong(what: impl Into<String>) -> McapError {
    McapError::Io(io::Error::new(io::ErrorKind::InvalidData, what.into()))
}

/// A record of a known kind.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, McapError> {
    fits(opcode, body).ok_or_else(|| wrong("a record that is not what it says"))?;
    mcap::parse_record(opcode, body)
}

/// The records in the body of a chunk. What it claims is checked before anything is unpacked.
pub(crate) fn records_of(body: &[u8], most: usize) -> Result<Cow<'_, [u8]>, McapError> {
    let Record::Chunk { header, data } = parse(op::CHUNK, body)? else {
        return Err(wrong("a chunk that is none"));
    };
    let size = header.uncompressed_size;
    let size = usize::try_from(size).ok().filter(|n| *n <= most);
    let size = size
        .ok_or_else(|| wrong(format!("a chunk that claims {} bytes", header.uncompressed_size)))?;
    let records = match header.compression.as_str() {
        "" => data,
        "zstd" => zstd::bulk::decompress(&data, size)
            .map(Cow::Owned)
            .map_err(|e| wrong(format!("a chunk that cannot be unpacked: {e}")))?,
        other => return Err(wrong(format!("a chunk compressed with `{other}`"))),
    };
    if records.len() != size {
        return Err(wrong(format!("a chunk of {} bytes that claims {size}", records.len())));
    }
    if header.uncompressed_crc != 0 && crc32fast::hash(&records) != header.uncompressed_crc {
        return Err(wrong("a chunk that is not what its checksum says"));
    }
    Ok(records)
}

/// Opcode and body of the first of several records, and the others.
pub(crate) fn first_record(records: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (header, rest) = records.split_first_chunk::<9>()?;
    let [opcode, length @ ..] = *header;
    let (body, rest) = split(rest, u64::from_le_bytes(length))?;
    Some((opcode, body, rest))
}
