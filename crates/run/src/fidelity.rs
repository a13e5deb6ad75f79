//! How near a run against a rig comes to the simulated system: the same spacecraft, the mechanism that the
//! rig has, the same start and control wrenches, no rig (§8).
//!
//! Two comparisons, and both matter. *Felt*: the wrench that the bodies' programme receives, and the motion
//! that it makes of it; that is the truth of the simulation. *Hardware*: the true wrench on the article on
//! the rig, and the true relative pose of its halves; that is what the test does to the article. The latter
//! is known of emulated rigs only.
//!
//! Each is laid over the simulated system at its own first contact, interpolated below the tick: a shift of
//! 1 ms alone would be 1 to 3 % of the force. With a lead the hardware touches early by the lag of the sensor
//! that the lead makes up for, while what is felt is in time.
//!
//! The simulated system runs beside the loop's record tick by tick, and everything is summed as it comes:
//! nothing of a run's length is kept. This is the only place that says what a figure of fidelity means;
//! `docs/summary.md` has the same in a table.

mod figures;
mod first_contact;
mod latches;

use std::collections::VecDeque;

use docktwin_core::{CONTACT_GAP_NS, DVec3, PERIOD_NS, Pose, SimTime, Tick, Twist, Wrench};
use docktwin_hil::scheduler::TickRecord;
use docktwin_model::Rig;
use docktwin_physics::{
    body::BodyState,
    mechanism::{CHASER, LatchPhase, System, TARGET},
    reduced::Inputs,
};
use docktwin_record::Fidelity;
use docktwin_rigport::message::{Capabilities, wrench};

use crate::{
    telemetry::port_speed,
    twin::{TickedTwin, TwinKind},
};

use figures::{When, Windows};
use first_contact::FirstContact;
use latches::{LatchTimes, RigLatches};

/// Steps of the simulated system in a tick of 1 ms, as the reduced twin has by default.
const STEPS: u32 = 10;
/// Ticks that a contact may be interrupted for.
const GAP_TICKS: usize = (CONTACT_GAP_NS / PERIOD_NS) as usize;
/// First contacts further apart than so many ticks are not compared.
const MOST_APART: usize = 60_000;
/// Simulated contacts shorter than so many ticks have no R_T: an edge is known to a part of a tick, and one
/// tick is 5 % of them.
const SHORTEST_TICKS: f64 = 20.0;
/// How long after the capture of the simulated system the window `to_capture` goes on, s.
const AFTER_CAPTURE_S: f64 = 1.0;

/// One side of the port at one instant: what is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PortState {
    /// F4, M4 on the target, in `e4`, N and N·m.
    pub wrench: Wrench,
    /// `X_34`.
    pub x_34: Pose,
    /// Motion of `e4` against `e3`, in `e4`, m/s and rad/s.
    pub twist: Twist,
}

impl PortState {
    /// Power that the port gives the relative motion, W.
    fn power_w(&self) -> f64 {
        self.wrench.f.dot(self.twist.v) + self.wrench.m.dot(self.twist.w)
    }

    /// Between two neighbouring ticks.
    fn between(a: &Self, b: &Self, part: f64) -> Self {
        let mix = |x: DVec3, y: DVec3| x + (y - x) * part;
        Self {
            wrench: Wrench { f: mix(a.wrench.f, b.wrench.f), m: mix(a.wrench.m, b.wrench.m) },
            x_34: Pose::new(mix(a.x_34.p, b.x_34.p), a.x_34.q.slerp(b.x_34.q, part)),
            twist: Twist { v: mix(a.twist.v, b.twist.v), w: mix(a.twist.w, b.twist.w) },
        }
    }
}

/// One tick of either side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trace {
    /// What the bodies' programme receives, and its motion; of the simulated system the truth.
    pub felt: PortState,
    /// The truth of the article on the rig, where the rig reports it; of the simulated system as `felt`.
    pub hardware: Option<PortState>,
    /// Relative speed of the ports, m/s.
    pub speed_m_s: f64,
    /// Kinetic energy of both spacecraft, J.
    pub kinetic_j: f64,
}

impl Trace {
    /// The better known of both, by which contacts are recognised.
    #[must_use]
    pub fn truest(&self) -> &PortState {
        self.hardware.as_ref().unwrap_or(&self.felt)
    }
}

fn kinetic(system: &System, bodies: &[BodyState; 2]) -> f64 {
    [CHASER, TARGET].into_iter().zip(bodies).map(|(k, b)| b.kinetic_energy(&system.mass()[k])).sum()
}

