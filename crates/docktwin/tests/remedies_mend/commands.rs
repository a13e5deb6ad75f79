//! Remedies for commands: each is obeyed on the command line, or in the files that it names.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::texts::is_of;

/// What is changed before a command, in a folder with the shipped models and two runs.
type Change = fn(&Path);

/// A remedy as it stands in the sources, a command that asks for it, and ways of obeying it.
pub(crate) struct Case {
    pub(crate) remedy: &'static str,
    /// Before the command that fails.
    breaks: Change,
    fails: &'static str,
    /// What is mended in files, and the command that then works.
    ways: &'static [(Change, &'static str)],
}

const fn nothing(_: &Path) {}

/// Other words on the command line mend it.
const fn words(
    remedy: &'static str,
    fails: &'static str,
    ways: &'static [(Change, &'static str)],
) -> Case {
    Case { remedy, breaks: nothing, fails, ways }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("room");
    for entry in fs::read_dir(from).expect("a folder") {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() { copy(&path, &target) } else { drop(fs::copy(&path, target)) }
    }
}

/// The exit code, and what was said.
fn docktwin(words: &str, at: &Path) -> (Option<i32>, String) {
    let done = Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .args(words.split_whitespace())
        .current_dir(at)
        .env("NO_COLOR", "1")
        .env("COLUMNS", "1000")
        .stdin(Stdio::null())
        .output()
        .expect("docktwin starts");
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    (done.status.code(), format!("{}{}", text(&done.stdout), text(&done.stderr)))
}

fn change(at: &Path, file: &str, from: &str, to: &str) {
    let path = at.join(file);
    let text = fs::read_to_string(&path).expect("a text");
    assert!(text.contains(from), "{file} has no {from:?}: mend the case");
    fs::write(path, text.replacen(from, to, 1)).expect("room");
}

/// A folder with the models, some scenarios, and runs `a` and `b` of 0.2 s.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    for part in ["models/urdf", "meshes"] {
        copy(&root().join(part), &at.join(part));
    }
    for name in ["basic_central_impact", "apas_nominal", "free_flight", "basic_ring_ring"] {
        let from = root().join(format!("scenarios/{name}.toml"));
        fs::copy(from, at.join(format!("{name}.toml"))).expect("room");
    }
    let short = "--twin reduced --no-rrd --set run.duration_s=0.2";
    for (scenario, more, out) in [
        ("basic_central_impact", "", "a"),
        ("basic_central_impact", "--set initial.axial_speed_m_s=0.36", "b"),
        ("free_flight", "", "free"),
        ("basic_ring_ring", "", "bare"),
    ] {
        let (code, said) =
            docktwin(&format!("rehearse {scenario}.toml {short} {more} --out {out}"), at);
        assert!(matches!(code, Some(0 | 1)), "{said}");
    }
    dir
}

const RIG: &str = "models/urdf/stewart.toml";

/// Gravity across the docking axis, and no balance.
fn lies(at: &Path) {
    unbalanced(at);
    change(at, RIG, "[-9.81, 0.0, 0.0]", "[0.0, 0.0, -9.81]");
}

fn unbalanced(at: &Path) {
    let path = at.join(RIG);
    let text = fs::read_to_string(&path).expect("a text");
    let begin = text.find("[offload]").expect("a balance");
    let end = text.find("# Half-widths").expect("a spread");
    fs::write(path, format!("{}{}", &text[..begin], &text[end..])).expect("room");
}

fn shipped_rig(at: &Path) {
    fs::copy(root().join(RIG), at.join(RIG)).expect("room");
}

fn blind(at: &Path) {
    let path = at.join(RIG);
    let text = fs::read_to_string(&path).expect("a text");
    let begin = text.find("[sensors]").expect("sensors");
    let end = text.find("# The balance").expect("a balance");
    fs::write(path, format!("{}{}", &text[..begin], &text[end..])).expect("room");
}

fn rigid_by_default(at: &Path) {
    change(at, "models/urdf/apas_active.toml", "\"characteristic\"", "\"rigid\"");
}

