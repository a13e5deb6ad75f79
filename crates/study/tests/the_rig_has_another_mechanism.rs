//! A rig with a mechanism that the loop does not believe: held against the simulated system that has it.

use std::path::{Path, PathBuf};

use docktwin_core::DVec3;
use docktwin_physics::as_built::{Grade, MechanismDraw};
use docktwin_record::{Outcome, Summary};
use docktwin_run::{HilOptions, HilRun, RigMechanism};
use docktwin_scenario::{Loader, Scenario};
use docktwin_study::fidelity::{
    Cause, OnRig,
    draws::{self, DrawOptions, FIGURES},
    on_rig,
};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn fast(duration_s: f64) -> Scenario {
    Loader::new()
        .set("run.duration_s", duration_s)
        .load(&root().join("scenarios/apas_fast.toml"))
        .expect("shipped")
}

fn with(file: Option<&str>, number: Option<u64>) -> HilOptions {
    let file = file.map(|name| root().join(format!("models/foreign/apas_{name}_active.toml")));
    let draw = number.map(|number| MechanismDraw { number, grade: Grade::Fine });
    HilOptions { mechanism: RigMechanism { file, draw }, ..HilOptions::default() }
}

fn simulated(scenario: &Scenario, options: HilOptions) -> Summary {
    let run = HilRun::new(scenario, options).expect("a rig");
    run.simulate(DVec3::ZERO).expect("a rehearsal")
}

fn peak(on: &OnRig) -> f64 {
    on.hardware(on.window()).peak_force_ratio.expect("a docking")
}

/// A rig without any cause of deviation is its own simulated system, whatever mechanism it has. What is left of its
/// peak (0.3 % of the believed mechanism here, by the step of the rig) is far below what the system with the
/// believed mechanism differs by, so that the wrong reference would show.
#[test]
fn oracle_an_ideal_rig_is_the_simulated_system_with_its_mechanism() {
    let scenario = fast(2.5);
    let believed = simulated(&scenario, with(None, None)).peak_force_n;
    for options in [with(Some("stiff"), None), with(None, Some(4))] {
        let own = simulated(&scenario, options.clone()).peak_force_n;
        let apart = (own / believed - 1.0).abs();
        let on = on_rig(&scenario, &options, &Cause::ALL).expect("a run");
        assert!(on.stopped.is_none() && on.outcome == Outcome::Captured, "{on:?}");
        let off = (peak(&on) - 1.0).abs();
        assert!(apart > 0.03 && off < 0.2 * apart, "{options:?}: {off} of {apart}");
    }
}

/// Latches that catch 20 ms late do so on the rig and in the simulated system: the difference is the rig's alone.
#[test]
fn regress_late_latches_are_late_in_both() {
    let scenario = fast(2.5);
    let at_once = simulated(&scenario, with(None, None)).capture_s.expect("captured");
    let late = simulated(&scenario, with(Some("late_latch"), None)).capture_s.expect("captured");
    assert!(late - at_once > 0.015, "{late} {at_once}");
    let on = on_rig(&scenario, &with(Some("late_latch"), None), &[]).expect("a run");
    let later = on.fidelity.hardware.expect("a truth").capture_difference_s.expect("captured");
    assert!(later.abs() < 0.008, "{later}");
}

#[test]
fn regress_draws_are_those_of_their_numbers_and_have_figures() {
    let scenario = fast(1.6);
    let asked = DrawOptions { draws: 2, grade: Grade::Fine };
    let found = draws::draws(&scenario, &HilOptions::default(), asked, &mut ()).expect("draws");
    assert_eq!(found.draws.iter().map(|d| d.number).collect::<Vec<_>>(), [1, 2]);
    assert_ne!(found.draws[0].drawn, found.draws[1].drawn);
    let alone = on_rig(&scenario, &with(None, Some(2)), &[]).expect("a run");
    assert_eq!(found.draws[1].on_rig, alone);
    assert!(found.draws.iter().all(|d| d.same() && d.simulated == Outcome::Captured), "{found:?}");
    let all = FIGURES.iter().filter_map(|f| found.distribution(f)).collect::<Vec<_>>();
    assert!(all.len() == FIGURES.len() && all.iter().all(|d| d.n == 2 && d.p5 <= d.median));
    // Written and read back.
    let text = serde_json::to_string(&found).expect("it serialises");
    assert_eq!(serde_json::from_str::<draws::Draws>(&text).expect("as it was"), found);
}

/// A mechanism without a spread cannot be drawn, and the remedy is told.
#[test]
fn regress_without_a_spread_nothing_is_drawn() {
    let scenario =
        Loader::new().load(&root().join("scenarios/vibro_impact.toml")).expect("shipped");
    let told = HilRun::new(&scenario, with(None, Some(1))).err().expect("a stick has no spread");
    assert!(told.to_string().contains("no table [spread]"), "{told}");
    assert!(told.remedy().contains("models/urdf/apas_active.toml"));
}
