//! A thousand dockings in memory, on all cores, nothing kept but the summaries.
//!
//! `cargo run --release -p docktwin-run --example 04_thousand`

use docktwin_record::Outcome;
use docktwin_run::{Rehearsal, RehearsalOptions, SummaryOnly, TwinKind};
use docktwin_scenario::Loader;
use rayon::prelude::*;

fn main() {
    let loader = Loader::new().set("run.stop_when_decided", true);
    let options = RehearsalOptions { twin: TwinKind::Reduced, ..RehearsalOptions::default() };
    let begin = std::time::Instant::now();
    let captured = (0..1000)
        .into_par_iter()
        .filter(|i| {
            let offset_m = 0.08 * (f64::from(*i) / 999.0 - 0.5);
            let loader = loader.clone().set("initial.lateral_y_m", offset_m);
            let scenario = loader.load("scenarios/apas_nominal.toml".as_ref()).expect("a scenario");
            let run = Rehearsal::with(&scenario, options).expect("the sides are apart");
            run.run(&mut SummaryOnly).expect("nothing is written").outcome == Outcome::Captured
        })
        .count();
    println!(
        "{captured} of 1000 captured, {:.1} runs a second",
        1e3 / begin.elapsed().as_secs_f64()
    );
}
