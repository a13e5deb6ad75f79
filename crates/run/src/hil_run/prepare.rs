//! Everything that is known before a rig moves.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use docktwin_control::{
    planner::RunUp,
    rig::RigSetup,
    safety::{SafetyLimits, half_widths},
    sensing::SensorScheme,
};
use docktwin_core::{DVec3, Digest, PORT_CONTACT_N, Pose};
use docktwin_hil::{
    calibrate::Calibration,
    emulated::{EmulatedRig, clear},
    identify::Identification,
    scheduler::{Approach, Check, LoopSetup, RigParameters, TickRecord},
};
use docktwin_model::{HydraulicPreset, Rig as RigModel, SAG_REMEDY, load_rig_from, sag_refusal};
use docktwin_physics::{
    as_built::Drawn,
    body::BodyState,
    mechanism::{CHASER, System, TARGET},
    programme::Programme,
};
use docktwin_record::Summary;
use docktwin_rigport::{in_process::InProcess, message::LATCHES};
use docktwin_scenario::{CompensatorChoice, Scenario, resolve_path_from};

use super::{Commands, PERIOD_NS, check, seconds};
use crate::{
    article::{RigArticle, RigMechanism, bodies_with},
    control::{Control, Situation, TimedThrusts},
    error::RunError,
    provenance::{KeptFile, digest_keys},
    rehearsal::Rehearsal,
    rig_place::{
        ClockKind, Operator, RigPlace, calibration, compensation, confirm, identification,
        new_session,
    },
    rigfile::{CalibrationFile, IdentificationFile, Origin, Read},
    setup::start,
    sink::SummaryOnly,
};

/// Rig when neither scenario nor options name one.
const DEFAULT_RIG: &str = "models/urdf/stewart.urdf";
/// Folder of a run directory that holds its rig.
const RIG_FOLDER: &str = "models/rig";
/// Folder of a run directory that holds another mechanism of the rig.
const MECHANISM_FOLDER: &str = "models/rig-mechanism";
/// Largest file of a rig that is kept, bytes.
const MOST_RIG_BYTES: u64 = 1 << 20;
/// Age at which an identification or a calibration is no longer believed, days.
const MOST_DAYS: f64 = 30.0;
/// Fastest of the first move, m/s and rad/s.
const MOVE_M_S: f64 = 0.1;
const MOVE_RAD_S: f64 = 0.05;
/// Rest before the run-up, s.
const SETTLE_S: f64 = 0.6;
/// Longest way of the run-up along the docking axis, m, and the times it may take, s.
const RUN_UP_M: f64 = 0.1;
const RUN_UP_S: [f64; 2] = [0.05, 4.0];
/// By how much nearer along the docking axis it is to be clear too, m: a ring that sags is not where it is believed.
const RUN_UP_CLEARANCE_M: f64 = 0.001;

/// How a loop with a rig is run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HilOptions {
    /// Where the rig is.
    pub place: RigPlace,
    /// What drives the ticks.
    pub clock: ClockKind,
    /// Against the delay of the rig; else as the scenario says, or lead.
    pub compensator: Option<CompensatorChoice>,
    /// Lead, s; else as the scenario says, or the delay that is believed.
    pub lead_s: Option<f64>,
    /// TOML or URDF of the rig; else as the scenario says, or the default rig.
    pub model: Option<PathBuf>,
    /// File of `rig identify`.
    pub identification: Option<PathBuf>,
    /// File of `rig calibrate`.
    pub calibration: Option<PathBuf>,
    /// Seed of an emulated rig's noise.
    pub seed: u64,
    /// Draws an emulated rig within the spread of its file.
    pub perturb: Option<u64>,
    /// The mechanism that the rig has, and that it is compared with; else that of the scenario.
    pub mechanism: RigMechanism,
    /// Slowly to the initial condition and back, without closing the loop.
    pub dry_run: bool,
}

impl HilOptions {
    /// Whether such a run repeats bit by bit: not in real time, nor against a rig in another process.
    #[must_use]
    pub fn repeats(&self) -> bool {
        self.clock == ClockKind::Virtual && self.place == RigPlace::Emulated
    }
}

