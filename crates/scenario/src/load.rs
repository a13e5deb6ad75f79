use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Euler};
use docktwin_model::input;
use docktwin_model::toml_check::{Checker, Table};
use docktwin_model::{
    AttenuationChoice, ContactLaw, DockingMechanism, FileDigest, HydraulicPreset, Loaded,
    ModelErrors, NormalLaw, Note, Problem, Sources, Spacecraft, load_mechanism_from,
    load_spacecraft_from,
};

use crate::expect::Expect;
use crate::keys::places;
use crate::load_expect::read_expect;
use crate::overrides::{self, Patch};
use crate::read::{count, flag, maybe, number, vector};
use crate::scenario::{
    Body, CompensatorChoice, HilSettings, InitialConditions, RunSettings, Scenario, ScenarioErrors,
    Thrust, Trigger, TurningBody,
};
use crate::stiff::{Moving, too_stiff};

/// Ticks of a run: some 200 GB of recording, a day in ticks of 1 ms.
const MOST_TICKS: f64 = 1e8;
/// Steps of a run: more than a week of computing.
const MOST_STEPS: f64 = 1e10;
/// Steps of a tick: the range of `run.steps_per_tick`.
const MOST_STEPS_PER_TICK: f64 = 1e4;
/// Longest free flight from the start to first contact, s; it is computed back in short steps.
const LONGEST_APPROACH_S: f64 = 1000.0;
/// Characters of a scenario's name.
const LONGEST_NAME: usize = 100;

/// Checks the text of a scenario, as `file` has it, with patches, and loads what it names.
pub(crate) fn checked(
    text: &str,
    file: FileDigest,
    patches: &[Patch],
    label: &str,
    sources: &Sources,
) -> Result<Scenario, ScenarioErrors> {
    let path = file.path.clone();
    let mut problems = Vec::new();
    let effective = apply(&path, text, patches, label, &mut problems);
    let checker = Checker::new(&path, &effective).with_places(places());
    let read = checker.read(read_scenario);
    problems.extend(checker.finish().0);

    let mut notes = Vec::new();
    let mut files = vec![file];
    let scenario = read.and_then(|said| {
        let mut load = Loading {
            path: &path,
            sources,
            problems: &mut problems,
            notes: &mut notes,
            files: &mut files,
        };
        let chaser = load.craft("chaser.model", &said.chaser, 1.0);
        let target = load.craft("target.model", &said.target, -1.0);
        let mechanism = load.mechanism(&said);
        if let (Some(chaser), Some(target), Some(mechanism)) = (&chaser, &target, &mechanism) {
            let initial = &said.initial;
            let pushed = !said.thrusts.is_empty();
            let moving = Moving { chaser, target, mechanism, initial, pushed };
            load.refuse_too_stiff(&moving, &said.run);
        }
        Some(Scenario {
            name: said.name,
            description: said.description,
            chaser: chaser?,
            target: target?,
            mechanism: mechanism?,
            initial: said.initial,
            run: said.run,
            thrusts: said.thrusts,
            hil: said.hil,
            expect: said.expect,
            notes: Vec::new(),
            files: Vec::new(),
            sources: sources.clone(),
            effective_toml: String::new(),
        })
    });
    relate_to_original(&path, text, patches, label, &mut problems);
    match scenario {
        Some(scenario) if problems.is_empty() => {
            Ok(Scenario { notes, files, effective_toml: effective, ..scenario })
        }
        _ => Err(ScenarioErrors { problems }),
    }
}

/// The text with the overrides applied; the text itself when it is not TOML, which the checker then
/// reports.
fn apply(
    path: &Path,
    text: &str,
    patches: &[Patch],
    label: &str,
    problems: &mut Vec<Problem>,
) -> String {
    if patches.is_empty() {
        return text.to_owned();
    }
    let Ok(mut document) = text.parse::<toml_edit::DocumentMut>() else { return text.to_owned() };
    for Patch { key, value } in patches {
        if let Err(what) = overrides::set(&mut document, key, value) {
            problems.push(Problem {
                file: path.into(),
                key: format!("{label}{}", input::shown(key)),
                value: input::shown(value),
                what,
                remedy:
                    "give an existing key as --set key.path=value; `scenario explain` lists all"
                        .into(),
                ..Problem::default()
            });
        }
    }
    document.to_string()
}

