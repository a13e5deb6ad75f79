//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use docktwin_run::{TwinKind, rig_place::ClockKind};

use crate::{
    company::{LiveArgs, PilotArgs},
    rigs::{LedArgs, RigPlace},
};

/// Digital twin of spacecraft docking: rehearse a docking from a scenario file, look at its
/// contacts, replay it bit by bit.
#[derive(Debug, Parser)]
#[command(name = "docktwin", version, max_term_width = 100, after_help = EXAMPLES)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXAMPLES: &str = "\
Examples:
  docktwin rehearse scenarios/apas_nominal.toml
  docktwin rehearse scenarios/apas_fast.toml --set initial.lateral_y_m=0.1 --out runs/wide
  docktwin replay runs/wide
  docktwin scenario explain initial.gap_m

Exit codes: 0 the run ended as its `expect` says; 1 it ended otherwise; 2 bad input or usage;
3 the supervisor stopped the rig, and that was not expected; 70 a defect of docktwin.";

/// Options of every command.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Print the result as JSON on stdout, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Rehearse a docking with the twin alone, as fast as possible
    #[command(after_help = REHEARSE)]
    Rehearse(RehearseArgs),
    /// Close the loop around a rig, emulated or real, in virtual or in real time
    #[command(after_help = HIL)]
    Hil(HilArgs),
    /// Check the files of a model, or explain their keys
    #[command(subcommand)]
    Model(ModelCommand),
    /// Check a scenario, or explain its keys
    #[command(subcommand)]
    Scenario(ScenarioCommand),
    /// Compare two recordings: bit by bit, or within tolerances
    #[command(after_help = crate::diff::EXAMPLES)]
    Diff(crate::diff::DiffArgs),
    /// Write a recording as CSV or as a MATLAB file
    #[command(after_help = crate::export::EXAMPLES)]
    Export(crate::export::ExportArgs),
    /// Make the files of a run whole after its process or its disk died
    #[command(after_help = crate::recover::EXAMPLES)]
    Recover(crate::recover::RecoverArgs),
    /// Run a recording again, tick by tick, and say where it first differs
    #[command(after_help = REPLAY)]
    Replay(ReplayArgs),
    /// Open a run, or two laid over each other, in the rerun viewer
    #[command(after_help = VIEW)]
    View(ViewArgs),
    /// Analyse a design, without a docking
    #[command(subcommand)]
    Analyze(AnalyzeCommand),
    /// Write one self-contained HTML page of a run: verdict, pictures, plots, contacts in words
    #[command(after_help = REPORT)]
    Report(ReportArgs),
    /// What this machine offers a real-time loop, each shortfall with what mends it
    #[command(after_help = crate::doctor::EXAMPLES)]
    Doctor(crate::doctor::DoctorArgs),
    /// Emulate a rig, calibrate it, identify it
    #[command(subcommand)]
    Rig(crate::rig::RigCommand),
    /// Hold docktwin against something else
    #[command(subcommand)]
    Validate(crate::validate::ValidateCommand),
}

const REHEARSE: &str = "\
The run directory holds summary.json, run.mcap (every tick, crash-safe), telemetry.parquet,
events.jsonl, run.rrd (for the rerun viewer) and scenario.toml (as it ran).

--live streams to a viewer at rerun+http://127.0.0.1:9876/proxy, or at --live=URL, beside writing
the files; start one with `rerun --bind 127.0.0.1`. What it does not take in time it does not
show; the run neither waits nor differs.

--pilot adds the pilot's force and moment to the scenario's thrusts, in real time, 1 ×. The keys
are told at the start: w/s a/d r/f push along X Y Z of e1, o/u i/k j/l turn about them, space lets
go, q ends. The run is recorded like any other and can be replayed bit by bit.

Examples:
  docktwin rehearse scenarios/apas_nominal.toml
  docktwin rehearse scenarios/apas_nominal.toml --twin reduced --json
  docktwin rehearse scenarios/apas_nominal.toml --live --pilot --set run.duration_s=60
  docktwin rehearse scenarios/apas_fast.toml --set mechanism.attenuation='\"differential\"'";

