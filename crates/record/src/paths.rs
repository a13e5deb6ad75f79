//! Files of a run directory, opened and on their way to their names.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use crate::RecordError;

/// Opens a regular file: a pipe or a device would wait or never end.
pub(crate) fn open_file(path: &Path, action: &'static str) -> Result<File, RecordError> {
    let meta = fs::metadata(path).map_err(|e| RecordError::io(action, path, &e))?;
    if !meta.is_file() {
        let e = io::Error::new(io::ErrorKind::InvalidInput, "this is not a regular file");
        return Err(RecordError::io(action, path, &e));
    }
    File::open(path).map_err(|e| RecordError::io(action, path, &e))
}

/// A file on its way to its name.
pub(crate) fn part_of(dir: &Path, name: &str) -> PathBuf {
    dir.join(format!(".{name}.part"))
}
