//! A rig that is driven through motions with nothing in its way: what identification and calibration
//! share. It has a session of its own, the clock it is given, and its own supervisor; an emulated
//! rig and a physical rig are driven alike.

use core::time::Duration;

use docktwin_control::{
    feedforward::{Feedforward, LegCorrections, MotionError, PlateMotion},
    planner::Move,
    safety::{SafetyLimits, Supervisor, Trip, Watched, half_widths},
};
use docktwin_core::{Pose, Wrench};
use docktwin_model::Rig as RigModel;
use docktwin_physics::{platform::Platform, programme::RelativeMotion};
use docktwin_rigport::{
    guard::Guard,
    message::{Capabilities, RigCommand, RigMeasurement, RigMode, Status, wrench},
    rig::{Rig, RigError},
};

use crate::{
    clock::Clock,
    commands::{Form, Motion, guard, largest, least, still, write_motion},
};

/// What a drive needs.
#[derive(Clone, Debug)]
pub struct DriveSetup {
    /// The rig as its file says.
    pub rig: RigModel,
    /// What every leg is commanded, by what is believed of them.
    pub feedforward: Feedforward,
    /// What was identified of every leg before and is to be undone.
    pub corrections: LegCorrections,
    /// What ends the drive; the force is that by which sensor A may change: nothing is to touch.
    pub limits: SafetyLimits,
    /// Fastest move from place to place, m/s and rad/s.
    pub speed: [f64; 2],
    /// Number of this session at the port, not 0.
    pub session: u64,
    /// How long to wait for a measurement: in lockstep the rig's time, else next to nothing.
    pub patience: Duration,
}

/// Why a drive ended.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// The rig does not answer, or the connection is broken.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// It does not get ready.
    #[error("the rig does not get ready: clear its fault, release its emergency stop, reset it")]
    NotReady,
    /// It takes none of the commands of a drive, or lacks a required sensor.
    #[error(
        "the rig takes neither the values of six legs nor the plate's pose, or has no sensor A: see the \
         capability bits of the protocol page"
    )]
    Interface,
    /// It stands in no pose.
    #[error(
        "the leg lengths belong to no pose, or neither lengths nor a pose are measured: check the length \
         sensors and the rig's file"
    )]
    Pose,
    /// The motion cannot be commanded.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// Drawing back does not part the mechanisms.
    #[error(
        "the mechanisms are not parted: open the latches by hand, and see what holds the rig back"
    )]
    Joined,
    /// Drawing back has no end.
    #[error("the rig goes on drawing back and does not come to rest: see its own controller")]
    Restless,
    /// A limit was passed.
    #[error(
        "the rig was stopped: {} reached {:.4}, allowed is {:.4}; fix the cause, or take a place \
         and an amplitude with more room", .0.limit.name(), .0.value, .0.allowed
    )]
    Trip(Trip),
}

/// A measurement of a motion.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Its instant, s since the motion's begin.
    pub time_s: f64,
    /// `X_34` from the measured lengths.
    pub x_34: Pose,
    /// All of it.
    pub measurement: RigMeasurement,
}

/// Ticks in which a rig must have become ready.
const READY_TICKS: u32 = 500;
/// Sessions begun before a rig counts as not ready: it may have reset itself in the first.
const SESSIONS: u32 = 3;
/// Ticks of rest before, and of stopping after.
const REST_TICKS: u32 = 20;
const STOP_TICKS: u32 = 300;
/// Ticks in which a retraction must have ended, after how many it is looked at again, and how many looks
/// it may rest with the mechanisms joined.
const RETRACT_TICKS: u32 = 60_000;
const RETRACT_LOOK: u32 = 1000;
const RETRACT_HELD: u32 = 10;
/// Way between two looks of a rig at rest, m.
const RETRACT_RESTS_M: f64 = 2e-4;
/// Commanded poses kept for the tracking error: the command before last is of the present instant.
const PAST: usize = 3;

