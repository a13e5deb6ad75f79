//! Listed surfaces against closed forms, brute force and coal (a collision library in C++), and what always holds.
mod common;

use common::apas;
use docktwin_core::{DMat3, DQuat, DVec3, Digest, Pose, Twist};
use docktwin_model::{
    Attenuator, ContactLaw, DockingMechanism, MechanismLimits, NormalLaw, RingBody, RingGeometry,
    SideGeometry, Spacecraft, Surface, SurfaceCore,
};
use docktwin_physics::{
    body::{BodyState, MassProperties},
    contact::{ContactState, RING_AND_PETAL_PAIRS, Scene},
    mechanism::{CHASER, RING, System, TARGET},
    reduced::{DockingState, Inputs},
};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{RngCore, SeedableRng},
};

fn surface(core: SurfaceCore, rounding_m: f64) -> Surface {
    Surface {
        name: core.word().into(),
        link: "ring".into(),
        x_link: Pose::IDENTITY,
        x_ring: Pose::IDENTITY,
        core,
        rounding_m,
        stiffness_n_m: 2e5,
        friction: 0.0,
    }
}

fn side(surfaces: Vec<Surface>) -> SideGeometry {
    SideGeometry {
        ring: RingGeometry { mean_radius_m: 0.5, section_radius_m: 0.0, segments: 8 },
        has_ring: false,
        petals: None,
        surfaces,
    }
}

/// Two sides without ring, the active one part of the chaser, both ring frames at the mass centres.
fn mechanism(active: Surface, passive: Surface, law: ContactLaw) -> DockingMechanism {
    let loose = 1e9;
    DockingMechanism {
        active: side(vec![active]),
        passive: side(vec![passive]),
        ring_body: RingBody {
            mass_kg: 1e-9,
            inertia_kg_m2: DMat3::from_diagonal(DVec3::splat(1e-9)),
            com_m: DVec3::ZERO,
        },
        ring_rest_offset_m: 0.0,
        passive_ring_offset_m: 0.0,
        contact: law,
        attenuator: Attenuator::Rigid,
        latches: None,
        limits: MechanismLimits {
            tension_n: loose,
            compression_n: loose,
            shear_n: loose,
            torsion_nm: loose,
            bending_nm: loose,
            depth_m: loose,
            overtravel_m: loose,
        },
        ..apas()
    }
}

fn law(normal: NormalLaw) -> ContactLaw {
    ContactLaw { normal, friction_kinetic: 0.0, friction_static: 0.0, ..common::law() }
}

fn elastic() -> ContactLaw {
    law(NormalLaw::HuntCrossley { stiffness: 1e5, exponent: 1.0, damping_s_m: 0.0 })
}

fn craft(mass_kg: f64, inertia: f64) -> Spacecraft {
    Spacecraft {
        name: "body".into(),
        mass_kg,
        inertia_kg_m2: DMat3::from_diagonal(DVec3::splat(inertia)),
        x_body_port: Pose::IDENTITY,
        digest: Digest::default(),
    }
}

/// r4 seen from e4.
fn half_turn() -> DQuat {
    DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0)
}

struct Pair {
    system: System,
    state: DockingState,
}

impl Pair {
    /// The chaser at rest in the origin, the target at `p` and `q` of its body, moving.
    fn new(m: DockingMechanism, masses: [f64; 2], [p, v, w]: [DVec3; 3], q: DQuat) -> Self {
        let crafts = masses.map(|m| craft(m, 0.4 * m));
        let system = System::new(&crafts[0], &crafts[1], m);
        let body = |mass: &MassProperties, x: Pose, v: DVec3, w: DVec3| {
            BodyState::new(mass, x, v, x.q.conjugate() * w)
        };
        let mass = system.mass();
        let mut bodies = [
            body(&mass[CHASER], Pose::IDENTITY, DVec3::ZERO, DVec3::ZERO),
            body(&mass[RING], Pose::IDENTITY, DVec3::ZERO, DVec3::ZERO),
            body(&mass[TARGET], Pose::new(p, q), v, w),
        ];
        system.follow(&mut bodies);
        Self { state: DockingState::new(bodies), system }
    }

