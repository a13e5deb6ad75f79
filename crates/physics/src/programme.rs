//! The body programme as it runs in the loop (§2, Fig. 5, §6): both spacecraft, driven by the wrenches
//! measured at their ports, one measurement a tick.
//!
//! A kick at `t_k` with the wrenches of `t_k`, then a drift to `t_{k+1}`: positions stand on ticks and
//! momenta between them, which is the leapfrog. With a perfect rig the loop is then a symplectic
//! integrator of the docking, and gains no energy from sampling; a wrench held over the tick that
//! follows it instead is half a tick late, 1.4 % of R_e in the fastest row of Table 4.

use docktwin_core::{DQuat, Pose, Twist, Wrench};

use crate::{
    body::{BodyState, MassProperties},
    mechanism::{CHASER, System, TARGET},
    reduced::Inputs,
};

/// Motion of `e4` against `e3` in axes of `e3`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelativeMotion {
    /// Pose `X_34`.
    pub x_34: Pose,
    /// Velocity and angular velocity, m/s and rad/s.
    pub twist: Twist,
    /// Rate of the twist's components, m/s² and rad/s².
    pub acceleration: Twist,
    /// Rate of the acceleration, m/s³ and rad/s³.
    pub jerk: Twist,
}

/// `a + b s`.
fn sum(a: Twist, b: Twist, s: f64) -> Twist {
    Twist { v: a.v + b.v * s, w: a.w + b.w * s }
}

impl RelativeMotion {
    /// The motion `time_s` later by its first terms: position by velocity, velocity by acceleration,
    /// acceleration by jerk. This is the lead `x + τ v`, not a Taylor series.
    #[must_use]
    pub fn led(&self, time_s: f64) -> Self {
        let x = &self.x_34;
        let turn = DQuat::from_scaled_axis(self.twist.w * time_s);
        Self {
            x_34: Pose::new(x.p + self.twist.v * time_s, (turn * x.q).normalize()),
            twist: sum(self.twist, self.acceleration, time_s),
            acceleration: sum(self.acceleration, self.jerk, time_s),
            jerk: self.jerk,
        }
    }

    /// The motion carried on by a series: position `x + c₁ v + c₂ a + c₃ j`, and its derivatives as far as they are
    /// known. With t, t²/2 and t³/6 it is the motion a time t later, with constant jerk: the Taylor series that
    /// [`RelativeMotion::led`] is not.
    #[must_use]
    pub fn by_series(&self, [c1, c2, c3]: [f64; 3]) -> Self {
        let x = &self.x_34;
        let way =
            sum(sum(sum(Twist::default(), self.twist, c1), self.acceleration, c2), self.jerk, c3);
        Self {
            x_34: Pose::new(x.p + way.v, (DQuat::from_scaled_axis(way.w) * x.q).normalize()),
            twist: sum(sum(self.twist, self.acceleration, c1), self.jerk, c2),
            acceleration: sum(self.acceleration, self.jerk, c1),
            jerk: self.jerk,
        }
    }

    /// True when every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x_34.is_finite()
            && [self.twist, self.acceleration, self.jerk]
                .iter()
                .all(|t| t.v.is_finite() && t.w.is_finite())
    }
}

/// Both spacecraft in the loop.
#[derive(Clone, Debug)]
pub struct Programme {
    mass: [MassProperties; 2],
    /// `X_13` and `X_24`.
    port: [Pose; 2],
    /// Poses at `t_k`, momenta at `t_{k−1/2}`.
    bodies: [BodyState; 2],
    tick_s: f64,
    /// Twist of `e4` against `e3` at `t_{k−1/2}`, and its last rate.
    twist: Twist,
    rate: Twist,
    /// Wrenches at the last instant about the mass centres, world axes.
    last: [Wrench; 2],
    /// Control wrenches of the tick before.
    before: Inputs,
}