/// A loop with a rig, prepared: everything is known, and nothing has moved.
///
/// ```
/// use docktwin_run::{HilOptions, HilRun, SummaryOnly};
/// use docktwin_scenario::Loader;
/// # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// # let path = root.join("scenarios/apas_nominal.toml");
/// let scenario = Loader::new().set("run.duration_s", 1.2).load(&path)?;
/// let run = HilRun::new(&scenario, HilOptions::default())?;
/// let rig = run.emulated()?;
/// let summary = run.run(rig, &mut SummaryOnly)?;
/// println!("{}", summary.outcome);
/// # Ok::<(), docktwin_run::RunError>(())
/// ```
pub struct HilRun<'a> {
    pub(crate) scenario: &'a Scenario,
    pub(crate) options: HilOptions,
    pub(crate) rig_path: PathBuf,
    pub(crate) rig: RigModel,
    pub(crate) preset: HydraulicPreset,
    pub(crate) system: System,
    pub(crate) bodies: [BodyState; 3],
    pub(crate) setup: LoopSetup,
    /// The mechanism that the rig has.
    pub(crate) article: RigArticle,
    known: Known,
}

/// What was found out about this rig beforehand.
struct Known {
    identification: Option<(Read<IdentificationFile>, Identification)>,
    calibration: Option<(Read<CalibrationFile>, Calibration)>,
}

impl Known {
    fn read(options: &HilOptions, rig: &RigModel) -> Result<Self, RunError> {
        let [i, c] = [&options.identification, &options.calibration].map(Option::as_deref);
        Ok(Self {
            identification: i.map(|path| identification(path, rig)).transpose()?,
            calibration: c.map(|path| calibration(path, rig)).transpose()?,
        })
    }

    /// What is believed of the rig by its file and by these.
    fn parameters(&self, rig: &RigModel) -> RigParameters {
        let identification = self.identification.as_ref().map(|i| &i.1);
        RigParameters::new(rig, identification, self.calibration.as_ref().map(|c| &c.1))
    }

    /// Either file by what it holds, if it was given.
    fn files(&self) -> [(&'static str, Option<KnownFile<'_>>); 2] {
        let of = |origin: &Origin, digest: &Digest| (origin.age_days(), digest.to_string());
        let i = self.identification.as_ref().map(|(file, _)| {
            let (days, digest) = of(&file.content.origin, &file.digest);
            KnownFile { days, digest, path: &file.path }
        });
        let c = self.calibration.as_ref().map(|(file, _)| {
            let (days, digest) = of(&file.content.origin, &file.digest);
            KnownFile { days, digest, path: &file.path }
        });
        [("identification", i), ("calibration", c)]
    }
}

/// A file of `rig identify` or `rig calibrate`.
struct KnownFile<'a> {
    /// Age.
    days: f64,
    digest: String,
    path: &'a Path,
}

impl<'a> HilRun<'a> {
    /// Reads the rig and what is known of it, and checks that it can show the approach.
    ///
    /// # Errors
    /// Problems of the rig's files, a start at which the sides overlap, or beyond the rig's reach.
    pub fn new(scenario: &'a Scenario, options: HilOptions) -> Result<Self, RunError> {
        Self::with_rig(scenario, options, |_| {})
    }