    fn run(&mut self, steps: u32, h: f64) {
        for _ in 0..steps {
            self.system.step(&mut self.state, &Inputs::default(), h);
        }
    }

    fn total_j(&self) -> f64 {
        let measured = self.system.measure(&self.state.mechanism, &self.state.poses());
        let e = self.system.energy(&self.state, &measured);
        e.kinetic + e.stored + e.lost
    }
}

fn balls() -> DockingMechanism {
    let ball = || Surface { stiffness_n_m: 2.0 * 3502.537, ..surface(SurfaceCore::Sphere, 1.0) };
    mechanism(
        ball(),
        ball(),
        law(NormalLaw::KelvinVoigt { stiffness: 1.0, damping_n_s_m: 70.0507 }),
    )
}

fn near(got: f64, want: f64, part: f64, what: &str) {
    assert!((got / want - 1.0).abs() <= part, "{what}: {got}, want {want}");
}

/// Two balls of 100 kg with radius 1 m on Kelvin and Voigt's law, closing at 2 m/s.
#[test]
fn oracle_two_balls_meet_head_on() {
    let [p, v] = [DVec3::X * 2.002, DVec3::X * -2.0];
    let mut pair = Pair::new(balls(), [100.0, 100.0], [p, v, DVec3::ZERO], DQuat::IDENTITY);
    let h = 1e-5;
    let (mut begin, mut end) = (None, None);
    for i in 0..60_000u32 {
        let before = pair.state.net_impulse.x;
        pair.run(1, h);
        let t = f64::from(i) * h;
        if pair.state.net_impulse.x.to_bits() != before.to_bits() {
            begin.get_or_insert(t);
            end = Some(t);
        }
    }
    let (k, c, m) = (3502.537f64, 70.0507, 50.0f64);
    let w = (k / m).sqrt();
    let zeta = c / (2.0 * m * w);
    let root = (1.0 - zeta * zeta).sqrt();
    let phi = (2.0 * zeta * root).atan2(2.0 * zeta * zeta - 1.0);
    let e = (-zeta * phi / root).exp();
    near(e, 0.77896, 1e-5, "the printed restitution");
    near(pair.state.peak_depth_m, 0.21090, 1e-4, "depth");
    near(pair.state.peak_force_n, 749.2, 1e-4, "force");
    let contact_s = end.expect("touched") - begin.expect("touched") + h;
    near(contact_s, 0.3566, 2e-4, "duration");
    near(contact_s, phi / (w * root), 1e-4, "duration of the closed form");
    let bodies = &pair.state.bodies;
    near((bodies[TARGET].v - bodies[CHASER].v).x / 2.0, e, 1e-4, "restitution");
}

/// The same, off centre by half a metre; figures of an independent integration of two points.
#[test]
fn oracle_two_balls_meet_off_centre() {
    let [p, v] = [DVec3::new(2.0, 0.5, 0.0), DVec3::X * -2.0];
    let mut pair = Pair::new(balls(), [100.0, 100.0], [p, v, DVec3::ZERO], DQuat::IDENTITY);
    pair.run(60_000, 1e-5);
    near(pair.state.peak_depth_m, 0.202_417, 1e-4, "depth");
    let v1 = pair.state.bodies[CHASER].v;
    near(v1.x, -1.620_257, 1e-4, "speed along");
    near(v1.y, -0.500_426, 1e-4, "speed across");
    assert!(pair.state.bodies[TARGET].l.length() < 1e-9, "without friction nothing turns");
}

