//! What every method against the delay must pass, whatever it does: one suite, one line a method.

use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
    hint::black_box,
    path::Path,
    sync::OnceLock,
};

use docktwin_control::{
    compensation::{
        Believed, Compensation, Compensator, Demand, Lead, LoopContext, Measured, Method, Order,
        Phase, Published, Residual, Twin, Uncompensated,
    },
    feedforward::{PathTimes, PlateMotion},
    one_sided::Interface,
    sensing::SensorScheme,
};
use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{Attenuator, Rig, load_mechanism, load_rig, load_spacecraft};
use docktwin_physics::{
    initial::{ContactConditions, initial_state},
    mechanism::System,
    mounted::Ports,
    platform::Platform,
    programme::{Programme, RelativeMotion},
    reduced::Inputs,
};

thread_local! {
    // Of this thread only: the test harness has threads of its own.
    static REQUESTS: Cell<u64> = const { Cell::new(0) };
}

/// The system's heap, counting.
struct Counting;

#[expect(unsafe_code, reason = "an allocator cannot be written without; it only counts")]
// SAFETY: every call goes unchanged to the system's allocator; the counter is a thread-local `Cell`
// without destructor, which needs no memory of its own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { Heap.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as promised by the caller.
        unsafe { Heap.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Requests for memory while `f` runs.
fn requests(f: impl FnOnce()) -> u64 {
    let before = REQUESTS.get();
    f();
    REQUESTS.get() - before
}

const TICK_S: f64 = 1e-3;
const PATHS: PathTimes = PathTimes { flow_ahead_s: 3.2e-3, force_ahead_s: 0.5e-3 };

/// A loop around a rig that shows what it is commanded, `delay` ticks late, with a spring between its
/// mechanisms: enough for a method to live in.
struct Stage {
    platform: Platform,
    bodies: Programme,
    motion: RelativeMotion,
    in_flight: [PlateMotion; 32],
    measured: Measured,
    ports: Ports,
    tick: u64,
    /// `p_34` along X at which the mechanisms touch, m.
    touches_at_m: f64,
    /// Ticks by which the plate comes later than commanded.
    delay: usize,
    /// A tick without a measurement every so many.
    without_every: Option<u64>,
}

fn model(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name)
}

/// A rig and what stands on it, as files say.
struct Files {
    rig: Rig,
    system: System,
}

/// The default rig with a mechanism between two spacecraft; `rigid` without a moving ring.
fn files(mechanism: &str, bodies: [&str; 2], rigid: bool) -> Files {
    let rig = load_rig(&model("stewart.urdf")).expect("the default rig").model;
    let [active, passive] = ["active", "passive"].map(|side| format!("{mechanism}_{side}.urdf"));
    let mechanism = load_mechanism(&model(&active), &model(&passive), None);
    let mut mechanism = mechanism.expect("the mechanism").model;
    if rigid {
        mechanism.attenuator = Attenuator::Rigid;
    }
    let [chaser, target] = bodies.map(|f| load_spacecraft(&model(f)).expect("a spacecraft").model);
    Files { system: System::new(&chaser, &target, mechanism), rig }
}

const BODIES: [&str; 2] = ["chaser_8t.urdf", "target_12t.urdf"];

/// The mechanism of the stage.
fn docking() -> &'static Files {
    static FILES: OnceLock<Files> = OnceLock::new();
    FILES.get_or_init(|| files("apas", BODIES, false))
}

/// The same without a moving ring, whose inertia in orbit no rig shows.
fn without_ring() -> &'static Files {
    static FILES: OnceLock<Files> = OnceLock::new();
    FILES.get_or_init(|| files("apas", BODIES, true))
}

impl Files {
    fn believed(&self) -> Believed<'_> {
        Believed {
            rig: &self.rig,
            system: &self.system,
            scheme: SensorScheme::Single,
            sensors: self.rig.sensors.map(|s| [s.force; 2]),
        }
    }
}

/// How far the mechanisms are apart at first, m; and so far that those of a model never touch on this stage.
const GAP_M: f64 = 0.05;
const FAR_M: f64 = 0.2;