/// Gives problems of the scenario their line in the file as it is on disk: the checker counted lines
/// of the text with overrides. What an override said is named as such.
fn relate_to_original(
    path: &Path,
    text: &str,
    patches: &[Patch],
    label: &str,
    problems: &mut [Problem],
) {
    let lines = overrides::lines(text);
    let ours = |p: &&mut Problem| {
        p.file == path && !["syntax", "more"].contains(&p.key.as_str()) && !p.key.contains(' ')
    };
    for p in problems.iter_mut().filter(ours) {
        if patches.iter().any(|patch| patch.key == p.key) {
            p.key = format!("{label}{}", p.key);
            p.line = None;
            continue;
        }
        let mut at = p.key.as_str();
        p.line = loop {
            if let Some(line) = lines.get(at) {
                break Some(*line);
            }
            match at.rsplit_once('.') {
                Some((parent, _)) => at = parent,
                None => break Some(1),
            }
        };
    }
}

/// What the file itself says.
pub(crate) struct Said {
    name: String,
    description: String,
    chaser: String,
    target: String,
    active: String,
    passive: String,
    attenuation: Option<AttenuationChoice>,
    petals: bool,
    contact: Option<ContactOverrides>,
    initial: InitialConditions,
    run: RunSettings,
    thrusts: Vec<Thrust>,
    hil: HilSettings,
    expect: Expect,
}

/// Parts of the contact law that a scenario changes.
#[derive(Clone, Copy, Default)]
struct ContactOverrides {
    hunt_crossley: Option<bool>,
    stiffness: Option<f64>,
    exponent: Option<f64>,
    damping_s_m: Option<f64>,
    damping_n_s_m: Option<f64>,
    friction_kinetic: Option<f64>,
    friction_static: Option<f64>,
    stribeck_velocity_m_s: Option<f64>,
    bristle_breakaway_m: Option<f64>,
    bristle_damping_s: Option<f64>,
    merge_depth_m: Option<f64>,
}

/// A name that is a file name everywhere: run directories are called after it.
fn read_name(t: &Table<'_, '_>) -> String {
    let name = t.text("name", "text");
    let first = name.chars().next().is_none_or(char::is_alphanumeric);
    let others = name.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | '.'));
    if !(first && others && name.chars().count() <= LONGEST_NAME) {
        t.refuse(
            "name",
            format!(
                "is no name for a run directory: letters, digits, `_`, `-` and `.`, beginning with \
                 a letter or digit, at most {LONGEST_NAME}"
            ),
            "change the name",
        );
    }
    name
}

pub(crate) fn read_scenario(t: &Table<'_, '_>) -> Said {
    if count(t, "schema").is_none() {
        t.refuse("schema", "is missing", "add `schema = 1`");
    }
    let model = |key| t.section(key, |c| c.text("model", "path of a URDF"));
    let (chaser, target) = (model("chaser"), model("target"));
    let (active, passive, attenuation, petals, contact) = t.section("mechanism", |m| {
        (
            m.text("active", "path of a URDF"),
            m.text("passive", "path of a URDF"),
            m.optional_choice("attenuation", &AttenuationChoice::WORDS),
            flag(m, "petals"),
            m.optional_section("contact", read_contact),
        )
    });
    Said {
        name: read_name(t),
        description: t.text("description", "text"),
        chaser,
        target,
        active,
        passive,
        attenuation,
        petals,
        contact,
        initial: t.section("initial", read_initial),
        run: t.section("run", read_run),
        thrusts: t.sections("thrust", read_thrust),
        hil: t.optional_section("loop", read_loop).unwrap_or_default(),
        expect: t.section("expect", read_expect),
    }
}

fn read_contact(t: &Table<'_, '_>) -> ContactOverrides {
    ContactOverrides {
        hunt_crossley: t
            .optional_choice("normal_law", &[("hunt_crossley", true), ("kelvin_voigt", false)]),
        stiffness: maybe(t, "stiffness_n_m"),
        exponent: maybe(t, "exponent"),
        damping_s_m: maybe(t, "damping_s_m"),
        damping_n_s_m: maybe(t, "damping_n_s_m"),
        friction_kinetic: maybe(t, "friction_kinetic"),
        friction_static: maybe(t, "friction_static"),
        stribeck_velocity_m_s: maybe(t, "stribeck_velocity_m_s"),
        bristle_breakaway_m: maybe(t, "bristle_breakaway_m"),
        bristle_damping_s: maybe(t, "bristle_damping_s"),
        merge_depth_m: maybe(t, "merge_depth_m"),
    }
}

