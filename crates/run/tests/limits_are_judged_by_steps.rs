//! Case C2 and its kind: limits are judged by every physics step, so a verdict does not hang on the tick, and no
//! pass stands beside a peak above a limit. The figures of a summary mean what they say.

use std::path::PathBuf;

use docktwin_physics::reduced::Inputs;
use docktwin_record::{Outcome, Summary, Verdict};
use docktwin_run::{Rehearsal, RehearsalOptions, SummaryOnly, TwinKind};
use docktwin_scenario::{Loader, Scenario};

fn scenario(name: &str, loader: &Loader) -> Scenario {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../scenarios", name].iter().collect();
    loader.load(&path).expect("a scenario")
}

fn run(scenario: &Scenario) -> Summary {
    let options = RehearsalOptions { twin: TwinKind::Reduced, ..RehearsalOptions::default() };
    let rehearsal = Rehearsal::with(scenario, options).expect("the sides are apart");
    rehearsal.run(&mut SummaryOnly).expect("a summary")
}

#[test]
fn regress_a_verdict_does_not_hang_on_the_tick() {
    // (stiffness N/m, closing speed m/s, offset m): from far above a limit to just below it.
    let cases =
        [(1e8, 0.2, 0.02), (1e8, 0.1, 0.02), (3e7, 0.2, 0.0), (1e7, 0.15, 0.03), (1e7, 0.05, 0.0)];
    let mut exceeded = 0;
    for (stiffness, speed, offset) in cases {
        let outcomes: Vec<_> = [(0.0001, 10), (0.001, 100), (0.002, 200)]
            .map(|(tick_s, steps)| {
                let loader = Loader::new()
                    .set("mechanism.contact.stiffness_n_m", stiffness)
                    .set("initial.axial_speed_m_s", speed)
                    .set("initial.lateral_y_m", offset)
                    .set("run.duration_s", 1.5)
                    .set("run.tick_s", tick_s)
                    .set("run.steps_per_tick", i64::from(steps));
                let scenario = scenario("apas_nominal.toml", &loader);
                let s = run(&scenario);
                let l = &scenario.mechanism.limits;
                if s.verdict == Verdict::Pass {
                    let most = l.compression_n.max(l.tension_n).hypot(l.shear_n);
                    assert!(s.peak_force_n <= most && s.peak_penetration_m <= l.depth_m, "{s:?}");
                }
                s.outcome
            })
            .into();
        assert!(outcomes.iter().all(|o| *o == outcomes[0]), "{stiffness}, {speed}: {outcomes:?}");
        exceeded += u32::from(outcomes[0] == Outcome::LimitExceeded);
    }
    assert!((1..5).contains(&exceeded), "{exceeded} of 5: both sides of the limits are looked at");
}

#[test]
fn oracle_the_net_impulse_is_the_targets_change_of_momentum() {
    for name in ["basic_ring_ring.toml", "apas_nominal.toml"] {
        let scenario = scenario(name, &Loader::new().set("run.duration_s", 3.0));
        let rehearsal = Rehearsal::new(&scenario).expect("the sides are apart");
        let mut running = rehearsal.begin(SummaryOnly).expect("a sink");
        let first = running.situation().bodies[1].v;
        while !running.ended() {
            running.tick(&Inputs::default());
        }
        let last = running.situation().bodies[1].v;
        let (s, _) = running.finish();
        let change = (last - first).length() * scenario.target.mass_kg;
        let net = s.net_impulse_ns.expect("a figure");
        assert!((net - change).abs() < 1e-3 * change + 1e-6, "{name}: {net} against {change} N·s");
        assert!(net <= s.impulse_ns * 1.0001 || s.capture_s.is_some(), "{name}");
        let m = s.mass_kg.expect("masses");
        assert_eq!((m.chaser, m.target), (scenario.chaser.mass_kg, scenario.target.mass_kg));
    }
}
