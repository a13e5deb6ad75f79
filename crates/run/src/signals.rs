//! What is recorded of a docking, and in which columns.

use arrayvec::ArrayVec;
use docktwin_core::{DVec3, Euler, Twist, Wrench};
use docktwin_model::{DockingMechanism, MOST_LATCHES};
use docktwin_physics::{
    contact::ContactSample,
    mechanism::{CHASER, Forces, Measured, Midpoint, RING, System, TARGET},
    outcome::Observation,
    reduced::{DockingState, Energy, Inputs},
};
use docktwin_record::{Cell, Column, ContactRow};

use crate::{
    columns::{DOCKING, LATCH_COLUMNS, columns_of, columns_with},
    control::Situation,
};

/// Most places of contact recorded in one tick.
pub const MAX_CONTACTS: usize = 32;

/// One instant: the state, and everything that follows from it.
#[derive(Clone, Debug)]
pub struct Instant {
    /// The state.
    pub state: DockingState,
    /// Contacts, deflection, latch gaps, frames.
    pub measured: Measured,
    /// Wrenches inside the mechanism.
    pub forces: Forces,
    /// Energy account, J.
    pub energy: Energy,
    /// Linear momentum, kg·m/s, and angular momentum about the world's origin, kg·m²/s.
    pub momentum: Wrench,
    contacts: [ContactSample; MAX_CONTACTS],
    contact_count: usize,
    /// Motion of `e4` against `e3` at the passive ring's centre, axes of `e3`.
    pub relative: Twist,
    /// F3, M3: on the chaser at the origin of `e3`, in `e3`.
    pub port3: Wrench,
    /// F4, M4: on the target at the origin of `e4`, in `e4`.
    pub port4: Wrench,
    /// How far the attenuator is beyond its travel, m.
    pub overtravel_m: f64,
    /// Force of each latch on the target, in `r3`, N.
    pub latch_force_n: ArrayVec<DVec3, MOST_LATCHES>,
}

impl Instant {
    /// Evaluates a state. `h` is the physics step, s, over which friction is evaluated.
    #[must_use]
    pub fn new(system: &System, state: DockingState, time_s: f64, h: f64) -> Self {
        let poses = state.poses();
        let com = poses.map(|x| x.p);
        let mass = system.mass();
        let measured = system.measure(&state.mechanism, &poses);
        let twist: [Twist; 3] = core::array::from_fn(|i| state.bodies[i].twist(&mass[i]));
        let middle = Midpoint { com, time_s, h };
        let forces = system.forces(&measured, &state.mechanism, &twist, &middle);
        let frames = *measured.poses();
        let about = frames.x_wr.p;
        let at = |i: usize, p: DVec3| Twist {
            v: twist[i].v + twist[i].w.cross(p - com[i]),
            w: twist[i].w,
        };
        let mut contacts = [ContactSample::default(); MAX_CONTACTS];
        let contact_count = measured.contacts().samples(
            about,
            at(RING, about),
            at(TARGET, about),
            h,
            &mut contacts,
        );
        let mut contact_count = contact_count;
        if let Some(stick) = measured.stick().filter(|s| s.touching()) {
            contacts[contact_count] = ContactSample {
                point_w_m: frames.x_w4.p,
                normal_w_n: frames.x_w3.q * stick.force_n,
                depth_m: stick.depth_m,
                ..ContactSample::default()
            };
            contact_count += 1;
        }
        let p = frames.x_wp.p;
        let (c, t) = (at(CHASER, p), at(TARGET, p));
        let back = frames.x_w3.q.conjugate();
        // With a rigid ring the chaser feels the target directly.
        let on_chaser =
            if system.rigid() { -forces.on_target } else { -forces.on_ring_from_attenuator };
        let port3 = on_chaser.shifted(frames.x_w3.p - about).rotated(back);
        let port4 =
            forces.on_target.shifted(frames.x_w4.p - about).rotated(frames.x_w4.q.conjugate());
        Self {
            energy: system.energy(&state, &measured),
            momentum: system.momentum(&state),
            contacts,
            contact_count,
            relative: Twist { v: back * (t.v - c.v), w: back * (t.w - c.w) },
            port3,
            port4,
            overtravel_m: system.overtravel_m(&measured),
            latch_force_n: system.latch_forces(&measured, &state.mechanism, &com, &twist),
            state,
            measured,
            forces,
        }
    }