/// Options of `rehearse`.
#[derive(Debug, Args)]
pub(crate) struct RehearseArgs {
    /// Scenario file
    pub(crate) scenario: PathBuf,
    /// Run directory; by default a new one under `runs`.
    #[arg(long, value_name = "DIR", help = "Run directory [default: runs/<scenario>-<utc>]")]
    pub(crate) out: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of all random numbers (a rehearsal draws none; it is kept with the run)
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Which twin integrates the bodies
    #[arg(long, value_enum, default_value_t = TwinArg::Full)]
    pub(crate) twin: TwinArg,
    /// Do not write run.rrd
    #[arg(long)]
    pub(crate) no_rrd: bool,
    #[command(flatten)]
    pub(crate) live: LiveArgs,
    #[command(flatten)]
    pub(crate) pilot: PilotArgs,
}

const HIL: &str = "\
The programme of both spacecraft answers the wrenches that the rig measures, 1000 times a second,
and the rig shows the mechanisms how they would move. `emulated` runs an emulated rig in this
process; `ipc:NAME` talks to another process (`docktwin rig emulate`, or a rig of your own written
from docs/rig-protocol.md) and asks before it moves that rig. With the virtual clock loop and rig
wait for each other and a run repeats bit by bit; with the real-time clock the loop waits for
nobody.

A run: checklist and arming; a slow move to the beginning of the run-up, where sensors are tared;
the run-up along the free flight to the initial condition; then the loop is closed. What is
recorded begins there. A limit passed anywhere stops the rig (exit code 3, unless the scenario
expects it). --dry-run goes there and back, slowly, without closing the loop.

The run directory is that of `rehearse`, with columns of loop, legs and sensors beside it, and
`loop`, `fidelity` (against the same docking without a rig) and `safety` in summary.json.

Examples:
  docktwin hil scenarios/apas_nominal.toml --rig emulated
  docktwin hil scenarios/vibro_impact.toml --rig emulated --compensator none
  docktwin hil scenarios/apas_nominal.toml --rig emulated --perturb 7 --lead-ms 1.8 --out runs/p7
  docktwin rig identify --rig emulated --model models/urdf/stewart.toml --perturb 7 --out p7.toml
  docktwin hil scenarios/apas_nominal.toml --rig emulated --perturb 7 --identification p7.toml
  docktwin rig emulate models/urdf/stewart.toml --name lab &
  docktwin hil scenarios/apas_nominal.toml --rig ipc:lab --clock realtime --live --yes";

/// Options of `hil`.
#[derive(Debug, Args)]
pub(crate) struct HilArgs {
    /// Scenario file
    pub(crate) scenario: PathBuf,
    /// The rig: `emulated` in this process, or `ipc:NAME` in another
    #[arg(long, value_name = "emulated|ipc:NAME")]
    pub(crate) rig: RigPlace,
    #[command(flatten)]
    pub(crate) led: LedArgs,
    /// Against the delay of the rig [default: as the scenario says, or lead]
    #[arg(long, value_parser = compensator, value_name = "none|lead")]
    pub(crate) compensator: Option<docktwin_scenario::CompensatorChoice>,
    /// Lead, ms [default: as the scenario says, or the delay that is believed]
    #[arg(long, value_name = "MS", value_parser = not_negative)]
    pub(crate) lead_ms: Option<f64>,
    /// TOML of the rig [default: as the scenario says, or models/urdf/stewart.toml]
    #[arg(long, value_name = "RIG.toml")]
    pub(crate) model: Option<PathBuf>,
    /// File of `rig identify`: null bias and flow gain are corrected, delay and lead are its own
    #[arg(long, value_name = "FILE")]
    pub(crate) identification: Option<PathBuf>,
    /// File of `rig calibrate`: what sensor B carries is its own
    #[arg(long, value_name = "FILE")]
    pub(crate) calibration: Option<PathBuf>,
    /// Run directory; by default a new one under `runs`.
    #[arg(long, value_name = "DIR", help = "Run directory [default: runs/<scenario>-<utc>]")]
    pub(crate) out: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of the emulated rig's noise
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Draw the emulated rig within the spread of its file; the loop still believes the file
    #[arg(long, value_name = "SEED")]
    pub(crate) perturb: Option<u64>,
    /// Do not write run.rrd
    #[arg(long)]
    pub(crate) no_rrd: bool,
    /// Slowly to the initial condition and back, with an open gap
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) live: LiveArgs,
    #[command(flatten)]
    pub(crate) pilot: PilotArgs,
}

