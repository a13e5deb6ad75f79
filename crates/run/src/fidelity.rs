//! How near a run against a rig comes to the simulated system: the same spacecraft and mechanism, the
//! same start and control wrenches, no rig (§8).
//!
//! The simulated system runs beside the loop's record tick by tick, and everything is summed as it comes:
//! nothing of a run's length is kept.

use std::collections::VecDeque;

use docktwin_core::{CONTACT_GAP_NS, DVec3, PERIOD_NS, PORT_CONTACT_N, SimTime, Tick};
use docktwin_hil::scheduler::TickRecord;
use docktwin_physics::{
    body::BodyState,
    mechanism::{CHASER, System, TARGET},
    reduced::Inputs,
};
use docktwin_record::Fidelity;
use docktwin_rigport::message::Capabilities;

use crate::{
    telemetry::port_speed,
    twin::{TickedTwin, TwinKind},
};

/// Steps of the simulated system in a tick of 1 ms, as the reduced twin has by default.
const STEPS: u32 = 10;
/// Ticks that a contact may be interrupted for.
const GAP_TICKS: usize = (CONTACT_GAP_NS / PERIOD_NS) as usize;
/// Ticks before first contact, and after its end, at which speeds are compared.
const SPEED_BEFORE: usize = 5;
const SPEED_AFTER: usize = 15;
/// Speeds remembered: from [`SPEED_AFTER`] ticks after a contact until its end is certain.
const SPEEDS: usize = 32;
/// First contacts further apart than so many ticks are not compared.
const MOST_APART: usize = 60_000;

/// One tick of either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    /// F4 on the target, in `e4`, N: true value if the rig reports it, otherwise measured.
    pub force_n: DVec3,
    /// `p_34`, m.
    pub position_m: DVec3,
    /// Relative speed of the ports, m/s.
    pub speed_m_s: f64,
    /// Kinetic energy of both spacecraft, J.
    pub kinetic_j: f64,
}

fn kinetic(system: &System, bodies: &[BodyState; 2]) -> f64 {
    [CHASER, TARGET].into_iter().zip(bodies).map(|(k, b)| b.kinetic_energy(&system.mass()[k])).sum()
}

/// What a tick of the loop leaves behind.
#[must_use]
pub fn trace(system: &System, r: &TickRecord) -> Trace {
    let m = &r.measurement;
    let truth = DVec3::from_slice(&m.truth_port4[..3]);
    Trace {
        force_n: if m.has(Capabilities::TRUTH) { truth } else { r.ports.port4.f },
        position_m: r.x_34.p,
        speed_m_s: port_speed(system, &r.bodies),
        kinetic_j: kinetic(system, &r.bodies),
    }
}

/// What the simulated system is at the beginning of a tick, over which it is then stepped.
fn simulated(twin: &mut TickedTwin, time_s: f64, control: &Inputs) -> Trace {
    let now = twin.instant(time_s);
    let system = twin.twin().system();
    let pair = [now.state.bodies[CHASER], now.state.bodies[TARGET]];
    let frames = now.measured.poses();
    let out = Trace {
        force_n: now.port4.f,
        position_m: (frames.x_w3.inverse() * frames.x_w4).p,
        speed_m_s: port_speed(system, &pair),
        kinetic_j: kinetic(system, &pair),
    };
    twin.tick(control);
    out
}

/// First contact of one side.
#[derive(Clone, Debug, Default)]
struct FirstContact {
    ticks: usize,
    peak_n: f64,
    /// The newest last.
    speeds: VecDeque<f64>,
    begin: Option<usize>,
    last_on: usize,
    entry_speed_m_s: f64,
    /// Last tick of it, once that is certain, and the speed [`SPEED_AFTER`] ticks later.
    end: Option<(usize, f64)>,
}

impl FirstContact {
    fn add(&mut self, t: &Trace) {
        let force = t.force_n.length();
        self.peak_n = self.peak_n.max(force);
        if self.speeds.len() == SPEEDS {
            self.speeds.pop_front();
        }
        self.speeds.push_back(t.speed_m_s);
        let on = force > PORT_CONTACT_N;
        if on && self.begin.is_none() {
            self.begin = Some(self.ticks);
            let back = SPEED_BEFORE.min(self.ticks);
            self.entry_speed_m_s = self.speeds[self.speeds.len() - 1 - back];
        }
        if on && self.end.is_none() {
            self.last_on = self.ticks;
        } else if self.begin.is_some()
            && self.end.is_none()
            && self.ticks - self.last_on > GAP_TICKS
        {
            let back = self.ticks - self.last_on - SPEED_AFTER;
            self.end = Some((self.last_on, self.speeds[self.speeds.len() - 1 - back]));
        }
        self.ticks += 1;
    }

