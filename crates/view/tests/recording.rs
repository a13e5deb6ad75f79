//! What is written can be read again.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::collections::BTreeMap;
use std::path::PathBuf;

use docktwin_core::{DVec3, Pose, SimTime};
use docktwin_view::{ContactArrow, Frame, Scalars, SceneModel, SceneWriter, ViewError};
use re_chunk::Chunk;
use re_log_encoding::DecoderApp;
use re_log_types::LogMsg;
use re_sdk_types::archetypes::{Arrows3D, TextDocument};

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Rows of each entity of the recording (not of its blueprint), by rerun's own decoder.
fn read(path: &PathBuf) -> BTreeMap<String, Vec<Chunk>> {
    let reader = std::io::BufReader::new(std::fs::File::open(path).expect("the file exists"));
    let mut entities = BTreeMap::<String, Vec<Chunk>>::new();
    for message in DecoderApp::decode_eager(reader).expect("rerun opens it") {
        if let LogMsg::ArrowMsg(store, message) = message.expect("every message is whole")
            && store.is_recording()
        {
            let chunk = Chunk::from_arrow_msg(&message).expect("a chunk");
            entities.entry(chunk.entity_path().to_string()).or_default().push(chunk);
        }
    }
    entities
}

fn rows(entities: &BTreeMap<String, Vec<Chunk>>, path: &str) -> usize {
    entities.get(path).map_or(0, |chunks| chunks.iter().map(Chunk::num_rows).sum())
}

#[test]
fn invariant_a_recording_opens_and_holds_every_frame() {
    let path = file("opens.rrd");
    let frames = synthetic::write(&path, 4.0).expect("written").len();
    let entities = read(&path);
    for (entity, want) in [
        ("/scene/target", frames),
        ("/scene/active_ring", frames),
        ("/scene/attenuator_legs", frames),
        ("/scene/active_ring/ring", 1),
        ("/scene/active_ring/petal_2", 1),
        ("/scene/target/passive_ring/petal_0", 1),
    ] {
        assert_eq!(rows(&entities, entity), want, "{entity}");
    }
    // Curves have one static row more: names and colours.
    for curve in ["/port/force", "/relative/rate", "/energy", "/latch/gap"] {
        assert_eq!(rows(&entities, curve), frames + 1, "{curve}");
    }
    assert!(rows(&entities, "/scene/contacts/petal_ring/normal") > 10);
    assert!(rows(&entities, "/events") > 0);
    for chunk in entities.values().flatten().filter(|c| !c.is_static()) {
        let timelines: Vec<_> = chunk.timelines().keys().map(|t| t.as_str().to_owned()).collect();
        assert_eq!(timelines, ["sim_time"], "{}", chunk.entity_path());
    }
}

struct Rig {
    chaser: docktwin_model::Spacecraft,
    target: docktwin_model::Spacecraft,
    mechanism: docktwin_model::DockingMechanism,
}

impl Rig {
    fn new() -> Self {
        Self {
            chaser: synthetic::chaser(),
            target: synthetic::target(),
            mechanism: synthetic::mechanism(),
        }
    }

    fn scene(&self) -> SceneModel<'_> {
        SceneModel {
            scenario: "test",
            chaser: &self.chaser,
            target: &self.target,
            mechanism: &self.mechanism,
            with_rig: true,
        }
    }

    fn writer(&self, path: &std::path::Path) -> Result<SceneWriter, ViewError> {
        SceneWriter::create(path, &self.scene(), &synthetic::pair_names())
    }
}

fn frame<'a>(nanos: u64, contacts: &'a [ContactArrow], scalars: &'a Scalars) -> Frame<'a> {
    Frame {
        time: SimTime::from_nanos(nanos),
        x_world_chaser: Pose::IDENTITY,
        x_world_target: Pose::from_translation(DVec3::X * 8.5),
        x_world_ring: Pose::from_translation(DVec3::X * 3.8),
        contacts,
        latches: [0; 3],
        scalars,
    }
}

const CONTACT: ContactArrow = ContactArrow {
    pair: 1,
    point_w_m: DVec3::new(3.8, 0.6, 0.0),
    normal_force_w_n: DVec3::new(-1900.0, 0.0, 0.0),
    friction_w_n: DVec3::ZERO,
    depth_m: 0.0019,
};

