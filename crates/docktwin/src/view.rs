//! `view`: a run, or two of them, in the rerun viewer.

use std::{
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
};

use clap::{Args, ValueEnum};
use docktwin_core::SimTime;
use docktwin_playback::{Align, Recording};
use docktwin_record::RunReader;
use docktwin_view::{VIEWER_VERSION, is_whole};
use serde_json::json;

use crate::failure::Failure;

/// Names the viewer, where it is not `rerun` on the path. Not `RERUN`: rerun itself reads that one.
const VIEWER: &str = "DOCKTWIN_VIEWER";

pub(crate) const EXAMPLES: &str = "\
The viewer is `rerun` on the path, in the version that run.rrd is written for; it is started with
its usage statistics off and the user's own configuration untouched. A run.rrd that is missing, cut
or of a killed run is made again from run.mcap.

Examples:
  docktwin view runs/fast
  docktwin view runs/fast --at 0.15                 as it was 0.15 s after the start
  docktwin view runs/fast --save fast.rrd           for another machine
  docktwin view --compare runs/fast runs/wide --align first-contact";

/// Options of `view`.
#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// Run directory
    #[arg(required_unless_present = "compare")]
    run: Option<PathBuf>,
    /// Lay run B over run A, as a grey ghost
    #[arg(long, num_args = 2, value_names = ["RUN_A", "RUN_B"], conflicts_with = "run")]
    compare: Vec<PathBuf>,
    /// What the two runs have in common in time
    #[arg(long, value_enum, default_value_t = AlignArg::Start, requires = "compare")]
    align: AlignArg,
    /// Show the run only up to this simulated time: the viewer opens there
    #[arg(long, value_name = "TIME_S", allow_negative_numbers = true)]
    at: Option<f64>,
    /// Write the recording for the viewer to this file instead of opening it
    #[arg(long, value_name = "FILE.rrd")]
    save: Option<PathBuf>,
    /// The viewer's program [default: DOCKTWIN_VIEWER of the environment, or `rerun`]
    #[arg(long, value_name = "PATH")]
    viewer: Option<PathBuf>,
}

/// What two runs share in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum AlignArg {
    /// Their start
    Start,
    /// Their first contact
    FirstContact,
}

