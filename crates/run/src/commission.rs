//! Commissioning of a rig before the loop is closed: identification of its drives, calibration of
//! its sensors; and retraction after a run.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use docktwin_control::{feedforward::LegCorrections, rig::RigSetup, safety::SafetyLimits};
use docktwin_core::Pose;
use docktwin_hil::{
    calibrate::{CalibrateSetup, Calibration, Touch, calibrate as calibrate_on},
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    drive::{Drive, DriveSetup},
    emulated::{EmulatedRig, clear},
    identify::{FREQUENCIES_HZ, Identification, IdentifySetup, identify as identify_on},
    realtime::relax,
};
use docktwin_model::{HydraulicPreset, Rig as RigModel, load_rig};
use docktwin_physics::{mechanism::System, mounted::Article};
use docktwin_rigport::{in_process::InProcess, rig::Rig};
use docktwin_scenario::{Loader, Scenario, resolve_path};

use crate::{
    article::RigMechanism,
    error::RunError,
    hil_run::{PERIOD_NS, preset, refuse_sag},
    rig_place::{
        ClockKind, Operator, RealtimeOptions, RigPlace, best_effort, confirm, connect,
        identification, new_session, patience,
    },
    rigfile::{CalibrationFile, IdentificationFile, Origin},
    setup::start,
};

/// Scenario when none is named.
const DEFAULT_SCENARIO: &str = "scenarios/apas_nominal.toml";
/// Opening of a frame that no stick reaches, m.
const NO_FRAME_M: f64 = 10.0;
/// From place to place, m/s and rad/s.
const MOVE: [f64; 2] = [0.1, 0.05];
/// By how much the force on sensor A may change before the drive is stopped, N: with nothing touching,
/// with a stick that is swung against its frame, and while a rig is drawn back, where it is what a
/// mechanism bears in tension: more is a latch that stays shut.
const CLEAR_N: f64 = 50.0;
const TOUCH_N: f64 = 500.0;
const RETRACT_N: f64 = 4000.0;
/// Tilt of a mechanism that has room, and of a stick in its frame, rad.
const TILT_RAD: f64 = 0.08;
const STICK_TILT_RAD: f64 = 0.012;
/// How often a touch is made, Hz.
const TOUCH_HZ: f64 = 2.0;

/// A rig, what stands on it, and how it is built when it is emulated.
#[derive(Clone, Debug, Default)]
pub struct StandOptions {
    /// TOML or URDF of the rig, the other beside it.
    pub model: PathBuf,
    /// Scenario whose mechanism stands on the rig; else that of `apas_nominal`, found from the rig's folder
    /// up.
    pub scenario: Option<PathBuf>,
    /// Reads the scenario, with values patched.
    pub loader: Loader,
    /// Seed of an emulated rig's noise.
    pub seed: u64,
    /// Draws an emulated rig within the spread of its file; controllers still believe the file.
    pub perturb: Option<u64>,
    /// The mechanism that an emulated rig has; else that of the scenario.
    pub mechanism: RigMechanism,
    /// Oil volume; else as the rig's file says.
    pub preset: Option<HydraulicPreset>,
}

/// A rig, and what stands on it.
#[derive(Clone, Debug)]
pub struct Stand {
    /// The rig as its file says.
    pub rig: RigModel,
    /// Oil volume.
    pub preset: HydraulicPreset,
    /// Spacecraft and mechanism.
    pub system: System,
    /// What stands on an emulated rig.
    article: Article,
    scenario: Scenario,
    seed: u64,
    perturb: Option<u64>,
}

