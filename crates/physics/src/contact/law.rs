//! The contact law at one place between one pair of surfaces.

use docktwin_core::DVec3;
use docktwin_model::{ContactLaw, NormalLaw};

/// Normal force of one place, split for the energy account.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalForce {
    /// Total, N, ≥ 0.
    pub total_n: f64,
    /// Elastic part, the derivative of the stored energy, N.
    pub elastic_n: f64,
}

/// Stiffness of the law, N/mⁿ.
#[must_use]
pub fn stiffness(law: &NormalLaw) -> f64 {
    match *law {
        NormalLaw::HuntCrossley { stiffness, .. } | NormalLaw::KelvinVoigt { stiffness, .. } => {
            stiffness
        }
    }
}

fn power(x: f64, n: f64) -> f64 {
    if (n - 1.0).abs() < f64::EPSILON { x } else { x.powf(n) }
}

/// Elastic force `k δⁿ`, N; zero for δ ≤ 0.
#[must_use]
pub fn elastic_force(law: &NormalLaw, k: f64, depth_m: f64) -> f64 {
    let d = depth_m.max(0.0);
    match *law {
        NormalLaw::HuntCrossley { exponent, .. } => k * power(d, exponent),
        NormalLaw::KelvinVoigt { .. } => k * d,
    }
}

/// Stored energy `k δ^(n+1)/(n+1)`, J.
#[must_use]
pub fn stored_energy(law: &NormalLaw, k: f64, depth_m: f64) -> f64 {
    let d = depth_m.max(0.0);
    match *law {
        NormalLaw::HuntCrossley { exponent, .. } => k * power(d, exponent) * d / (exponent + 1.0),
        NormalLaw::KelvinVoigt { .. } => 0.5 * k * d * d,
    }
}

/// Normal force at depth δ (m) with elastic part `elastic_n`, growing at δ' (m/s).
#[must_use]
pub fn normal_force(law: &NormalLaw, elastic_n: f64, depth_rate_m_s: f64) -> NormalForce {
    if elastic_n <= 0.0 {
        return NormalForce { total_n: elastic_n, elastic_n };
    }
    let total = match *law {
        NormalLaw::HuntCrossley { damping_s_m, .. } => {
            elastic_n * (1.0 + damping_s_m * depth_rate_m_s)
        }
        NormalLaw::KelvinVoigt { damping_n_s_m, .. } => elastic_n + damping_n_s_m * depth_rate_m_s,
    };
    NormalForce { total_n: total.max(0.0), elastic_n }
}

/// Coulomb–Stribeck coefficient at sliding speed `v` (m/s).
#[must_use]
pub fn friction_coefficient(law: &ContactLaw, v: f64) -> f64 {
    if law.friction_static <= law.friction_kinetic {
        return law.friction_kinetic;
    }
    let x = v / law.stribeck_velocity_m_s;
    law.friction_kinetic + (law.friction_static - law.friction_kinetic) * (-x * x).exp()
}

/// Bristle (LuGre form, scaled by the normal force): mean deflection over a step of `h` at constant
/// sliding velocity `v`, and the deflection at its end. `y` is relative to the break-away
/// displacement, |y| ≤ 1.
///
/// y' = (v − |v| y)/s₀ has the exact solution y(t) = v̂ + (y₀ − v̂) e^(−|v| t/s₀), so that the step is
/// stable whatever the speed.
#[must_use]
pub fn bristle(law_breakaway: f64, y: DVec3, v: DVec3, h: f64) -> (DVec3, DVec3) {
    let speed = v.length();
    let a = speed * h / law_breakaway;
    if a < 1e-6 {
        let end = y + (v - y * speed) * (h / law_breakaway);
        return ((y + end) * 0.5, end);
    }
    let dir = v / speed;
    let decay = (-a).exp();
    let mean = dir + (y - dir) * ((1.0 - decay) / a);
    (mean, dir + (y - dir) * decay)
}

/// Whether there is friction at all.
#[must_use]
pub fn rubs(law: &ContactLaw) -> bool {
    law.friction_kinetic > 0.0 || law.friction_static > 0.0
}

/// Friction force on the surface that slides with `v_t` relative to the other, N, and the bristle's
/// deflection at the end of the step.
#[must_use]
pub fn friction(law: &ContactLaw, normal_n: f64, y: DVec3, v_t: DVec3, h: f64) -> (DVec3, DVec3) {
    if !rubs(law) || normal_n <= 0.0 {
        return (DVec3::ZERO, y);
    }
    let (mean, end) = bristle(law.bristle_breakaway_m, y, v_t, h);
    let speed = v_t.length();
    let x = speed / law.stribeck_velocity_m_s;
    // Micro-damping of the sticking bristle; it fades with sliding so that kinetic friction is μN.
    let tau = law.bristle_damping_s * (-x * x).exp();
    let rate = (v_t - mean * speed) / law.bristle_breakaway_m;
    (-(mean + rate * tau) * (friction_coefficient(law, speed) * normal_n), end)
}
