//! Recordings for the viewer, made afterwards: of one run, or of one laid over another.

use std::path::{Path, PathBuf};

use docktwin_core::{SimTime, Tick};
use docktwin_model::{DockingMechanism, SideGeometry};
use docktwin_record::{Cut, RunReader, files};
use docktwin_run::provenance::digest_keys;
use docktwin_scenario::{Scenario, load_scenario};
use docktwin_view::SceneWriter;

use crate::{
    error::PlaybackError,
    playback::{pair_names, play, scene_model},
};

/// What two runs share in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Their start.
    Start,
    /// Their first contact.
    FirstContact,
}

/// A recording with the scenario that it was made from.
pub struct Recording {
    dir: PathBuf,
    reader: RunReader,
    scenario: Scenario,
    changed: Vec<PathBuf>,
}

impl Recording {
    /// Opens a run directory.
    ///
    /// # Errors
    /// It holds no recording, or its scenario cannot be read.
    pub fn open(dir: &Path) -> Result<Self, PlaybackError> {
        let reader = RunReader::open(dir)?;
        let scenario = load_scenario(&dir.join(files::SCENARIO), &[])?;
        let changed = digest_keys(&scenario.files)
            .filter(|(key, f)| {
                reader.metadata().get(key).is_some_and(|then| *then != f.digest.to_string())
            })
            .map(|(_, f)| f.path.clone())
            .collect();
        Ok(Self { dir: dir.to_owned(), reader, scenario, changed })
    }

    /// Model files that have changed since the run: it is drawn with the shapes of today.
    #[must_use]
    pub fn changed(&self) -> &[PathBuf] {
        &self.changed
    }

    /// Where and why the log stops before its end mark, once it was saved to its end.
    #[must_use]
    pub const fn cut(&self) -> Option<&Cut> {
        self.reader.cut()
    }

    /// Time of the first contact, ns.
    fn first_contact(&self) -> Result<u64, PlaybackError> {
        let events = self.reader.events()?;
        let first = events.iter().find(|e| e.kind == "contact_begin");
        first
            .map(|e| SimTime::of_tick(Tick(e.tick), self.scenario.run.tick_nanos).nanos())
            .ok_or_else(|| PlaybackError::NothingTouches { run: self.dir.clone() })
    }

    fn play(
        &mut self,
        view: &mut SceneWriter,
        until: Option<SimTime>,
    ) -> Result<(), PlaybackError> {
        play(&mut self.reader, &self.scenario, view, until)?;
        Ok(())
    }
}

/// Writes a run for the viewer, to `until` or to its end.
///
/// # Errors
/// The recording cannot be read or lacks columns, or the file cannot be written.
pub fn save_one(
    run: &mut Recording,
    until: Option<SimTime>,
    file: &Path,
) -> Result<(), PlaybackError> {
    let model = scene_model(&run.scenario, run.reader.columns());
    let mut view = SceneWriter::create(file, &model, &pair_names(&run.scenario))?;
    run.play(&mut view, until)?;
    Ok(view.finish()?)
}

/// Writes run B over run A for the viewer, to `until` of A's time or to the end.
///
/// # Errors
/// Those of [`save_one`]; the mechanisms have other shapes, or nothing touches that is to be aligned.
pub fn save_two(
    [a, b]: [&mut Recording; 2],
    align: Align,
    until: Option<SimTime>,
    file: &Path,
) -> Result<(), PlaybackError> {
    let differences = differences(&a.scenario.mechanism, &b.scenario.mechanism);
    if !differences.is_empty() {
        return Err(PlaybackError::Mechanisms { a: a.dir.clone(), b: b.dir.clone(), differences });
    }
    let shift_ns = match align {
        Align::Start => 0,
        Align::FirstContact => a.first_contact()?.cast_signed() - b.first_contact()?.cast_signed(),
    };
    // In B's own time; before its start nothing of it is shown.
    let until_b = until.map(|t| t.nanos().cast_signed() - shift_ns);
    let names = pair_names(&a.scenario);
    let [model_a, model_b] = [&*a, &*b].map(|r| scene_model(&r.scenario, r.reader.columns()));
    let mut front = SceneWriter::create_compared(file, &model_a, &names)?;
    let mut ghost = front.ghost(&model_b, &names, shift_ns)?;
    let seconds = SimTime::from_nanos(shift_ns.unsigned_abs()).seconds();
    let later = if shift_ns < 0 { "earlier" } else { "later" };
    let (a_name, b_name) = (a.dir.display().to_string(), b.dir.display().to_string());
    front.event(SimTime::from_nanos(0), "run", &a_name)?;
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