/// A copy of run `a` without a tick.
fn empty_run(at: &Path) {
    copy(&at.join("a"), &at.join("empty"));
    let log = at.join("empty/run.mcap");
    let bytes = fs::read(&log).expect("a log");
    let chunk = bytes.windows(4).position(|w| w == b"zstd").expect("a chunk");
    fs::write(log, &bytes[..chunk - 40]).expect("room");
}

fn other_models(at: &Path) {
    change(at, "a/models/models/urdf/test_8t.toml", "# ", "#  ");
}

fn models_of_that_day(at: &Path) {
    change(at, "a/models/models/urdf/test_8t.toml", "#  ", "# ");
}

fn foreign_scenario(at: &Path) {
    fs::rename(at.join("a/scenario.toml"), at.join("kept.toml")).expect("room");
    fs::copy(at.join("b/scenario.toml"), at.join("a/scenario.toml")).expect("room");
}

fn own_scenario(at: &Path) {
    fs::rename(at.join("kept.toml"), at.join("a/scenario.toml")).expect("room");
}

fn written_before(at: &Path) {
    fs::write(at.join("left.csv"), "x").expect("room");
}

fn remove_it(at: &Path) {
    fs::remove_file(at.join("left.csv")).expect("it is there");
}

fn utf_16(at: &Path) {
    let text = fs::read_to_string(at.join("apas_nominal.toml")).expect("a text");
    let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(at.join("odd.toml"), bytes).expect("room");
}

fn latin_1(at: &Path) {
    let text = fs::read(at.join("apas_nominal.toml")).expect("a text");
    let mut bytes = b"# f\xfcr sp\xe4ter\n".to_vec();
    bytes.extend(text);
    fs::write(at.join("odd.toml"), bytes).expect("room");
}

fn as_utf_8(at: &Path) {
    let bytes = fs::read(at.join("odd.toml")).expect("a file");
    let text: String = if bytes.contains(&0) {
        let units: Vec<u16> =
            bytes.chunks_exact(2).map(|c| u16::from_le_bytes([c[0], c[1]])).collect();
        String::from_utf16(&units).expect("UTF-16")
    } else {
        bytes.iter().map(|b| char::from(*b)).collect()
    };
    fs::write(at.join("odd.toml"), text).expect("room");
}

fn blank(at: &Path) {
    fs::write(at.join("odd.toml"), "\n\n").expect("room");
}

fn its_content(at: &Path) {
    fs::copy(at.join("apas_nominal.toml"), at.join("odd.toml")).expect("room");
}

fn huge(at: &Path) {
    let text = fs::read_to_string(at.join("apas_nominal.toml")).expect("a text");
    fs::write(at.join("odd.toml"), format!("{text}{}", "# more\n".repeat(200_000))).expect("room");
}

fn linked_mesh(at: &Path) {
    let (mesh, away) = (at.join("meshes/chaser_8t_hull.obj"), at.join("../linked.obj"));
    fs::rename(&mesh, &away).expect("room");
    #[cfg(unix)]
    std::os::unix::fs::symlink(&away, &mesh).expect("a link");
}

fn mesh_itself(at: &Path) {
    let mesh = at.join("meshes/chaser_8t_hull.obj");
    fs::remove_file(&mesh).expect("a link");
    fs::rename(at.join("../linked.obj"), mesh).expect("room");
}

fn a_file(at: &Path) {
    fs::write(at.join("file"), "x").expect("room");
}