pub(crate) fn compensator(text: &str) -> Result<docktwin_scenario::CompensatorChoice, String> {
    let words = docktwin_scenario::CompensatorChoice::WORDS;
    words
        .into_iter()
        .find(|(w, _)| *w == text)
        .map(|(_, c)| c)
        .ok_or_else(|| "a compensator is `none` or `lead`".to_owned())
}

/// What drives the ticks of a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClockArg {
    /// As fast as it goes; a run repeats bit by bit
    #[default]
    Virtual,
    /// 1 kHz of the machine's clock
    Realtime,
}

impl ClockArg {
    pub(crate) const fn kind(self) -> ClockKind {
        match self {
            Self::Virtual => ClockKind::Virtual,
            Self::Realtime => ClockKind::Realtime,
        }
    }
}

pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=1e9).contains(&x) => Ok(x),
        _ => Err("a number, not negative, is wanted".to_owned()),
    }
}

/// Which twin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TwinArg {
    /// rapier integrates; 0.2 ms steps by default
    Full,
    /// Our own allocation-free integrator; 0.1 ms steps by default
    Reduced,
}

impl TwinArg {
    pub(crate) const fn kind(self) -> TwinKind {
        match self {
            Self::Full => TwinKind::Full,
            Self::Reduced => TwinKind::Reduced,
        }
    }
}

/// `model …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ModelCommand {
    /// Tell everything read, refused or ignored in a URDF or its TOML, all problems at once
    #[command(
        after_help = "Examples:\n  docktwin model check models/urdf/apas_active.urdf\n  docktwin model check models/urdf/chaser_8t.toml --json"
    )]
    Check {
        /// URDF or TOML of a spacecraft or of one side of a mechanism
        file: PathBuf,
    },
    /// Explain a key of the TOML of spacecraft, mechanisms and rigs, or all of them
    #[command(
        after_help = "Examples:\n  docktwin model explain\n  docktwin model explain ring_body.mass_kg\n  docktwin model explain spread --kind rig"
    )]
    Explain {
        /// Key or table, with dots
        key: Option<String>,
        /// Only of one kind of file
        #[arg(long, value_name = "KIND", value_parser = file_kind)]
        kind: Option<docktwin_model::keys::FileKind>,
    },
}

fn file_kind(text: &str) -> Result<docktwin_model::keys::FileKind, String> {
    let words = docktwin_model::keys::FileKind::WORDS;
    words
        .into_iter()
        .find(|(w, _)| *w == text)
        .map(|(_, kind)| kind)
        .ok_or_else(|| format!("a kind is one of {}", words.map(|(w, _)| w).join(", ")))
}

/// `scenario …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ScenarioCommand {
    /// Check a scenario and every model it names, all problems at once
    #[command(
        after_help = "Examples:\n  docktwin scenario check scenarios/apas_nominal.toml\n  docktwin scenario check my.toml --set run.duration_s=5"
    )]
    Check {
        /// Scenario file
        file: PathBuf,
        /// Override a key of the scenario, repeatable
        #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
        set: Vec<String>,
    },
    /// Explain a key of the scenario file, or all of them
    #[command(
        after_help = "Examples:\n  docktwin scenario explain\n  docktwin scenario explain initial.gap_m"
    )]
    Explain {
        /// Key, with dots
        key: Option<String>,
    },
}

const REPLAY: &str = "\
The recorded control wrenches are fed to the same twin from the same start; the state digest is
compared at every tick.

Examples:
  docktwin replay runs/apas_nominal-20261122T101500Z
  docktwin replay runs/wide --json";

/// Options of `replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Run directory
    pub(crate) run: PathBuf,
}

