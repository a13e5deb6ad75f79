//! What fuzzing found, in plain words: each was accepted, and then not finite.

use crate::models::{Damaged, judge_model, judge_scenario};
use crate::recordings::{self, Start};
use crate::world::World;

/// A text, and what stands in its place.
type Edit<'a> = (&'a str, &'a str);

/// A shipped file with texts replaced, and what is said of it.
fn said(world: &World, name: &str, edits: &[Edit<'_>]) -> String {
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
    let cases: &[(&str, &[Edit<'_>], &str)] = &[
        // One moment of inertia of no body: a rate of 1e9 rad/s in the first contact.
        (
            "models/urdf/test_12t.urdf",
            &[("iyy=\"12000.0\"", "iyy=\"1e-9\"")],
            "inertia: its least radius gyration",
        ),
        // A port 190 m from the mass centre: a lever by which the attenuator throws the chaser about.
        (
            "models/urdf/light_575kg.urdf",
            &[("<origin xyz=\"0.8 0 0\"", "<origin xyz=\"189.686 0 0\"")],
            "mechanism attenuation characteristic axial",
        ),
        // Springs and dampers that steps of a run cannot follow.
        (
            "models/urdf/apas_active.toml",
            &[("stiffness_n_m = { value = 1000000.0", "stiffness_n_m = { value = 1e12")],
            "mechanism contact stiffness: acts faster than steps",
        ),
        (
            "models/urdf/apas_active.toml",
            &[(
                "damping_after_capture_n_s_m = { value = 1000.0",
                "damping_after_capture_n_s_m = { value = 1e8",
            )],
            "mechanism attenuation characteristic lateral damping after capture: acts faster than steps",
        ),
        (
            "scenarios/apas_nominal.toml",
            &[("[initial]", "[mechanism.contact]\nstiffness_n_m = 1e12\n\n[initial]")],
            "mechanism contact stiffness: acts faster than steps",
        ),
        // A latch of its own.
        (
            "models/urdf/probe_active.toml",
            &[(
                "joined_stiffness_n_m = { value = 1000000.0",
                "joined_stiffness_n_m = { value = 1e9",
            )],
            "mechanism latch joined stiffness: acts faster than steps",
        ),
    ];
    let world = &world;
    for (name, edits, kind) in cases {
        let found = said(world, name, edits);
        assert!(found.starts_with(kind), "{name} {edits:?}: {found:?}");
        // Of this test: the file as it is steps.
        let found = said(world, name, &[]);
        assert!(found.starts_with("stepped"), "{name}: {found:?}");
    }
}

/// Surfaces that files list: of two in series the soft one decides, so both are hard.
#[test]
fn regress_listed_surfaces_that_steps_cannot_follow() {
    let hard = ("stiffness_n_m = { value = 2000000.0", "stiffness_n_m = { value = 1e10");
    let mut world = World::new();
    let (probe, drogue) = ("models/urdf/probe_active.toml", "models/urdf/probe_passive.toml");
    // One of them alone steps.
    let found = said(&world, drogue, &[hard]);
    assert!(found.starts_with("stepped"), "{found}");
    let text = String::from_utf8(world.files[drogue].clone()).expect("text");
    let text = text.replacen(hard.0, hard.1, 1).into_bytes();
    world.sources = world.with(drogue, &text);
    world.files.insert(drogue.to_owned(), text);
    let found = said(&world, probe, &[hard]);
    assert!(found.starts_with("mechanism surface stiffness: acts faster than steps"), "{found}");
}

/// A start for which the plane of first contact is moved out by 1 mm, again and again, each time along the whole
/// way back: 21 s in 0.05 m, and hours for a slow one from afar.
#[test]
fn regress_a_start_beside_the_petals_is_found_soon() {
    let edits = [
        ("lateral_speed_z_m_s = 0.04", "lateral_speed_z_m_s = 0.2"),
        ("roll_deg = 4.0", "roll_deg = 0.1"),
        ("pitch_rate_deg_s = 0.2", "pitch_rate_deg_s = 0.04"),
    ];
    let found = said(&World::new(), "scenarios/thrust_assist.toml", &edits);
    assert!(found.starts_with("stepped"), "{found}");
}

/// Data that end before some of them, with a hole behind: a recovery counted all ticks, and left the log in which
/// no reader goes beyond the hole.
#[test]
fn regress_a_log_that_ends_before_its_data_is_recovered() {
    let start = Start::new(&World::new());
    let log = recordings::ended_early(&start);
    let found = recordings::judge_log(&start, &log, true);
    assert!(found.contains("ticks of 251"), "{found}");
}
