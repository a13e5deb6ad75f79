//! What fuzzing found, in plain words: each was accepted, and then not finite.

use crate::models::{Damaged, judge_model, judge_scenario};
use crate::world::World;

/// A shipped file with texts replaced, and what is said of it.
fn said(world: &World, name: &str, edits: &[(&str, &str)]) -> String {
    let mut text = String::from_utf8(world.files[name].clone()).expect("text");
    for (from, to) in edits {
        assert!(text.contains(from), "{name} has no {from:?}: mend the case");
        text = text.replacen(from, to, 1);
    }
    let d = Damaged { name: name.to_owned(), text: text.into_bytes() };
    if name.starts_with("scenarios/") { judge_scenario(world, &d) } else { judge_model(world, &d) }
}

#[test]
fn regress_what_was_accepted_and_then_not_finite() {
    let world = World::new();
    let cases: &[(&str, &[(&str, &str)], &str)] = &[
        // One moment of inertia of no body: a rate of 1e9 rad/s in the first contact.
        (
            "models/urdf/test_12t.urdf",
            &[("iyy=\"12000.0\"", "iyy=\"1e-9\"")],
            "inertia its least radius gyration",
        ),
        // Springs and dampers that steps of a run cannot follow.
        (
            "models/urdf/apas_active.toml",
            &[("stiffness_n_m = { value = 1000000.0", "stiffness_n_m = { value = 1e12")],
            "mechanism contact stiffness acts faster than steps",
        ),
        (
            "models/urdf/apas_active.toml",
            &[("damping_after_capture_n_s_m = { value = 1000.0", "damping_after_capture_n_s_m = { value = 1e8")],
            "mechanism attenuation characteristic lateral damping acts faster than steps",
        ),
        (
            "scenarios/apas_nominal.toml",
            &[("[initial]", "[mechanism.contact]\nstiffness_n_m = 1e12\n\n[initial]")],
            "mechanism contact stiffness acts faster than steps",
        ),
    ];
    for (name, edits, kind) in cases {
        let found = said(&world, name, edits);
        assert!(found.starts_with(kind), "{name} {edits:?}: {found:?}");
        // Of this test: the file as it is steps.
        let found = said(&world, name, &[]);
        assert!(found.starts_with("stepped"), "{name}: {found:?}");
    }
}