impl Stand {
    /// Reads both.
    ///
    /// # Errors
    /// Problems of their files, no scenario, or a mechanism that would sag out of its travel on this rig.
    pub fn load(options: &StandOptions) -> Result<Self, RunError> {
        let rig = load_rig(&options.model)?.model;
        let named = options.scenario.clone();
        let path = named.or_else(|| resolve_path(&options.model, Path::new(DEFAULT_SCENARIO)));
        let path = path.ok_or_else(|| {
            RunError::usage(
                format!("no {DEFAULT_SCENARIO} from the folder of the rig up"),
                "name the scenario whose mechanism stands on the rig: --scenario FILE",
            )
        })?;
        let scenario = options.loader.load(&path)?;
        let (system, _) = start(&scenario)?;
        let preset = preset(&rig, options.preset, "--preset")?;
        let article = options.mechanism.article(&scenario, &system)?.article;
        refuse_sag(&rig, &article.system, &options.model)?;
        let (seed, perturb) = (options.seed, options.perturb);
        Ok(Self { rig, preset, system, article, scenario, seed, perturb })
    }

    /// Takes a stick out of its frame, if there is one.
    fn free_the_stick(&mut self) {
        let s = &self.scenario;
        let mut mechanism = s.mechanism.clone();
        if let Some(stick) = &mut mechanism.stick {
            stick.frame_opening_m = NO_FRAME_M;
            self.system = System::new(&s.chaser, &s.target, mechanism);
            self.article = self.system.clone().into();
        }
    }

    /// Whether the mechanism is a spring stick.
    #[must_use]
    pub fn has_stick(&self) -> bool {
        self.system.mechanism().stick.is_some()
    }

    /// Name of the scenario whose mechanism stands on the rig.
    #[must_use]
    pub fn scenario_name(&self) -> &str {
        &self.scenario.name
    }

    /// Where nothing touches, `X_34`.
    #[must_use]
    pub fn clear(&self) -> Pose {
        clear(&self.rig, &self.system)
    }

    /// The rig emulated, at a pose.
    ///
    /// # Errors
    /// The rig's file lacks what an emulation needs.
    pub fn emulated(&self, at: &Pose) -> Result<EmulatedRig, RunError> {
        let article = self.article.clone();
        EmulatedRig::new(&self.rig, self.preset, self.perturb, self.seed, article, at).map_err(
            |e| {
                RunError::usage(
                    e.to_string(),
                    "mend the rig's file; models/urdf/stewart.toml is an example",
                )
            },
        )
    }

    fn believed(&self) -> RigSetup {
        RigSetup::of_rig(&self.rig, self.preset, None)
    }
}

/// How a rig is driven.
#[derive(Clone, Debug, Default)]
pub struct DriveOptions {
    /// Where the rig is.
    pub place: RigPlace,
    /// What drives the ticks.
    pub clock: ClockKind,
    /// What is asked of the machine in real time.
    pub realtime: RealtimeOptions,
}

/// Work on a rig that is driven.
trait Work {
    type Found;
    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Self::Found, RunError>;
}

fn failed(e: &dyn core::fmt::Display) -> RunError {
    RunError::usage(e.to_string(), "mend that and begin again; nothing was written")
}

/// Connects to a rig, does the work with the chosen clock, and ends the session.
fn drive<R: Rig, W: Work, O: Operator>(
    rig: R,
    options: &DriveOptions,
    setup: DriveSetup,
    work: &W,
    operator: &mut O,
) -> Result<W::Found, RunError> {
    match options.clock {
        ClockKind::Virtual => with_clock(rig, VirtualClock::new(PERIOD_NS), setup, work),
        ClockKind::Realtime => {
            if let Some(lacking) = best_effort(&options.realtime.apply()?) {
                operator.note(&lacking);
            }
            let clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
            let found = with_clock(rig, clock, setup, work);
            relax();
            found
        }
    }
}

fn with_clock<R: Rig, K: Clock, W: Work>(
    rig: R,
    clock: K,
    setup: DriveSetup,
    work: &W,
) -> Result<W::Found, RunError> {
    let setup = DriveSetup { patience: patience::<K>(), ..setup };
    let mut drive = Drive::start(setup, rig, clock).map_err(|e| failed(&e))?;
    let found = work.work(&mut drive)?;
    drive.finish().map_err(|e| failed(&e))?;
    Ok(found)
}

