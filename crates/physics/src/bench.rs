//! The mechanism on a test bench: the ring is moved along one axis, and the required force is
//! measured.
//!
//! The chaser's side stands still; the bench holds the ring at its centre. *Deflection* is the pose
//! of `r3` in `e3` against rest: three displacements along `e3` (m) and the three components of the
//! rotation vector (rad; roll about X, pitch about Y, yaw about Z). *Reaction* is the force and the
//! moment about the ring's centre that the bench puts on the ring, axes of `e3`: a spring gives a
//! positive slope of reaction over deflection. The ring has no mass here, and nothing touches it.
//!
//! The other five axes are either *held* or *free*. Free means that the bench gives them no force
//! and no moment: the ring finds its equilibrium in them at every instant (Newton's method on their
//! generalised forces), dampers included. The ring of a differential mechanism cannot move sideways
//! far without also moving axially, so only free axes show what a docking meets.
//!
//! Unlike the rest of this crate the bench allocates: it is no part of a step.

use core::f64::consts::PI;

use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{Attenuator, ContactLaw, DockingMechanism};
use serde::{Deserialize, Serialize};

use crate::{
    attenuator::{
        self, AttenuatorForce, AttenuatorGeometry, AttenuatorState, channels, elastic_wrench,
        relaxed, stored_energy, total_slip,
    },
    contact::law,
};

/// Six components: X, Y, Z, roll, pitch, yaw.
pub type Six = [f64; 6];
/// Rows and columns as in [`Six`].
pub type Matrix6 = [Six; 6];

/// An axis of the ring in `e3`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along the docking axis; compression is negative.
    X,
    /// Sideways.
    Y,
    /// Sideways.
    Z,
    /// About X3.
    Roll,
    /// About Y3.
    Pitch,
    /// About Z3.
    Yaw,
}

impl Axis {
    /// All six, in the order of [`Six`].
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Roll, Self::Pitch, Self::Yaw];

    /// Place in a [`Six`].
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
            Self::Roll => 3,
            Self::Pitch => 4,
            Self::Yaw => 5,
        }
    }

    /// Whether it is a rotation (rad, N·m) or a displacement (m, N).
    #[must_use]
    pub const fn turns(self) -> bool {
        self.index() >= 3
    }

    /// Word for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["x", "y", "z", "roll", "pitch", "yaw"][self.index()]
    }
}

/// How the driven axis moves between its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wave {
    /// At constant speed.
    Triangle,
    /// Stretches of a sine; the speed is that in the middle.
    Sine,
}

/// What the bench does with the other five axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Others {
    /// Held at the offset.
    Held,
    /// No force and no moment.
    Free,
}

/// One test: cycles 0 → `ends[0]` → `ends[1]` → 0 on one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cycling {
    /// The driven axis.
    pub axis: Axis,
    /// Where it turns, from the offset, m or rad.
    pub ends: [f64; 2],
    /// Speed, m/s or rad/s; above 0.
    pub speed: f64,
    /// How it moves.
    pub wave: Wave,
    /// How often.
    pub cycles: u32,
    /// What happens to the other axes.
    pub others: Others,
    /// Pose from which the test starts, reached slowly from rest with all axes held.
    pub offset: Six,
    /// 0: damping before capture; 1: after.
    pub damping_phase: f64,
}

/// One instant of a test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Time from the start of the cycles, s.
    pub time_s: f64,
    /// Cycle, from 0.
    pub cycle: u32,
    /// Displacements (m) and rotation vector (rad) from rest.
    pub deflection: Six,
    /// Its rate, m/s and rad/s.
    pub rate: Six,
    /// Force (N) and moment (N·m) of the bench on the ring about the ring's centre, axes of `e3`.
    pub reaction: Six,
    /// Stored energy, J.
    pub stored_j: f64,
    /// Lost since the start of the cycles, J.
    pub lost_j: f64,
    /// Work of the bench since the start of the cycles, J.
    pub work_j: f64,
}

/// A test's record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// What was done.
    pub test: Cycling,
    /// Instants, about [`SAMPLES_PER_CYCLE`] a cycle, the turns among them.
    pub samples: Vec<Sample>,
    /// Work of the bench in each cycle, J.
    pub cycle_work_j: Vec<f64>,
    /// Loss in each cycle by the mechanism's own account, J.
    pub cycle_lost_j: Vec<f64>,
    /// Deflection of the driven axis at which a series brake first slipped, with the reaction there.
    pub first_slip: Option<[f64; 2]>,
    /// Largest force left on a free axis, N (moments over the ring radius).
    pub residual_n: f64,
}

/// Samples kept of one cycle.
pub const SAMPLES_PER_CYCLE: u32 = 800;
/// Steps of one test, at most.
const MAX_STEPS: f64 = 4e6;
/// Largest step of the driven axis while dry friction turns, m or rad.
const FINE: f64 = 1e-4;

