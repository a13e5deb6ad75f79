//! `analyze`: files and answers of every analysis.

use std::{path::Path, process::Command};

fn run(args: &[&str]) -> (Option<i32>, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_docktwin")).args(args).output().expect("starts");
    (out.status.code(), String::from_utf8(out.stdout).expect("UTF-8"))
}

fn model(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name);
    path.to_string_lossy().into_owned()
}

#[test]
fn oracle_the_answer_is_that_of_the_model_file() {
    let dir = tempfile::tempdir().expect("a directory");
    let at = |n: &str| dir.path().join(n).to_string_lossy().into_owned();
    let file = model("apas_passive.toml");
    let test = |out: &str| {
        run(&[
            "analyze",
            "mechanism",
            &file,
            "--axis",
            "roll",
            "--axis",
            "x",
            "--json",
            "--out",
            out,
        ])
    };
    let (code, text) = test(&at("a"));
    assert_eq!(code, Some(0), "{text}");
    let v: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(v["attenuation"], "characteristic");
    let axis = |i: usize| &v["axes"][i]["as_in_a_docking"];
    let near = |got: &serde_json::Value, want: f64| {
        let got = got.as_f64().expect("a number");
        assert!((got / want - 1.0).abs() < 2e-3, "{got} against {want}");
    };
    assert_eq!((&v["axes"][0]["axis"], &v["axes"][1]["axis"]), (&"x".into(), &"roll".into()));
    near(&axis(0)["soft_stiffness"], 3e5);
    near(&axis(0)["dry_friction"], 250.0);
    near(&axis(0)["travel"][0], -0.15);
    near(&axis(1)["soft_stiffness"], 600.0);
    near(&axis(1)["travel"][1], 15f64.to_radians());
    // The loop area in the file is the loss of the cycle.
    let csv = std::fs::read_to_string(dir.path().join("a/loop_x.csv")).expect("CSV");
    let mut rows = csv.lines();
    assert_eq!(
        rows.next(),
        Some(
            "test,other_axes,cycle,time_s,x_m,y_m,z_m,rotation_x_rad,rotation_y_rad,rotation_z_rad,\
             force_x_n,force_y_n,force_z_n,moment_x_nm,moment_y_nm,moment_z_nm,stored_j,lost_j,work_j"
        )
    );
    let points: Vec<[f64; 2]> = rows
        .map(|r| r.split(',').collect::<Vec<_>>())
        .filter(|r| r[0] == "working" && r[2] == "1")
        .map(|r| [r[4], r[10]].map(|x| x.parse().expect("a number")))
        .collect();
    let closed = points.iter().chain(points.first()).collect::<Vec<_>>();
    let area: f64 =
        closed.windows(2).map(|w| 0.5 * (w[0][1] + w[1][1]) * (w[1][0] - w[0][0])).sum();
    near(&axis(0)["lost_per_cycle_j"], area);
    for f in ["loop_x.svg", "loop_roll.svg", "coupling.svg", "contact.svg"] {
        let svg = std::fs::read_to_string(dir.path().join("a").join(f)).expect(f);
        assert!(svg.starts_with("<svg") && svg.contains("<path"), "{f}");
        assert!(!svg.contains("NaN") && svg.len() < 300_000, "{f}: {}", svg.len());
    }
    for f in ["matrices.csv", "contact.csv", "mechanism.json"] {
        assert!(dir.path().join("a").join(f).is_file(), "{f}");
    }
    assert!(!dir.path().join("a/loop_y.csv").exists());

    // The same answer again, bit for bit, and never over an old one.
    let (_, again) = test(&at("b"));
    assert_eq!(text, again);
    let other = std::fs::read_to_string(dir.path().join("b/loop_x.csv")).expect("CSV");
    assert!(csv == other, "the loops repeat");
    let (code, refusal) = test(&at("a"));
    assert_eq!(code, Some(2), "{refusal}");
    assert!(refusal.contains("is not empty"), "{refusal}");
}

