//! The mechanism on the rig with its ring on a balance, against closed forms: sag, and what sensor A
//! carries.

use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Pose, Twist};
use docktwin_model::{
    AttenuationChoice, Attenuator, DockingMechanism, Offload, Rig, load_mechanism, load_rig,
    load_spacecraft, static_sag,
};
use docktwin_physics::{mechanism::System, mounted::Mounted};

const STEP_S: f64 = 1.25e-4;
const K_N_M: f64 = 3e5;
const RING_KG: f64 = 39.1;
const G: f64 = 9.81;

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name)
}

fn mechanism(choice: Option<AttenuationChoice>) -> DockingMechanism {
    load_mechanism(&model("apas_active.urdf"), &model("apas_passive.urdf"), choice)
        .expect("as the model says")
        .model
}

/// The shipped mechanism without dry friction and with an axial damper of `damping`, whose rest is that of
/// its spring alone.
fn frictionless(damping: f64) -> DockingMechanism {
    let mut out = mechanism(None);
    let Attenuator::Characteristic(a) = &mut out.attenuator else { panic!("by tables") };
    a.axial.dry_friction = 0.0;
    a.axial.damping.before_capture = damping;
    out
}

fn rig(offload: Option<Offload>) -> Rig {
    let mut out = load_rig(&model("stewart.urdf")).expect("as the model says").model;
    out.offload = offload;
    out
}

fn balance(share: f64, friction_n: f64, added_mass_kg: f64) -> Offload {
    Offload { share, friction_n, added_mass_kg, stiffness_n_m: 2e6, damping_ratio: 0.0 }
}

fn mounted(mechanism: DockingMechanism, rig: &Rig) -> Mounted {
    let [chaser, target] = ["chaser_8t.urdf", "target_12t.urdf"]
        .map(|name| load_spacecraft(&model(name)).expect("as the model says").model);
    Mounted::new(System::new(&chaser, &target, mechanism), rig, STEP_S)
}

/// The plate where nothing touches.
fn far(rig: &Rig) -> Pose {
    let mut x = rig.middle();
    x.p.x += 0.5;
    x
}

/// (1 − share) m g / k, whatever the balance adds to what moves.
#[test]
fn oracle_the_ring_sags_by_what_is_not_carried() {
    for share in [None, Some(0.9), Some(0.98), Some(1.0)] {
        for added in [0.0, 2.0, 40.0] {
            let rig = rig(share.map(|s| balance(s, 0.0, added)));
            let sag = (1.0 - share.unwrap_or(0.0)) * RING_KG * G / K_N_M;
            let mechanism = frictionless(4000.0);
            let told = &static_sag(&rig, &mechanism)[0];
            assert!((told.sag - sag).abs() < 1e-12, "{} {sag}", told.sag);
            assert!(
                (told.brake_share().expect("as the model says") - sag * K_N_M / 2500.0).abs()
                    < 1e-12
            );
            let found = -mounted(mechanism, &rig).ring_deflection().0.x;
            assert!((found - sag).abs() < 1e-9 + 1e-4 * sag, "{share:?} {added}: {found} {sag}");
        }
    }
}

/// Sensor A bears the weight that is left, and at rest nothing else comes to the ports.
#[test]
fn oracle_sensor_a_bears_what_is_not_carried() {
    for (share, left) in [(None, 1.0), (Some(0.98), 0.02), (Some(1.0), 0.0)] {
        let rig = rig(share.map(|s| balance(s, 0.0, 2.0)));
        let mounted = mounted(frictionless(4000.0), &rig);
        let weight = mounted.ring_weight();
        let expected = -left * RING_KG * G;
        assert!((weight.f.x - expected).abs() < 1e-9, "{} {expected}", weight.f.x);
        let at_rest = mounted.now(&far(&rig), &Twist::default());
        assert!(at_rest.port3.f.length() < 0.05, "{:?}", at_rest.port3);
    }
}

