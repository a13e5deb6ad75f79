use std::collections::BTreeMap;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use rerun::external::re_log_encoding::DecoderApp;
use rerun::external::re_log_types::LogMsg;
use rerun::log::Chunk;

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

/// Whether a recording is there, readable and closed: a writer that was killed leaves no table of
/// contents at the end.
#[must_use]
pub fn is_whole(path: &Path) -> bool {
    ends_with_its_footer(path).unwrap_or(false) && each(path, |_| Ok(())).is_ok()
}

/// Whether the last frame of the file is that of its table of contents: 12 bytes, the tag
/// `RRF2`, the word `FOOT` and a count (`StreamFooter` of re_log_encoding).
fn ends_with_its_footer(path: &Path) -> std::io::Result<bool> {
    let mut file = std::fs::File::open(path)?;
    file.seek(SeekFrom::End(-12))?;
    let mut end = [0; 8];
    file.read_exact(&mut end)?;
    Ok(end == *b"RRF2FOOT")
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