/// `analyze COMMAND stewart.toml …` with its files in `dir`: the answer.
fn rig(dir: &Path, args: &[&str]) -> serde_json::Value {
    let (file, out) = (model("stewart.toml"), dir.to_string_lossy().into_owned());
    let mut all = vec!["analyze", args[0], &file, "--json", "--out", &out];
    all.extend(&args[1..]);
    let (code, text) = run(&all);
    assert_eq!(code, Some(0), "{text}");
    let kept = std::fs::read_to_string(dir.join(format!("{}.json", args[0]))).expect("the answer");
    let answer: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(serde_json::from_str::<serde_json::Value>(&kept).expect("JSON"), answer);
    answer
}

/// Columns by name, and rows, of a table.
fn table(dir: &Path, name: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let text = std::fs::read_to_string(dir.join(name)).expect(name);
    let mut rows = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = rows.next().expect("a header");
    let rows: Vec<_> = rows.collect();
    for row in &rows {
        assert_eq!(row.len(), header.len(), "{name}: {row:?}");
        let finite = |x: &String| x.parse::<f64>().map_or(true, f64::is_finite);
        assert!(row.iter().all(finite), "{name}: {row:?}");
    }
    (header, rows)
}

fn column((header, rows): &(Vec<String>, Vec<Vec<String>>), name: &str) -> Vec<f64> {
    let k = header.iter().position(|h| h == name).unwrap_or_else(|| panic!("{name}: {header:?}"));
    rows.iter().map(|r| r[k].parse().expect("a number")).collect()
}

fn drawn(dir: &Path, name: &str) {
    let svg = std::fs::read_to_string(dir.join(name)).expect(name);
    roxmltree::Document::parse(&svg).expect("well formed");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
    assert!(!svg.contains("no data") && svg.len() < 400_000, "{name}: {}", svg.len());
}

fn near(got: f64, want: f64, within: f64) {
    assert!((got / want - 1.0).abs() <= within, "{got} against {want}");
}

#[test]
fn oracle_the_workspace_holds_the_docking_box() {
    let dir = tempfile::tempdir().expect("a directory");
    let v = rig(dir.path(), &["workspace"]);
    assert_eq!(v["fits"], true);
    assert!(v["growth"].as_f64() > Some(1.0));
    let places = table(dir.path(), "workspace.csv");
    let margin = column(&places, "stroke_margin_m");
    assert_eq!(margin.len(), 729);
    let least = margin.iter().copied().fold(f64::INFINITY, f64::min);
    near(v["stroke_margin_m"]["value"].as_f64().expect("a number"), least, 1e-5);
    assert!(least > 0.0 && column(&places, "joint_margin_deg").iter().all(|x| *x > 0.0));
    // By hand: joints at radii 4 and 2 m, 8 degrees beside the corners of triangles turned by 60
    // degrees, 3 m apart; in the middle, row 364 of the grid, all legs are alike.
    let length = (9.0 + 16.0 + 4.0 - 16.0 * 44f64.to_radians().cos()).sqrt();
    for leg in 0..6 {
        near(column(&places, &format!("leg_{leg}_m"))[364], length, 1e-6);
    }
    // Every outline goes round the docking box: beyond its corner in every direction.
    let sections = table(dir.path(), "sections.csv");
    let at = ["x_m", "y_m", "z_m"].map(|n| column(&sections, n));
    for ((x, y), z) in at[0].iter().zip(&at[1]).zip(&at[2]) {
        assert!(x.abs().max(y.abs()).max(z.abs()) > 0.3, "{x} {y} {z}");
    }
    // 1135 kg, ±1.27 mm and ±0.10 degrees of the paper.
    for key in ["tolerance", "range", "payload_at_rest", "payload_at_10_hz"] {
        assert_eq!(v["meets_the_paper"][key], true, "{key}");
    }
    drawn(dir.path(), "workspace.svg");
    assert!(docktwin_view::is_whole(&dir.path().join("rig.rrd")));
}