fn read_initial(t: &Table<'_, '_>) -> InitialConditions {
    let rates = ["roll_rate_deg_s", "pitch_rate_deg_s", "yaw_rate_deg_s"];
    let (axial_speed_m_s, gap_m) = (number(t, "axial_speed_m_s"), number(t, "gap_m"));
    let approach_s = gap_m / axial_speed_m_s;
    if approach_s > LONGEST_APPROACH_S {
        let what = format!(
            "needs {approach_s:.1e} s over the gap of {gap_m} m to first contact, at most \
             {LONGEST_APPROACH_S} s are allowed"
        );
        t.refuse("axial_speed_m_s", what, "make it larger, or initial.gap_m smaller");
    }
    InitialConditions {
        axial_speed_m_s,
        lateral_m: [number(t, "lateral_y_m"), number(t, "lateral_z_m")],
        lateral_speed_m_s: [number(t, "lateral_speed_y_m_s"), number(t, "lateral_speed_z_m_s")],
        attitude: Euler::from_degrees(
            number(t, "roll_deg"),
            number(t, "pitch_deg"),
            number(t, "yaw_deg"),
        ),
        rates_rad_s: vector(t, rates) * (core::f64::consts::PI / 180.0),
        turning: t.optional_choice("turning", &TurningBody::WORDS).unwrap_or_default(),
        gap_m,
    }
}

fn read_run(t: &Table<'_, '_>) -> RunSettings {
    let duration_s = number(t, "duration_s");
    let tick_s = number(t, "tick_s");
    let nanos = (tick_s * 1e9).round();
    if (tick_s * 1e9 - nanos).abs() > 1e-3 {
        t.refuse("tick_s", "is not a whole number of nanoseconds", "round it");
    }
    if tick_s > duration_s {
        t.refuse("tick_s", "is longer than the run", "make it shorter than duration_s");
    }
    if duration_s / tick_s > MOST_TICKS {
        let what = format!(
            "gives {:.1e} ticks of {tick_s} s, at most {MOST_TICKS:e} can be recorded",
            duration_s / tick_s
        );
        t.refuse("duration_s", what, "shorten the run, or make run.tick_s longer");
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0.00001 s to 0.1 s, or NaN, which was reported and becomes 0"
    )]
    let tick_nanos = nanos as u64;
    let steps_per_tick = count(t, "steps_per_tick");
    let steps = steps_per_tick.map_or(0.0, f64::from) * duration_s / tick_s;
    if steps > MOST_STEPS && duration_s / tick_s <= MOST_TICKS {
        let what = format!("makes {steps:.1e} steps of the run, at most {MOST_STEPS:e} are taken");
        t.refuse("steps_per_tick", what, "make it smaller, or shorten the run");
    }
    RunSettings {
        duration_s,
        tick_nanos,
        steps_per_tick,
        stop_when_decided: flag(t, "stop_when_decided"),
    }
}

fn read_loop(t: &Table<'_, '_>) -> HilSettings {
    let settings = HilSettings {
        rig: t.optional_text("rig", "path of a URDF"),
        preset: t.optional_choice("preset", &HydraulicPreset::WORDS),
        compensator: t.optional_choice("compensator", &CompensatorChoice::WORDS),
        lead_s: maybe(t, "lead_s"),
        added_delay_s: number(t, "added_delay_s"),
        two_sensors: t.optional_choice("sensors", &[("single", false), ("two", true)])
            == Some(true),
        force_limit_n: maybe(t, "force_limit_n"),
        moment_limit_nm: maybe(t, "moment_limit_nm"),
        energy_limit: maybe(t, "energy_limit"),
    };
    if settings.compensator == Some(CompensatorChoice::None) && settings.lead_s.is_some() {
        t.refuse(
            "lead_s",
            "is a lead, but nothing leads",
            "remove it, or take a method that leads",
        );
    }
    settings
}

