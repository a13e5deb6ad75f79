//! What the suites of the rig port share: a loop's commands, an ideal rig, rigs in other processes.
#![allow(dead_code, reason = "every suite takes what it needs")]

pub(crate) mod stick;

use std::{
    io::Read as _,
    process::{Child, Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

use docktwin_core::{DVec3, Pose};
use docktwin_hil::ideal::IdealRig;
use docktwin_model::Stick;
use docktwin_rigport::{
    clock::monotonic_ns,
    ipc::{RigServer, ServeOptions},
    message::{Capabilities, Flags, RigCommand, RigMeasurement, RigMode, Status, attitude},
    rig::{CommandForm, Plant, Rig},
};

pub(crate) const MS: u64 = 1_000_000;
/// Far longer than any answer takes, on a machine that does other things besides.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// Geometry of models/urdf/stewart.urdf, on which the rigs of other languages stand too.
fn x_b3() -> Pose {
    Pose::from_translation(DVec3::new(1.0, 0.0, 0.0))
}

fn x_4p() -> Pose {
    Pose::from_translation(DVec3::new(1.0, 0.0, 0.0))
}

fn middle() -> DVec3 {
    DVec3::new(0.6, 0.0, 0.0)
}

/// Table 4, rows 1 to 3.
const STICK: Stick =
    Stick { stiffness_n_m: 35.4e3, diameter_m: 0.0075, frame_opening_m: 0.0275, lever_m: 0.5 };

/// The plate with the mechanisms apart by `d` from the middle, in `e3`: `X_bp = X_b3 · X_34 · X_4p`.
pub(crate) fn plate_at(d: DVec3) -> Pose {
    x_b3() * Pose::from_translation(middle() + d) * x_4p()
}

pub(crate) fn start() -> Pose {
    plate_at(DVec3::ZERO)
}

pub(crate) fn ideal() -> IdealRig {
    let file =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = docktwin_model::load_rig(&file).expect("the default rig").model;
    IdealRig::new(&rig, STICK, middle().x, start())
}

/// A rig that takes no leg values and has no legs: it follows the plate's pose, and measures it without
/// error.
pub(crate) struct PoseOnly<P>(pub(crate) P);

impl<P> PoseOnly<P> {
    fn without_legs(mut m: RigMeasurement) -> RigMeasurement {
        let legs = Capabilities::LEG_LENGTH
            | Capabilities::LEG_SPEED
            | Capabilities::LEG_FORCE
            | Capabilities::VALVE_SPOOL;
        m.capabilities -= legs;
        m.capabilities |= Capabilities::PLATE_POSE | Capabilities::PLATE_TWIST;
        m.leg_count = 0;
        (m.plate_position_m, m.plate_attitude) = (m.truth_position_m, m.truth_attitude);
        let [x, y, z, a, b, c] = m.truth_twist;
        (m.plate_velocity_m_s, m.plate_rate_rad_s) = ([x, y, z], [a, b, c]);
        m
    }
}

impl<P: Plant> Plant for PoseOnly<P> {
    fn command_form(&self) -> CommandForm {
        CommandForm::POSE
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        Self::without_legs(self.0.answer(command))
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        Self::without_legs(self.0.alone(period_ns))
    }
}

/// A name that no other test uses at the same time.
pub(crate) fn unique(what: &str) -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    format!("test-{what}-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

/// A number for a session, never used before in this process.
pub(crate) fn new_session() -> u64 {
    static COUNT: AtomicU64 = AtomicU64::new(1);
    COUNT.fetch_add(1, Ordering::Relaxed)
}

/// What a loop in lockstep sends in tick `tick`, every number its own.
pub(crate) fn command(session: u64, tick: u64, mode: RigMode, x_bp: Pose) -> RigCommand {
    let six = |base: f64| core::array::from_fn(|i| base + i as f64 / 8.0);
    RigCommand {
        mode: mode as u32,
        flags: Flags::LOCKSTEP,
        leg_count: 6,
        session,
        tick,
        loop_time_ns: tick * MS,
        wakeup_ns: tick * MS,
        period_ns: MS,
        leg_length_m: six(3.0),
        leg_speed_m_s: six(0.25),
        leg_flow_speed_m_s: six(0.5),
        leg_force_n: six(1000.0),
        plate_position_m: x_bp.p.to_array(),
        plate_attitude: attitude(x_bp.q),
        plate_velocity_m_s: [0.01, 0.02, 0.03],
        plate_rate_rad_s: [0.1, 0.2, 0.3],
        ..RigCommand::zero()
    }
}

/// The same on `CLOCK_MONOTONIC`, due now.
pub(crate) fn now(mut c: RigCommand) -> RigCommand {
    c.flags -= Flags::LOCKSTEP;
    c.wakeup_ns = monotonic_ns();
    c
}

/// Sends, waits for the answer, and returns it as the loop would validate it one period later.
pub(crate) fn exchange(rig: &mut dyn Rig, c: &RigCommand) -> RigMeasurement {
    let later_ns = if c.flags.contains(Flags::LOCKSTEP) {
        c.loop_time_ns + c.period_ns
    } else {
        monotonic_ns().max(c.wakeup_ns) + 3_600_000 * MS
    };
    exchange_by(rig, c, later_ns)
}

/// Sends, waits for the answer, and validates it at `later_ns`.
pub(crate) fn exchange_by(rig: &mut dyn Rig, c: &RigCommand, later_ns: u64) -> RigMeasurement {
    rig.send(c).expect("sent");
    let answer = rig.receive(PATIENCE, later_ns).expect("validated");
    answer.expect("an answer within the patience")
}

/// A session begun: idle, then one tick of following at `x_bp`.
pub(crate) fn begin(rig: &mut dyn Rig, session: u64, x_bp: Pose) -> RigMeasurement {
    exchange(rig, &command(session, 0, RigMode::Idle, x_bp));
    let m = exchange(rig, &command(session, 1, RigMode::Track, x_bp));
    assert!(!m.is(Status::SAFE_STATE), "{m:?}");
    m
}

/// A server with an ideal rig in a thread of its own; stops when dropped.
pub(crate) struct Served {
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Served {
    pub(crate) fn of<P: Plant + Send + 'static>(name: &str, mut plant: P) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (seen, name) = (stop.clone(), name.to_owned());
        let (ready, is_ready) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let mut server = RigServer::open(&name).expect("a rig of a new name");
            ready.send(()).expect("someone waits");
            let options = ServeOptions { lockstep_patience: PATIENCE };
            let stop = || seen.load(Ordering::Relaxed);
            server.serve(&mut plant, options, stop, |_| ()).expect("the transport holds");
        });
        is_ready.recv().expect("the rig is open");
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking(), "the rig's thread has panicked");
        }
    }
}

