//! What `replay` and `report` say of a run directory that is not what was recorded.

#[path = "../../crates/record/tests/mcap_rewrite/mod.rs"]
mod mcap_rewrite;

use std::{
    fs,
    path::{Path, PathBuf},
};

use docktwin_physics::as_built::{Grade, MechanismDraw};
use docktwin_record::{RunReader, files, read_summary};
use docktwin_run::{
    HilOptions, HilRun, Rehearsal, RehearsalOptions, Replay, Replayed, RigMechanism, RunDirectory,
    RunError, TwinKind,
};
use docktwin_scenario::{CompensatorChoice, Loader};
use mcap_rewrite::{Rewrite, rewrite, scale};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_owned()
}

fn rehearse(scenario: &Path, speed: f64, dir: &Path) {
    let loader = Loader::new().set("run.duration_s", 0.4).set("initial.axial_speed_m_s", speed);
    let scenario = loader.load(scenario).expect("a scenario");
    let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
    let run = Rehearsal::with(&scenario, options).expect("the sides are apart");
    let _ = run.run(&mut RunDirectory::new(dir)).expect("room");
}

fn recorded(speed: f64) -> (tempfile::TempDir, PathBuf) {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("run");
    rehearse(&root().join("scenarios/basic_central_impact.toml"), speed, &dir);
    (at, dir)
}

fn replay(dir: &Path) -> Result<Replayed, RunError> {
    Replay::open(dir)?.run()
}

fn report(dir: &Path) -> (docktwin_report::Written, String) {
    let written = docktwin_report::write(dir, &dir.join("report.html")).expect("a page");
    let page = fs::read_to_string(&written.path).expect("a page");
    (written, page)
}

#[test]
fn oracle_a_whole_run_is_identical_with_the_figures_of_its_summary() {
    let (_at, dir) = recorded(0.35);
    let found = replay(&dir).expect("replayable");
    assert!(found.identical() && found.cut.is_none(), "{found:?}");
    assert!(found.signals > 100 && found.figures == 16 && found.unknown.is_empty(), "{found:?}");
    let (written, page) = report(&dir);
    assert!(written.as_recorded && written.incomplete.is_none());
    assert!(page.contains("as expected") && page.contains("<table class=\"loads\">"));
}

#[test]
fn regress_a_replay_names_the_first_edited_signal_whatever_checksums_say() {
    let (_at, dir) = recorded(0.35);
    let log = dir.join(files::LOG);
    let mut first = None;
    let whole = RunReader::open(&dir).expect("a recording");
    let (port, name) = {
        let of: Vec<_> = whole.columns().iter().filter(|c| c.topic == "/loads").collect();
        (4, of[0].name.clone())
    };
    rewrite(&log, &Rewrite::default(), |topic, tick, data| {
        if topic == "/loads" {
            let before = data.clone();
            scale(data, port, 0.1);
            if *data != before {
                first.get_or_insert(tick);
            }
        }
        true
    });
    let found = replay(&dir).expect("replayable");
    let d = found.first_difference.as_ref().expect("it differs");
    assert_eq!((d.tick, &d.signal), (u64::from(first.expect("a load")), &name), "{found:?}");
    assert!(!found.identical() && found.not_as_recorded, "{found:?}");
    let (written, page) = report(&dir);
    assert!(!written.as_recorded, "{written:?}");
    assert!(page.contains("This is not what was recorded.") && !page.contains(">as expected<"));
    assert!(page.contains("Not read: the log is not whole"));
}

