//! What must hold of the contact kernel, at any number of random poses.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its own part")]

use docktwin_core::{DQuat, DVec3, Pose, Twist};
use docktwin_model::{DockingMechanism, RING_AND_PETAL_PAIRS};
use docktwin_physics::{
    contact::{ContactState, Scene, SurfacePair},
    mechanism::System,
    reduced::{DockingState, Inputs},
};

use crate::{
    brute::Brute,
    common,
    draws::{Draws, Region, in_contact, touching},
};

const STILL: Twist = Twist { v: DVec3::ZERO, w: DVec3::ZERO };
/// No point of a side is farther from its ring's centre, m.
const REACH_M: f64 = 0.68;

/// Worst of many figures, and how many are out of bounds.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    pub of: &'static str,
    pub region: &'static str,
    pub looked_at: u64,
    pub out_of_bounds: u64,
    pub worst: f64,
}

impl Tally {
    const fn new(of: &'static str, region: &Region) -> Self {
        let worst = f64::NEG_INFINITY;
        Self { of, region: region.name, looked_at: 0, out_of_bounds: 0, worst }
    }

    /// Counts a figure; returns whether it is out of bounds (or no number).
    fn add(&mut self, figure: f64, bound: f64) -> bool {
        self.looked_at += 1;
        self.worst = if figure.is_nan() { f64::NAN } else { self.worst.max(figure) };
        let out = figure.is_nan() || figure > bound;
        self.out_of_bounds += u64::from(out);
        out
    }
}

/// Change of the depth of every pair between two steps, beyond how far the surfaces moved, m: ≤ 1 µm.
pub fn continuity(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let scene = Scene::new(m);
    let mut tally = Tally::new("change of depth beyond the motion, m", region);
    for k in first..first + count {
        let mut draws = Draws::new(0xC0 + k);
        let mut x = draws.pose(region);
        x = touching(&scene, x, 0.0).unwrap_or(x);
        let mut last = scene.depths(x, -5e-3);
        for _ in 0..50 {
            let (y, moved) = draws.step(x, 1e-4, REACH_M);
            let now = scene.depths(y, -5e-3);
            for i in 0..RING_AND_PETAL_PAIRS {
                // Below the floor there are bounds only.
                if now[i].min(last[i]) > -5e-3 {
                    tally.add((now[i] - last[i]).abs() - moved, 1e-6);
                }
            }
            (x, last) = (y, now);
        }
    }
    tally
}

/// Forces and moments against differences of the stored energy, relative: ≤ 1e-3.
pub fn gradient(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let scene = without_friction(m);
    let mut tally = Tally::new("force against the gradient of the energy", region);
    for k in first..first + count {
        let mut draws = Draws::new(0x6AD + k);
        let mut x = in_contact(&scene, &mut draws, region);
        // Ten poses around each: what they cost is finding one.
        for _ in 0..10 {
            let error = gradient_error(&scene, x);
            if tally.add(error, 1e-3) {
                println!("  {error:e} at {x:?}");
            }
            x = draws.step(x, 2e-4, REACH_M).0;
        }
    }
    tally
}

/// The surfaces alone, whose forces are a gradient.
pub fn without_friction(m: &DockingMechanism) -> Scene {
    let mut m = m.clone();
    m.contact.friction_kinetic = 0.0;
    m.contact.friction_static = 0.0;
    Scene::new(&m)
}

/// By differences over ±0.1 µm, and over a tenth of it where a contact begins or ends within them: the energy has a kink
/// in its second derivative there, which a difference takes for an error.
pub fn gradient_error(scene: &Scene, x: Pose) -> f64 {
    let error = difference_error(scene, x, 1e-7);
    if error < 1e-4 { error } else { difference_error(scene, x, 1e-8) }
}

fn difference_error(scene: &Scene, x: Pose, h: f64) -> f64 {
    let state = ContactState::default();
    let at = |x: Pose| scene.measure(&state, Pose::IDENTITY, x);
    let slope =
        |by: &dyn Fn(f64) -> Pose| -(at(by(h)).stored_j() - at(by(-h)).stored_j()) / (2.0 * h);
    let w = at(x).wrench(DVec3::ZERO, STILL, STILL, 1e-4).0;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let force = DVec3::from_array(axes.map(|e| slope(&|s| Pose::new(x.p + e * s, x.q))));
    let moment = DVec3::from_array(axes.map(|e| {
        slope(&|s| {
            let q = DQuat::from_scaled_axis(e * s);
            Pose::new(q * x.p, q * x.q)
        })
    }));
    let size = w.f.length().max(1.0);
    let off = (force - w.f).length() / size;
    off.max((moment - w.m).length() / w.m.length().max(0.3 * size))
}

fn pairs() -> impl Iterator<Item = SurfacePair> {
    (0..RING_AND_PETAL_PAIRS).map(SurfacePair::from_index)
}

/// Depth of every pair that nearly touches against brute force, m: ≤ 1 µm.
pub fn depths(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let scene = Scene::new(m);
    let brute = Brute { m, grid: 40 };
    let mut tally = Tally::new("depth of a pair against brute force, m", region);
    for k in first..first + count {
        let x = in_contact(&scene, &mut Draws::new(0xB0 + k), region);
        let ours = scene.depths(x, -1e-3);
        for pair in pairs() {
            let want = brute.depth(pair, x);
            let ours = ours[pair.index()];
            // Far apart there is only a bound.
            let error = if ours <= -1e-3 { want + 1e-3 } else { (ours - want).abs() };
            if tally.add(error, 1e-6) {
                println!("  draw {k} {pair}: {ours} instead of {want} at {x:?}");
            }
        }
    }
    tally
}

