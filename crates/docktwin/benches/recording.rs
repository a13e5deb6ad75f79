//! What a recording costs a run: `apas_fast` for 40 s in the full twin, without a recording, with the
//! log (and table and events), and with the viewer's file as well, one after the other and again, so
//! that a busy machine troubles all three alike.
//!
//! `cargo bench -p docktwin --bench recording`; with a number, so many rounds.

use std::{collections::BTreeMap, path::Path, time::Instant as WallInstant};

use docktwin::{
    playback::{self, Playback},
    setup::{FULL_STEPS_PER_MS, inputs, start, steps_per_tick, tick_digest},
    signals::{Instant, columns, contact_rows, row},
};
use docktwin_core::{SimTime, Tick};
use docktwin_physics::reduced::DockingTwin;
use docktwin_record::{Policy, RunWriter};
use docktwin_scenario::{Scenario, load_scenario};
use docktwin_twin::FullTwin;
use docktwin_view::SceneWriter;

const SECONDS: u64 = 40;
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
    let (system, bodies) = start(scenario).expect("the sides are apart");
    let names = playback::pair_names(scenario);
    let metadata = BTreeMap::from([(
        "started_unix_ns".to_owned(),
        std::time::SystemTime::UNIX_EPOCH.elapsed().expect("after 1970").as_nanos().to_string(),
    )]);
    let mut log = (!matches!(kept, Kept::Nothing)).then(|| {
        RunWriter::create(dir, columns(), names.clone(), &metadata, Policy::Wait).expect("a log")
    });
    let mut view = matches!(kept, Kept::LogAndView).then(|| {
        let model = playback::scene_model(scenario);
        let writer = SceneWriter::create(&dir.join("run.rrd"), &model, &names).expect("a scene");
        (writer, Playback::new(scenario, &columns()).expect("all columns"))
    });
    let steps = steps_per_tick(scenario, FULL_STEPS_PER_MS);
    #[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
    let h = scenario.run.tick_nanos as f64 / 1e9 / f64::from(steps);
    let mut twin = FullTwin::new(system, bodies, h);
    let (mut cells, mut contacts) = (Vec::new(), Vec::new());
    let ticks = SECONDS * 1_000_000_000 / scenario.run.tick_nanos;

    let wall = WallInstant::now();
    for tick in 0..=ticks {
        let time = SimTime::of_tick(Tick(tick), scenario.run.tick_nanos);
        let state = twin.state();
        let control = inputs(&scenario.thrusts, &state, time.seconds());
        let digest = tick_digest(twin.digest(), &control);
        // What a run without a recording would have to measure as well, for its verdict.
        let now = Instant::new(twin.system(), &state, time.seconds(), h);
        if let Some(log) = &mut log {
            row(&now, twin.system(), &control, digest.short(), &mut cells);
            contact_rows(&now, &mut contacts);
            log.tick(Tick(tick), time, &cells, &contacts).expect("room on the disk");
        }
        if let Some((view, playback)) = &mut view {
            playback.show(view, time, &cells, &contacts, tick == ticks).expect("a frame");
        }
        for _ in 0..steps {
            twin.step(&control);
        }
    }
    let last_tick = wall.elapsed().as_secs_f64();
    if let Some((view, _)) = view {
        view.finish().expect("room on the disk");
    }
    drop(log);
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
    let scenario = load_scenario(&root.join("scenarios/apas_fast.toml"), &[]).expect("a scenario");
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
        let rate = bytes as f64 / 1e6 / SECONDS as f64;
        println!("{} {rate:.3} MB per simulated second", name.to_string_lossy());
    }
}
