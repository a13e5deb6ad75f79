//! What is left of a run.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use docktwin_core::DVec3;
use docktwin_model::MechanismLimits;
use docktwin_record::{
    Cell, ColumnKind, ContactRow, Event, Flaw, KEPT_KEY, RecordError, RunReader, Summary,
    SummaryFile, files, read_summary,
};
use docktwin_scenario::{Scenario, load_scenario};

use crate::ReportError;
use crate::geometry::{Bodies, BodyColumns, Geometry};
use crate::moments::{self, Facts, Moment};
use crate::story::{Collector, Contact, KINDS, Pair};

/// Ports further than this from where they were recorded mean other models, m.
const MISMATCH_M: f64 = 1e-4;

/// One tick, whole, for a picture.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    pub(crate) time_s: f64,
    pub(crate) bodies: Bodies,
    pub(crate) contacts: Vec<ContactRow>,
    /// Phase of each latch: 0 free, 1 approach, 2 struck, 3 latched.
    pub(crate) latches: [u64; 3],
    /// F4 on the target in `e4`, N.
    pub(crate) port_n: Option<DVec3>,
}

/// Largest load and when, s.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Largest {
    pub(crate) value: f64,
    pub(crate) time_s: f64,
}

impl Largest {
    fn see(&mut self, value: f64, time_s: f64) {
        if value > self.value {
            *self = Self { value, time_s };
        }
    }
}

/// Loads at the passive side, as the limits of a mechanism name them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Loads {
    pub(crate) compression_n: Largest,
    pub(crate) tension_n: Largest,
    pub(crate) shear_n: Largest,
    pub(crate) torsion_nm: Largest,
    pub(crate) bending_nm: Largest,
    pub(crate) depth_m: Largest,
    /// Length of the force.
    pub(crate) force_n: Largest,
}

impl Loads {
    /// Force, N, and moment about the passive ring's centre, N·m, both in `e4`.
    fn see(&mut self, f: DVec3, m: DVec3, t: f64) {
        self.compression_n.see(f.x, t);
        self.tension_n.see(-f.x, t);
        self.shear_n.see(f.y.hypot(f.z), t);
        self.torsion_nm.see(m.x.abs(), t);
        self.bending_nm.see(m.y.hypot(m.z), t);
        self.force_n.see(f.length(), t);
    }
}

/// Columns kept for plots.
struct Curves {
    /// Place in the row, name and kind.
    kept: Vec<(usize, String, ColumnKind)>,
    values: Vec<Vec<f32>>,
}

impl Curves {
    fn of(reader: &RunReader) -> Self {
        let kept: Vec<(usize, String, ColumnKind)> = reader
            .columns()
            .iter()
            .enumerate()
            .filter(|(_, c)| c.kind != ColumnKind::U64 || c.name.contains("phase"))
            .map(|(i, c)| (i, c.name.clone(), c.kind))
            .collect();
        let values = vec![Vec::new(); kept.len()];
        Self { kept, values }
    }

    fn add(&mut self, row: &[Cell]) {
        for ((i, _, kind), out) in self.kept.iter().zip(&mut self.values) {
            let cell = row.get(*i).copied().unwrap_or_default();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_precision_loss,
                reason = "for plots seven digits are enough"
            )]
            out.push(match kind {
                ColumnKind::F64 => cell.as_f64() as f32,
                ColumnKind::U64 => cell.as_u64() as f32,
                ColumnKind::Bool => f32::from(u8::from(cell.as_bool())),
            });
        }
    }

    fn named(self) -> BTreeMap<String, Vec<f32>> {
        self.kept.into_iter().map(|(_, name, _)| name).zip(self.values).collect()
    }
}

