//! `rig calibrate` and `rig identify`: a rig is led through motions, and what was found is written.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use docktwin::rigfile::{CalibrationFile, DOFS, IdentificationFile, Origin, RigFile, write};
use docktwin_control::{feedforward::LegCorrections, rig::RigSetup, safety::SafetyLimits};
use docktwin_core::{Digest, Pose};
use docktwin_hil::{
    calibrate::{CalibrateSetup, Touch, calibrate as calibrated},
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    drive::{Drive, DriveSetup},
    identify::{FREQUENCIES_HZ, IdentifySetup, identify as identified},
    realtime::relax,
};
use docktwin_rigport::{in_process::InProcess, rig::Rig};

use super::{CalibrateArgs, IdentifyArgs, MeasureArgs, Stand};
use crate::{
    cli::ClockArg,
    failure::Failure,
    rigs::{LedArgs, PERIOD_NS, RigPlace, confirm, connect, identification, new_session, patience},
};

/// From place to place, m/s and rad/s.
const MOVE: [f64; 2] = [0.1, 0.05];
/// By how much sensor A may change before the drive is stopped, N.
const TOUCHED_N: f64 = 50.0;
const TOUCH_N: f64 = 500.0;
/// Tilt of a mechanism that has room, and of a stick in its frame, rad.
const TILT_RAD: f64 = 0.08;
const STICK_TILT_RAD: f64 = 0.012;
/// How often a touch is made, Hz.
const TOUCH_HZ: f64 = 2.0;

fn failed(e: &dyn core::fmt::Display) -> Failure {
    Failure::Usage {
        what: e.to_string(),
        remedy: "the rig was stopped, and nothing was written".to_owned(),
    }
}

/// What is done with a rig on the lead.
pub(super) trait Work {
    type Found;
    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Self::Found, Failure>;
}

