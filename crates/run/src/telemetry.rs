//! What is recorded of a run against a rig: the columns of a docking, and those of loop and rig.
//!
//! What the columns of a docking mean against a rig stands beside each in [`crate::columns`].

use docktwin_core::{DVec3, PORT_CONTACT_N, Pose, Wrench};
use docktwin_hil::scheduler::TickRecord;
use docktwin_model::{DockingMechanism, MOST_LATCHES};
use docktwin_physics::{
    body::BodyState,
    limits::{LimitPassed, Loads},
    mechanism::{
        CHASER, EnergyLosses, LatchPhase, LatchState, MechanismState, RING, System, TARGET,
    },
    reduced::{DockingState, Energy},
};
use docktwin_record::{Cell, Column};
use docktwin_rigport::message::six;

use crate::{
    columns::{WITH_RIG, columns_of},
    signals::{Instant, columns_for},
};

/// Columns of a run of a mechanism against a rig: those of a docking, then those of [`loop_row`], which are
/// [`crate::columns::WITH_RIG`].
#[must_use]
pub fn hil_columns_for(mechanism: &DockingMechanism) -> Vec<Column> {
    let mut out = columns_for(mechanism);
    out.extend(columns_of(WITH_RIG));
    out
}

/// Appends the cells of loop and rig; `timed` is false under a virtual clock, where times of the wall
/// would make two runs differ.
pub fn loop_row(r: &TickRecord, x_34: &Pose, timed: bool, out: &mut Vec<Cell>) {
    let mut vector = |v: DVec3| out.extend(v.to_array().map(Cell::from));
    vector(x_34.p);
    vector(x_34.q.to_scaled_axis());
    let m = &r.measurement;
    for w in [m.sensor_a, m.sensor_b, m.truth_port3, m.truth_port4] {
        out.extend(w.map(Cell::from));
    }
    out.extend(m.plate_acceleration.map(Cell::from));
    let c = &r.command;
    for i in 0..6 {
        out.extend(
            [
                m.leg_length_m[i],
                m.leg_speed_m_s[i],
                m.leg_force_n[i],
                m.valve_spool[i],
                c.leg_length_m[i],
                c.leg_flow_speed_m_s[i],
                c.leg_force_n[i],
            ]
            .map(Cell::from),
        );
    }
    out.push(Cell::from(r.phase as u64));
    out.push(Cell::from(u64::from(m.status.bits())));
    out.push(Cell::from(u64::from(m.capabilities.bits())));
    out.push(Cell::from(r.fresh));
    #[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
    let us = |ns: u64| if timed { ns as f64 * 1e-3 } else { 0.0 };
    out.push(Cell::from(us(r.lateness_ns)));
    out.push(Cell::from(us(r.compute_ns)));
    out.push(Cell::from(r.missed));
    let report = r.compensator_report.unwrap_or_default();
    let correction = r.correction.unwrap_or_default();
    for w in [correction.port3, correction.port4, report.residual.port4] {
        out.extend(six(w.f, w.m).map(Cell::from));
    }
    out.push(Cell::from(report.trust));
    out.push(Cell::from(report.trust_fast));
}

/// What has happened so far in a run against a rig, kept from tick to tick.
#[derive(Clone, Debug)]
pub struct Watcher {
    latches: [LatchState; MOST_LATCHES],
    captured_s: Option<f64>,
    /// State as shown; its sums run from tick to tick.
    state: DockingState,
    kinetic_start_j: Option<f64>,
    last: Option<[BodyState; 2]>,
}

impl Watcher {
    /// Before the loop is closed.
    #[must_use]
    pub fn new(bodies: [BodyState; 3]) -> Self {
        Self {
            latches: [LatchState::default(); MOST_LATCHES],
            captured_s: None,
            state: DockingState::new(bodies),
            kinetic_start_j: None,
            last: None,
        }
    }

    /// The state as shown last.
    #[must_use]
    pub const fn state(&self) -> &DockingState {
        &self.state
    }