impl Programme {
    /// The spacecraft of a system at `bodies` (chaser, ring, target; the ring is the rig's), free
    /// until the first tick.
    #[must_use]
    pub fn new(system: &System, bodies: &[BodyState; 3], tick_s: f64) -> Self {
        let [m1, _, m2] = *system.mass();
        let mut out = Self {
            mass: [m1, m2],
            port: system.ports(),
            bodies: [bodies[CHASER], bodies[TARGET]],
            tick_s,
            twist: Twist::default(),
            rate: Twist::default(),
            last: [Wrench::ZERO; 2],
            before: Inputs::default(),
        };
        let at = |back: f64| {
            let mut p = out.clone();
            p.drift(-back);
            p.relative_twist()
        };
        let (half, more) = (at(0.5 * tick_s), at(1.5 * tick_s));
        out.twist = half;
        out.rate = sum(half, more, -1.0);
        out.rate.v /= tick_s;
        out.rate.w /= tick_s;
        out
    }

    fn drift(&mut self, time_s: f64) {
        for (b, m) in self.bodies.iter_mut().zip(&self.mass) {
            b.drift(m, time_s);
        }
    }

    fn ports(&self) -> [Pose; 2] {
        core::array::from_fn(|i| self.bodies[i].pose() * self.port[i])
    }

    /// `X_34` now.
    #[must_use]
    pub fn x_34(&self) -> Pose {
        let [x_w3, x_w4] = self.ports();
        x_w3.inverse() * x_w4
    }

    /// Twist of `e4` against `e3`, axes of `e3`, with the momenta as they stand.
    fn relative_twist(&self) -> Twist {
        let [x_w3, x_w4] = self.ports();
        let at = |i: usize, x: &Pose| {
            let t = self.bodies[i].twist(&self.mass[i]);
            Twist { v: t.v + t.w.cross(x.p - self.bodies[i].p), w: t.w }
        };
        let (t3, t4) = (at(0, &x_w3), at(1, &x_w4));
        let back = x_w3.q.conjugate();
        Twist { v: back * (t4.v - t3.v - t3.w.cross(x_w4.p - x_w3.p)), w: back * (t4.w - t3.w) }
    }

    /// One tick: the wrenches at the ports measured at `t_k` (F3, M3 on the chaser at `e3`, in `e3`;
    /// F4, M4 on the target at `e4`, in `e4`) and the control wrenches held; afterwards it is
    /// `t_{k+1}`, whose motion is returned.
    pub fn tick(&mut self, port3: &Wrench, port4: &Wrench, control: &Inputs) -> RelativeMotion {
        let h = self.tick_s;
        let ports = self.ports();
        let before = [self.before.chaser, self.before.target];
        let controls = [control.chaser, control.target];
        for (i, port) in [port3, port4].into_iter().enumerate() {
            let b = &mut self.bodies[i];
            let arm = b.p - ports[i].p;
            let port = port.rotated(ports[i].q).shifted(arm);
            let [half, whole] = [before[i], controls[i]].map(|w| w.rotated(b.q));
            // Held from t_k on: of the time of the kick, t_{k−1/2} to t_{k+1/2}, half was the tick before.
            let held = Wrench { f: (half.f + whole.f) * 0.5, m: (half.m + whole.m) * 0.5 };
            b.kick(&self.mass[i], port + held, h);
            self.last[i] = port + whole;
        }
        self.before = *control;
        self.drift(0.5 * h);
        let twist = self.relative_twist();
        self.drift(0.5 * h);
        let per_tick = |a: Twist, b: Twist| Twist { v: (a.v - b.v) / h, w: (a.w - b.w) / h };
        let rate = per_tick(twist, self.twist);
        let jerk = per_tick(rate, self.rate);
        (self.twist, self.rate) = (twist, rate);
        RelativeMotion {
            x_34: self.x_34(),
            twist: sum(twist, rate, 0.5 * h),
            acceleration: sum(rate, jerk, h),
            jerk,
        }
    }

