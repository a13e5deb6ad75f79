//! What a recording costs a run: `apas_fast` for 40 s in the full twin, without a recording, with the
//! log (and table and events), and with the viewer's file as well, one after the other and again, so
//! that a busy machine troubles all three alike.
//!
//! `cargo bench -p docktwin --bench recording`; with a number, so many rounds.

use std::{path::Path, time::Instant as WallInstant};

use docktwin_physics::reduced::Inputs;
use docktwin_playback::ViewerFile;
use docktwin_run::{Rehearsal, RunDirectory};
use docktwin_scenario::{Loader, Scenario};

const SECONDS: u32 = 40;
const ROUNDS: usize = 9;

#[derive(Clone, Copy)]
enum Kept {
    Nothing,
    Log,
    LogAndView,
}

/// Wall time of the run, s: up to its last tick, and with the files closed.
fn run(scenario: &Scenario, kept: Kept, dir: &Path) -> [f64; 2] {
    let _ = std::fs::remove_dir_all(dir);
    let log = (!matches!(kept, Kept::Nothing)).then(|| RunDirectory::new(dir));
    let view = matches!(kept, Kept::LogAndView).then(|| ViewerFile::new(dir.join("run.rrd")));
    let rehearsal = Rehearsal::new(scenario).expect("the sides are apart");
    let mut run = rehearsal.begin((log, view)).expect("room on the disk");
    let wall = WallInstant::now();
    while !run.ended() {
        run.tick(&Inputs::default());
    }
    assert!(run.lost().is_none(), "room on the disk");
    let last_tick = wall.elapsed().as_secs_f64();
    let _ = run.finish();
    [last_tick, wall.elapsed().as_secs_f64()]
}

fn median(values: &[f64]) -> f64 {
    let mut v = values.to_vec();
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

fn main() {
    let rounds = std::env::args().find_map(|a| a.parse().ok()).unwrap_or(ROUNDS);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let loader = Loader::new().set("run.duration_s", f64::from(SECONDS));
    let scenario = loader.load(&root.join("scenarios/apas_fast.toml")).expect("a scenario");
    let dir = std::env::temp_dir().join(format!("docktwin-recording-{}", std::process::id()));
    let variants = [Kept::Nothing, Kept::Log, Kept::LogAndView];
    let mut times = [(); 3].map(|()| [Vec::new(), Vec::new()]);
    for _ in 0..rounds {
        for (t, kept) in times.iter_mut().zip(variants) {
            let [last, closed] = run(&scenario, kept, &dir);
            t[0].push(last);
            t[1].push(closed);
        }
    }
    let mut sizes: Vec<_> = std::fs::read_dir(&dir)
        .expect("what was written")
        .filter_map(|e| e.ok().and_then(|e| Some((e.file_name(), e.metadata().ok()?.len()))))
        .collect();
    sizes.sort();
    let _ = std::fs::remove_dir_all(&dir);
    println!("{SECONDS} s of apas_fast, full twin, {rounds} rounds, median (least to most)");
    for (what, at) in [("to the last tick", 0), ("files closed", 1)] {
        for (name, t) in ["nothing", "log", "log and run.rrd"].iter().zip(&times) {
            let ratios: Vec<f64> = t[at].iter().zip(&times[0][at]).map(|(a, b)| a / b).collect();
            let bounds = (
                ratios.iter().copied().fold(f64::INFINITY, f64::min),
                ratios.iter().copied().fold(0.0, f64::max),
            );
            println!(
                "{what:17} {name:15} {:.3} s, {:.3} ({:.3} to {:.3}) of a run without",
                median(&t[at]),
                median(&ratios),
                bounds.0,
                bounds.1
            );
        }
    }
    for (name, bytes) in sizes {
        #[expect(clippy::cast_precision_loss, reason = "a size")]
        let rate = bytes as f64 / 1e6 / f64::from(SECONDS);
        println!("{} {rate:.3} MB per simulated second", name.to_string_lossy());
    }
}