/// What a bench cannot do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BenchError {
    /// The ring does not move against the chaser.
    Rigid,
    /// Speed, ends, cycles or offset make no motion, or too many steps.
    Motion,
    /// With free axes no equilibrium was found at this deflection of the driven axis (m or rad).
    NoEquilibrium {
        /// The driven axis.
        axis: Axis,
        /// Deflection.
        at: f64,
    },
}

impl core::fmt::Display for BenchError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Rigid => f.write_str("the attenuation is rigid: the ring has no travel to test"),
            Self::Motion => f.write_str(
                "speed, ends and cycles give no motion, or more than four million steps",
            ),
            Self::NoEquilibrium { axis, at } => write!(
                f,
                "with the other axes free there is no equilibrium at {} = {at:.6} {}",
                axis.name(),
                if axis.turns() { "rad" } else { "m" }
            ),
        }
    }
}

impl core::error::Error for BenchError {}

fn vectors(q: &Six) -> (DVec3, DVec3) {
    (DVec3::new(q[0], q[1], q[2]), DVec3::new(q[3], q[4], q[5]))
}

fn six(a: DVec3, b: DVec3) -> Six {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

fn lerp(a: &Six, b: &Six, t: f64) -> Six {
    core::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

/// The attenuator and the state of a test.
#[derive(Clone, Debug)]
struct Bench<'a> {
    model: &'a Attenuator,
    rest_offset_m: f64,
    ring_radius_m: f64,
    phase: f64,
    q: Six,
    state: AttenuatorState,
    /// Generalised reaction at the end of the last step, for the work of free axes.
    last: Option<Six>,
}

/// What one step measured.
struct Reading {
    /// Where the reaction was measured.
    q: Six,
    rate: Six,
    reaction: Six,
    work_j: f64,
    lost_j: f64,
}

impl<'a> Bench<'a> {
    fn new(m: &'a DockingMechanism, phase: f64) -> Result<Self, BenchError> {
        if m.attenuator == Attenuator::Rigid {
            return Err(BenchError::Rigid);
        }
        Ok(Self {
            model: &m.attenuator,
            rest_offset_m: m.ring_rest_offset_m,
            ring_radius_m: m.active.ring.mean_radius_m,
            phase,
            q: [0.0; 6],
            state: AttenuatorState::default(),
            last: None,
        })
    }

    fn geometry(&self, q: &Six) -> AttenuatorGeometry {
        let (d, psi) = vectors(q);
        let x_3r = Pose::new(DVec3::X * self.rest_offset_m + d, DQuat::from_scaled_axis(psi));
        AttenuatorGeometry::new(x_3r, self.rest_offset_m)
    }

    /// Twist of the ring, and its force, at `q` moving at `rate` (of [`Six`]).
    fn force(&self, q: &Six, rate: &Six, h: f64) -> (AttenuatorGeometry, Twist, AttenuatorForce) {
        let g = self.geometry(q);
        let (v, psi_rate) = vectors(rate);
        let rel = Twist { v, w: g.rotation_rate_matrix().inverse() * psi_rate };
        let f = attenuator::force(self.model, &g, &self.state, rel, self.phase, h);
        (g, rel, f)
    }

    /// Longest step for which the slip of every series brake, advanced explicitly, is well resolved.
    fn longest_step(&self, speed: f64) -> f64 {
        channels(self.model)
            .filter_map(|c| {
                let b = c.series_brake.as_ref()?;
                let damping = c.damping.before_capture
                    + (c.damping.after_capture - c.damping.before_capture) * self.phase;
                let k = [&c.loading, &c.unloading]
                    .into_iter()
                    .flat_map(|t| t.points.windows(2))
                    .map(|w| (w[1][1] - w[0][1]) / (w[1][0] - w[0][0]))
                    .fold(0.0, f64::max);
                // The slip of a step is known after it: 1e-3 of the elongation at which it begins.
                (k > 0.0)
                    .then(|| (0.25 * (damping + b.viscous) / k).min(1e-3 * b.force / k / speed))
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Moves the driven axis to `x` in one step, or in as many as a slipping brake asks for.
    fn advance(
        &mut self,
        axis: Axis,
        x: f64,
        others: Others,
        h: f64,
    ) -> Result<Reading, BenchError> {
        let (k, speed) = (axis.index(), (x - self.q[axis.index()]).abs() / h);
        let longest = self.longest_step(speed);
        if h > longest {
            let mut trial = self.clone();
            let whole = trial.step(axis, x, others, h);
            let slips =
                |b: &Self| total_slip(&b.state).to_bits() != total_slip(&self.state).to_bits();
            if let Ok(r) = whole
                && !slips(&trial)
            {
                *self = trial;
                return Ok(r);
            }
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let n = (h / longest).ceil().clamp(1.0, MOST_PARTS) as u32;
        let from = self.q[k];
        let h = h / f64::from(n);
        let (mut work_j, mut lost_j) = (0.0, 0.0);
        for i in 1..n {
            let to = from + (x - from) * f64::from(i) / f64::from(n);
            let r = self.step(axis, to, others, h)?;
            work_j += r.work_j;
            lost_j += r.lost_j;
        }
        let r = self.step(axis, x, others, h)?;
        Ok(Reading { work_j: work_j + r.work_j, lost_j: lost_j + r.lost_j, ..r })
    }

    /// One step to `x`.
    fn step(&mut self, axis: Axis, x: f64, others: Others, h: f64) -> Result<Reading, BenchError> {
        let mut next = self.q;
        next[axis.index()] = x;
        // Held axes: the middle of the step, second order. Free axes: its end, so that they settle.
        let theta = if others == Others::Free {
            self.settle(axis, &mut next, h)?;
            1.0
        } else {
            0.5
        };
        let at = lerp(&self.q, &next, theta);
        let rate: Six = core::array::from_fn(|i| (next[i] - self.q[i]) / h);
        let (g, rel, f) = self.force(&at, &rate, h);
        let w = f.on_ring;
        let mut work_j = -(w.f.dot(rel.v) + w.m.dot(rel.w)) * h;
        if others == Others::Free {
            // Measured at the ends of the steps: the mean of both ends.
            let now = six(-w.f, -(g.rotation_rate_matrix().inverse().transpose() * w.m));
            let before = self.last.unwrap_or(now);
            work_j = (0..6).map(|i| 0.5 * (before[i] + now[i]) * rate[i] * h).sum();
            self.last = Some(now);
        }
        self.q = next;
        self.state = f.next;
        Ok(Reading { q: at, rate, reaction: six(-w.f, -w.m), work_j, lost_j: f.lost_w * h })
    }

    /// Generalised forces of the ring at the end of a step to `next`; rotations over the radius.
    fn generalised(&self, next: &Six, h: f64) -> Six {
        let rate: Six = core::array::from_fn(|i| (next[i] - self.q[i]) / h);
        let (g, _, f) = self.force(next, &rate, h);
        let turn = g.rotation_rate_matrix().inverse().transpose() * f.on_ring.m;
        six(f.on_ring.f, turn / self.ring_radius_m)
    }

    /// Newton's method with a line search: places of the free axes without generalised force.
    fn settle(&self, axis: Axis, next: &mut Six, h: f64) -> Result<(), BenchError> {
        let scale = |i: usize| if i >= 3 { 1.0 / self.ring_radius_m } else { 1.0 };
        let size = |r: &Six| {
            (0..6).filter(|i| *i != axis.index()).map(|i| r[i] * r[i]).sum::<f64>().sqrt()
        };
        let mut r = self.generalised(next, h);
        for _ in 0..60 {
            let now = size(&r);
            if now < RESIDUAL_N {
                return Ok(());
            }
            let mut a = [[0.0; 6]; 6];
            for j in (0..6).filter(|j| *j != axis.index()) {
                let eps = 1e-8 * scale(j);
                let mut moved = *next;
                moved[j] += eps;
                let ahead = self.generalised(&moved, h);
                moved[j] -= 2.0 * eps;
                let behind = self.generalised(&moved, h);
                for i in 0..6 {
                    a[i][j] = (ahead[i] - behind[i]) / (2.0 * eps);
                }
            }
            a[axis.index()] = core::array::from_fn(|j| if j == axis.index() { 1.0 } else { 0.0 });
            let mut b = r;
            b[axis.index()] = 0.0;
            let Some(step) = solve(a, b) else { break };
            let mut t = 1.0;
            let better = loop {
                let trial: Six = core::array::from_fn(|i| next[i] - t * step[i]);
                let rt = self.generalised(&trial, h);
                if size(&rt) < now {
                    break Some((trial, rt));
                }
                t *= 0.5;
                if t < 1e-6 {
                    break None;
                }
            };
            let Some((trial, rt)) = better else { break };
            *next = trial;
            r = rt;
        }
        if size(&r) < RESIDUAL_ACCEPTED_N {
            return Ok(());
        }
        Err(BenchError::NoEquilibrium { axis, at: next[axis.index()] })
    }

    fn stored(&self, q: &Six) -> f64 {
        stored_energy(self.model, &self.geometry(q), &self.state)
    }

    /// Hessian of the stored energy at constant memory.
    fn stiffness(&self, pose: &Six) -> Matrix6 {
        let gradient = |q: &Six| {
            let g = self.geometry(q);
            let w = elastic_wrench(self.model, &g, &self.state);
            six(-w.f, -(g.rotation_rate_matrix().inverse().transpose() * w.m))
        };
        let mut out = [[0.0; 6]; 6];
        for j in 0..6 {
            // Five-point difference: the gradient is smooth between the corners of the tables.
            let eps = 2e-6;
            let at = |n: f64| {
                let mut q = *pose;
                q[j] += n * eps;
                gradient(&q)
            };
            let (a, b, c, d) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
            for (i, row) in out.iter_mut().enumerate() {
                row[j] = (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * eps);
            }
        }
        out
    }

    /// Reaches a pose in small steps, slowly against the dampers.
    fn approach(&mut self, q: &Six) {
        let steps = 2000;
        let from = self.q;
        let h = 0.2 * self.longest_step(0.0).min(0.05);
        for i in 1..=steps {
            let to = lerp(&from, q, f64::from(i) / f64::from(steps));
            let rate: Six = core::array::from_fn(|k| (to[k] - self.q[k]) / h);
            let (_, _, f) = self.force(&lerp(&self.q, &to, 0.5), &rate, h);
            self.state = f.next;
            self.q = to;
        }
        // Standing still until the brakes, which slipped against the dampers, have come to rest.
        for _ in 0..steps {
            let (_, _, f) = self.force(q, &[0.0; 6], h);
            self.state = f.next;
        }
    }
}

/// Parts of a step, at most.
const MOST_PARTS: f64 = 2000.0;
/// Newton stops here, N.
const RESIDUAL_N: f64 = 1e-7;
/// What rounding may leave at worst, N; far below every friction.
const RESIDUAL_ACCEPTED_N: f64 = 1e-3;

/// Gauss with pivoting.
fn solve(mut a: Matrix6, mut b: Six) -> Option<Six> {
    for k in 0..6 {
        let p = (k..6).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))?;
        a.swap(k, p);
        b.swap(k, p);
        let (row, right) = (a[k], b[k]);
        if !row[k].is_finite() || row[k].abs() < 1e-300 {
            return None;
        }
        for i in k + 1..6 {
            let f = a[i][k] / row[k];
            a[i].iter_mut().zip(row).for_each(|(x, y)| *x -= f * y);
            b[i] -= f * right;
        }
    }
    for k in (0..6).rev() {
        let rest: f64 = (k + 1..6).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - rest) / a[k][k];
    }
    Some(b)
}

/// One stretch of a cycle, from the offset.
struct Stretch {
    from: f64,
    way: f64,
    time_s: f64,
    /// Place from 0 to 1 over the part of the time from 0 to 1.
    done: fn(f64) -> f64,
}

/// The three stretches of a cycle.
fn stretches(c: &Cycling) -> [Stretch; 3] {
    let stops = [0.0, c.ends[0], c.ends[1], 0.0];
    core::array::from_fn(|i| {
        let way = stops[i + 1] - stops[i];
        let (slower, done): (f64, fn(f64) -> f64) = match (c.wave, i) {
            (Wave::Triangle, _) => (1.0, |s| s),
            (Wave::Sine, 0) => (0.5 * PI, |s| (0.5 * PI * s).sin()),
            (Wave::Sine, 1) => (0.5 * PI, |s| 0.5 * (1.0 - (PI * s).cos())),
            (Wave::Sine, _) => (0.5 * PI, |s| 1.0 - (0.5 * PI * s).cos()),
        };
        Stretch { from: stops[i], way, time_s: slower * way.abs() / c.speed, done }
    })
}

/// Runs a test.
///
/// # Errors
///
/// [`BenchError`]: a rigid attenuation, a test without motion, or no equilibrium of free axes.
pub fn run(m: &DockingMechanism, test: &Cycling) -> Result<Record, BenchError> {
    let mut bench = Bench::new(m, test.damping_phase)?;
    let k = test.axis.index();
    let numbers = test.offset.iter().chain(&test.ends).chain([&test.speed]).all(|x| x.is_finite());
    let stretches = stretches(test);
    let period: f64 = stretches.iter().map(|s| s.time_s).sum();
    if !numbers || test.speed <= 0.0 || test.cycles == 0 || !(period > 0.0 && period.is_finite()) {
        return Err(BenchError::Motion);
    }
    if test.offset.iter().any(|x| x.abs() > 0.0) {
        bench.approach(&test.offset);
    }
    let rubs = channels(bench.model).any(|c| c.dry_friction > 0.0 || c.loading != c.unloading);
    let fine = if rubs { period * test.speed / FINE } else { 0.0 };
    let wanted = fine.max(2000.0).ceil();
    if wanted * f64::from(test.cycles) > MAX_STEPS {
        return Err(BenchError::Motion);
    }
    // Whole steps in every stretch: no step straddles a turn.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 4e6")]
    let steps = |s: &Stretch| (wanted * s.time_s / period).ceil() as u32;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 4e6")]
    let every = (wanted as u32 / SAMPLES_PER_CYCLE).max(1);
    let mut out = Record {
        test: *test,
        samples: Vec::new(),
        cycle_work_j: Vec::new(),
        cycle_lost_j: Vec::new(),
        first_slip: None,
        residual_n: 0.0,
    };
    let slip_before = total_slip(&bench.state);
    let (mut work, mut lost) = (0.0, 0.0);
    let mut time_s = 0.0;
    for cycle in 0..test.cycles {
        let before = (work, lost);
        for (stretch, n) in stretches.iter().map(|s| (s, steps(s))) {
            let h = stretch.time_s / f64::from(n.max(1));
            for i in 1..=n {
                let done = (stretch.done)(f64::from(i) / f64::from(n));
                let x = test.offset[k] + stretch.from + stretch.way * done;
                let r = bench.advance(test.axis, x, test.others, h)?;
                time_s += h;
                work += r.work_j;
                lost += r.lost_j;
                if out.first_slip.is_none() && (total_slip(&bench.state) - slip_before).abs() > 0.0
                {
                    out.first_slip = Some([r.q[k], r.reaction[k]]);
                }
                if test.others == Others::Free {
                    let arm = bench.ring_radius_m;
                    let left =
                        (0..6).filter(|j| *j != k && (!test.axis.turns() || *j < 3)).map(|j| {
                            if j < 3 { r.reaction[j].abs() } else { r.reaction[j].abs() / arm }
                        });
                    out.residual_n = left.fold(out.residual_n, f64::max);
                }
                if i % every == 0 || i == n {
                    out.samples.push(Sample {
                        time_s,
                        cycle,
                        deflection: r.q,
                        rate: r.rate,
                        reaction: r.reaction,
                        stored_j: bench.stored(&r.q),
                        lost_j: lost,
                        work_j: work,
                    });
                }
            }
        }
        out.cycle_work_j.push(work - before.0);
        out.cycle_lost_j.push(lost - before.1);
    }
    Ok(out)
}

/// Deflection of one axis, in the direction of `sign`, at which a first channel comes to the end of
/// its travel, m or rad; `None` when none does within `limit`.
///
/// # Errors
///
/// As [`run`].
pub fn travel(
    m: &DockingMechanism,
    axis: Axis,
    sign: f64,
    others: Others,
    speed: f64,
    limit: f64,
) -> Result<Option<f64>, BenchError> {
    let mut bench = Bench::new(m, 0.0)?;
    if !(speed > 0.0 && limit > 0.0 && limit.is_finite()) {
        return Err(BenchError::Motion);
    }
    let dx = limit / 4000.0;
    let over = |b: &Bench<'_>, q: &Six| {
        attenuator::overtravel(b.model, &b.geometry(q), b.ring_radius_m) > 0.0
    };
    let (mut x, mut last) = (0.0, [0.0; 6]);
    while x < limit {
        x = (x + dx).min(limit);
        bench.advance(axis, x * sign, others, dx / speed)?;
        if over(&bench, &bench.q) {
            // Between the last two poses, by halving.
            let (mut a, mut b) = (0.0, 1.0);
            for _ in 0..40 {
                let t = 0.5 * (a + b);
                if over(&bench, &lerp(&last, &bench.q, t)) { b = t } else { a = t }
            }
            return Ok(Some(lerp(&last, &bench.q, b)[axis.index()] * sign));
        }
        last = bench.q;
    }
    Ok(None)
}

/// Stiffness and damping of the ring about one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangent {
    /// The pose.
    pub deflection: Six,
    /// Reaction at rest in it, after it was reached slowly from rest.
    pub reaction: Six,
    /// Hessian of the stored energy in (displacement, rotation vector), every brake holding:
    /// N/m, N/rad = N·m/m, N·m/rad. Symmetric up to rounding, since it has a potential.
    pub stiffness: Matrix6,
    /// Damping of small motions about this pose with every brake holding, before capture: reaction
    /// over velocity and angular velocity, N·s/m, N·s/rad, N·m·s/rad.
    pub damping_before: Matrix6,
    /// The same after capture.
    pub damping_after: Matrix6,
}

