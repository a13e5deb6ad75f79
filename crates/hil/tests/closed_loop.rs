//! The whole loop on the emulated rig, in virtual time.
#![expect(clippy::unwrap_used, reason = "a test stops where something is wrong")]

mod common;

use common::stick::{Models, axis, emulated, models, settings};
use docktwin_control::{
    compensation::{Compensation, Published, Residual},
    safety::Limit,
};
use docktwin_core::{DVec3, PERIOD_NS, Pose};
use docktwin_hil::{
    clock::VirtualClock,
    scheduler::{Loop, Phase, TickRecord},
};
use docktwin_rigport::in_process::InProcess;
use docktwin_study::table4::{Contact, TABLE_4, VibroRun, VibroSettings, VibroTest};

fn run(m: &Models, test: &VibroTest, s: &VibroSettings, look: impl FnMut(&TickRecord)) -> VibroRun {
    let rig = emulated(m, test);
    let setup = test.setup(&m.rig, s).unwrap();
    let idle = Loop::new(setup, InProcess::new(rig), VirtualClock::new(PERIOD_NS));
    test.run(idle, look).unwrap()
}

/// Every row whose speeds the valves can follow, in every degree of freedom: without compensation a
/// contact gives back more than it took, with the believed delay led away it comes near one, with a
/// lead far beyond it takes energy out, and twins that know the stick leave a tenth of a per cent.
#[test]
fn invariant_energy_goes_with_the_sign_of_the_delay() {
    let m = models();
    for name in ["x", "y", "z", "roll", "pitch", "yaw"] {
        for row in [TABLE_4[2], TABLE_4[5]] {
            let test = VibroTest::new(row, &[axis(name)], &m.body, &m.stick).unwrap();
            let of = |c| run(&m, &test, &settings(c), |_| {}).contacts[0];
            let none = of(Compensation::None);
            let lead = of(Compensation::Lead(0.0018));
            let over = of(Compensation::Lead(0.010));
            let twin = of(Compensation::Twin { lead_s: 0.0018, residual: Residual::Felt });
            println!(
                "{name} {:.3} Hz: {:+.4} {:+.4} {:+.4} {:+.4}",
                row.frequency_hz,
                none.r_e - 1.0,
                lead.r_e - 1.0,
                over.r_e - 1.0,
                twin.r_e - 1.0
            );
            assert!(none.r_e > 1.01, "{name} {}: {none:?}", row.frequency_hz);
            assert!((lead.r_e - 1.0).abs() < 0.01, "{name} {}: {lead:?}", row.frequency_hz);
            assert!(over.r_e < 0.97, "{name} {}: {over:?}", row.frequency_hz);
            assert!((twin.r_e - 1.0).abs() < 0.001, "{name} {}: {twin:?}", row.frequency_hz);
        }
    }
}

/// The methods of the literature undo a delay that they know, each within a per cent.
#[test]
fn oracle_methods_of_the_literature_undo_a_delay() {
    let m = models();
    for name in ["y", "pitch"] {
        let test = VibroTest::new(TABLE_4[5], &[axis(name)], &m.body, &m.stick).unwrap();
        for method in Published::ALL.into_iter().filter(|m| *m != Published::Passivity) {
            let c = Compensation::Published { method, lead_s: 1.84e-3 };
            let found = run(&m, &test, &settings(c), |_| {}).contacts[0];
            println!("{name} {}: {:+.4} {:+.4}", method.name(), found.r_e - 1.0, found.r_t - 1.0);
            assert!((found.r_e - 1.0).abs() < 0.005, "{name} {}: {found:?}", method.name());
            assert!((found.r_t - 1.0).abs() < 0.005, "{name} {}: {found:?}", method.name());
        }
    }
}

/// Damping by energy brings the speed near where it belongs, and the time nowhere: never R_e without R_T.
#[test]
fn invariant_passivity_mends_the_speed_and_not_the_time() {
    let m = models();
    let test = VibroTest::new(TABLE_4[5], &[axis("y")], &m.body, &m.stick).unwrap();
    let of = |c| run(&m, &test, &settings(c), |_| {}).contacts[0];
    let none = of(Compensation::None);
    let c = Compensation::Published { method: Published::Passivity, lead_s: 1.84e-3 };
    let damped = of(c);
    println!(
        "none {:+.4}, passivity {:+.4} {:+.4}",
        none.r_e - 1.0,
        damped.r_e - 1.0,
        damped.r_t - 1.0
    );
    assert!((damped.r_e - 1.0).abs() < 0.5 * (none.r_e - 1.0), "{damped:?}");
    assert!(damped.r_t - 1.0 > 5.0 * (none.r_t - 1.0).abs(), "{damped:?}");
}

/// Fig. 41 to 44: contact after contact the peaks grow without compensation until the supervisor ends
/// it, and fall with too much.
#[test]
fn invariant_peaks_grow_without_compensation_and_fall_with_too_much() {
    let m = models();
    let test = VibroTest::new(TABLE_4[5], &[axis("x")], &m.body, &m.stick).unwrap();
    let many = |c, contacts| {
        let s = VibroSettings { contacts, ..settings(c) };
        run(&m, &test, &s, |_| {})
    };
    let peaks = |c: &[Contact]| c.iter().map(|c| c.peak_ratio * c.v0_m_s.abs()).collect::<Vec<_>>();
    let grows = many(Compensation::None, 8);
    let p = peaks(&grows.contacts);
    assert!(p.len() >= 6 && p.windows(2).all(|w| w[1] > w[0]), "{p:?}");
    let falls = many(Compensation::Lead(0.008), 6);
    let p = peaks(&falls.contacts);
    assert!(p.len() >= 4 && p.windows(2).all(|w| w[1] < w[0]), "{p:?}");
    // It does not end by itself.
    let diverges = many(Compensation::None, 60);
    let trip = diverges.trip.expect("the supervisor ends it");
    println!("{trip:?} after {} contacts", diverges.contacts.len());
}

