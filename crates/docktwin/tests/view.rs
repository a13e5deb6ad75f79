//! `docktwin view`: the same picture live and from the log, refusals, and a viewer that keeps quiet.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn docktwin(words: &[&str]) -> Output {
    let mut c = Command::new(env!("CARGO_BIN_EXE_docktwin"));
    c.current_dir(root()).args(words).env("NO_COLOR", "1").env_remove("DOCKTWIN_VIEWER");
    c.output().expect("docktwin starts")
}

fn said(o: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr))
}

fn rehearse(scenario: &str, seconds: &str, dir: &Path) {
    let (file, set) = (format!("scenarios/{scenario}.toml"), format!("run.duration_s={seconds}"));
    let out = dir.display().to_string();
    let o = docktwin(&["rehearse", &file, "--set", &set, "--out", &out]);
    // A run that is cut short is not captured: exit code 1 is fine.
    assert!(matches!(o.status.code(), Some(0 | 1)), "{}", said(&o));
}

/// What a recording holds, entity by entity: times and values, without ids and chunk borders.
fn content(path: &Path) -> std::collections::BTreeMap<String, Vec<String>> {
    let mut content = docktwin_view::content(path).expect("readable");
    // Name and date of the recording, kept by rerun.
    content.remove("/__properties");
    content
}

#[test]
fn invariant_a_recording_shows_the_same_afterwards_as_live() {
    let at = tempfile::tempdir().expect("a folder");
    let run = at.path().join("run");
    rehearse("apas_fast", "1.2", &run);
    let again = at.path().join("again.rrd");
    let (run_s, again_s) = (run.display().to_string(), again.display().to_string());
    let o = docktwin(&["view", &run_s, "--save", &again_s]);
    assert!(o.status.success(), "{}", said(&o));
    let (live, later) = (content(&run.join("run.rrd")), content(&again));
    assert!(live.len() > 40, "{:?}", live.keys());
    assert_eq!(live.keys().collect::<Vec<_>>(), later.keys().collect::<Vec<_>>());
    // The properties hold the time of day at which a file was made.
    for (entity, rows) in live.iter().filter(|(e, _)| !e.starts_with("/__properties")) {
        assert!(*rows == later[entity], "{entity} differs: {} rows", rows.len());
    }

    // A negative control: another time shows other content.
    let early = at.path().join("early.rrd");
    let early_s = early.display().to_string();
    assert!(docktwin(&["view", &run_s, "--at", "0.15", "--save", &early_s]).status.success());
    let early = content(&early);
    let last = |c: &std::collections::BTreeMap<String, Vec<String>>| {
        c["/scene/active_ring"].last().cloned().unwrap_or_default()
    };
    assert!(last(&early).starts_with("150000000 "), "{}", last(&early));
    assert!(!last(&later).starts_with("150000000 "));
}

/// rerun's file writer keeps to itself that the end of its file did not fit on the disk.
#[cfg(target_os = "linux")]
#[test]
fn invariant_a_recording_without_its_end_is_an_error() {
    let at = tempfile::tempdir().expect("a folder");
    let run = at.path().join("run");
    rehearse("apas_fast", "1.2", &run);
    let whole = std::fs::metadata(run.join("run.rrd")).expect("recorded").len();
    let save = |kib: u64| {
        // Counts in KiB in bash; without the trap a signal would end the process.
        let script = format!(
            "trap '' XFSZ; ulimit -f {kib}; exec '{}' view '{}' --save '{}'",
            env!("CARGO_BIN_EXE_docktwin"),
            run.display(),
            at.path().join("again.rrd").display()
        );
        Command::new("bash").args(["-c", &script]).output().expect("bash starts")
    };
    // The table of contents at the end takes more than that.
    let cut = save((whole - 4096) / 1024);
    assert_eq!(cut.status.code(), Some(2), "{}", said(&cut));
    assert!(said(&cut).contains("its end is missing; free some space"), "{}", said(&cut));
    let enough = save(2 * whole / 1024);
    assert!(enough.status.success(), "{}", said(&enough));
}