/// `matrix[i][j]` over the geometric mean of the diagonal: 0 uncoupled, 1 a lost degree of freedom.
#[must_use]
pub fn coupling(matrix: &Matrix6, i: usize, j: usize) -> f64 {
    let scale = (matrix[i][i] * matrix[j][j]).sqrt();
    if scale > 0.0 { matrix[i][j] / scale } else { 0.0 }
}

/// Stiffness and damping about a pose.
///
/// # Errors
///
/// As [`run`].
pub fn tangent(m: &DockingMechanism, pose: &Six) -> Result<Tangent, BenchError> {
    let mut bench = Bench::new(m, 0.0)?;
    if !pose.iter().all(|x| x.is_finite()) {
        return Err(BenchError::Motion);
    }
    bench.approach(pose);
    let h = bench.longest_step(0.0).min(1e-3);
    let (_, _, f) = bench.force(pose, &[0.0; 6], h);
    let damping = |phase: f64| {
        let mut b = bench.clone();
        b.phase = phase;
        // No brake is loaded and no friction engaged, so that velocity meets the dampers alone; in
        // a step this short friction does not build up.
        b.state = relaxed(b.model, &b.geometry(pose));
        let h = 1e-12;
        let g = b.geometry(pose);
        let wrench = |n: f64, j: usize| -> Wrench {
            let mut t = [0.0; 6];
            t[j] = n * 1e-6;
            let (v, w) = vectors(&t);
            attenuator::force(b.model, &g, &b.state, Twist { v, w }, phase, h).on_ring
        };
        let mut d = [[0.0; 6]; 6];
        for j in 0..6 {
            let (p, n) = (wrench(1.0, j), wrench(-1.0, j));
            let column = six((n.f - p.f) / 2e-6, (n.m - p.m) / 2e-6);
            for (row, x) in d.iter_mut().zip(column) {
                row[j] = x;
            }
        }
        d
    };
    Ok(Tangent {
        deflection: *pose,
        reaction: six(-f.on_ring.f, -f.on_ring.m),
        stiffness: bench.stiffness(pose),
        damping_before: damping(0.0),
        damping_after: damping(1.0),
    })
}

