//! Files that are wrong, broken or meant to break: the binary says what to mend, ends with exit
//! code 2, and stays within 1 GiB of address space and a minute.
//!
//! Every case runs twice, as text and as JSON. A command that reads recordings is added in
//! `READERS`, a damaged recording in `recordings`.

use std::{
    cell::RefCell,
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;

/// Address space of a case, KiB. A rehearsal runs within it too.
const LIMIT_KIB: u32 = 1 << 20;
/// After this a case is taken to hang. No case needs a tenth of it.
const HANG: Duration = Duration::from_secs(120);

/// What a command said.
struct Said {
    code: Option<i32>,
    out: String,
    err: String,
}

/// Runs the binary within bounds and checks what holds for every input, good or bad.
fn docktwin(case: &str, words: &[&str], at: &Path) -> Said {
    let (out, err) = (at.join(".out"), at.join(".err"));
    let file = |p: &Path| Stdio::from(fs::File::create(p).expect("a file"));
    let binary = env!("CARGO_BIN_EXE_docktwin");
    let mut command = if cfg!(target_os = "linux") {
        let mut c = Command::new("sh");
        c.args(["-c", &format!("ulimit -v {LIMIT_KIB} && exec \"$0\" \"$@\""), binary]);
        c
    } else {
        Command::new(binary)
    };
    command.args(words).current_dir(at).env("NO_COLOR", "1").env("COLUMNS", "100");
    let mut child = command
        .stdin(Stdio::null())
        .stdout(file(&out))
        .stderr(file(&err))
        .spawn()
        .expect("docktwin starts");
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("a status") {
            break status;
        }
        if begin.elapsed() > HANG {
            child.kill().expect("it can be ended");
            child.wait().expect("it ends");
            panic!("{case}: `docktwin {}` hangs", words.join(" "));
        }
        std::thread::sleep(Duration::from_millis(3));
    };
    let text = |p: &Path| String::from_utf8(fs::read(p).expect("output")).expect("UTF-8");
    let said = Said { code: status.code(), out: text(&out), err: text(&err) };
    let all = format!("{}{}", said.out, said.err);
    assert!(said.code.is_some(), "{case}: ended by a signal, {status}: {}", head(&all));
    assert!(said.code != Some(70), "{case}: a defect: {}", head(&all));
    assert!(!said.err.contains("panicked"), "{case}: {}", head(&said.err));
    let command = all.chars().find(|c| c.is_control() && *c != '\n');
    assert!(command.is_none(), "{case}: {command:?} would reach the terminal");
    assert!(all.len() < 100_000, "{case}: {} bytes of output", all.len());
    said
}

fn head(text: &str) -> String {
    text.chars().take(4000).collect()
}

thread_local! {
    /// Cases that failed in this test; the others are still tried.
    static FAILED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Ends a test: no case may have failed. Each has told why.
fn settle() {
    let failed = FAILED.take();
    assert!(failed.is_empty(), "{} cases failed: {failed:#?}", failed.len());
}

/// Tries one case and goes on.
fn attempt(case: &str, check: impl FnOnce()) {
    if catch_unwind(AssertUnwindSafe(check)).is_err() {
        FAILED.with_borrow_mut(|f| f.push(case.to_owned()));
    }
}

/// The case is refused with exit code 2 and says all of `says`, as text and as JSON.
fn refused(case: &str, words: &[&str], at: &Path, says: &[&str]) {
    attempt(case, || must_be_refused(case, words, at, says));
}

fn must_be_refused(case: &str, words: &[&str], at: &Path, says: &[&str]) {
    let said = docktwin(case, words, at);
    let all = format!("{}{}", said.out, said.err);
    assert_eq!(said.code, Some(2), "{case}: {}", head(&all));
    for s in says {
        assert!(all.contains(s), "{case}: {s:?} is not in\n{}", head(&all));
    }
    let json = [words, &["--json"]].concat();
    let said = docktwin(case, &json, at);
    assert_eq!(said.code, Some(2), "{case}: {}", said.err);
    let value: Value = serde_json::from_str(&said.out)
        .unwrap_or_else(|e| panic!("{case}: {e}: {}{}", said.out, said.err));
    assert_eq!(value["exit_code"], 2, "{case}: {value}");
    let problems = value["problems"].as_array().expect("problems");
    assert!(!problems.is_empty(), "{case}: {value}");
    for p in problems {
        for field in ["what", "key"] {
            assert!(p[field].as_str().is_some_and(|s| !s.is_empty()), "{case}: {p}");
        }
        let remedy = p["remedy"].as_str().unwrap_or_default();
        let what = p["what"].as_str().unwrap_or_default();
        // A recording's failure has its remedy within the sentence.
        assert!(!remedy.is_empty() || what.contains(';'), "{case}: no remedy in {p}");
    }
}

fn root() -> PathBuf {
    fs::canonicalize(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")).expect("the repository")
}

/// A folder with the models and a good scenario in it.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let copy = |from: &str| {
        fs::create_dir_all(dir.path().join(from)).expect("a folder");
        for f in fs::read_dir(root().join(from)).expect("files") {
            let f = f.expect("a file");
            fs::copy(f.path(), dir.path().join(from).join(f.file_name())).expect("copied");
        }
    };
    copy("models/urdf");
    copy("meshes");
    fs::copy(root().join("scenarios/apas_fast.toml"), dir.path().join("good.toml"))
        .expect("copied");
    fs::copy(root().join("scenarios/thrust_assist.toml"), dir.path().join("thrust.toml"))
        .expect("copied");
    dir
}

/// `text` with `from` replaced, which must be there.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "no {from:?}: mend the case");
    text.replacen(from, to, 1)
}

// Scenarios ------------------------------------------------------------------------------------

