use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use docktwin_core::DVec3;
use docktwin_model::toml_check::Checker;
use docktwin_model::{AttenuationChoice, Attenuator, NormalLaw};

use crate::keys::{EXAMPLE, KEYS, Shape, find};
use crate::load::read_scenario;
use crate::*;

fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

fn nominal() -> PathBuf {
    scenarios().join("apas_nominal.toml")
}

fn set(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
}

fn load(pairs: &[(&str, &str)]) -> Scenario {
    load_scenario(&nominal(), &set(pairs)).unwrap_or_else(|e| panic!("{e}"))
}

/// A scenario with every section; models are those of the repository.
const WHOLE: &str = EXAMPLE;

/// Writes `WHOLE` with one text replaced into `scenarios/` of a folder that has our models.
fn problems_of(from: &str, to: &str) -> Vec<docktwin_model::Problem> {
    assert!(WHOLE.contains(from), "no {from:?}: mend the case");
    // The Kelvin–Voigt damping stands there only so that every key does.
    let text = WHOLE.replacen("damping_n_s_m = 4000.0\n", "", 1);
    let text = text.replacen(from, to, 1);
    let text = text.replace("\"models/", &format!("\"{}/../models/", scenarios().display()));
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("bad.toml");
    std::fs::write(&path, text).expect("write");
    load_scenario(&path, &[]).map_or_else(|e| e.problems, |_| Vec::new())
}

