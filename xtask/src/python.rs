//! Python environments of the gate, each under `target/` and made from a file of requirements.

use std::path::{Path, PathBuf};

use crate::shell;

/// The `bin` folder of the environment `target/<name>`, made or renewed when `requirements` changed.
pub(crate) fn environment(root: &Path, name: &str, requirements: &str) -> Result<PathBuf, String> {
    let wanted = std::fs::read_to_string(root.join(requirements))
        .map_err(|e| format!("{requirements} cannot be read ({e})"))?;
    let dir = shell::target(root).join(name);
    let bin = dir.join("bin");
    let python = bin.join("python");
    // What the environment was made from.
    let stamp = dir.join("requirements.txt");
    if python.is_file() && std::fs::read_to_string(&stamp).is_ok_and(|had| had == wanted) {
        println!("using {}", dir.display());
        return Ok(bin);
    }
    prerequisites(root)?;
    println!("making {} from {requirements}", dir.display());
    let of = |p: &Path| p.display().to_string();
    shell::run(&mut shell::command(root, "python3", &["-m", "venv", "--clear", &of(&dir)]))?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let mut install = shell::command(root, &python, &pip);
    install.args(["--requirement", requirements]);
    shell::run(&mut install)?;
    std::fs::write(&stamp, wanted)
        .map_err(|e| format!("{} cannot be written ({e})", of(&stamp)))?;
    Ok(bin)
}

/// One clear line for each thing this machine lacks.
fn prerequisites(root: &Path) -> Result<(), String> {
    let has = |code: &str| {
        shell::capture(&mut shell::command(root, "python3", &["-c", code]))
            .is_ok_and(|(_, status, _)| status == Some(0))
    };
    if !has("") {
        return Err("Python 3 is missing: `apt-get install python3 python3-venv`".to_owned());
    }
    if !has("import sys; sys.exit(sys.version_info < (3, 11))") {
        return Err("Python 3.11 or newer is needed: `apt-get install python3.11 python3.11-venv`"
            .to_owned());
    }
    if !has("import venv, ensurepip") {
        return Err("Python's venv module is missing: `apt-get install python3-venv`".to_owned());
    }
    Ok(())
}