/// What the loop adds is measured by the contact itself: R_e² − 1 of the kinetic energy, and with a lead that fits nothing.
#[test]
fn oracle_energy_that_the_loop_adds_is_what_the_speeds_say() {
    let m = models();
    for name in ["x", "y"] {
        let test = VibroTest::new(TABLE_4[4], &[axis(name)], &m.body, &m.stick).unwrap();
        for (c, within) in [(Compensation::None, 0.01), (Compensation::Lead(1.84e-3), 0.004)] {
            let (found, shares) = with_budget(&m, &test, &settings(c), 10.0);
            let (share, gained) = (*shares.last().unwrap(), found.contacts[0].r_e.powi(2) - 1.0);
            println!("{name} {}: {share:+.4} of {gained:+.4}", c.name());
            assert!((share - gained).abs() < within, "{name} {}: {share} {gained}", c.name());
        }
    }
}

/// A budget of 6 %: what a contact adds without compensation is damped from half of it on; where damping cannot keep
/// up the run ends. A loop that adds nothing is left alone.
#[test]
fn invariant_a_budget_of_energy_is_kept() {
    let m = models();
    let test = VibroTest::new(TABLE_4[2], &[axis("y")], &m.body, &m.stick).unwrap();
    let many = VibroSettings { contacts: 8, ..settings(Compensation::None) };
    let (free, _) = with_budget(&m, &test, &many, 1e3);
    let (kept, shares) = with_budget(&m, &test, &many, 0.06);
    let most = shares.iter().copied().fold(0.0, f64::max);
    println!("most {most:.4}, {:?}, {} contacts", kept.trip, kept.contacts.len());
    assert!(most > 0.03 && (most < 0.0601 || kept.trip.is_some_and(|t| t.limit == Limit::Energy)));
    let last = |run: &VibroRun| run.contacts.last().unwrap().v0_m_s.abs();
    assert!(last(&kept) < last(&free), "{} {}", last(&kept), last(&free));
    // A budget of a tenth of a per cent is passed in the first contact.
    let (stopped, _) = with_budget(&m, &test, &many, 1e-3);
    assert_eq!(stopped.trip.map(|t| t.limit), Some(Limit::Energy));
    // With twins it changes nothing.
    let twin = settings(Compensation::Twin { lead_s: 1.84e-3, residual: Residual::Felt });
    let of = |budget| with_budget(&m, &test, &twin, budget).0.contacts[0].r_e;
    assert_eq!(of(0.02).to_bits(), of(1e3).to_bits());
}

/// With a limit of energy: the run, and the shares that were seen.
fn with_budget(
    m: &Models,
    test: &VibroTest,
    s: &VibroSettings,
    share: f64,
) -> (VibroRun, Vec<f64>) {
    let mut setup = test.setup(&m.rig, s).unwrap();
    setup.limits.energy_gained = Some(share);
    let idle = Loop::new(setup, InProcess::new(emulated(m, test)), VirtualClock::new(PERIOD_NS));
    let mut shares = Vec::new();
    let run = test.run(idle, |r| {
        if r.phase == Phase::Closed {
            shares.extend(r.gained.map(|g| g.share));
        }
    });
    (run.unwrap(), shares)
}

/// Locus planning ends where the bodies begin, in position and in velocity.
#[test]
fn invariant_closing_the_loop_makes_no_bump() {
    let m = models();
    for name in ["x", "y", "yaw"] {
        let test = VibroTest::new(TABLE_4[5], &[axis(name)], &m.body, &m.stick).unwrap();
        let mut commands: Vec<(Phase, Pose, DVec3)> = Vec::new();
        run(&m, &test, &settings(Compensation::Lead(0.0018)), |r| {
            let p = DVec3::from_array(r.command.plate_position_m);
            let v = DVec3::from_array(r.command.plate_velocity_m_s);
            commands.push((r.phase, Pose::from_translation(p), v));
        });
        let k = commands.iter().position(|c| c.0 == Phase::Closed).unwrap();
        // What the command before the closing leads to, against the first one of the closed loop.
        let (before, last, first) = (&commands[k - 2], &commands[k - 1], &commands[k]);
        let speed = 1.5 * last.2 - 0.5 * before.2;
        let jump = (first.1.p - last.1.p - speed * 1e-3).length();
        let step = (first.2 - (2.0 * last.2 - before.2)).length();
        println!("{name}: {:.2e} m, {:.2e} m/s", jump, step);
        assert!(jump <= 1e-6, "{name}: the command jumps by {jump} m");
        assert!(step <= 1e-5, "{name}: its velocity jumps by {step} m/s");
    }
}

/// The same seed gives the same bits, another seed of the noise others.
#[test]
fn invariant_a_run_repeats_bit_by_bit() {
    let m = models();
    let test = VibroTest::new(TABLE_4[5], &[axis("x"), axis("y")], &m.body, &m.stick).unwrap();
    let digests = || {
        let mut out = Vec::new();
        run(&m, &test, &settings(Compensation::None), |r| out.push(r.digest()));
        out
    };
    let (a, b) = (digests(), digests());
    assert_eq!(a, b);
}