pub(crate) const CASES: &[Case] = &[
    words(
        "`docktwin model explain` lists every key",
        "model explain ring.colour",
        &[(nothing, "model explain")],
    ),
    words(
        "`docktwin scenario explain` lists every key",
        "scenario explain initial.colour",
        &[(nothing, "scenario explain")],
    ),
    words(
        "write it as --set key.path=value, for example --set initial.lateral_y_m=0.1",
        "scenario check apas_nominal.toml --set initial.lateral_y_m",
        &[(nothing, "scenario check apas_nominal.toml --set initial.lateral_y_m=0.1")],
    ),
    words(
        "give an existing key as --set key.path=value; `scenario explain` lists all",
        "scenario check apas_nominal.toml --set initial..gap_m=0.1",
        &[(nothing, "scenario check apas_nominal.toml --set initial.gap_m=0.1")],
    ),
    words(
        "mend the path",
        "scenario check apas_nominl.toml",
        &[(nothing, "scenario check apas_nominal.toml")],
    ),
    words(
        "give the path of a file",
        "scenario check models",
        &[(nothing, "scenario check apas_nominal.toml")],
    ),
    Case {
        remedy: "give a text file; one saved as UTF-16 must be saved again as UTF-8",
        breaks: utf_16,
        fails: "scenario check odd.toml",
        ways: &[(as_utf_8, "scenario check odd.toml")],
    },
    Case {
        remedy: "save the file as UTF-8",
        breaks: latin_1,
        fails: "scenario check odd.toml",
        ways: &[(as_utf_8, "scenario check odd.toml")],
    },
    Case {
        remedy: "write its content, or give the path of another file",
        breaks: blank,
        fails: "scenario check odd.toml",
        ways: &[
            (nothing, "scenario check apas_nominal.toml"),
            (its_content, "scenario check odd.toml"),
        ],
    },
    Case {
        remedy: "give a text file of the kind asked for, or take out what is not needed",
        breaks: huge,
        fails: "scenario check odd.toml",
        ways: &[(its_content, "scenario check odd.toml")],
    },
    Case {
        remedy: "put the mesh itself there, not a link to it",
        breaks: linked_mesh,
        fails: "model check models/urdf/chaser_8t.urdf",
        ways: &[(mesh_itself, "model check models/urdf/chaser_8t.urdf")],
    },
    words(
        "use `docktwin scenario check {}`",
        "model check apas_nominal.toml",
        &[(nothing, "scenario check apas_nominal.toml")],
    ),
    words(
        "a model is a URDF and a TOML of the same name beside it, with `kind = \"…\"`: {}",
        "model check meshes/chaser_8t_hull.obj",
        &[(nothing, "model check models/urdf/chaser_8t.urdf")],
    ),
    words(
        "name a rig, or leave --mechanism out",
        "model check models/urdf/chaser_8t.toml --mechanism models/urdf/apas_active.urdf",
        &[
            (
                nothing,
                "model check models/urdf/stewart.toml --mechanism models/urdf/apas_active.urdf",
            ),
            (nothing, "model check models/urdf/chaser_8t.toml"),
        ],
    ),
    words(
        "name `…_active.urdf`, with `…_passive.urdf` beside it",
        "model check models/urdf/stewart.toml --mechanism models/urdf/chaser_8t.urdf",
        &[(
            nothing,
            "model check models/urdf/stewart.toml --mechanism models/urdf/apas_active.urdf",
        )],
    ),
    Case {
        remedy: "turn the docking axis into the vertical and let [offload] of the rig's file carry the ring, \
                 or take a mechanism that bears its weight",
        breaks: lies,
        fails: "model check models/urdf/stewart.toml --mechanism models/urdf/apas_active.urdf",
        ways: &[
            (
                nothing,
                "model check models/urdf/stewart.toml --mechanism models/urdf/guide_active.urdf",
            ),
            (
                shipped_rig,
                "model check models/urdf/stewart.toml --mechanism models/urdf/apas_active.urdf",
            ),
        ],
    },
    Case {
        remedy: "add [offload] to the rig's TOML; models/urdf/stewart.toml is an example",
        breaks: unbalanced,
        fails: "validate fidelity apas_nominal.toml --offload-map --set run.duration_s=0.01",
        ways: &[(
            shipped_rig,
            "validate fidelity apas_nominal.toml --offload-map --set run.duration_s=0.01",
        )],
    },
    words(
        "add --tolerance 1e-3 or --tol m=1e-3",
        "diff a b --align first-contact",
        &[
            (nothing, "diff a b --align first-contact --tolerance 1e-3"),
            (nothing, "diff a b --align first-contact --tol m=1e-3"),
        ],
    ),
    Case {
        remedy: "give a run that was recorded for at least one tick",
        breaks: empty_run,
        fails: "diff empty empty",
        ways: &[(nothing, "diff a b")],
    },
    words(
        "align the runs at their start, or give runs in which something touches",
        "diff free free --align first-contact --tolerance 1e-3",
        &[
            (nothing, "diff free free --align start --tolerance 1e-3"),
            (nothing, "diff a b --align first-contact --tolerance 1e-3"),
        ],
    ),
    Case {
        remedy: "give two runs of at least one tick, and align them where both have ticks",
        breaks: empty_run,
        fails: "diff a empty --tolerance 1e-3",
        ways: &[(nothing, "diff a b --tolerance 1e-3")],
    },
    words(
        "write a name with * ? or a whole [...] in it",
        "export a --format csv --out x.csv --columns [",
        &[(nothing, "export a --format csv --out x.csv --columns [r]elative_*")],
    ),
    words(
        "name one of the columns that an export without --columns has",
        "export a --format csv --out x.csv --columns colour",
        &[(nothing, "export a --format csv --out x.csv --columns chaser_position_x_m")],
    ),
    words(
        "name a file with --out, or leave out --contacts and --json",
        "export a --format csv --out - --contacts",
        &[
            (nothing, "export a --format csv --out some.csv --contacts"),
            (nothing, "export a --format csv --out -"),
        ],
    ),
    Case {
        remedy: "name another with --out, or remove it first",
        breaks: written_before,
        fails: "export a --format csv --out left.csv",
        ways: &[
            (nothing, "export a --format csv --out right.csv"),
            (remove_it, "export a --format csv --out left.csv"),
        ],
    },
    Case {
        remedy: "restore the files of that day, or rehearse again",
        breaks: other_models,
        fails: "replay a",
        ways: &[
            (nothing, "rehearse basic_central_impact.toml --twin reduced --no-rrd --out again"),
            (models_of_that_day, "replay a"),
        ],
    },
    Case {
        remedy: "run.mcap and scenario.toml are not of one run, or damaged; use another copy",
        breaks: foreign_scenario,
        fails: "replay a",
        ways: &[(own_scenario, "replay a")],
    },
    Case {
        remedy: "use another copy, or rehearse again",
        breaks: empty_run,
        fails: "replay empty",
        ways: &[(nothing, "replay a")],
    },
    Case {
        remedy: "check the disk and the path",
        breaks: a_file,
        fails: "rehearse free_flight.toml --no-rrd --set run.duration_s=0.1 --out file/run",
        ways: &[(
            nothing,
            "rehearse free_flight.toml --no-rrd --set run.duration_s=0.1 --out folder/run",
        )],
    },
    words("check the path", "replay models", &[(nothing, "replay a")]),
    words(
        "give a smaller initial.gap_m, or less lateral speed and rate",
        "rehearse apas_nominal.toml --no-rrd --twin reduced --set run.duration_s=0.1 --set initial.lateral_y_m=1.4 \
         --set initial.lateral_speed_y_m_s=1.0 --set initial.roll_deg=20 --set initial.gap_m=0.098",
        &[
            (
                nothing,
                "rehearse apas_nominal.toml --no-rrd --twin reduced --set run.duration_s=0.1 --set \
                 initial.lateral_y_m=1.4 --set initial.lateral_speed_y_m_s=1.0 --set initial.gap_m=0.01 --out less",
            ),
            (
                nothing,
                "rehearse apas_nominal.toml --no-rrd --twin reduced --set run.duration_s=0.1 --set \
                 initial.lateral_y_m=1.4 --set initial.lateral_speed_y_m_s=0.1 --set initial.gap_m=0.098 --out slow",
            ),
        ],
    ),
    words(
        "leave run.tick_s at 0.001 for `hil`",
        "hil apas_nominal.toml --rig emulated --set run.tick_s=0.0005 --set run.duration_s=0.1",
        &[(
            nothing,
            "hil apas_nominal.toml --rig emulated --set run.duration_s=0.1 --no-rrd --out hil",
        )],
    ),
    words(
        "name it with --model RIG.toml, or as loop.rig in the scenario",
        "hil apas_nominal.toml --rig emulated --set loop.rig=stewart.urdf --set run.duration_s=0.1",
        &[(
            nothing,
            "hil apas_nominal.toml --rig emulated --set loop.rig=models/urdf/stewart.urdf --set run.duration_s=0.1 --no-rrd \
             --out hil",
        )],
    ),
    words(
        "give a smaller initial.gap_m or other initial conditions; `docktwin analyze workspace RIG.toml` tells \
         what the rig reaches",
        "hil apas_nominal.toml --rig emulated --set initial.gap_m=2.0 --set run.duration_s=0.1",
        &[(
            nothing,
            "hil apas_nominal.toml --rig emulated --set initial.gap_m=0.05 --set run.duration_s=0.1 --no-rrd --out hil",
        )],
    ),
    words(
        "make loop.sensors \"single\": F4 and M4 then come from sensor A",
        "hil apas_nominal.toml --rig emulated --model models/urdf/electric_hexapod.toml --set loop.sensors=two \
         --set run.duration_s=0.1",
        &[(
            nothing,
            "hil apas_nominal.toml --rig emulated --model models/urdf/electric_hexapod.toml --set loop.sensors=single \
             --set run.duration_s=0.1 --no-rrd --out hil",
        )],
    ),
    words(
        "leave the preset out",
        "rig identify --rig emulated --model models/urdf/electric_hexapod.toml --scenario apas_nominal.toml --preset \
         stiff --dof x --out a.toml",
        &[(
            nothing,
            "rig identify --rig emulated --model models/urdf/electric_hexapod.toml --scenario apas_nominal.toml --dof x \
             --out found.toml",
        )],
    ),
    words(
        "give one: a map is of one axis",
        "analyze stability models/urdf/stewart.toml --axis x+y --compensator none --added-ms 0 --out found",
        &[(
            nothing,
            "analyze stability models/urdf/stewart.toml --axis y --compensator none --added-ms 0 --out found",
        )],
    ),
    words(
        "leave --clock realtime away",
        "validate vibro-impact --axis x --case 6 --draws 1 --clock realtime --allow-best-effort --out found",
        &[(nothing, "validate vibro-impact --axis x --case 6 --draws 1 --out found")],
    ),
    words(
        "give --draws a number above 0",
        "validate vibro-impact --axis x --case 6 --draws 0 --draw-stick --out found",
        &[(nothing, "validate vibro-impact --axis x --case 6 --draws 1 --draw-stick --out found")],
    ),
    words(
        "leave --draws, --dead-zone and --corner away, or take --rig emulated",
        "validate vibro-impact --axis x --case 6 --corner 3 --rig ipc:none --out found",
        &[(
            nothing,
            "validate vibro-impact --axis x --case 6 --corner 3 --rig emulated --out found",
        )],
    ),
    words(
        "take `analyze bode` without --preset and --set, which measures their response, or a hydraulic rig",
        "analyze frequency models/urdf/electric_hexapod.toml --out found",
        &[
            (
                nothing,
                "analyze bode models/urdf/electric_hexapod.toml --payload none --dof x --out found",
            ),
            (nothing, "analyze frequency models/urdf/stewart.toml --out on_oil"),
        ],
    ),
    words(
        "give a hydraulic rig, models/urdf/stewart.toml is one",
        "validate single-dof --rig models/urdf/electric_hexapod.toml --mechanism models/urdf/apas_active.urdf --out found",
        &[(
            nothing,
            "validate single-dof --rig models/urdf/stewart.toml --mechanism models/urdf/apas_active.urdf --out found",
        )],
    ),
    Case {
        remedy: "add one; models/urdf/stewart.toml is an example",
        breaks: blind,
        fails: "hil apas_nominal.toml --rig emulated --set run.duration_s=0.1",
        ways: &[(
            shipped_rig,
            "hil apas_nominal.toml --rig emulated --set run.duration_s=0.1 --no-rrd --out hil",
        )],
    },
    words(
        "give 0 to {} ms with --lead-ms",
        "hil apas_nominal.toml --rig emulated --lead-ms 4000 --set run.duration_s=0.1",
        &[(
            nothing,
            "hil apas_nominal.toml --rig emulated --lead-ms 4 --set run.duration_s=0.1 --no-rrd --out hil",
        )],
    ),
    words(
        "name one",
        "analyze stiffness models/urdf/stewart.toml --set kp=20",
        &[(nothing, "analyze stiffness models/urdf/stewart.toml --set high_pass_hz=1 --out found")],
    ),
    words(
        "write it as --set KEY=NUMBER",
        "analyze stiffness models/urdf/stewart.toml --set high_pass_hz=low",
        &[(nothing, "analyze stiffness models/urdf/stewart.toml --set high_pass_hz=1 --out found")],
    ),
    words(
        "give a value in the range",
        "analyze stiffness models/urdf/stewart.toml --set high_pass_hz=1000",
        &[(nothing, "analyze stiffness models/urdf/stewart.toml --set high_pass_hz=1 --out found")],
    ),
    words(
        "give a new directory with --out DIR",
        "analyze stiffness models/urdf/stewart.toml --out a",
        &[(nothing, "analyze stiffness models/urdf/stewart.toml --out found")],
    ),
    Case {
        remedy: "give a directory that can be written with --out DIR",
        breaks: a_file,
        fails: "analyze stiffness models/urdf/stewart.toml --out file/found",
        ways: &[(nothing, "analyze stiffness models/urdf/stewart.toml --out found")],
    },
    words(
        "give the file of the active side and --passive FILE, or name the two …_active.urdf and …_passive.urdf",
        "analyze mechanism models/urdf/chaser_8t.urdf",
        &[(nothing, "analyze mechanism models/urdf/apas_active.urdf --axis x --out found")],
    ),
    Case {
        remedy: "give a mechanism whose ring moves; where the file describes more than its default, choose with \
                 --attenuation characteristic or --attenuation differential",
        breaks: rigid_by_default,
        fails: "analyze mechanism models/urdf/apas_active.urdf --axis x",
        ways: &[
            (nothing, "analyze mechanism models/urdf/apas75_active.urdf --axis x --out found"),
            (
                nothing,
                "analyze mechanism models/urdf/apas_active.urdf --axis x --attenuation characteristic --out found_too",
            ),
        ],
    },
    words(
        "give seconds of simulated time from its start, for example --at 0.15",
        "view a --at -1 --save v.rrd",
        &[(nothing, "view a --at 0.15 --save v.rrd")],
    ),
    words(
        "align the runs at their start: --align start",
        "view --compare free free --align first-contact --save v.rrd",
        &[(nothing, "view --compare free free --align start --save v.rrd")],
    ),
    words(
        "view each by itself; `docktwin diff` compares their numbers",
        "view --compare free bare --save v.rrd",
        &[(nothing, "view free --save v.rrd"), (nothing, "diff free bare --tolerance 1e-3")],
    ),
];