/// Every bit of rest, deflection and port wrenches of a ring that is shaken on the plate for 50 ms.
fn shaken(offload: Option<Offload>) -> Vec<u64> {
    let rig = rig(offload);
    let mut mounted = mounted(mechanism(None), &rig);
    let (start, mut out) = (far(&rig), Vec::new());
    let mut take = |v: [DVec3; 3]| {
        out.extend(v.iter().flat_map(|v| v.to_array()).map(f64::to_bits));
    };
    let rest = mounted.ring_deflection();
    take([rest.0, rest.1, DVec3::ZERO]);
    for i in 0..400 {
        let t = f64::from(i) * STEP_S;
        let (s, c) = (40.0 * t).sin_cos();
        let mut at = start;
        at.p += DVec3::new(0.01, 0.004, 0.0) * s;
        let twist = Twist { v: DVec3::new(0.01, 0.004, 0.0) * (40.0 * c), w: DVec3::ZERO };
        let (_, ports) = mounted.advance(&at, &twist);
        take([ports.port3.f, ports.port3.m, ports.port4.f]);
        let ring = mounted.ring_deflection();
        take([ring.0, ring.1, DVec3::ZERO]);
    }
    out
}

/// Without a table nothing hangs: the same bits as with a balance that lifts nothing, rubs nowhere and has no
/// mass, at rest and shaken. One that lifts a billionth of the weight is seen.
#[test]
fn invariant_none_is_no_balance() {
    let none = shaken(None);
    let lifting = |share: f64| Some(balance(share, 0.0, 0.0));
    assert!(none == shaken(lifting(0.0)), "no balance is not a balance that bears nothing");
    assert!(none != shaken(lifting(1e-9)));
    let differ = |other: &[u64]| none.iter().zip(other).filter(|(a, b)| a != b).count();
    assert!(differ(&shaken(Some(balance(0.98, 5.0, 2.0)))) > none.len() / 20);
    // And the whole weight is on the mechanism.
    let [without, with] = [None, Some(balance(0.98, 5.0, 2.0))]
        .map(|offload| mounted(mechanism(None), &rig(offload)).ring_weight().f.x);
    assert!((without + RING_KG * G).abs() < 1e-9 && (with - 0.02 * without).abs() < 1e-9);
}

/// A docking axis that lies: 98 % carried or not, the ring falls out of its soft travel, and that is said.
#[test]
fn oracle_a_lying_axis_is_refused_by_its_sag() {
    let mut lying = rig(None);
    lying.gravity_m_s2 = docktwin_core::DVec3::new(0.0, 0.0, -G);
    for choice in [AttenuationChoice::Characteristic, AttenuationChoice::Differential] {
        let mechanism = mechanism(Some(choice));
        let why = docktwin_model::sag_refusal(&lying, &mechanism).expect("as the model says");
        assert!(why.contains("would sag out of its travel"), "{why}");
        assert!(docktwin_model::sag_refusal(&rig(None), &mechanism).is_none());
    }
    // W/k of the soft axis: 0.48 m of 0.12 m.
    let sags = static_sag(&lying, &mechanism(None));
    let lateral = sags.iter().find(|s| s.channel == "lateral").expect("as the model says");
    assert!((lateral.sag - RING_KG * G / 800.0).abs() < 1e-9);
}

/// Both models of the attenuation have the same stiffness along the axis, so the same sag.
#[test]
fn oracle_both_attenuations_take_the_same_of_their_travel() {
    let rig = rig(None);
    let [tables, legs] = [AttenuationChoice::Characteristic, AttenuationChoice::Differential]
        .map(|choice| static_sag(&rig, &mechanism(Some(choice)))[0].clone());
    assert!((tables.travel_share() - legs.travel_share()).abs() < 1e-6);
    let [a, b] = [&tables, &legs].map(|s| s.brake_share().expect("as the model says"));
    assert!((a - b).abs() < 1e-6, "{a} {b}");
}