/// A cone that opens toward +X of its own frame, half-angle `alpha`, from radius 0.05 m over 0.5 m.
fn cone(alpha: f64) -> Surface {
    let profile = vec![[0.0, 0.05], [0.5, 0.05 + 0.5 * alpha.tan()]];
    surface(SurfaceCore::Hollow { profile }, 0.01)
}

/// A ball on the axis of a cone is a mass on a spring k sin²α; beside the axis it bounces off a wall.
#[test]
fn oracle_ball_in_a_cone() {
    let alpha = 40f64.to_radians();
    let m = || mechanism(surface(SurfaceCore::Sphere, 0.1), cone(alpha), elastic());
    let (mass, h) = (60.0, 2e-6);
    // r4 looks toward −X: the ball enters from there.
    let reach = 0.11 / alpha.sin() - 0.05 / alpha.tan();
    for v in [0.3, 0.7] {
        let p = DVec3::X * (reach + 1e-4);
        let mut pair =
            Pair::new(m(), [1e12, mass], [p, DVec3::X * -v, DVec3::ZERO], DQuat::IDENTITY);
        pair.run(1, h);
        while pair.state.net_impulse == DVec3::ZERO {
            pair.run(1, h);
        }
        let mut steps = 0u32;
        while pair.state.bodies[TARGET].v.x < 0.0 {
            pair.run(1, h);
            steps += 1;
        }
        let w = (1e5f64 / mass).sqrt() * alpha.sin();
        near(pair.state.peak_force_n, v * mass * w, 1e-4, "force along the axis");
        near(pair.state.peak_depth_m, v / w * alpha.sin(), 1e-4, "depth");
        near(
            f64::from(steps) * h,
            0.5 * core::f64::consts::PI / w,
            1e-3,
            "a quarter of the period",
        );
    }
    // Against one wall: the speed along its normal turns, that along it stays.
    let n = DVec3::new(alpha.sin(), -alpha.cos(), 0.0);
    let v = DVec3::new(-0.4, 0.2, 0.0);
    let p = DVec3::new(0.25, 0.05, 0.0);
    // The ball has the mass: its force acts at its centre.
    let mut pair = Pair::new(m(), [mass, 1e12], [p, v, DVec3::ZERO], DQuat::IDENTITY);
    while pair.state.net_impulse == DVec3::ZERO {
        pair.run(1, h);
    }
    let peak = v.dot(n).abs() * (1e5 * mass).sqrt();
    for _ in 0..200_000 {
        pair.run(1, h);
        let measured = pair.system.measure(&pair.state.mechanism, &pair.state.poses());
        if !measured.touching() {
            break;
        }
    }
    near(pair.state.peak_force_n, peak, 1e-4, "force on a wall");
    let after = pair.state.bodies[CHASER].v;
    assert!((after - 2.0 * v.dot(n) * n).length() < 1e-4, "{after} of {v}");
}

// Random poses ---------------------------------------------------------------------------------

struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn within(&mut self, lo: f64, hi: f64) -> f64 {
        let part = self.0.next_u32() as f64 / f64::from(u32::MAX);
        lo + (hi - lo) * part
    }

    fn vector(&mut self, r: f64) -> DVec3 {
        DVec3::new(self.within(-r, r), self.within(-r, r), self.within(-r, r))
    }

    fn turn(&mut self) -> DQuat {
        loop {
            let v: [f64; 4] = core::array::from_fn(|_| self.within(-1.0, 1.0));
            let q = DQuat::from_array(v);
            if q.length() > 0.1 && q.length() < 1.0 {
                return q.normalize();
            }
        }
    }
}