/// Least-squares slope of reaction over deflection of the driven axis over the samples of one cycle
/// that `keep` takes (it gets the deflection from the offset and its rate): the mean of the slopes
/// of both directions of motion, so that the height of the loop does not count. `None` where no
/// direction has three samples.
#[must_use]
pub fn slope(record: &Record, cycle: u32, keep: impl Fn(f64, f64) -> bool) -> Option<f64> {
    let k = record.test.axis.index();
    let one_way = |forward: bool| {
        let points: Vec<[f64; 2]> = record
            .samples
            .iter()
            .filter(|s| s.cycle == cycle && (s.rate[k] > 0.0) == forward)
            .map(|s| (s.deflection[k] - record.test.offset[k], s.rate[k], s.reaction[k]))
            .filter(|(x, v, _)| keep(*x, *v))
            .map(|(x, _, y)| [x, y])
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "a few thousand")]
        let n = points.len() as f64;
        let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / n;
        let (mx, my) = (mean(0), mean(1));
        let sxx: f64 = points.iter().map(|p| (p[0] - mx) * (p[0] - mx)).sum();
        let sxy: f64 = points.iter().map(|p| (p[0] - mx) * (p[1] - my)).sum();
        (points.len() > 2 && sxx > 0.0).then(|| sxy / sxx)
    };
    match (one_way(true), one_way(false)) {
        (Some(a), Some(b)) => Some(0.5 * (a + b)),
        (a, b) => a.or(b),
    }
}