#[test]
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn regress_hostile_scenarios() {
    let dir = folder();
    let at = dir.path();
    let good = fs::read_to_string(at.join("good.toml")).expect("a scenario");
    let edit = |from: &str, to: &str| changed(&good, from, to);
    let run = |extra: &str| edit("duration_s = 40.0", extra);
    let n = 100_000;
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("empty", vec![], &["scenario: is empty", "[bad.toml]"]),
        ("blank lines only", b"\n\n  \n".to_vec(), &["is empty"]),
        ("binary", (0..=255).cycle().take(5000).collect(), &["byte 0 is 0", "UTF-8", "[bad.toml:1]"]),
        ("latin-1", edit("The 0.35", "\u{1}").replace('\u{1}', "M\u{2}").into_bytes().into_iter()
            .map(|b| if b == 2 { 0xfc } else { b }).collect(), &["is not UTF-8 text", "0xfc", "[bad.toml:3]", "save the file as UTF-8"]),
        ("UTF-16", good.encode_utf16().flat_map(u16::to_le_bytes).collect(), &["UTF-16", "[bad.toml:1]"]),
        ("cut in a string", good.as_bytes()[..good.find("\"captured\"").expect("an outcome") + 4].to_vec(), &["syntax:", "[bad.toml:2"]),
        ("printable rubbish", b"!!! ??? <<<>>>\n".repeat(20_000), &["101 problems", "more problems are not listed", "mend those above first"]),
        ("control characters", (1..32u8).cycle().take(3000).collect(), &["syntax:", "[bad.toml:"]),
        ("an XML file", b"<robot name=\"r\"/>".to_vec(), &["syntax:", "[bad.toml:1]"]),
        ("2 MB", vec![b'#'; 2_000_000], &["larger than any file of this kind", "at most 1048576 bytes"]),
        ("unknown keys at three places", edit("roll_deg", "rol_deg").replace("[run]", "[run]\nseconds = 3").replace("schema", "colour = \"red\"\nschema").into_bytes(),
            &["3 problems", "initial.rol_deg = 15.0", "did you mean `roll_deg`?", "[bad.toml:19]", "run.seconds = 3", "[bad.toml:23]", "colour = \"red\"", "[bad.toml:1]"]),
        ("wrong unit", edit("lateral_y_m", "lateral_y_mm").into_bytes(), &["initial.lateral_y_mm = 0.05", "is not a known key", "did you mean `lateral_y_m`?", "[bad.toml:17]"]),
        ("wrong types", edit("0.35\n", "\"fast\"\n").replace("40.0", "true").replace("\"apas_fast\"", "[1, 2]").into_bytes(),
            &["3 problems", "name = [1, 2]: is an array", "initial.axial_speed_m_s = \"fast\" m/s: is a string", "run.duration_s = true s: is a boolean", "allowed: number, > 0 and ≤ 100000"]),
        ("several values out of range", edit("0.35\n", "-0.35\n").replace("roll_deg = 15.0", "roll_deg = 500").replace("yaw_deg = 7.0", "yaw_deg = nan").replace("40.0", "inf").into_bytes(),
            &["4 problems", "initial.axial_speed_m_s = -0.35 m/s: is out of range; allowed: > 0 and ≤ 2 m/s", "initial.roll_deg = 500 deg: is out of range; allowed: ≥ -180 and ≤ 180 deg", "initial.yaw_deg = nan deg: is not a finite number", "run.duration_s = inf s: is not a finite number", "[bad.toml:18]"]),
        ("a number that overflows", edit("0.35\n", "1e999\n").into_bytes(), &["initial.axial_speed_m_s", "1e999"]),
        ("a tiny speed", edit("0.35\n", "1e-300\n").into_bytes(), &["over the gap of 0.05 m to first contact, at most 1000 s", "initial.gap_m smaller"]),
        ("an integer beyond 64 bits", edit("0.35\n", "123456789012345678901234567890\n").into_bytes(), &["initial.axial_speed_m_s"]),
        ("hexadecimal", edit("0.35\n", "0x10\n").into_bytes(), &["initial.axial_speed_m_s"]),
        ("1e10 ticks", run("duration_s = 1e5\ntick_s = 1e-5").into_bytes(), &["run.duration_s = 1e5 s: gives 1.0e10 ticks", "at most 1e8", "make run.tick_s longer"]),
        ("ticks of 1e18 s", run("duration_s = 40\ntick_s = 1e18").into_bytes(), &["run.tick_s = 1e18 s: is out of range; allowed: ≥ 0.00001 and ≤ 0.002 s"]),
        ("1e12 steps", run("duration_s = 1000\ntick_s = 1e-5\nsteps_per_tick = 10000").into_bytes(), &["run.steps_per_tick = 10000", "1.0e12 steps"]),
        ("steps beyond 32 bits", run("duration_s = 1\nsteps_per_tick = 4000000000000").into_bytes(), &["allowed: whole number from 1 to 10000"]),
        ("a duration of 1e300 s", run("duration_s = 1e300").into_bytes(), &["run.duration_s = 1e300 s: is out of range"]),
        ("a duration of 1e-300 s", run("duration_s = 1e-300").into_bytes(), &["is longer than the run"]),
        ("a tick with parts of a nanosecond", run("duration_s = 1\ntick_s = 0.00033333333333").into_bytes(), &["is not a whole number of nanoseconds"]),
        ("duplicate key", edit("roll_deg", "yaw_deg").into_bytes(), &["syntax: duplicate key", "[bad.toml:19]"]),
        ("duplicate table", format!("{good}\n[run]\nduration_s = 1.0\n").into_bytes(), &["syntax: duplicate key"]),
        ("no table at all", b"schema = 1\n".to_vec(), &["chaser: this table is missing; add [chaser]", "expect: this table is missing", "name: is missing"]),
        ("another schema", edit("schema = 1", "schema = 99").into_bytes(), &["schema = 99", "allowed: whole number from 1 to 1", "[bad.toml:1]"]),
        ("unknown words", edit("\"captured\"", "\"docked\"").replace("[initial]", "attenuation = \"springy\"\n[initial]").into_bytes(),
            &["2 problems", "expect.outcome = \"docked\": is not a known word; allowed: captured | rebounded", "mechanism.attenuation = \"springy\""]),
        ("impossible together", format!("{}\n[[thrust]]\non = \"chaser\"\nafter = \"capture\"\nduration_s = 1\nuntil_capture = true\n", edit("[expect]", "[expect]\ncapture_after_s = 5.0")).into_bytes(),
            &["leaves nothing: the lower bound is 5", "neither force nor moment is given", "it begins after capture"]),
        ("capture bounded of a miss", edit("\"captured\"", "\"missed\"").into_bytes(), &["bounds a capture that the outcome excludes"]),
        ("laws mixed", edit("[initial]", "[mechanism.contact]\nnormal_law = \"kelvin_voigt\"\nexponent = 1.5\nfriction_kinetic = 1.0\n[initial]").into_bytes(),
            &["3 problems", "mechanism.contact.damping_n_s_m: is needed by this normal law", "mechanism.contact.exponent = 1.5: belongs to the other normal law", "is below the kinetic coefficient"]),
        ("models that are not there", edit("chaser_8t", "no_such").replace("apas_passive", "gone").into_bytes(),
            &["2 problems", "chaser.model = \"models/urdf/no_such.urdf\": is found neither", "mechanism.passive", "[bad.toml:6]", "mend the path"]),
        ("a path that climbs out", edit("models/urdf/chaser_8t.urdf", "../../../../../../../../etc/passwd").into_bytes(), &["xml: ", "/etc/passwd:1]"]),
        ("a device as model", edit("models/urdf/chaser_8t.urdf", "/dev/zero").into_bytes(), &["chaser.model = \"/dev/zero\"", "is found neither"]),
        ("a directory as model", edit("models/urdf/chaser_8t.urdf", "models").into_bytes(), &["chaser.model = \"models\""]),
        ("an endless path", edit("models/urdf/chaser_8t.urdf", &"../".repeat(50_000)).into_bytes(), &["chaser.model"]),
        ("itself as model", edit("models/urdf/chaser_8t.urdf", "bad.toml").into_bytes(), &["xml:"]),
        ("sides swapped", edit("chaser_8t", "target_12t").into_bytes(), &["port on the wrong side", "[bad.toml:6]"]),
        ("active twice", edit("apas_passive", "apas_active").into_bytes(), &["kind"]),
        ("a name that climbs out", edit("\"apas_fast\"", "\"../../etc/passwd\"").into_bytes(), &["is no name for a run directory", "[bad.toml:2]"]),
        ("terminal commands in a name", edit("\"apas_fast\"", "\"\\u001b]0;owned\\u0007\\u001b[31m\"").into_bytes(), &["\\u{1b}]0;owned\\u{7}", "cannot be printed"]),
        ("terminal commands in a key", edit("roll_deg", "\"\\u001b[2J\\u009b31m\"").into_bytes(), &["initial.\\u{1b}[2J\\u{9b}31m"]),
        ("text turned around", edit("The 0.35", "\\u202eeht").into_bytes(), &["description", "\\u{202e}"]),
        ("a name of 900 000 letters", edit("\"apas_fast\"", &format!("\"{}\"", "x".repeat(900_000))).into_bytes(), &["is no name for a run directory", "…"]),
        ("a key of 900 000 letters", edit("roll_deg", &"x".repeat(900_000)).into_bytes(), &["initial.xxxx", "is not a known key"]),
        ("a line of 900 000 numbers", edit("roll_deg = 15.0", &format!("roll_deg = [{}]", "1,".repeat(450_000))).into_bytes(), &["initial.roll_deg", "is an array", "…"]),
        ("100 000 keys", format!("{good}{}", (0..n).map(|i| format!("k{i}=1\n")).collect::<String>()).into_bytes(), &["101 problems"]),
        ("90 000 tables", format!("{good}{}", (0..90_000).map(|i| format!("[t{i}]\n")).collect::<String>()).into_bytes(), &["101 problems"]),
        ("90 000 thrusts", format!("{good}{}", "[[thrust]]\n".repeat(90_000)).into_bytes(), &["thrust.0", "more problems are not listed"]),
        ("lists 100 000 deep", format!("a = {}{}", "[".repeat(n), "]".repeat(n)).into_bytes(), &["deeper than 80", "[bad.toml:1]"]),
        ("open lists 100 000 deep", format!("a = {}", "[".repeat(n)).into_bytes(), &["deeper than 80"]),
        ("inline tables 100 000 deep", format!("a = {}1{}", "{a=".repeat(n), "}".repeat(n)).into_bytes(), &["deeper than 80"]),
        ("a dotted key 100 000 deep", format!("x = 1\n{}a = 1", "a.".repeat(n)).into_bytes(), &["deeper than 80", "[bad.toml:2]"]),
        ("a table 100 000 deep", format!("[{}a]", "a.".repeat(n)).into_bytes(), &["deeper than 80"]),
        ("a model given as scenario", fs::read(at.join("models/urdf/apas_active.toml")).expect("a model"), &["kind = \"mechanism_active\": is not a known key"]),
    ];
    assert!(cases.len() >= 55, "{}", cases.len());
    for (case, bytes, says) in &cases {
        fs::write(at.join("bad.toml"), bytes).expect("written");
        refused(case, &["scenario", "check", "bad.toml"], at, says);
    }
    // A byte order mark is no fault: editors of one system write it.
    fs::write(at.join("bom.toml"), format!("\u{feff}{good}")).expect("written");
    let said = docktwin("byte order mark", &["scenario", "check", "bom.toml"], at);
    assert_eq!(said.code, Some(0), "{}", said.err);
    settle();
}