#[test]
fn regress_a_replay_names_the_first_figure_that_does_not_follow() {
    let (_at, dir) = recorded(0.35);
    let path = dir.join(files::SUMMARY);
    let peak = read_summary(&dir).expect("readable").expect("a summary").summary.peak_force_n;
    let text = fs::read_to_string(&path).expect("a summary");
    let edited = text.replace(&format!("{peak:?}"), &format!("{:?}", peak * 0.5));
    assert_ne!(text, edited);
    // Without its own digest it is a summary as older versions wrote them.
    fs::write(&path, edited.replace("\"summary_digest\"", "\"was_digest\"")).expect("room");
    let found = replay(&dir).expect("replayable");
    let d = found.summary_difference.as_ref().expect("it differs");
    assert_eq!((d.key.as_str(), &d.replayed), ("peak_force_n", &format!("{peak:?}")), "{found:?}");
    assert!(!found.identical() && found.first_difference.is_none());
    // With it, a report says so too, and takes nothing from it.
    fs::write(&path, &edited).expect("room");
    let (written, page) = report(&dir);
    assert!(!written.as_recorded && page.contains("summary.json is not as it was written"));
    assert!(page.contains("no verdict") && !page.contains("largest force between the sides"));
}

#[test]
fn regress_a_report_of_a_damaged_log_says_so_first_and_gives_no_load() {
    let (_at, dir) = recorded(0.35);
    let log = dir.join(files::LOG);
    let good = fs::read(&log).expect("a log");
    // In the first chunk, so that nothing can be read in front of the damage, and in the middle.
    let mut chunks = (0..good.len()).filter(|i| good[*i..].starts_with(b"zstd"));
    let mut inside = |n| chunks.nth(n).expect("a chunk") + 60;
    for (at, ticks) in [(inside(0), false), (inside(3), true)] {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        fs::write(&log, bad).expect("room");
        let (written, page) = report(&dir);
        let why = written.incomplete.expect("told");
        assert!(why.contains("The log is damaged") && !written.as_recorded, "{why}");
        let [warning, verdict, loads] =
            ["class=\"warning\"", "class=\"verdict", "Loads on the passive ring"]
                .map(|w| page.find(w).expect("it is there"));
        assert!(warning < verdict && verdict < loads);
        assert!(page.contains("Not read: the log is not whole") && !page.contains(">as expected<"));
        assert_eq!(page.contains("<td>not read</td>"), !ticks, "recorded time");
    }
}

#[test]
fn regress_files_of_another_run_are_told() {
    let ((_a, one), (_b, two)) = (recorded(0.35), recorded(0.36));
    let keep = fs::read(one.join(files::SUMMARY)).expect("a summary");
    fs::copy(two.join(files::SUMMARY), one.join(files::SUMMARY)).expect("room");
    let (written, page) = report(&one);
    assert!(!written.as_recorded && page.contains("summary.json and run.mcap are not of one run"));
    assert!(page.contains("no verdict") && !page.contains("<table class=\"loads\">"));
    let found = replay(&one).expect("replayable");
    assert!(found.not_as_recorded && found.cut.is_some_and(|c| c.contains("not of one run")));
    fs::write(one.join(files::SUMMARY), keep).expect("room");

    let scenario = fs::read(one.join(files::SCENARIO)).expect("a scenario");
    fs::copy(two.join(files::SCENARIO), one.join(files::SCENARIO)).expect("room");
    let (written, page) = report(&one);
    assert!(!written.as_recorded && page.contains("scenario.toml is not the file of the run"));
    let e = replay(&one).expect_err("another scenario").to_string();
    assert!(e.contains("scenario.toml is not the file of the run"), "{e}");
    fs::write(one.join(files::SCENARIO), scenario).expect("room");
    assert!(replay(&one).expect("as it was").identical());
}

#[test]
fn regress_a_folder_with_a_line_feed_in_its_name_is_replayable() {
    let at = tempfile::tempdir().expect("a folder");
    let odd = at.path().join("two\nlines = 1");
    let copy = |from: &str| {
        let (from, to) = (root().join(from), odd.join(from));
        fs::create_dir_all(to.parent().expect("a folder")).expect("room");
        fs::copy(from, to).expect("room");
    };
    let scenario = "scenarios/basic_central_impact.toml";
    copy(scenario);
    for e in ["models", "models/urdf", "meshes"] {
        let Ok(entries) = fs::read_dir(root().join(e)) else { continue };
        for f in entries.map(|f| f.expect("an entry").path()).filter(|f| f.is_file()) {
            copy(&format!("{e}/{}", f.file_name().expect("a name").to_string_lossy()));
        }
    }
    let dir = odd.join("run");
    rehearse(&odd.join(scenario), 0.35, &dir);
    let found = replay(&dir).expect("replayable");
    assert!(found.identical() && found.ticks > 300, "{found:?}");
}

