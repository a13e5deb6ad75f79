//! The validation stick, its runs, and rigs that spoil what they measure.

use std::{cell::RefCell, path::Path, rc::Rc, time::Duration};

use docktwin_control::{compensator::Compensation, sensing::SensorScheme};
use docktwin_hil::{
    emulated::EmulatedRig,
    in_process::InProcess,
    port::{RigCommand, RigMeasurement, Sequence},
    rig::{Rig, RigError},
    vibro::{Axis, VibroSettings, VibroTest},
};
use docktwin_model::{
    DockingMechanism, HydraulicPreset, Rig as RigModel, Spacecraft, load_mechanism, load_rig,
    load_spacecraft,
};

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
        compensation,
        scheme: SensorScheme::Single,
        contacts: 1,
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

/// What becomes of a measurement on its way.
pub(crate) type Fate = Result<Option<RigMeasurement>, RigError>;

/// Modes that were sent, tick by tick.
pub(crate) type Sent = Rc<RefCell<Vec<u32>>>;

/// A rig whose measurements are spoilt on their way, and then judged as a transport judges them.
pub(crate) struct Spoilt<R, F> {
    rig: R,
    spoil: F,
    sequence: Sequence,
    /// Modes of all commands.
    pub(crate) sent: Sent,
}

impl<P: docktwin_hil::rig::Plant, F: FnMut(RigMeasurement) -> Fate> Spoilt<InProcess<P>, F> {
    pub(crate) fn new(plant: P, spoil: F) -> Self {
        let rig = InProcess::new(plant);
        Self { rig, spoil, sequence: Sequence::default(), sent: Sent::default() }
    }
}

impl<R: Rig, F: FnMut(RigMeasurement) -> Fate> Rig for Spoilt<R, F> {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        if command.session != self.sequence.session {
            self.sequence = Sequence { session: command.session, tick: None };
        }
        self.sent.borrow_mut().push(command.mode);
        self.rig.send(command)
    }

    fn receive(&mut self, patience: Duration, now_ns: u64) -> Fate {
        let Some(m) = self.rig.receive(patience, now_ns)? else { return Ok(None) };
        let Some(m) = (self.spoil)(m)? else { return Ok(None) };
        self.sequence.measurement(&m, now_ns).map_err(RigError::Refused)?;
        Ok(Some(m))
    }
}
