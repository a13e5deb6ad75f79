//! The validation stick, its runs, and rigs with faults.

use std::{cell::RefCell, path::Path, rc::Rc, time::Duration};

use docktwin_control::{compensation::Compensation, sensing::SensorScheme};
use docktwin_hil::{
    emulated::EmulatedRig,
    faults::{Fault, FaultyRig},
};
use docktwin_model::{
    DockingMechanism, HydraulicPreset, Rig as RigModel, Spacecraft, load_mechanism, load_rig,
    load_spacecraft,
};
use docktwin_rigport::{
    in_process::InProcess,
    message::{RigCommand, RigMeasurement},
    rig::{Plant, Rig, RigError},
};
use docktwin_study::table4::{Axis, VibroSettings, VibroTest};

pub(crate) struct Models {
    pub(crate) rig: RigModel,
    pub(crate) stick: DockingMechanism,
    pub(crate) body: Spacecraft,
}

pub(crate) fn models() -> Models {
    let at = |f: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(f);
    let stick = load_mechanism(&at("stick_active.urdf"), &at("stick_passive.urdf"), None);
    Models {
        rig: load_rig(&at("stewart.urdf")).expect("the default rig").model,
        stick: stick.expect("the stick").model,
        body: load_spacecraft(&at("test_2026kg.urdf")).expect("a body").model,
    }
}

pub(crate) fn axis(name: &str) -> Axis {
    Axis::ALL.iter().find(|a| a.0 == name).expect("an axis").1
}

pub(crate) fn settings(compensation: Compensation) -> VibroSettings {
    VibroSettings {
        preset: HydraulicPreset::Printed,
        parameters: None,
        compensation,
        scheme: SensorScheme::Single,
        contacts: 1,
        added_ticks: 0,
        session: 1,
        patience: Duration::ZERO,
    }
}

/// The emulated rig as its file says, with the mechanism of a test.
pub(crate) fn emulated(m: &Models, test: &VibroTest) -> EmulatedRig {
    let rest = m.rig.docking.pose([0.0; 6]);
    let preset = HydraulicPreset::Printed;
    EmulatedRig::new(&m.rig, preset, None, 1, test.system.clone(), &rest).expect("a rig")
}

/// Modes that were sent, tick by tick.
pub(crate) type Sent = Rc<RefCell<Vec<u32>>>;

/// The emulated rig with faults; what modes it is sent is kept.
pub(crate) struct Watched<R> {
    rig: FaultyRig<R>,
    /// Modes of all commands.
    pub(crate) sent: Sent,
}

impl<P: Plant> Watched<InProcess<P>> {
    pub(crate) fn new(plant: P, faults: &[Fault]) -> Self {
        Self { rig: FaultyRig::new(InProcess::new(plant), faults), sent: Sent::default() }
    }
}

impl<R: Rig> Rig for Watched<R> {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        self.sent.borrow_mut().push(command.mode);
        self.rig.send(command)
    }

    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        self.rig.receive(patience, now_ns)
    }
}