#[test]
fn invariant_two_runs_share_a_picture_only_with_one_mechanism() {
    let at = tempfile::tempdir().expect("a folder");
    let [a, b, c] = ["a", "b", "c"].map(|n| at.path().join(n));
    rehearse("apas_fast", "0.3", &a);
    rehearse("apas_corner_a", "0.3", &b);
    rehearse("basic_central_impact", "0.3", &c);
    let file = at.path().join("both.rrd");
    let save = file.display().to_string();
    let compare = |x: &Path, y: &Path, more: &[&str]| {
        let (x, y) = (x.display().to_string(), y.display().to_string());
        let mut words = vec!["view", "--compare", &x, &y, "--save", &save];
        words.extend(more);
        docktwin(&words)
    };
    let o = compare(&a, &b, &[]);
    assert!(o.status.success(), "{}", said(&o));
    let both = content(&file);
    for entity in ["/scene/active_ring", "/scene/ghost/active_ring", "/energy/ghost"] {
        assert!(both.contains_key(entity), "{entity}");
    }
    let o = compare(&a, &c, &[]);
    let text = said(&o);
    assert_eq!(o.status.code(), Some(2), "{text}");
    for word in ["different mechanisms", "active petals: 3", "docktwin diff"] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
}

#[test]
fn invariant_without_a_viewer_the_error_names_the_command_that_installs_it() {
    let at = tempfile::tempdir().expect("a folder");
    let mut c = Command::new(env!("CARGO_BIN_EXE_docktwin"));
    c.env("PATH", "").env_remove("DOCKTWIN_VIEWER").env("NO_COLOR", "1");
    let o = c.arg("view").arg(at.path()).output().expect("docktwin starts");
    let text = said(&o);
    assert_eq!(o.status.code(), Some(2), "{text}");
    let install = format!("pip install rerun-sdk=={}", docktwin_view::VIEWER_VERSION);
    assert!(text.contains(&install), "{text}");
}

/// A viewer that writes down how it was called.
#[cfg(unix)]
fn fake_viewer(dir: &Path, version: &str, obeys: bool) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let path = dir.join("fake-rerun");
    let config = if obeys {
        r#"cat "$XDG_CONFIG_HOME/rerun/analytics.json""#
    } else {
        r#"echo '{"analytics_enabled": true}'"#
    };
    let script = format!(
        "#!/bin/sh\ncase \"$1\" in\n--version) echo 'rerun-cli {version} (all)';;\n\
         analytics) {config};;\n*) cp \"$1\" \"{0}/shown.rrd\"; \
         echo \"$2 $3 $4\" > \"{0}/options\"; \
         cat \"$XDG_CONFIG_HOME/rerun/analytics.json\" > \"{0}/config\";;\nesac\n",
        dir.display()
    );
    std::fs::write(&path, script).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("allowed");
    path
}

#[cfg(unix)]
#[test]
fn invariant_the_viewer_is_opened_with_statistics_off_or_not_at_all() {
    let at = tempfile::tempdir().expect("a folder");
    let run = at.path().join("run");
    rehearse("apas_fast", "0.2", &run);
    std::fs::remove_file(run.join("run.rrd")).expect("it was there");
    let run = run.display().to_string();
    let ours = docktwin_view::VIEWER_VERSION;

    let viewer = fake_viewer(at.path(), ours, true).display().to_string();
    let o = docktwin(&["view", &run, "--viewer", &viewer]);
    assert!(o.status.success(), "{}", said(&o));
    // Made again from the log.
    assert!(content(&at.path().join("shown.rrd")).contains_key("/scene/active_ring"));
    let config = std::fs::read_to_string(at.path().join("config")).expect("seen");
    let config: serde_json::Value = serde_json::from_str(&config).expect("JSON");
    assert_eq!(config["analytics_enabled"], false, "{config}");
    let options = std::fs::read_to_string(at.path().join("options")).expect("seen");
    assert_eq!(options.trim(), "--new --bind 127.0.0.1");

    for (version, obeys, words) in
        [(ours, false, "analytics disable"), ("0.1.2", true, "version 0.1.2")]
    {
        std::fs::remove_file(at.path().join("config")).ok();
        let viewer = fake_viewer(at.path(), version, obeys).display().to_string();
        let o = docktwin(&["view", &run, "--viewer", &viewer]);
        assert_eq!(o.status.code(), Some(2), "{}", said(&o));
        assert!(said(&o).contains(words), "{}", said(&o));
        assert!(!at.path().join("config").exists(), "it was opened");
    }
}
