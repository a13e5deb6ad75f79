//! Calling other programs, and where those of this workspace are.

use std::{
    ffi::OsStr,
    io::{BufRead, BufReader, ErrorKind},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// A command with words, in `dir`.
pub(crate) fn command<S: AsRef<OsStr>>(
    dir: &Path,
    program: impl AsRef<OsStr>,
    args: &[S],
) -> Command {
    let mut c = Command::new(program);
    c.args(args).current_dir(dir);
    c
}

/// The cargo that called us, or the one on the path.
pub(crate) fn cargo(dir: &Path, args: &[&str]) -> Command {
    command(dir, std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), args)
}

/// How a command is written, for messages.
pub(crate) fn words(c: &Command) -> String {
    let mut out = Path::new(c.get_program())
        .file_name()
        .unwrap_or(c.get_program())
        .to_string_lossy()
        .into_owned();
    for a in c.get_args() {
        out.push(' ');
        out.push_str(&a.to_string_lossy());
    }
    out
}

fn cannot_start(c: &Command, e: &std::io::Error) -> String {
    let what = words(c);
    if e.kind() == ErrorKind::NotFound {
        format!("`{what}`: the program is not there")
    } else {
        format!("`{what}` cannot be started ({e})")
    }
}

/// Runs it with our own output; an error when it ends with anything but 0.
pub(crate) fn run(c: &mut Command) -> Result<(), String> {
    let status = c.status().map_err(|e| cannot_start(c, &e))?;
    if status.success() { Ok(()) } else { Err(format!("`{}` ended with {status}", words(c))) }
}

/// Runs it silently; what it wrote to stdout, its exit code, what it wrote to stderr.
pub(crate) fn capture(c: &mut Command) -> Result<(String, Option<i32>, String), String> {
    let done = c.output().map_err(|e| cannot_start(c, &e))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ok((text(&done.stdout), done.status.code(), text(&done.stderr)))
}

/// Runs it, repeats its stdout line by line, and gives the last line that is not empty.
pub(crate) fn run_and_keep_last_line(c: &mut Command) -> Result<String, String> {
    let mut child = c.stdout(Stdio::piped()).spawn().map_err(|e| cannot_start(c, &e))?;
    let mut last = String::new();
    if let Some(out) = child.stdout.take() {
        for line in BufReader::new(out).lines() {
            let line = line.map_err(|e| format!("`{}`: {e}", words(c)))?;
            println!("{line}");
            if !line.trim().is_empty() {
                last = line;
            }
        }
    }
    let status = child.wait().map_err(|e| format!("`{}`: {e}", words(c)))?;
    if status.success() { Ok(last) } else { Err(format!("`{}` ended with {status}", words(c))) }
}

/// Where cargo puts what it builds.
pub(crate) fn target(root: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir))
}

/// The command line of this workspace, dev profile.
pub(crate) fn binary(root: &Path) -> PathBuf {
    program(root, "docktwin")
}

/// A program of this workspace, dev profile.
pub(crate) fn program(root: &Path, name: &str) -> PathBuf {
    target(root).join("debug").join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
}
