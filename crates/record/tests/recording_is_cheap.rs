//! What recording costs, printed (`--nocapture`); only sizes are asserted, never times.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::{Duration, Instant};

use docktwin_core::{DVec3, SimTime, Tick};
use docktwin_record::{Cell, Column, ContactRow, Policy, RunWriter};

const TICKS: u64 = 10_000;
const MS: u64 = 1_000_000;
/// A tick of the twin takes about this long.
const STEP: Duration = Duration::from_micros(60);

/// 120 columns on 12 topics, as a docking has them: motion, forces, latches, digests.
fn columns() -> Vec<Column> {
    (0..120u64)
        .map(|i| {
            let (topic, name) = (format!("/signals/part_{}", i / 10), format!("signal_{i}_m"));
            match i % 10 {
                8 => Column::bool(topic, name),
                9 => Column::u64(topic, name),
                _ => Column::f64(topic, name),
            }
        })
        .collect()
}

/// Smooth signals with all their digits, which no compressor likes.
fn fill(row: &mut Vec<Cell>, tick: u64) {
    row.clear();
    let t = tick as f64 * 1e-3;
    row.extend((0..120u64).map(|i| {
        let x = i as f64;
        match i % 10 {
            8 => Cell::from(t > x / 12.0),
            9 if i == 9 => Cell::from(tick.wrapping_mul(0x9e37_79b9_7f4a_7c15)),
            9 => Cell::from(tick / 1000),
            // Forces, zero but for some time in contact.
            7 => Cell::from(if (4.0..6.0).contains(&t) { (t * x).sin() * 100.0 } else { 0.0 }),
            _ => Cell::from((0.3 * t + x).sin() * (-0.1 * t).exp()),
        }
    }));
}

fn contacts(tick: u64) -> Vec<ContactRow> {
    let n = if (4_000..6_000).contains(&tick) { 6 } else { 0 };
    let x = (tick as f64 * 1e-3).sin();
    (0..n)
        .map(|pair| ContactRow {
            pair,
            point_w_m: DVec3::splat(x * f64::from(pair)),
            normal_w: DVec3::new(x, 0.3 * x, 0.1),
            depth_m: 1e-4 * x,
            normal_force_n: 100.0 * x,
            friction_w_n: DVec3::splat(10.0 * x),
        })
        .collect()
}

/// Processor time of the recording threads so far, which other work on the machine does not change;
/// zero where the system does not tell.
fn recorder_time() -> Duration {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return Duration::ZERO };
    let nanos = tasks.flatten().filter_map(|t| {
        let name = std::fs::read_to_string(t.path().join("comm")).ok()?;
        let stat = std::fs::read_to_string(t.path().join("schedstat")).ok()?;
        let nanos: u64 = stat.split(' ').next()?.parse().ok()?;
        ["record", "record-table", "record-sync"].contains(&name.trim()).then_some(nanos)
    });
    Duration::from_nanos(nanos.sum())
}

fn run(mut each: impl FnMut(u64, &[Cell], &[ContactRow])) -> Duration {
    let mut row = Vec::new();
    let start = Instant::now();
    for i in 0..TICKS {
        let step = Instant::now();
        fill(&mut row, i);
        let c = contacts(i);
        while step.elapsed() < STEP {
            std::hint::spin_loop();
        }
        each(i, &row, &c);
    }
    start.elapsed()
}

#[test]
fn invariant_a_simulated_second_takes_less_than_2_mb() {
    let bare = run(|_, row, c| {
        black_box((row, c));
    });
    for policy in [Policy::Wait, Policy::DropNewest] {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let metadata = BTreeMap::new();
        let mut w = RunWriter::create(dir.path(), columns(), vec![], &metadata, policy)
            .expect("a fresh directory");
        let mut calls = Duration::ZERO;
        let recorded = run(|i, row, c| {
            let call = Instant::now();
            w.tick(Tick(i), SimTime::of_tick(Tick(i), MS), row, c).expect("the disk has room");
            calls += call.elapsed();
        });
        let (dropped, threads) = (w.dropped_ticks(), recorder_time());
        let closing = Instant::now();
        drop(w);
        let closing = closing.elapsed();
        let size = |name: &str| {
            std::fs::metadata(dir.path().join(name)).expect("a file").len() as f64 / 10.0
        };
        let (log, table) = (size("run.mcap"), size("telemetry.parquet"));
        let ms = |d: Duration| d.as_secs_f64() * 1e3;
        println!(
            "{policy}: {TICKS} ticks of {STEP:?} take {:.1} ms bare and {:.1} ms recorded ({:+.1} %); \
             {:.2} µs a call, {:.2} µs of processor a tick in the threads, {:.1} ms to close, \
             {dropped} dropped; a simulated second takes {:.3} MB of log and {:.3} MB of table",
            ms(bare),
            ms(recorded),
            (recorded.as_secs_f64() / bare.as_secs_f64() - 1.0) * 100.0,
            calls.as_secs_f64() * 1e6 / TICKS as f64,
            threads.as_secs_f64() * 1e6 / TICKS as f64,
            ms(closing),
            log / 1e6,
            table / 1e6,
        );
        assert!(log + table < 2e6, "{log} bytes of log and {table} of table a simulated second");
        assert!(policy == Policy::DropNewest || dropped == 0);
    }
}