#[test]
fn regress_hostile_words_and_places() {
    let dir = folder();
    let at = dir.path();
    let deep = format!("{}a=1", "a.".repeat(20_000));
    let long = format!("run.duration_s={}", "9".repeat(100_000));
    let nested = format!("run.duration_s={}", "[".repeat(50_000));
    fs::create_dir(at.join("folder")).expect("a folder");
    fs::write(at.join("file"), "x").expect("written");
    let set = |words: &'static str| ["scenario", "check", "good.toml", "--set", words];
    for (words, says) in [
        (set("initial.gap"), &["has no `=`", "--set key.path=value"][..]),
        (set("=5"), &["is not a key path"]),
        (set("initial..gap_m=1"), &["is not a key path"]),
        (set("initial.gapp_m=1"), &["--set initial.gapp_m = 1", "did you mean `gap_m`?"]),
        (set("initial=1"), &["is a table, not a value"]),
        (set("name.x=1"), &["is a value, not a table"]),
        (set("initial.gap_m=nan"), &["--set initial.gap_m = nan m: is not a finite number"]),
        (set("initial.gap_m=1e400"), &["--set initial.gap_m"]),
        (
            set("run.duration_s=\u{1b}[31mred"),
            &["--set run.duration_s = \"\\u{1b}[31mred\" s: is a string"],
        ),
        (set("name=../x"), &["is no name for a run directory"]),
        (set("chaser.model=/dev/random"), &["--set chaser.model"]),
        (
            ["scenario", "check", "thrust.toml", "--set", "thrust.99999999999.delay_s=1"],
            &["is a list of 1"],
        ),
        (
            ["scenario", "check", "good.toml", "--set", deep.as_str()],
            &["a path of 20001 names; no key has more than 8"],
        ),
        (["scenario", "check", "good.toml", "--set", long.as_str()], &["--set run.duration_s"]),
        (
            ["scenario", "check", "good.toml", "--set", nested.as_str()],
            &["--set run.duration_s", "is a string"],
        ),
        (["rehearse", "good.toml", "--no-rrd", "--out", "file"], &["file"]),
        (["rehearse", "good.toml", "--no-rrd", "--out", "file/below"], &["file/below"]),
        (["rehearse", "good.toml", "--no-rrd", "--out", "/proc/docktwin"], &["/proc/docktwin"]),
    ] {
        refused(words[4], &words, at, says);
    }
    for path in
        ["folder", "gone.toml", "/dev/zero", "/dev/stdin", "file/below.toml", "\u{1b}[31m.toml"]
    {
        refused(path, &["scenario", "check", path], at, &["scenario: "]);
        refused(path, &["rehearse", path], at, &["scenario: "]);
        refused(path, &["model", "check", path], at, &["model: "]);
        refused(path, &["replay", path], at, &[]);
    }
    let absurd = "x/".repeat(30_000);
    refused("a path of 60 000 letters", &["scenario", "check", &absurd], at, &["mend the path"]);
    refused(
        "unknown key",
        &["scenario", "explain", "inital.gap"],
        at,
        &["did you mean `initial.gap_m`?"],
    );
    if cfg!(unix) {
        let done = Command::new("mkfifo").arg(at.join("pipe.toml")).status().expect("mkfifo");
        assert!(done.success());
        let says = ["is a pipe, a socket or a device, not a file", "pipe.toml"];
        refused("pipe", &["scenario", "check", "pipe.toml"], at, &says);
        refused("pipe", &["model", "check", "pipe.toml"], at, &says);
        fs::create_dir(at.join("piped")).expect("a folder");
        fs::rename(at.join("pipe.toml"), at.join("piped/run.mcap")).expect("moved");
        refused("a pipe as log", &["replay", "piped"], at, &["not a regular file"]);
    }
    settle();
}