#[test]
fn regress_every_scenario_of_the_repository_loads() {
    let mut count = 0;
    for entry in std::fs::read_dir(scenarios()).expect("scenarios/") {
        let path = entry.expect("entry").path();
        let scenario = load_scenario(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
        let stem = path.file_stem().expect("name").to_string_lossy();
        assert_eq!(scenario.name, stem, "a scenario is called after its file");
        assert!(scenario.expect.because.len() > 20, "{stem}: say why");
        // Scenario, two spacecraft and two sides of two files each.
        assert_eq!(scenario.files.len(), 9, "{stem}");
        count += 1;
    }
    assert!(count >= 17, "{count}");
}

#[test]
fn regress_angles_are_radians_and_defaults_hold() {
    let s = load(&[("initial.roll_deg", "15"), ("initial.yaw_rate_deg_s", "0.5")]);
    assert!((s.initial.attitude.roll - 15f64.to_radians()).abs() < 1e-15);
    assert!((s.initial.attitude.yaw - 2f64.to_radians()).abs() < 1e-15);
    assert!((s.initial.rates_rad_s.z - 0.5f64.to_radians()).abs() < 1e-15);
    assert!((s.initial.gap_m - 0.05).abs() < 1e-15);
    assert_eq!(s.run.tick_nanos, 1_000_000);
    assert_eq!(s.run.ticks(), 30_000);
    assert_eq!(s.run.steps_per_tick, None);
    assert!(s.thrusts.is_empty() && !s.run.stop_when_decided);
    assert!(matches!(s.mechanism.attenuator, Attenuator::Characteristic(_)));
}

#[test]
fn invariant_every_key_is_read_and_explained() {
    let checker = Checker::new(Path::new("whole.toml"), WHOLE);
    assert!(checker.read(read_scenario).is_some());
    let (problems, values) = checker.finish();
    assert!(problems.is_empty(), "{problems:#?}");
    let read: BTreeSet<&str> =
        values.iter().map(|v| find(&v.key).unwrap_or_else(|| panic!("{}", v.key)).key).collect();
    let known: BTreeSet<&str> = KEYS.iter().map(|k| k.key).collect();
    assert_eq!(read, known);
    // Words are explained as they are read.
    let words = |key: &str| match find(key).map(|k| k.shape) {
        Some(Shape::Words(w, _)) => w.to_vec(),
        other => panic!("{key}: {other:?}"),
    };
    assert_eq!(words("expect.outcome"), ExpectedOutcome::WORDS.map(|(w, _)| w));
    assert_eq!(words("mechanism.attenuation"), AttenuationChoice::WORDS.map(|(w, _)| w));
    for k in KEYS {
        let text = explain(Some(k.key)).expect("explained");
        assert!(text.contains(k.meaning) && k.meaning.ends_with('.'), "{}", k.key);
        let name = k.key.rsplit('.').next().expect("a name");
        assert!(text.contains(&format!("    example: {name} = ")), "{text}");
    }
}

#[test]
fn regress_explain() {
    let all = explain(None).expect("all keys");
    assert_eq!(all.lines().count(), 4 * KEYS.len());
    let gap = explain(Some("initial.gap_m")).expect("one key");
    assert!(gap.contains("number, m, > 0 and ≤ 10; default 0.05"), "{gap}");
    assert_eq!(explain(Some("thrust.0.on")), explain(Some("thrust.on")));
    assert!(explain(Some("initial")).expect("a table").lines().count() > 30);
    let unknown = explain(Some("initial.gap")).expect_err("no such key");
    assert_eq!(unknown.nearest, "initial.gap_m");
    // The name alone, without its table, and one unlike anything.
    assert_eq!(explain(Some("gap_m")).expect_err("a table is missing").nearest, "initial.gap_m");
    let strange = explain(Some(&"x\u{1b}".repeat(500))).expect_err("no such key");
    assert!(strange.nearest.is_empty() && strange.key.chars().count() < 1000, "{strange}");
    assert!(!strange.to_string().contains('\u{1b}'), "{strange}");
}

#[test]
fn regress_overrides_change_add_and_reach_into_lists() {
    let s = load(&[
        ("initial.axial_speed_m_s", "0.09"),
        ("run.steps_per_tick", "4"),
        ("mechanism.attenuation", "rigid"),
        ("mechanism.contact.friction_kinetic", "0"),
    ]);
    assert!((s.initial.axial_speed_m_s - 0.09).abs() < 1e-15);
    assert_eq!(s.run.steps_per_tick, Some(4));
    assert_eq!(s.mechanism.attenuator, Attenuator::Rigid);
    assert!(s.mechanism.contact.friction_kinetic.abs() < 1e-15);

    let path = scenarios().join("thrust_assist.toml");
    let s = load_scenario(&path, &set(&[("thrust.0.force_x_n", "250.0")])).expect("loads");
    assert_eq!(s.thrusts[0].force_n, DVec3::X * 250.0);
    assert_eq!(s.thrusts[0].after, Trigger::FirstContact);
    assert!(s.effective_toml.contains("force_x_n = 250.0"));
}

#[test]
fn regress_wrong_overrides_say_so() {
    for (key, value, says) in [
        ("initial.axial_speed_m_s", "-1", "--set initial.axial_speed_m_s = -1 m/s"),
        ("initial.axial", "1", "is not a known key"),
        ("initial", "1", "is a table"),
        ("name.x", "1", "is a value, not a table"),
        ("initial..gap_m", "1", "not a key path"),
        ("run.duration_s", "soon", "is a string"),
    ] {
        let e = load_scenario(&nominal(), &set(&[(key, value)])).expect_err(key);
        assert!(e.to_string().contains(says), "{key}: {e}");
    }
    let path = scenarios().join("thrust_assist.toml");
    let e = load_scenario(&path, &set(&[("thrust.3.delay_s", "1")])).expect_err("one thrust");
    assert!(e.to_string().contains("list of 1"), "{e}");
}

#[test]
fn invariant_lines_are_those_of_the_file_even_with_overrides() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("bad.toml");
    let text = WHOLE
        .replace("gap_m = 0.1", "gap_m = -0.1")
        .replace("\"models/", &format!("\"{}/../models/", scenarios().display()));
    std::fs::write(&path, &text).expect("write");
    let line = 1 + text.lines().position(|l| l.starts_with("gap_m")).expect("line");
    for overrides in [set(&[]), set(&[("mechanism.contact.merge_depth_m", "1e-4")])] {
        let e = load_scenario(&path, &overrides).expect_err("bad gap");
        let gap = e.problems.iter().find(|p| p.key == "initial.gap_m").expect("reported");
        assert_eq!(gap.line, Some(line));
    }
}

