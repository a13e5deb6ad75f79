//! The model files of a run, kept with it: a run directory can be replayed on any machine and after
//! the originals have changed.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Component, Path, PathBuf},
};

use docktwin_core::Digest;
use docktwin_model::named_meshes;
use docktwin_record::{RecordError, RunWriter};
use docktwin_scenario::{Scenario, resolve_path};

use crate::failure::Failure;

/// Folder of a run directory that holds its models.
const FOLDER: &str = "models";
/// Keys of a scenario that name a model.
const KEYS: [(&str, &str); 4] =
    [("chaser", "model"), ("target", "model"), ("mechanism", "active"), ("mechanism", "passive")];

/// Copies of every file a scenario read, and of the meshes that its URDFs name. They stand to each
/// other as the originals do, so that relative paths between them stay right.
pub(crate) struct ModelCopies {
    /// By path below the run directory.
    files: BTreeMap<PathBuf, Vec<u8>>,
    /// New name of the model, by table and key of the scenario.
    names: Vec<(&'static str, &'static str, String)>,
}

impl ModelCopies {
    /// Reads the files again.
    ///
    /// # Errors
    /// A file that cannot be read, or is no longer the one the scenario was made from.
    pub(crate) fn read(scenario: &Scenario) -> Result<Self, Failure> {
        let changed = |path: &Path, why: String| Failure::Usage {
            what: format!("a model cannot be kept with the run: {why}: {}", path.display()),
            remedy: "rehearse again when nothing else writes the models".to_owned(),
        };
        let mut originals: BTreeMap<PathBuf, Vec<u8>> = BTreeMap::new();
        for file in scenario.files.iter().skip(1) {
            let bytes =
                std::fs::read(&file.path).map_err(|e| changed(&file.path, e.to_string()))?;
            if Digest::of_bytes(&bytes) != file.digest {
                return Err(changed(&file.path, "it changed after it was read".to_owned()));
            }
            originals.insert(plain(&file.path), bytes);
        }
        let mut meshes: BTreeMap<PathBuf, Vec<u8>> = BTreeMap::new();
        for file in scenario.files.iter().skip(1) {
            let is_urdf = file.path.extension().is_some_and(|e| e == "urdf");
            let Some(bytes) = originals.get(&plain(&file.path)).filter(|_| is_urdf) else {
                continue;
            };
            let folder = file.path.parent().unwrap_or(Path::new(""));
            for name in named_meshes(&String::from_utf8_lossy(bytes)) {
                let path = folder.join(name);
                let bytes = std::fs::read(&path).map_err(|e| changed(&path, e.to_string()))?;
                meshes.insert(plain(&path), bytes);
            }
        }
        originals.extend(meshes);
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
                let found = resolve_path(&scenario.files.first()?.path, Path::new(&named))?;
                Some((table, key, slashes(&below(&plain(&found)))))
            })
            .collect();
        let files = originals.iter().map(|(p, b)| (below(p), b.clone())).collect();
        Ok(Self { files, names })
    }

    /// Writes the copies into the run directory.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn write(&self, writer: &RunWriter) -> Result<(), RecordError> {
        self.files.iter().try_for_each(|(path, bytes)| writer.keep_file(path, bytes))
    }

    /// The scenario with the copies in place of the originals.
    pub(crate) fn refer(&self, scenario: &str) -> String {
        let Ok(mut text) = scenario.parse::<toml_edit::DocumentMut>() else {
            return scenario.to_owned();
        };
        for (table, key, name) in &self.names {
            text[*table][*key] = toml_edit::value(name);
        }
        text.to_string()
    }
}

/// Absolute and without `.` and `..`.
fn plain(path: &Path) -> PathBuf {
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
fn slashes(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|p| p.to_string_lossy()).collect();
    parts.join("/")
}