    /// As [`Self::new`], the rig of the file changed before anything is made of it: what is emulated and what
    /// the loop believes is the changed one. A record of such a run holds the files as they are and is
    /// replayed by them, so it is for studies that keep a summary alone.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_rig(
        scenario: &'a Scenario,
        options: HilOptions,
        change: impl FnOnce(&mut RigModel),
    ) -> Result<Self, RunError> {
        let rig_path = rig_path(options.model.as_deref(), scenario)?;
        let mut rig = load_rig_from(&scenario.sources, &rig_path)?.model;
        change(&mut rig);
        if rig.sensors.is_none() {
            return Err(RunError::usage(
                format!("the rig has no table [sensors]: {}", rig_path.display()),
                "add one; models/urdf/stewart.toml is an example",
            ));
        }
        let hil = &scenario.hil;
        let preset = preset(&rig, hil.preset, "loop.preset of the scenario")?;
        if hil.two_sensors && !rig.sensors.is_some_and(|s| s.plate_force) {
            return Err(RunError::usage(
                format!(
                    "the rig has no sensor B, and loop.sensors is \"two\": {}",
                    rig_path.display()
                ),
                "make loop.sensors \"single\": F4 and M4 then come from sensor A",
            ));
        }
        let (system, bodies) = start(scenario)?;
        let latches = scenario.mechanism.latch_count();
        if latches > LATCHES {
            return Err(RunError::usage(
                format!("the mechanism has {latches} latches, and a rig reports at most {LATCHES}"),
                "take a mechanism with fewer latches for a rig",
            ));
        }
        let article = options.mechanism.article(scenario, &system)?;
        refuse_sag(&rig, &article.article.system, &rig_path)?;
        let tick_s = period_s(scenario)?;
        let programme = Programme::new(&system, &bodies, tick_s);
        let believed = RigSetup::of_rig(&rig, preset, None);
        let run_up_s = run_up_s(&system, &programme);
        for (what, time_s) in [("initial condition", 0.0), ("run-up", -0.5 * run_up_s)] {
            within_reach(&rig, &believed, &programme.free(time_s).x_34, what)?;
        }
        let known = Known::read(&options, &rig)?;
        let choice = options.compensator.or(hil.compensator).unwrap_or(CompensatorChoice::Lead);
        let parameters = known.parameters(&rig);
        let lead_s = options.lead_s.or(hil.lead_s).unwrap_or(parameters.lead_s);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 30")]
        let added_ticks = (hil.added_delay_s / tick_s).round() as usize;
        let setup = LoopSetup::builder(&rig, preset, &system, &bodies)
            .parameters(parameters)
            .compensation(compensation(choice, lead_s)?)
            .added_ticks(added_ticks)
            .sensors(if hil.two_sensors { SensorScheme::Two } else { SensorScheme::Single })
            .loads(hil.force_limit_n, hil.moment_limit_nm)
            .energy_limit(hil.energy_limit)
            .approach(Approach {
                speed_m_s: MOVE_M_S,
                rate_rad_s: MOVE_RAD_S,
                settle_s: SETTLE_S,
                run_up_s,
            })
            .ticks(scenario.run.ticks())
            .session(if options.repeats() { 1 } else { new_session() })
            .dry_run(options.dry_run)
            .build()?;
        Ok(Self { scenario, options, rig_path, rig, preset, system, bodies, setup, article, known })
    }

    /// The same with both halves of the mechanism standing where the rig's file says, whatever was drawn.
    #[must_use]
    pub fn mounted_as_filed(mut self) -> Self {
        self.article.article.mounts = None;
        self
    }

    /// The rig emulated in this process, drawn back.
    ///
    /// # Errors
    /// The rig's file lacks what an emulation needs.
    pub fn emulated(&self) -> Result<InProcess<EmulatedRig>, RunError> {
        self.emulated_with(|rig| rig)
    }

    /// The same, changed before it runs.
    ///
    /// # Errors
    /// As [`Self::emulated`].
    pub fn emulated_with(
        &self,
        change: impl FnOnce(EmulatedRig) -> EmulatedRig,
    ) -> Result<InProcess<EmulatedRig>, RunError> {
        let rest = clear(&self.rig, &self.system);
        EmulatedRig::new(
            &self.rig,
            self.preset,
            self.options.perturb,
            self.options.seed,
            self.article.article.clone(),
            &rest,
        )
        .map(|rig| InProcess::new(change(rig)))
        .map_err(|e| RunError::usage(e.to_string(), format!("mend {}", self.rig_path.display())))
    }

    /// The rig as its file says.
    #[must_use]
    pub const fn rig(&self) -> &RigModel {
        &self.rig
    }

    /// What was drawn of the mechanism that the rig has.
    #[must_use]
    pub fn drawn(&self) -> &[Drawn] {
        &self.article.drawn
    }

    /// The simulated system: the scenario's spacecraft with the mechanism that the rig has, and its bodies at
    /// the beginning.
    #[must_use]
    pub fn reference(&self) -> (System, [BodyState; 3]) {
        let system = self.article.article.system.clone();
        if self.options.mechanism == RigMechanism::default() {
            return (system, self.bodies);
        }
        let bodies = bodies_with(&self.system, &system, &self.bodies);
        (system, bodies)
    }

    /// Rehearses the simulated system by the reduced twin, the target begun `shift_m` off its place, in `e3`.
    ///
    /// # Errors
    /// None at present.
    pub fn simulate(&self, shift_m: DVec3) -> Result<Summary, RunError> {
        let (system, mut bodies) = self.reference();
        let x_w3 = bodies[CHASER].pose() * system.ports()[0];
        bodies[TARGET].p += x_w3.q * shift_m;
        Rehearsal::beginning(self.scenario, system, bodies).run(&mut SummaryOnly)
    }

    /// What the bodies know before the first tick, and what moves them.
    pub(super) fn commands<C: Control>(&self, control: C) -> Commands<(TimedThrusts, C)> {
        Commands {
            control: (TimedThrusts::of(self.scenario), control),
            now: Situation {
                time_s: 0.0,
                bodies: [self.bodies[0], self.bodies[2]],
                x_34: self.setup.bodies.x_34(),
                relative: self.setup.bodies.free(0.0).twist,
                port4: docktwin_core::Wrench::ZERO,
                first_contact_s: None,
                captured_s: None,
            },
        }
    }

    /// Points of the checklist that the loop itself cannot look at.
    pub(crate) fn checks(&self, operator: &mut impl Operator) -> Result<Vec<Check>, RunError> {
        let limits = &self.setup.limits;
        let mut out = vec![check(
            "limits",
            true,
            format!(
                "loaded from {}: {:.0} N, {:.0} N·m at the ports",
                self.rig_path.display(),
                limits.port_force_n,
                limits.port_moment_nm
            ),
        )];
        for (name, known) in self.known.files() {
            out.push(match known {
                None => check(name, true, "none: the rig's file is believed"),
                Some(KnownFile { days, digest, .. }) if days < MOST_DAYS => {
                    check(name, true, format!("{days:.1} days old, {}", &digest[..12]))
                }
                Some(KnownFile { days, .. }) => check(
                    name,
                    false,
                    format!("{days:.0} days old: make it again, at most {MOST_DAYS:.0} days count"),
                ),
            });
        }
        confirm(operator, &self.options.place)?;
        out.push(check(
            "operator",
            true,
            if self.options.place == RigPlace::Emulated {
                "not asked: nothing but an emulation moves"
            } else {
                "confirmed: emergency stop tested, nobody near the rig"
            },
        ));
        Ok(out)
    }

    /// What the recording says of itself.
    pub(super) fn metadata(&self) -> BTreeMap<String, String> {
        let (o, compensation) = (&self.options, &self.setup.compensation);
        let mut m: BTreeMap<String, String> = [
            ("tool", "docktwin".to_owned()),
            ("tool_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("command", "hil".to_owned()),
            ("scenario", self.scenario.name.clone()),
            ("seed", o.seed.to_string()),
            ("rig", o.place.to_string()),
            ("clock", o.clock.name().to_owned()),
            ("compensator", compensation.name().to_owned()),
            ("lead_s", compensation.lead_s().to_string()),
            ("preset", self.rig.oil_word(self.preset).to_owned()),
            ("perturb", o.perturb.map_or("none".to_owned(), |s| s.to_string())),
            ("tick_nanos", self.scenario.run.tick_nanos.to_string()),
            ("digest:rig", self.rig.digest.to_string()),
            ("started_unix_ns", jiff::Timestamp::now().as_nanosecond().to_string()),
        ]
        .into_iter()
        .map(|(k, v)| (k.to_owned(), v))
        .collect();
        for (name, known) in self.known.files() {
            if let Some(file) = known {
                m.insert(format!("digest:{name}"), file.digest);
            }
        }
        if let Some(digest) = self.article.digest {
            m.insert(MECHANISM_DIGEST.to_owned(), digest.to_string());
        }
        if let Some(draw) = o.mechanism.draw {
            m.insert("mechanism_draw".to_owned(), draw.number.to_string());
            m.insert("mechanism_grade".to_owned(), draw.grade.name().to_owned());
        }
        let drawn = self.article.drawn.iter();
        m.extend(drawn.map(|d| (format!("drawn:{}", d.name), d.value.to_string())));
        m.extend(digest_keys(&self.scenario.files).map(|(key, f)| (key, f.digest.to_string())));
        m
    }

    /// The rig's files and what is known of it, for the run directory, and the name of the URDF there.
    pub(super) fn kept(&self) -> Result<(PathBuf, Vec<KeptFile>), RunError> {
        let mut out = Vec::new();
        let mut keep = |what: &str, name: PathBuf, from: &Path| {
            let bytes = self.scenario.sources.read(from, MOST_RIG_BYTES).map_err(|why| {
                RunError::usage(
                    format!(
                        "the {what} cannot be kept with the run: {}: {}",
                        why.what,
                        from.display()
                    ),
                    "run it again when nothing else writes the file",
                )
            })?;
            out.push((name, bytes));
            Ok::<(), RunError>(())
        };
        let stem = self.rig_path.file_stem().unwrap_or_default();
        let mut name = Path::new(RIG_FOLDER).join(stem);
        for kind in ["toml", "urdf"] {
            name.set_extension(kind);
            keep("rig", name.clone(), &self.rig_path.with_extension(kind))?;
        }
        if let Some(urdf) = self.options.mechanism.urdf() {
            for kind in ["toml", "urdf"] {
                let to = kept_mechanism().with_extension(kind);
                keep("rig's mechanism", to, &urdf.with_extension(kind))?;
            }
        }
        for (what, known) in self.known.files() {
            if let Some(file) = known {
                keep(what, kept_name(what), file.path)?;
            }
        }
        Ok((name, out))
    }
}