// Models ---------------------------------------------------------------------------------------

const BODY: &str = r#"<robot name="craft">
  <link name="body">
    <inertial>
      <mass value="8000.0"/>
      <inertia ixx="8000.0" ixy="0" ixz="0" iyy="8000.0" iyz="0" izz="8000.0"/>
    </inertial>
  </link>
  <link name="port"/>
  <joint name="body_port" type="fixed">
    <parent link="body"/>
    <child link="port"/>
    <origin xyz="2.0 0 0" rpy="0 0 0"/>
  </joint>
</robot>
"#;
const BODY_TOML: &str = r#"schema = 1
kind = "spacecraft"
port_link = "port"
[numbers]
mass_kg = { source = "test" }
inertia_kg_m2 = { source = "test" }
com_m = { source = "test" }
port = { source = "test" }
[hull]
radius_m = { value = 1.0, assumed = "test" }
length_m = { value = 4.0, assumed = "test" }
"#;

#[test]
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn regress_hostile_spacecraft() {
    let dir = folder();
    let at = dir.path();
    let edit = |from: &str, to: &str| changed(BODY, from, to);
    let add = |text: &str| edit("</robot>", &format!("{text}</robot>"));
    let link = |i: usize| format!("<link name=\"l{i}\"/>");
    let joint = |i: usize, from: &str, to: &str| {
        format!(
            "<joint name=\"j{i}\" type=\"fixed\"><parent link=\"{from}\"/><child link=\"{to}\"/></joint>"
        )
    };
    let chain: String =
        (1..=5000).map(|i| link(i) + &joint(i, &format!("l{}", i - 1), &format!("l{i}"))).collect();
    let laughs = format!(
        "<!DOCTYPE r [<!ENTITY a0 \"ha\">{}]>{BODY}",
        (1..30)
            .map(|i| format!("<!ENTITY a{i} \"{}\">", format!("&a{};", i - 1).repeat(10)))
            .collect::<String>()
    );
    let cases: Vec<(&str, String, &[&str])> = vec![
        (
            "cycle",
            add(&format!("{}{}{}{}", link(1), link(2), joint(1, "l1", "l2"), joint(2, "l2", "l1"))),
            &[
                "link `l1`: hangs on a cycle of joints",
                "link `l2`: hangs on a cycle",
                "cut the cycle",
                "bad.urdf:14]",
            ],
        ),
        (
            "a link that hangs on itself",
            add(&format!("{}{}", link(1), joint(1, "l1", "l1"))),
            &["link `l1`: hangs on a cycle"],
        ),
        ("cycle of all", add(&joint(1, "port", "body")), &["has no root link"]),
        ("two roots", add(&link(1)), &["has 2 root links: `body`, `l1`", "into one tree"]),
        (
            "unknown link",
            edit("child link=\"port\"", "child link=\"harbour\""),
            &["names the link `harbour`, which does not exist", "[bad.urdf:9]"],
        ),
        (
            "duplicate names",
            add(
                "<link name=\"port\"/><joint name=\"body_port\" type=\"fixed\"><parent link=\"body\"/><child link=\"port\"/></joint>",
            ),
            &[
                "link `port`: stands twice",
                "joint `body_port`: stands twice",
                "is the child of more than one joint",
                "rename or remove one",
            ],
        ),
        (
            "NaN mass",
            edit("value=\"8000.0\"", "value=\"NaN\""),
            &["mass of link `body` value = NaN kg: is not a finite number", "[bad.urdf:4]"],
        ),
        (
            "infinite inertia and a word",
            edit("ixx=\"8000.0\"", "ixx=\"inf\"").replace("iyy=\"8000.0\"", "iyy=\"much\""),
            &["ixx = inf kg·m²: is not a finite number", "iyy = much kg·m²", "2 refused"],
        ),
        (
            "overflowing number",
            edit("8000.0\"/>", "1e999\"/>"),
            &["value = 1e999 kg: is not a finite number"],
        ),
        (
            "negative mass and inertia",
            edit("8000.0\"/>", "-8000.0\"/>").replace("iyy=\"8000.0\"", "iyy=\"-1\""),
            &[
                "mass of link `body` = -8000 kg: is out of range; allowed: ≥ 0.0001 and ≤ 10000000 kg",
                "is not positive definite",
                "2 refused",
                "[bad.urdf:2]",
            ],
        ),
        (
            "zero mass",
            edit("8000.0\"/>", "0\"/>"),
            &["mass of link `body` = 0 kg: is out of range"],
        ),
        ("subnormal mass", edit("8000.0\"/>", "5e-324\"/>"), &["is out of range"]),
        ("huge mass", edit("8000.0\"/>", "1e300\"/>"), &["is out of range"]),
        (
            "indefinite inertia",
            edit("ixy=\"0\"", "ixy=\"9000\""),
            &["inertia of link `body` = principal moments", "is not positive definite"],
        ),
        (
            "triangle inequality",
            edit("izz=\"8000.0\"", "izz=\"80000.0\""),
            &["the sum of two principal moments is below the third"],
        ),
        (
            "huge inertia",
            edit("izz=\"8000.0\"", "izz=\"1e300\""),
            &["izz = 1e300 kg·m²: is out of range"],
        ),
        (
            "a place at infinity",
            edit("2.0 0 0", "1e300 0 0"),
            &["origin of joint `body_port` xyz = 1e300 0 0 m: is out of range"],
        ),
        (
            "two numbers for three",
            edit("2.0 0 0", "2.0 0"),
            &["has 2 numbers; allowed: 3 finite numbers"],
        ),
        (
            "missing mesh",
            edit(
                "<link name=\"port\"/>",
                "<link name=\"port\"><visual><geometry><mesh filename=\"../gone.obj\"/></geometry></visual></link>",
            ),
            &["mesh of link `port` = ../gone.obj: does not exist", "mend the file name"],
        ),
        (
            "mesh by absolute path",
            edit(
                "<link name=\"port\"/>",
                "<link name=\"port\"><visual><geometry><mesh filename=\"/etc/passwd\"/></geometry></visual></link>",
            ),
            &["is not a relative path"],
        ),
        (
            "mesh by URL",
            edit(
                "<link name=\"port\"/>",
                "<link name=\"port\"><visual><geometry><mesh filename=\"file:///dev/zero\"/></geometry></visual></link>",
            ),
            &["is not a relative path"],
        ),
        (
            "mesh that is a directory",
            edit(
                "<link name=\"port\"/>",
                "<link name=\"port\"><visual><geometry><mesh filename=\"../../meshes\"/></geometry></visual></link>",
            ),
            &["is not the name of a mesh"],
        ),
        (
            "moving joint",
            edit("type=\"fixed\"", "type=\"continuous\""),
            &["moves, but a spacecraft is one rigid body; allowed: fixed"],
        ),
        (
            "unknown joint type",
            edit("type=\"fixed\"", "type=\"wobbly\""),
            &["wobbly", "[bad.urdf:"],
        ),
        (
            "unknown elements and attributes",
            edit("<link name=\"port\"/>", "<link name=\"port\" color=\"red\"><spring/></link>"),
            &["unknown attribute `color`", "spring of link `port`", "2 refused"],
        ),
        ("no mass at all", edit("      <mass value=\"8000.0\"/>\n", ""), &["has no `mass`"]),
        ("empty", String::new(), &["is empty", "[bad.urdf]"]),
        ("not XML", "hello".into(), &["xml:", "write well-formed XML"]),
        ("cut", BODY[..BODY.len() / 2].into(), &["xml:", "write well-formed XML"]),
        ("not a robot", "<html/>".into(), &["is not a URDF", "expand xacro first"]),
        (
            "terminal commands in a name",
            edit("\"craft\"", "\"&#x9b;31mred&#x202e;\""),
            &["\\u{9b}31mred\\u{202e}", "cannot be printed"],
        ),
        ("entity expansion", laughs, &["has a DTD", "[bad.urdf:1]"]),
        (
            "an entity from a file",
            format!("<!DOCTYPE r [<!ENTITY x SYSTEM \"file:///etc/passwd\">]>{BODY}"),
            &["has a DTD"],
        ),
        (
            "elements 100 000 deep",
            format!("{}{}", "<a>".repeat(100_000), "</a>".repeat(100_000)),
            &["xml: "],
        ),
        (
            "ignored elements 20 000 deep",
            add(&format!("<gazebo>{}{}</gazebo>", "<a>".repeat(20_000), "</a>".repeat(20_000))),
            &["nests elements 20002 deep", "at most 32"],
        ),
        (
            "30 000 links",
            add(&(0..30_000).map(link).collect::<String>()),
            &["links; allowed: at most 1000"],
        ),
        (
            "a million links",
            add(&(0..1_000_000).map(link).collect::<String>()),
            &["is larger than any file of this kind"],
        ),
        ("5000 links in a chain", add(&(link(0) + &chain)), &["at most 1000"]),
        (
            "80 000 attributes",
            edit(
                "<robot ",
                &format!(
                    "<robot {}",
                    (0..80_000).map(|i| format!("a{i}=\"\" ")).collect::<String>()
                ),
            ),
            &["has more than 64 attributes in one element", "[bad.urdf:1]"],
        ),
        (
            "a name of 900 000 letters",
            edit("\"craft\"", &format!("\"{}\"", "x".repeat(900_000)))
                .replace("8000.0\"/>", "0\"/>"),
            &["xxx…", "2 refused"],
        ),
        (
            "a long name with a thousand faults",
            edit(
                "<link name=\"port\"/>",
                &format!("<link name=\"{}\">{}</link>", "x".repeat(700_000), "<b/>".repeat(5000)),
            ),
            &["more problems are not listed"],
        ),
    ];
    assert!(cases.len() >= 40, "{}", cases.len());
    fs::write(at.join("bad.toml"), BODY_TOML).expect("written");
    fs::write(at.join("bad.urdf"), BODY).expect("written");
    let said = docktwin("the good model", &["model", "check", "bad.urdf"], at);
    assert_eq!(said.code, Some(0), "{}", said.out);
    for (case, text, says) in &cases {
        fs::write(at.join("bad.urdf"), text).expect("written");
        refused(case, &["model", "check", "bad.urdf"], at, says);
    }
    fs::write(at.join("bad.urdf"), BODY).expect("written");
    for (case, from, to, says) in [
        (
            "no kind",
            "kind = \"spacecraft\"",
            "",
            &["kind: is missing; allowed: spacecraft | mechanism_active | mechanism_passive"][..],
        ),
        (
            "unknown kind",
            "\"spacecraft\"",
            "\"submarine\"",
            &["kind = \"submarine\": is not a known word"],
        ),
        (
            "no such port",
            "\"port\"",
            "\"harbour\"",
            &[
                "port_link = \"harbour\": is not a link of the URDF; name one of `body`, `port`",
                "[bad.toml:3]",
            ],
        ),
        (
            "no notes",
            "{ source = \"test\" }",
            "{}",
            &["numbers.mass_kg", "no note where it comes from"],
        ),
        (
            "both notes",
            "assumed = \"test\" }",
            "assumed = \"a\", source = \"b\" }",
            &["has both a source and an assumed note"],
        ),
        (
            "hull of 1e30 m",
            "value = 4.0",
            "value = 1e30",
            &["hull.length_m = 1e30 m: is out of range; allowed: > 0 and ≤ 500 m", "[bad.toml:11]"],
        ),
        ("cut", "kind = \"spacecraft\"", "kind = \"spacecraft", &["syntax:", "[bad.toml:2]"]),
    ] {
        fs::write(at.join("bad.toml"), changed(BODY_TOML, from, to)).expect("written");
        refused(case, &["model", "check", "bad.urdf"], at, says);
    }
    fs::remove_file(at.join("bad.toml")).expect("removed");
    refused(
        "no TOML",
        &["model", "check", "bad.urdf"],
        at,
        &["does not exist", "bad.toml", "a TOML of the same name beside it"],
    );
    refused(
        "no URDF",
        &["model", "check", "gone.urdf"],
        at,
        &["model: this file does not exist; mend the path [gone.urdf]"],
    );
    refused(
        "a scenario as model",
        &["model", "check", "good.toml"],
        at,
        &["this is a scenario, not a model", "docktwin scenario check good.toml"],
    );
    settle();
}

