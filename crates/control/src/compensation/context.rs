//! What the loop knows in a tick, as a compensator gets it.

use docktwin_core::{DVec3, Pose, Wrench};
use docktwin_physics::{
    mounted::Ports,
    programme::{Programme, RelativeMotion},
    reduced::Inputs,
};

use crate::feedforward::{PathTimes, PlateMotion};

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// To the beginning of the run-up.
    Move = 0,
    /// At rest there.
    Settle = 1,
    /// Along the free flight to the initial condition.
    RunUp = 2,
    /// The dynamics loop is closed.
    Closed = 3,
    /// Coming to rest.
    Stop = 4,
}

impl Phase {
    /// Name in events.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Move => "move",
            Self::Settle => "settle",
            Self::RunUp => "run_up",
            Self::Closed => "closed",
            Self::Stop => "stop",
        }
    }
}

/// The last measurement, in the loop's own terms. What a rig does not measure is `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Whether it is of this tick; without a measurement of its own a tick has the last one there was.
    pub fresh: bool,
    /// How long before `t_k` its samples were taken, s.
    pub age_s: f64,
    /// Sensor A as read: about its origin, in its axes, weight and zero included.
    pub sensor_a: Option<Wrench>,
    /// Sensor B as read.
    pub sensor_b: Option<Wrench>,
    /// Accelerometers beside B: specific force, m/s², and angular acceleration, rad/s².
    pub accelerometer: Option<[DVec3; 2]>,
    /// Lengths from joint to joint, m.
    pub leg_length_m: Option<[f64; 6]>,
    /// Their rates, m/s.
    pub leg_speed_m_s: Option<[f64; 6]>,
    /// Forces of the drives on the rods, N, pushing positive.
    pub leg_force_n: Option<[f64; 6]>,
    /// Openings of the valves, parts of full stroke.
    pub valve_spool: Option<[f64; 6]>,
    /// Displacement (m) and rotation vector (rad) of the ring from rest, in `e3`.
    pub ring: Option<[DVec3; 2]>,
    /// Phases of the latches, 0 free to 3 latched; `None` beyond those that report.
    pub latches: [Option<u32>; super::LATCHES],
    /// Whether the rings are joined.
    pub joined: Option<bool>,
    /// The plate, `X_bp`: from the leg lengths, or as the rig measures it.
    pub x_bp: Pose,
    /// The mechanisms, `X_34`, from it.
    pub x_34: Pose,
}

impl Measured {
    /// Nothing measured yet, the plate at `x_bp`.
    #[must_use]
    pub const fn none(x_bp: Pose, x_34: Pose) -> Self {
        Self {
            fresh: false,
            age_s: 0.0,
            sensor_a: None,
            sensor_b: None,
            accelerometer: None,
            leg_length_m: None,
            leg_speed_m_s: None,
            leg_force_n: None,
            valve_spool: None,
            ring: None,
            latches: [None; super::LATCHES],
            joined: None,
            x_bp,
            x_34,
        }
    }
}

/// What the loop knows in a tick.
#[derive(Clone, Copy, Debug)]
pub struct LoopContext<'a> {
    /// Tick since the start of the loop: `t_k` is `tick` periods later.
    pub tick: u64,
    /// Period of the loop, s.
    pub period_s: f64,
    /// Where the run is.
    pub phase: Phase,
    /// Both spacecraft; at the initial condition until the loop is closed.
    pub bodies: &'a Programme,
    /// Motion of `e4` against `e3` at `t_k`, as the bodies (before closing, the plan) have it.
    pub motion: &'a RelativeMotion,
    /// Control wrenches held from `t_k`, each about the mass centre of its spacecraft, in its axes.
    pub control: &'a Inputs,
    /// The measurement of `t_k`.
    pub measured: &'a Measured,
    /// Wrenches at both ports from it: tared, less weight and inertia of what the sensors carry.
    pub ports: &'a Ports,
    /// Motions of the plate that were commanded, newest first: the first is for `t_k`, each further one a
    /// tick earlier.
    pub in_flight: &'a [PlateMotion],
    /// By how much later than the pose the other paths of a command arrive.
    pub paths: PathTimes,
}
