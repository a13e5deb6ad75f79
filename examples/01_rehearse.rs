//! A docking from a scenario file, into a run directory.
//!
//! `cargo run --release -p docktwin-run --example 01_rehearse`

use docktwin_run::{Rehearsal, RunDirectory, RunError};
use docktwin_scenario::Loader;

fn main() -> Result<(), RunError> {
    // A scenario file, with one value patched: 3 cm off to the side.
    let scenario = Loader::new()
        .set("initial.lateral_y_m", 0.03)
        .load("scenarios/apas_nominal.toml".as_ref())?;
    // What the directory holds is what `docktwin rehearse` writes: `docktwin report` and `view` read it.
    let folder = std::env::temp_dir().join(format!("docktwin-example-{}", std::process::id()));
    let summary = Rehearsal::new(&scenario)?.run(&mut RunDirectory::new(&folder))?;
    println!("{}: {} ({})", summary.scenario, summary.outcome, summary.verdict);
    println!("peak force {:.0} N, capture after {:?} s", summary.peak_force_n, summary.capture_s);
    println!("written to {}", folder.display());
    Ok(())
}