/// Every kind of convex surface.
fn convex() -> Vec<Surface> {
    let points = vec![
        DVec3::new(0.0, 0.1, 0.0),
        DVec3::new(0.0, -0.08, 0.05),
        DVec3::new(0.12, 0.0, 0.1),
        DVec3::new(-0.1, 0.02, -0.09),
        DVec3::new(0.05, 0.06, -0.02),
    ];
    vec![
        surface(SurfaceCore::Sphere, 0.1),
        surface(SurfaceCore::Capsule { half: 0.15 }, 0.04),
        surface(SurfaceCore::Box { half: DVec3::new(0.1, 0.06, 0.08) }, 0.02),
        surface(SurfaceCore::Cylinder { radius: 0.07, half: 0.1 }, 0.02),
        surface(SurfaceCore::Cone { radius: 0.1, half: 0.08 }, 0.02),
        surface(SurfaceCore::Hull { points }, 0.02),
    ]
}

fn torus() -> Surface {
    surface(SurfaceCore::Torus { radius: 0.2 }, 0.03)
}

fn hollows() -> Vec<Surface> {
    let cup = vec![[0.0, 0.0], [0.0, 0.08], [0.1, 0.1], [0.15, 0.2]];
    vec![cone(0.6), surface(SurfaceCore::Hollow { profile: cup }, 0.02)]
}

/// Every pair that has a law, two of a kind and both orders included.
fn pairs() -> Vec<[Surface; 2]> {
    let mut all = convex();
    all.push(torus());
    all.extend(hollows());
    let of = |a: &Surface| all.iter().map(|b| [a.clone(), b.clone()]).collect::<Vec<_>>();
    all.iter().flat_map(of).filter(|[a, b]| a.core.may_touch(&b.core)).collect()
}

/// A pose of r4 in r3 at which a pair is so deep that both radii hold: from apart toward each other.
fn touching(scene: &Scene, draw: &mut Draw, deepest: f64) -> Option<Pose> {
    let (q, dir) = (draw.turn(), draw.vector(1.0).normalize());
    let aim = draw.vector(0.15);
    let at = |s: f64| Pose::new(aim + dir * s, q);
    let depth = |s: f64| scene.depths(at(s), f64::NEG_INFINITY)[RING_AND_PETAL_PAIRS];
    let mut s = 1.2;
    while depth(s) < 0.0 {
        // As far as they are apart at most.
        s -= (-depth(s)).max(1e-6);
        if s < -0.3 {
            return None;
        }
    }
    let wanted = draw.within(0.2, 1.0) * deepest;
    for _ in 0..200 {
        let d = depth(s);
        if (d - wanted).abs() < 1e-9 || d >= wanted {
            break;
        }
        s -= 0.5 * (wanted - d).max(1e-7);
    }
    (depth(s) > 0.0).then(|| at(s))
}

/// Nearest distance of two cores by sampling both, refined around the best of all samples.
fn brute(a: &Surface, b: &Surface, x: Pose) -> f64 {
    let core = |s: &Surface, [u, v, w]: [f64; 3]| -> DVec3 {
        let (sin, cos) = (v * core::f64::consts::TAU).sin_cos();
        let around = DVec3::new(0.0, cos, sin);
        match &s.core {
            SurfaceCore::Sphere => DVec3::ZERO,
            SurfaceCore::Capsule { half } => DVec3::X * (half * (2.0 * u - 1.0)),
            SurfaceCore::Torus { radius } => around * *radius,
            SurfaceCore::Hollow { profile } => {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "small"
                )]
                let i = (w as usize).min(profile.len() - 2);
                let [p, q] = [profile[i], profile[i + 1]];
                let at = |k: usize| p[k] + (q[k] - p[k]) * u;
                DVec3::X * at(0) + around * at(1)
            }
            _ => unreachable!("convex pairs are compared with coal"),
        }
    };
    let walls = |s: &Surface| match &s.core {
        SurfaceCore::Hollow { profile } => profile.len() - 1,
        _ => 1,
    };
    let along = |s: &Surface| !matches!(s.core, SurfaceCore::Sphere | SurfaceCore::Torus { .. });
    let about =
        |s: &Surface| matches!(s.core, SurfaceCore::Torus { .. } | SurfaceCore::Hollow { .. });
    let mut best = f64::INFINITY;
    let n = 24u32;
    let grid = |yes: bool| if yes { n } else { 0 };
    for (wa, wb) in (0..walls(a)).flat_map(|i| (0..walls(b)).map(move |j| (i, j))) {
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let far = |z: [f64; 4]| {
            let p = core(a, [z[0].clamp(0.0, 1.0), z[1], wa as f64]);
            let q = core(b, [z[2].clamp(0.0, 1.0), z[3], wb as f64]);
            (p - x.transform_point(q)).length()
        };
        let mut starts = Vec::new();
        for i in 0..=grid(along(a)) {
            for j in 0..=grid(about(a)) {
                for k in 0..=grid(along(b)) {
                    for l in 0..=grid(about(b)) {
                        let z = [i, j, k, l].map(|g| f64::from(g) / f64::from(n));
                        starts.push((far(z), z));
                    }
                }
            }
        }
        starts.sort_by(|p, q| p.0.total_cmp(&q.0));
        for (_, z) in starts.iter().take(12) {
            best = best.min(refined(*z, &far));
        }
    }
    best
}