/// A run directory, read.
#[derive(Debug)]
pub struct Run {
    /// The directory.
    pub dir: PathBuf,
    /// Its name.
    pub name: String,
    /// `summary.json`, if the run came to its end.
    pub summary: Option<Summary>,
    /// `events.jsonl`, as far as readable.
    pub events: Vec<Event>,
    /// What the recorder was told.
    pub metadata: BTreeMap<String, String>,
    /// Pairs of surfaces.
    pub pairs: Vec<Pair>,
    /// Every contact, in the order of beginning.
    pub contacts: Vec<Contact>,
    /// Why the run is incomplete and up to when it is readable; `None` for a whole one.
    pub incomplete: Option<String>,
    /// Whether log, summary and models are those that the run wrote, as far as they go: not edited, not
    /// damaged, not of another run.
    pub as_recorded: bool,
    /// What else could not be read, and what the page lacks for it.
    pub notes: Vec<String>,
    /// Time of every tick, s.
    pub(crate) time_s: Vec<f64>,
    columns: BTreeMap<String, Vec<f32>>,
    /// Normal force by kind of pair, N, at every tick.
    pub(crate) by_kind_n: [Vec<f32>; KINDS.len()],
    pub(crate) scenario: Option<Scenario>,
    pub(crate) geometry: Option<Geometry>,
    pub(crate) no_pictures: Option<String>,
    pub(crate) loads: Option<Loads>,
    /// Tick of the strongest contact.
    pub(crate) moments: Vec<(Moment, Snapshot)>,
    pub(crate) sizes: Vec<(&'static str, u64)>,
}

impl Run {
    /// Reads a run directory, whatever is left of it.
    ///
    /// # Errors
    /// Neither log, summary nor events can be read, or the disk fails.
    pub fn read(dir: &Path) -> Result<Self, ReportError> {
        let mut notes = Vec::new();
        let (summary, summary_right) = own_summary(dir, &mut notes);
        let events = read_events(dir, &mut notes);
        let reader = RunReader::open(dir);
        let sizes = [files::LOG, files::TABLE, files::EVENTS, "run.rrd"]
            .into_iter()
            .filter_map(|f| Some((f, fs::metadata(dir.join(f)).ok()?.len())))
            .collect();
        let name = dir
            .canonicalize()
            .unwrap_or_else(|_| dir.to_path_buf())
            .file_name()
            .map_or_else(|| dir.display().to_string(), |n| n.to_string_lossy().into_owned());
        let mut run = Self {
            dir: dir.to_path_buf(),
            name,
            summary,
            events,
            metadata: BTreeMap::new(),
            pairs: Vec::new(),
            contacts: Vec::new(),
            incomplete: None,
            as_recorded: true,
            notes,
            time_s: Vec::new(),
            columns: BTreeMap::new(),
            by_kind_n: Default::default(),
            scenario: None,
            geometry: None,
            no_pictures: None,
            loads: None,
            moments: Vec::new(),
            sizes,
        };
        run.as_recorded &= summary_right;
        match reader {
            Ok(reader) => run.read_log(reader)?,
            Err(e) => {
                if run.summary.is_none() && run.events.is_empty() {
                    let why = why_of(&e);
                    return Err(ReportError::Nothing { why, path: dir.to_path_buf() });
                }
                run.incomplete = Some(format!(
                    "The log cannot be read ({}), so there are no plots, no pictures and no contacts.",
                    why_of(&e)
                ));
                run.no_pictures = Some("the log cannot be read".to_owned());
                run.as_recorded = false;
            }
        }
        if run.summary.is_none() && run.incomplete.is_none() {
            let until = run.time_s.last().copied().unwrap_or(0.0);
            run.incomplete = Some(if run.dir.join(files::SUMMARY).exists() {
                format!("Its summary.json cannot be used. Its log is readable up to {until:.3} s.")
            } else {
                format!(
                    "There is no summary.json: the run did not come to its end. Its log is readable up \
                     to {until:.3} s."
                )
            });
        }
        Ok(run)
    }

    fn read_log(&mut self, mut reader: RunReader) -> Result<(), ReportError> {
        self.metadata = reader.metadata().clone();
        self.pairs = reader.pair_names().iter().map(|n| Pair::new(n)).collect();
        let changed = reader.changed_files();
        self.read_scenario();
        if !changed.is_empty() {
            self.as_recorded = false;
            (self.scenario, self.geometry) = (None, None);
            self.no_pictures
                .get_or_insert("scenario.toml or its models are not those of the run".into());
            self.notes.extend(
                changed
                    .iter()
                    .map(|why| format!("{why}; expectation, limits and pictures are left out.")),
            );
        }
        let bodies = BodyColumns::find(&reader);
        if bodies.is_none() && self.no_pictures.is_none() {
            self.no_pictures = Some("the record has no motion of the bodies".to_owned());
        }
        let at = Places::find(&reader);
        let mismatch_m = self.read_ticks(&mut reader, bodies.as_ref(), &at)?;
        self.judge_log(&reader);
        // Digests know better where there are any. On a rig the ports recorded are those measured, off the
        // programme's bodies by what the rig lags.
        let unproven = !self.metadata.keys().any(|k| k.starts_with(KEPT_KEY) || k == "rig");
        if unproven && mismatch_m > MISMATCH_M {
            self.geometry = None;
            self.no_pictures = Some(format!(
                "the models found are not those of the run: they put the ports {:.1} mm from where \
                 they were recorded",
                mismatch_m * 1e3
            ));
        }
        self.snapshots(&mut reader, bodies.as_ref(), &at)?;
        Ok(())
    }

