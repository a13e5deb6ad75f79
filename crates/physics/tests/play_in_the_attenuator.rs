//! Backlash before spring, damper and brake of a channel, against closed forms.
mod common;

use core::f64::consts::PI;

use docktwin_core::{DVec3, Pose, Twist};
use docktwin_model::{Attenuator, AxisChannel, SeriesBrake};
use docktwin_physics::{
    attenuator::{self, AttenuatorGeometry, AttenuatorState, elastic_wrench, stored_energy},
    mechanism::System,
    reduced::Inputs,
};

const K: f64 = 3e5;
const M: f64 = 4800.0;
const PLAY: f64 = 1e-3;
const H: f64 = 1e-5;

/// A mass on the axial channel alone, along X.
struct Ring {
    model: Attenuator,
    state: AttenuatorState,
    x: f64,
    v: f64,
    lost: f64,
}

/// A channel with play, spring and damper alone.
fn channel(damping: f64) -> AxisChannel {
    AxisChannel { backlash: PLAY, ..common::channel(K, [damping, damping], [1.0, 1.0], 1e6, 0.0) }
}

impl Ring {
    fn new(axial: AxisChannel, x: f64, v: f64) -> Self {
        let mut c = common::attenuator();
        c.axial = axial;
        let state = AttenuatorState::default();
        Self { model: Attenuator::Characteristic(c), state, x, v, lost: 0.0 }
    }

    fn geometry(&self) -> AttenuatorGeometry {
        AttenuatorGeometry::new(Pose::from_translation(DVec3::X * self.x), 0.0)
    }

    fn stored(&self) -> f64 {
        stored_energy(&self.model, &self.geometry(), &self.state)
    }

    fn energy(&self) -> f64 {
        0.5 * M * self.v * self.v + self.stored() + self.lost
    }

    /// One step of the twins' scheme; gives the force.
    fn step(&mut self) -> f64 {
        self.x += 0.5 * H * self.v;
        let g = self.geometry();
        let (start, mut mid) = (self.v, self.v);
        let mut f = attenuator::AttenuatorForce::default();
        for _ in 0..8 {
            let rel = Twist { v: DVec3::X * mid, w: DVec3::ZERO };
            f = attenuator::force(&self.model, &g, &self.state, rel, 0.0, H);
            mid = start + 0.5 * H * f.on_ring.f.x / M;
        }
        self.v = 2.0 * mid - start;
        self.state = f.next;
        self.lost += f.lost_w * H;
        self.x += 0.5 * H * self.v;
        f.on_ring.f.x
    }

    /// Held at a deflection, moving at `v`, for a step.
    fn held(&mut self, x: f64, v: f64) -> f64 {
        self.x = x;
        let rel = Twist { v: DVec3::X * v, w: DVec3::ZERO };
        let f = attenuator::force(&self.model, &self.geometry(), &self.state, rel, 0.0, H);
        self.state = f.next;
        f.on_ring.f.x
    }
}

/// Without damping: half a swing on the spring to either side and the play crossed twice,
/// T = 2π √(m/k) + 2 b/v, and the way out is b/2 + v √(m/k).
#[test]
fn oracle_a_mass_swings_through_the_play() {
    let v = 0.05;
    let mut ring = Ring::new(channel(0.0), 0.0, v);
    let e0 = ring.energy();
    let (mut ups, mut most, mut account) = (Vec::new(), 0.0f64, 0.0f64);
    let mut before = 0.0;
    for i in 0..300_000 {
        ring.step();
        if before < 0.0 && ring.x >= 0.0 {
            ups.push((f64::from(i) + before / (before - ring.x)) * H);
        }
        before = ring.x;
        most = most.max(ring.x);
        account = account.max((ring.energy() / e0 - 1.0).abs());
    }
    let period = (ups[ups.len() - 1] - ups[0]) / (ups.len() - 1) as f64;
    let expected = 2.0 * PI * (M / K).sqrt() + 2.0 * PLAY / v;
    assert!((period / expected - 1.0).abs() < 1e-5, "{period} {expected}");
    let way = 0.5 * PLAY + v * (M / K).sqrt();
    assert!((most / way - 1.0).abs() < 1e-5, "{most} {way}");
    assert!(account < 1e-6 && ring.lost.abs() < 1e-6 * e0, "{account} {}", ring.lost);
}

/// With a damper the element is a Kelvin–Voigt contact that does not pull: it takes the ring for φ/ω_d and
/// gives it back with e = exp(−ζ φ/√(1−ζ²)), φ = atan2(2ζ√(1−ζ²), 2ζ²−1).
#[test]
fn oracle_the_element_throws_the_ring_back() {
    for damping in [4000.0, 20_000.0] {
        let v = 0.05;
        let mut ring = Ring::new(channel(damping), 0.0, v);
        let zeta = damping / (2.0 * (K * M).sqrt());
        let root = (1.0 - zeta * zeta).sqrt();
        let phi = (2.0 * zeta * root).atan2(2.0 * zeta * zeta - 1.0);
        let (e, lasts) = ((-zeta * phi / root).exp(), phi / ((K / M).sqrt() * root));
        let (e0, mut account, mut pushed) = (ring.energy(), 0.0f64, 0u32);
        while ring.v > 0.0 || ring.x > 0.0 {
            if ring.step() < 0.0 {
                pushed += 1;
            }
            account = account.max((ring.energy() / e0 - 1.0).abs());
        }
        assert!((-ring.v / v / e - 1.0).abs() < 1e-4, "{damping}: {} {e}", -ring.v / v);
        let lasted = f64::from(pushed) * H;
        assert!((lasted / lasts - 1.0).abs() < 1e-3, "{damping}: {lasted} {lasts}");
        assert!(account < 1e-3, "{damping}: {account}");
    }
}