const VIEW: &str = "\
The viewer is `rerun` on the path, in the version that run.rrd is written for; it is started with
its usage statistics off and the user's own configuration untouched. A run.rrd that is missing, cut
or of a killed run is made again from run.mcap.

Examples:
  docktwin view runs/fast
  docktwin view runs/fast --at 0.15                 as it was 0.15 s after the start
  docktwin view runs/fast --save fast.rrd           for another machine
  docktwin view --compare runs/fast runs/wide --align first-contact";

/// Options of `view`.
#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// Run directory
    #[arg(required_unless_present = "compare")]
    pub(crate) run: Option<PathBuf>,
    /// Lay run B over run A, as a grey ghost
    #[arg(long, num_args = 2, value_names = ["RUN_A", "RUN_B"], conflicts_with = "run")]
    pub(crate) compare: Vec<PathBuf>,
    /// What the two runs have in common in time
    #[arg(long, value_enum, default_value_t = Align::Start, requires = "compare")]
    pub(crate) align: Align,
    /// Show the run only up to this simulated time: the viewer opens there
    #[arg(long, value_name = "TIME_S", allow_negative_numbers = true)]
    pub(crate) at: Option<f64>,
    /// Write the recording for the viewer to this file instead of opening it
    #[arg(long, value_name = "FILE.rrd")]
    pub(crate) save: Option<PathBuf>,
    /// The viewer's program [default: DOCKTWIN_VIEWER of the environment, or `rerun`]
    #[arg(long, value_name = "PATH")]
    pub(crate) viewer: Option<PathBuf>,
}

/// What two runs share in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Align {
    /// Their start
    Start,
    /// Their first contact
    FirstContact,
}

/// `analyze …`.
#[derive(Debug, Subcommand)]
pub(crate) enum AnalyzeCommand {
    /// Put the mechanism on a test bench: force over displacement on every axis, coupling, contact
    #[command(after_help = MECHANISM)]
    Mechanism(MechanismArgs),
    /// Where a rig reaches: does the docking workspace fit, tolerance, range and payload
    #[command(after_help = WORKSPACE)]
    Workspace(RigArgs),
    /// Natural frequency of a rig per degree of freedom over its docking workspace
    #[command(after_help = FREQUENCY)]
    Frequency(RigArgs),
    /// Frequency response of the running rig by swept sine, its linear model laid over it
    #[command(after_help = BODE)]
    Bode(BodeArgs),
    /// How the closed loop of a rig moves with the stiffness of its payload, 0 to 1e6 N/m
    #[command(after_help = STIFFNESS)]
    Stiffness(StiffnessArgs),
}

const WORKSPACE: &str = "\
Reach is where every stroke and joint has room and no singular pose is near, found on straight
ways from the middle. The docking workspace is checked at 729 places: middle, corners, edges and
faces. Tolerance is what the length error of the file makes of the pose at the worst place;
payload is what can be added before a leg needs more than its force. A rig that does not reach
its docking workspace is refused with every leg and place (exit code 2), as by `docktwin model
check`.

The directory holds workspace.csv (every place), sections.csv, workspace.svg (Fig. 30 of the
paper), workspace.json (what --json prints), and rig.rrd for the viewer: the rig on its way through
all corners, legs coloured by what is left of their strokes, docking workspace inside the reachable
one.

Examples:
  docktwin analyze workspace models/urdf/stewart.toml
  docktwin analyze workspace mine.toml --out reach --json
  docktwin view reach                                              the rig in the viewer
  docktwin analyze workspace models/urdf/stewart.toml --seed 7     as built: another plate mass";

const FREQUENCY: &str = "\
The plate on six oil springs, valves closed. Of every degree of freedom the natural frequency
with the other five held, and the six modes, at 729 places of the docking workspace: middle,
corners, edges and faces.

The directory holds frequency.csv, frequency.svg (Fig. 31 to 36 of the paper) and frequency.json
(what --json prints).

Examples:
  docktwin analyze frequency models/urdf/stewart.toml
  docktwin analyze frequency models/urdf/stewart.toml --preset stiff --out stiff --json
  docktwin analyze frequency models/urdf/stewart.toml --seed 7   a drawn rig";