/// A rig and where it is measured.
struct Task<'a> {
    options: &'a DriveOptions,
    stand: Stand,
    place: Pose,
    corrections: LegCorrections,
    may_change_n: f64,
}

impl<'a> Task<'a> {
    fn new(stand: Stand, options: &'a DriveOptions, at_x_m: Option<f64>) -> Self {
        let mut place = stand.clear();
        if let Some(x) = at_x_m {
            place.p.x = stand.rig.docking.middle_m.x + x;
        }
        let corrections = LegCorrections::default();
        Self { options, stand, place, corrections, may_change_n: CLEAR_N }
    }

    fn run<W: Work, O: Operator>(&self, work: &W, operator: &mut O) -> Result<W::Found, RunError> {
        confirm(operator, &self.options.place)?;
        let rig = &self.stand.rig;
        let setup = DriveSetup {
            rig: rig.clone(),
            feedforward: self.stand.believed().feedforward(),
            corrections: self.corrections,
            limits: SafetyLimits::of_rig(rig, self.may_change_n, f64::INFINITY),
            speed: MOVE,
            session: new_session(),
            patience: Duration::ZERO,
        };
        match &self.options.place {
            RigPlace::Emulated => {
                let plant = self.stand.emulated(&self.place)?;
                drive(InProcess::new(plant), self.options, setup, work, operator)
            }
            RigPlace::Port(name) => drive(connect(name)?, self.options, setup, work, operator),
        }
    }

    fn origin(&self) -> Origin {
        let place = &self.options.place;
        let stand = &self.stand;
        let mut o = Origin::now(&stand.rig, stand.preset, &place.to_string(), &self.place);
        if *place == RigPlace::Emulated {
            (o.seed, o.perturb) = (Some(stand.seed), stand.perturb);
        }
        o
    }
}

impl Work for IdentifySetup {
    type Found = Identification;

    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Identification, RunError> {
        identify_on(drive, self).map_err(|e| failed(&e))
    }
}

impl Work for CalibrateSetup {
    type Found = Calibration;

    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Calibration, RunError> {
        calibrate_on(drive, self).map_err(|e| failed(&e))
    }
}

/// What `rig identify` is asked for beside rig and drive.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifyOptions {
    /// X of the origin of `e4` from the middle, m; else clear of the other side.
    pub at_x_m: Option<f64>,
    /// Degrees of freedom whose response is measured, 0 to 5; empty for all.
    pub dofs: Vec<usize>,
    /// Free way along X about the place, m.
    pub room_m: f64,
}

/// Finds null bias and flow gain of valves, where there are any, delay and frequency response of a rig. Takes
/// about four minutes of the rig's time.
///
/// # Errors
/// The rig cannot be taken over, or stopped; nothing is found then.
pub fn identify(
    stand: Stand,
    options: &DriveOptions,
    asked: &IdentifyOptions,
    operator: &mut impl Operator,
) -> Result<(Identification, IdentificationFile), RunError> {
    let mut task = Task::new(stand, options, asked.at_x_m);
    let believed = task.stand.believed();
    let stick = task.stand.system.mechanism().stick;
    let lever_m = stick.map_or(believed.platform.plate_radius_m(), |s| s.lever_m);
    task.stand.free_the_stick();
    let setup = IdentifySetup {
        legs: believed.hydraulic().map(|h| h.believed_legs),
        place: task.place,
        room_m: asked.room_m,
        dofs: if asked.dofs.is_empty() { (0..6).collect() } else { asked.dofs.clone() },
        hz: FREQUENCIES_HZ.to_vec(),
        lever_m,
    };
    let found = task.run(&setup, operator)?;
    let file = IdentificationFile::new(task.origin(), &found);
    Ok((found, file))
}