/// Where the ring, held on one axis and moved along it, stops being stable on the other five.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instability {
    /// Deflection of the driven axis, m or rad.
    pub at: f64,
    /// Reaction on it there, N or N·m.
    pub reaction: f64,
    /// The axis that lost most of the stiffness it has at rest.
    pub weakest: Axis,
    /// What is left of it, N/m or N·m/rad, every brake holding.
    pub stiffness: f64,
}

/// Moves the ring slowly along one axis, in the direction of `to`, the others held, and looks for the
/// first pose (of 400, refined) at which the stored energy is no longer a minimum in them: from there on the
/// ring would give way sideways if nothing but the attenuator held it. The legs of a differential
/// mechanism do that under compression, like a column on hinges.
///
/// # Errors
///
/// As [`run`].
pub fn instability(
    m: &DockingMechanism,
    axis: Axis,
    to: f64,
) -> Result<Option<Instability>, BenchError> {
    let mut bench = Bench::new(m, 0.0)?;
    if !to.is_finite() {
        return Err(BenchError::Motion);
    }
    let k = axis.index();
    let rest = bench.stiffness(&[0.0; 6]);
    let speed = if axis.turns() { SLOW_RAD_S } else { SLOW_M_S };
    let h = (to.abs() / 400.0 / speed).max(1e-6);
    let step = to / 400.0;
    for i in 1..=400 {
        let before = bench.clone();
        bench.advance(axis, step * f64::from(i), Others::Held, h)?;
        if positive_definite(&bench.stiffness(&bench.q), k) {
            continue;
        }
        // Between the last two poses, by halving.
        let (mut a, mut b) = (0.0, 1.0);
        let reached = |t: f64| {
            let mut bench = before.clone();
            let x = before.q[k] + t * step;
            let r = bench.advance(axis, x, Others::Held, t * h)?;
            Ok::<_, BenchError>((r, bench.stiffness(&bench.q)))
        };
        for _ in 0..20 {
            let t = 0.5 * (a + b);
            if positive_definite(&reached(t)?.1, k) { a = t } else { b = t }
        }
        let (r, now) = reached(b)?;
        let left = |a: &Axis| now[a.index()][a.index()] / rest[a.index()][a.index()];
        let weakest = Axis::ALL
            .into_iter()
            .filter(|a| *a != axis)
            .min_by(|a, b| left(a).total_cmp(&left(b)))
            .unwrap_or(axis);
        return Ok(Some(Instability {
            at: before.q[k] + b * step,
            reaction: r.reaction[k],
            weakest,
            stiffness: now[weakest.index()][weakest.index()],
        }));
    }
    Ok(None)
}