#[test]
fn oracle_natural_frequencies_follow_the_oil_volume() {
    let dir = tempfile::tempdir().expect("a directory");
    let v = rig(dir.path(), &["frequency"]);
    // Table 1 with 2500 kg on one leg.
    let presets = v["presets"].as_array().expect("presets");
    for (p, (want, volume)) in presets.iter().zip([(16.7, 0.36), (25.9, 0.15), (52.9, 0.036_f64)]) {
        let number = |x: &serde_json::Value| x.as_f64().expect("a number");
        near(number(&p["lumped_hz"]), want, 0.003);
        for dof in 0..6 {
            for end in 0..2 {
                let printed = number(&presets[0]["held_hz"][dof][end]);
                near(number(&p["held_hz"][dof][end]), printed * (0.36 / volume).sqrt(), 1e-9);
            }
        }
    }
    // The table and the answer tell the same extremes.
    let places = table(dir.path(), "frequency.csv");
    for (i, name) in ["x_hz", "y_hz", "z_hz", "roll_hz", "pitch_hz", "yaw_hz"].iter().enumerate() {
        let all = column(&places, name);
        assert_eq!(all.len(), 729);
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = all.iter().copied().fold(0.0, f64::max);
        near(v["held_hz"][i]["least"]["value"].as_f64().expect("a number"), least, 1e-5);
        near(v["held_hz"][i]["greatest"]["value"].as_f64().expect("a number"), greatest, 1e-5);
        assert!(least > 10.0, "{name}: {least}");
    }
    drawn(dir.path(), "frequency.svg");
    // Another plate and other oil, the same again for the same seed.
    let other = |n: &str| rig(&dir.path().join(n), &["frequency", "--seed", "3"]);
    let (a, b) = (other("a"), other("b"));
    assert_eq!(a, b);
    assert_ne!(a["middle"], v["middle"]);
}

#[test]
fn oracle_a_swept_sine_measures_the_linear_model_in_the_linear_range() {
    let dir = tempfile::tempdir().expect("a directory");
    let args =
        ["bode", "--dof", "y", "--dof", "roll", "--payload", "lateral", "--ideal", "--foreseen"];
    let v = rig(dir.path(), &args);
    let p = &v["payloads"][0];
    let apart = p["measured_against_linear"].as_f64().expect("a number");
    assert!(apart < 0.01, "{apart}");
    let points = table(dir.path(), "bode.csv");
    let [measured, linear] = ["gain_db", "linear_gain_db"].map(|n| column(&points, n));
    assert_eq!(measured.len(), 32);
    for (m, l) in measured.iter().zip(&linear) {
        assert!((m - l).abs() < 0.087, "1 % is 0.086 dB: {m} against {l}");
    }
    drawn(dir.path(), "bode_y.svg");
    drawn(dir.path(), "bode_roll.svg");
    assert!(!dir.path().join("bode_x.svg").exists());
}

#[test]
fn oracle_the_running_rig_holds_what_is_required_in_the_middle() {
    let dir = tempfile::tempdir().expect("a directory");
    let v = rig(dir.path(), &["bode", "--dof", "x", "--payload", "axial", "--preset", "stiff"]);
    assert_eq!(
        (&v["holds_where_measured"], &v["required"]["gain_error_to_5_hz"]),
        (&true.into(), &0.05.into())
    );
    let points = table(dir.path(), "bode.csv");
    assert!(column(&points, "coherence").iter().all(|c| *c > 0.999));
    let hz = column(&points, "frequency_hz");
    let (db, deg) = (column(&points, "gain_db"), column(&points, "phase_deg"));
    let ten = hz.iter().position(|f| (f - 10.0).abs() < 1e-9).expect("10 Hz");
    assert!(db[ten].abs() <= 2.0 && deg[ten] >= -70.0);
    // Friction, which the linear model has not, is seen.
    assert!(v["payloads"][0]["measured_against_linear"].as_f64() > Some(1e-4));

    // A loop that is not stable is no measurement, and the linear model says so first.
    let out = dir.path().join("fast").to_string_lossy().into_owned();
    let file = model("stewart.toml");
    let (code, text) = run(&[
        "analyze",
        "bode",
        &file,
        "--dof",
        "x",
        "--payload",
        "none",
        "--set",
        "position_gain_1_s=200",
        "--json",
        "--out",
        &out,
    ]);
    if code == Some(0) {
        let v: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(v["linear_model_holds_everywhere"], false, "{text}");
    } else {
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains("unstable"), "{text}");
    }
}

