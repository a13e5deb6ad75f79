//! A loop with a rig, stepped by the caller: for a program with a loop of its own, such as a
//! co-simulation.
//!
//! `cargo run --release -p docktwin-run --example 06_step_by_hand`

use docktwin_core::{DVec3, Wrench};
use docktwin_hil::scheduler::Phase;
use docktwin_physics::reduced::Inputs;
use docktwin_run::{HilOptions, HilRun, Memory, RunError};
use docktwin_scenario::Loader;

fn main() -> Result<(), RunError> {
    let scenario =
        Loader::new().set("run.duration_s", 2.0).load("scenarios/apas_nominal.toml".as_ref())?;
    let prepared = HilRun::new(&scenario, HilOptions::default())?;
    let rig = prepared.emulated()?;
    let mut run = prepared.begin(rig, Memory::new(), &mut ())?;
    while !run.ended() {
        // 200 N forward from first contact on.
        let push = run.situation().first_contact_s.map_or(0.0, |_| 200.0);
        let control =
            Inputs { chaser: Wrench { f: DVec3::X * push, m: DVec3::ZERO }, ..Inputs::default() };
        if let Some(tick) = run.tick(&control)
            && tick.phase == Phase::Closed
            && tick.closed_tick.is_some_and(|k| k % 500 == 0)
        {
            let s = run.situation();
            println!("t {:.1} s, closing at {:+.3} m/s", s.time_s, s.closing_m_s());
        }
    }
    let (summary, memory) = run.finish();
    let signals = memory.signals();
    println!(
        "{}; {} ticks of {} columns in memory, {} events",
        summary.outcome,
        signals.rows(),
        signals.schema.fields().len(),
        memory.events().len()
    );
    Ok(())
}