#[test]
fn oracle_arrows_are_drawn_in_e3_at_half_a_metre_for_a_kilonewton() {
    let path = file("arrows.rrd");
    let rig = Rig::new();
    let mut writer = rig.writer(&path).expect("created");
    let scalars = Scalars::default();
    // The vehicles drift and turn as one; the drawing must not notice.
    let drift = Pose::new(DVec3::new(7.0, -3.0, 2.0), docktwin_core::DQuat::from_rotation_y(1.1));
    let still = frame(0, &[], &scalars);
    let contact = ContactArrow {
        point_w_m: drift.transform_point(CONTACT.point_w_m),
        normal_force_w_n: drift.q * CONTACT.normal_force_w_n,
        ..CONTACT
    };
    let moved = Frame {
        x_world_chaser: drift * still.x_world_chaser,
        x_world_target: drift * still.x_world_target,
        x_world_ring: drift * still.x_world_ring,
        contacts: &[contact],
        ..still
    };
    writer.frame(&moved).expect("recorded");
    writer.frame(&frame(10_000_000, &[], &scalars)).expect("recorded");
    writer.frame(&frame(20_000_000, &[], &scalars)).expect("recorded");
    writer.finish().expect("closed");

    let entities = read(&path);
    let normal = "/scene/contacts/petal_ring/normal";
    assert_eq!(rows(&entities, normal), 2, "once there, once gone, then silence");
    let chunk = &entities[normal][0];
    let read = |part: re_sdk_types::ComponentDescriptor| {
        chunk.iter_slices::<[f32; 3]>(part.component).map(<[_]>::to_vec).collect::<Vec<_>>()
    };
    let vectors = read(Arrows3D::descriptor_vectors());
    let origins = read(Arrows3D::descriptor_origins());
    let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(near(vectors[0][0], [-1900.0 * 0.5 / 1000.0, 0.0, 0.0]), "{vectors:?}");
    // e3 is 3.5 m in front of the chaser's mass centre.
    assert!(near(origins[0][0], [0.3, 0.6, 0.0]), "{origins:?}");
    assert!(vectors[1].is_empty());
}

#[test]
fn invariant_all_problems_of_a_frame_are_named_and_the_recording_goes_on() {
    let path = file("problems.rrd");
    let rig = Rig::new();
    let mut writer = rig.writer(&path).expect("created");
    let scalars = Scalars::default();
    let bad = ContactArrow { pair: 99, depth_m: f64::NAN, ..CONTACT };
    let contacts = [bad];
    let mut f = frame(1_000_000, &contacts, &scalars);
    f.x_world_ring.p.y = f64::INFINITY;
    f.latches[2] = 4;
    let message = writer.frame(&f).expect_err("refused").to_string();
    for part in
        ["0.001 s", "x_world_ring", "contacts[0].pair: 99", "contacts[0].depth_m", "latches[2]: 4"]
    {
        assert!(message.contains(part), "{part} is not in: {message}");
    }
    writer.frame(&frame(2_000_000, &[CONTACT], &scalars)).expect("recorded");
    writer.finish().expect("closed");
    assert_eq!(rows(&read(&path), "/scene/active_ring"), 1);
}

#[test]
fn invariant_peaks_and_trace_are_those_of_ticks_between_frames() {
    let path = file("ticks.rrd");
    let mut writer = Rig::new().writer(&path).expect("created");
    let scalars = Scalars { between_force_n: 2345.0, ..Scalars::default() };
    writer.frame(&frame(0, &[], &Scalars::default())).expect("recorded");
    writer.tick(&frame(1_000_000, &[CONTACT], &scalars)).expect("taken in");
    let figures = "against the simulated system: felt peak 1.006; hardware peak 0.993";
    writer.event(SimTime::from_nanos(10_000_000), "fidelity", figures).expect("recorded");
    writer.frame(&frame(20_000_000, &[], &Scalars::default())).expect("recorded");
    writer.finish().expect("closed");
    let entities = read(&path);
    assert_eq!(rows(&entities, "/scene/active_ring"), 2);
    assert_eq!(rows(&entities, "/scene/active_ring/trace/000"), 1);
    let text = TextDocument::descriptor_text();
    let last = entities["/contact_table"]
        .iter()
        .flat_map(|c| c.iter_slices::<String>(text.component).map(|t| t[0].to_string()).last())
        .last()
        .expect("a table");
    assert!(last.contains("1.90 kN | 0.001 s"), "{last}");
    assert!(last.contains("peak 2.35 kN at 0.001 s"), "{last}");
    let told = entities["/fidelity"]
        .iter()
        .flat_map(|c| c.iter_slices::<String>(text.component).map(|t| t[0].to_string()).last())
        .last()
        .expect("the figures");
    assert!(told.contains("- felt peak 1.006\n- hardware peak 0.993"), "{told}");
}

