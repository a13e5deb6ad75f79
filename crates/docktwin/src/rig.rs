//! `rig`: an emulated rig as a process of its own, and what is to be known of a rig before a loop is
//! closed around it.

mod emulate;
mod measure;
mod retract;

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Subcommand};
use docktwin_run::rig_place::RigPlace;

use crate::{
    args::{AxisArg, LedArgs, PresetArg, RealtimeArgs, RigMechanismArgs},
    failure::Failure,
};

/// `rig …`.
#[derive(Debug, Subcommand)]
pub(crate) enum RigCommand {
    /// Run an emulated rig as a process of its own, on the other end of `ipc:NAME`
    #[command(after_help = EMULATE)]
    Emulate(EmulateArgs),
    /// Find zeros of the force sensors, what they carry, and how late they are
    #[command(after_help = CALIBRATE)]
    Calibrate(CalibrateArgs),
    /// Find null bias, flow gain, delay and frequency response of a rig
    #[command(after_help = IDENTIFY)]
    Identify(IdentifyArgs),
    /// Open the latches and draw a rig back after a run, until nothing touches
    #[command(after_help = RETRACT)]
    Retract(retract::RetractArgs),
}

const EMULATE: &str = "\
Says one line when it is ready, and runs until Ctrl-C or SIGTERM; then the rig has stopped and what
was counted is told. It waits for a loop with the virtual clock, and lives on by itself when the
clock is real; a loop that falls silent finds it in its safe state, holding.

The mechanism between rack and plate is that of the scenario. A scenario's spring stick stands in
the middle of its frame, any other mechanism begins drawn back.

Examples:
  docktwin rig emulate models/urdf/stewart.toml --name lab --allow-best-effort
  docktwin rig emulate models/urdf/stewart.toml --name lab --scenario scenarios/vibro_impact.toml
  docktwin rig emulate models/urdf/stewart.toml --name lab --perturb 7     another rig of its kind";

const CALIBRATE: &str = "\
The plate is tilted to all sides and swung along and about all axes, nothing touching: tare of
sensor A, and of sensor B its zero, the mass, mass centre and inertia of what it carries, and the
time by which its samples are later than those of the legs. Takes about a minute of the rig's time.

Sensor A stands still and feels no motion: with --touch-mm a light stick in its frame is swung
against both ends, and A is compared with how far the plate has gone beyond the play of the stick.

A rig behind a port moves when somebody confirms it. The file is dated and never overwritten; `hil`
refers to it by digest.

Examples:
  docktwin rig calibrate --rig emulated --model models/urdf/stewart.toml --perturb 7
  docktwin rig calibrate --rig emulated --model models/urdf/stewart.toml \\
      --scenario scenarios/vibro_impact.toml --touch-mm 13.5
  docktwin rig calibrate --rig ipc:lab --model models/urdf/stewart.toml --yes --out lab/sensors.toml";

const IDENTIFY: &str = "\
In the order in which one thing hides another: null bias of every valve at standstill, flow gain on
a slow move along X, delay from time stamps with both corrected, then the response along every
degree of freedom by sines of the amplitude of a contact, 0.235 to 10 Hz. Takes about four minutes
of the rig's time; --dof takes less. Nothing may touch: in an emulation a spring stick is taken out
of its frame. A rig without valves, or one that does not report their openings, has no bias and no
gain to be found; delay and response need the plate's pose alone.

A rig behind a port moves when somebody confirms it. The file is dated and never overwritten; `hil`
refers to it by digest.

Examples:
  docktwin rig identify --rig emulated --model models/urdf/stewart.toml --perturb 7
  docktwin rig identify --rig emulated --model models/urdf/stewart.toml --dof x --dof y --json
  docktwin rig identify --rig ipc:lab --model models/urdf/stewart.toml --yes --out lab/legs.toml
  docktwin rig identify --rig emulated --model models/urdf/electric_hexapod.toml --drive drive.toml";

const RETRACT: &str = "\
A run leaves the rig where it ended: docked, often. The rig opens its latches, as far as they have
drives, and goes back along the docking axis by itself, slowly; the command waits until it rests.

