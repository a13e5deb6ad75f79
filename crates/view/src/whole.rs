use std::collections::BTreeMap;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use re_chunk::Chunk;
use re_log_encoding::{Decodable as _, DecoderApp, StreamFooter};
use re_log_types::LogMsg;

/// Calls `look` with every message; the first error ends it.
fn each(path: &Path, mut look: impl FnMut(LogMsg) -> Result<(), String>) -> Result<(), String> {
    let text = |e: &dyn core::fmt::Display| e.to_string();
    let file = std::fs::File::open(path).map_err(|e| text(&e))?;
    let messages = DecoderApp::decode_eager(std::io::BufReader::new(file)).map_err(|e| text(&e))?;
    for message in messages {
        look(message.map_err(|e| text(&e))?)?;
    }
    Ok(())
}

/// Whether a recording is there, readable, and closed: one that was cut or whose writer was killed
/// has no footer, though rerun would show what there is of it.
#[must_use]
pub fn is_whole(path: &Path) -> bool {
    has_footer(path) && each(path, |_| Ok(())).is_ok()
}

/// Whether the file ends as a recording that was closed does.
pub(crate) fn has_footer(path: &Path) -> bool {
    let footer = || -> std::io::Result<Vec<u8>> {
        let mut file = std::fs::File::open(path)?;
        let size = i64::try_from(StreamFooter::ENCODED_SIZE_BYTES).unwrap_or(i64::MAX);
        file.seek(SeekFrom::End(-size))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    footer().is_ok_and(|bytes| StreamFooter::from_rrd_bytes(&bytes).is_ok())
}

/// What a recording (not its blueprint) holds, entity by entity, as text: a row with its time in
/// nanoseconds and its values, without ids and chunk borders. For tests that compare recordings.
///
/// # Errors
/// The file cannot be read to its end.
#[doc(hidden)]
pub fn content(path: &Path) -> Result<BTreeMap<String, Vec<String>>, String> {
    let mut out = BTreeMap::<String, Vec<String>>::new();
    each(path, |message| {
        let LogMsg::ArrowMsg(store, message) = message else { return Ok(()) };
        if !store.is_recording() {
            return Ok(());
        }
        let chunk = Chunk::from_arrow_msg(&message).map_err(|e| e.to_string())?;
        let times: Vec<i64> =
            chunk.timelines().values().next().map(|t| t.times_raw().to_vec()).unwrap_or_default();
        let rows = out.entry(chunk.entity_path().to_string()).or_default();
        for i in 0..chunk.num_rows() {
            let mut row = times.get(i).map_or_else(|| "static".to_owned(), i64::to_string);
            let mut values = BTreeMap::new();
            #[expect(clippy::iter_over_hash_type, reason = "goes into a sorted map")]
            for (name, column) in chunk.components().iter() {
                let value = column.list_array.value(i);
                values.insert(name.to_string(), format!("{value:?}"));
            }
            for (name, value) in values {
                row.push_str(&format!(" {name} {value}"));
            }
            rows.push(row);
        }
        Ok(())
    })?;
    // Pieces of one entity may come in any order; those of one time are told apart by their content.
    for rows in out.values_mut() {
        rows.sort_by_cached_key(|r| {
            let time = r.split(' ').next().and_then(|t| t.parse::<i64>().ok());
            (time.unwrap_or(i64::MIN), r.clone())
        });
    }
    Ok(out)
}