/// An end that was let go goes back by itself: e(t) = e₀ exp(−k t/c), so that the ring, back again, finds it
/// where it then is.
#[test]
fn oracle_an_end_let_go_creeps_back() {
    let c = 40_000.0;
    let mut ring = Ring::new(channel(c), 0.0, 0.0);
    // Pushed at a speed, then taken away within a step; there the end is free.
    let e0 = 4e-4;
    assert!(ring.held(0.5 * PLAY + e0, 0.1) < -K * e0);
    for i in 1..=20_000 {
        assert!(ring.held(0.0, -0.1).abs() < 1e-300, "nothing pulls");
        let t = f64::from(i) * H;
        let expected = e0 * (-K * t / c).exp();
        let found = (2.0 * ring.stored() / K).sqrt();
        assert!((found / expected - 1.0).abs() < 1e-3, "{t}: {found} {expected}");
    }
    // Taken up again: by the way that is left of its own.
    let left = e0 * (-K * 20_001.0 * H / c).exp();
    let f = ring.held(0.5 * PLAY + left + 1e-4, 0.0);
    assert!((f / (-K * (left + 1e-4)) - 1.0).abs() < 1e-6, "{f}");
}

/// A brake that has slipped by s takes the middle of the play along: pushed back slowly the ring is free over
/// the whole width, from s + b/2 to s − b/2.
#[test]
fn oracle_the_brake_takes_the_play_along() {
    let mut axial = channel(0.0);
    let force = 2500.0;
    axial.series_brake = Some(SeriesBrake { force, viscous: 500.0 });
    let mut ring = Ring::new(axial, 0.0, 0.0);
    let (far, v) = (0.02, 1e-3);
    let step = v * H;
    let mut x = 0.0;
    while x < far {
        x += step;
        ring.held(x, v);
    }
    let slip = far - 0.5 * PLAY - (force + 500.0 * v) / K;
    assert!((ring.state.axial_slip_m() / slip - 1.0).abs() < 1e-3, "{}", ring.state.axial_slip_m());
    let (mut free_from, mut free_to) = (0.0, 0.0);
    while x > far - 0.02 {
        x -= step;
        let f = ring.held(x, -v);
        // The spring in series with the brake, by the side from which it is pushed.
        let slip = ring.state.axial_slip_m();
        let e = (x - slip).abs() - 0.5 * PLAY;
        let expected = if e > 0.0 { -(x - slip).signum() * K * e } else { 0.0 };
        assert!((f - expected).abs() < 1.0, "{x}: {f} {expected}");
        if f == 0.0 {
            free_from = if free_from == 0.0 { x } else { free_from };
            free_to = x;
        }
    }
    let free = free_from - free_to;
    assert!((free / PLAY - 1.0).abs() < 1e-3, "{free}");
}

/// Spring and stop are the gradient of what is stored, at whatever memory.
#[test]
fn oracle_the_elastic_force_is_the_gradient_of_the_stored_energy() {
    let mut ring = Ring::new(channel(4000.0), 0.0, 0.3);
    for i in 0..8000 {
        ring.step();
        if i % 37 > 0 {
            continue;
        }
        let at = |dx: f64| {
            let g = AttenuatorGeometry::new(Pose::from_translation(DVec3::X * (ring.x + dx)), 0.0);
            (
                stored_energy(&ring.model, &g, &ring.state),
                elastic_wrench(&ring.model, &g, &ring.state).f.x,
            )
        };
        let d = 1e-8;
        let slope = (at(d).0 - at(-d).0) / (2.0 * d);
        assert!((slope + at(0.0).1).abs() < 0.02, "{}: {slope} {}", ring.x, at(0.0).1);
    }
}

/// Whole dockings with 1 mm of it, by tables and by legs: the accounts close, and the play is felt.
#[test]
fn invariant_energy_and_momentum_through_a_docking_with_play() {
    let docked = |backlash: f64| {
        let mut m = common::apas();
        let Attenuator::Characteristic(a) = &mut m.attenuator else { panic!("by tables") };
        a.axial.backlash = backlash;
        let system = System::new(&common::chaser(), &common::target(), m);
        let c = common::conditions(0.1, 0.05, 0.0, [2.0, 2.0, 0.0]);
        let mut s = common::start(&system, &c, 0.02);
        let look = |s: &_| system.energy(s, &system.measure(&s.mechanism, &s.poses()));
        let (e0, p0) = (look(&s), system.momentum(&s));
        let (mut energy, mut momentum) = (0.0f64, 0.0f64);
        for i in 0..60_000 {
            system.step(&mut s, &Inputs::default(), 1e-4);
            if i % 10 == 0 {
                let e = look(&s);
                energy = energy.max(((e.kinetic + e.stored + e.lost) / e0.kinetic - 1.0).abs());
                momentum = momentum.max((system.momentum(&s).f - p0.f).length());
            }
        }
        assert!(s.mechanism.captured_s().is_some(), "not captured");
        assert!(energy < 1e-3, "the energy account is off by {energy:e}");
        assert!(momentum < 1e-8, "momentum {momentum:e}");
        s.digest()
    };
    assert_ne!(docked(1e-3), docked(0.0));
    // What is not there changes nothing, to the bit.
    assert_eq!(docked(0.0), docked(0.0));
}