#[test]
fn regress_contact_and_petals_are_overridden() {
    let s = load(&[("mechanism.petals", "false")]);
    assert!(s.mechanism.active.petals.is_none() && s.mechanism.passive.petals.is_none());
    let s = load(&[
        ("mechanism.contact.normal_law", "kelvin_voigt"),
        ("mechanism.contact.damping_n_s_m", "4000"),
    ]);
    let want = NormalLaw::KelvinVoigt { stiffness: 1e6, damping_n_s_m: 4000.0 };
    assert_eq!(s.mechanism.contact.normal, want);
    let s = load(&[("mechanism.contact.damping_s_m", "0")]);
    let want = NormalLaw::HuntCrossley { stiffness: 1e6, exponent: 1.0, damping_s_m: 0.0 };
    assert_eq!(s.mechanism.contact.normal, want);
}

#[test]
fn invariant_a_recorded_scenario_loads_as_the_same() {
    let s = load(&[("initial.lateral_y_m", "0.03")]);
    let folder = scenarios().join("../target/scenario-tests");
    std::fs::create_dir_all(&folder).expect("a folder");
    let dir = tempfile::tempdir_in(&folder).expect("a folder");
    let path = dir.path().join("scenario.toml");
    std::fs::write(&path, s.as_run_toml()).expect("write");
    let again = load_scenario(&path, &[]).expect("loads");
    assert_eq!(again.initial, s.initial);
    assert_eq!(again.mechanism, s.mechanism);
    assert_eq!((again.chaser, again.target), (s.chaser, s.target));
    let digest = s.files[1].digest.to_string();
    assert!(again.effective_toml.contains(&digest), "digests stand in the file");
}

#[test]
fn invariant_problems_of_scenario_and_models_come_together() {
    let e = load_scenario(
        &nominal(),
        &set(&[
            ("chaser.model", "models/urdf/nothing.urdf"),
            ("target.model", "models/urdf/chaser_8t.urdf"),
            ("mechanism.attenuation", "soft"),
            ("initial.gap_m", "0"),
        ]),
    )
    .expect_err("four problems");
    let text = e.to_string();
    assert_eq!(e.problems.len(), 4, "{text}");
    for says in ["nothing.urdf", "wrong side", "characteristic | differential | rigid", "gap_m"] {
        assert!(text.contains(says), "{says} in\n{text}");
    }
}

#[test]
fn regress_paths_count_from_the_scenario_upward() {
    let named = Path::new("models/urdf/chaser_8t.urdf");
    assert!(resolve_path(&nominal(), named).expect("found").is_file());
    assert_eq!(resolve_path(&nominal(), Path::new("models/urdf/nothing.urdf")), None);
    let dir = tempfile::tempdir().expect("a folder");
    let deep = dir.path().join("a/b");
    std::fs::create_dir_all(&deep).expect("folders");
    std::fs::write(dir.path().join("x.urdf"), "far").expect("write");
    let found = resolve_path(&deep.join("s.toml"), Path::new("x.urdf")).expect("found");
    assert_eq!(std::fs::read_to_string(found).expect("text"), "far");
    std::fs::write(deep.join("x.urdf"), "near").expect("write");
    let found = resolve_path(&deep.join("s.toml"), Path::new("x.urdf")).expect("found");
    assert_eq!(std::fs::read_to_string(found).expect("text"), "near");
}