/// Pattern search.
fn refined(mut z: [f64; 4], far: &dyn Fn([f64; 4]) -> f64) -> f64 {
    let (mut step, mut value) = (0.05, far(z));
    while step > 1e-10 {
        let mut better = false;
        for i in 0..4 {
            for way in [-1.0, 1.0] {
                let mut y = z;
                y[i] += way * step;
                // Both clamped coordinates end with their cores.
                if i % 2 == 0 {
                    y[i] = y[i].clamp(0.0, 1.0);
                }
                let f = far(y);
                if f < value {
                    (z, value, better) = (y, f, true);
                }
            }
        }
        if !better {
            step *= 0.5;
        }
    }
    value
}

#[test]
fn oracle_depths_of_toruses_and_hollows_are_those_of_brute_force() {
    let mut draw = Draw::new(31);
    let (mut worst, mut seen) = (0.0f64, 0);
    for [a, b] in pairs() {
        let revolved =
            |s: &Surface| matches!(s.core, SurfaceCore::Torus { .. } | SurfaceCore::Hollow { .. });
        if !revolved(&a) && !revolved(&b) {
            continue;
        }
        let scene = Scene::new(&mechanism(a.clone(), b.clone(), elastic()));
        for _ in 0..60 {
            let x = Pose::new(draw.vector(0.3), draw.turn());
            let got = scene.depths(x, f64::NEG_INFINITY)[RING_AND_PETAL_PAIRS];
            let apart = brute(&a, &b, x);
            // Limits end a run before cores meet.
            if apart < 2e-3 {
                continue;
            }
            let want = a.rounding_m + b.rounding_m - apart;
            seen += 1;
            let name = format!("{} on {} at {x:?}", a.name, b.name);
            assert!((got - want).abs() < 1e-6, "{name}: {got}, brute force {want}");
            worst = worst.max((got - want).abs());
        }
    }
    assert!(seen > 500, "{seen}");
    println!("worst {worst:.1e} m in {seen}");
}

/// coal's distances stand in a table beside this file, made by `validation/oracles/convex_distances.py`.
#[test]
fn oracle_depths_of_convex_bodies_are_coals() {
    let table = include_str!("surfaces/coal.csv");
    let kinds = convex();
    let mut worst = 0.0f64;
    let mut rows = 0;
    for line in table.lines().filter(|l| !l.starts_with('#')) {
        let v: Vec<f64> = line.split(',').map(|x| x.parse().expect("a number")).collect();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
        let (a, b) = (kinds[v[0] as usize].clone(), kinds[v[1] as usize].clone());
        let x = Pose::new(DVec3::new(v[2], v[3], v[4]), DQuat::from_xyzw(v[6], v[7], v[8], v[5]));
        let sum = a.rounding_m + b.rounding_m;
        let names = format!("{} on {}", a.name, b.name);
        let scene = Scene::new(&mechanism(a, b, elastic()));
        let got = scene.depths(x, f64::NEG_INFINITY)[RING_AND_PETAL_PAIRS];
        assert!((got - (sum - v[9])).abs() < 1e-6, "{names} at {x:?}: {got}, coal {}", sum - v[9]);
        worst = worst.max((got - (sum - v[9])).abs());
        rows += 1;
    }
    assert!(rows >= 2000, "{rows}");
    println!("worst {worst:.1e} m in {rows}");
}