/// The gate runs this file with the feature `live` and without it.
#[test]
fn invariant_without_a_viewer_there_is_no_live_recording() {
    let rig = Rig::new();
    let names = synthetic::pair_names();
    // A port that no program of a user may open, and what is no viewer's address.
    for url in ["rerun+http://127.0.0.1:1/proxy", "nonsense"] {
        let Err(e) = SceneWriter::live(url, &rig.scene(), &names) else {
            panic!("connected to {url}")
        };
        let said = e.to_string();
        assert!(said.contains(url), "{said}");
        if cfg!(feature = "live") {
            assert!(matches!(e, ViewError::NoViewer { .. }), "{said}");
            assert!(said.contains("rerun --bind 127.0.0.1"), "{said}");
        } else {
            assert!(matches!(e, ViewError::WithoutLive { .. }), "{said}");
            assert!(said.contains("cargo build --release --features live"), "{said}");
        }
    }
}

#[test]
fn invariant_a_ghost_shares_plots_and_keeps_its_own_scene() {
    let path = file("ghost.rrd");
    let rig = Rig::new();
    let scene = rig.scene();
    let names = synthetic::pair_names();
    let mut a = SceneWriter::create_compared(&path, &scene, &names).expect("created");
    let mut b = a.ghost(&scene, &names, -5_000_000).expect("added");
    let scalars = Scalars::default();
    b.frame(&frame(0, &[CONTACT], &scalars)).expect("recorded");
    b.frame(&frame(10_000_000, &[CONTACT], &scalars)).expect("recorded");
    a.frame(&frame(0, &[CONTACT], &scalars)).expect("recorded");
    b.finish().expect("sent");
    a.finish().expect("closed");
    let entities = read(&path);
    for (entity, want) in [
        ("/scene/active_ring", 1),
        ("/scene/ghost/active_ring", 2),
        ("/scene/ghost/active_ring/petal_0", 1),
        ("/scene/ghost/contacts/petal_ring/normal", 2),
        ("/scene/ghost/labels/text", 0),
        ("/port/force", 2),
        ("/port/force/ghost", 3),
        ("/ghost_contact_table", 2),
    ] {
        assert_eq!(rows(&entities, entity), want, "{entity}");
    }
    let times: Vec<i64> = entities["/scene/ghost/active_ring"]
        .iter()
        .flat_map(|c| c.timelines().values().flat_map(|t| t.times_raw().to_vec()))
        .collect();
    assert_eq!(times, [-5_000_000, 5_000_000]);
}

#[test]
fn invariant_the_viewers_version_is_that_of_the_library() {
    let manifest = include_str!("../../../Cargo.toml");
    let pinned = format!("\"={}\"", docktwin_view::VIEWER_VERSION);
    let of_rerun = |l: &&str| l.starts_with("re_") && l.contains("version");
    let lines: Vec<&str> = manifest.lines().filter(of_rerun).collect();
    assert!(lines.len() > 3, "rerun's crates are not in the manifest: {lines:?}");
    for line in lines {
        assert!(line.contains(&pinned), "{line}");
    }
}

#[test]
fn invariant_a_cut_or_missing_recording_is_not_whole() {
    let path = file("whole.rrd");
    let mut writer = Rig::new().writer(&path).expect("created");
    writer.frame(&frame(0, &[CONTACT], &Scalars::default())).expect("recorded");
    writer.finish().expect("closed");
    assert!(docktwin_view::is_whole(&path));
    let bytes = std::fs::read(&path).expect("written");
    let cut = file("cut.rrd");
    for keep in [0, 3, bytes.len() / 2] {
        std::fs::write(&cut, &bytes[..keep]).expect("written");
        assert!(!docktwin_view::is_whole(&cut), "{keep} of {} bytes", bytes.len());
    }
    assert!(!docktwin_view::is_whole(&file("nothing.rrd")));
}