/// `X_34` of two bodies and the motion of `e4` against `e3`, in `e4`.
fn relative(system: &System, bodies: &[BodyState; 2]) -> (Pose, Twist) {
    let [x_13, x_24] = system.ports();
    let x_w4 = bodies[1].pose() * x_24;
    let x_34 = (bodies[0].pose() * x_13).inverse() * x_w4;
    let mass = system.mass();
    let at = |i: usize, k: usize| {
        let t = bodies[i].twist(&mass[k]);
        Twist { v: t.v + t.w.cross(x_w4.p - bodies[i].p), w: t.w }
    };
    let (c, t) = (at(0, CHASER), at(1, TARGET));
    let back = x_w4.q.conjugate();
    (x_34, Twist { v: back * (t.v - c.v), w: back * (t.w - c.w) })
}

/// The article on the rig as it really is.
fn article(rig: &Rig, r: &TickRecord) -> Option<PortState> {
    let m = &r.measurement;
    m.has(Capabilities::TRUTH).then(|| {
        let [w, x, y, z] = m.truth_attitude;
        let q = docktwin_core::DQuat::from_xyzw(x, y, z, w);
        let x_bp = Pose::new(DVec3::from_array(m.truth_position_m), q);
        let x_b4 = x_bp * rig.x_4p.inverse();
        let t = wrench(&m.truth_twist);
        let (v, w) = (t.f + t.m.cross(x_b4.p - x_bp.p), t.m);
        let back = x_b4.q.conjugate();
        PortState {
            wrench: wrench(&m.truth_port4),
            x_34: rig.docking_from_plate(&x_bp),
            twist: Twist { v: back * v, w: back * w },
        }
    })
}

/// What a tick of the loop leaves behind.
#[must_use]
pub fn trace(system: &System, rig: &Rig, r: &TickRecord) -> Trace {
    let (x_34, twist) = relative(system, &r.bodies);
    let corrected = r.correction.map_or(Wrench::ZERO, |c| c.port4);
    Trace {
        felt: PortState { wrench: r.ports.port4 + corrected, x_34, twist },
        hardware: article(rig, r),
        speed_m_s: port_speed(system, &r.bodies),
        kinetic_j: kinetic(system, &r.bodies),
    }
}

/// What the simulated system is at the beginning of a tick, over which it is then stepped.
fn simulated(twin: &mut TickedTwin, time_s: f64, control: &Inputs) -> (Trace, LatchTimes) {
    let now = twin.instant(time_s);
    let system = twin.twin().system();
    let pair = [now.state.bodies[CHASER], now.state.bodies[TARGET]];
    let (x_34, twist) = relative(system, &pair);
    let port = PortState { wrench: now.port4, x_34, twist };
    let out = Trace {
        felt: port,
        hardware: Some(port),
        speed_m_s: port_speed(system, &pair),
        kinetic_j: kinetic(system, &pair),
    };
    let latched = now.state.mechanism.latches.map(|l| l.times_s[LatchPhase::Latched as usize - 1]);
    twin.tick(control);
    (out, LatchTimes { latched_s: latched })
}

/// One comparison: both sides from their first contacts on.
#[derive(Clone, Debug, Default)]
struct Aligned {
    hil: FirstContact,
    sim: FirstContact,
    /// Ticks of the loop not yet paired, and the tick of the first of them.
    hil_ticks: VecDeque<PortState>,
    hil_first: usize,
    sim_ticks: VecDeque<PortState>,
    sim_first: usize,
    too_far: bool,
    windows: Windows,
}

impl Aligned {
    /// Takes a tick of both sides in.
    fn add(
        &mut self,
        hil: (&PortState, f64),
        sim: (&PortState, f64),
        latches: &LatchTimes,
        start_j: f64,
    ) {
        let tick = self.hil.ticks();
        self.hil.add(hil.0, hil.1);
        self.sim.add(sim.0, sim.1);
        if self.too_far {
            return;
        }
        // Both keep one tick before their first contact: between it and the next the contact begins.
        for (queue, first, state, on) in [
            (&mut self.hil_ticks, &mut self.hil_first, hil.0, self.hil.touched()),
            (&mut self.sim_ticks, &mut self.sim_first, sim.0, self.sim.touched()),
        ] {
            if !on {
                queue.clear();
            }
            if queue.is_empty() {
                *first = tick;
            }
            queue.push_back(*state);
        }
        if self.hil_ticks.len().max(self.sim_ticks.len()) > MOST_APART {
            self.too_far = true;
            (self.hil_ticks, self.sim_ticks) = Default::default();
        }
        if let [Some(h), Some(s)] = [self.hil.begin(), self.sim.begin()] {
            self.pair(h - s, s, latches, start_j);
        }
    }

