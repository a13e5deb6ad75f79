//! The compensator `twin` on whole dockings with the emulated rig: right where the mechanism is as believed, and what
//! the hardware does that no twin knows comes through. The reference is the simulated system with the rig's own
//! mechanism; the control is the same method with the measured wrenches left out.

use std::path::Path;

use docktwin_record::{FidelityFigures, Summary};
use docktwin_run::{HilOptions, HilRun, RigMechanism, SummaryOnly};
use docktwin_scenario::{CompensatorChoice, Loader};

fn root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A fast docking, 2.5 s of it: contact, latches, joined rings.
fn docked(compensator: CompensatorChoice, structure: Option<&str>) -> Summary {
    let path = root().join("scenarios/apas_fast.toml");
    let scenario = Loader::new().set("run.duration_s", 2.5).load(&path).expect("a scenario");
    let file = structure.map(|s| root().join(format!("models/foreign/apas_{s}_active.toml")));
    let mechanism = RigMechanism { file, draw: None };
    let options = HilOptions { compensator: Some(compensator), mechanism, ..HilOptions::default() };
    let run = HilRun::new(&scenario, options).expect("a run");
    let rig = run.emulated().expect("a rig");
    run.run(rig, &mut SummaryOnly).expect("a summary")
}

fn felt(s: &Summary) -> FidelityFigures {
    s.fidelity.and_then(|f| f.felt).expect("compared").whole_run
}

/// Felt: 0.5 % of the force and 0.3 % of the pose are what is measured; a lead leaves 8.9 and 1.2 %.
#[test]
fn oracle_a_docking_is_felt_as_in_orbit() {
    let twin = docked(CompensatorChoice::Twin, None);
    let f = felt(&twin);
    let off = |x: Option<f64>| x.expect("a figure");
    assert!(off(f.nrms_force) < 0.01 && off(f.nrms_pose) < 0.006, "{f:?}");
    assert!((off(f.peak_force_ratio) - 1.0).abs() < 0.005, "{f:?}");
    let c = twin.compensator.expect("named");
    assert_eq!((c.name.as_str(), c.fell_back_s), ("twin", None));
    assert!(off(c.trust_min) > 0.9 && off(c.correction_rms_n) > 10.0, "{c:?}");
    let lead = docked(CompensatorChoice::Lead, None);
    assert!(off(felt(&lead).nrms_force) > 0.05, "{:?}", felt(&lead));
    let c = lead.compensator.expect("named");
    assert_eq!((c.name.as_str(), c.trust_mean, c.correction_rms_n), ("lead", None, None));
}

/// A mechanism of twice the axial stiffness, which the twins do not know.
#[test]
fn oracle_what_no_twin_knows_comes_through() {
    let off = |choice| felt(&docked(choice, Some("stiff"))).nrms_force.expect("a figure");
    let (twin, alone) = (off(CompensatorChoice::Twin), off(CompensatorChoice::TwinModelOnly));
    assert!(twin < 0.08 && alone > 4.0 * twin, "twin {twin}, model only {alone}");
}
