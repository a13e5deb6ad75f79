//! `rig identify` against the truth of drawn rigs, through the port.

mod stand;

use docktwin_model::HydraulicPreset;
use stand::{Stand, TICK_S};

/// Load of a leg under the weight of the plate, at most, N.
const LOAD_N: f64 = 8e3;

/// Acceptance: delay ±0.1 ms, null bias ±0.03 % of spool, flow gain ±1 %. Where a bypass leaks (the
/// stiff preset), what is believed wrongly of the leak cannot be told from null bias.
#[test]
fn oracle_bias_gain_and_delay_are_those_of_the_draw() {
    for (preset, seed) in [
        (HydraulicPreset::Printed, 1),
        (HydraulicPreset::Printed, 2),
        (HydraulicPreset::Printed, 3),
        (HydraulicPreset::Consistent, 4),
        (HydraulicPreset::Consistent, 5),
        (HydraulicPreset::Stiff, 1),
        (HydraulicPreset::Stiff, 4),
    ] {
        let stand = Stand { preset, ..Stand::new(Some(seed)) };
        let (truth, found) = (stand.truth(), stand.identified(Vec::new(), Vec::new()));
        // A command is for the tick after it was given.
        let delay_s = truth.dead_time_s - TICK_S;
        println!("{preset:?} {seed}: delay {delay_s:.6} s, found {:.6} s", found.delay_s());
        assert!((found.delay_s() - delay_s).abs() < 2e-5);
        let oil = truth.hydraulic().expect("on oil");
        let valves = found.found.valves.expect("it has valves");
        let legs = [found.found, found.corrected].map(|p| p.legs.expect("it measures lengths"));
        for i in 0..6 {
            let (is, was) = (&oil.legs[i], &oil.believed_legs[i]);
            let gain = is.no_load_speed_m_s() / was.no_load_speed_m_s();
            let bias_error = valves.null_bias[i] - is.valve.null_bias;
            let gain_error = valves.flow_gain[i] / gain - 1.0;
            println!("   leg {i}: bias error {bias_error:+.1e}, gain error {gain_error:+.1e}");
            let area = was.oil.area_m2;
            let leaks = (is.oil.leakage_m3_s_pa - was.oil.leakage_m3_s_pa).abs() / (area * area);
            let hidden = leaks * LOAD_N / was.no_load_speed_m_s();
            assert!(bias_error.abs() < 3e-4 + hidden && gain_error.abs() < 1e-2);
            let friction = valves.friction_n[i] / is.friction.coulomb_n - 1.0;
            assert!(friction.abs() < 0.05, "friction of leg {i} is off by {friction}");
            // What is left under corrections.
            let (before, after) = (legs[0].hold_error_m[i], legs[1].hold_error_m[i]);
            let held = if preset == HydraulicPreset::Stiff { 2e-5 } else { 2e-6 };
            assert!(after.abs() < held, "{before} {after}");
            let apart = (legs[1].lag_s[i] - found.delay_s()).abs();
            assert!(apart < 5e-5, "leg {i} is {apart} s from the plate");
        }
    }
}

/// The same rig seen twice is the same rig, and a second look finds nothing left.
#[test]
fn invariant_identification_repeats() {
    let stand = Stand::new(Some(9));
    let (a, b) = (stand.identified(vec![1], vec![3.0]), stand.identified(vec![1], vec![3.0]));
    assert_eq!(a, b);
    let [first, second] = [a.found, a.corrected].map(|p| p.valves.expect("it has valves"));
    for i in 0..6 {
        assert!((first.null_bias[i] - second.null_bias[i]).abs() < 5e-5);
        assert!((first.flow_gain[i] / second.flow_gain[i] - 1.0).abs() < 2e-3);
    }
}
