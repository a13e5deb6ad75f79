//! Energy account of drawn dockings, in both twins, at full size: `cargo run --release -p docktwin-twin --example
//! docking_survey -- TWIN REGION COUNT [FIRST]`, TWIN `reduced` or `full`, REGION `usual` or `wild`.
//!
//! Account: change of kinetic, stored and lost energy over three seconds or until 50 ms after capture, relative to
//! the kinetic energy brought in, looked at every millisecond; ≤ 1e-3. Dockings that pass a limit of the
//! mechanism (loads, travel, depth) are counted apart: what follows a limit is no docking.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "its purpose")]

#[path = "../../physics/tests/common/mod.rs"]
mod common;
#[path = "../../physics/tests/common/draws.rs"]
mod draws;

use std::process::ExitCode;

use docktwin_physics::{
    mechanism::System,
    reduced::{DockingState, DockingTwin, Energy, Inputs, ReducedTwin},
};
use docktwin_twin::FullTwin;

const STEP_S: f64 = 1e-4;
const STEPS: u32 = 30_000;
const BOUND: f64 = 1e-3;

#[derive(Debug, Default)]
struct Found {
    touched: u64,
    captured: u64,
    limit: u64,
    counted: u64,
    out_of_bounds: u64,
    worst: f64,
}

fn energy(system: &System, s: &DockingState) -> Energy {
    system.energy(s, &system.measure(&s.mechanism, &s.poses()))
}

/// Error of the account, whether it touched, whether it was captured: `None` once a limit is passed.
fn account(mut twin: impl DockingTwin) -> Option<(f64, bool, bool)> {
    let e0 = energy(twin.system(), &twin.state()).kinetic;
    let (mut worst, mut touched) = (0.0f64, false);
    for i in 1..=STEPS {
        twin.step(&Inputs::default());
        if i % 10 != 0 {
            continue;
        }
        let s = twin.state();
        if s.limit.is_some() {
            return None;
        }
        touched |= s.first_contact_s.is_some();
        let e = energy(twin.system(), &s);
        worst = worst.max(((e.kinetic + e.stored + e.lost) / e0 - 1.0).abs());
        if s.mechanism.captured_s().is_some_and(|c| f64::from(i) * STEP_S > c + 0.05) {
            return Some((worst, touched, true));
        }
    }
    Some((worst, touched, false))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let word = |i: usize| arguments.get(i).map_or("", String::as_str);
    let number = |i: usize, or: u64| word(i).parse().unwrap_or(or);
    let region = match word(2) {
        "usual" => draws::USUAL,
        "wild" => draws::WILD,
        _ => {
            eprintln!(
                "name a twin (reduced, full), a region (usual, wild), a count and a first draw"
            );
            return ExitCode::from(2);
        }
    };
    let full = word(1) == "full";
    let system = System::new(&common::chaser(), &common::target(), common::apas());
    let mut found = Found::default();
    let (count, first) = (number(3, 100), number(4, 0));
    for k in first..first + count {
        let c = draws::Draws::new(0xD0C0 + k).conditions(&region);
        let bodies = common::start(&system, &c, 2e-3).bodies;
        let one = if full {
            account(FullTwin::new(system.clone(), bodies, STEP_S))
        } else {
            account(ReducedTwin::new(system.clone(), bodies, STEP_S))
        };
        let Some((error, touched, captured)) = one else {
            found.limit += 1;
            continue;
        };
        found.touched += u64::from(touched);
        found.captured += u64::from(captured);
        found.counted += 1;
        found.worst = if error.is_nan() { error } else { found.worst.max(error) };
        if error.is_nan() || error > BOUND {
            found.out_of_bounds += 1;
            println!("  draw {k}: off by {error:e} with {c:?}");
        }
    }
    println!("{} {} {first}+{count}: {found:?}", word(1), region.name);
    ExitCode::from(u8::from(found.out_of_bounds > 0))
}