/// A rig that is driven.
#[derive(Debug)]
pub struct Drive<R, K> {
    setup: DriveSetup,
    platform: Platform,
    rig: R,
    clock: K,
    supervisor: Supervisor,
    tick: u64,
    /// Where it is commanded to be at rest.
    at: Pose,
    x_bp: Pose,
    past: [Pose; PAST],
    last: RigMeasurement,
    /// Sensor A before the first motion.
    untouched: Option<Wrench>,
    form: Form,
    guard: Guard,
    without: u32,
}

fn seconds(ns: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "hours are far below 2^53 ns")]
    let s = ns as f64 * 1e-9;
    s
}

impl<R: Rig, K: Clock> Drive<R, K> {
    /// Takes the rig over: idle, then holding, until it is ready.
    ///
    /// # Errors
    /// It does not answer or does not get ready.
    pub fn start(setup: DriveSetup, rig: R, clock: K) -> Result<Self, DriveError> {
        let platform = setup.feedforward.platform().clone();
        let x_bp = platform.middle();
        let mut out = Self {
            supervisor: Supervisor::new(setup.limits),
            at: platform.docking_from_plate(&x_bp),
            setup,
            platform,
            rig,
            clock,
            tick: 0,
            x_bp,
            past: [x_bp; PAST],
            last: RigMeasurement::zero(),
            untouched: None,
            form: Form::Legs,
            guard: Guard::NONE,
            without: 0,
        };
        out.clock.start();
        for _ in 0..SESSIONS {
            if out.gets_ready()? {
                out.form = Form::of(&out.last).ok_or(DriveError::Interface)?;
                out.look()?;
                out.at = out.platform.docking_from_plate(&out.x_bp);
                out.past = [out.x_bp; PAST];
                out.untouched = Some(wrench(&out.last.sensor_a));
                let s = &out.setup;
                out.guard = guard(&s.rig, &s.limits, out.last.capabilities, out.untouched);
                return Ok(out);
            }
            // A rig leaves its safe state with a new session only.
            out.setup.session += 1;
        }
        Err(if out.last.session == 0 { RigError::Gone.into() } else { DriveError::NotReady })
    }

