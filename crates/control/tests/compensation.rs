//! What every method against the delay must pass, whatever it does: one suite, one line a method.

use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
    hint::black_box,
    path::Path,
};

use docktwin_control::{
    compensation::{
        Compensation, Compensator, Demand, Lead, LoopContext, Measured, Method, Phase,
        Uncompensated,
    },
    feedforward::{PathTimes, PlateMotion},
};
use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{load_mechanism, load_rig, load_spacecraft};
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

impl Stage {
    fn new(delay: usize, without_every: Option<u64>) -> Self {
        let rig = load_rig(&model("stewart.urdf")).expect("the default rig").model;
        let platform = Platform::new(&rig);
        let load = |f| load_spacecraft(&model(f)).expect("a spacecraft").model;
        let mechanism =
            load_mechanism(&model("apas_active.urdf"), &model("apas_passive.urdf"), None);
        let mechanism = mechanism.expect("the mechanism").model;
        let system = System::new(&load("chaser_8t.urdf"), &load("target_12t.urdf"), mechanism);
        let conditions = ContactConditions {
            attitude: docktwin_core::Euler { roll: 0.02, pitch: 0.01, yaw: -0.01 },
            lateral_m: DVec3::new(0.0, 0.02, -0.01),
            velocity_m_s: DVec3::new(-0.2, 0.01, 0.0),
            rate_rad_s: DVec3::new(0.0, 0.002, 0.0),
            ..ContactConditions::default()
        };
        let bodies =
            Programme::new(&system, &initial_state(&system, &conditions, 0.05).bodies, TICK_S);
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
    // Finite in every phase, in contact, and with a measurement missing now and then.
    run(&mut delayed(), delay_ticks, None);
    let first = run(&mut delayed(), delay_ticks, Some(7));
    // No memory is asked for, from the reset on.
    let mut method = delayed();
    let mut stage = Stage::new(delay_ticks, Some(7));
    let asked = requests(|| {
        method.reset();
        for tick in 0..TICKS {
            black_box(stage.tick(&mut method, &control(tick)));
            black_box(method.digest());
        }
    });
    assert_eq!(asked, 0, "{} asks for memory", method.name());
    // Repeatable bit by bit; and a reset leaves nothing of an earlier run.
    let again = run(&mut delayed(), delay_ticks, Some(7));
    assert!(first == again, "{} does not repeat", method.name());
    method.reset();
    let after = run(&mut method, delay_ticks, Some(7));
    assert!(first == after, "something of the run before is left");
    // The identity where there is no delay: the motion wanted is commanded, and no wrench is added.
    let mut method = undelayed();
    let mut stage = Stage::new(0, None);
    for tick in 0..TICKS {
        let (correction, demand) = stage.tick(&mut method, &control(tick));
        let off = apart(&demand.pose.motion, &stage.motion);
        assert!(off < 1e-9, "tick {tick}: {off}");
        let added = correction.unwrap_or_default();
        assert!(added.port3.f.length() < 1e-6 && added.port4.f.length() < 1e-6, "{added:?}");
    }
    let name = delayed().name();
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    assert!(
        !name.is_empty() && name.chars().all(plain),
        "{name}: lower-case letters, digits and -"
    );
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
    for of in [|_: f64| Compensation::None, Compensation::Lead] {
        let made = |delay_s: f64| move || -> Method { of(delay_s).method() };
        conforms(made(0.0), made(3e-3), 3);
        assert_eq!(of(0.01).name(), of(0.01).method().name());
    }
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