#[test]
fn regress_expectations_make_the_verdict() {
    let target =
        |value, tolerance| Bound { near: Some(Target { value, tolerance }), ..Bound::default() };
    let expect = Expect {
        outcome: ExpectedOutcome::Captured,
        hil_outcome: None,
        because: "why".into(),
        run: RunBounds {
            capture_s: Bound { below: Some(5.0), ..Bound::default() },
            peak_force_n: target(1000.0, 0.01),
            impulse_ns: Bound { above: Some(10.0), ..Bound::default() },
            ..RunBounds::default()
        },
        exit_speed_m_s: Bound::default(),
        hil: HilBounds::default(),
        fidelity: Vec::new(),
    };
    let good = Measured {
        outcome: ExpectedOutcome::Captured,
        first_contact_s: Some(0.7),
        capture_s: Some(3.0),
        duration_s: 9.0,
        peak_force_n: 1009.0,
        peak_moment_nm: f64::NAN,
        peak_penetration_m: 0.001,
        impulse_ns: 20.0,
        exit_speed_m_s: None,
    };
    assert_eq!(expect.failures(&good), Vec::<String>::new());
    let one = |bad: Measured, says: &str| {
        let failures = expect.failures(&bad);
        assert!(failures.len() == 1 && failures[0].contains(says), "{failures:?}");
    };
    one(Measured { outcome: ExpectedOutcome::Missed, ..good }, "missed instead of captured (why)");
    one(Measured { capture_s: Some(5.1), ..good }, "at most 5");
    one(Measured { capture_s: None, ..good }, "there was none");
    one(Measured { peak_force_n: 989.0, ..good }, "1000 ± 1 %");
    one(Measured { peak_force_n: f64::NAN, ..good }, "NaN");
    one(Measured { impulse_ns: 9.0, ..good }, "at least 10");
    // They are of the docking without a rig.
    let hil = Measured { capture_s: None, peak_force_n: 0.0, ..good };
    assert_eq!(expect.hil_failures(&hil, &|_| None), Vec::<String>::new());
    assert_eq!(
        expect.not_judged_by_hil(),
        ["expect.capture_before_s", "expect.peak_force_n", "expect.impulse_above_ns"]
    );
    assert!(expect.not_judged_without_rig().is_empty());
}

/// Every bound that the example file gives of a run with a rig, met once, then broken one by one, then
/// without its figure.
#[test]
fn invariant_each_bound_of_a_rig_is_judged_and_none_is_met_by_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("my_approach.toml");
    let text = WHOLE.replacen("damping_n_s_m = 4000.0\n", "", 1);
    let text = text.replace("\"models/", &format!("\"{}/../models/", scenarios().display()));
    let text = text.replace("hil_outcome = \"stopped\"\n", "");
    std::fs::write(&path, text).expect("write");
    let expect = load_scenario(&path, &[]).unwrap_or_else(|e| panic!("{e}")).expect;
    let run = Measured {
        outcome: ExpectedOutcome::Captured,
        first_contact_s: Some(1.0),
        capture_s: Some(3.0),
        duration_s: 9.0,
        peak_force_n: 1000.0,
        peak_moment_nm: 100.0,
        peak_penetration_m: 0.001,
        impulse_ns: 20.0,
        exit_speed_m_s: None,
    };
    let as_simulated = |key: &str| -> Option<f64> {
        Some(if key.contains("ratio") || key.starts_with("R_") { 1.0 } else { 1e-4 })
    };
    assert_eq!(expect.hil_failures(&run, &as_simulated), Vec::<String>::new());
    let none = expect.hil_failures(&run, &|_| None);
    // R_e, R_T, delta_energy, first_contact_difference_s, and ten of the comparison.
    assert_eq!(none.len(), 14, "{none:?}");
    assert!(none.iter().all(|f| f.contains("was not computed (null)")), "{none:?}");
    for far in [1e3, -1e3] {
        let all = expect.hil_failures(&run, &|_| Some(far));
        let upper_only = ["nrms", "latch", "capture_d", "first_contact_d"];
        let judged = |key: &str| {
            far > 0.0 || key.contains("difference") || {
                !upper_only.iter().any(|u| key.contains(u))
            }
        };
        let expected = none.iter().filter(|f| judged(f.split(':').next().unwrap_or_default()));
        assert_eq!(all.len(), expected.count(), "{all:?}");
    }
    let nan = Measured { peak_moment_nm: f64::NAN, first_contact_s: None, ..run };
    let failures = expect.hil_failures(&nan, &as_simulated);
    assert_eq!(failures.len(), 2, "{failures:?}");
    // Latches are judged by the worst, and one that is missing is no figure.
    let latch = |key: &str| match key {
        "hardware.latch_difference_s.2" => Some(-0.006),
        _ => as_simulated(key),
    };
    let failures = expect.hil_failures(&run, &latch);
    assert!(
        failures.len() == 1 && failures[0].contains("hardware.latch_difference_s 0.006 s"),
        "{failures:?}"
    );
    let gone = |key: &str| as_simulated(key).filter(|_| key != "hardware.latch_difference_s.0");
    assert_eq!(expect.hil_failures(&run, &gone).len(), 1);
    let keys = expect.not_judged_without_rig();
    let given = WHOLE.split("[expect.hil]").nth(1).expect("the table");
    let bounds = given.lines().filter(|l| l.contains(" = ") && !l.contains('"')).count();
    assert_eq!(keys.len(), bounds, "{keys:?}");
    assert!(keys.contains(&"expect.fidelity.0.nrms_force_below".to_owned()), "{keys:?}");
}