impl Stage {
    fn new(delay: usize, without_every: Option<u64>) -> Self {
        Self::with_gap(delay, without_every, GAP_M)
    }

    fn with_gap(delay: usize, without_every: Option<u64>, gap_m: f64) -> Self {
        let Files { rig, system } = docking();
        let platform = Platform::new(rig);
        let conditions = ContactConditions {
            attitude: docktwin_core::Euler { roll: 0.02, pitch: 0.01, yaw: -0.01 },
            lateral_m: DVec3::new(0.0, 0.02, -0.01),
            velocity_m_s: DVec3::new(-0.2, 0.01, 0.0),
            rate_rad_s: DVec3::new(0.0, 0.002, 0.0),
            ..ContactConditions::default()
        };
        let bodies =
            Programme::new(system, &initial_state(system, &conditions, gap_m).bodies, TICK_S);
        let motion = bodies.free(0.0);
        let plate = Self::plate(&platform, &motion);
        Self {
            measured: Measured::none(plate.x_bp, motion.x_34),
            in_flight: [plate; 32],
            ports: Ports::default(),
            tick: 0,
            touches_at_m: motion.x_34.p.x - 0.03,
            platform,
            bodies,
            motion,
            delay,
            without_every,
        }
    }

    fn plate(platform: &Platform, m: &RelativeMotion) -> PlateMotion {
        PlateMotion::of_docking(platform, &m.x_34, &[m.twist, m.acceleration, m.jerk])
    }

    /// Where the run is: every phase comes.
    const fn phase(&self) -> Phase {
        match self.tick {
            0..20 => Phase::Move,
            20..40 => Phase::Settle,
            40..60 => Phase::RunUp,
            _ => Phase::Closed,
        }
    }

    /// What the rig measures; a spring from 30 mm of way on.
    fn measure(&mut self) {
        let fresh = self.without_every.is_none_or(|n| self.tick % n != n - 1);
        self.measured.fresh = fresh;
        if !fresh {
            return;
        }
        let shown = &self.in_flight[self.delay];
        let x_34 = self.platform.docking_from_plate(&shown.x_bp);
        let depth = (self.touches_at_m - x_34.p.x).max(0.0);
        let force = DVec3::X * (1e5 * depth);
        let port4 = Wrench { f: x_34.q.conjugate() * force, m: DVec3::ZERO };
        self.ports = Ports { port3: Wrench { f: -force, m: -x_34.p.cross(force) }, port4 };
        let legs = self.platform.at(&shown.x_bp);
        self.measured = Measured {
            fresh,
            age_s: 0.0,
            sensor_a: Some(self.ports.port3),
            sensor_b: Some(self.ports.port4),
            accelerometer: None,
            leg_length_m: Some(legs.length_m),
            leg_speed_m_s: Some(legs.rates(&shown.twist)),
            leg_force_n: Some([5e3; 6]),
            valve_spool: None,
            ring: Some([DVec3::X * -depth, DVec3::ZERO]),
            latches: [Some(0), Some(0), Some(0), None, None, None, None, None],
            joined: Some(false),
            x_bp: shown.x_bp,
            x_34,
        };
    }

    /// One tick with a method; what it demands.
    fn tick(&mut self, method: &mut impl Compensator, control: &Inputs) -> (Option<Ports>, Demand) {
        self.measure();
        let correction = method.wrench(&self.seen(control));
        if self.phase() == Phase::Closed {
            let add = correction.unwrap_or_default();
            let (port3, port4) = (self.ports.port3 + add.port3, self.ports.port4 + add.port4);
            self.motion = self.bodies.tick(&port3, &port4, control);
        }
        let next = self.motion;
        let demand = method.command(&self.seen(control), &next);
        self.in_flight.rotate_right(1);
        self.in_flight[0] = Self::plate(&self.platform, &demand.pose.motion);
        self.tick += 1;
        (correction, demand)
    }