    /// What the log says of itself once it is read, and whether the other files belong to it.
    fn judge_log(&mut self, reader: &RunReader) {
        if self.summary.is_some()
            && let Some(problem) = reader.summary_problem()
        {
            self.as_recorded = false;
            self.summary = None;
            self.notes.push(format!("{problem}. It is left out, so there is no verdict."));
        }
        let Some(cut) = reader.cut() else {
            if reader.logged_events() != self.events
                && (!reader.logged_events().is_empty()
                    || reader.metadata().contains_key("record_digest"))
            {
                self.notes
                    .push("events.jsonl is not what the log has; the events are the log's.".into());
                self.events = reader.logged_events().to_vec();
            }
            return;
        };
        // A largest value is one of all ticks or none.
        self.loads = None;
        self.as_recorded &= cut.merely_ends();
        let until = self.time_s.last().map_or("nothing".to_owned(), |t| format!("up to {t:.3} s"));
        let part = format!("Readable: {until}; everything below is about that part.");
        self.incomplete = Some(match cut.flaw {
            Flaw::Ends => format!("The log stops before its end mark ({}). {part}", cut.why),
            Flaw::Damaged => format!(
                "The log is damaged ({}). {part} Behind the damage it can be read again: `docktwin \
                 recover` goes on there.",
                cut.why
            ),
            Flaw::Edited => format!("The log is not what was recorded ({}). {part}", cut.why),
            Flaw::Foreign | Flaw::Recovered => format!("{}.", cut.why),
        });
    }

    /// First pass: every tick. Gives how far the ports are from where the models put them, m.
    fn read_ticks(
        &mut self,
        reader: &mut RunReader,
        bodies: Option<&BodyColumns>,
        at: &Places,
    ) -> Result<f64, RecordError> {
        let mut curves = Curves::of(reader);
        let kinds: Vec<usize> = self.pairs.iter().map(Pair::kind).collect();
        let mut collector = Collector::new(self.pairs.len(), self.tick_s());
        let mut loads = at.port4.map(|_| Loads::default());
        let mut loaded_ticks = 0u64;
        let offset = self.geometry.as_ref().map_or(0.0, |g| g.mechanism.passive_ring_offset_m);
        let mut mismatch: f64 = 0.0;
        let capture_s = self.capture_s();
        while let Some(tick) = reader.next_tick()? {
            let t = tick.time.seconds();
            self.time_s.push(t);
            curves.add(&tick.row);
            let now = bodies.and_then(|c| c.read(&tick.row));
            if let Some((g, b)) = self.geometry.as_ref().zip(now.as_ref()) {
                mismatch = mismatch.max(g.mismatch_m(b));
            }
            collector.tick(t, &tick.contacts, now.as_ref());
            let mut sums = [0.0f64; KINDS.len()];
            for c in &tick.contacts {
                sums[kinds.get(usize::from(c.pair)).copied().unwrap_or(3)] += c.normal_force_n;
                // As the summary has it: halves that are latched together touch on a rig.
                if let Some(l) = loads.as_mut().filter(|_| capture_s.is_none_or(|at| t <= at)) {
                    l.depth_m.see(c.depth_m, t);
                }
            }
            for (out, sum) in self.by_kind_n.iter_mut().zip(sums) {
                #[expect(clippy::cast_possible_truncation, reason = "for plots")]
                out.push(sum as f32);
            }
            if let (Some(l), Some((f, m))) = (&mut loads, at.port4(&tick.row)) {
                loaded_ticks += 1;
                // Moment about the centre of the passive ring, which lies at −offset on X4.
                l.see(f, m - (DVec3::X * -offset).cross(f), t);
            }
        }
        self.columns = curves.named();
        self.contacts = collector.finish();
        // From where nothing was read nothing is said, and no zero.
        self.loads = loads.filter(|_| loaded_ticks > 0);
        Ok(mismatch)
    }

    fn facts(&self) -> Facts {
        Facts {
            first_contact_s: self.contacts.first().map(|c| c.begin_s),
            strongest_s: self.strongest().map(|c| c.peak.time_s),
            closest_s: self.closest_s(),
            latched_s: self.latched_s(),
            capture_s: self.capture_s(),
            port_load_s: self.loads.map(|l| l.force_n).filter(|l| l.value > 1.0).map(|l| l.time_s),
            end_s: self.end_s(),
            incomplete: self.incomplete.is_some(),
            tick_s: self.tick_s(),
        }
    }