    /// What the monitor looks at.
    #[must_use]
    pub fn observation(&self, time_s: f64) -> Observation {
        let frames = self.measured.poses();
        let ring = docktwin_core::Pose::new(frames.x_wp.p, frames.x_w4.q);
        Observation {
            time_s,
            x_ring: frames.x_wr.inverse() * ring,
            relative: self.relative,
            touching: self.measured.touching(),
            limit: self.state.limit,
        }
    }

    /// The same for whoever commands the thrusters.
    #[must_use]
    pub fn situation(&self, time_s: f64) -> Situation {
        let frames = self.measured.poses();
        Situation {
            time_s,
            bodies: [self.state.bodies[CHASER], self.state.bodies[TARGET]],
            x_34: frames.x_w3.inverse() * frames.x_w4,
            relative: self.relative,
            port4: self.port4,
            first_contact_s: self.state.first_contact_s,
            captured_s: self.state.mechanism.captured_s(),
        }
    }

    /// Places of contact.
    #[must_use]
    pub fn contacts(&self) -> &[ContactSample] {
        &self.contacts[..self.contact_count]
    }
}

/// Columns of the recording, in the order of [`row`]: those of [`crate::columns::DOCKING`].
#[must_use]
pub fn columns() -> Vec<Column> {
    columns_of(DOCKING)
}

/// As [`columns`], with columns for every latch of a mechanism.
#[must_use]
pub fn columns_for(mechanism: &DockingMechanism) -> Vec<Column> {
    columns_with(DOCKING, mechanism.latch_count())
}

/// The places of contact of an instant; `out` is cleared and filled.
pub fn contact_rows(i: &Instant, out: &mut Vec<ContactRow>) {
    out.clear();
    out.extend(i.contacts().iter().map(|c| ContactRow {
        pair: u16::try_from(c.pair).unwrap_or(u16::MAX),
        point_w_m: c.point_w_m,
        normal_w: c.normal_w_n.normalize_or_zero(),
        depth_m: c.depth_m,
        normal_force_n: c.normal_w_n.length(),
        friction_w_n: c.friction_w_n,
    }));
}

fn vector(out: &mut Vec<Cell>, v: DVec3) {
    out.extend(v.to_array().map(Cell::from));
}

/// One row; `out` is cleared and filled without growing after the first tick.
pub fn row(i: &Instant, system: &System, inputs: &Inputs, digest: u64, out: &mut Vec<Cell>) {
    out.clear();
    for (b, m) in i.state.bodies.iter().zip(system.mass()) {
        vector(out, b.p);
        vector(out, b.v);
        vector(out, b.rate_body(m));
    }
    let frames = i.measured.poses();
    let x_34 = frames.x_w3.inverse() * frames.x_w4;
    let e = Euler::from_quat(x_34.q);
    vector(out, x_34.p);
    vector(out, DVec3::new(e.roll, e.pitch, e.yaw));
    vector(out, i.relative.v);
    vector(out, i.relative.w);
    let d = i.measured.deflection();
    vector(out, d.d);
    vector(out, d.psi);
    for w in [i.port3, i.port4] {
        vector(out, w.f);
        vector(out, w.m);
    }
    vector(out, i.forces.contact_on_target);
    for w in [inputs.chaser, inputs.target] {
        vector(out, w.f);
        vector(out, w.m);
    }
    let latches = system.mechanism().latch_count().max(LATCH_COLUMNS);
    for latch in 0..latches {
        vector(out, i.latch_force_n.get(latch).copied().unwrap_or_default());
    }
    vector(out, i.momentum.f);
    vector(out, i.momentum.m);
    for b in &i.state.bodies {
        out.extend([b.q.w, b.q.x, b.q.y, b.q.z].map(Cell::from));
    }
    let l = &i.state.mechanism.losses;
    out.extend(
        [
            i.energy.kinetic,
            i.energy.stored,
            l.contact,
            l.friction,
            l.attenuator,
            l.joint,
            l.capture,
            i.energy.work_in,
        ]
        .map(Cell::from),
    );
    let phases = i.state.mechanism.all_latches().take(latches);
    out.extend(phases.map(|l| Cell::from(l.phase as u64)));
    out.extend(i.measured.latches.iter().take(latches).map(|l| Cell::from(l.axial_m)));
    out.push(Cell::from(i.measured.deepest_m()));
    out.push(Cell::from(i.contact_count as u64));
    out.push(Cell::from(digest));
}

/// Names of the control wrench columns, in the order of [`Inputs`].
#[must_use]
pub fn input_columns() -> Vec<String> {
    columns().into_iter().filter(|c| c.topic == "/inputs").map(|c| c.name).collect()
}
