//! The next whole chunk behind a damaged place.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};

use mcap::records::op;

use crate::bounded;

/// Bytes looked at at a time.
const BLOCK: usize = 1 << 20;
/// Opcode and length; times, size, checksum; name of the compression with its length; length of the data.
const MOST_HEADER: usize = 9 + 28 + 4 + 4 + 8;

fn u64_at(b: &[u8], at: usize) -> Option<u64> {
    b.get(at..at + 8)?.try_into().ok().map(u64::from_le_bytes)
}

/// Length of the body of what may be a chunk, of which `left` bytes are in the file.
fn plausible(b: &[u8], left: u64, most: u64) -> Option<u64> {
    let body = u64_at(b, 1).filter(|n| *n <= most && n.saturating_add(9) <= left)?;
    let (first, last, size) = (u64_at(b, 9)?, u64_at(b, 17)?, u64_at(b, 25)?);
    let name = u32::from_le_bytes(b.get(37..41)?.try_into().ok()?);
    let name = usize::try_from(name).ok().filter(|n| *n <= 4)?;
    let named = matches!(b.get(41..41 + name)?, b"" | b"zstd");
    let data = u64_at(b, 41 + name)?;
    let fits = body == 28 + 4 + name as u64 + 8 + data;
    (named && fits && first <= last && (1..=most).contains(&size)).then_some(body)
}

/// Offset of the first chunk at or behind `from` that is what its checksum says.
pub(crate) fn next_chunk(file: &File, from: u64, most: usize) -> io::Result<Option<u64>> {
    let mut file = file.try_clone()?;
    let end = file.metadata()?.len();
    let (mut at, mut block) = (from, Vec::new());
    while at < end {
        file.seek(SeekFrom::Start(at))?;
        block.clear();
        (&mut file).take((BLOCK + MOST_HEADER) as u64).read_to_end(&mut block)?;
        let looked_at = block.len().min(BLOCK);
        for i in (0..looked_at).filter(|i| block[*i] == op::CHUNK) {
            let begin = at + i as u64;
            let header = &block[i..block.len().min(i + MOST_HEADER)];
            let Some(n) = plausible(header, end - begin, most as u64) else { continue };
            let mut body = vec![0; usize::try_from(n).unwrap_or(0)];
            file.seek(SeekFrom::Start(begin + 9))?;
            file.read_exact(&mut body)?;
            if bounded::records_of(&body, most).is_ok() {
                return Ok(Some(begin));
            }
        }
        if looked_at == 0 {
            break;
        }
        at += looked_at as u64;
    }
    Ok(None)
}