#[test]
fn regress_hostile_mechanisms() {
    let dir = folder();
    let at = dir.path();
    let path = at.join("models/urdf/apas_active.toml");
    let good = fs::read_to_string(&path).expect("a model");
    for (case, from, to, says) in [
        (
            "4e9 petals",
            "count = { value = 3",
            "count = { value = 4000000000",
            &["petals.count = 4000000000", "allowed: whole number from 1 to 12"][..],
        ),
        (
            "4e18 segments",
            "segments = { value = 48",
            "segments = { value = 4000000000000000000",
            &["ring.segments", "from 8 to 720"],
        ),
        (
            "a ring of 0 m",
            "mean_radius_m = { value = 0.6",
            "mean_radius_m = { value = 0.0",
            &["ring.mean_radius_m = 0.0 m: is out of range; allowed: > 0 and ≤ 5 m"],
        ),
        (
            "section above the radius",
            "section_radius_m = { value = 0.025",
            "section_radius_m = { value = 0.5",
            &["petals collide"],
        ),
        (
            "negative stiffness and exponent",
            "stiffness_n_m = { value = 1000000.0",
            "stiffness_n_m = { value = -1.0",
            &["contact.stiffness_n_m = -1.0 N/m: is out of range"],
        ),
        (
            "inertia not symmetric",
            "[12.7, 0.0, 0.0]",
            "[12.7, 1.0, 0.0]",
            &["ring_body.inertia_kg_m2", "is not symmetric"],
        ),
        (
            "inertia of no body",
            "[12.7, 0.0, 0.0]",
            "[1000.0, 0.0, 0.0]",
            &["is not that of any body"],
        ),
        ("NaN in the inertia", "[12.7, 0.0, 0.0]", "[nan, 0.0, 0.0]", &["ring_body.inertia_kg_m2"]),
        (
            "a curve that falls",
            "[[0.0, 0.0], [0.15, 45000.0]]",
            "[[0.0, 9.0], [0.15, 1.0]]",
            &["does not rise", "sort or mend the points"],
        ),
        (
            "a curve of 100 000 points",
            "[[0.0, 0.0], [0.15, 45000.0]]",
            &format!("[{}]", "[0.0, 0.0], ".repeat(80_000)),
            &["attenuation.characteristic.axial.loading_n_over_m", "does not rise"],
        ),
        (
            "an unknown attenuation",
            "default = \"characteristic\"",
            "default = \"magic\"",
            &["attenuation.default = \"magic\"", "characteristic | differential | rigid"],
        ),
        (
            "terminal commands in a note",
            "assumed = \"45 degrees",
            "assumed = \"\\u001b[31m45 degrees",
            &["cannot be printed"],
        ),
    ] {
        fs::write(&path, changed(&good, from, to)).expect("written");
        refused(case, &["model", "check", "models/urdf/apas_active.urdf"], at, says);
        refused(case, &["scenario", "check", "good.toml"], at, &says[..1]);
    }
    settle();
}