/// Whether a symmetric matrix without row and column `left_out` is positive definite (Cholesky).
fn positive_definite(a: &Matrix6, left_out: usize) -> bool {
    let keep: Vec<usize> = (0..6).filter(|i| *i != left_out).collect();
    let mut l = [[0.0; 6]; 6];
    for (n, &i) in keep.iter().enumerate() {
        for &j in &keep[..=n] {
            let done: f64 =
                keep[..n].iter().take_while(|c| **c < j).map(|&c| l[i][c] * l[j][c]).sum();
            let rest = a[i][j] - done;
            if i == j {
                if rest <= 0.0 {
                    return false;
                }
                l[i][i] = rest.sqrt();
            } else {
                l[i][j] = rest / l[j][j];
            }
        }
    }
    true
}

/// Speed of the slow tests, m/s: dampers hardly show.
pub const SLOW_M_S: f64 = 2e-3;
/// Speed of the slow tests, rad/s (0.2 °/s).
pub const SLOW_RAD_S: f64 = 0.2 * PI / 180.0;
/// How far the tests go beyond the end of the travel, as a part of it.
const INTO_STOP: f64 = 0.05;
/// How far travels are looked for.
const FAR_M: f64 = 0.5;
const FAR_RAD: f64 = 1.0;

/// An axis in figures; m, N, N/m, J, or rad, N·m, N·m/rad, J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisFigures {
    /// The axis.
    pub axis: Axis,
    /// What happened to the others.
    pub others: Others,
    /// Ends of the travel, negative and positive; `None` beyond 0.5 m or 1 rad.
    pub travel: [Option<f64>; 2],
    /// Small cycles about rest with every brake holding: slope of the loop's middle line.
    pub soft_stiffness: f64,
    /// Half the height of that loop at rest: dry friction.
    pub friction: f64,
    /// Amplitude of those cycles.
    pub soft_amplitude: f64,
    /// Where, going to the first end, a series brake begins to slip, and the reaction there.
    pub slip: Option<[f64; 2]>,
    /// Slope over the second half of the travel, going to the first end.
    pub working_stiffness: f64,
    /// Reaction over deflection at 98 % of the travel, the first end.
    pub secant_stiffness: f64,
    /// Reaction at the travel's end, negative and positive, reached slowly.
    pub end_reaction: [f64; 2],
    /// Slope beyond the travel, going into the stop at the first end.
    pub stop_stiffness: f64,
    /// Loss of one slow cycle over 98 % of the travel to both sides, J.
    pub cycle_loss_j: f64,
    /// Work done on the mechanism by one slow stroke from rest to 98 % of the first end, J.
    pub stroke_work_j: f64,
}