const BODE: &str = "\
One degree of freedom of the port is driven by a repeated swept sine on the running, nonlinear
rig, its control, friction and dead time included, and all six are measured. Required: at 10 Hz
at most 2 dB and 70 degrees; from 0.5 to 5 Hz |G| within 10 % (stiff: 5 %) and at most 0.15 in
other degrees of freedom; modal damping of at least 0.1. Rotations count at the radius of the
plate joints.

What is measured is where --places says; the linear model covers the middle and all 64 corners,
and takes the legs of a drawn rig to be as the first one. On two cores `middle` takes 20
seconds, `sample` (and five corners) two minutes, `all` (and 64 corners) 20 minutes; one payload
takes a third of it.

Keys of --set: position_gain_1_s, damping_ratio (of pressure feedback at 2500 kg), high_pass_hz,
valve_lead_hz (0: none), rate_hz, dead_time_s.

The directory holds bode.csv, poles.csv, bode_DOF.svg (Fig. 39 and 40 of the paper) and
bode.json (what --json prints).

Examples:
  docktwin analyze bode models/urdf/stewart.toml --dof x --dof y
  docktwin analyze bode models/urdf/stewart.toml --preset stiff --places sample --payload none
  docktwin analyze bode models/urdf/stewart.toml --seed 7 --set position_gain_1_s=20 --json";

const STIFFNESS: &str = "\
Poles and 10 Hz response of the linear model, controllers, sampling and dead time included,
against a spring of 0 to 1e6 N/m at the port, along X (axial) and along Y (lateral): in the
middle at many stiffnesses, at the 64 corners at both ends. Beside it the same with the bulk
modulus half as large again, as the paper's oil without air. Takes a few seconds.

Keys of --set: as of `docktwin analyze bode`.

The directory holds poles.csv, response.csv, poles.svg and stiffness.json (what --json prints).

Examples:
  docktwin analyze stiffness models/urdf/stewart.toml
  docktwin analyze stiffness models/urdf/stewart.toml --preset printed --out poles --json
  docktwin analyze stiffness models/urdf/stewart.toml --set damping_ratio=0.3 --set high_pass_hz=2";

/// What every analysis of a rig can be told.
#[derive(Debug, Args)]
pub(crate) struct RigArgs {
    /// TOML or URDF of the rig, the other beside it
    pub(crate) rig: PathBuf,
    /// Oil volume [default: as the file says; `stiffness`: all]
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetArg>,
    /// Draw the rig as built within the spread of its file; controllers still believe the file
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/<rig>-<command>-<utc>]")]
    pub(crate) out: Option<PathBuf>,
}

/// Options of `analyze bode`.
#[derive(Debug, Args)]
pub(crate) struct BodeArgs {
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    /// Where in the docking workspace to measure
    #[arg(long, value_enum, default_value_t = PlacesArg::Middle)]
    pub(crate) places: PlacesArg,
    /// Spring of 1e6 N/m at the port
    #[arg(long, value_enum, default_value_t = PayloadArg::All)]
    pub(crate) payload: PayloadArg,
    /// Degree of freedom to drive, repeatable [default: all]
    #[arg(long, value_enum)]
    pub(crate) dof: Vec<AxisArg>,
    /// Amplitude, mm; of a rotation at the radius of the plate joints
    #[arg(long, value_name = "MM", default_value_t = 2.0, value_parser = amplitude_mm)]
    pub(crate) amplitude_mm: f64,
    /// Override a setting of the leg control, repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Give the wanted motion ahead by the valve's delay, as a predictor knows it
    #[arg(long)]
    pub(crate) foreseen: bool,
    /// Leave out friction, null bias and orifice: the linear range
    #[arg(long)]
    pub(crate) ideal: bool,
}

/// Options of `analyze stiffness`.
#[derive(Debug, Args)]
pub(crate) struct StiffnessArgs {
    #[command(flatten)]
    pub(crate) rig: RigArgs,
    /// Override a setting of the leg control, repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
}