/// Another process, killed when dropped.
pub(crate) struct Process(pub(crate) Child);

impl Process {
    pub(crate) fn kill(&mut self) {
        self.0.kill().expect("it is ours");
        self.0.wait().expect("it is ours");
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Name under which a test binary, started again as another process, finds what it is to do.
const ROLE: &str = "DOCKTWIN_TEST_ROLE";

/// Starts this very test binary as another process, which runs the ignored test `test` as `role`.
pub(crate) fn start_again(test: &str, role: &str) -> Process {
    let me = std::env::current_exe().expect("a path");
    let child = Command::new(me)
        .args(["--exact", test, "--ignored", "--nocapture"])
        .env(ROLE, role)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    Process(child.expect("a process"))
}

/// What the sensors of the rig in Python measure.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sensors {
    /// The contact alone.
    Bare,
    /// Weight, inertia and noise too.
    AsOfSteel,
}

/// The rig of validation/rig in Python; nothing where there is no Python with iceoryx2:
/// `DOCKTWIN_PYTHON`, or the environment that `cargo xtask test` makes.
pub(crate) fn python_rig(name: &str, sensors: Sensors, options: &[&str]) -> Option<Process> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let made = root.join("target/venv-validation/bin/python");
    let python = std::env::var_os("DOCKTWIN_PYTHON").map_or(made, Into::into);
    let mut joins = Command::new(&python);
    joins.args(["-c", "import iceoryx2, numpy"]).stderr(Stdio::null());
    if !joins.status().is_ok_and(|s| s.success()) {
        eprintln!("not checked: {} has no iceoryx2 and numpy", python.display());
        return None;
    }
    let script = root.join("validation/rig/rig.py");
    let mut command = Command::new(python);
    command.arg(script).args([name, "--lockstep-patience", "20"]).args(options);
    if sensors == Sensors::Bare {
        command.arg("--bare");
    }
    let child = command.spawn();
    Some(Process(child.expect("a process")))
}

/// What this process is to be, if it was started by [`start_again`].
pub(crate) fn role() -> Option<String> {
    std::env::var(ROLE).ok()
}

/// Becomes true when the process that started this one has ended.
pub(crate) fn orphaned() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let told = flag.clone();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        told.store(true, Ordering::Relaxed);
    });
    flag
}

/// Serves an ideal rig until the process that started this one ends.
pub(crate) fn serve_until_orphaned(name: &str, lockstep_patience: Duration) {
    let orphaned = orphaned();
    let mut server = RigServer::open(name).expect("a rig of a new name");
    let options = ServeOptions { lockstep_patience };
    let stop = || orphaned.load(Ordering::Relaxed);
    server.serve(&mut ideal(), options, stop, |_| ()).expect("the transport holds");
}