/// The stored energy against brute force, as the depth that stores as much, m: ≤ 1 µm.
pub fn energies(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let scene = Scene::new(m);
    let brute = Brute { m, grid: 24 };
    let mut tally = Tally::new("depth of the stored energy against brute force, m", region);
    for k in first..first + count {
        let x = in_contact(&scene, &mut Draws::new(0xE0 + k), region);
        let ours = scene.measure(&ContactState::default(), Pose::IDENTITY, x).stored_j();
        let want = brute.energy(x);
        let error = ((2e-6 * ours).sqrt() - (2e-6 * want).sqrt()).abs();
        if tally.add(error, 1e-6) {
            println!(
                "  draw {k}: {ours} J instead of {want} J at {x:?}, {:?}",
                scene.depths(x, -1e-3)
            );
        }
    }
    tally
}

/// Stored energy with a memory of the steps before against one without, as a depth, m: the same.
pub fn memory(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let scene = Scene::new(m);
    let mut tally = Tally::new("depth of the stored energy with against without memory, m", region);
    for k in first..first + count {
        let mut draws = Draws::new(0x3E + k);
        let mut x = in_contact(&scene, &mut draws, region);
        let mut state = ContactState::default();
        for i in 0..60 {
            let known = scene.measure(&state, Pose::IDENTITY, x);
            let fresh = scene.measure(&ContactState::default(), Pose::IDENTITY, x);
            known.commit(&mut state, DVec3::ZERO, STILL, STILL, 1e-4);
            let depth = |j: f64| (2e-6 * j.max(0.0)).sqrt();
            if tally.add((depth(known.stored_j()) - depth(fresh.stored_j())).abs(), 1e-8) {
                println!("  draw {k} step {i}: {} J but {} J", known.stored_j(), fresh.stored_j());
            }
            x = draws.step(x, if i % 10 == 9 { 2e-3 } else { 5e-5 }, REACH_M).0;
        }
    }
    tally
}

/// Growth of the law's depth beyond the motion while one side is pushed into the other down to 40 mm, through the
/// depth at which the cores meet, m: ≤ 1 µm. Beyond that depth a place may end, as one that slides off an
/// edge: then the depth falls.
pub fn deep(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let scene = Scene::new(m);
    let mut tally = Tally::new("growth of depth beyond the motion down to 40 mm, m", region);
    for k in first..first + count {
        let mut draws = Draws::new(0xDEE9 + k);
        let mut x = in_contact(&scene, &mut draws, region);
        let mut state = ContactState::default();
        let (mut last, mut way) = (f64::NAN, DVec3::ZERO);
        for i in 0..500 {
            let c = scene.measure(&state, Pose::IDENTITY, x);
            c.commit(&mut state, DVec3::ZERO, STILL, STILL, 1e-4);
            if i == 0 {
                way = -c.wrench(DVec3::ZERO, STILL, STILL, 1e-4).0.f.normalize_or(DVec3::X);
            } else if tally.add(c.deepest_m() - last - 1e-4, 1e-6) {
                println!("  draw {k} step {i}: {last} m, then {} m", c.deepest_m());
            }
            last = c.deepest_m();
            if last > 0.04 {
                break;
            }
            x.p += way * 1e-4;
        }
    }
    tally
}

/// Energy account of drawn dockings of three seconds, relative to the kinetic energy brought in: ≤ 1e-3. Those that
/// pass a limit are not counted.
pub fn dockings(m: &DockingMechanism, region: &Region, count: u64, first: u64) -> Tally {
    let system = System::new(&common::chaser(), &common::target(), m.clone());
    let mut tally = Tally::new("energy account of a docking", region);
    for k in first..first + count {
        let c = Draws::new(0xD0C0 + k).conditions(region);
        if let Some(error) = account(&system, common::start(&system, &c, 2e-3))
            && tally.add(error, 1e-3)
        {
            println!("  draw {k}: off by {error:e} with {c:?}");
        }
    }
    tally
}

/// Largest error of the energy account over three seconds or until 50 ms after capture; `None` once a limit is passed.
fn account(system: &System, mut s: DockingState) -> Option<f64> {
    const H: f64 = 1e-4;
    let look = |s: &DockingState| system.energy(s, &system.measure(&s.mechanism, &s.poses()));
    let e0 = look(&s).kinetic;
    let mut worst = 0.0f64;
    for i in 1..=30_000u32 {
        system.step(&mut s, &Inputs::default(), H);
        if i % 10 == 0 {
            let e = look(&s);
            worst = worst.max(((e.kinetic + e.stored + e.lost) / e0 - 1.0).abs());
            if s.peak_depth_m > 0.04 || s.peak_force_n > 6.5e3 {
                return None;
            }
            let captured = s.mechanism.captured_s();
            if captured.is_some_and(|c| f64::from(i) * H > c + 0.05) {
                break;
            }
        }
    }
    Some(worst)
}