    fn seen<'a>(&'a self, control: &'a Inputs) -> LoopContext<'a> {
        LoopContext {
            tick: self.tick,
            period_s: TICK_S,
            phase: self.phase(),
            bodies: &self.bodies,
            motion: &self.motion,
            control,
            measured: &self.measured,
            ports: &self.ports,
            in_flight: &self.in_flight,
            paths: PATHS,
        }
    }
}

/// Ticks of a test: all phases, and a contact in the last.
const TICKS: u64 = 600;

/// Control wrenches of a tick: a thruster that pulses.
fn control(tick: u64) -> Inputs {
    let mut out = Inputs::default();
    if tick % 100 < 30 {
        out.chaser.f = DVec3::new(80.0, 0.0, -20.0);
    }
    out
}

/// What a method gives back in a tick.
type Given = (Option<Ports>, Demand, Option<u64>);

/// Everything that a method gives back in a run on a fresh stage.
fn run(method: &mut impl Compensator, delay: usize, without_every: Option<u64>) -> Vec<Given> {
    let mut stage = Stage::new(delay, without_every);
    let mut strongest_n = 0.0_f64;
    let mut out = Vec::new();
    for tick in 0..TICKS {
        let (correction, demand) = stage.tick(method, &control(tick));
        // Finite in, finite out.
        assert!(demand.is_finite(), "tick {tick}: {demand:?}");
        let finite = |c: Ports| c.port3.is_finite() && c.port4.is_finite();
        assert!(correction.is_none_or(finite), "tick {tick}: {correction:?}");
        strongest_n = strongest_n.max(stage.ports.port4.f.length());
        out.push((correction, demand, method.digest()));
    }
    assert!(strongest_n > 50.0, "the stage shows no contact");
    out
}

/// How far two motions are apart, in m, rad and their rates.
fn apart(a: &RelativeMotion, b: &RelativeMotion) -> f64 {
    let x = a.x_34.inverse() * b.x_34;
    let rates = [(a.twist, b.twist), (a.acceleration, b.acceleration), (a.jerk, b.jerk)];
    let rates = rates.into_iter().map(|(a, b)| (a.v - b.v).length().max((a.w - b.w).length()));
    rates.fold(x.p.length().max(x.q.to_scaled_axis().length()), f64::max)
}

/// What every method must pass. `undelayed` makes it for a rig without delay, `delayed` for one of
/// `delay_ticks`.
fn conforms<C: Compensator>(
    undelayed: impl Fn() -> C,
    delayed: impl Fn() -> C,
    delay_ticks: usize,
) {
    behaves(delayed, delay_ticks);
    is_identity(undelayed());
}

/// Finite in every phase, in contact, and with a measurement missing now and then; no memory asked for, from the
/// reset on; repeatable bit by bit.
fn behaves<C: Compensator>(delayed: impl Fn() -> C, delay_ticks: usize) {
    run(&mut delayed(), delay_ticks, None);
    let first = run(&mut delayed(), delay_ticks, Some(7));
    let mut method = delayed();
    let mut stage = Stage::new(delay_ticks, Some(7));
    let asked = requests(|| {
        method.reset();
        for tick in 0..TICKS {
            black_box(stage.tick(&mut method, &control(tick)));
            black_box((method.digest(), method.report()));
        }
    });
    assert_eq!(asked, 0, "{} asks for memory", method.name());
    // And a reset leaves nothing of an earlier run.
    let again = run(&mut delayed(), delay_ticks, Some(7));
    assert!(first == again, "{} does not repeat", method.name());
    method.reset();
    let after = run(&mut method, delay_ticks, Some(7));
    assert!(first == after, "something of the run before is left");
    let name = delayed().name();
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    assert!(
        !name.is_empty() && name.chars().all(plain),
        "{name}: lower-case letters, digits and -"
    );
}

