use std::path::{Path, PathBuf};

use toml::de::DeTable;

use crate::Rig;
use crate::input;
use crate::keys::FileKind;
use crate::load_mechanism::{join, mated_fit, read_active, read_passive};
use crate::load_rig::read_rig;
use crate::load_spacecraft::read_spacecraft;
use crate::mechanism::DockingMechanism;
use crate::problem::{Findings, Note, Problem, ReadValue};
use crate::rig_check;
use crate::sag::{SAG_REMEDY, Sag, sag_refusal, static_sag};
use crate::toml_check::Checker;

/// The `kind` of a TOML file, if it can be read.
pub(crate) fn kind_of(toml: &Path) -> Option<FileKind> {
    let bytes = input::read_bytes(toml, input::MAX_TEXT_BYTES).ok()?;
    let text = input::text_of(bytes).ok()?;
    let (root, _) = DeTable::parse_recoverable(&text);
    let word = root.get_ref().get("kind")?.get_ref().as_str()?;
    FileKind::WORDS.iter().find(|(w, _)| *w == word).map(|(_, kind)| *kind)
}

/// Says why no kind is known: a file that cannot be read, is no TOML, or names none.
fn unknown_kind(path: &Path, out: &mut Findings) {
    let toml = path.with_extension("toml");
    // The file that was named comes first, whichever of the two it is.
    if path != toml && out.read(path, "model").is_none() {
        return;
    }
    let Some(text) = out.read(&toml, "TOML of the model") else {
        if let Some(p) = out.problems.last_mut() {
            p.remedy = format!(
                "a model is a URDF and a TOML of the same name beside it, with `kind = \"…\"`: {}",
                p.remedy
            );
        }
        return;
    };
    let checker = Checker::new(&toml, &text);
    let is_scenario = checker.read_some(|t| {
        let scenario = ["initial", "run", "expect"].iter().any(|k| t.has(k));
        if !scenario {
            t.choice("kind", &FileKind::WORDS);
        }
        scenario
    });
    out.problems.extend(checker.finish().0);
    if is_scenario == Some(true) {
        out.problems.push(Problem {
            file: toml.clone(),
            key: "kind".into(),
            what: "this is a scenario, not a model".into(),
            remedy: format!("use `docktwin scenario check {}`", toml.display()),
            ..Problem::default()
        });
    }
}

/// What a check of model files found, as lines of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The values behind `read`, without those derived from several.
    pub values: Vec<ReadValue>,
    /// The notes behind `ignored`.
    pub notes: Vec<Note>,
    /// The problems behind `refused`.
    pub problems: Vec<Problem>,
    /// Files read.
    pub files: Vec<PathBuf>,
    /// Every value that is used, with unit and note.
    pub read: Vec<String>,
    /// What is there but not used, and why.
    pub ignored: Vec<String>,
    /// What is used although it looks wrong, and why; the model can still be right.
    pub flagged: Vec<String>,
    /// What is wrong. Empty: the model is right.
    pub refused: Vec<String>,
    /// Both sides of a mechanism together, where nothing is wrong with them.
    pub mechanism: Option<Box<DockingMechanism>>,
}

impl Report {
    /// Everything, one line each, problems last.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.files.iter().map(|f| format!("file    {}", f.to_string_lossy())).collect();
        lines.extend(self.read.iter().map(|l| format!("read    {l}")));
        lines.extend(self.ignored.iter().map(|l| format!("ignored {l}")));
        lines.extend(self.flagged.iter().map(|l| format!("flagged {l}")));
        lines.extend(self.refused.iter().map(|l| format!("refused {l}")));
        let flagged = match self.flagged.len() {
            0 => String::new(),
            n => format!("{n} flagged, "),
        };
        lines.push(format!(
            "{} values read, {} ignored, {flagged}{} refused",
            self.read.len(),
            self.ignored.len(),
            self.refused.len()
        ));
        lines
    }
}

/// Checks any URDF or TOML of a model: reads it together with the file of the same name beside it,
/// and a mechanism's side also with the other side when `…_active` and `…_passive` stand side by
/// side.
#[must_use]
pub fn model_check(path: &Path) -> Report {
    model_check_with(path, None)
}