#[test]
fn oracle_a_run_against_an_emulated_rig_is_identical_with_its_figures() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("run");
    let loader = Loader::new().set("run.duration_s", 1.0);
    let scenario = loader.load(&root().join("scenarios/hil_uncompensated.toml"));
    let scenario = scenario.expect("a scenario");
    let run = HilRun::new(&scenario, HilOptions::default()).expect("a rig");
    let rig = run.emulated().expect("a rig");
    let _ = run.run(rig, &mut RunDirectory::new(&dir)).expect("room");
    let found = replay(&dir).expect("replayable");
    assert!(found.identical() && found.cut.is_none(), "{found:?}");
    assert!(found.figures > 15 && found.signals > 150, "{found:?}");
}

/// The twins of the loop are in its digest, and come out the same; what they gave is in the record.
#[test]
fn oracle_a_run_with_twins_replays_by_its_record() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("run");
    let loader = Loader::new().set("run.duration_s", 0.6).set("initial.gap_m", 0.01);
    let scenario = loader.load(&root().join("scenarios/apas_fast.toml")).expect("a scenario");
    let options =
        HilOptions { compensator: Some(CompensatorChoice::Twin), ..HilOptions::default() };
    let run = HilRun::new(&scenario, options).expect("a rig");
    let rig = run.emulated().expect("a rig");
    let summary = run.run(rig, &mut RunDirectory::new(&dir)).expect("room");
    assert_eq!(summary.compensator.expect("named").name, "twin");
    let mut log = RunReader::open(&dir).expect("a recording");
    let column = log.column_index("correction_4_force_x_n").expect("a column");
    let given = log.ticks().map(|t| t.expect("a tick").row[column].as_f64().abs());
    assert!(given.fold(0.0, f64::max) > 10.0, "no correction in the record");
    let found = replay(&dir).expect("replayable");
    assert!(found.identical() && found.cut.is_none(), "{found:?}");
}

/// A drawn mechanism, and another one: the record holds what it takes to be run again, and what was drawn.
#[test]
fn oracle_a_run_with_another_mechanism_on_the_rig_replays_by_its_record() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("run");
    let loader = Loader::new().set("run.duration_s", 0.6).set("initial.gap_m", 0.01);
    let scenario = loader.load(&root().join("scenarios/apas_fast.toml")).expect("a scenario");
    let options = HilOptions {
        mechanism: RigMechanism {
            file: Some(root().join("models/foreign/apas_backlash_active.toml")),
            draw: Some(MechanismDraw { number: 5, grade: Grade::Coarse }),
        },
        ..HilOptions::default()
    };
    let run = HilRun::new(&scenario, options).expect("a rig");
    let stiffness =
        run.drawn().iter().find(|d| d.name == "contact_stiffness").expect("drawn").value;
    let rig = run.emulated().expect("a rig");
    let _ = run.run(rig, &mut RunDirectory::new(&dir)).expect("room");
    let metadata = RunReader::open(&dir).expect("a recording").metadata().clone();
    let of = |key: &str| metadata.get(key).map(String::as_str);
    assert_eq!((of("mechanism_draw"), of("mechanism_grade")), (Some("5"), Some("coarse")));
    assert_eq!(of("drawn:contact_stiffness"), Some(stiffness.to_string().as_str()));
    let found = replay(&dir).expect("replayable");
    assert!(found.identical() && found.cut.is_none(), "{found:?}");
    // Another mechanism beside the log is noticed.
    let kept = dir.join("models/rig-mechanism/active.toml");
    let text = fs::read_to_string(&kept).expect("kept");
    fs::write(&kept, text.replacen("value = 0.001,", "value = 0.002,", 1)).expect("room");
    let told = replay(&dir).expect_err("another mechanism").to_string();
    assert!(told.contains("mechanism"), "{told}");
}