    /// Duration in ticks, and exit over entry speed.
    fn over(&self) -> Option<(usize, f64)> {
        let (begin, (end, exit)) = (self.begin?, self.end?);
        Some((end - begin, exit / self.entry_speed_m_s))
    }
}

/// Sums over both sides, aligned at first contact.
#[derive(Clone, Debug, Default)]
struct Aligned {
    /// Ticks since first contact of the side that is ahead, not yet paired.
    hil: VecDeque<Trace>,
    sim: VecDeque<Trace>,
    pairs: usize,
    force_error: f64,
    force: f64,
    position_error: f64,
    /// Mean of the simulated position and the sum of squares about it (Welford).
    mean_m: DVec3,
    position: f64,
    /// Kinetic energies of the last pair, J.
    kinetic_j: Option<[f64; 2]>,
    too_far: bool,
}

impl Aligned {
    fn add(&mut self, hil: Option<&Trace>, sim: Option<&Trace>) {
        self.hil.extend(hil.copied());
        self.sim.extend(sim.copied());
        if self.hil.len().max(self.sim.len()) > MOST_APART {
            (self.hil, self.sim) = Default::default();
            self.too_far = true;
        }
        if self.too_far || self.hil.is_empty() || self.sim.is_empty() {
            return;
        }
        if let (Some(h), Some(s)) = (self.hil.pop_front(), self.sim.pop_front()) {
            self.pair(&h, &s);
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "ticks")]
    fn pair(&mut self, h: &Trace, s: &Trace) {
        self.pairs += 1;
        self.force_error += (h.force_n - s.force_n).length_squared();
        self.force += s.force_n.length_squared();
        self.position_error += (h.position_m - s.position_m).length_squared();
        let off = s.position_m - self.mean_m;
        self.mean_m += off / self.pairs as f64;
        self.position += off.dot(s.position_m - self.mean_m);
        self.kinetic_j = Some([h.kinetic_j, s.kinetic_j]);
    }
}

/// Compares a run against a rig with the simulated system as it goes.
pub struct FidelityMeter {
    simulated: TickedTwin,
    tick_nanos: u64,
    hil: FirstContact,
    sim: FirstContact,
    aligned: Aligned,
    start_j: Option<f64>,
}

impl FidelityMeter {
    /// From the initial condition at which the loop is closed.
    #[must_use]
    pub fn new(system: System, bodies: [BodyState; 3], tick_nanos: u64) -> Self {
        Self {
            simulated: TickedTwin::new(TwinKind::Reduced, system, bodies, tick_nanos, STEPS),
            tick_nanos,
            hil: FirstContact::default(),
            sim: FirstContact::default(),
            aligned: Aligned::default(),
            start_j: None,
        }
    }

    /// Takes a tick of the closed loop in.
    pub fn add(&mut self, hil: &Trace, control: &Inputs) {
        let time = SimTime::of_tick(Tick(self.hil.ticks as u64), self.tick_nanos);
        let sim = simulated(&mut self.simulated, time.seconds(), control);
        self.start_j.get_or_insert(sim.kinetic_j);
        self.hil.add(hil);
        self.sim.add(&sim);
        let touched = |side: &FirstContact| side.begin.is_some();
        self.aligned.add(touched(&self.hil).then_some(hil), touched(&self.sim).then_some(&sim));
    }

    /// Everything `None` without contact in both.
    #[must_use]
    pub fn fidelity(&self) -> Fidelity {
        let mut out = Fidelity::default();
        if self.hil.begin.is_none() || self.sim.begin.is_none() {
            return out;
        }
        out.peak_force_ratio = Some(self.hil.peak_n / self.sim.peak_n);
        #[expect(clippy::cast_precision_loss, reason = "ticks")]
        if let (Some((h_ticks, h_ratio)), Some((s_ticks, s_ratio))) =
            (self.hil.over(), self.sim.over())
        {
            out.R_T = Some(h_ticks as f64 / s_ticks.max(1) as f64);
            out.R_e = Some(h_ratio / s_ratio);
        }
        let a = &self.aligned;
        if let (Some([h, s]), Some(start)) = (a.kinetic_j, self.start_j) {
            out.nrms_force = Some((a.force_error / a.force).sqrt());
            out.nrms_pose = Some((a.position_error / a.position).sqrt());
            out.delta_energy = Some((h - s) / start);
        }
        out
    }
}