/// The identity where there is no delay, and nothing that a rig adds: the motion wanted is commanded, and no
/// wrench is added.
fn is_identity(mut method: impl Compensator) {
    let mut stage = Stage::with_gap(0, None, FAR_M);
    for tick in 0..TICKS {
        let (correction, demand) = stage.tick(&mut method, &control(tick));
        let off = apart(&demand.pose.motion, &stage.motion);
        assert!(off < 1e-9, "tick {tick}: {off}");
        let added = correction.unwrap_or_default();
        assert!(added.port3.f.length() < 1e-6 && added.port4.f.length() < 1e-6, "{added:?}");
    }
}

#[test]
fn invariant_no_compensation_conforms() {
    conforms(|| Uncompensated, || Uncompensated, 3);
}

#[test]
fn invariant_a_lead_conforms() {
    conforms(|| Lead::new(0.0), || Lead::new(3e-3), 3);
}

/// What the command line chooses from, by its own dispatch.
#[test]
fn invariant_every_choice_of_the_command_line_conforms() {
    let twin = |lead_s| Compensation::Twin { lead_s, residual: Residual::Felt };
    for of in [|_: f64| Compensation::None, Compensation::Lead, twin] {
        let made = |delay_s: f64, files: &'static Files| {
            move || -> Method { of(delay_s).method(&files.believed()) }
        };
        conforms(made(0.0, without_ring()), made(3e-3, docking()), 3);
        assert_eq!(of(0.01).name(), of(0.01).method(&docking().believed()).name());
    }
    for method in Published::ALL {
        let made = |lead_s: f64, files: &'static Files| {
            move || Compensation::Published { method, lead_s }.method(&files.believed())
        };
        conforms(made(0.0, without_ring()), made(3e-3, docking()), 3);
        assert_eq!(method.name(), made(3e-3, docking())().name());
    }
    // The control of validations leaves out what was measured, so it is no identity.
    let control = Compensation::Twin { lead_s: 3e-3, residual: Residual::LeftOut };
    behaves(|| control.method(&docking().believed()), 3);
    assert_eq!(control.name(), control.method(&docking().believed()).name());
}

/// Two spacecraft with a stick between them, and the stage of a moment: the bodies press it by 3 mm, the plate where it is
/// measured by 2 mm. With it the stiffness, N/m.
fn pressed_stick() -> (Files, Stage, f64) {
    let body = "test_2026kg.urdf";
    let files = files("stick", [body, body], false);
    let stick = files.system.mechanism().stick.expect("a stick");
    let docked_m = files.system.mechanism().docked_length_m();
    let at =
        |depth_m: f64| Pose::from_translation(DVec3::X * (docked_m - stick.play_m() - depth_m));
    let mut stage = Stage::new(0, None);
    stage.motion = RelativeMotion { x_34: at(3e-3), ..RelativeMotion::default() };
    stage.measured.x_34 = at(2e-3);
    stage.measured.x_bp = files.rig.plate_from_docking(&at(2e-3));
    stage.measured.fresh = true;
    (files, stage, stick.stiffness_n_m)
}

/// The stick on both twins: where the plate stands 1 mm off the bodies for long, the bodies are to feel K · 1 mm more
/// than was measured, whatever that is; of the model alone, the K · 3 mm of where they stand.
#[test]
fn oracle_the_twin_adds_what_the_plate_is_off_by() {
    let (files, stage, k) = pressed_stick();
    let found = |residual, measured_n: f64| {
        let mut stage_ports = Ports::default();
        stage_ports.port4.f.x = measured_n;
        let mut twin = Twin::new(&files.believed(), 0.0, residual);
        let control = Inputs::default();
        let mut last = None;
        for tick in 50..150 {
            let mut seen = stage.seen(&control);
            (seen.tick, seen.phase, seen.ports) = (tick, Phase::RunUp, &stage_ports);
            last = twin.wrench(&seen);
        }
        measured_n + last.expect("a correction").port4.f.x
    };
    for measured_n in [0.0, 2e-3 * k, 1000.0] {
        let felt = found(Residual::Felt, measured_n);
        assert!((felt - measured_n - k * 1e-3).abs() < 1e-6, "{felt}");
        let model = found(Residual::LeftOut, measured_n);
        assert!((model - k * 3e-3).abs() < 1e-6, "{model}");
    }
}