/// The tests behind [`AxisFigures`].
#[derive(Clone, Debug, PartialEq)]
pub struct AxisTests {
    /// Figures.
    pub figures: AxisFigures,
    /// Two small cycles.
    pub soft: Record,
    /// Two cycles over 98 % of the travel.
    pub working: Record,
    /// One cycle into the end stops.
    pub stops: Record,
}

/// Tests one axis slowly: small cycles, cycles over the travel, one cycle into the stops. The
/// *first end* is compression for X and the positive end otherwise.
///
/// # Errors
///
/// As [`run`].
pub fn characterise(
    m: &DockingMechanism,
    axis: Axis,
    others: Others,
) -> Result<AxisTests, BenchError> {
    let (speed, far) = if axis.turns() { (SLOW_RAD_S, FAR_RAD) } else { (SLOW_M_S, FAR_M) };
    let first = if axis == Axis::X { -1.0 } else { 1.0 };
    let reach = |sign| travel(m, axis, sign, others, speed, far);
    let ends = [reach(first)?, reach(-first)?];
    let way = ends.map(|e| e.unwrap_or(far));
    let test = |ends: [f64; 2], cycles, speed| Cycling {
        axis,
        ends,
        speed,
        wave: Wave::Triangle,
        cycles,
        others,
        offset: [0.0; 6],
        damping_phase: 0.0,
    };
    let both = |f: &dyn Fn(f64) -> f64| [first * f(way[0]), -first * f(way[1])];
    let k = axis.index();
    let mut working = run(m, &test(both(&|w| 0.98 * w), 2, speed))?;
    let slip = working.first_slip.filter(|s| s[0] * first > 0.0);
    let smaller = way[0].min(way[1]);
    let small = slip.map_or(0.25 * smaller, |s| (0.5 * s[0].abs()).min(0.25 * smaller));
    let slowly = |speed| run(m, &test([first * small, -first * small], 2, speed));
    let gentle = speed.min(0.05 * small);
    let soft = slowly(gentle)?;
    let into = INTO_STOP * way[0].max(way[1]);
    let stops = run(m, &test(both(&|w| w + into), 1, speed))?;

    let soft_stiffness = slope(&soft, 1, |x, _| in_middle(x, small)).unwrap_or(0.0);
    let half_height = |r: &Record| half_height(r, small, soft_stiffness);
    // Extrapolated to standstill, so that dampers do not count.
    let friction = 2.0 * half_height(&slowly(0.5 * gentle)?) - half_height(&soft);
    let out = |x: f64, v: f64| x * v > 0.0;
    let working_stiffness = slope(&working, 0, |x, v| {
        out(x, v) && x * first > 0.5 * way[0] && x * first < 0.95 * way[0]
    });
    let stop_stiffness = slope(&stops, 0, |x, v| out(x, v) && x * first > way[0] + 0.2 * into);
    let turn = working
        .samples
        .iter()
        .take_while(|s| s.cycle == 0)
        .max_by(|a, b| (a.deflection[k] * first).total_cmp(&(b.deflection[k] * first)))
        .copied();
    let end = [reaction_at_stop(&stops, first, way[0]), reaction_at_stop(&stops, -first, way[1])];
    let cycle_loss_j = working.cycle_lost_j.last().copied().unwrap_or(0.0);
    working.first_slip = slip;
    let order = |v: [f64; 2]| if first < 0.0 { v } else { [v[1], v[0]] };
    let signed = [ends[0].map(|e| e * first), ends[1].map(|e| -e * first)];
    Ok(AxisTests {
        figures: AxisFigures {
            axis,
            others,
            travel: if first < 0.0 { signed } else { [signed[1], signed[0]] },
            soft_stiffness,
            friction: friction.max(0.0),
            soft_amplitude: small,
            slip,
            working_stiffness: working_stiffness.unwrap_or(0.0),
            secant_stiffness: turn.map_or(0.0, |s| s.reaction[k] / s.deflection[k]),
            end_reaction: order(end),
            stop_stiffness: stop_stiffness.unwrap_or(0.0),
            cycle_loss_j,
            stroke_work_j: turn.map_or(0.0, |s| s.work_j),
        },
        soft,
        working,
        stops,
    })
}