    fn closest_s(&self) -> Option<f64> {
        let axis = |a: &str| self.curve(&format!("relative_position_{a}_m"), 1.0);
        let (x, y, z) = (axis("x")?, axis("y")?, axis("z")?);
        let far = |i: usize| x[i][1].hypot(y[i][1]).hypot(z[i][1]);
        (0..x.len()).min_by(|a, b| far(*a).total_cmp(&far(*b))).map(|i| x[i][0])
    }

    /// Second pass: the ticks of the key moments.
    fn snapshots(
        &mut self,
        reader: &mut RunReader,
        bodies: Option<&BodyColumns>,
        at: &Places,
    ) -> Result<(), RecordError> {
        let (Some(columns), Some(_)) = (bodies, &self.geometry) else { return Ok(()) };
        let mut wanted = moments::choose(&self.facts()).into_iter().peekable();
        reader.rewind()?;
        while let Some(m) = wanted.peek() {
            let Some(tick) = reader.next_tick()? else { break };
            let t = tick.time.seconds();
            if t + 1e-9 < m.time_s {
                continue;
            }
            let Some(bodies) = columns.read(&tick.row) else { continue };
            let phase =
                |i: Option<usize>| i.and_then(|i| tick.row.get(i)).map_or(0, |c| c.as_u64());
            let snapshot = Snapshot {
                time_s: t,
                bodies,
                contacts: tick.contacts.clone(),
                latches: at.latches.map(phase),
                port_n: at.port4(&tick.row).map(|(f, _)| f),
            };
            if let Some(m) = wanted.next() {
                self.moments.push((m, snapshot));
            }
        }
        Ok(())
    }

    fn read_scenario(&mut self) {
        let path = self.dir.join(files::SCENARIO);
        match load_scenario(&path, &[]) {
            Ok(s) => {
                let changed: Vec<String> = s
                    .files
                    .iter()
                    .filter(|f| {
                        let digest = f.digest.to_string();
                        // The scenario of a run carries its overrides, so its digest is another.
                        f.path.extension().is_some_and(|e| e == "urdf")
                            && !self.metadata.is_empty()
                            && !self.metadata.values().any(|v| *v == digest)
                    })
                    .filter_map(|f| Some(f.path.file_name()?.to_string_lossy().into_owned()))
                    .collect();
                if !changed.is_empty() {
                    self.notes.push(format!(
                        "{} changed since the run; pictures, limits and places are by what is there \
                         now.",
                        changed.join(", ")
                    ));
                }
                self.geometry = Some(Geometry::new(&s));
                self.scenario = Some(s);
            }
            Err(e) => {
                let first = e.problems.first().map_or(String::new(), |p| {
                    let n = e.problems.len();
                    let more = if n > 1 { format!(" and {} more", n - 1) } else { String::new() };
                    format!("{}{more}", p.what)
                });
                self.no_pictures =
                    Some(format!("scenario.toml and its models cannot be loaded: {first}"));
            }
        }
    }

    /// Length of a tick, s.
    pub(crate) fn tick_s(&self) -> f64 {
        let nanos: Option<f64> = self.metadata.get("tick_nanos").and_then(|n| n.parse().ok());
        nanos.filter(|n| *n > 0.0).map_or(1e-3, |n| n * 1e-9)
    }

    /// A column as a curve over time, scaled.
    pub(crate) fn curve(&self, column: &str, factor: f64) -> Option<Vec<[f64; 2]>> {
        let values = self.columns.get(column)?;
        Some(self.over_time(values, factor))
    }

    /// Values at every tick as a curve over time, scaled.
    pub(crate) fn over_time(&self, values: &[f32], factor: f64) -> Vec<[f64; 2]> {
        self.time_s.iter().zip(values).map(|(t, v)| [*t, f64::from(*v) * factor]).collect()
    }

    /// Names of the columns kept.
    pub(crate) fn column_names(&self) -> impl Iterator<Item = &str> {
        self.columns.keys().map(String::as_str)
    }

    pub(crate) fn limits(&self) -> Option<&MechanismLimits> {
        self.geometry.as_ref().map(|g| &g.mechanism.limits)
    }

    /// Simulated time the record covers, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// First contact: by the summary, or by the record.
    pub(crate) fn first_contact_s(&self) -> Option<f64> {
        self.summary
            .as_ref()
            .and_then(|s| s.first_contact_s)
            .or_else(|| self.contacts.first().map(|c| c.begin_s))
    }

