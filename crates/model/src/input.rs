//! Reading files that may be anything: bounded, never blocking, and safe to print.

use std::fs;
use std::io::Read as _;
use std::path::Path;

pub use crate::text::{is_unprintable, plain, shown, shown_path};

/// Largest text file that is read, bytes. The largest model shipped has 25 000; parsing takes some
/// hundred times as much memory in the worst case.
pub const MAX_TEXT_BYTES: u64 = 1 << 20;

/// Why a file cannot be read, in the fields of a [`crate::Problem`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unreadable {
    /// Line, where there is one.
    pub line: Option<usize>,
    /// What is wrong.
    pub what: String,
    /// What is allowed; empty when `what` says all.
    pub allowed: String,
    /// What to do.
    pub remedy: String,
}

/// Bytes of a regular file of at most `most` bytes. Directories, pipes, sockets and devices are
/// refused without being opened, so nothing waits for them.
///
/// # Errors
/// Why it cannot be read.
pub fn read_bytes(path: &Path, most: u64) -> Result<Vec<u8>, Unreadable> {
    let failed = |e: &std::io::Error| Unreadable {
        what: match e.kind() {
            std::io::ErrorKind::NotFound => "this file does not exist".into(),
            std::io::ErrorKind::PermissionDenied => "this file may not be read by you".into(),
            _ => format!("this file cannot be read ({e})"),
        },
        remedy: match e.kind() {
            std::io::ErrorKind::PermissionDenied => "give yourself the right to read it".into(),
            _ => "mend the path".into(),
        },
        ..Unreadable::default()
    };
    let meta = fs::metadata(path).map_err(|e| failed(&e))?;
    if !meta.is_file() {
        let kind = if meta.is_dir() { "a directory" } else { "a pipe, a socket or a device" };
        return Err(Unreadable {
            what: format!("is {kind}, not a file"),
            remedy: "give the path of a file".into(),
            ..Unreadable::default()
        });
    }
    let mut bytes = Vec::new();
    let file = fs::File::open(path).map_err(|e| failed(&e))?;
    // The length that the system tells is not asked: it may be wrong, or grow.
    file.take(most + 1).read_to_end(&mut bytes).map_err(|e| failed(&e))?;
    if bytes.len() as u64 > most {
        return Err(too_large(most));
    }
    Ok(bytes)
}

pub(crate) fn too_large(most: u64) -> Unreadable {
    Unreadable {
        what: "is larger than any file of this kind".into(),
        allowed: format!("at most {most} bytes"),
        remedy: "give a text file of the kind asked for, or take out what is not needed".into(),
        ..Unreadable::default()
    }
}

/// Bytes as text, with the place of the first wrong byte.
///
/// # Errors
/// The bytes are not UTF-8, or hold a character that no text has.
pub fn text_of(bytes: impl Into<Vec<u8>>) -> Result<String, Unreadable> {
    let bytes = bytes.into();
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(Unreadable {
            what: "is empty".into(),
            remedy: "write its content, or give the path of another file".into(),
            ..Unreadable::default()
        });
    }
    let line_at = |offset: usize, bytes: &[u8]| {
        Some(1 + bytes[..offset].iter().filter(|b| **b == b'\n').count())
    };
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        return Err(Unreadable {
            line: line_at(at, &bytes),
            what: format!("is not a text: byte {at} is 0"),
            allowed: "UTF-8 text".into(),
            remedy: "give a text file; one saved as UTF-16 must be saved again as UTF-8".into(),
        });
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let byte = e.as_bytes().get(at).copied().unwrap_or_default();
        Unreadable {
            line: line_at(at, e.as_bytes()),
            what: format!("is not UTF-8 text: byte {at} is 0x{byte:02x}"),
            allowed: "UTF-8 text".into(),
            remedy: "save the file as UTF-8".into(),
        }
    })
}

/// Line numbers of a text by offset.
#[derive(Clone, Debug)]
pub struct Lines(Vec<usize>);

impl Lines {
    /// Of this text.
    #[must_use]
    pub fn of(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i).collect())
    }

    /// Line, from 1, of the byte at `offset`.
    #[must_use]
    pub fn at(&self, offset: usize) -> usize {
        1 + self.0.partition_point(|feed| *feed < offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_lines_are_counted() {
        let text = "a\nbb\n\nc";
        let lines = Lines::of(text);
        for offset in 0..=text.len() {
            let counted = 1 + text.bytes().take(offset).filter(|b| *b == b'\n').count();
            assert_eq!(lines.at(offset), counted, "{offset}");
        }
    }
}