/// What is not as it should be with a case.
fn wrong(good: &Path, case: &Case) -> Option<String> {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path().join("work");
    copy(good, &at);
    (case.breaks)(&at);
    let (code, said) = docktwin(&format!("{} --json", case.fails), &at);
    let value: serde_json::Value = serde_json::from_str(&said).unwrap_or_default();
    let problems = value["problems"].as_array().cloned().unwrap_or_default();
    let says = problems.iter().any(|p| {
        let [remedy, what] =
            ["remedy", "what"].map(|k| p[k].as_str().unwrap_or_default().to_owned());
        // A recording's failure has its remedy within the sentence.
        is_of(&remedy, case.remedy) || what.contains(case.remedy)
    });
    if code != Some(2) || !says {
        return Some(format!("{:?} is not said by `{}`:\n{said}", case.remedy, case.fails));
    }
    for (mend, words) in case.ways {
        mend(&at);
        let (code, said) = docktwin(words, &at);
        if !matches!(code, Some(0 | 1)) {
            return Some(format!(
                "{:?}, obeyed with `{words}`, ends {code:?}:\n{said}",
                case.remedy
            ));
        }
    }
    None
}

#[test]
fn invariant_a_remedy_for_a_command_mends_it() {
    let good = folder();
    let wrong: Vec<String> = CASES.iter().filter_map(|c| wrong(good.path(), c)).collect();
    assert!(wrong.is_empty(), "{} remedies\n{}", wrong.len(), wrong.join("\n"));
}