    /// Capture: by the summary, or by the events.
    pub(crate) fn capture_s(&self) -> Option<f64> {
        self.summary
            .as_ref()
            .and_then(|s| s.capture_s)
            .or_else(|| self.events.iter().find(|e| e.kind == "captured").map(|e| e.time_s))
    }

    /// When each latch caught for good.
    pub(crate) fn latched_s(&self) -> Vec<Option<f64>> {
        let latched = |i: usize| {
            if let Some(s) = &self.summary {
                return s.latches_s.get(i).copied().flatten();
            }
            let number = u64::try_from(i + 1).unwrap_or(0);
            self.events
                .iter()
                .rfind(|e| e.kind == "latched" && e.body["latch"].as_u64() == Some(number))
                .map(|e| e.time_s)
        };
        (0..self.latch_count()).map(latched).collect()
    }

    /// Number of latches, three as long as the mechanism is not known.
    pub(crate) fn latch_count(&self) -> usize {
        let of = |g: &crate::geometry::Geometry| g.mechanism.own_latches.len();
        self.geometry.as_ref().map(of).filter(|n| *n > 0).unwrap_or(3)
    }

    /// Whether the mechanism has latches, as far as is known.
    pub(crate) fn has_latches(&self) -> bool {
        match &self.geometry {
            Some(g) => g.mechanism.latch_count() > 0,
            None => self.latched_s().iter().any(Option::is_some),
        }
    }

    /// The strongest contact.
    pub(crate) fn strongest(&self) -> Option<&Contact> {
        self.contacts.iter().max_by(|a, b| a.peak.force_n.total_cmp(&b.peak.force_n))
    }
}

/// Columns of the loads and of the latches.
struct Places {
    port4: Option<[usize; 6]>,
    latches: [Option<usize>; 3],
}

impl Places {
    fn find(r: &RunReader) -> Self {
        let names = [
            "port4_force_x_n",
            "port4_force_y_n",
            "port4_force_z_n",
            "port4_moment_x_nm",
            "port4_moment_y_nm",
            "port4_moment_z_nm",
        ];
        let [a, b, c, d, e, f] = names.map(|n| r.column_index(n));
        let all = || Some([a?, b?, c?, d?, e?, f?]);
        let latch = |i: usize| r.column_index(&format!("latch_{}_phase", i + 1));
        Self { port4: all(), latches: core::array::from_fn(latch) }
    }

    /// F4 and M4 at the origin of `e4`, in `e4`.
    fn port4(&self, row: &[Cell]) -> Option<(DVec3, DVec3)> {
        let [a, b, c, d, e, f] = self.port4?.map(|i| row.get(i).map_or(f64::NAN, |c| c.as_f64()));
        let (force, moment) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
        (force.is_finite() && moment.is_finite()).then_some((force, moment))
    }
}

/// The reason alone: the page and the error name the path themselves.
fn why_of(e: &RecordError) -> String {
    match e {
        RecordError::NotARecording { why, .. } => why.clone(),
        RecordError::Io { action, reason, .. } => format!("could not {action}: {reason}"),
        other => other.to_string(),
    }
}

/// The summary, and false where there is one that is not what the run wrote.
fn own_summary(dir: &Path, notes: &mut Vec<String>) -> (Option<Summary>, bool) {
    match read_summary(dir) {
        Ok(None) => (None, true),
        Ok(Some(SummaryFile { summary, damage: None })) => (Some(summary), true),
        Ok(Some(SummaryFile { damage: Some(why), .. })) => {
            notes.push(format!("{why}. It is left out, so there is no verdict."));
            (None, false)
        }
        Err(RecordError::Newer { found, supported, .. }) => {
            notes.push(format!(
                "summary.json has schema {found}, this docktwin reads up to {supported}; it is left \
                 out."
            ));
            (None, true)
        }
        Err(e) => {
            notes.push(format!("summary.json is damaged and left out ({}).", why_of(&e)));
            (None, false)
        }
    }
}

fn read_events(dir: &Path, notes: &mut Vec<String>) -> Vec<Event> {
    let Ok(bytes) = fs::read(dir.join(files::EVENTS)) else {
        notes.push(
            "events.jsonl cannot be read; latches and capture are by the summary.".to_owned(),
        );
        return Vec::new();
    };
    let text = String::from_utf8_lossy(&bytes);
    let mut bad = 0usize;
    let events = text
        .lines()
        .filter(|l| !l.trim().is_empty())
        .filter_map(|l| {
            let e = serde_json::from_str::<Event>(l).ok();
            bad += usize::from(e.is_none());
            e
        })
        .collect();
    if bad > 0 {
        notes.push(format!("{bad} damaged lines of events.jsonl are left out."));
    }
    events
}