    /// Takes a tick in: bodies, latches and sums. Returns the state with the target where the
    /// mechanisms really are, for what touches.
    pub fn take(
        &mut self,
        system: &System,
        r: &TickRecord,
        time_s: f64,
        tick_s: f64,
    ) -> DockingState {
        let mass = system.mass();
        let m = &r.measurement;
        for (latch, phase) in self.latches.iter_mut().zip(m.latch_phases()) {
            let phase = [LatchPhase::Latched, LatchPhase::Struck, LatchPhase::Approach]
                .into_iter()
                .find(|p| *phase >= u32::from(*p as u8))
                .unwrap_or_default();
            latch.phase = phase;
            for (i, reached) in [LatchPhase::Approach, LatchPhase::Struck, LatchPhase::Latched]
                .into_iter()
                .enumerate()
            {
                if phase >= reached {
                    latch.times_s[i].get_or_insert(time_s);
                }
            }
        }
        if m.is_joined() == Some(true) {
            self.captured_s.get_or_insert(time_s);
        }
        let losses = self.state.mechanism.losses;
        self.state.mechanism = MechanismState::told(self.latches, self.captured_s);
        self.state.mechanism.losses = losses;

        let [chaser, target] = r.bodies;
        let [d, psi] = m.ring().unwrap_or_default();
        let offset = Pose::new(d, docktwin_core::DQuat::from_scaled_axis(psi));
        let ring = chaser.pose() * system.ring_at_rest() * offset;
        let t = chaser.twist(&mass[CHASER]);
        let v = t.v + t.w.cross(ring.p - chaser.p);
        let ring = BodyState::new(&mass[RING], ring, v, ring.q.conjugate() * t.w);
        self.state.bodies = [chaser, ring, target];

        let interface = interface(system, &r.ports.port4);
        let force = interface.f.length();
        let s = &mut self.state;
        s.step += 1;
        s.peak_force_n = s.peak_force_n.max(force);
        s.peak_moment_nm = s.peak_moment_nm.max(interface.m.length());
        // Braking at the end the rig moves and the bodies do not.
        if r.closed_tick.is_some() {
            let x_w4 = target.pose() * system.ports()[1];
            s.net_impulse += x_w4.q * interface.f * tick_s;
        }
        if force > PORT_CONTACT_N {
            s.first_contact_s.get_or_insert(time_s);
            // Below that the noise of the sensor would add up.
            if self.captured_s.is_none() {
                s.impulse_ns += force * tick_s;
            }
        }
        // Work and impulse of the control wrenches over the tick before, by its mean velocities.
        if let Some(before) = self.last {
            for (i, (w, k)) in
                [(r.control.chaser, CHASER), (r.control.target, TARGET)].into_iter().enumerate()
            {
                let (b, a) = (&before[i], &r.bodies[i]);
                let w = w.rotated(a.q);
                let (tb, ta) = (b.twist(&mass[k]), a.twist(&mass[k]));
                s.work_in_j += 0.5 * tick_s * (w.f.dot(tb.v + ta.v) + w.m.dot(tb.w + ta.w));
                s.impulse_in.push(a.p, w.f * tick_s);
                s.impulse_in.m += w.m * tick_s;
            }
        }
        self.last = Some(r.bodies);

        let mut shown = self.state.clone();
        let [x_13, x_24] = system.ports();
        let x_wt = chaser.pose() * x_13 * r.x_34 * x_24.inverse();
        let tw = target.twist(&mass[TARGET]);
        shown.bodies[TARGET] = BodyState::new(&mass[TARGET], x_wt, tw.v, x_wt.q.conjugate() * tw.w);
        shown
    }

    /// One instant, made of the state that [`Watcher::take`] returned and of what was measured.
    #[must_use]
    pub fn instant(
        &mut self,
        system: &System,
        shown: DockingState,
        r: &TickRecord,
        time_s: f64,
        tick_s: f64,
    ) -> Instant {
        let mut now = Instant::new(system, shown, time_s, tick_s);
        now.port3 = r.ports.port3;
        now.port4 = r.ports.port4;
        let loads = Loads {
            interface: interface(system, &r.ports.port4),
            // Surfaces of halves that are latched together do not count, as in a rehearsal.
            depth_m: if self.captured_s.is_none() { now.measured.deepest_m() } else { 0.0 },
            overtravel_m: now.overtravel_m,
        };
        self.state.peak_depth_m = self.state.peak_depth_m.max(loads.depth_m);
        if self.state.limit.is_none() {
            self.state.limit = LimitPassed::first(system.mechanism(), &loads, time_s);
        }
        let kinetic: f64 = [CHASER, TARGET]
            .into_iter()
            .map(|i| self.state.bodies[i].kinetic_energy(&system.mass()[i]))
            .sum();
        let start = *self.kinetic_start_j.get_or_insert(kinetic);
        let lost = start + self.state.work_in_j - kinetic;
        self.state.mechanism.losses = EnergyLosses { contact: lost, ..EnergyLosses::default() };
        now.energy = Energy { kinetic, stored: 0.0, lost, work_in: self.state.work_in_j };
        now.momentum = system.momentum(&self.state);
        now.state = self.state.clone();
        now
    }
}

/// The wrench on the target at the passive ring's centre, in `e4`, as limits are judged by.
#[must_use]
pub fn interface(system: &System, port4: &Wrench) -> Wrench {
    port4.shifted(system.passive_ring().p)
}

/// Velocity of `e4` against `e3` of two bodies, m/s.
#[must_use]
pub fn port_speed(system: &System, bodies: &[BodyState; 2]) -> f64 {
    let mass = system.mass();
    let p4 = (bodies[1].pose() * system.ports()[1]).p;
    let at = |i: usize, k: usize| {
        let t = bodies[i].twist(&mass[k]);
        t.v + t.w.cross(p4 - bodies[i].p)
    };
    (at(1, TARGET) - at(0, CHASER)).length()
}