/// A model known beforehand adds the same, wherever the loop is: K times what bodies and plate are apart by.
#[test]
fn oracle_prior_force_adds_what_the_plate_is_off_by() {
    let (files, stage, k) = pressed_stick();
    let prior = Compensation::Published { method: Published::PriorForce, lead_s: 2e-3 };
    let mut prior = prior.method(&files.believed());
    let control = Inputs::default();
    let mut last = None;
    for tick in 60..160 {
        let mut seen = stage.seen(&control);
        (seen.tick, seen.phase) = (tick, Phase::Closed);
        last = prior.wrench(&seen);
    }
    let added = last.expect("a correction").port4.f.x;
    assert!((added - k * 1e-3).abs() < 1e-6, "{added}");
}

/// A spring of 94.4 kN/m that is read 0.84 ms late: once it is identified, a Smith predictor adds what the force has
/// risen by since; a phase lead of the force adds the same.
#[test]
fn oracle_smith_and_force_lead_undo_the_lag_of_the_sensor() {
    let (k, w) = (94.4e3, 15.0_f64);
    let files = docking();
    let late_s = files.rig.sensors.map_or(0.0, |s| Interface::of_sensor(&s.force).lag_s());
    let way = |t: f64| if t > 0.0 { 3e-3 * (w * t).sin() } else { 0.0 };
    for method in [Published::SmithLead, Published::SmithDob, Published::ForceLead] {
        let made = Compensation::Published { method, lead_s: late_s };
        let mut method = made.method(&files.believed());
        let mut stage = Stage::new(0, None);
        let control = Inputs::default();
        let mut worst_n = 0.0_f64;
        for tick in 0..80_u32 {
            let t = f64::from(tick) * TICK_S;
            let x_34 = Pose::from_translation(DVec3::X * (0.6 - way(t)));
            let a = DVec3::X * (w * w * way(t));
            stage.motion = RelativeMotion {
                x_34,
                acceleration: Twist { v: a, w: DVec3::ZERO },
                ..RelativeMotion::default()
            };
            (stage.measured.x_34, stage.measured.fresh) = (x_34, true);
            stage.ports.port4.f.x = k * way(t - late_s);
            let mut seen = stage.seen(&control);
            (seen.tick, seen.phase) = (u64::from(tick) + 60, Phase::Closed);
            let added = method.wrench(&seen).expect("a correction");
            if tick > 40 {
                worst_n = worst_n.max((added.port4.f.x - k * (way(t) - way(t - late_s))).abs());
                // Action and reaction, about the mass centres of nothing.
                assert!(
                    (added.port3.f + added.port4.f).length() < 1e-9
                        || method.name() == "force-lead"
                );
            }
        }
        let rises_n = k * 3e-3 * w * late_s;
        println!("{}: {worst_n:.3} of {rises_n:.1} N", method.name());
        assert!(worst_n < 0.03 * rises_n, "{}: {worst_n} of {rises_n} N", method.name());
    }
}

/// A motion that is a polynomial of their order is carried on exactly, across the ticks of a lead that is none of them.
#[test]
fn oracle_polynomials_are_exact_on_polynomials() {
    let lead_s = 3.7e-3;
    for (order, degree) in [(Order::First, 1), (Order::Second, 2), (Order::Third, 3)] {
        let made = Compensation::Published { method: Published::Polynomial(order), lead_s };
        let mut method = made.method(&docking().believed());
        let stage = Stage::new(0, None);
        let control = Inputs::default();
        let way = |t: f64| (0..=degree).map(|i| 0.1 * t.powi(i)).sum::<f64>();
        for tick in 0..400_u32 {
            let t = f64::from(tick) * TICK_S;
            let next = RelativeMotion {
                x_34: Pose::from_translation(DVec3::Y * way(t)),
                ..RelativeMotion::default()
            };
            let mut seen = stage.seen(&control);
            seen.tick = u64::from(tick);
            let found = method.command(&seen, &next).pose.motion.x_34.p.y;
            // Between two ticks a line is off by a T²/8, which the factors add up to 15 times.
            if tick > 20 {
                assert!(
                    (found - way(t + lead_s)).abs() < 15.0 * 0.6 * TICK_S * TICK_S / 8.0,
                    "{found}"
                );
            }
        }
    }
}