#[test]
fn oracle_poles_start_alike_and_stay_damped() {
    let dir = tempfile::tempdir().expect("a directory");
    let v = rig(dir.path(), &["stiffness"]);
    for (p, oil) in v["presets"].as_array().expect("presets").iter().zip([2.76e7, 6.624e7, 2.76e8])
    {
        assert_eq!(p["stable"], true);
        assert!(p["least_modal_damping"].as_f64() >= Some(0.1), "{p}");
        near(p["stiffness_ratio"].as_f64().expect("a number"), 1e6 / oil, 1e-9);
        for payload in p["payloads"].as_array().expect("payloads") {
            // More bulk modulus makes the payload matter less.
            let change = |key: &str| payload[key].as_f64().expect("a number").abs();
            let before = payload["gain_change_10_hz_db"]["value"].as_f64().expect("a number");
            assert!(change("then_gain_change_10_hz_db") < before.abs(), "{payload}");
        }
    }
    let poles = table(dir.path(), "poles.csv");
    assert!(column(&poles, "real_rad_s").iter().all(|x| *x < 0.0));
    // Without stiffness it has no direction.
    let free = |payload: &str| -> Vec<Vec<String>> {
        let rows = poles.1.iter().filter(|r| r[1] == payload && r[2] == "0.000000e0");
        rows.map(|r| [&r[..1], &r[3..]].concat()).collect()
    };
    assert!(!free("axial").is_empty());
    assert_eq!(free("axial"), free("lateral"));
    drawn(dir.path(), "poles.svg");
}

#[test]
fn regress_a_rig_that_cannot_reach_is_refused_in_terms_of_its_geometry() {
    let dir = tempfile::tempdir().expect("a directory");
    let text = std::fs::read_to_string(model("stewart.toml")).expect("TOML");
    let wide = text.replace("axial_m = { value = 0.3", "axial_m = { value = 1.2");
    assert_ne!(text, wide);
    let file = dir.path().join("wide.toml");
    std::fs::write(&file, wide).expect("written");
    std::fs::copy(model("stewart.urdf"), dir.path().join("wide.urdf")).expect("copied");
    for command in ["workspace", "frequency", "bode", "stiffness"] {
        let out = dir.path().join(command).to_string_lossy().into_owned();
        let name = file.to_string_lossy();
        let (code, told) = run(&["analyze", command, &name, "--out", &out, "--json"]);
        assert_eq!(code, Some(2), "{told}");
        assert!(told.contains("does not reach the docking workspace"), "{told}");
        assert!(!Path::new(&out).exists(), "nothing is written");
    }
}

/// Every row with two methods at one delay: the twin has every cell that a lead has, and the plot shows each.
#[test]
fn oracle_stability_is_told_by_cell_and_by_method() {
    let dir = tempfile::tempdir().expect("a directory");
    let dir = dir.path().join("map");
    let methods = ["--compensator", "lead", "--compensator", "twin", "--added-ms", "10"];
    let answer = rig(&dir, &[&["stability"], &methods[..]].concat());
    let cells = table(&dir, "stability.csv");
    assert_eq!(cells.1.len(), 2 * 7 * 7);
    assert!(column(&cells, "added_delay_s").iter().all(|s| (s - 0.01).abs() < 1e-12));
    let reach = answer["reach"].as_array().expect("a list");
    let within = |i: usize| reach[i]["within"][1].as_u64().expect("a count");
    assert_eq!(
        (reach[0]["method"].as_str(), reach[1]["method"].as_str()),
        (Some("lead"), Some("twin"))
    );
    assert!(within(0) > 5 && within(1) >= 42 && within(1) > within(0), "{reach:?}");
    assert_eq!(reach[1]["up_to_hz"][0].as_f64(), Some(2.884));
    let svg = std::fs::read_to_string(dir.join("stability.svg")).expect("a plot");
    assert!(svg.contains("lead") && svg.contains("twin") && svg.contains("row of Table 4"));
    drawn(&dir, "stability.svg");
    let bad = ["--axis", "x+y", "--compensator", "lead", "--json"];
    let file = model("stewart.toml");
    let (code, told) = run(&[&["analyze", "stability", &file], &bad[..]].concat());
    assert_eq!(code, Some(2), "{told}");
    assert!(told.contains("a map is of one axis"), "{told}");
}