/// Where a run directory keeps the file of `rig identify` or `rig calibrate`.
pub(crate) fn kept_name(what: &str) -> PathBuf {
    Path::new(RIG_FOLDER).join(format!("{what}.toml"))
}

/// Key of a recording for the digest of another mechanism of the rig.
pub(crate) const MECHANISM_DIGEST: &str = "digest:rig_mechanism";

/// Where a run directory keeps the URDF of another mechanism of the rig.
pub(crate) fn kept_mechanism() -> PathBuf {
    Path::new(MECHANISM_FOLDER).join("active.urdf")
}

/// Takes in what a tick showed.
pub(super) fn see(now: &mut Situation, r: &TickRecord) {
    now.bodies = r.bodies;
    now.x_34 = r.motion.x_34;
    now.relative = r.motion.twist;
    now.port4 = r.ports.port4;
    let Some(k) = r.closed_tick else { return };
    let time_s = seconds(k);
    if r.ports.port4.f.length() > PORT_CONTACT_N {
        now.first_contact_s.get_or_insert(time_s);
    }
    if r.measurement.is_joined() == Some(true) {
        now.captured_s.get_or_insert(time_s);
    }
    // Of the tick to come.
    now.time_s = seconds(k + 1);
}

fn period_s(scenario: &Scenario) -> Result<f64, RunError> {
    #[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
    let tick_s = scenario.run.tick_nanos as f64 * 1e-9;
    if scenario.run.tick_nanos == PERIOD_NS {
        return Ok(tick_s);
    }
    Err(RunError::usage(
        format!("the loop runs at 1 kHz, the scenario has ticks of {tick_s} s"),
        "leave run.tick_s at 0.001 for `hil`",
    ))
}