fn amplitude_mm(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 50.0 => Ok(x),
        _ => Err("an amplitude is a number of millimetres above 0, at most 50".to_owned()),
    }
}

/// Oil volume of the legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PresetArg {
    /// The paper's Table 1 as printed
    Printed,
    /// What belongs to the stroke
    Consistent,
    /// A tenth of the printed one, with a bypass leak
    Stiff,
}

impl PresetArg {
    /// The preset of the rig.
    pub(crate) const fn preset(self) -> docktwin_model::HydraulicPreset {
        use docktwin_model::HydraulicPreset;
        match self {
            Self::Printed => HydraulicPreset::Printed,
            Self::Consistent => HydraulicPreset::Consistent,
            Self::Stiff => HydraulicPreset::Stiff,
        }
    }
}

/// Where in the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlacesArg {
    /// Its middle
    Middle,
    /// Its middle and five corners
    Sample,
    /// Its middle and all 64 corners
    All,
}

/// What the plate touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PayloadArg {
    /// Nothing
    None,
    /// A spring along X
    Axial,
    /// A spring along Y
    Lateral,
    /// One after the other
    All,
}

const MECHANISM: &str = "\
The ring is moved along one axis at a time, to and fro: in its soft travel, over its travel,
into the end stops, and at the speed of a docking before and after capture. X is moved with the
other axes held, the others with the ring free in the remaining ones, and held for comparison.

The directory holds loop_AXIS.csv and .svg (Fig. 6 to 9 of the paper), matrices.csv (stiffness
and damping about several poses), coupling.svg, contact.csv and .svg, and mechanism.json (what
--json prints).

Examples:
  docktwin analyze mechanism models/urdf/apas_active.urdf
  docktwin analyze mechanism models/urdf/apas_active.toml --attenuation differential --out bench
  docktwin analyze mechanism mine.urdf --passive theirs.urdf --axis x --axis roll --json";

/// Options of `analyze mechanism`.
#[derive(Debug, Args)]
pub(crate) struct MechanismArgs {
    /// URDF or TOML of a side of the mechanism, the other side beside it
    pub(crate) mechanism: PathBuf,
    /// URDF or TOML of the passive side [default: beside the active one, of the same name]
    #[arg(long, value_name = "FILE")]
    pub(crate) passive: Option<PathBuf>,
    /// What carries the ring [default: as the file says]
    #[arg(long, value_enum)]
    pub(crate) attenuation: Option<AttenuationArg>,
    /// Axis to test, repeatable [default: all]
    #[arg(long, value_enum)]
    pub(crate) axis: Vec<AxisArg>,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/<mechanism>-<utc>]")]
    pub(crate) out: Option<PathBuf>,
}

/// What carries the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AttenuationArg {
    /// A table for every axis
    Characteristic,
    /// Six screw legs, coupled by differentials
    Differential,
}

/// An axis of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxisArg {
    /// Along the docking axis
    X,
    /// Sideways
    Y,
    /// Sideways
    Z,
    /// About X
    Roll,
    /// About Y
    Pitch,
    /// About Z
    Yaw,
}

impl AxisArg {
    /// The axis of the bench.
    pub(crate) const fn axis(self) -> docktwin_physics::bench::Axis {
        use docktwin_physics::bench::Axis;
        match self {
            Self::X => Axis::X,
            Self::Y => Axis::Y,
            Self::Z => Axis::Z,
            Self::Roll => Axis::Roll,
            Self::Pitch => Axis::Pitch,
            Self::Yaw => Axis::Yaw,
        }
    }
}
const REPORT: &str = "\
The page needs nothing but itself: no network, no script. It is also written of what is left of a run
that was killed, and then says so first. An existing page is replaced.

Examples:
  docktwin report runs/wide
  docktwin report runs/wide --out wide.html
  docktwin report runs/wide --json";

/// Options of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Run directory
    pub(crate) run: PathBuf,
    /// Where the page goes; by default into the run directory.
    #[arg(long, value_name = "FILE", help = "Where the page goes [default: RUN/report.html]")]
    pub(crate) out: Option<PathBuf>,
}