    /// Pairs what can be paired: the simulated tick k with the loop's k + `shift`, from the simulated first
    /// contact at `from` on.
    fn pair(&mut self, shift: f64, from: f64, latches: &LatchTimes, start_j: f64) {
        while let Some(sim) = self.sim_ticks.front().copied() {
            #[expect(clippy::cast_precision_loss, reason = "ticks")]
            let (k, first) = (self.sim_first as f64, self.hil_first as f64);
            let at = k + shift - first;
            // Below 0 by rounding at the very edge alone.
            if k >= from && at >= 0.0 {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "≥ 0")]
                let i = at as usize;
                let [Some(a), Some(b)] = [self.hil_ticks.get(i), self.hil_ticks.get(i + 1)] else {
                    return;
                };
                let when = When {
                    part: at.fract(),
                    since_s: (k - from) * tick_s(),
                    ends: latches.windows_s(from * tick_s()),
                    start_j,
                };
                self.windows.add(&[*a, *b], &sim, &when);
                self.hil_ticks.drain(..i);
                self.hil_first += i;
            }
            self.sim_ticks.pop_front();
            self.sim_first += 1;
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
const fn tick_s() -> f64 {
    PERIOD_NS as f64 * 1e-9
}

/// Both sides, tick by tick, and what follows from them.
#[derive(Clone, Debug, Default)]
struct Comparison {
    felt: Aligned,
    hardware: Aligned,
    /// Kinetic energy at the start, J, and of both sides at the last tick.
    start_j: Option<f64>,
    last_j: [f64; 2],
    sim_latches: LatchTimes,
}

impl Comparison {
    fn add(&mut self, hil: &Trace, sim: &Trace, sim_latches: LatchTimes) {
        self.sim_latches = sim_latches;
        let start_j = *self.start_j.get_or_insert(sim.kinetic_j);
        self.last_j = [hil.kinetic_j, sim.kinetic_j];
        let truth = (&sim.felt, sim.speed_m_s);
        self.felt.add((&hil.felt, hil.speed_m_s), truth, &sim_latches, start_j);
        if let Some(hardware) = &hil.hardware {
            self.hardware.add((hardware, hil.speed_m_s), truth, &sim_latches, start_j);
        }
    }

    fn fidelity(&self, latches: &RigLatches) -> Fidelity {
        let sim = &self.sim_latches;
        let felt = self.felt.windows.of_pairs(latches.told(), sim);
        let hardware = self.hardware.windows.of_pairs(latches.interpolated(), sim);
        let mut out = Fidelity {
            felt: Some(felt.unwrap_or_default()),
            hardware: Some(hardware.unwrap_or_default()),
            ..Fidelity::default()
        };
        // What the keys without `felt` or `hardware` mean: the article's truth where it is known.
        let best = if self.hardware.hil.ticks() > 0 { &self.hardware } else { &self.felt };
        let (Some(h), Some(s)) = (best.hil.begin(), best.sim.begin()) else { return out };
        out.first_contact_difference_s = Some((h - s) * tick_s());
        if let (Some((h_ticks, h_ratio)), Some((s_ticks, s_ratio))) =
            (best.hil.over(), best.sim.over())
        {
            out.R_T = (s_ticks >= SHORTEST_TICKS).then(|| h_ticks / s_ticks);
            out.R_e = Some(h_ratio / s_ratio);
        }
        let [h, s] = self.last_j;
        out.delta_energy = self.start_j.map(|start| (h - s) / start);
        let whole = hardware.or(felt).unwrap_or_default().whole_run;
        out.peak_force_ratio = whole.peak_force_ratio;
        out.nrms_force = whole.nrms_force;
        out.nrms_pose = whole.nrms_pose;
        out
    }
}

/// Compares a run against a rig with the simulated system as it goes.
pub struct FidelityMeter {
    simulated: TickedTwin,
    rig: Rig,
    tick_nanos: u64,
    ticks: u64,
    latches: RigLatches,
    comparison: Comparison,
}

impl FidelityMeter {
    /// From the initial condition at which the loop is closed; `system` has the mechanism that the rig has, `rig`
    /// its mounting planes where they stand.
    #[must_use]
    pub fn new(system: System, rig: Rig, bodies: [BodyState; 3], tick_nanos: u64) -> Self {
        Self {
            simulated: TickedTwin::new(TwinKind::Reduced, system, bodies, tick_nanos, STEPS),
            rig,
            tick_nanos,
            ticks: 0,
            latches: RigLatches::default(),
            comparison: Comparison::default(),
        }
    }

    /// Takes a tick of the closed loop in.
    pub fn add(&mut self, r: &TickRecord) {
        let system = self.simulated.twin().system();
        let hil = trace(system, &self.rig, r);
        let time_s = SimTime::of_tick(Tick(self.ticks), self.tick_nanos).seconds();
        self.latches.add(system, r, &hil.truest().x_34, time_s);
        let (sim, latches) = simulated(&mut self.simulated, time_s, &r.control);
        self.comparison.add(&hil, &sim, latches);
        self.ticks += 1;
    }

    /// Null where a figure means nothing; everything without contact in both.
    #[must_use]
    pub fn fidelity(&self) -> Fidelity {
        self.comparison.fidelity(&self.latches)
    }
}

#[cfg(test)]
mod tests;
