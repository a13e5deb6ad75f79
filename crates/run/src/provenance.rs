//! What a run was made from: the model files, kept with it, so that a run directory can be replayed on
//! any machine and after the originals have changed; and the digests by which they are known again.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    sync::Arc,
};

use docktwin_core::Digest;
use docktwin_model::{FileDigest, input, named_meshes, sources::absolute};
use docktwin_record::{RecordError, RunWriter};
use docktwin_scenario::{Scenario, resolve_path_from};

use crate::error::RunError;

/// Folder of a run directory that holds its models.
const FOLDER: &str = "models";
/// Keys of a scenario that name a model.
const KEYS: [(&str, &str); 4] =
    [("chaser", "model"), ("target", "model"), ("mechanism", "active"), ("mechanism", "passive")];

/// Largest mesh that is kept, bytes.
const MOST_MESH_BYTES: u64 = 1 << 28;

/// A file that is kept with a run: its path below the run directory, and its bytes.
pub type KeptFile = (PathBuf, Arc<[u8]>);

/// Copies of every file a scenario read, and of the meshes that its URDFs name. They stand to each
/// other as the originals do, so that relative paths between them stay right.
#[derive(Clone, Debug)]
pub struct ModelCopies {
    /// By path below the run directory.
    files: BTreeMap<PathBuf, Arc<[u8]>>,
    /// New name of the model, by table and key of the scenario.
    names: Vec<(&'static str, &'static str, String)>,
}

impl ModelCopies {
    /// The files as they were read, and the meshes.
    ///
    /// # Errors
    /// A mesh that cannot be read.
    pub fn of(scenario: &Scenario) -> Result<Self, RunError> {
        let models = || scenario.files.iter().skip(1);
        let mut originals: BTreeMap<PathBuf, Arc<[u8]>> =
            models().map(|f| (absolute(&f.path), Arc::clone(&f.bytes))).collect();
        for file in models().filter(|f| f.path.extension().is_some_and(|e| e == "urdf")) {
            let folder = file.path.parent().unwrap_or(Path::new(""));
            for name in named_meshes(&String::from_utf8_lossy(&file.bytes)) {
                let path = folder.join(name);
                let bytes = scenario.sources.read(&path, MOST_MESH_BYTES).map_err(|why| {
                    RunError::usage(
                        format!(
                            "a mesh cannot be kept with the run: {}: {}",
                            why.what,
                            input::shown_path(&path)
                        ),
                        "make the meshes with `cargo xtask meshes`, or mend the name in the URDF",
                    )
                })?;
                originals.insert(absolute(&path), bytes);
            }
        }
        let root = common_folder(originals.keys());
        let below = |path: &Path| {
            // Every original is below the folder common to all.
            Path::new(FOLDER).join(path.strip_prefix(&root).unwrap_or(path))
        };
        let names = KEYS
            .into_iter()
            .filter_map(|(table, key)| {
                let text: toml_edit::DocumentMut = scenario.effective_toml.parse().ok()?;
                let named = text.get(table)?.get(key)?.as_str()?.to_owned();
                let from = &scenario.files.first()?.path;
                let found = resolve_path_from(&scenario.sources, from, Path::new(&named))?;
                Some((table, key, slashes(&below(&absolute(&found)))))
            })
            .collect();
        let files = originals.iter().map(|(p, b)| (below(p), Arc::clone(b))).collect();
        Ok(Self { files, names })
    }

    /// Writes the copies into the run directory.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, writer: &RunWriter) -> Result<(), RecordError> {
        self.files.iter().try_for_each(|(path, bytes)| writer.keep_file(path, bytes))
    }

    /// Path below the run directory and digest of each copy; one whose path is no text is left out.
    pub fn digests(&self) -> impl Iterator<Item = (String, Digest)> {
        let named = self.files.iter().filter(|(path, _)| path.to_str().is_some());
        named.map(|(path, bytes)| (slashes(path), Digest::of_bytes(bytes)))
    }

    /// The scenario with the copies in place of the originals.
    #[must_use]
    pub fn refer(&self, scenario: &str) -> String {
        let Ok(mut text) = scenario.parse::<toml_edit::DocumentMut>() else {
            return scenario.to_owned();
        };
        for (table, key, name) in &self.names {
            text[*table][*key] = toml_edit::value(name);
        }
        text.to_string()
    }
}

/// The deepest folder that holds all of the files.
fn common_folder<'a>(files: impl Iterator<Item = &'a PathBuf>) -> PathBuf {
    let folders: BTreeSet<&Path> = files.filter_map(|f| f.parent()).collect();
    let mut folders = folders.into_iter();
    let first = folders.next().map(Path::to_owned).unwrap_or_default();
    folders.fold(first, |common, folder| {
        let same = core::iter::zip(common.components(), folder.components());
        same.take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
    })
}

/// With `/` between names, as TOML files have it on every system.
pub(crate) fn slashes(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|p| p.to_string_lossy()).collect();
    parts.join("/")
}

/// Keys under which the digests of a run's model files are kept. Numbered, because two files may have
/// one name; the scenario itself, first of all, is kept whole.
pub fn digest_keys(files: &[FileDigest]) -> impl Iterator<Item = (String, &FileDigest)> {
    let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned());
    files
        .iter()
        .enumerate()
        .skip(1)
        .map(move |(i, f)| (format!("digest:{i}:{}", name(&f.path).unwrap_or_default()), f))
}

/// Checks the files of a scenario against the digests in the metadata of a recording.
///
/// # Errors
/// Every file that is another one now.
pub fn same_files(
    files: &[FileDigest],
    metadata: &BTreeMap<String, String>,
    run: &Path,
) -> Result<(), RunError> {
    let changed: Vec<String> = digest_keys(files)
        .filter_map(|(key, f)| {
            let then = metadata.get(&key)?;
            (*then != f.digest.to_string())
                .then(|| format!("{} was {then}, is {}", f.path.display(), f.digest))
        })
        .collect();
    if changed.is_empty() {
        return Ok(());
    }
    Err(RunError::usage(
        format!(
            "model files changed since {} was recorded:\n{}",
            run.display(),
            changed.join("\n")
        ),
        "restore the files of that day, or rehearse again",
    ))
}