    /// Chaser and target at `t_k`, momenta brought there by half a kick with the last wrenches.
    #[must_use]
    pub fn bodies(&self) -> [BodyState; 2] {
        let mut out = self.bodies;
        for ((b, m), w) in out.iter_mut().zip(&self.mass).zip(self.last) {
            b.kick(m, w, 0.5 * self.tick_s);
        }
        out
    }

    /// Acceleration of the chaser from the last instant on, by the wrench measured there and the control wrench held
    /// since: of its mass centre, m/s², and angular, rad/s² (without the gyroscopic part), in axes of `e1`.
    #[must_use]
    pub fn chaser_acceleration(&self) -> Twist {
        let b = &self.bodies[0];
        let d = b.kick_response(&self.mass[0], self.last[0], 1.0);
        let back = b.q.conjugate();
        Twist { v: back * d.v, w: back * d.w }
    }

    /// Mass properties of chaser and target.
    #[must_use]
    pub const fn mass(&self) -> &[MassProperties; 2] {
        &self.mass
    }

    /// Motion in free flight `time_s` from now (may be negative), as if nothing pushed.
    #[must_use]
    pub fn free(&self, time_s: f64) -> RelativeMotion {
        let at = |t: f64| {
            let mut p = self.clone();
            p.drift(t);
            p
        };
        let eps = 1e-3;
        let here = at(time_s);
        let (before, after) = (at(time_s - eps), at(time_s + eps));
        let mut rate = sum(after.relative_twist(), before.relative_twist(), -1.0);
        rate.v /= 2.0 * eps;
        rate.w /= 2.0 * eps;
        RelativeMotion {
            x_34: here.x_34(),
            twist: here.relative_twist(),
            acceleration: rate,
            jerk: Twist::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use docktwin_core::DVec3;
    use docktwin_model::{load_mechanism, load_spacecraft};

    use super::*;
    use crate::initial::{ContactConditions, initial_state};

    /// A thrust held from a tick on moves the chaser by ½ F/m t², from the tick after its end uniformly.
    #[test]
    fn oracle_a_held_thrust_moves_by_half_its_acceleration_times_time_squared() {
        const TICK_S: f64 = 1e-3;
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
        let file = |name: &str| folder.join(name);
        let [chaser, target] = ["chaser_8t.urdf", "target_12t.urdf"]
            .map(|name| load_spacecraft(&file(name)).expect("shipped").model);
        let (active, passive) = (file("apas_active.urdf"), file("apas_passive.urdf"));
        let mechanism = load_mechanism(&active, &passive, None).expect("shipped").model;
        let system = System::new(&chaser, &target, mechanism);
        let bodies = initial_state(&system, &ContactConditions::default(), 0.5).bodies;
        let mut programme = Programme::new(&system, &bodies, TICK_S);
        let thrust = Inputs {
            chaser: Wrench { f: DVec3::new(600.0, 0.0, 0.0), m: DVec3::ZERO },
            target: Wrench::ZERO,
        };
        let (none, nothing) = (Wrench::ZERO, Inputs::default());
        let start = programme.bodies()[0];
        let along = start.q * DVec3::X;
        let a = 600.0 / system.mass()[CHASER].mass();
        for k in 1..=400_u32 {
            let (on, t) = (k <= 200, f64::from(k) * TICK_S);
            programme.tick(&none, &none, if on { &thrust } else { &nothing });
            let t_on = t.min(200.0 * TICK_S);
            let want = a * t_on * (t - 0.5 * t_on);
            let moved = (programme.bodies()[0].p - start.p - start.v * t).dot(along);
            assert!((moved - want).abs() < 1e-12, "{k}: {moved} m, {want} m");
            let speed = (programme.bodies()[0].v - start.v).dot(along);
            let held = if on { a * t } else { a * t_on };
            assert!((speed - held).abs() < 1e-12, "{k}: {speed} m/s, {held} m/s");
        }
    }
}