/// Energy of a pose, and the elastic wrench on the passive side about the origin.
fn energy(scene: &Scene, x: Pose) -> f64 {
    scene.measure(&ContactState::default(), Pose::IDENTITY, x).stored_j()
}

/// Forces and moments are the gradient of the energy, by central differences.
#[test]
fn invariant_forces_are_the_gradient_of_the_energy() {
    let mut draw = Draw::new(5);
    for [a, b] in pairs() {
        let name = format!("{} on {}", a.name, b.name);
        let scene = Scene::new(&mechanism(a.clone(), b.clone(), elastic()));
        let deepest = 0.9 * (a.rounding_m + b.rounding_m).min(0.04);
        let mut seen = 0;
        for _ in 0..60 {
            let Some(x) = touching(&scene, &mut draw, deepest) else { continue };
            let still = Twist::default();
            let contacts = scene.measure(&ContactState::default(), Pose::IDENTITY, x);
            let (w, _) = contacts.wrench(x.p, still, still, 1e-4);
            let h = 1e-5;
            let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let moved = |s: f64| energy(&scene, Pose::new(x.p + axis * s, x.q));
                let turned =
                    |s: f64| energy(&scene, Pose::new(x.p, DQuat::from_axis_angle(axis, s) * x.q));
                for (f, out) in
                    [(&moved as &dyn Fn(f64) -> f64, &mut force), (&turned, &mut moment)]
                {
                    *out -= axis * ((f(h) - f(-h)) / (2.0 * h));
                }
            }
            let scale = w.f.length();
            let far = (force - w.f).length() / scale;
            let turn = (moment - w.m).length() / (scale * 0.3);
            assert!(
                far < 1e-3 && turn < 1e-3,
                "{name} at {x:?}: {far:.1e} {turn:.1e}, {w:?} {force} {moment}"
            );
            seen += 1;
        }
        assert!(seen >= 20, "{name}: {seen} poses");
    }
}

/// The depth changes by no more than a surface moves, and the energy is continuous with it.
#[test]
fn invariant_depths_and_energy_are_continuous() {
    let mut draw = Draw::new(9);
    for [a, b] in pairs() {
        let name = format!("{} on {}", a.name, b.name);
        let scene = Scene::new(&mechanism(a.clone(), b.clone(), elastic()));
        let deepest = 0.9 * (a.rounding_m + b.rounding_m).min(0.04);
        for _ in 0..8 {
            let Some(x) = touching(&scene, &mut draw, deepest) else { continue };
            let (along, about) = (draw.vector(1e-5), draw.vector(3e-5));
            let step = along.length() + about.length() * 0.8;
            let mut last: Option<(f64, f64)> = None;
            for i in 0..400 {
                let s = f64::from(i);
                let at = Pose::new(x.p + along * s, DQuat::from_scaled_axis(about * s) * x.q);
                let depth = scene.depths(at, f64::NEG_INFINITY)[RING_AND_PETAL_PAIRS];
                let stored = energy(&scene, at);
                if let Some((d, e)) = last {
                    assert!((depth - d).abs() <= step + 1e-9, "{name}: depth {d} to {depth}");
                    // A hollow can be touched at several places at once.
                    let most = 8.0 * 1e5 * 0.06 * step;
                    assert!((stored - e).abs() <= most, "{name}: {e} J to {stored} J");
                }
                last = Some((depth, stored));
            }
        }
    }
}

