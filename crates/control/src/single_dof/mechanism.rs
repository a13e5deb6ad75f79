//! The docking mechanism along one axis: what force it makes against being pressed together.

use docktwin_model::{AxisChannel, PiecewiseCurve};

/// Break-away displacement of the channel's dry friction, m, as in the twin's attenuator.
const DRY_BREAKAWAY_M: f64 = 2e-4;
/// Over this far into a stop its damping grows to its full value, m, as in the twin's attenuator.
const STOP_ENGAGEMENT_M: f64 = 1e-3;

/// A law along one axis. Displacements `x` are how far the mechanism is pressed together from first
/// touch on (m), forces push it apart (N).
#[derive(Clone, Debug, PartialEq)]
pub enum Mechanism {
    /// (5): spring and damper, `C s + K`. From first touch on it holds both ways.
    Linear {
        /// K, N/m (Table 3: 1e6).
        stiffness_n_m: f64,
        /// C, N·s/m (Table 3: 0).
        damping_n_s_m: f64,
    },
    /// A spring that is touched and left again: no force where x < 0.
    Contact {
        /// K, N/m.
        stiffness_n_m: f64,
    },
    /// The nonlinear axial characteristic of a mechanism's file (Fig. 6), damping before capture. From
    /// first touch on it holds both ways.
    Characteristic(AxisChannel),
}

/// What a mechanism remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory {
    /// It has been touched.
    pub touched: bool,
    /// Slip of the series brake, m.
    pub slip_m: f64,
    /// Bristle of dry friction and of branches, parts of its break-away displacement, −1 to 1.
    pub bristle: f64,
}

/// A displacement (m) and its rate (m/s).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct At {
    /// How far pressed together, m.
    pub x_m: f64,
    /// Its rate, m/s.
    pub v_m_s: f64,
}

/// Force, N, and the rates of slip (m/s) and bristle (1/s).
struct Law {
    force_n: f64,
    slip_m_s: f64,
    bristle_1_s: f64,
}

impl Law {
    /// A force without memory.
    const fn of(force_n: f64) -> Self {
        Self { force_n, slip_m_s: 0.0, bristle_1_s: 0.0 }
    }
}

/// Value of a curve at `x` ≥ 0: linear between points, the last slope beyond.
fn value(curve: &PiecewiseCurve, x: f64) -> f64 {
    let p = &curve.points;
    let Some(last) = p.len().checked_sub(2) else { return 0.0 };
    let i = p.iter().skip(1).position(|q| x <= q[0]).unwrap_or(last).min(last);
    let ([x0, f0], [x1, f1]) = (p[i], p[i + 1]);
    f0 + (f1 - f0) * (x - x0) / (x1 - x0)
}

fn characteristic(c: &AxisChannel, m: &Memory, at: At) -> Law {
    // Pressed together is the channel's negative direction.
    let (d, v) = (-at.x_m, -at.v_m_s);
    let stretch = d - m.slip_m;
    let (up, down) = (value(&c.loading, stretch.abs()), value(&c.unloading, stretch.abs()));
    let elastic = 0.5 * (up + down).copysign(stretch);
    let damping = c.damping.before_capture;
    // Spring and damper stand in series with the brake: beyond its force it slips so fast that the
    // force is the same in both, k e + c (v − s') = F_b + b s'.
    let held = elastic + damping * v;
    let slip_m_s = c
        .series_brake
        .map_or(0.0, |b| ((held.abs() - b.force) / (damping + b.viscous)).max(0.0).copysign(held));
    let mut force = -(held - damping * slip_m_s);
    let branch = 0.5 * (up - down).max(0.0);
    let breakaway = if branch > 0.0 { c.branch_change } else { DRY_BREAKAWAY_M };
    force -= (c.dry_friction + branch) * m.bristle;
    let travel = if d < 0.0 { c.travel_negative } else { c.travel_positive };
    let over = d.abs() - travel;
    if over > 0.0 {
        let rate = v * d.signum();
        let damp = c.stop_damping * rate * (over / STOP_ENGAGEMENT_M).min(1.0);
        force -= (c.stop_stiffness * over + damp).max(0.0).copysign(d);
    }
    // The force on the ring against its deflection pushes both sides apart when it points along +X3.
    Law { force_n: force, slip_m_s, bristle_1_s: (v - v.abs() * m.bristle) / breakaway }
}

impl Mechanism {
    fn law(&self, m: &Memory, at: At) -> Law {
        match self {
            Self::Contact { stiffness_n_m } => Law::of(stiffness_n_m * at.x_m.max(0.0)),
            _ if !m.touched => Law::of(0.0),
            Self::Linear { stiffness_n_m, damping_n_s_m } => {
                Law::of(stiffness_n_m * at.x_m + damping_n_s_m * at.v_m_s)
            }
            Self::Characteristic(c) => characteristic(c, m, at),
        }
    }

    /// Force that pushes both sides apart, N.
    #[must_use]
    pub fn force_n(&self, m: &Memory, at: At) -> f64 {
        self.law(m, at).force_n
    }

    /// Rates of slip (m/s) and bristle (1/s), for an integrator of its own.
    #[must_use]
    pub fn memory_rates(&self, m: &Memory, at: At) -> [f64; 2] {
        let law = self.law(m, at);
        [law.slip_m_s, law.bristle_1_s]
    }

    /// Carries the memory along the smooth path between two displacements `time_s` apart, by fourth
    /// order; half a millisecond is the most that dry friction at docking speeds stands.
    pub fn advance(&self, m: &mut Memory, from: At, to: At, time_s: f64) {
        let (mut from, mut h) = (from, time_s);
        if !m.touched {
            if to.x_m < 0.0 {
                return;
            }
            // Only what is left of the step after the touch is felt.
            if from.x_m < 0.0 {
                h *= to.x_m / (to.x_m - from.x_m);
                from = At { x_m: 0.0, v_m_s: from.v_m_s };
            }
            m.touched = true;
        }
        let mid = At {
            x_m: 0.5 * (from.x_m + to.x_m) + 0.125 * h * (from.v_m_s - to.v_m_s),
            v_m_s: 0.5 * (from.v_m_s + to.v_m_s),
        };
        let start = *m;
        let rates = |k: [f64; 2], by: f64, at: At| {
            let moved = Memory {
                slip_m: start.slip_m + by * k[0],
                bristle: start.bristle + by * k[1],
                ..start
            };
            self.memory_rates(&moved, at)
        };
        let k1 = rates([0.0; 2], 0.0, from);
        let k2 = rates(k1, 0.5 * h, mid);
        let k3 = rates(k2, 0.5 * h, mid);
        let k4 = rates(k3, h, to);
        let mean = |i: usize| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0;
        m.slip_m += h * mean(0);
        m.bristle += h * mean(1);
    }
}