    /// Idle, then holding, until the rig has been ready for a while.
    fn gets_ready(&mut self) -> Result<bool, DriveError> {
        let mut ready = 0;
        for i in 0..READY_TICKS {
            let mode = if i < REST_TICKS { RigMode::Idle } else { RigMode::Hold };
            let fresh = self.still(mode)?;
            let fit = self.last.is(Status::ENABLED) && !self.left();
            ready = if fresh && fit && i > REST_TICKS { ready + 1 } else { 0 };
            if ready > REST_TICKS {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The set-up.
    pub const fn setup(&self) -> &DriveSetup {
        &self.setup
    }

    /// The kinematics that it believes in.
    pub const fn platform(&self) -> &Platform {
        &self.platform
    }

    /// What the legs are corrected by from now on.
    pub const fn correct(&mut self, corrections: LegCorrections) {
        self.setup.corrections = corrections;
    }

    /// What the rig takes and measures, as its last measurement says.
    #[must_use]
    pub const fn capabilities(&self) -> Capabilities {
        self.last.capabilities
    }

    fn left(&self) -> bool {
        let left = Status::SAFE_STATE | Status::EMERGENCY_STOP | Status::LIMIT_SWITCH;
        self.last.status.intersects(left)
    }

    fn blank(&self, mode: RigMode, due_ns: u64) -> RigCommand {
        let mut c = still(&self.clock, mode, self.setup.session, self.tick, due_ns);
        self.guard.write(&mut c);
        c
    }

    /// Waits for the next tick and takes what there is: when it was due, and whether there was
    /// anything.
    fn next(&mut self) -> Result<(u64, bool), DriveError> {
        let w = self.clock.wait();
        self.tick += w.missed;
        let fresh = match self.rig.receive(self.setup.patience, self.clock.now_ns()) {
            Ok(Some(m)) => {
                self.last = m;
                true
            }
            Ok(None) | Err(RigError::Refused(_) | RigError::Gone) => false,
            Err(e) => return Err(e.into()),
        };
        self.without = if fresh { 0 } else { self.without + 1 };
        Ok((w.due_ns, fresh))
    }

    fn send(&mut self, c: &RigCommand) -> Result<(), DriveError> {
        self.rig.send(c)?;
        self.tick += 1;
        Ok(())
    }

    /// A tick without motion.
    fn still(&mut self, mode: RigMode) -> Result<bool, DriveError> {
        let (due_ns, fresh) = self.next()?;
        let c = self.blank(mode, due_ns);
        self.send(&c)?;
        Ok(fresh)
    }

    fn command(&mut self, motion: &RelativeMotion, due_ns: u64) -> Result<RigCommand, DriveError> {
        let m = motion;
        let rates = [m.twist, m.acceleration, m.jerk];
        let plate = PlateMotion::of_docking(&self.platform, &m.x_34, &rates);
        let legs = self.setup.feedforward.command(&plate)?.legs;
        let mut out = self.blank(RigMode::Track, due_ns);
        let times = self.setup.feedforward.path_times();
        let motion = Motion { legs, arrival: plate, external: Wrench::ZERO };
        write_motion(&mut out, self.form, &motion, &self.setup.corrections, times);
        self.past.rotate_right(1);
        self.past[0] = plate.x_bp;
        Ok(out)
    }

    /// Finds the plate in the last measurement.
    fn look(&mut self) -> Result<(), DriveError> {
        let found = if self.last.has(Capabilities::LEG_LENGTH) {
            self.platform.forward(&self.last.leg_length_m, &self.x_bp).ok().map(|f| f.x_bp)
        } else {
            self.last.plate()
        };
        self.x_bp = found.ok_or(DriveError::Pose)?;
        Ok(())
    }

    fn judge(&mut self, watched: &Watched) -> Result<(), DriveError> {
        self.supervisor.judge(watched, self.tick).map_or(Ok(()), |t| Err(DriveError::Trip(t)))
    }

    fn watched(&self) -> Watched {
        let m = &self.last;
        let apart = self.past[1].inverse() * self.x_bp;
        let turned = apart.q.to_scaled_axis().length() * self.platform.plate_radius_m();
        let legs = |bit, x: &[f64; 6]| m.has(bit).then_some(*x);
        let lengths = legs(Capabilities::LEG_LENGTH, &m.leg_length_m)
            .unwrap_or_else(|| self.platform.at(&self.x_bp).length_m);
        let speeds = legs(Capabilities::LEG_SPEED, &m.leg_speed_m_s)
            .or_else(|| m.plate_twist().map(|t| self.platform.at(&self.x_bp).rates(&t)));
        let changed = self.untouched.map_or(0.0, |w| (wrench(&m.sensor_a).f - w.f).length());
        Watched {
            stroke_margin_m: least(&self.platform.stroke_margins_m(&lengths)),
            leg_speed_m_s: speeds.map_or(0.0, |v| largest(&v)),
            leg_force_n: legs(Capabilities::LEG_FORCE, &m.leg_force_n).map(|f| largest(&f)),
            port_force_n: changed,
            port_moment_nm: 0.0,
            pose_half_widths: half_widths(
                &self.setup.rig,
                &self.platform.docking_from_plate(&self.x_bp),
            ),
            tracking_error_m: apart.p.length().max(turned),
            ticks_without: self.without,
            rig_left: self.left() || !m.is(Status::ENABLED),
            saturated: m.status.intersects(Status::SENSOR_A_SATURATED | Status::SENSOR_B_SATURATED),
            // Whether a sensor is alive is what is being found out.
            ticks_frozen: 0,
            energy_gained: None,
        }
    }

    /// Drives the rig along `motion` (by its own time, s) for `duration_s`, and gives every measurement
    /// to `take`. It must begin where the rig was left, and end at rest. On an error the rig is
    /// stopped.
    ///
    /// # Errors
    /// See [`DriveError`].
    pub fn run(
        &mut self,
        duration_s: f64,
        motion: impl Fn(f64) -> RelativeMotion,
        mut take: impl FnMut(&Sample),
    ) -> Result<(), DriveError> {
        let done = self.lead(duration_s, &motion, &mut take);
        if done.is_err() {
            // The first error is returned, not one of the stop.
            let _ = self.halt();
        }
        done
    }

    fn lead(
        &mut self,
        duration_s: f64,
        motion: &impl Fn(f64) -> RelativeMotion,
        take: &mut impl FnMut(&Sample),
    ) -> Result<(), DriveError> {
        let mut start = None;
        loop {
            let (due_ns, fresh) = self.next()?;
            let start_ns = *start.get_or_insert(due_ns);
            if fresh {
                self.look()?;
            }
            self.judge(&self.watched())?;
            if fresh && self.last.stamp_ns >= start_ns {
                take(&Sample {
                    time_s: seconds(self.last.stamp_ns - start_ns),
                    x_34: self.platform.docking_from_plate(&self.x_bp),
                    measurement: self.last,
                });
            }
            // The command is for the next tick.
            let time_s = seconds(due_ns + self.clock.period_ns() - start_ns);
            let m = motion(time_s.min(duration_s));
            let c = self.command(&m, due_ns)?;
            self.send(&c)?;
            self.at = m.x_34;
            if time_s > duration_s {
                return Ok(());
            }
        }
    }

    /// Slowly to a place.
    ///
    /// # Errors
    /// See [`DriveError`].
    pub fn go(&mut self, to: &Pose) -> Result<(), DriveError> {
        let way = Move::new(&self.at, to, self.setup.speed[0], self.setup.speed[1]);
        self.run(way.duration_s, |t| way.at(t), |_| ())
    }

    /// Stays where it is.
    ///
    /// # Errors
    /// See [`DriveError`].
    pub fn rest(&mut self, duration_s: f64, take: impl FnMut(&Sample)) -> Result<(), DriveError> {
        let x_34 = self.at;
        self.run(duration_s, |_| RelativeMotion { x_34, ..RelativeMotion::default() }, take)
    }

    /// Lets the rig draw back by itself until it rests; where it then stands, `X_34`.
    ///
    /// # Errors
    /// See [`DriveError`].
    pub fn retract(&mut self) -> Result<Pose, DriveError> {
        let done = self.draw_back();
        if done.is_err() {
            let _ = self.halt();
        }
        done
    }

    fn draw_back(&mut self) -> Result<Pose, DriveError> {
        let (mut was, mut held) = (self.x_bp, 0);
        for i in 1..=RETRACT_TICKS {
            if self.still(RigMode::Retract)? {
                self.look()?;
            }
            // No pose is commanded, so there is no tracking error; and a run may have ended outside
            // the workspace.
            let watched =
                Watched { tracking_error_m: 0.0, pose_half_widths: 0.0, ..self.watched() };
            self.judge(&watched)?;
            if i % RETRACT_LOOK == 0 {
                let moved = was.inverse() * self.x_bp;
                let turned_m = moved.q.to_scaled_axis().length() * self.platform.plate_radius_m();
                was = self.x_bp;
                // It begins gently, and latches take their time to open.
                if i > 2 * RETRACT_LOOK && moved.p.length().max(turned_m) < RETRACT_RESTS_M {
                    if !self.last.is_held() {
                        self.past = [self.x_bp; PAST];
                        self.at = self.platform.docking_from_plate(&self.x_bp);
                        return Ok(self.at);
                    }
                    held += 1;
                    if held == RETRACT_HELD {
                        return Err(DriveError::Joined);
                    }
                }
            }
        }
        Err(if self.last.is_held() { DriveError::Joined } else { DriveError::Restless })
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        for i in 0..STOP_TICKS {
            let mode = if i + REST_TICKS < STOP_TICKS { RigMode::Stop } else { RigMode::Idle };
            self.still(mode)?;
        }
        Ok(())
    }

    /// Brings the rig to rest and ends the session.
    ///
    /// # Errors
    /// The connection is broken.
    pub fn finish(mut self) -> Result<(R, K), DriveError> {
        self.halt()?;
        Ok((self.rig, self.clock))
    }
}