/// Each case: text, what replaces it, what the message must say.
const BAD: &[(&str, &str, &str)] = &[
    ("schema = 1", "", "schema: is missing"),
    ("schema = 1", "schema = 2", "whole number from 1 to 1"),
    ("name = \"my_approach\"", "name = \"\"", "name = \"\": is empty"),
    ("name = \"my_approach\"", "", "name: is missing"),
    ("name = \"my_approach\"", "title = \"whole\"", "title = \"whole\": is not a known key"),
    ("[chaser]\nmodel = ", "[chaser]\nmodle = ", "did you mean `model`?"),
    ("[chaser]\nmodel = ", "[chaser]\nmodel = 5 # ", "chaser.model = 5: is an integer"),
    ("chaser_8t.urdf", "chaser_9t.urdf", "is found neither beside the scenario"),
    ("target_12t.urdf", "chaser_8t.urdf", "wrong side"),
    ("chaser_8t.urdf", "target_12t.urdf", "wrong side"),
    ("[target]", "[tarjet]", "add [target]"),
    ("apas_active.urdf", "apas_passive.urdf", "mechanism_active"),
    ("\"differential\"", "\"soft\"", "characteristic | differential | rigid"),
    ("petals = true", "petals = \"yes\"", "true | false"),
    ("\"hunt_crossley\"", "\"hertz\"", "hunt_crossley | kelvin_voigt"),
    ("\"hunt_crossley\"", "\"kelvin_voigt\"", "is needed by this normal law"),
    ("damping_s_m = 0.5", "damping_n_s_m = 5.0", "belongs to the other normal law"),
    ("exponent = 1.5", "exponent = 0.5", "≥ 1 and ≤ 3"),
    ("friction_static = 0.3", "friction_static = 0.1", "is below the kinetic coefficient"),
    ("friction_static = 0.3", "friction = 0.1", "did you mean `friction_"),
    ("axial_speed_m_s = 0.1", "axial_speed_m_s = 0", "> 0 and ≤ 2 m/s"),
    ("axial_speed_m_s = 0.1", "", "initial.axial_speed_m_s: is missing"),
    ("turning = \"chaser\"", "turning = \"ring\"", "target | chaser | both"),
    ("axial_speed_m_s = 0.1", "axial_speed_m_s = nan", "not a finite number"),
    ("lateral_y_m = 0.01", "lateral_y_mm = 10", "did you mean `lateral_y_m`?"),
    ("lateral_z_m = 0.02", "lateral_z_m = \"0.02\"", "is a string"),
    ("pitch_deg = 2.0", "pitch_deg = 90.0", "≥ -45 and ≤ 45"),
    ("yaw_rate_deg_s = 0.3", "yaw_rate_deg_s = 300", "out of range"),
    ("gap_m = 0.1", "gap_m = -0.1", "> 0 and ≤ 10"),
    ("duration_s = 20.0\ntick_s", "tick_s", "run.duration_s: is missing"),
    ("tick_s = 0.002", "tick_s = 0.0000123456789", "whole number of nanoseconds"),
    ("tick_s = 0.002", "tick_s = 1.0", "≥ 0.00001 and ≤ 0.002"),
    ("duration_s = 20.0\ntick_s", "duration_s = 0.001\ntick_s", "longer than the run"),
    ("steps_per_tick = 7", "steps_per_tick = 0", "whole number from 1 to 10000"),
    ("steps_per_tick = 7", "steps_per_tick = 2.5", "whole number from 1 to 10000"),
    ("[[thrust]]", "[thrust]", "array of tables"),
    ("on = \"chaser\"", "on = \"ring\"", "chaser | target"),
    ("after = \"first_contact\"", "", "start | first_contact | capture"),
    ("after = \"first_contact\"", "after = \"capture\"", "begins after capture"),
    ("duration_s = 3.0", "duration_s = -3.0", "thrust.0.duration_s = -3.0 s"),
    ("force_x_n = 1.0", "force_x = 1.0", "did you mean `force_x_n`?"),
    ("outcome = \"captured\"", "outcome = \"docked\"", "captured | rebounded | missed"),
    ("outcome = \"captured\"", "outcome = \"missed\"", "the outcome excludes"),
    (
        "because = \"8.6 J of closing energy against less than 1 J in the soft channels.\"",
        "",
        "why physics gives this outcome",
    ),
    ("capture_before_s = 9.0", "capture_before_s = 0.1", "leaves nothing"),
    ("peak_force_tolerance = 0.1", "", "has no `peak_force_tolerance`"),
    ("impulse_ns = 1000.0", "", "has no `impulse_ns`"),
    ("[expect]", "[expect", "valid TOML"),
    ("[expect]", "[expected]", "expect.outcome: is missing"),
    ("of = \"hardware\"", "of = \"sensed\"", "felt | hardware"),
    ("window = \"to_capture\"", "", "expect.fidelity.0.window: is missing"),
    ("nrms_force_below = 0.06", "nrms_force_belw = 0.06", "did you mean `nrms_force_below`?"),
    ("nrms_force_below = 0.06", "nrms_force_below = 0", "> 0 and ≤ 100"),
    ("peak_force_ratio_above = 0.98", "peak_force_ratio_above = 1.1", "leaves nothing"),
    (
        "outcome = \"captured\"",
        "outcome = \"jammed\"",
        "window = \"to_capture\": ends after a capture",
    ),
    (
        "hil_outcome = \"stopped\"",
        "hil_outcome = \"rebounded\"",
        "expect.hil.capture_after_s = 0.2 s: bounds a capture",
    ),
    (
        "[[expect.fidelity]]",
        "[[expect.fidelity]]\nof = \"hardware\"\nwindow = \"to_capture\"\nnrms_force_below = 1.0\n\n[[expect.fidelity]]",
        "a second time",
    ),
    (
        "[[expect.fidelity]]",
        "[[expect.fidelity]]\nof = \"felt\"\nwindow = \"whole_run\"\n\n[[expect.fidelity]]",
        "bounds nothing",
    ),
    ("gap_m = 0.1", "gap_m = 0.1\ngap_m = 0.2", "valid TOML"),
];