// Recordings -----------------------------------------------------------------------------------

/// Commands that read a run directory, which is the word after these.
const READERS: &[&[&str]] = &[&["replay"]];

/// Commands that make something of whatever is left of a run, the run directory first.
const GLEANERS: &[&[&str]] = &[
    &["report", "run"],
    &["view", "run", "--save", "view.rrd"],
    &["export", "run", "--format", "csv", "--out", "left.csv"],
    &["diff", "good", "run"],
    &["diff", "run", "good", "--tolerance", "1e-3"],
];

/// What a reader may do with a damaged recording.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    /// Nothing can be read: exit code 2.
    Refused,
    /// Read up to the damage, which is told: exit code 0, or 1 where it differs; or refused.
    Cut,
    /// The damage lies where readers need not look: anything but a defect.
    Anything,
}

/// Little-endian number at a place.
fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
}

/// Opcode, offset and length of each record.
fn records(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let (mut at, mut out) = (8, Vec::new());
    while at + 9 <= bytes.len() - 8 {
        let length = usize::try_from(u64_at(bytes, at + 1)).expect("a length") + 9;
        out.push((bytes[at], at, length));
        at += length;
    }
    out
}

/// A zstd frame of runs of zeros: 4 bytes for each 128 KiB.
fn bomb(blocks: usize) -> Vec<u8> {
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x38];
    for i in 0..blocks {
        frame.extend([u8::from(i + 1 == blocks) | 0x02, 0x00, 0x10, 0x00]);
    }
    frame
}

/// A chunk that claims `claimed` bytes for these compressed ones.
fn chunk(claimed: u64, compression: &str, body: &[u8]) -> Vec<u8> {
    let mut inner = Vec::new();
    inner.extend(0u64.to_le_bytes());
    inner.extend(0u64.to_le_bytes());
    inner.extend(claimed.to_le_bytes());
    inner.extend(0u32.to_le_bytes());
    inner.extend(u32::try_from(compression.len()).expect("short").to_le_bytes());
    inner.extend(compression.as_bytes());
    inner.extend((body.len() as u64).to_le_bytes());
    inner.extend(body);
    record(6, &inner)
}

