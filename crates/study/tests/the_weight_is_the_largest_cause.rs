//! A fast docking on the rig with and without the balance: which cause makes it differ from the one in orbit.

use std::{fs, path::Path};

use docktwin_run::HilOptions;
use docktwin_scenario::{Loader, Scenario};
use docktwin_study::fidelity::{Cause, OnRig, on_rig};

/// Of the repository, in 2.5 s, which holds its capture and a second after it.
fn fast(root: &Path) -> Scenario {
    Loader::new()
        .set("run.duration_s", 2.5)
        .load(&root.join("scenarios/apas_fast.toml"))
        .expect("shipped")
}

/// The default rig without its table `[offload]`, in a folder.
fn without_balance(root: &Path, to: &Path) -> HilOptions {
    for ext in ["urdf", "toml"] {
        let name = format!("stewart.{ext}");
        let text = fs::read_to_string(root.join("models/urdf").join(&name)).expect("shipped");
        let text = match (text.find("[offload]"), text.find("# Half-widths by which")) {
            (Some(begin), Some(end)) => format!("{}{}", &text[..begin], &text[end..]),
            _ if ext == "toml" => panic!("the default rig has no [offload] any more"),
            _ => text,
        };
        fs::write(to.join(name), text).expect("a file");
    }
    HilOptions { model: Some(to.join("stewart.toml")), ..HilOptions::default() }
}

fn force(on: &OnRig) -> f64 {
    on.hardware(on.window()).nrms_force.expect("a docking")
}

/// The weight of the ring makes a third of the force wrong, more than any other cause; the balance of the
/// default rig takes it away, and so does the removal of that cause.
#[test]
fn regress_a_balance_removes_what_the_weight_does() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let (scenario, dir) = (fast(&root), tempfile::tempdir().expect("a folder"));
    let bare = without_balance(&root, dir.path());
    let weighed = on_rig(&scenario, &bare, &[]).expect("a run");
    let carried = on_rig(&scenario, &HilOptions::default(), &[]).expect("a run");
    assert!(force(&weighed) > 0.25, "{weighed:?}");
    let mut left: Vec<(Cause, f64)> = Cause::ALL
        .into_iter()
        .map(|cause| (cause, force(&on_rig(&scenario, &bare, &[cause]).expect("a run"))))
        .collect();
    left.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (first, removed) = left[0];
    assert!(first == Cause::Weight && removed < 0.05, "{left:?}");
    // Nothing else takes as much as a quarter of what the weight does.
    let takes = |x: f64| force(&weighed) - x;
    assert!(left[1..].iter().all(|(_, x)| takes(*x) < 0.25 * takes(removed)), "{left:?}");
    // Where a balance carries it there is nothing left for its removal to take.
    assert!(force(&carried) < 0.06, "{carried:?}");
    let again = on_rig(&scenario, &HilOptions::default(), &[Cause::Weight]).expect("a run");
    assert!((force(&carried) - force(&again)).abs() < 0.1 * takes(removed), "{again:?}");
    let peak = |on: &OnRig| on.hardware(on.window()).peak_force_ratio.expect("a docking") - 1.0;
    assert!(peak(&weighed) < -0.08 && peak(&carried).abs() < 0.02);
    // Felt and hardware are told apart: until the latches hold, sensor A does not feel what the ring takes.
    let felt = carried.felt(carried.window()).nrms_force.expect("a docking");
    assert!(felt > force(&carried), "{felt}");
}