/// Far enough from the turns of a small cycle for friction to have turned over.
fn in_middle(x: f64, amplitude: f64) -> bool {
    x.abs() < 0.3 * amplitude
}

/// Half the height of the second cycle's loop about a spring of `stiffness`.
fn half_height(r: &Record, amplitude: f64, stiffness: f64) -> f64 {
    let k = r.test.axis.index();
    let (mut height, mut n) = (0.0, 0.0);
    for s in r.samples.iter().filter(|s| s.cycle == 1 && in_middle(s.deflection[k], amplitude)) {
        height += (s.reaction[k] - stiffness * s.deflection[k]) * s.rate[k].signum();
        n += 1.0;
    }
    if n > 0.0 { height / n } else { 0.0 }
}

/// The reaction where the stop begins, `way` out on the side of `sign`: the last two samples before it,
/// prolonged.
fn reaction_at_stop(stops: &Record, sign: f64, way: f64) -> f64 {
    let k = stops.test.axis.index();
    let mut before = stops
        .samples
        .iter()
        .filter(|s| {
            let x = s.deflection[k] * sign;
            s.rate[k] * sign > 0.0 && x > 0.5 * way && x < way
        })
        .rev();
    match (before.next(), before.next()) {
        (Some(b), Some(a)) => {
            let (xa, xb) = (a.deflection[k] * sign, b.deflection[k] * sign);
            let t = if xb > xa { (way - xb) / (xb - xa) } else { 0.0 };
            b.reaction[k] + t * (b.reaction[k] - a.reaction[k])
        }
        _ => 0.0,
    }
}

/// Depth and force of the contact law, a place pressed in as a sine to `depth_m` and let go, moving
/// at `speed_m_s` when it touches: (δ in m, F in N), `n + 1` of them.
#[must_use]
pub fn contact_loop(law: &ContactLaw, depth_m: f64, speed_m_s: f64, n: u32) -> Vec<[f64; 2]> {
    let k = law::stiffness(&law.normal);
    (0..=n)
        .map(|i| {
            let (s, c) = (PI * f64::from(i) / f64::from(n.max(1))).sin_cos();
            let depth = (depth_m * s).max(0.0);
            let elastic = law::elastic_force(&law.normal, k, depth);
            [depth, law::normal_force(&law.normal, elastic, speed_m_s * c).total_n]
        })
        .collect()
}
