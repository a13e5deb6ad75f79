//! A scenario put together in a program.

use std::path::Path;

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

use crate::{ExpectedOutcome, Loader, Scenario, ScenarioErrors};

/// Puts a scenario together key by key, without a file. What comes out is checked like a file, and
/// [`Self::to_toml`] is one.
///
/// ```
/// use docktwin_scenario::{ExpectedOutcome, ScenarioBuilder};
/// # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// let scenario = ScenarioBuilder::new("three_centimetres_off")
///     .description("Slow and 3 cm off.")
///     .spacecraft("models/urdf/chaser_8t.urdf", "models/urdf/target_12t.urdf")
///     .mechanism("models/urdf/apas_active.urdf", "models/urdf/apas_passive.urdf")
///     .set("initial.axial_speed_m_s", 0.06)
///     .set("initial.lateral_y_m", 0.03)
///     .set("run.duration_s", 30.0)
///     .expect(ExpectedOutcome::Captured, "8.6 J of closing energy against less than 1 J.")
///     .fidelity([
///         ("of", "hardware".into()),
///         ("window", "to_capture".into()),
///         ("nrms_force_below", 0.05.into()),
///     ])
///     .build(&root)?;
/// assert_eq!(scenario.initial.axial_speed_m_s, 0.06);
/// assert_eq!(scenario.expect.fidelity[0].nrms_force.below, Some(0.05));
/// # Ok::<(), docktwin_scenario::ScenarioErrors>(())
/// ```
#[derive(Clone, Debug)]
pub struct ScenarioBuilder {
    document: DocumentMut,
    wrong: Vec<(String, String)>,
}

impl ScenarioBuilder {
    /// With a name; run directories are called after it.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let out = Self { document: DocumentMut::new(), wrong: Vec::new() };
        out.set("schema", 1).set("name", name).set("description", name)
    }

    /// What happens, in a sentence or two.
    #[must_use]
    pub fn description(self, text: &str) -> Self {
        self.set("description", text)
    }

    /// Paths of the URDFs of both spacecraft.
    #[must_use]
    pub fn spacecraft(self, chaser: &str, target: &str) -> Self {
        self.set("chaser.model", chaser).set("target.model", target)
    }

    /// Paths of the URDFs of both sides of the docking mechanism.
    #[must_use]
    pub fn mechanism(self, active: &str, passive: &str) -> Self {
        self.set("mechanism.active", active).set("mechanism.passive", passive)
    }

    /// The outcome that physics gives, and why.
    #[must_use]
    pub fn expect(self, outcome: ExpectedOutcome, because: &str) -> Self {
        self.set("expect.outcome", outcome.word()).set("expect.because", because)
    }

    /// Any key of a scenario; `docktwin scenario explain` lists them.
    #[must_use]
    pub fn set(mut self, key: &str, value: impl Into<Value>) -> Self {
        let text = value.into().to_string();
        if let Err(what) = crate::overrides::set(&mut self.document, key, &text) {
            self.wrong.push((key.to_owned(), what));
        }
        self
    }

    /// One more timed control wrench, by the keys of `[[thrust]]`, such as
    /// `[("on", "chaser".into()), ("after", "first_contact".into()), ("force_x_n", 300.0.into()), …]`.
    #[must_use]
    pub fn thrust<const N: usize>(mut self, keys: [(&str, Value); N]) -> Self {
        let list = self.document.entry("thrust").or_insert(no_tables());
        if !push(list, keys) {
            self.wrong.push(("thrust".to_owned(), NO_LIST.to_owned()));
        }
        self
    }

    /// One more table of bounds of fidelity, by the keys of `[[expect.fidelity]]`, such as
    /// `[("of", "hardware".into()), ("window", "to_capture".into()), ("nrms_force_below", 0.05.into())]`.
    #[must_use]
    pub fn fidelity<const N: usize>(mut self, keys: [(&str, Value); N]) -> Self {
        let expect = self.document.entry("expect").or_insert(Item::Table(Table::new()));
        let list = expect.as_table_mut().map(|t| t.entry("fidelity").or_insert(no_tables()));
        if !list.is_some_and(|list| push(list, keys)) {
            self.wrong.push(("expect.fidelity".to_owned(), NO_LIST.to_owned()));
        }
        self
    }

    /// As a scenario file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        self.document.to_string()
    }

    /// Checks it as if it stood as a file in `folder`, from which the paths of models count.
    ///
    /// # Errors
    /// All problems of the scenario and of all its models.
    pub fn build(&self, folder: impl AsRef<Path>) -> Result<Scenario, ScenarioErrors> {
        self.build_with(&Loader::new(), folder)
    }

    /// The same with a loader, for models in memory.
    ///
    /// # Errors
    /// All problems of the scenario and of all its models.
    pub fn build_with(
        &self,
        loader: &Loader,
        folder: impl AsRef<Path>,
    ) -> Result<Scenario, ScenarioErrors> {
        // A key that could not be set at all is set again by the loader, which reports it.
        let again: Vec<(String, String)> =
            self.wrong.iter().map(|(key, _)| (key.clone(), String::new())).collect();
        loader.clone().set_texts("", &again).read(&self.to_toml(), folder.as_ref())
    }
}

const NO_LIST: &str = "is no list of tables";

fn no_tables() -> Item {
    Item::ArrayOfTables(ArrayOfTables::new())
}

/// One more table of these keys; false where it is no list of tables.
fn push<const N: usize>(list: &mut Item, keys: [(&str, Value); N]) -> bool {
    let Some(list) = list.as_array_of_tables_mut() else { return false };
    let mut table = Table::new();
    for (key, value) in keys {
        table.insert(key, Item::Value(value));
    }
    list.push(table);
    true
}