impl AlignArg {
    const fn align(self) -> Align {
        match self {
            Self::Start => Align::Start,
            Self::FirstContact => Align::FirstContact,
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &ViewArgs, json: bool) -> Result<ExitCode, Failure> {
    let until = args.at.map(sim_time).transpose()?;
    if let Some(file) = &args.save {
        match (&args.run, args.compare.as_slice()) {
            (Some(run), _) => save_one(run, until, file)?,
            (None, runs) => save_two(runs, args.align.align(), until, file)?,
        }
        if json {
            println!("{}", json!({ "saved": file }));
        } else {
            println!("written to {}", file.display());
        }
        return Ok(ExitCode::SUCCESS);
    }
    // Before the work of a playback: there may be no viewer.
    let viewer = Viewer::find(args.viewer.as_deref())?;
    let made = viewer.dir.0.join("run.rrd");
    let file = match (&args.run, args.compare.as_slice()) {
        // What `analyze workspace` left.
        (Some(dir), _) if dir.join("rig.rrd").is_file() => dir.join("rig.rrd"),
        (Some(run), _) => {
            let kept = run.join("run.rrd");
            // A run that was cut off left a picture that ends earlier than its log.
            let complete = RunReader::open(run)?.summary()?.is_some() && is_whole(&kept);
            if until.is_none() && complete {
                kept
            } else {
                save_one(run, until, &made)?;
                made
            }
        }
        (None, runs) => {
            save_two(runs, args.align.align(), until, &made)?;
            made
        }
    };
    viewer.show(&file)?;
    if json {
        println!("{}", json!({ "viewer": viewer.program, "version": VIEWER_VERSION }));
    }
    Ok(ExitCode::SUCCESS)
}

fn sim_time(seconds: f64) -> Result<SimTime, Failure> {
    if !(0.0..=1e9).contains(&seconds) {
        return Err(Failure::Usage {
            what: format!("`--at {seconds}` is no time of a run"),
            remedy: "give seconds of simulated time from its start, for example --at 0.15"
                .to_owned(),
        });
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within 0 and 1e18 ns"
    )]
    Ok(SimTime::from_nanos((seconds * 1e9).round() as u64))
}

/// Opens a run, and says when its models have changed since.
fn open(dir: &Path) -> Result<Recording, Failure> {
    let run = Recording::open(dir)?;
    let changed: Vec<String> = run.changed().iter().map(|p| p.display().to_string()).collect();
    if !changed.is_empty() {
        eprintln!(
            "drawn with the shapes of today: changed since the run are {}",
            changed.join(", ")
        );
    }
    Ok(run)
}

/// Says where a recording that was shown to its end stops before its run.
fn tell_cut(run: &Recording, until: Option<SimTime>) {
    if let Some(cut) = run.cut().filter(|_| until.is_none()) {
        eprintln!("the recording is cut: {cut}");
    }
}

fn save_one(dir: &Path, until: Option<SimTime>, file: &Path) -> Result<(), Failure> {
    let mut run = open(dir)?;
    docktwin_playback::save_one(&mut run, until, file)?;
    tell_cut(&run, until);
    Ok(())
}

/// Writes run B over run A for the viewer.
pub(crate) fn save_two(
    dirs: &[PathBuf],
    align: Align,
    until: Option<SimTime>,
    file: &Path,
) -> Result<(), Failure> {
    let [dir_a, dir_b] = dirs else {
        return Err(Failure::Usage {
            what: "`--compare` takes two runs".to_owned(),
            remedy: "docktwin view --compare RUN_A RUN_B".to_owned(),
        });
    };
    let (mut a, mut b) = (open(dir_a)?, open(dir_b)?);
    docktwin_playback::save_two([&mut a, &mut b], align, until, file)?;
    [&b, &a].into_iter().for_each(|run| tell_cut(run, until));
    Ok(())
}

/// A new folder, removed with what is in it when it goes out of use.
struct Folder(PathBuf);

impl Folder {
    fn new() -> std::io::Result<Self> {
        let all = std::env::temp_dir();
        let mut n = 0;
        loop {
            let path = all.join(format!("docktwin-view-{}-{n}", std::process::id()));
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(Self(path)),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists && n < 1000 => n += 1,
                Err(e) => return Err(e),
            }
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed is left to the system's own cleaning.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The viewer's program, and a folder for what it needs.
pub(crate) struct Viewer {
    program: PathBuf,
    dir: Folder,
}

impl Viewer {
    /// Finds the viewer of our version and makes sure that it will send no usage statistics.
    pub(crate) fn find(named: Option<&Path>) -> Result<Self, Failure> {
        let program = named
            .map(Path::to_owned)
            .or_else(|| std::env::var_os(VIEWER).filter(|v| !v.is_empty()).map(PathBuf::from))
            .unwrap_or_else(|| PathBuf::from("rerun"));
        let install = format!("install it: pip install rerun-sdk=={VIEWER_VERSION}");
        let dir = Folder::new().map_err(|e| Failure::Usage {
            what: format!("cannot make a temporary folder: {e}"),
            remedy: "free some space, or set TMPDIR to a folder that can be written".to_owned(),
        })?;
        let viewer = Self { program, dir };
        let version = viewer.ask(&["--version"]).map_err(|e| Failure::Usage {
            what: format!("cannot start the viewer `{}`: {e}", viewer.program.display()),
            remedy: format!(
                "{install}\nor name it: --viewer PATH. Without a display: --save FILE.rrd"
            ),
        })?;
        // "rerun-cli 0.36.3 (features) …"
        let found = version.split_whitespace().nth(1).unwrap_or("unknown");
        if found != VIEWER_VERSION {
            return Err(Failure::Usage {
                what: format!(
                    "the viewer `{}` has version {found}, runs are written for {VIEWER_VERSION}",
                    viewer.program.display()
                ),
                remedy: install,
            });
        }
        viewer.silence()?;
        Ok(viewer)
    }

    /// Its program.
    pub(crate) fn program(&self) -> &Path {
        &self.program
    }

    /// The viewer with a configuration of its own: nothing in the user's is changed or obeyed.
    fn command(&self) -> Command {
        let mut c = Command::new(&self.program);
        c.env("XDG_CONFIG_HOME", &self.dir.0);
        c
    }

    fn ask(&self, words: &[&str]) -> std::io::Result<String> {
        let said = self.command().args(words).stdin(Stdio::null()).output()?;
        Ok(String::from_utf8_lossy(&said.stdout).into_owned())
    }

    /// The viewer knows no option and no variable against its usage statistics, only a file in its
    /// configuration folder. Where that folder cannot be moved, the user's own choice is asked for.
    fn silence(&self) -> Result<(), Failure> {
        let folder = self.dir.0.join("rerun");
        let file = folder.join("analytics.json");
        let config = json!({
            "analytics_enabled": false,
            "analytics_id": "",
            "metadata": {},
            "config_file_path": file,
            "data_dir_path": folder,
        });
        std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::write(&file, config.to_string()))
            .map_err(|e| Failure::Usage {
            what: format!("cannot write {}: {e}", file.display()),
            remedy: "free some space, or set TMPDIR to another folder".to_owned(),
        })?;
        let said = self.ask(&["analytics", "config"]).unwrap_or_default();
        let quiet = said
            .find('{')
            .and_then(|at| serde_json::from_str::<serde_json::Value>(&said[at..]).ok())
            .is_some_and(|v| v["analytics_enabled"] == json!(false));
        if quiet {
            return Ok(());
        }
        Err(Failure::Usage {
            what: "the viewer would send usage statistics".to_owned(),
            remedy: format!("switch them off once: {} analytics disable", self.program.display()),
        })
    }

    /// Opens a recording and waits until the viewer is closed.
    fn show(&self, file: &Path) -> Result<(), Failure> {
        let remedy = "without a display, write the file with --save FILE.rrd and open it elsewhere";
        let failed = |what: String| Failure::Usage { what, remedy: remedy.to_owned() };
        // A viewer of its own: by default the file would go to one that is open already, whatever its
        // settings. And one that listens to this machine only, not to the whole network.
        let status = self
            .command()
            .arg(file)
            .args(["--new", "--bind", "127.0.0.1"])
            .status()
            .map_err(|e| failed(format!("cannot start {}: {e}", self.program.display())))?;
        if status.success() {
            return Ok(());
        }
        Err(failed(format!("the viewer ended with {status}")))
    }
}
