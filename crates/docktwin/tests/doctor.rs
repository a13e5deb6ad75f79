//! What `doctor` says holds together, whatever the machine.

use std::process::Command;

use serde_json::Value;

#[test]
fn invariant_every_shortfall_has_its_cost_and_its_remedy() {
    let done = Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .args(["doctor", "--seconds", "1", "--json"])
        .output()
        .expect("docktwin starts");
    let text = String::from_utf8_lossy(&done.stdout);
    let said: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    let checks = said["checks"].as_array().expect("checks");
    let names: Vec<&str> = checks.iter().filter_map(|c| c["name"].as_str()).collect();
    for name in ["kernel", "priority", "locked memory", "timer", "wake-ups", "shared memory"] {
        assert!(names.contains(&name), "{name} is not looked at: {names:?}");
    }
    let mut lacking = 0;
    for c in checks {
        let short = c["state"] != "good";
        assert_eq!(c["cost"].is_string(), short, "{c}");
        assert_eq!(c["remedy"].as_str().is_some_and(|r| !r.is_empty()), short, "{c}");
        lacking += usize::from(c["state"] == "lacking");
    }
    // The exit code is the verdict, and the verdict follows from what is lacking.
    let (verdict, code) = if lacking == 0 { ("real_time", 0) } else { ("best_effort", 1) };
    assert_eq!(said["verdict"], verdict, "{text}");
    assert_eq!(done.status.code(), Some(code));

    // Every tick of the second woke the loop or was missed.
    let count = |v: &Value| v.as_u64().expect("a count");
    let (n, missed) = (count(&said["wakeup_us"]["n"]), count(&said["missed"]));
    assert!(n + missed >= 1000 && n > 0, "{n} and {missed}");
    let bars = said["histogram_us"].as_array().expect("a histogram");
    assert_eq!(bars.iter().map(|b| count(&b[1])).sum::<u64>(), n);
}