#[test]
fn invariant_a_dropped_writer_leaves_what_it_was_given() {
    let path = file("dropped.rrd");
    let scalars = Scalars::default();
    let mut writer = Rig::new().writer(&path).expect("created");
    writer.frame(&frame(0, &[CONTACT], &scalars)).expect("recorded");
    drop(writer);
    assert_eq!(rows(&read(&path), "/scene/active_ring"), 1);
}

#[test]
fn invariant_a_path_that_cannot_be_written_is_an_error() {
    let path = file("no such directory").join("run.rrd");
    let Err(e) = Rig::new().writer(&path) else {
        panic!("created in a directory that is not there")
    };
    assert!(matches!(e, ViewError::Create { .. }), "{e}");
    assert!(e.to_string().contains("run.rrd"), "{e}");
}

#[test]
fn invariant_twenty_seconds_with_twelve_contacts_stay_below_ten_megabytes() {
    let path = file("long.rrd");
    let mut writer = Rig::new().writer(&path).expect("created");
    let mut spent = std::time::Duration::ZERO;
    for k in 0..2000u32 {
        let t = f64::from(k) * 0.01;
        let contacts: Vec<_> = (0..12u32)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * 0.52 + 0.05 * t).sin_cos();
                let size = 2000.0 * (1.0 + (3.0 * t + f64::from(i)).sin());
                ContactArrow {
                    pair: i as usize,
                    point_w_m: DVec3::new(3.82 + 0.002 * t, 0.6 * cos, 0.6 * sin),
                    normal_force_w_n: DVec3::new(-size, 0.3 * size * cos, 0.3 * size * sin),
                    friction_w_n: DVec3::new(0.0, -0.1 * size * sin, 0.1 * size * cos),
                    depth_m: 1e-6 * size,
                }
            })
            .collect();
        let scalars = Scalars {
            port_force_n: DVec3::new(-1e3 * t.sin(), 1e2 * t.cos(), t.sqrt()),
            relative_position_m: DVec3::new(t.sin(), t.cos(), t.sqrt()),
            ..Scalars::default()
        };
        let f = frame(u64::from(k) * 10_000_000, &contacts, &scalars);
        let start = std::time::Instant::now();
        writer.frame(&f).expect("recorded");
        spent += start.elapsed();
    }
    writer.finish().expect("closed");
    let bytes = std::fs::metadata(&path).expect("written").len();
    assert!(bytes < 10_000_000, "{bytes} bytes");
    println!("{bytes} bytes, {:.1} µs a frame", 1e6 * spent.as_secs_f64() / 2000.0);
}

#[test]
fn invariant_a_bare_rigid_ring_has_no_petals_legs_or_latches() {
    let path = file("bare.rrd");
    let mut rig = Rig::new();
    rig.mechanism.active.petals = None;
    rig.mechanism.passive.petals = None;
    rig.mechanism.latches = None;
    rig.mechanism.attenuator = docktwin_model::Attenuator::Rigid;
    let scalars = Scalars { latch_gap_m: [f64::NAN; 3], ..Scalars::default() };
    let mut writer = rig.writer(&path).expect("created");
    writer.frame(&frame(0, &[ContactArrow { pair: 0, ..CONTACT }], &scalars)).expect("recorded");
    writer.finish().expect("closed");
    let entities = read(&path);
    assert_eq!(rows(&entities, "/scene/active_ring/ring"), 1);
    assert_eq!(rows(&entities, "/scene/contacts/ring_ring/normal"), 1);
    let odd =
        |e: &&String| ["petal_", "legs", "latches", "latch_state"].iter().any(|w| e.contains(w));
    assert_eq!(entities.keys().find(odd), None);
}

#[cfg(target_os = "linux")]
#[test]
fn invariant_a_full_disk_is_an_error() {
    let scalars = Scalars::default();
    let result = Rig::new().writer(std::path::Path::new("/dev/full")).and_then(|mut writer| {
        writer.frame(&frame(0, &[CONTACT], &scalars))?;
        writer.finish()
    });
    assert!(
        matches!(result, Err(ViewError::Create { .. } | ViewError::Write { .. })),
        "{result:?}"
    );
}
