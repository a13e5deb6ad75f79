//! Case C21: both twins turn a free body as Euler's equations do, at rates up to 60 °/s.

use std::path::Path;

use docktwin_core::{DMat3, DQuat, DVec3};
use docktwin_physics::{
    body::BodyState,
    mechanism::{System, TARGET},
    reduced::{DockingTwin, Inputs, ReducedTwin},
};
use docktwin_run::setup::start;
use docktwin_scenario::Scenario;
use docktwin_twin::FullTwin;

const INERTIA: DVec3 = DVec3::new(500.0, 200.0, 300.0);

/// Attitude after `time_s` by Runge and Kutta's method on Euler's equations, in 0.1 ms: nothing of the twins.
fn by_eulers_equations(rate: DVec3, time_s: f64) -> DQuat {
    let slope = |q: DQuat, w: DVec3| {
        let turn = q * DQuat::from_xyzw(w.x, w.y, w.z, 0.0) * 0.5;
        (turn, (INERTIA * w).cross(w) / INERTIA)
    };
    let (mut q, mut w, h) = (DQuat::IDENTITY, rate, 1e-4);
    let mut left = (time_s / h).round();
    while left > 0.5 {
        let (q1, w1) = slope(q, w);
        let (q2, w2) = slope(q + q1 * (0.5 * h), w + w1 * (0.5 * h));
        let (q3, w3) = slope(q + q2 * (0.5 * h), w + w2 * (0.5 * h));
        let (q4, w4) = slope(q + q3 * h, w + w3 * h);
        q = (q + (q1 + q2 * 2.0 + q3 * 2.0 + q4) * (h / 6.0)).normalize();
        w += (w1 + w2 * 2.0 + w3 * 2.0 + w4) * (h / 6.0);
        left -= 1.0;
    }
    q
}

/// Modified Rodrigues parameters by which a twin's target is off after `time_s`.
fn off<T: DockingTwin>(mut twin: T, step_s: f64, rate: DVec3, time_s: f64) -> f64 {
    let mut left = (time_s / step_s).round();
    while left > 0.5 {
        twin.step(&Inputs::default());
        left -= 1.0;
    }
    let off = by_eulers_equations(rate, time_s).conjugate() * twin.state().bodies[TARGET].q;
    off.xyz().length() / (1.0 + off.w.abs())
}

#[test]
fn oracle_free_rotation_is_eulers_in_both_twins() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/apas_nominal.toml");
    let mut scenario = Scenario::from_path(path).expect("a scenario");
    scenario.target.inertia_kg_m2 = DMat3::from_diagonal(INERTIA);
    let system = System::new(&scenario.chaser, &scenario.target, scenario.mechanism.clone());
    let (_, mut bodies) = start(&scenario).expect("the sides are apart");
    // The case's rates, 22 °/s, and 60 °/s.
    for (rate, time_s) in
        [(DVec3::new(0.2, -0.16, 0.28), 25.0), (DVec3::new(0.6, 0.2, -0.83), 10.0)]
    {
        let far = docktwin_core::Pose::from_translation(DVec3::X * 50.0);
        bodies[TARGET] = BodyState::new(&system.mass()[TARGET], far, DVec3::ZERO, rate);
        let reduced = off(ReducedTwin::new(system.clone(), bodies, 1e-4), 1e-4, rate, time_s);
        let full = off(FullTwin::new(system.clone(), bodies, 2e-4), 2e-4, rate, time_s);
        assert!(reduced < 1e-8 && full < 1e-8, "reduced {reduced:.1e}, full {full:.1e} at {rate}");
    }
}