fn record(op: u8, body: &[u8]) -> Vec<u8> {
    let mut r = vec![op];
    r.extend((body.len() as u64).to_le_bytes());
    r.extend(body);
    r
}

/// A metadata record of pairs of texts.
fn metadata(name: &str, pairs: impl Iterator<Item = (String, String)>) -> Vec<u8> {
    let text = |b: &mut Vec<u8>, s: &str| {
        b.extend(u32::try_from(s.len()).expect("short").to_le_bytes());
        b.extend(s.as_bytes());
    };
    let (mut body, mut map) = (Vec::new(), Vec::new());
    text(&mut body, name);
    for (k, v) in pairs {
        text(&mut map, &k);
        text(&mut map, &v);
    }
    body.extend(u32::try_from(map.len()).expect("short").to_le_bytes());
    body.extend(map);
    record(0x0c, &body)
}

/// Damaged logs made of a good one.
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn recordings(good: &[u8]) -> Vec<(String, Vec<u8>, Ends)> {
    let all = records(good);
    let chunks: Vec<_> = all.iter().filter(|r| r.0 == 6).copied().collect();
    let first = chunks[0].1;
    let head = &good[..first];
    let mut out: Vec<(String, Vec<u8>, Ends)> = Vec::new();
    let mut add = |name: &str, bytes: Vec<u8>, ends| out.push((name.to_owned(), bytes, ends));

    add("empty", vec![], Ends::Refused);
    add("rubbish", (0..=255).cycle().take(100_000).collect(), Ends::Refused);
    add("text", b"not a recording\n".repeat(100), Ends::Refused);
    add("the mark alone", good[..8].to_vec(), Ends::Refused);
    for cut in [9, 20, first / 2, first - 1] {
        add(&format!("cut in the head at {cut}"), good[..cut].to_vec(), Ends::Refused);
    }
    add("cut before the first chunk", head.to_vec(), Ends::Refused);
    for i in 1..=12 {
        let cut = first + (good.len() - first) * i / 13;
        let ends = if cut < first + chunks[0].2 { Ends::Refused } else { Ends::Cut };
        add(&format!("cut at {cut}"), good[..cut].to_vec(), ends);
    }
    add("end mark cut", good[..good.len() - 8].to_vec(), Ends::Cut);
    let flipped = |at: usize| {
        let mut b = good.to_vec();
        b[at] ^= 0x10;
        b
    };
    for i in 0..12 {
        add(&format!("flipped in the head, {i}"), flipped(i * first / 12), Ends::Anything);
    }
    for i in 1..=8 {
        let at = chunks[1].1 + 50 + (chunks[1].2 - 60) * i / 8;
        add(&format!("flipped in a chunk at {at}"), flipped(at), Ends::Cut);
    }
    let last = all.last().expect("a footer").1;
    for at in [last + 9, last + 20, good.len() - 4] {
        add(&format!("flipped in the end at {at}"), flipped(at), Ends::Anything);
    }
    let index = all.iter().find(|r| r.0 == 7).expect("an index").1;
    add("flipped in an index", flipped(index + 12), Ends::Anything);
    for length in [0, 1, 1 << 31, 1 << 60, u64::MAX - 8, u64::MAX] {
        for (name, at, ends) in [
            ("the header", 8, Ends::Refused),
            ("a chunk", chunks[1].1, Ends::Cut),
            ("the footer", last, Ends::Cut),
        ] {
            let mut b = good.to_vec();
            b[at + 1..at + 9].copy_from_slice(&length.to_le_bytes());
            add(
                &format!("{name} claims {length} bytes"),
                b,
                if length < 2 { Ends::Anything } else { ends },
            );
        }
    }
    let with = |records: &[u8]| [head, records].concat();
    let big = bomb(80_000);
    for claimed in [0, 1000, 60 << 20, 10 << 30, 1 << 60, u64::MAX] {
        add(
            &format!("10 GB in a chunk that claims {claimed}"),
            with(&chunk(claimed, "zstd", &big)),
            Ends::Refused,
        );
    }
    add("60 MB of nothing", with(&chunk(480 << 17, "zstd", &bomb(480))), Ends::Refused);
    add("an unknown compression", with(&chunk(100, "\u{1b}[31mzip", &[0; 100])), Ends::Refused);
    add("a chunk that is no zstd", with(&chunk(100, "zstd", &[7; 100])), Ends::Refused);
    add("an empty chunk", with(&chunk(0, "", &[])), Ends::Refused);

    // Metadata of an enemy: our first record, then his.
    let ours = &good[..all[1].1];
    let run = |pairs: &[(&str, &str)]| {
        metadata("docktwin", pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())))
    };
    let schema = ("docktwin_record_schema", "1");
    let columns = |n: usize| {
        metadata(
            "docktwin.columns",
            (0..n).map(|i| (format!("{i:07}"), format!("float64 /t{i} c{i}"))),
        )
    };
    let pairs = || metadata("docktwin.pairs", std::iter::empty());
    add(
        "a newer schema",
        [ours, &run(&[("docktwin_record_schema", "99")])].concat(),
        Ends::Refused,
    );
    add("no schema", [ours, &run(&[])].concat(), Ends::Refused);
    add(
        "a schema that is no number",
        [ours, &run(&[("docktwin_record_schema", "\u{1b}[31m")])].concat(),
        Ends::Refused,
    );
    add(
        "60 000 columns",
        [ours, &run(&[schema]), &columns(60_000), &pairs()].concat(),
        Ends::Refused,
    );
    add("no columns", [ours, &run(&[schema]), &columns(0), &pairs()].concat(), Ends::Refused);
    let commands = metadata(
        "docktwin.columns",
        [("0".to_owned(), "float64 /a \u{1b}[31m".to_owned())].into_iter(),
    );
    add(
        "terminal commands in a column",
        [ours, &run(&[schema]), &commands, &pairs()].concat(),
        Ends::Refused,
    );
    add(
        "20 MB of metadata",
        [
            ours,
            &metadata("x", (0..500_000).map(|i| (format!("{i:07}"), "x".repeat(30)))),
            &run(&[schema]),
        ]
        .concat(),
        Ends::Refused,
    );
    let many: Vec<u8> =
        (0..100_000).flat_map(|i| metadata(&format!("m{i}"), std::iter::empty())).collect();
    add("100 000 metadata records", [ours, &many].concat(), Ends::Refused);
    // The twin's settings.
    for (key, value) in [
        ("steps_per_tick", "0"),
        ("steps_per_tick", "1000000000000000000"),
        ("steps_per_tick", "-1"),
        ("tick_nanos", "0"),
        ("tick_nanos", "18446744073709551615"),
        ("twin", "\u{1b}[31mthird"),
    ] {
        let meta = all.iter().find(|r| r.0 == 0x0c).expect("metadata");
        let body = &good[meta.1..meta.1 + meta.2];
        let end = good[meta.1 + meta.2..].to_vec();
        add(
            &format!("{key} = {value:?}"),
            [&good[..meta.1], &with_pair(body, key, value), &end].concat(),
            Ends::Refused,
        );
    }
    out
}

