//! The report of a run, of a cut one and of what is no run: through the command line.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use docktwin_record::{RunReader, TickRecord};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Below the repository, so that the models named by a run are found.
fn fresh(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if dir.exists() {
        fs::remove_dir_all(&dir).expect("an old run can be removed");
    }
    dir
}

fn docktwin(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .current_dir(root())
        .args(args)
        .output()
        .expect("docktwin can be called")
}

fn rehearse(scenario: &str, out: &Path, seconds: &str) {
    let done = docktwin(&[
        "rehearse",
        &format!("scenarios/{scenario}.toml"),
        "--twin",
        "reduced",
        "--no-rrd",
        "--set",
        &format!("run.duration_s={seconds}"),
        "--out",
        &out.display().to_string(),
    ]);
    // Cut short, a run may end otherwise than its scenario expects.
    let code = done.status.code().expect("it ended by itself");
    assert!(code <= 1, "{}", String::from_utf8_lossy(&done.stderr));
}

fn report(run: &Path) -> (serde_json::Value, String) {
    let done = docktwin(&["report", &run.display().to_string(), "--json"]);
    // 1: a page of what is not what was recorded.
    let code = done.status.code();
    assert!(matches!(code, Some(0 | 1)), "{}", String::from_utf8_lossy(&done.stderr));
    let said: serde_json::Value = serde_json::from_slice(&done.stdout).expect("one JSON object");
    let path = said["path"].as_str().expect("a path");
    let page = fs::read_to_string(path).expect("the page is there");
    assert_eq!(said["bytes"].as_u64(), Some(page.len() as u64));
    assert_eq!(said["as_recorded"].as_bool(), Some(code == Some(0)));
    (said, page)
}

/// Every SVG of the page, parsed.
fn check_page(page: &str) -> usize {
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    for outside in ["http:", "https:", "url(", "@import", "<script", " src=", "NaN", ">inf"] {
        assert!(!page.contains(outside), "`{outside}` stands in the page");
    }
    let mut count = 0;
    let mut rest = page;
    while let Some(at) = rest.find("<svg") {
        let end = rest[at..].find("</svg>").expect("it is closed") + at + "</svg>".len();
        let svg = roxmltree::Document::parse(&rest[at..end]).expect("well-formed");
        assert!(svg.root_element().attribute("viewBox").is_some());
        count += 1;
        rest = &rest[end..];
    }
    for section in ["Summary", "Key moments", "Plots", "Contacts in words", "Terms and frames"] {
        assert!(page.contains(&format!("<h2>{section}</h2>")), "no section {section}");
    }
    count
}

/// Largest normal force of a pair in one tick: force, time.
fn largest(run: &Path) -> (f64, f64) {
    let mut reader = RunReader::open(run).expect("a log");
    let pairs = reader.pair_names().len();
    let mut best = (0.0, 0.0);
    for tick in reader.ticks() {
        let TickRecord { time, contacts, .. } = tick.expect("a tick");
        for pair in 0..pairs {
            let of_pair = contacts.iter().filter(|c| usize::from(c.pair) == pair);
            let force: f64 = of_pair.map(|c| c.normal_force_n).sum();
            if force > best.0 {
                best = (force, time.seconds());
            }
        }
    }
    best
}

#[test]
fn oracle_report_of_a_docking_says_what_the_record_holds() {
    let run = fresh("report_nominal");
    rehearse("apas_nominal", &run, "1.6");
    let (said, page) = report(&run);
    assert!(said["incomplete"].is_null());
    let svgs = check_page(&page);
    assert!(svgs > 30, "{svgs} pictures and plots");
    assert!(page.contains("The latches hold") && page.contains("First contact · "));
    let (force, time) = largest(&run);
    assert!((100.0..900.0).contains(&force), "{force} N: written with no decimals");
    let peak = format!("peak <strong>{force:.0} N</strong> at {time:.3} s");
    assert!(page.contains(&peak), "the chronicle has `{peak}`");
    assert!(page.contains("between petals A") && page.contains("sliding "));
    assert!(page.contains("docktwin replay "));
}

