//! The reduced twin and the rig are on the loop's path: once built, they never ask for memory.
mod common;
use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
};

use common::*;
use docktwin_core::{DVec3, Wrench};
use docktwin_physics::{
    mechanism::System,
    reduced::{DockingTwin, Inputs, ReducedTwin},
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

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { Heap.alloc_zeroed(layout) }
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

#[test]
fn invariant_the_counter_counts() {
    let mut kept = Vec::new();
    assert_eq!(requests(|| kept.push(1u64)), 1);
    assert_eq!(requests(|| kept.push(2)), 0);
    assert!(requests(|| kept.extend(0..1000)) >= 1);
}

#[test]
fn invariant_a_step_of_the_reduced_twin_never_allocates() {
    let system = System::new(&chaser(), &target(), apas());
    let c = conditions(0.1, 0.05, 0.0, [2.0, 2.0, 0.0]);
    let bodies = start(&system, &c, 0.02).bodies;
    let mut twin = ReducedTwin::new(system, bodies, 1e-4);
    let rest = Inputs::default();
    let push = Inputs { chaser: Wrench { f: DVec3::X * 50.0, m: DVec3::ZERO }, ..rest };
    let begin = twin.snapshot();
    let mut kept = twin.snapshot();
    let n = requests(|| {
        for i in 0..150_000 {
            twin.step(if i < 20_000 { &push } else { &rest });
            // What a predictor does: keep the state, look at it, go back to it.
            if i % 1000 == 0 {
                kept = twin.snapshot();
                std::hint::black_box(twin.digest());
                twin.restore(&kept);
            }
        }
    });
    // The whole docking was on the way: contact, latches, capture, attenuation afterwards.
    let state = twin.state();
    assert!(state.first_contact_s.is_some() && state.peak_force_n > 0.0, "the sides touch");
    assert!(state.mechanism.captured_s().is_some(), "the latches catch");
    assert_ne!(begin, kept);
    assert_eq!(n, 0, "requests for memory in 150 000 steps");
}

#[test]
fn invariant_the_platform_never_allocates() {
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = docktwin_model::load_rig(&path).unwrap_or_else(|e| panic!("{e}")).model;
    let maps = docktwin_physics::platform::maps::Maps::new(&rig);
    let platform = maps.platform().clone();
    let x = rig.plate_from_docking(&rig.docking.pose([0.5; 6]));
    let still = docktwin_core::Twist::default();
    let mut sum = 0.0;
    let asked = requests(|| {
        let c = platform.at(&x);
        let found = platform.forward(&c.length_m, &platform.middle()).expect("found");
        let forces =
            platform.inverse_dynamics(&c, &still, &still, &Wrench::ZERO).expect("not singular");
        let a = platform.forward_dynamics(&c, &still, &forces, &Wrench::ZERO).expect("definite");
        let masses = platform.effective_masses_kg(&c).expect("not singular");
        let map = maps.frequencies(2.76e7, &[0.0; 6]).expect("not singular");
        let payload = maps.capability().expect("not singular").payload_at_rest_kg.0;
        sum = found.x_bp.p.x
            + a.v.x
            + masses[0]
            + platform.singularity(&c)
            + map.middle.frequency_hz[0]
            + maps.workspace().stroke_m
            + payload;
    });
    assert!(sum.is_finite());
    assert_eq!(asked, 0, "requests for memory");
}

#[test]
fn invariant_a_tick_of_the_rig_never_allocates() {
    a_tick_never_allocates("stewart");
    a_tick_never_allocates("electric_hexapod");
}

fn a_tick_never_allocates(name: &str) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("../../models/urdf/{name}.urdf"));
    let rig = docktwin_model::load_rig(&path).expect("the rig of the repository loads").model;
    let preset = docktwin_model::HydraulicPreset::Printed;
    let setup = docktwin_control::rig::RigSetup::of_rig(&rig, preset, Some(1));
    let forward = setup.feedforward();
    let middle = rig.middle();
    let mut closed = docktwin_control::rig::ClosedRig::new(&setup, &middle).expect("it stands");
    let mut motion = docktwin_control::feedforward::PlateMotion::rest(middle);
    let n = requests(|| {
        for i in 0..500 {
            motion.x_bp.p.y = middle.p.y + 1e-3 * (0.01 * f64::from(i)).sin();
            let command = forward.command(&motion).expect("it can be commanded");
            closed.tick(&command, |_, _| Wrench::ZERO).expect("it runs");
            std::hint::black_box((closed.measure(), closed.digest()));
        }
    });
    assert_eq!(n, 0, "requests for memory in 500 ticks");
}

/// Listed surfaces by closed form, by parry and around a torus.
#[test]
fn invariant_listed_surfaces_never_allocate() {
    use docktwin_core::Pose;
    use docktwin_model::{Surface, SurfaceCore};
    use docktwin_physics::contact::{ContactState, Scene};
    let surface = |name: &str, core: SurfaceCore| Surface {
        name: name.into(),
        link: "ring".into(),
        x_link: Pose::IDENTITY,
        x_ring: Pose::IDENTITY,
        core,
        rounding_m: 0.05,
        stiffness_n_m: 1e6,
        friction: 0.1,
    };
    let mut m = bare_rings();
    (m.active.has_ring, m.passive.has_ring) = (false, false);
    m.active.surfaces = vec![
        surface("cylinder", SurfaceCore::Cylinder { radius: 0.1, half: 0.1 }),
        surface("torus", SurfaceCore::Torus { radius: 0.2 }),
    ];
    m.passive.surfaces = vec![
        surface("capsule", SurfaceCore::Capsule { half: 0.1 }),
        surface("box", SurfaceCore::Box { half: DVec3::splat(0.1) }),
        surface(
            "hollow",
            SurfaceCore::Hollow { profile: vec![[0.0, 0.0], [0.0, 0.1], [0.2, 0.3]] },
        ),
    ];
    // A box against a torus has no law.
    assert_eq!(m.surface_pairs().len(), 4);
    let scene = Scene::new(&m);
    let state = ContactState::default();
    let mut touched = 0;
    let n = requests(|| {
        for i in 0..500 {
            let x = pose(0.05 + 1e-3 * f64::from(i % 300), 0.12, 0.02, [3.0, 5.0, f64::from(i)]);
            touched += u32::from(scene.measure(&state, Pose::IDENTITY, x).touching());
        }
    });
    assert!(touched > 50, "{touched}");
    assert_eq!(n, 0);
}
