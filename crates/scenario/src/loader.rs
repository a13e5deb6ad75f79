//! A scenario from a file, from a text in memory, or from parts; with values patched.

use std::path::{Path, PathBuf};

use docktwin_model::{FileDigest, Sources, input};

use crate::load::checked;
use crate::overrides::Patch;
use crate::scenario::{Scenario, ScenarioErrors};

/// Reads scenarios: from a file or a text, with values patched, and with models from memory as well as
/// from the disk.
///
/// ```
/// use docktwin_scenario::Loader;
/// # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// # let path = root.join("scenarios/apas_nominal.toml");
/// let wide = Loader::new().set("initial.lateral_y_m", 0.08).set("run.duration_s", 12.0).load(&path)?;
/// assert_eq!(wide.initial.lateral_m[0], 0.08);
/// # Ok::<(), docktwin_scenario::ScenarioErrors>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Loader {
    patches: Vec<Patch>,
    sources: Sources,
    /// What stands before the key of a patch in a message.
    label: &'static str,
}

impl Loader {
    /// Of files as they are.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// With one value patched: a key as `initial.lateral_y_m` or `thrust.0.force_x_n`, in the unit that
    /// the key names. Later patches of a key win. Wrong ones are reported by the load, all at once.
    #[must_use]
    pub fn set(mut self, key: impl Into<String>, value: impl Into<toml_edit::Value>) -> Self {
        self.patches.push(Patch { key: key.into(), value: value.into().to_string() });
        self
    }

    /// With values patched that come as texts, such as from a command line: a value that is not TOML is
    /// a text without quotes. `label` stands before the key in messages.
    #[must_use]
    pub fn set_texts(mut self, label: &'static str, pairs: &[(String, String)]) -> Self {
        self.label = label;
        let patch =
            |(key, value): &(String, String)| Patch { key: key.clone(), value: value.clone() };
        self.patches.extend(pairs.iter().map(patch));
        self
    }

    /// With these sources of files instead of the disk.
    #[must_use]
    pub fn sources(mut self, sources: Sources) -> Self {
        self.sources = sources;
        self
    }

    /// Reads a file and the models it names. Model paths count from the folder of the scenario, or from
    /// one above it.
    ///
    /// # Errors
    /// All problems of the scenario and of all its models.
    pub fn load(&self, path: &Path) -> Result<Scenario, ScenarioErrors> {
        let bytes = self
            .sources
            .read(path, input::MAX_TEXT_BYTES)
            .map_err(|why| ScenarioErrors { problems: vec![why.problem(path, "scenario")] })?;
        let text = input::text_of(&*bytes)
            .map_err(|why| ScenarioErrors { problems: vec![why.problem(path, "scenario")] })?;
        checked(&text, FileDigest::new(path, bytes), &self.patches, self.label, &self.sources)
    }

    /// Checks a text that stands in no file, as if it stood in `folder`, from which model paths count.
    ///
    /// # Errors
    /// All problems of the scenario and of all its models.
    pub fn read(&self, text: &str, folder: &Path) -> Result<Scenario, ScenarioErrors> {
        let path: PathBuf = folder.join("scenario.toml");
        let file = FileDigest::new(&path, text.as_bytes().into());
        checked(text, file, &self.patches, self.label, &self.sources)
    }
}

/// Reads a scenario, applies `overrides` (`key.path`, value) to its tree, checks it and loads the
/// models it names. Model paths are tried from the folder of the scenario upward.
///
/// # Errors
/// All problems of the scenario and of all its models.
pub fn load_scenario(
    path: &Path,
    overrides: &[(String, String)],
) -> Result<Scenario, ScenarioErrors> {
    Loader::new().set_texts("--set ", overrides).load(path)
}

impl Scenario {
    /// From a file; see [`Loader`] for patched values and models in memory.
    ///
    /// # Errors
    /// All problems of the scenario and of all its models.
    pub fn from_path(path: impl AsRef<Path>) -> Result<Self, ScenarioErrors> {
        Loader::new().load(path.as_ref())
    }

    /// From a text, as if it stood in `folder`, from which the paths of models count.
    ///
    /// # Errors
    /// All problems of the scenario and of all its models.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self, ScenarioErrors> {
        Loader::new().read(text, folder.as_ref())
    }
}
