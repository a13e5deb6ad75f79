//! Your own control law: the chaser brakes while its closing speed is too high; after first contact
//! the thrusters are off.
//!
//! `cargo run --release -p docktwin-run --example 02_control_law`

use docktwin_core::{DVec3, Wrench};
use docktwin_physics::reduced::Inputs;
use docktwin_run::{Rehearsal, RunError, Situation, SummaryOnly};
use docktwin_scenario::Loader;

/// Closing speed to arrive with, m/s.
const WANTED_M_S: f64 = 0.10;
/// Largest force of the thrusters along the docking axis, N.
const MOST_N: f64 = 400.0;

fn brake(now: &Situation) -> Inputs {
    if now.first_contact_s.is_some() {
        return Inputs::default();
    }
    // F1 acts on the chaser at its mass centre, in its own axes: -X brakes it.
    let too_fast = (now.closing_m_s() - WANTED_M_S).max(0.0);
    let force = DVec3::NEG_X * (20_000.0 * too_fast).min(MOST_N);
    Inputs { chaser: Wrench { f: force, m: DVec3::ZERO }, ..Inputs::default() }
}

fn main() -> Result<(), RunError> {
    // Begins 0.3 m before first contact, at 0.2 m/s.
    let scenario = Loader::new()
        .set("initial.axial_speed_m_s", 0.2)
        .set("initial.gap_m", 0.3)
        .load("scenarios/apas_nominal.toml".as_ref())?;
    for (name, summary) in [
        ("coasting", Rehearsal::new(&scenario)?.run(&mut SummaryOnly)?),
        ("braking", Rehearsal::new(&scenario)?.run_with(&mut SummaryOnly, brake, &mut ())?),
    ] {
        println!("{name:9} {}, peak force {:.0} N", summary.outcome, summary.peak_force_n);
    }
    Ok(())
}
