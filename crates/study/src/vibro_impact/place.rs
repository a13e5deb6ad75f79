//! Table 4 where a rig stands: in this process or behind a port, in virtual or in real time.

use std::path::Path;

use docktwin_core::PERIOD_NS;
use docktwin_hil::{
    clock::{OverrunPolicy, RealtimeClock, VirtualClock},
    emulated::EmulationError,
    realtime::relax,
};
use docktwin_model::{
    DockingMechanism, ModelErrors, Rig, Spacecraft, load_mechanism, load_rig, load_spacecraft,
};
use docktwin_rigport::{in_process::InProcess, rig::Rig as RigPort};
use docktwin_run::{
    RunError,
    commission::DriveOptions,
    rig_place::{ClockKind, RigPlace, best_effort, connect, new_session, patience},
};
use docktwin_scenario::resolve_path;

use super::{LoopTiming, RigDraw, TestRun, VibroModels, VibroOptions, emulated_rig, run_test};
use crate::table4::{VibroError, VibroTest};

/// Why a test was not run to its end on a rig.
#[derive(Debug, thiserror::Error)]
pub enum PlacedTestError {
    /// There is no rig, or the machine does not grant real time.
    #[error(transparent)]
    Place(#[from] RunError),
    /// The rig cannot be emulated.
    #[error(transparent)]
    Emulation(#[from] EmulationError),
    /// The test was not run to its end.
    #[error(transparent)]
    Test(#[from] VibroError),
}

/// The models of Table 4, as they are shipped, for a rig of one's own.
#[derive(Clone, Debug)]
pub struct StickModels {
    /// The rig as its file describes it.
    pub rig: Rig,
    /// The mechanism with a stick.
    pub stick: DockingMechanism,
    /// Both spacecraft, but for mass and inertia.
    pub spacecraft: Spacecraft,
}

impl StickModels {
    /// Reads the rig, and the others beside it or among the models of docktwin above it.
    ///
    /// # Errors
    /// All problems of the first file that has some.
    pub fn load(rig: &Path) -> Result<Self, ModelErrors> {
        let file = |name: &str| {
            resolve_path(rig, Path::new(name))
                .or_else(|| resolve_path(rig, &Path::new("models/urdf").join(name)))
                .unwrap_or_else(|| rig.with_file_name(name))
        };
        Ok(Self {
            rig: load_rig(&rig.with_extension("urdf"))?.model,
            stick: load_mechanism(&file("stick_active.urdf"), &file("stick_passive.urdf"), None)?
                .model,
            spacecraft: load_spacecraft(&file("test_2026kg.urdf"))?.model,
        })
    }

    /// As a test takes them.
    #[must_use]
    pub const fn models(&self) -> VibroModels<'_> {
        VibroModels { rig: &self.rig, stick: &self.stick, spacecraft: &self.spacecraft }
    }
}

/// Runs one test on the rig that is named; `believed` is the rig as its file describes it. A rig behind
/// a port is what it is: there `draw` is not looked at.
///
/// # Errors
/// See [`PlacedTestError`].
pub fn on_rig(
    believed: &Rig,
    options: &VibroOptions,
    drive: &DriveOptions,
    test: &VibroTest,
    draw: RigDraw,
) -> Result<TestRun, PlacedTestError> {
    let known = options.unknown.believed(believed, draw);
    let at = At { believed: &known, options, drive, test };
    match &drive.place {
        RigPlace::Emulated => {
            at.run(InProcess::new(emulated_rig(believed, options, test, draw)?), 1)
        }
        RigPlace::Port(name) => at.run(connect(name)?, new_session()),
    }
}

struct At<'a> {
    believed: &'a Rig,
    options: &'a VibroOptions,
    drive: &'a DriveOptions,
    test: &'a VibroTest,
}

impl At<'_> {
    fn run<R: RigPort>(&self, rig: R, session: u64) -> Result<TestRun, PlacedTestError> {
        let settings = |patience| self.options.settings(self.believed, session, patience);
        match self.drive.clock {
            ClockKind::Virtual => {
                let settings = settings(patience::<VirtualClock>());
                let clock = VirtualClock::new(PERIOD_NS);
                Ok(run_test(self.test, self.believed, &settings, rig, clock)?)
            }
            ClockKind::Realtime => {
                let lacking = best_effort(&self.drive.realtime.apply()?);
                let settings = settings(patience::<RealtimeClock>());
                let clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
                let out = run_test(self.test, self.believed, &settings, rig, clock);
                relax();
                let TestRun { run, timing } = out?;
                Ok(TestRun { run, timing: LoopTiming { best_effort: lacking, ..timing } })
            }
        }
    }
}