#[test]
fn invariant_report_of_what_is_left_of_a_killed_run() {
    let run = fresh("report_cut");
    rehearse("apas_nominal", &run, "1.6");
    for gone in ["summary.json", "telemetry.parquet"] {
        fs::remove_file(run.join(gone)).expect("it was there");
    }
    let log = run.join("run.mcap");
    let whole = fs::read(&log).expect("a log");
    // Through the middle of a chunk, then all but the columns, then not even these.
    for (share, ticks) in [(0.7, true), (0.02, false)] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a share of a size"
        )]
        let keep = (whole.len() as f64 * share) as usize;
        fs::write(&log, &whole[..keep]).expect("it can be cut");
        let (said, page) = report(&run);
        check_page(&page);
        assert!(said["incomplete"].is_string());
        assert!(page.contains("This run is incomplete.") && page.contains("no verdict"));
        if ticks {
            let mut reader = RunReader::open(&run).expect("a log");
            let last = reader.ticks().last().expect("ticks").expect("a tick");
            let until = format!("up to {:.3} s", last.time.seconds());
            assert!(page.contains(&until), "it says `{until}`");
        }
    }
    fs::write(&log, b"no log").expect("it can be written");
    let (_, page) = report(&run);
    assert!(page.contains("The log cannot be read") && page.contains("No pictures"));
}

#[test]
fn invariant_report_without_models_says_so_and_goes_on() {
    let run = fresh("report_no_models");
    rehearse("basic_guide_ring", &run, "0.9");
    let scenario = run.join("scenario.toml");
    let text = fs::read_to_string(&scenario).expect("a scenario");
    fs::write(&scenario, text.replace("models/", "gone/")).expect("it can be written");
    let (_, page) = report(&run);
    check_page(&page);
    assert!(page.contains("No pictures: scenario.toml and its models cannot be loaded"));
    assert!(page.contains("petal A1 meets ring P") && page.contains("its limits are not known"));
}

#[test]
fn invariant_report_of_flight_without_contact() {
    let run = fresh("report_free");
    rehearse("free_flight", &run, "2.0");
    let (_, page) = report(&run);
    check_page(&page);
    assert!(page.contains("Nothing touched.") && page.contains("Closest approach"));
}

#[test]
fn invariant_what_is_no_run_is_bad_input() {
    let run = fresh("report_nothing");
    fs::create_dir_all(&run).expect("a directory");
    let done = docktwin(&["report", &run.display().to_string()]);
    assert_eq!(done.status.code(), Some(2));
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(said.contains("no run to report on"), "{said}");
    assert!(!run.join("report.html").exists());
}

/// A page of a run against a rig says how the loop did, and promises a replay only where one is possible.
#[test]
fn invariant_report_of_a_loop_tells_of_its_rig() {
    for (clock, repeats) in [("virtual", true), ("realtime", false)] {
        let out = fresh(&format!("loop_{clock}"));
        let path = out.to_str().expect("plain");
        let run = docktwin(&[
            "hil",
            "scenarios/vibro_impact.toml",
            "--rig",
            "emulated",
            "--clock",
            clock,
            "--allow-best-effort",
            "--set",
            "run.duration_s=1",
            "--out",
            path,
        ]);
        assert!(out.join("summary.json").exists(), "{}", String::from_utf8_lossy(&run.stderr));
        let (_, page) = report(&out);
        for word in ["The loop and its rig", "a lead of", "least margin", "left out"] {
            assert!(page.contains(word), "{clock}: no {word}");
        }
        assert!(!page.contains("lost in the attenuator"));
        // The ports measured are off those of the programme by what the rig lags: no sign of other models.
        assert!(!page.contains("are not those of the run") && !page.contains("cannot be read"));
        assert_eq!(page.contains("docktwin replay"), repeats, "{clock}");
    }
}
