//! Models and runs that several tests share.

#![allow(dead_code, reason = "every test is a crate of its own and uses a part")]

use std::{path::Path, time::Duration};

use docktwin_control::{feedforward::LegCorrections, rig::RigSetup, safety::SafetyLimits};
use docktwin_core::Pose;
use docktwin_hil::{
    clock::VirtualClock,
    drive::{Drive, DriveSetup},
    emulated::EmulatedRig,
    identify::{Identification, IdentifySetup, identify},
    scheduler::{Approach, Loop, LoopSetup, TickRecord},
};
use docktwin_model::{
    DockingMechanism, HydraulicPreset, Rig, Spacecraft, load_mechanism, load_rig, load_spacecraft,
};
use docktwin_physics::{body::BodyState, mechanism::System, mounted::Payload, reduced::Inputs};
use docktwin_rigport::{in_process::InProcess, rig::Rig as RigPort};

pub(crate) const TICK_NS: u64 = 1_000_000;
pub(crate) const TICK_S: f64 = 1e-3;

/// A rig, what stands on it and how it was drawn.
#[derive(Clone)]
pub(crate) struct Stand {
    pub(crate) rig: Rig,
    pub(crate) preset: HydraulicPreset,
    pub(crate) drawn: Option<u64>,
}

pub(crate) fn model(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name)
}

impl Stand {
    pub(crate) fn new(drawn: Option<u64>) -> Self {
        let rig = load_rig(&model("stewart.urdf")).expect("as the model says").model;
        Self { rig, preset: HydraulicPreset::Printed, drawn }
    }

    /// What the controllers believe.
    pub(crate) fn believed(&self) -> RigSetup {
        RigSetup::of_rig(&self.rig, self.preset, None)
    }

    /// What is built.
    pub(crate) fn truth(&self) -> RigSetup {
        RigSetup::of_rig(&self.rig, self.preset, self.drawn)
    }

    pub(crate) fn middle(&self) -> Pose {
        self.rig.docking.pose([0.0; 6])
    }

    pub(crate) fn emulated(&self, system: System, at: &Pose) -> EmulatedRig {
        let seed = self.drawn.unwrap_or(1);
        EmulatedRig::new(&self.rig, self.preset, self.drawn, seed, system, at)
            .expect("as the model says")
    }

    pub(crate) fn drive(
        &self,
        system: System,
        at: &Pose,
        corrections: LegCorrections,
    ) -> Drive<InProcess<EmulatedRig>, VirtualClock> {
        self.lead(InProcess::new(self.emulated(system, at)), corrections)
    }

    /// Leads any rig as this one.
    pub(crate) fn lead<R: RigPort>(
        &self,
        rig: R,
        corrections: LegCorrections,
    ) -> Drive<R, VirtualClock> {
        let setup = DriveSetup {
            rig: self.rig.clone(),
            feedforward: self.believed().feedforward(),
            corrections,
            limits: SafetyLimits::of_rig(&self.rig, 500.0, f64::INFINITY),
            speed: [0.1, 0.1],
            session: 7,
            patience: Duration::ZERO,
        };
        Drive::start(setup, rig, VirtualClock::new(TICK_NS)).expect("as the model says")
    }

    /// Identified in the middle, the mechanism out of the way.
    pub(crate) fn identified(&self, dofs: Vec<usize>, hz: Vec<f64>) -> Identification {
        let place = self.middle();
        let mut drive = self.drive(free_stick(), &place, LegCorrections::default());
        let legs = self.believed().hydraulic().map(|oil| oil.believed_legs);
        let setup = IdentifySetup { legs, place, room_m: 0.2, dofs, hz, lever_m: 0.5 };
        let found = identify(&mut drive, &setup).expect("as the model says");
        drive.finish().expect("as the model says");
        found
    }

    /// What sensor B carries by the file.
    pub(crate) fn payload(&self) -> Payload {
        Payload::of(self.rig.passive_payload, &self.rig.x_4p.inverse())
    }

    /// Set-up of a loop without compensation that believes the file.
    pub(crate) fn loop_setup(
        &self,
        system: &System,
        bodies: &[BodyState; 3],
        run_up_s: f64,
        ticks: u64,
    ) -> LoopSetup {
        LoopSetup::builder(&self.rig, self.preset, system, bodies)
            .loads(Some(5e4), Some(5e4))
            .approach(Approach { speed_m_s: 0.05, rate_rad_s: 0.05, settle_s: 0.5, run_up_s })
            .ticks(ticks)
            .build()
            .expect("as the model says")
    }

    /// Runs a loop to its end.
    pub(crate) fn run(&self, setup: LoopSetup, system: System, at: &Pose) -> Vec<TickRecord> {
        let rig = InProcess::new(self.emulated(system, at));
        let idle = Loop::new(setup, rig, VirtualClock::new(TICK_NS));
        let mut running = idle.arm(Vec::new()).expect("as the model says").start();
        let mut records = Vec::new();
        while !running.finished() {
            records.push(running.tick(&Inputs::default()).expect("as the model says"));
        }
        assert_eq!(running.stop().end().trip, None);
        records
    }
}

pub(crate) fn stick() -> DockingMechanism {
    load_mechanism(&model("stick_active.urdf"), &model("stick_passive.urdf"), None)
        .expect("as the model says")
        .model
}

pub(crate) fn body() -> Spacecraft {
    load_spacecraft(&model("test_2026kg.urdf")).expect("as the model says").model
}

/// The stick taken out of its frame: nothing touches.
pub(crate) fn free_stick() -> System {
    let mut stick = stick();
    stick.stick.as_mut().expect("as the model says").frame_opening_m = 10.0;
    System::new(&body(), &body(), stick)
}