/// The oil volume that is meant; `where_` is what asks for one.
pub(crate) fn preset(
    rig: &RigModel,
    asked: Option<HydraulicPreset>,
    where_: &str,
) -> Result<HydraulicPreset, RunError> {
    match asked {
        Some(preset) if rig.drive.hydraulic().is_none() => Err(RunError::usage(
            format!(
                "{where_} asks for the oil volume {}, and no oil moves {}",
                preset.word(),
                rig.name
            ),
            "leave the preset out",
        )),
        asked => Ok(rig.preset(asked)),
    }
}

/// A mechanism that would sag out of its travel stands on no rig.
pub(crate) fn refuse_sag(rig: &RigModel, system: &System, path: &Path) -> Result<(), RunError> {
    let Some(what) = sag_refusal(rig, system.mechanism()) else { return Ok(()) };
    let what = format!("{what}: {}", path.with_extension("toml").display());
    Err(RunError::usage(what, SAG_REMEDY))
}

/// The URDF of the rig: the one named, the scenario's, or the default one.
pub(crate) fn rig_path(named: Option<&Path>, scenario: &Scenario) -> Result<PathBuf, RunError> {
    if let Some(path) = named {
        return Ok(path.with_extension("urdf"));
    }
    let named = scenario.hil.rig.as_deref().unwrap_or(DEFAULT_RIG);
    let from = scenario.files.first().map_or(Path::new("."), |f| &f.path);
    resolve_path_from(&scenario.sources, from, Path::new(named)).ok_or_else(|| {
        RunError::usage(
            format!(
                "the rig is found neither beside the scenario nor in any folder above it: {named}"
            ),
            "name it with --model RIG.toml, or as loop.rig in the scenario",
        )
    })
}