/// What `rig calibrate` is asked for beside rig and drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CalibrateOptions {
    /// X of the origin of `e4` from the middle, m; else clear of the other side.
    pub at_x_m: Option<f64>,
    /// File of `rig identify` whose corrections are applied.
    pub identification: Option<PathBuf>,
    /// Corrections that are at hand, where there is no file.
    pub corrections: Option<LegCorrections>,
    /// Swings a stick along Y against both ends of its frame by this much, m.
    pub touch_m: Option<f64>,
}

/// Finds zeros of the force sensors, what they carry, and how late they are. Takes about a minute of
/// the rig's time.
///
/// # Errors
/// The rig cannot be taken over, or stopped; nothing is found then.
pub fn calibrate(
    stand: Stand,
    options: &DriveOptions,
    asked: &CalibrateOptions,
    operator: &mut impl Operator,
) -> Result<(Calibration, CalibrationFile), RunError> {
    let mut task = Task::new(stand, options, asked.at_x_m);
    let sensors = task.stand.rig.sensors.ok_or_else(|| {
        RunError::usage(
            "the rig has no table [sensors]",
            "add one; models/urdf/stewart.toml is an example",
        )
    })?;
    let mut setup = CalibrateSetup::at(task.place, sensors);
    setup.tilt_rad = if task.stand.has_stick() { STICK_TILT_RAD } else { TILT_RAD };
    if let Some(amplitude_m) = asked.touch_m {
        let stick = task.stand.system.mechanism().stick.ok_or_else(|| {
            RunError::usage(
                "only a light stick can be touched for this",
                "give a scenario with a stick, scenarios/vibro_impact.toml is one",
            )
        })?;
        let play_m = stick.play_m();
        if amplitude_m <= play_m {
            let mm = play_m * 1e3;
            return Err(RunError::usage(
                format!("a swing of {} mm ends before the stick touches", amplitude_m * 1e3),
                format!("let it swing by more than its play of {mm} mm"),
            ));
        }
        setup.touch = Some(Touch { dof: 1, amplitude_m, hz: TOUCH_HZ, play_m });
        task.may_change_n = TOUCH_N;
    }
    if let Some(path) = &asked.identification {
        task.corrections = identification(path, &task.stand.rig)?.1.corrections();
    } else if let Some(corrections) = asked.corrections {
        task.corrections = corrections;
    }
    let found = task.run(&setup, operator)?;
    let file = CalibrationFile::new(task.origin(), &found);
    Ok((found, file))
}

struct DrawBack;

impl Work for DrawBack {
    type Found = Pose;

    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Pose, RunError> {
        drive.retract().map_err(|e| {
            RunError::usage(
                e.to_string(),
                "the rig was stopped; fix the cause, or draw it back with its own controller",
            )
        })
    }
}

/// Opens the latches and retracts a rig through the rig port until nothing touches; gives `X_34`
/// there.
///
/// # Errors
/// The rig is an emulated one of this process, cannot be taken over, or stopped.
pub fn retract(
    model: &Path,
    options: &DriveOptions,
    operator: &mut impl Operator,
) -> Result<Pose, RunError> {
    let RigPlace::Port(name) = &options.place else {
        return Err(RunError::usage(
            "an emulated rig of this process begins drawn back",
            "name one that runs: --rig ipc:NAME",
        ));
    };
    let model = load_rig(model)?.model;
    confirm(operator, &options.place)?;
    let setup = DriveSetup {
        feedforward: RigSetup::of_rig(&model, model.preset(None), None).feedforward(),
        corrections: LegCorrections::default(),
        limits: SafetyLimits::of_rig(&model, RETRACT_N, f64::INFINITY),
        speed: [0.0; 2],
        session: new_session(),
        patience: Duration::ZERO,
        rig: model,
    };
    drive(connect(name)?, options, setup, &DrawBack, operator)
}