/// A chaser under thrust takes its ring along: F3 is −m a on the mean, and no rig shows it.
#[test]
fn oracle_the_ring_weighs_on_a_chaser_under_thrust() {
    let Files { system, .. } = docking();
    let mut stage = Stage::with_gap(0, None, 0.5);
    stage.touches_at_m = -1.0;
    let mut twin = Twin::new(&docking().believed(), 0.0, Residual::Felt);
    let mut control = Inputs::default();
    control.chaser.f.x = -400.0;
    let (mut sum, mut n) = (0.0, 0.0);
    for tick in 0..4060 {
        let (correction, _) = stage.tick(&mut twin, &control);
        if tick >= 2060 {
            sum += correction.expect("a correction").port3.f.x;
            n += 1.0;
        }
    }
    let mass = system.mass();
    let expected = mass[1].mass() * 400.0 / mass[0].mass();
    assert!((sum / n - expected).abs() < 0.02 * expected, "{} N, expected {expected} N", sum / n);
}

/// A lead is `x + τ v` with all derivatives led alike, and nothing else; none is the motion to the bit.
#[test]
fn oracle_what_none_and_a_lead_command() {
    let motion = RelativeMotion {
        x_34: Pose::new(DVec3::new(0.6, 0.01, -0.02), DQuat::from_rotation_y(0.05)),
        twist: Twist { v: DVec3::new(-0.2, 0.01, 0.0), w: DVec3::new(0.0, 0.02, -0.01) },
        acceleration: Twist { v: DVec3::new(0.5, 0.0, -0.1), w: DVec3::new(0.1, 0.0, 0.0) },
        jerk: Twist { v: DVec3::new(3.0, -1.0, 2.0), w: DVec3::new(0.0, 0.5, 0.0) },
    };
    let stage = Stage::new(0, None);
    let control = Inputs::default();
    let seen = stage.seen(&control);
    let none = Uncompensated.command(&seen, &motion);
    assert_eq!(none, Demand::of(motion));
    let tau = 0.004;
    let led = Lead::new(tau).command(&seen, &motion);
    assert!(led.flow.is_none() && led.force.is_none() && led.pose.contact.is_none());
    let x = led.pose.motion;
    let near = |a: DVec3, b: DVec3| (a - b).length() < 1e-15;
    assert!(near(x.x_34.p, motion.x_34.p + motion.twist.v * tau));
    assert!(near(x.twist.v, motion.twist.v + motion.acceleration.v * tau));
    assert!(near(x.acceleration.w, motion.acceleration.w + motion.jerk.w * tau));
    assert_eq!(x.jerk, motion.jerk);
    assert_eq!(Lead::new(tau).wrench(&seen), None);
}

/// The command of a twin on legs on oil once it has given up: the motion its lead later, and no contact expected.
fn is_led(demand: &Demand, next: &RelativeMotion, lead_s: f64) -> bool {
    let wanted = next.by_series([lead_s, lead_s.powi(2) / 2.0, lead_s.powi(3) / 6.0]);
    let alone = demand.pose.contact.is_none() && demand.flow.is_none() && demand.force.is_none();
    alone && apart(&demand.pose.motion, &wanted) < 1e-12
}