/// A metadata record with one value changed.
fn with_pair(record: &[u8], key: &str, value: &str) -> Vec<u8> {
    let mut at = 9;
    let mut text = || {
        let n = u32::from_le_bytes(record[at..at + 4].try_into().expect("four")) as usize;
        at += 4 + n;
        String::from_utf8(record[at - n..at].to_vec()).expect("text")
    };
    let name = text();
    at += 4;
    let mut pairs = Vec::new();
    while at < record.len() {
        let mut text = || {
            let n = u32::from_le_bytes(record[at..at + 4].try_into().expect("four")) as usize;
            at += 4 + n;
            String::from_utf8(record[at - n..at].to_vec()).expect("text")
        };
        let (k, v) = (text(), text());
        let v = if k == key { value.to_owned() } else { v };
        pairs.push((k, v));
    }
    metadata(&name, pairs.into_iter())
}

/// A good run within the limits, for the cases below.
fn good_run(at: &Path) -> PathBuf {
    fs::copy(root().join("scenarios/basic_central_impact.toml"), at.join("impact.toml"))
        .expect("copied");
    let words = [
        "rehearse",
        "impact.toml",
        "--twin",
        "reduced",
        "--set",
        "run.duration_s=0.3",
        "--out",
        "run",
    ];
    let said = docktwin("a good rehearsal", &words, at);
    assert!(matches!(said.code, Some(0 | 1)), "{}", said.err);
    at.join("run")
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn regress_damaged_recordings() {
    let dir = folder();
    let at = dir.path();
    let run = good_run(at);
    // The full twin and the viewer's file fit into the same memory.
    let words = ["rehearse", "impact.toml", "--set", "run.duration_s=0.1", "--out", "full"];
    assert!(matches!(docktwin("the full twin", &words, at).code, Some(0 | 1)));
    refused(
        "a run that is there",
        &["rehearse", "impact.toml", "--out", "run"],
        at,
        &["already there", "choose another --out", "run"],
    );
    let log = run.join("run.mcap");
    let good = fs::read(&log).expect("a log");
    fs::create_dir(at.join("good")).expect("a folder");
    for file in ["run.mcap", "summary.json", "scenario.toml"] {
        fs::copy(run.join(file), at.join("good").join(file)).expect("copied");
    }
    for reader in READERS {
        let words = [reader, &["run"][..]].concat();
        assert_eq!(docktwin("the good recording", &words, at).code, Some(0));
    }
    let cases = recordings(&good);
    assert!(cases.len() >= 60, "{}", cases.len());
    for (case, bytes, ends) in &cases {
        fs::write(&log, bytes).expect("written");
        for words in GLEANERS {
            let _ = fs::remove_file(at.join("left.csv"));
            attempt(case, || {
                let said = docktwin(case, words, at);
                assert!(matches!(said.code, Some(0..=2)), "{case}: {words:?} {:?}", said.code);
            });
        }
        for reader in READERS {
            let words = [reader, &["run"][..]].concat();
            if *ends == Ends::Refused {
                refused(case, &words, at, &["run"]);
                continue;
            }
            attempt(case, || {
                let said = docktwin(case, &words, at);
                let told = said.err.contains("cut") || said.code == Some(2) || said.code == Some(1);
                assert!(matches!(said.code, Some(0..=2)), "{case}: {:?}", said.code);
                assert!(*ends == Ends::Anything || told, "{case}: {}{}", said.out, said.err);
            });
        }
    }
    fs::write(&log, &good).expect("written");
    // The run directory itself.
    refused(
        "a file as run",
        &["replay", "run/run.mcap"],
        at,
        &["this is a file; give the run directory", "run/run.mcap"],
    );
    refused("a folder without a run", &["replay", "models"], at, &["models/run.mcap"]);
    let scenario = run.join("scenario.toml");
    let text = fs::read(&scenario).expect("a scenario");
    for (case, bytes) in
        [("rubbish", b"!!!".to_vec()), ("empty", vec![]), ("cut", text[..text.len() / 3].to_vec())]
    {
        fs::write(&scenario, bytes).expect("written");
        refused(case, &["replay", "run"], at, &["run/scenario.toml"]);
    }
    fs::write(
        &scenario,
        changed(&String::from_utf8(text.clone()).expect("text"), "[run]", "[run]\ntick_s = 0.0005"),
    )
    .expect("written");
    refused(
        "another tick",
        &["replay", "run"],
        at,
        &["ticks of 1000000 ns, its scenario.toml of 500000 ns"],
    );
    fs::remove_file(&scenario).expect("removed");
    refused(
        "no scenario",
        &["replay", "run"],
        at,
        &["this file does not exist", "run/scenario.toml"],
    );
    fs::create_dir(&scenario).expect("a folder");
    refused("a folder as scenario", &["replay", "run"], at, &["is a directory, not a file"]);
    fs::remove_dir(&scenario).expect("removed");
    fs::write(&scenario, text).expect("written");
    for rubbish in ["", "{", "[[[", "null", "{\"schema_version\": 1e99}"] {
        fs::write(run.join("summary.json"), rubbish).expect("written");
        for reader in READERS {
            docktwin("summary of rubbish", &[reader, &["run"][..]].concat(), at);
        }
    }
    // A reader that leaves is no defect.
    if cfg!(unix) {
        let pipe = format!("{} scenario explain | head -n 1", env!("CARGO_BIN_EXE_docktwin"));
        let done = Command::new("sh").args(["-c", &pipe]).output().expect("sh");
        assert!(done.stderr.is_empty(), "{}", String::from_utf8_lossy(&done.stderr));
    }
    settle();
}