A rig behind a port moves when somebody confirms it.

Examples:
  docktwin rig retract --rig ipc:lab --model models/urdf/stewart.toml
  docktwin rig retract --rig ipc:lab --model lab.toml --clock realtime --yes";

/// Options of `rig emulate`.
#[derive(Debug, Args)]
pub(crate) struct EmulateArgs {
    /// TOML or URDF of the rig, the other beside it
    rig: PathBuf,
    /// Name by which loops find it: `ipc:NAME`
    #[arg(long, value_name = "NAME")]
    name: String,
    #[command(flatten)]
    built: BuiltArgs,
    #[command(flatten)]
    realtime: RealtimeArgs,
}

/// How an emulated rig is built.
#[derive(Debug, Args)]
struct BuiltArgs {
    /// Scenario whose mechanism stands on the rig [default: scenarios/apas_nominal.toml, found from
    /// the rig's folder up]
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    set: Vec<String>,
    /// Seed of the emulated rig's noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Draw the emulated rig within the spread of its file; controllers still believe the file
    #[arg(long, value_name = "SEED")]
    perturb: Option<u64>,
    #[command(flatten)]
    mechanism: RigMechanismArgs,
    /// Oil volume [default: as the rig's file says]
    #[arg(long, value_enum)]
    preset: Option<PresetArg>,
}

/// What `calibrate` and `identify` share.
#[derive(Debug, Args)]
struct MeasureArgs {
    /// The rig: `emulated` in this process, or `ipc:NAME` in another
    #[arg(long, value_name = "emulated|ipc:NAME")]
    rig: RigPlace,
    /// TOML or URDF of the rig, the other beside it
    #[arg(long, value_name = "RIG.toml")]
    model: PathBuf,
    #[command(flatten)]
    built: BuiltArgs,
    #[command(flatten)]
    led: LedArgs,
    /// Where, X of the origin of e4 from the middle, mm [default: 0 for a spring stick, else 200]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    at_x_mm: Option<f64>,
    /// File; by default a new one under `calibrations`.
    #[arg(
        long,
        value_name = "FILE",
        help = "File [default: calibrations/<rig>-<command>-<utc>.toml]"
    )]
    out: Option<PathBuf>,
}

/// Options of `rig calibrate`.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArgs {
    #[command(flatten)]
    measure: MeasureArgs,
    /// File of `rig identify` whose corrections are applied
    #[arg(long, value_name = "FILE")]
    identification: Option<PathBuf>,
    /// Swing a stick along Y against both ends of its frame, mm, more than its play and 16 at most: finds A's
    /// lateness
    #[arg(long, value_name = "MM", value_parser = touch_mm)]
    touch_mm: Option<f64>,
}

/// Options of `rig identify`.
#[derive(Debug, Args)]
pub(crate) struct IdentifyArgs {
    #[command(flatten)]
    measure: MeasureArgs,
    /// Degree of freedom whose response is measured, repeatable [default: all]
    #[arg(long, value_enum)]
    dof: Vec<AxisArg>,
    /// Free way along X about the place, mm; a shorter one tells less of the flow gain
    #[arg(long, value_name = "MM", default_value_t = 200.0, value_parser = room_mm)]
    room_mm: f64,
    /// Write the response also as the table `[drive]` of a rig's file whose drive is `measured`
    #[arg(long, value_name = "FILE")]
    drive: Option<PathBuf>,
}

fn between(text: &str, least: f64, most: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (least..=most).contains(&x) => Ok(x),
        _ => Err(format!("a number of millimetres from {least} to {most} is wanted")),
    }
}

fn touch_mm(text: &str) -> Result<f64, String> {
    between(text, 1.0, 16.0)
}

fn room_mm(text: &str) -> Result<f64, String> {
    between(text, 5.0, 400.0)
}

/// Runs the command.
pub(crate) fn run(command: &RigCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        RigCommand::Emulate(args) => emulate::run(args, json),
        RigCommand::Calibrate(args) => measure::calibrate(args, json),
        RigCommand::Identify(args) => measure::identify(args, json),
        RigCommand::Retract(args) => retract::run(args, json),
    }
}