/// As [`model_check`]; a rig also with the mechanism, named by its active side, that is to stand on it: how
/// far it sags there, and whether it stays within its travel.
#[must_use]
pub fn model_check_with(path: &Path, mechanism: Option<&Path>) -> Report {
    let urdf = path.with_extension("urdf");
    let mut out = Findings::default();
    // Another file of the same name is not the one that was asked about.
    let named = path.extension().is_some_and(|e| e == "urdf" || e == "toml");
    let kind = named.then(|| kind_of(&path.with_extension("toml"))).flatten();
    if mechanism.is_some() && kind.is_some_and(|k| k != FileKind::Rig) {
        out.problems.push(Problem {
            file: path.into(),
            key: "kind".into(),
            what: "is no rig, and a mechanism stands on rigs only".into(),
            remedy: "name a rig, or leave --mechanism out".into(),
            ..Problem::default()
        });
    }
    match kind {
        Some(FileKind::Spacecraft) => {
            let read = read_spacecraft(&urdf, true, &mut out);
            let lines = read.filter(|_| out.problems.is_empty()).map(|r| r.lines);
            return report(out, lines.unwrap_or_default());
        }
        Some(FileKind::Rig) => {
            let rig = read_rig(&urdf, &mut out);
            // Values derived from wrong numbers are meaningless.
            let rig = rig.filter(|_| out.problems.is_empty());
            let mut lines = rig.as_ref().map(rig_check::summary).unwrap_or_default();
            if let Some((rig, named)) = rig.zip(mechanism) {
                lines.extend(sag_lines(&rig, &urdf, named, &mut out));
            }
            return report(out, lines);
        }
        Some(kind) => {
            let (ours, theirs) = match kind {
                FileKind::MechanismActive => ("_active", "_passive"),
                _ => ("_passive", "_active"),
            };
            let stem = urdf.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let other = stem
                .strip_suffix(ours)
                .map(|s| urdf.with_file_name(format!("{s}{theirs}.urdf")))
                .filter(|p| p.is_file());
            let (active, passive) = match kind {
                FileKind::MechanismActive => (Some(urdf), other),
                _ => (other, Some(urdf)),
            };
            let active = active.and_then(|p| read_active(&p, true, &mut out));
            let passive = passive.and_then(|p| read_passive(&p, true, &mut out));
            if let Some((a, p)) = active.zip(passive) {
                let fit = mated_fit(&a.geometry, &p.geometry);
                let joined = join(a, p, None, &mut out);
                let (mut lines, mut mechanism_checked) = (Vec::new(), None);
                // The clearances of wrong numbers mean nothing.
                if let Some(mechanism) = joined.filter(|_| out.problems.is_empty()) {
                    lines.push(format!("docked length = {:.6} m", mechanism.docked_length_m()));
                    // Without a petal, or a ring for it, there is no such clearance.
                    if fit.petal_to_ring_m.is_finite() {
                        lines.push(format!(
                            "mated clearance of petal to ring = {:.6} m",
                            fit.petal_to_ring_m
                        ));
                    }
                    lines.extend(mechanism.surface_lines());
                    mechanism_checked = Some(Box::new(mechanism));
                }
                return Report { mechanism: mechanism_checked, ..report(out, lines) };
            }
        }
        None => unknown_kind(path, &mut out),
    }
    report(out, Vec::new())
}

/// Sag of a mechanism, named by its active side, on a rig; refuses one that leaves its travel.
fn sag_lines(rig: &Rig, rig_urdf: &Path, named: &Path, out: &mut Findings) -> Vec<String> {
    let active_path = named.with_extension("urdf");
    let stem = active_path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let Some(base) = stem.strip_suffix("_active") else {
        out.problems.push(Problem {
            file: named.into(),
            key: "--mechanism".into(),
            what: "is not the active side of a mechanism".into(),
            remedy: "name `…_active.urdf`, with `…_passive.urdf` beside it".into(),
            ..Problem::default()
        });
        return Vec::new();
    };
    let passive_path = active_path.with_file_name(format!("{base}_passive.urdf"));
    let active = read_active(&active_path, true, out);
    let passive = read_passive(&passive_path, true, out);
    let joined = active.zip(passive).and_then(|(a, p)| join(a, p, None, out));
    let Some(mechanism) = joined.filter(|_| out.problems.is_empty()) else { return Vec::new() };
    if let Some(what) = sag_refusal(rig, &mechanism) {
        out.problems.push(Problem {
            file: rig_urdf.with_extension("toml"),
            key: "gravity.gravity_m_s2".into(),
            what,
            remedy: SAG_REMEDY.into(),
            ..Problem::default()
        });
    }
    let sags = static_sag(rig, &mechanism);
    sags.iter().filter(|s| s.load > 1e-6).map(Sag::line).collect()
}

fn report(out: Findings, derived: Vec<String>) -> Report {
    let problems = crate::problem::first_of(out.problems, 0);
    let mut read: Vec<String> = out.values.iter().map(ToString::to_string).collect();
    read.extend(derived);
    let mut files: Vec<PathBuf> = out.files.into_iter().map(|f| f.path).collect();
    files.dedup();
    Report {
        files,
        read,
        ignored: out.notes.iter().map(ToString::to_string).collect(),
        flagged: out.flags.iter().map(ToString::to_string).collect(),
        refused: problems.iter().map(ToString::to_string).collect(),
        values: out.values,
        notes: out.notes,
        problems,
        mechanism: None,
    }
}