#[test]
fn regress_bad_scenarios_are_refused_with_a_reason() {
    assert!(problems_of("schema = 1", "schema = 1").is_empty(), "the whole scenario is right");
    let mut wrong = Vec::new();
    for (from, to, says) in BAD {
        let problems = problems_of(from, to);
        let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
        if !text.iter().any(|t| t.contains(says)) {
            let got = text.join("\n");
            wrong.push(format!("{from:?} → {to:?} should say {says:?}, says\n{got}\n"));
        }
        for p in &problems {
            assert!(!p.remedy.is_empty() && !p.what.is_empty() && !p.key.is_empty(), "{p}");
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Problems found only with the models at hand have their line too.
    for (from, to) in [
        ("friction_static = 0.3", "friction_static = 0.1"),
        ("chaser_8t.urdf", "chaser_9t.urdf"),
        ("target_12t.urdf", "chaser_8t.urdf"),
    ] {
        let problems = problems_of(from, to);
        assert!(problems.len() == 1 && problems[0].line > Some(1), "{problems:?}");
    }
    let gone = load_scenario(Path::new("gone.toml"), &[]).expect_err("no such file");
    assert!(gone.to_string().contains("does not exist"));
}

/// Names of compensators stand in three places: keys, words and the help of the command line.
#[test]
fn invariant_compensators_have_one_list_of_names() {
    let words = crate::CompensatorChoice::WORDS.map(|(w, _)| w);
    assert_eq!(words.join("|"), crate::CompensatorChoice::NAMES);
    let key = crate::keys::find("loop.compensator").expect("the key");
    let crate::keys::Shape::Words(listed, _) = key.shape else { panic!("{:?}", key.shape) };
    assert_eq!(words.as_slice(), listed);
}