/// The longest run-up that stays clear of the other side, by [`RUN_UP_CLEARANCE_M`] where one does; arming refuses one
/// that does not at all.
fn run_up_s(system: &System, programme: &Programme) -> f64 {
    let speed = programme.free(0.0).twist.v.length().max(1e-3);
    let [shortest, longest] = RUN_UP_S;
    let most = (2.0 * RUN_UP_M / speed).clamp(shortest, longest);
    let clear =
        |time: f64, by_m: f64| RunUp::new(programme, time).is_clear(by_m, |x| system.touches_at(x));
    let times = || {
        let shorter = |t: &f64| (t * 0.8 > shortest).then_some(t * 0.8);
        core::iter::successors(Some(most), shorter).chain([shortest])
    };
    let longest_by = |by_m: f64| times().find(|t| clear(*t, by_m));
    // A stick is in its frame from the beginning.
    let by_m = if system.mechanism().stick.is_some() { 0.0 } else { RUN_UP_CLEARANCE_M };
    longest_by(by_m).or_else(|| longest_by(0.0)).unwrap_or(shortest)
}

/// The rig can show this pose with room to spare.
fn within_reach(
    rig: &RigModel,
    believed: &RigSetup,
    x_34: &Pose,
    what: &str,
) -> Result<(), RunError> {
    let c = believed.believed_platform.at(&rig.plate_from_docking(x_34));
    let margins = believed.believed_platform.stroke_margins_m(&c.length_m);
    let least = margins.iter().copied().fold(f64::INFINITY, f64::min);
    let limits = SafetyLimits::of_rig(rig, 0.0, 0.0);
    let (far, most) = (half_widths(rig, x_34), limits.pose_half_widths);
    if least > limits.stroke_margin_m && far < most {
        return Ok(());
    }
    let p = x_34.p;
    Err(RunError::usage(
        format!(
            "the rig cannot show the {what}, X_34 at ({:.2}, {:.2}, {:.2}) m: {far:.2} half-widths of \
             the docking workspace from its middle (most {most}), {least:.2} m of stroke left",
            p.x, p.y, p.z
        ),
        "give a smaller initial.gap_m or other initial conditions; \
         `docktwin analyze workspace RIG.toml` tells what the rig reaches",
    ))
}