/// Elastic contacts give back what they took, whatever touches what.
#[test]
fn invariant_elastic_contacts_keep_the_energy() {
    let mut draw = Draw::new(77);
    let mut worst = (0.0f64, String::new());
    for [a, b] in pairs() {
        let name = format!("{} on {}", a.name, b.name);
        let mut hit = 0;
        for _ in 0..6 {
            let m = mechanism(a.clone(), b.clone(), elastic());
            let scene = Scene::new(&m);
            let Some(x) = touching(&scene, &mut draw, 1e-6) else { continue };
            let v = -x.p.normalize() * draw.within(0.05, 0.2) + draw.vector(0.03);
            let w = draw.vector(0.3);
            // Half a millimetre back.
            let p = x.p - v.normalize() * 5e-4;
            let mut pair = Pair::new(m, [300.0, 200.0], [p, v, w], x.q * half_turn().conjugate());
            let start = pair.total_j();
            let mut off = 0.0f64;
            for _ in 0..2000 {
                pair.run(1, 1e-4);
                off = off.max((pair.total_j() / start - 1.0).abs());
            }
            hit += u32::from(pair.state.peak_depth_m > 0.0);
            if off > worst.0 {
                worst = (off, name.clone());
            }
            assert!(off < 1e-3, "{name}: the account is off by {:.3} %", 100.0 * off);
        }
        assert!(hit >= 2, "{name}: {hit}");
    }
    println!("worst {:.1e}: {}", worst.0, worst.1);
}

/// Faces that meet flat: the energy has an edge there, along which the body rocks; the account still closes.
#[test]
fn invariant_boxes_that_meet_flat_keep_the_energy() {
    let mut draw = Draw::new(3);
    let cube = || surface(SurfaceCore::Box { half: DVec3::splat(0.1) }, 0.02);
    let mut worst = 0.0f64;
    for tilt in [0.0, 1e-4, 1e-3, 1e-2] {
        for _ in 0..5 {
            let q = DQuat::from_scaled_axis(draw.vector(1.0).normalize() * tilt);
            let v = DVec3::new(-0.1, draw.within(-0.02, 0.02), 0.0);
            let p = DVec3::new(0.2405 + 0.2 * tilt, draw.within(-0.05, 0.05), 0.0);
            let m = mechanism(cube(), cube(), elastic());
            let mut pair =
                Pair::new(m, [300.0, 200.0], [p, v, DVec3::ZERO], q * half_turn().conjugate());
            let start = pair.total_j();
            for _ in 0..4000 {
                pair.run(1, 1e-4);
                worst = worst.max((pair.total_j() / start - 1.0).abs());
            }
            assert!(pair.state.peak_depth_m > 1e-4);
        }
    }
    println!("worst {worst:.1e}");
    assert!(worst < 1e-3, "the account is off by {:.3} %", 100.0 * worst);
}

/// Along lines from afar through each other the depth changes by no more than the way: no place is missed.
#[test]
fn regress_no_place_around_a_torus_is_missed() {
    let mut draw = Draw::new(8);
    for h in hollows() {
        let scene = Scene::new(&mechanism(torus(), h, elastic()));
        for _ in 0..80 {
            let (q, dir, aim) = (draw.turn(), draw.vector(1.0).normalize(), draw.vector(0.15));
            let at = |s: f64| Pose::new(aim + dir * s, q);
            let depth = |s: f64| scene.depths(at(s), f64::NEG_INFINITY)[RING_AND_PETAL_PAIRS];
            let mut last = depth(1.0);
            for i in 1..1000 {
                let s = 1.0 - 1e-3 * f64::from(i);
                let now = depth(s);
                assert!((now - last).abs() < 1.001e-3, "{last} to {now} at {:?}", at(s));
                last = now;
                // Cores that meet are beyond every limit.
                if now > 0.03 {
                    break;
                }
            }
        }
    }
}