/// The spring of the stage touches 20 mm before the twins' mechanism would: they give up, say so, and their command
/// goes on alone; their correction fades.
#[test]
fn invariant_twins_that_are_far_off_give_up_and_lead() {
    let lead_s = 3e-3;
    let mut twin = Twin::new(&docking().believed(), lead_s, Residual::Felt);
    let mut stage = Stage::new(3, None);
    let mut gave_up = None;
    for tick in 0..TICKS {
        let (correction, demand) = stage.tick(&mut twin, &Inputs::default());
        let report = twin.report().expect("a model");
        if report.fallen_back {
            let since = tick - *gave_up.get_or_insert(tick);
            let seen = stage.seen(&Inputs::default()).tick;
            assert_eq!(seen, tick + 1);
            assert!(is_led(&demand, &stage.motion, lead_s), "tick {tick}");
            let added = correction.expect("a correction").port4.f.length();
            assert!(since < 200 || added < 1.0, "{added} N after {since} ticks");
        }
    }
    let tick = gave_up.expect("it gives up");
    // It touches first about 150 ms after closing, and is known to be wrong 0.1 s later.
    assert!((200..400).contains(&tick), "in tick {tick}");
}

/// The suite sees what it is to see.
mod negative_controls {
    use super::*;

    /// A method with a defect.
    #[derive(Clone)]
    struct Bad {
        lead: Lead,
        memory: Vec<f64>,
        defect: Defect,
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Defect {
        Allocates,
        Remembers,
        NotFinite,
        Adds,
    }

    impl Compensator for Bad {
        fn name(&self) -> &'static str {
            "bad"
        }

        fn reset(&mut self) {
            if self.defect != Defect::Remembers {
                self.memory.clear();
            }
        }

        fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
            let mut out = *seen.ports;
            out.port4.f *= 0.01;
            (self.defect == Defect::Adds).then_some(out)
        }

        fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
            let mut out = self.lead.command(seen, next);
            match self.defect {
                Defect::Allocates => self.memory.push(next.x_34.p.x),
                Defect::Remembers => {
                    // One number, kept over a reset.
                    if self.memory.is_empty() {
                        self.memory.push(0.0);
                    }
                    self.memory[0] += 1e-6 * seen.ports.port4.f.length();
                    out.pose.motion.x_34.p.y += self.memory[0];
                }
                Defect::NotFinite if !seen.measured.fresh => {
                    out.pose.motion.x_34.p.x /= 0.0;
                }
                Defect::NotFinite | Defect::Adds => {}
            }
            out
        }
    }

    fn refused(defect: Defect) -> String {
        let made = move |lead_s| {
            move || Bad { lead: Lead::new(lead_s), memory: Vec::with_capacity(1), defect }
        };
        let found = std::panic::catch_unwind(|| conforms(made(0.0), made(3e-3), 3));
        let why = found.expect_err("the suite lets it pass");
        let owned = why.downcast_ref::<String>().cloned();
        owned.or_else(|| why.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default()
    }

    #[test]
    fn invariant_a_method_with_a_defect_does_not_conform() {
        assert!(refused(Defect::Allocates).contains("asks for memory"));
        assert!(refused(Defect::Remembers).contains("left"));
        assert!(refused(Defect::NotFinite).contains("Demand"));
        assert!(refused(Defect::Adds).contains("Ports"));
    }
}

/// Twins that are not finite are not felt, their command goes on alone, and that is told from then on.
#[test]
fn invariant_twins_that_are_not_finite_fall_back_and_say_so() {
    let none = Inputs::default();
    let mut twin = Twin::new(&docking().believed(), 0.003, Residual::Felt);
    let mut stage = Stage::new(2, None);
    for _ in 0..100 {
        stage.tick(&mut twin, &none);
    }
    assert!(!twin.report().expect("a model").fallen_back);
    let lost = RelativeMotion { x_34: Pose::new(DVec3::NAN, DQuat::IDENTITY), ..stage.motion };
    let seen = LoopContext { motion: &lost, ..stage.seen(&none) };
    assert_eq!(twin.wrench(&seen), None);
    for _ in 0..50 {
        let next = stage.motion;
        assert!(is_led(&twin.command(&stage.seen(&none), &next), &next, 0.003));
        let (correction, demand) = stage.tick(&mut twin, &none);
        assert!(correction.is_none_or(|c| c == Ports::default()) && demand.is_finite());
        let report = twin.report().expect("a model");
        assert!(report.fallen_back && report.trust <= 0.0 && report.residual.is_finite());
    }
}
