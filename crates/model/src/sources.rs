//! Where files are read from: memory first, then the disk.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use crate::input::{self, Unreadable};

/// Files held in memory, and whether the disk is asked for what they lack.
///
/// A file in memory stands for the file of the same path: it hides one on the disk, and other files
/// refer to it by relative paths as they would to that one.
#[derive(Clone, Debug, PartialEq)]
pub struct Sources {
    /// By absolute path without `.` and `..`.
    memory: Arc<BTreeMap<PathBuf, Arc<[u8]>>>,
    disk: bool,
}

impl Default for Sources {
    fn default() -> Self {
        Self::disk()
    }
}

impl Sources {
    /// The disk alone.
    #[must_use]
    pub fn disk() -> Self {
        Self { memory: Arc::default(), disk: true }
    }

    /// Memory alone: a file that is not given does not exist.
    #[must_use]
    pub fn memory() -> Self {
        Self { memory: Arc::default(), disk: false }
    }

    /// With the content of a file.
    #[must_use]
    pub fn with(mut self, path: impl AsRef<Path>, content: impl Into<Arc<[u8]>>) -> Self {
        Arc::make_mut(&mut self.memory).insert(absolute(path.as_ref()), content.into());
        self
    }

    /// Bytes of a file of at most `most` bytes.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn read(&self, path: &Path, most: u64) -> Result<Arc<[u8]>, Unreadable> {
        match self.memory.get(&absolute(path)) {
            Some(bytes) if bytes.len() as u64 > most => Err(input::too_large(most)),
            Some(bytes) => Ok(Arc::clone(bytes)),
            None if self.disk => input::read_bytes(path, most).map(Into::into),
            None => Err(Unreadable {
                what: "this file is not among those in memory".into(),
                remedy: "add its content, or allow files of the disk".into(),
                ..Unreadable::default()
            }),
        }
    }

    /// Whether a file is one of those in memory.
    pub(crate) fn in_memory(&self, path: &Path) -> bool {
        self.memory.contains_key(&absolute(path))
    }

    /// Whether there is such a file.
    #[must_use]
    pub fn is_file(&self, path: &Path) -> bool {
        self.memory.contains_key(&absolute(path)) || self.disk && path.is_file()
    }
}

/// A path from the root, without `.` and `..`; links are not followed.
#[must_use]
pub fn absolute(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for c in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
        match c {
            Component::ParentDir => {
                out.pop();
            }
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_memory_hides_the_disk_and_may_stand_alone() {
        let here = Path::new("Cargo.toml");
        let alone = Sources::memory().with("a/../Cargo.toml", *b"x");
        assert_eq!(&*alone.read(here, 10).expect("given"), b"x");
        assert!(alone.is_file(here) && !alone.is_file(Path::new("src/lib.rs")));
        assert!(alone.read(Path::new("src/lib.rs"), 1 << 20).is_err());
        let over = Sources::disk().with("Cargo.toml", *b"x");
        assert_eq!(&*over.read(here, 10).expect("given"), b"x");
        assert!(over.read(Path::new("src/lib.rs"), 1 << 20).is_ok());
        assert!(over.read(here, 0).is_err(), "bounded like a file");
    }
}