fn read_thrust(t: &Table<'_, '_>) -> Thrust {
    let on = t.choice("on", &[("chaser", Body::Chaser), ("target", Body::Target)]);
    let events = [
        ("start", Trigger::Start),
        ("first_contact", Trigger::FirstContact),
        ("capture", Trigger::Capture),
    ];
    let after = t.choice("after", &events);
    let thrust = Thrust {
        // Placeholders behind a problem that was reported.
        on: on.unwrap_or(Body::Chaser),
        after: after.unwrap_or(Trigger::Start),
        delay_s: number(t, "delay_s"),
        duration_s: number(t, "duration_s"),
        force_n: vector(t, ["force_x_n", "force_y_n", "force_z_n"]),
        moment_nm: vector(t, ["moment_x_nm", "moment_y_nm", "moment_z_nm"]),
        until_capture: flag(t, "until_capture"),
    };
    if thrust.force_n == DVec3::ZERO && thrust.moment_nm == DVec3::ZERO {
        t.refuse(
            "force_x_n",
            "neither force nor moment is given",
            "give one, or remove the thrust",
        );
    }
    if thrust.until_capture && after == Some(Trigger::Capture) {
        let what = "ends the thrust at capture, but it begins after capture";
        t.refuse("until_capture", what, "remove it");
    }
    thrust
}

// Models ---------------------------------------------------------------------------------------

struct Loading<'a> {
    path: &'a Path,
    sources: &'a Sources,
    problems: &'a mut Vec<Problem>,
    notes: &'a mut Vec<Note>,
    files: &'a mut Vec<FileDigest>,
}