/// Takes a rig over, does the work by the clock that was asked for, and lets the rig go.
pub(super) fn lead<R: Rig, W: Work>(
    rig: R,
    led: &LedArgs,
    setup: DriveSetup,
    work: &W,
) -> Result<W::Found, Failure> {
    match led.clock {
        ClockArg::Virtual => with_clock(rig, VirtualClock::new(PERIOD_NS), setup, work),
        ClockArg::Realtime => {
            led.realtime.apply_aloud()?;
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
) -> Result<W::Found, Failure> {
    let setup = DriveSetup { patience: patience::<K>(), ..setup };
    let mut drive = Drive::start(setup, rig, clock).map_err(|e| failed(&e))?;
    let found = work.work(&mut drive)?;
    drive.finish().map_err(|e| failed(&e))?;
    Ok(found)
}

/// A rig and where it is measured.
struct Task<'a> {
    args: &'a MeasureArgs,
    stand: Stand,
    place: Pose,
    corrections: LegCorrections,
    may_change_n: f64,
}

impl<'a> Task<'a> {
    fn new(args: &'a MeasureArgs) -> Result<Self, Failure> {
        let stand = Stand::load(&args.model, &args.built)?;
        let mut place = stand.clear();
        if let Some(mm) = args.at_x_mm {
            place.p.x = stand.rig.docking.middle_m.x + mm * 1e-3;
        }
        let corrections = LegCorrections::default();
        Ok(Self { args, stand, place, corrections, may_change_n: TOUCHED_N })
    }

    fn believed(&self) -> RigSetup {
        RigSetup::of_rig(&self.stand.rig, self.stand.preset, None)
    }

    fn run<W: Work>(&self, work: &W) -> Result<W::Found, Failure> {
        confirm(&self.args.rig, self.args.led.yes)?;
        let rig = &self.stand.rig;
        let setup = DriveSetup {
            rig: rig.clone(),
            feedforward: RigSetup::of_rig(rig, self.stand.preset, None).feedforward(),
            corrections: self.corrections,
            limits: SafetyLimits::of_rig(rig, self.may_change_n, f64::INFINITY),
            speed: MOVE,
            session: new_session(),
            patience: Duration::ZERO,
        };
        match &self.args.rig {
            RigPlace::Emulated => {
                let plant = self.stand.emulated(&self.args.built, &self.place)?;
                lead(InProcess::new(plant), &self.args.led, setup, work)
            }
            RigPlace::Port(name) => lead(connect(name)?, &self.args.led, setup, work),
        }
    }

    fn origin(&self) -> Origin {
        let a = self.args;
        let port = a.rig.to_string();
        let mut o = Origin::now(&self.stand.rig, self.stand.preset, &port, &self.place);
        if a.rig == RigPlace::Emulated {
            (o.seed, o.perturb) = (Some(a.built.seed), a.built.perturb);
        }
        o
    }

    /// Writes the file and tells where it is.
    fn finish<T: RigFile>(
        &self,
        content: &T,
        words: &[String],
        json: bool,
    ) -> Result<ExitCode, Failure> {
        let path = self.args.out.clone().unwrap_or_else(|| {
            let now = jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ");
            let name = format!("{}-{}-{now}.toml", self.stand.rig.name, T::COMMAND);
            Path::new("calibrations").join(name)
        });
        let digest = write(&path, content)?;
        tell(content, &path, digest, words, json);
        Ok(ExitCode::SUCCESS)
    }
}

fn tell<T: RigFile>(content: &T, path: &PathBuf, digest: Digest, words: &[String], json: bool) {
    if json {
        println!(
            "{}",
            serde_json::json!({ "file": path, "digest": digest.to_string(), "found": content })
        );
        return;
    }
    words.iter().for_each(|l| println!("{l}"));
    println!("written      {}, digest {digest}", path.display());
}

impl Work for IdentifySetup {
    type Found = docktwin_hil::identify::Identification;

    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Self::Found, Failure> {
        identified(drive, self).map_err(|e| failed(&e))
    }
}

impl Work for CalibrateSetup {
    type Found = docktwin_hil::calibrate::Calibration;

    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Self::Found, Failure> {
        calibrated(drive, self).map_err(|e| failed(&e))
    }
}

/// Runs `rig identify`.
pub(super) fn identify(args: &IdentifyArgs, json: bool) -> Result<ExitCode, Failure> {
    let mut task = Task::new(&args.measure)?;
    let lever_m = task
        .stand
        .system
        .mechanism()
        .stick
        .map_or(task.believed().platform.plate_radius_m(), |s| s.lever_m);
    task.stand.free_the_stick();
    let dofs = if args.dof.is_empty() {
        (0..6).collect()
    } else {
        args.dof.iter().map(|d| *d as usize).collect()
    };
    let setup = IdentifySetup {
        legs: task.believed().believed_legs,
        place: task.place,
        room_m: args.room_mm * 1e-3,
        dofs,
        hz: FREQUENCIES_HZ.to_vec(),
        lever_m,
    };
    let found = task.run(&setup)?;
    let mut words = vec![format!(
        "delay        {:.3} ms from the instant a command is for to the plate ({:.3} ms before \
         corrections)",
        found.delay_s() * 1e3,
        found.found.lag_s * 1e3
    )];
    for i in 0..6 {
        let (a, b) = (&found.found, &found.corrected);
        words.push(format!(
            "leg {i}        null bias {:+.4} % of stroke, flow gain {:.4}, friction {:.0} N; at standstill {:+.1} um, \
             corrected {:+.1} um",
            a.null_bias[i] * 100.0,
            a.flow_gain[i],
            a.friction_n[i],
            a.hold_error_m[i] * 1e6,
            b.hold_error_m[i] * 1e6
        ));
    }
    for p in &found.response {
        words.push(format!(
            "{:<5} {:>6.3} Hz  |G| {:.4}, {:+.2} deg, coupling {:.3}",
            DOFS[p.dof],
            p.hz,
            p.gain.norm(),
            p.gain.arg().to_degrees(),
            p.coupling
        ));
    }
    task.finish(&IdentificationFile::new(task.origin(), &found), &words, json)
}

/// Runs `rig calibrate`.
pub(super) fn calibrate(args: &CalibrateArgs, json: bool) -> Result<ExitCode, Failure> {
    let mut task = Task::new(&args.measure)?;
    let sensors = task.stand.rig.sensors.ok_or_else(|| Failure::Usage {
        what: "the rig has no table [sensors]".to_owned(),
        remedy: "add one; models/urdf/stewart.toml is an example".to_owned(),
    })?;
    let mut setup = CalibrateSetup::at(task.place, sensors);
    setup.tilt_rad = if task.stand.has_stick() { STICK_TILT_RAD } else { TILT_RAD };
    if let Some(mm) = args.touch_mm {
        if !task.stand.has_stick() {
            return Err(Failure::Usage {
                what: "only a light stick can be touched for this".to_owned(),
                remedy: "give a scenario with a stick, scenarios/vibro_impact.toml is one"
                    .to_owned(),
            });
        }
        setup.touch = Some(Touch { dof: 1, amplitude_m: mm * 1e-3, hz: TOUCH_HZ });
        task.may_change_n = TOUCH_N;
    }
    if let Some(path) = &args.identification {
        task.corrections = identification(path, &task.stand.rig)?.1.corrections();
    }
    let found = task.run(&setup)?;
    let (p, c) = (&found.payload, found.payload.com_m);
    let i = p.inertia_kg_m2.to_cols_array_2d();
    let us = |s: f64| s * 1e6;
    let mut words = vec![
        format!(
            "B carries    {:.3} kg, mass centre ({:.4}, {:.4}, {:.4}) m",
            p.mass_kg, c.x, c.y, c.z
        ),
        format!("             inertia {:.2}, {:.2}, {:.2} kg m2", i[0][0], i[1][1], i[2][2]),
        format!(
            "zero of B    ({:.2}, {:.2}, {:.2}) N, ({:.2}, {:.2}, {:.2}) N m",
            found.zero_b.f.x,
            found.zero_b.f.y,
            found.zero_b.f.z,
            found.zero_b.m.x,
            found.zero_b.m.y,
            found.zero_b.m.z
        ),
        format!(
            "tare of A    ({:.2}, {:.2}, {:.2}) N",
            found.tare_a.f.x, found.tare_a.f.y, found.tare_a.f.z
        ),
        format!("unexplained  {:.3} N, {:.3} N m", found.rest[0], found.rest[1]),
    ];
    for (name, delay) in [("A", found.delay_s[0]), ("B", found.delay_s[1])] {
        words.push(delay.map_or_else(
            || format!("delay of {name}   not looked at: it needs a touch (--touch-mm)"),
            |s| format!("delay of {name}   {:.1} us behind positions of the same stamp", us(s)),
        ));
    }
    if let Some(s) = found.accelerometer_delay_s {
        words.push(format!("accelerometers {:.1} us behind positions of the same stamp", us(s)));
    }
    task.finish(&CalibrationFile::new(task.origin(), &found), &words, json)
}
