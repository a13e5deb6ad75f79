//! `view`: a run, or two of them, in the rerun viewer.

use std::{
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
};

use clap::{Args, ValueEnum};
use docktwin::playback::{pair_names, play, scene_model};
use docktwin_core::{SimTime, Tick};
use docktwin_model::{DockingMechanism, SideGeometry};
use docktwin_record::{RunReader, files};
use docktwin_run::provenance::digest_keys;
use docktwin_scenario::{Scenario, load_scenario};
use docktwin_view::{SceneWriter, VIEWER_VERSION, is_whole};
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
    #[arg(long, value_enum, default_value_t = Align::Start, requires = "compare")]
    align: Align,
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
pub(crate) enum Align {
    /// Their start
    Start,
    /// Their first contact
    FirstContact,
}

/// Runs the command.
pub(crate) fn run(args: &ViewArgs, json: bool) -> Result<ExitCode, Failure> {
    let until = args.at.map(sim_time).transpose()?;
    if let Some(file) = &args.save {
        match (&args.run, args.compare.as_slice()) {
            (Some(run), _) => save_one(run, until, file)?,
            (None, runs) => save_two(runs, args.align, until, file)?,
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
            save_two(runs, args.align, until, &made)?;
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

/// A recording with the scenario that it was made from.
struct Run {
    reader: RunReader,
    scenario: Scenario,
}

impl Run {
    fn open(dir: &Path) -> Result<Self, Failure> {
        let reader = RunReader::open(dir)?;
        let scenario = load_scenario(&dir.join(files::SCENARIO), &[])?;
        let changed: Vec<String> = digest_keys(&scenario.files)
            .filter(|(key, f)| {
                reader.metadata().get(key).is_some_and(|then| *then != f.digest.to_string())
            })
            .map(|(_, f)| f.path.display().to_string())
            .collect();
        if !changed.is_empty() {
            eprintln!(
                "drawn with the shapes of today: changed since the run are {}",
                changed.join(", ")
            );
        }
        Ok(Self { reader, scenario })
    }

    /// Time of the first contact, ns.
    fn first_contact(&self, dir: &Path) -> Result<u64, Failure> {
        let events = self.reader.events()?;
        let first = events.iter().find(|e| e.kind == "contact_begin");
        first
            .map(|e| SimTime::of_tick(Tick(e.tick), self.scenario.run.tick_nanos).nanos())
            .ok_or_else(|| Failure::Usage {
                what: format!("nothing touches in {}", dir.display()),
                remedy: "align the runs at their start: --align start".to_owned(),
            })
    }

    fn play(&mut self, view: &mut SceneWriter, until: Option<SimTime>) -> Result<(), Failure> {
        play(&mut self.reader, &self.scenario, view, until)?;
        if let Some(cut) = self.reader.cut().filter(|_| until.is_none()) {
            eprintln!("the recording is cut: {cut}");
        }
        Ok(())
    }
}

fn save_one(dir: &Path, until: Option<SimTime>, file: &Path) -> Result<(), Failure> {
    let mut run = Run::open(dir)?;
    let mut view =
        SceneWriter::create(file, &scene_model(&run.scenario), &pair_names(&run.scenario))?;
    run.play(&mut view, until)?;
    Ok(view.finish()?)
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
    let (mut a, mut b) = (Run::open(dir_a)?, Run::open(dir_b)?);
    let different = differences(&a.scenario.mechanism, &b.scenario.mechanism);
    if !different.is_empty() {
        return Err(Failure::Usage {
            what: format!(
                "{} and {} dock with different mechanisms, which cannot be laid over each other:\n{}",
                dir_a.display(),
                dir_b.display(),
                different.join("\n")
            ),
            remedy: "view each by itself; `docktwin diff` compares their numbers".to_owned(),
        });
    }
    let shift_ns = match align {
        Align::Start => 0,
        Align::FirstContact => {
            a.first_contact(dir_a)?.cast_signed() - b.first_contact(dir_b)?.cast_signed()
        }
    };
    // In B's own time; before its start nothing of it is shown.
    let until_b = until.map(|t| t.nanos().cast_signed() - shift_ns);
    let names = pair_names(&a.scenario);
    let mut front = SceneWriter::create_compared(file, &scene_model(&a.scenario), &names)?;
    let mut ghost = front.ghost(&scene_model(&b.scenario), &names, shift_ns)?;
    let seconds = SimTime::from_nanos(shift_ns.unsigned_abs()).seconds();
    let later = if shift_ns < 0 { "earlier" } else { "later" };
    let (a_name, b_name) = (dir_a.display(), dir_b.display());
    front.event(SimTime::from_nanos(0), "run", &a_name.to_string())?;
    front.event(
        SimTime::from_nanos(0),
        "run",
        &format!("B: {b_name}, drawn {seconds:.3} s {later}"),
    )?;
    if until_b.is_none_or(|t| t >= 0) {
        let until_b = until_b.map(|t| SimTime::from_nanos(t.unsigned_abs()));
        b.play(&mut ghost, until_b)?;
    }
    a.play(&mut front, until)?;
    ghost.finish()?;
    Ok(front.finish()?)
}

/// What of the shapes differs, one line each. Laws may differ: they are what one compares.
fn differences(a: &DockingMechanism, b: &DockingMechanism) -> Vec<String> {
    let mut out = Vec::new();
    let mut number = |name: String, x: f64, y: f64, unit: &str| {
        if x.to_bits() != y.to_bits() {
            out.push(format!("{name}: {x}{unit} against {y}{unit}"));
        }
    };
    let offset = "distance of the active ring from e3 at rest".to_owned();
    number(offset, a.ring_rest_offset_m, b.ring_rest_offset_m, " m");
    let offset = "distance of the passive ring from e4".to_owned();
    number(offset, a.passive_ring_offset_m, b.passive_ring_offset_m, " m");
    for (side, x, y) in [("active", &a.active, &b.active), ("passive", &a.passive, &b.passive)] {
        let (r, s) = (&x.ring, &y.ring);
        number(format!("{side} ring's mean radius"), r.mean_radius_m, s.mean_radius_m, " m");
        number(format!("{side} ring's section"), r.section_radius_m, s.section_radius_m, " m");
        let count = |g: &SideGeometry| g.petals.map_or(0, |p| p.count);
        number(format!("{side} petals"), count(x).into(), count(y).into(), "");
        if let (Some(p), Some(q)) = (&x.petals, &y.petals) {
            for (name, p, q, unit) in [
                ("azimuth", p.first_azimuth_rad, q.first_azimuth_rad, " rad"),
                ("radius at the base", p.base_radius_m, q.base_radius_m, " m"),
                ("radius at the tip", p.tip_radius_m, q.tip_radius_m, " m"),
                ("height", p.height_m, q.height_m, " m"),
                ("half-angle at the base", p.base_half_angle_rad, q.base_half_angle_rad, " rad"),
                ("half-angle at the tip", p.tip_half_angle_rad, q.tip_half_angle_rad, " rad"),
                ("thickness", p.thickness_m, q.thickness_m, " m"),
            ] {
                number(format!("{side} petals' {name}"), p, q, unit);
            }
        }
    }
    let azimuths = |m: &DockingMechanism| m.latches.as_ref().map(|l| l.azimuths_rad);
    match (azimuths(a), azimuths(b)) {
        (Some(x), Some(y)) => {
            for i in 0..3 {
                number(format!("azimuth of latch {}", i + 1), x[i], y[i], " rad");
            }
        }
        (None, None) => {}
        (x, _) => {
            let (with, without) = if x.is_some() { ("A", "B") } else { ("B", "A") };
            out.push(format!("latches: {with} has them, {without} has none"));
        }
    }
    out
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