impl Loading<'_> {
    fn refuse(&mut self, key: &str, value: String, what: &str, remedy: &str) {
        self.problems.push(Problem {
            file: self.path.into(),
            key: key.into(),
            value,
            what: what.into(),
            remedy: remedy.into(),
            ..Problem::default()
        });
    }

    /// What the steps of a rehearsal cannot follow. Of files that are wrong otherwise nothing is said.
    fn refuse_too_stiff(&mut self, moving: &Moving<'_>, run: &RunSettings) {
        if !self.problems.is_empty() {
            return;
        }
        for s in too_stiff(moving, run.longest_step_s()) {
            let steps = (run.tick_s() / s.step_s).ceil();
            let (it, most) = (s.subject(), 0.99 * s.most);
            let place = s.place.words();
            let remedy = if steps <= MOST_STEPS_PER_TICK {
                format!("make {it} {most:.2e} at most{place}, or take run.steps_per_tick = {steps}")
            } else {
                format!("make {it} {most:.2e} at most{place}")
            };
            self.refuse(&s.key, format!("{:e}", s.value), &s.what(), &remedy);
        }
    }

    /// A path named by the scenario, looked for from its folder upward. Nothing when the name is
    /// missing, which was reported, or when there is no such file.
    fn find(&mut self, key: &str, named: &str) -> Option<PathBuf> {
        if named.is_empty() {
            return None;
        }
        let found = resolve_path_from(self.sources, self.path, Path::new(named));
        if found.is_none() {
            self.refuse(
                key,
                format!("\"{named}\""),
                "is found neither beside the scenario nor in any folder above it",
                "mend the path; it counts from the folder of the scenario or one above it",
            );
        }
        found
    }

    fn take<T>(&mut self, loaded: Result<Loaded<T>, ModelErrors>) -> Option<T> {
        match loaded {
            Ok(loaded) => {
                self.notes.extend(loaded.notes);
                self.files.extend(loaded.files);
                Some(loaded.model)
            }
            Err(errors) => {
                self.problems.extend(errors.problems);
                None
            }
        }
    }

    /// A spacecraft whose port looks along `side` · X of the docking axis.
    fn craft(&mut self, key: &str, named: &str, side: f64) -> Option<Spacecraft> {
        let urdf = self.find(key, named)?;
        let craft = self.take(load_spacecraft_from(self.sources, &urdf))?;
        let port = craft.x_body_port;
        if (port.q * DVec3::X).dot(port.p) * side < 0.0 {
            let what = "has its port on the wrong side: docked, the spacecraft would overlap (+X of \
                        both ports points from chaser to target)";
            self.refuse(
                key,
                format!("\"{named}\""),
                what,
                "name a model whose port faces the other",
            );
        }
        Some(craft)
    }

    fn mechanism(&mut self, said: &Said) -> Option<DockingMechanism> {
        let active = self.find("mechanism.active", &said.active);
        let passive = self.find("mechanism.passive", &said.passive);
        let mut mechanism =
            self.take(load_mechanism_from(self.sources, &active?, &passive?, said.attenuation))?;
        if !said.petals {
            mechanism.active.petals = None;
            mechanism.passive.petals = None;
        }
        if let Some(changes) = &said.contact {
            mechanism.contact = self.changed_contact(mechanism.contact, changes);
        }
        Some(mechanism)
    }

    fn changed_contact(&mut self, law: ContactLaw, o: &ContactOverrides) -> ContactLaw {
        let was = match law.normal {
            NormalLaw::HuntCrossley { stiffness, exponent, damping_s_m } => {
                (true, stiffness, Some((exponent, damping_s_m)), None)
            }
            NormalLaw::KelvinVoigt { stiffness, damping_n_s_m } => {
                (false, stiffness, None, Some(damping_n_s_m))
            }
        };
        let stiffness = o.stiffness.unwrap_or(was.1);
        let hunt_crossley = o.hunt_crossley.unwrap_or(was.0);
        let mut needed = |key: &str, value: Option<f64>| {
            value.unwrap_or_else(|| {
                let key = format!("mechanism.contact.{key}");
                let what = "is needed by this normal law and not given by the mechanism";
                self.refuse(&key, String::new(), what, "add it");
                f64::NAN
            })
        };
        let normal = if hunt_crossley {
            NormalLaw::HuntCrossley {
                stiffness,
                exponent: needed("exponent", o.exponent.or(was.2.map(|x| x.0))),
                damping_s_m: needed("damping_s_m", o.damping_s_m.or(was.2.map(|x| x.1))),
            }
        } else {
            let c = needed("damping_n_s_m", o.damping_n_s_m.or(was.3));
            NormalLaw::KelvinVoigt { stiffness, damping_n_s_m: c }
        };
        let foreign = if hunt_crossley {
            [("damping_n_s_m", o.damping_n_s_m), ("", None)]
        } else {
            [("exponent", o.exponent), ("damping_s_m", o.damping_s_m)]
        };
        for (key, value) in foreign {
            if let Some(x) = value {
                let key = format!("mechanism.contact.{key}");
                let what = "belongs to the other normal law";
                self.refuse(&key, x.to_string(), what, "remove it, or set normal_law");
            }
        }
        let changed = ContactLaw {
            normal,
            friction_kinetic: o.friction_kinetic.unwrap_or(law.friction_kinetic),
            friction_static: o.friction_static.unwrap_or(law.friction_static),
            stribeck_velocity_m_s: o.stribeck_velocity_m_s.unwrap_or(law.stribeck_velocity_m_s),
            bristle_breakaway_m: o.bristle_breakaway_m.unwrap_or(law.bristle_breakaway_m),
            bristle_damping_s: o.bristle_damping_s.unwrap_or(law.bristle_damping_s),
            merge_depth_m: o.merge_depth_m.unwrap_or(law.merge_depth_m),
        };
        if changed.friction_static < changed.friction_kinetic {
            self.refuse(
                "mechanism.contact.friction_static",
                changed.friction_static.to_string(),
                "is below the kinetic coefficient",
                "set friction_static too, at least as large as friction_kinetic",
            );
        }
        changed
    }
}

/// A path named in a scenario: as it stands if absolute, else from the folder of the scenario, then
/// from each folder above it. Given relative to the working folder where it lies below that.
#[must_use]
pub fn resolve_path(scenario: &Path, named: &Path) -> Option<PathBuf> {
    resolve_path_from(&Sources::disk(), scenario, named)
}

/// As [`resolve_path`], among files in memory too.
#[must_use]
pub fn resolve_path_from(sources: &Sources, scenario: &Path, named: &Path) -> Option<PathBuf> {
    if named.is_absolute() {
        return sources.is_file(named).then(|| named.to_owned());
    }
    let absolute = std::path::absolute(scenario).ok()?;
    let found = absolute.ancestors().skip(1).map(|d| d.join(named)).find(|p| sources.is_file(p))?;
    let here = std::env::current_dir().unwrap_or_default();
    Some(found.strip_prefix(&here).map(Path::to_owned).unwrap_or(found))
}
