//! Whether the files of a run directory belong together.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path};

use docktwin_core::{Digest, StateHasher};
use serde_json::Value;

use crate::paths::open_file;
use crate::{RecordError, SUMMARY_SCHEMA, Summary, files};

/// Key of the metadata, before the path of a file that is kept with the run, of its digest.
pub const KEPT_KEY: &str = "kept:";
/// Key of the summary's own digest.
const OWN_DIGEST: &str = "summary_digest";
/// Longest line of `events.jsonl`, and longest summary.
pub(crate) const MAX_TEXT_BYTES: u64 = 1 << 24;
/// Largest file that is held against its digest.
const MAX_KEPT_BYTES: u64 = 1 << 28;

/// The digest of all keys but the digest itself, however they are ordered, spaced and written.
pub(crate) fn own_digest(summary: &Value) -> Digest {
    let mut h = StateHasher::new();
    hash(summary, true, &mut h);
    h.finish()
}

fn hash(v: &Value, top: bool, h: &mut StateHasher) {
    let text = |s: &str, h: &mut StateHasher| {
        h.u64(s.len() as u64);
        h.bytes(s.as_bytes());
    };
    match v {
        Value::Null => h.bytes(b"0"),
        Value::Bool(b) => h.bytes(if *b { b"t" } else { b"f" }),
        // 3 and 3.0 are one number, but large counts are more than a float holds.
        Value::Number(n) => match n.as_u64().filter(|u| *u > 1 << 53) {
            Some(u) => {
                h.bytes(b"u");
                h.u64(u);
            }
            None => {
                h.bytes(b"n");
                h.f64(n.as_f64().unwrap_or(f64::NAN));
            }
        },
        Value::String(s) => {
            h.bytes(b"s");
            text(s, h);
        }
        Value::Array(items) => {
            h.bytes(b"[");
            h.u64(items.len() as u64);
            items.iter().for_each(|i| hash(i, false, h));
        }
        Value::Object(map) => {
            let mut keys: Vec<&String> = map.keys().filter(|k| !top || *k != OWN_DIGEST).collect();
            keys.sort();
            h.bytes(b"{");
            h.u64(keys.len() as u64);
            for k in keys {
                text(k, h);
                hash(&map[k], false, h);
            }
        }
    }
}

/// `summary.json`, and what its own digest says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SummaryFile {
    /// The summary.
    pub summary: Summary,
    /// Why it is not what was written; `None` for one that is, or that is too old to have a digest.
    pub damage: Option<String>,
}

/// Reads `summary.json` of a run directory; `None` where there is none.
///
/// # Errors
/// It cannot be read, is no summary, or is of a newer schema.
pub fn read_summary(dir: &Path) -> Result<Option<SummaryFile>, RecordError> {
    let path = dir.join(files::SUMMARY);
    let mut text = String::new();
    let read = match open_file(&path, "read the summary") {
        Ok(file) => file.take(MAX_TEXT_BYTES).read_to_string(&mut text),
        Err(RecordError::Io { kind: io::ErrorKind::NotFound, .. }) => return Ok(None),
        Err(e) => return Err(e),
    };
    read.map_err(|e| RecordError::io("read the summary", &path, &e))?;
    let bad = |e: serde_json::Error| RecordError::NotARecording {
        why: format!("this is no summary ({e})"),
        path: path.clone(),
    };
    let value: Value = serde_json::from_str(&text).map_err(bad)?;
    let found = value["schema_version"].as_u64().unwrap_or(0);
    if found > u64::from(SUMMARY_SCHEMA) {
        let found = u32::try_from(found).unwrap_or(u32::MAX);
        return Err(RecordError::Newer { found, supported: SUMMARY_SCHEMA, path });
    }
    let now = own_digest(&value).to_string();
    let summary: Summary = serde_json::from_value(value).map_err(bad)?;
    let said = summary.summary_digest.as_ref();
    let damage = said.filter(|said| **said != now).map(|_| {
        "summary.json is not as it was written: its digest differs (edited or damaged)".to_owned()
    });
    Ok(Some(SummaryFile { summary, damage }))
}

/// Why the file at `relative` of a run directory is not the one with this digest.
pub(crate) fn file_problem(dir: &Path, relative: &str, digest: &str) -> Option<String> {
    let path = Path::new(relative);
    if !path.components().all(|c| matches!(c, Component::Normal(_))) {
        return Some(format!("`{relative}` is no file below the run directory"));
    }
    let read = || -> Result<Vec<u8>, RecordError> {
        let (path, mut bytes) = (dir.join(path), Vec::new());
        let file: File = open_file(&path, "read a file of the run")?;
        file.take(MAX_KEPT_BYTES)
            .read_to_end(&mut bytes)
            .map_err(|e| RecordError::io("read a file of the run", &path, &e))?;
        Ok(bytes)
    };
    match read() {
        Ok(bytes) if Digest::of_bytes(&bytes).to_string() == digest => None,
        Ok(_) => Some(format!("{relative} is not the file of the run: its digest differs")),
        Err(RecordError::Io { kind: io::ErrorKind::NotFound, .. }) => {
            Some(format!("{relative} is missing"))
        }
        Err(e) => Some(e.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_the_digest_of_a_summary_is_over_its_values() {
        let of = |text: &str| own_digest(&serde_json::from_str(text).unwrap());
        let plain = of(r#"{"a": 1.5, "b": [null, true, "x"], "summary_digest": "00"}"#);
        assert_eq!(plain, of(r#"{"b":[null,true,"x"],"a":15e-1}"#));
        for other in [
            r#"{"a": 1.6, "b": [null, true, "x"]}"#,
            r#"{"a": 1.5, "b": [null, false, "x"]}"#,
            r#"{"a": 1.5, "b": [null, true, "y"]}"#,
            r#"{"a": 1.5, "b": [0, true, "x"]}"#,
            r#"{"a": 1.5, "c": [null, true, "x"]}"#,
            r#"{"a": "1.5", "b": [null, true, "x"]}"#,
            r#"{"a": 1.5, "b": [null, true], "x": null}"#,
        ] {
            assert_ne!(plain, of(other), "{other}");
        }
        assert_ne!(of("18446744073709551615"), of("18446744073709551614"));
    }
}
