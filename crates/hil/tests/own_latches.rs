//! What a rig reports of mechanisms with latches of their own.

use std::{path::Path, time::Duration};

use docktwin_hil::emulated::{EmulatedRig, clear};
use docktwin_model::{load_mechanism, load_rig, load_spacecraft};
use docktwin_physics::mechanism::System;
use docktwin_rigport::{
    in_process::InProcess,
    message::{Flags, RigCommand, RigMode},
    rig::Rig as _,
};

/// As many latches as the mechanism has, not three; three of a mechanism without any, as ever.
#[test]
fn invariant_a_rig_reports_every_latch() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
    let file = |name: &str| folder.join(name);
    let rig = load_rig(&file("stewart.urdf")).expect("shipped").model;
    let [chaser, target] = ["chaser_8t.urdf", "target_12t.urdf"]
        .map(|name| load_spacecraft(&file(name)).expect("shipped").model);
    for (stem, copies, reported) in [("probe", 1, 1), ("probe", 6, 6), ("apas", 0, 3)] {
        let [active, passive] = ["active", "passive"].map(|s| file(&format!("{stem}_{s}.urdf")));
        let mut mechanism = load_mechanism(&active, &passive, None).expect("shipped").model;
        if let Some(latch) = mechanism.own_latches.first().cloned() {
            mechanism.own_latches = vec![latch; copies];
        }
        let system = System::new(&chaser, &target, mechanism);
        let at = clear(&rig, &system);
        let preset = rig.preset(None);
        let emulated =
            EmulatedRig::new(&rig, preset, None, 1, system, &at).expect("it has sensors");
        let mut rig = InProcess::new(emulated);
        let command = RigCommand {
            mode: RigMode::Idle as u32,
            flags: Flags::LOCKSTEP,
            session: 1,
            period_ns: 1_000_000,
            ..RigCommand::zero()
        };
        rig.send(&command).expect("in this process");
        let m = rig.receive(Duration::ZERO, 1_000_000).expect("one").expect("an answer");
        assert_eq!(m.latch_phases().len(), reported, "{stem}, {copies}");
    }
}
