//! Latches with places and zones of their own: a caught one pulls along X of `r3`; from capture on it holds its
//! striker in every direction, beginning with the force of that instant. Contact goes on all the while.

use arrayvec::ArrayVec;
use docktwin_core::{DVec3, Pose, StateHasher, Twist};
use docktwin_model::{Latch, MOST_LATCHES};

use super::{
    Forces, LatchGap, LatchPhase, Measured, MechanismState, Midpoint, System, phase_by_gaps, reach,
    striker_rate,
};

/// A striker held in its latch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Held {
    /// Striker when it began, in `r3`, m.
    anchor: DVec3,
    /// Force on the target when it began, in `r3`, N, less the damper's.
    preload: DVec3,
}

impl Held {
    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        h.vec3(self.anchor);
        h.vec3(self.preload);
    }
}

/// Gap of a latch, `x_rp` being the pose of `r4` in `r3`.
pub(super) fn gap(l: &Latch, x_rp: Pose) -> LatchGap {
    let striker_r = x_rp.transform_point(l.striker_p);
    let g = striker_r - l.latch_r;
    // X of e4 points against X of r4.
    let x_4 = x_rp.q * -DVec3::X;
    LatchGap {
        axial_m: g.x,
        radial_m: g.y.hypot(g.z),
        tangential_m: 0.0,
        angle_rad: x_4.y.hypot(x_4.z).atan2(x_4.x),
        striker_r,
        pull_at_r: striker_r,
        axis_r: DVec3::X,
    }
}

fn reached(l: &Latch, gap: &LatchGap) -> LatchPhase {
    let near = |axial: f64, widen: f64| {
        gap.axial_m <= axial
            && gap.radial_m <= l.lateral_zone_m * widen
            && gap.angle_rad <= l.angle_zone_rad * widen
    };
    phase_by_gaps(near(l.catch_gap_m, 1.0), [l.strike_gap_m, l.approach_gap_m], near)
}

/// Force of a caught latch on the target before capture, in `r3`, N.
fn pull(l: &Latch, gap: &LatchGap) -> DVec3 {
    DVec3::X * (-l.hold_stiffness_n_m * (gap.axial_m - l.catch_gap_m).max(0.0))
}

impl System {
    fn own(&self) -> impl Iterator<Item = (usize, &Latch)> {
        self.mechanism.own_latches.iter().enumerate().take(MOST_LATCHES)
    }

    /// Force of latch `i` on the target, in `r3`, N, and the power lost in it, W.
    fn own_latch_force(
        &self,
        (i, l): (usize, &Latch),
        m: &Measured,
        state: &MechanismState,
        [r, t]: [Twist; 2],
    ) -> (DVec3, f64) {
        let gap = &m.latches[i];
        if let Some(held) = &state.held[i] {
            let rate = striker_rate(m, gap.striker_r, r, t);
            let back = m.poses().x_wr.q.conjugate();
            let spring = held.preload - (gap.striker_r - held.anchor) * l.joined_stiffness_n_m;
            let damper = back * rate * l.joined_damping_n_s_m;
            return (spring - damper, l.joined_damping_n_s_m * rate.length_squared());
        }
        let caught = state.latch(i).phase == LatchPhase::Latched;
        (if caught { pull(l, gap) } else { DVec3::ZERO }, 0.0)
    }

    /// Adds the forces of all own latches; `twists` are those of ring and target at the ring's centre.
    pub(super) fn own_latch_forces(
        &self,
        m: &Measured,
        state: &MechanismState,
        twists: [Twist; 2],
        out: &mut Forces,
    ) {
        let q = m.poses().x_wr.q;
        for l in self.own() {
            let (force, lost_w) = self.own_latch_force(l, m, state, twists);
            out.on_target.push(q * m.latches[l.0].striker_r, q * force);
            out.joint_w += lost_w;
        }
    }

    /// Force of each own latch on the target, in `r3`, N.
    pub(super) fn own_latch_forces_r(
        &self,
        m: &Measured,
        state: &MechanismState,
        r: Twist,
        t: Twist,
    ) -> ArrayVec<DVec3, MOST_LATCHES> {
        self.own().map(|l| self.own_latch_force(l, m, state, [r, t]).0).collect()
    }

    /// What the own latches store, J.
    pub(super) fn own_latch_energy(&self, m: &Measured, state: &MechanismState) -> f64 {
        let stored = |(i, l): (usize, &Latch)| match &state.held[i] {
            Some(held) => {
                let k = l.joined_stiffness_n_m;
                let stretch = m.latches[i].striker_r - held.anchor - held.preload / k;
                0.5 * k * stretch.length_squared()
            }
            None if state.latch(i).phase == LatchPhase::Latched => {
                let over = (m.latches[i].axial_m - l.catch_gap_m).max(0.0);
                0.5 * l.hold_stiffness_n_m * over * over
            }
            None => 0.0,
        };
        self.own().map(stored).sum()
    }

    /// Lets the own latches follow their strikers; from capture on those that have caught hold theirs.
    pub(super) fn advance_own_latches(
        &self,
        state: &mut MechanismState,
        m: &Measured,
        twists: [Twist; 2],
        middle: &Midpoint,
    ) {
        for (i, l) in self.own() {
            let gap = &m.latches[i];
            let reached = state.ruled(i, reached(l, gap), gap);
            reach(state.latch_mut(i), reached, middle.time_s);
        }
        let caught = |i: usize| state.latch(i).phase == LatchPhase::Latched;
        let mechanism = &self.mechanism;
        if mechanism.own_latches.is_empty() {
            return;
        }
        if state.held_since_s.is_none()
            && mechanism.captured_when.holds(mechanism.own_latches.len(), caught)
        {
            state.held_since_s = Some(middle.time_s);
        }
        if state.held_since_s.is_some() {
            for l in self.own() {
                self.hold(l, state, m, twists, middle.h);
            }
        }
    }

    /// A caught latch begins to hold its striker.
    fn hold(
        &self,
        (i, l): (usize, &Latch),
        state: &mut MechanismState,
        m: &Measured,
        twists: [Twist; 2],
        h: f64,
    ) {
        if state.held[i].is_some() || state.latch(i).phase != LatchPhase::Latched {
            return;
        }
        let striker_r = m.latches[i].striker_r;
        let back = m.poses().x_wr.q.conjugate();
        let rate = back * striker_rate(m, striker_r, twists[0], twists[1]);
        let before = self.own_latch_energy(m, state);
        let force = pull(l, &m.latches[i]);
        // The damper acts from the start: its share is taken off beforehand, so that no force jumps.
        let preload = force + rate * l.joined_damping_n_s_m;
        state.held[i] = Some(Held { anchor: striker_r, preload });
        // This step's kick carries the old force into its second half, over which the energy is the new one's.
        let change = (preload - force).dot(rate) * 0.5 * h;
        state.losses.capture += before - self.own_latch_energy(m, state) + change;
    }
}
