use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Pose, SimTime};
use docktwin_model::{DockingMechanism, Spacecraft};
use re_sdk_types::components::Radius;

use crate::columns::{Arrows, Curves, Labels, Legs, Points, Poses, Texts};
use crate::eye::{Eye, HALF_HEIGHT, reach};
use crate::mesh::f32x3;
use crate::stream::Stream;
use crate::style::{self, PairClass};
use crate::{ViewError, blueprint, paths, scene};

/// Frames sent together. Fewer lose less when the process dies (`view` makes the file anew from the log); of every
/// batch the file's table of contents keeps a row an entity in memory to the end of the run.
const BATCH: usize = 1024;
/// Points of the trace closer than this, m, are one.
const TRACE_CELL_M: f64 = 0.006;
/// Points of the trace in one entity: a new point repeats at most so many.
const TRACE_SEGMENT: usize = 32;
/// Table, labels and peaks change at most so often, ns.
const SUMMARY_PERIOD_NS: i64 = 10_000_000;
/// So often they change even when nothing touches: the port still feels the attenuator, ns.
const QUIET_PERIOD_NS: i64 = 100_000_000;
/// Friction below this, N, has no arrow.
const FRICTION_FROM_N: f64 = 1.0;
/// Labels on either side of the view.
const SLOTS: usize = 12;
/// Rows of the table.
const SUMMARY_ROWS: usize = 8;

/// What does not change during a run.
#[derive(Clone, Copy, Debug)]
pub struct SceneModel<'a> {
    /// Name of the scenario, shown as the recording's name.
    pub scenario: &'a str,
    /// The chaser, whose port carries the active side.
    pub chaser: &'a Spacecraft,
    /// The target, whose port carries the passive side.
    pub target: &'a Spacecraft,
    /// The mechanism.
    pub mechanism: &'a DockingMechanism,
    /// Whether it is a run against a rig, which is compared with the simulated system.
    pub with_rig: bool,
}

/// One instant of a run. About 100 frames a second are plenty, and one for every tick in which a
/// contact begins or ends.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Simulated time since the start of the run.
    pub time: SimTime,
    /// `X_W1`: the chaser's body frame `e1` in the world.
    pub x_world_chaser: Pose,
    /// `X_W2`: the target's body frame `e2` in the world.
    pub x_world_target: Pose,
    /// `X_Wr3`: the active ring's frame in the world.
    pub x_world_ring: Pose,
    /// Contacts at this instant, latches that hold included.
    pub contacts: &'a [ContactArrow],
    /// State of each latch: 0 free, 1 approach, 2 struck, 3 latched. Ignored where the mechanism
    /// has fewer latches; of more the first three.
    pub latches: [u8; 3],
    /// Curves.
    pub scalars: &'a Scalars,
}

/// One contact. Forces are those that the **active** side feels; the passive one feels the
/// opposite at the same point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactArrow {
    /// Index into the pair names given to [`SceneWriter::create`].
    pub pair: usize,
    /// Contact point, world frame, m.
    pub point_w_m: DVec3,
    /// Normal force, world frame, N.
    pub normal_force_w_n: DVec3,
    /// Friction force, world frame, N.
    pub friction_w_n: DVec3,
    /// Depth, m, ≥ 0.
    pub depth_m: f64,
}

impl ContactArrow {
    /// Size of the normal force, N.
    fn force_n(&self) -> f64 {
        self.normal_force_w_n.length()
    }
}

/// Curves of one instant. A number that is not known may be NaN: it leaves a gap in its curve.
/// Angles are roll, pitch, yaw in the x, y, z of a vector.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scalars {
    /// `p_34` in `e3`, m.
    pub relative_position_m: DVec3,
    /// Euler angles of `R_34`, degrees.
    pub relative_attitude_deg: DVec3,
    /// Velocity of `e4`'s origin seen from `e3`, in `e3`, m/s.
    pub relative_velocity_m_s: DVec3,
    /// Angular velocity of `e4` against `e3`, in `e3`, degrees/s.
    pub relative_rate_deg_s: DVec3,
    /// Displacement of the active ring from rest, in `e3`, mm.
    pub ring_deflection_mm: DVec3,
    /// Euler angles of the active ring against `e3`, degrees.
    pub ring_tilt_deg: DVec3,
    /// Force of the mechanism on the chaser at its port, in `e3`, N.
    pub port_force_n: DVec3,
    /// Moment of the mechanism on the chaser about the origin of `e3`, in `e3`, N·m.
    pub port_moment_nm: DVec3,
    /// Sum of the sizes of all normal forces, N.
    pub contact_normal_sum_n: f64,
    /// Energies since the start.
    pub energy: Energies,
    /// Size of the force between the sides, N: contacts, latches, joined rings.
    pub between_force_n: f64,
    /// Size of the moment between the sides about the passive ring's centre, N·m.
    pub between_moment_nm: f64,
    /// Axial gap at each latch, m.
    pub latch_gap_m: [f64; 3],
    /// Gap of each petal of the active and of the passive side to what is nearest on the other, m;
    /// negative in contact.
    pub petal_gap_m: [[f64; 3]; 2],
}

/// Energies by kind, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// Kinetic energy of the motion relative to the common mass centre.
    pub kinetic_relative_j: f64,
    /// Stored in springs of contact and attenuator.
    pub stored_j: f64,
    /// Lost so far in friction between the surfaces.
    pub dissipated_friction_j: f64,
    /// Lost so far in the damping of contacts.
    pub dissipated_contact_j: f64,
    /// Lost so far in the attenuator.
    pub dissipated_attenuator_j: f64,
}

/// Which run of a recording a writer writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// The only one.
    Alone,
    /// A of a comparison.
    First,
    /// B of a comparison.
    Ghost,
}

impl Part {
    fn path(self, path: &str) -> String {
        if self == Self::Ghost { paths::of_ghost(path) } else { path.to_owned() }
    }

    fn shade(self, colour: u32) -> u32 {
        if self == Self::Ghost { style::ghostly(colour) } else { colour }
    }

    /// In front of texts that both runs put into one list.
    fn prefix(self) -> &'static str {
        match self {
            Self::Alone => "",
            Self::First => "A: ",
            Self::Ghost => "B: ",
        }
    }
}

/// Writes the recording. What was not yet sent when a writer is dropped without
/// [`finish`](Self::finish) is written as far as possible, its errors lost.
pub struct SceneWriter {
    rec: Stream,
    path: PathBuf,
    part: Part,
    /// Added to every time, ns.
    shift: i64,
    /// `X_13`.
    x_chaser_port: Pose,
    /// `X_24`.
    x_target_port: Pose,
    legs: Vec<[DVec3; 2]>,
    latch_points: Option<[[f32; 3]; 3]>,
    latch_count: usize,
    pairs: Vec<Pair>,
    slots: Vec<Slot>,
    eye: Eye,
    face: Eye,
    /// Largest radius of the guiding surfaces, m.
    reach: f64,
    /// Petals of the active and the passive side.
    petals: [usize; 2],
    shown_latches: Option<[u8; 3]>,
    summary: Summary,
    trace: Trace,
    rows: Rows,
    frames: usize,
    last: i64,
    /// `X_3r3` of the last frame.
    x_3r: Pose,
}

/// A pair of surfaces.
struct Pair {
    name: String,
    class: PairClass,
    /// Strongest place in this tick, its point in `r3`.
    now_n: f64,
    now_friction_n: f64,
    now_depth_m: f64,
    now_point: DVec3,
    places: usize,
    peak: Option<Peak>,
    /// Its label's place, kept for the whole run.
    slot: Option<usize>,
}

/// A place for a label.
struct Slot {
    seen_at: [f64; 2],
    /// In `e3`, m.
    point: DVec3,
    taken: bool,
}

fn slots(eye: &Eye) -> Vec<Slot> {
    let rows = |x: f64| (0..SLOTS).map(move |k| [x, -0.76 + 1.4 * k as f64 / (SLOTS - 1) as f64]);
    let slot = |seen_at| Slot { seen_at, point: eye.point(seen_at, 0.75), taken: false };
    rows(-0.95).chain(rows(0.95)).map(slot).collect()
}

/// The strongest contact of a pair so far, in `r3`.
#[derive(Clone, Copy)]
struct Peak {
    force_n: f64,
    time: i64,
    point: DVec3,
    force: DVec3,
}

/// Size of the force (N) or moment (N·m) at the port, now and at its largest.
#[derive(Clone, Copy, Default)]
struct Load {
    now: f64,
    peak: f64,
    peak_time: i64,
}

impl Load {
    fn set(&mut self, time: i64, now: f64) {
        self.now = now;
        if now > self.peak {
            (self.peak, self.peak_time) = (now, time);
        }
    }
}

#[derive(Default)]
struct Summary {
    /// Pairs touching when last written.
    touching: BTreeSet<usize>,
    due: bool,
    written: Option<i64>,
    port_force: Load,
    port_moment: Load,
    between_force: Load,
    between_moment: Load,
}

/// Where the active side was touched, in `r3`, in segments so that a new point does not repeat all.
#[derive(Default)]
struct Trace {
    cells: BTreeSet<([i64; 3], u32)>,
    positions: Vec<[f32; 3]>,
    colours: Vec<u32>,
    rows: Points,
    full: Vec<Points>,
    segment: usize,
    grown: bool,
}

#[derive(Default)]
struct Rows {
    target: Poses,
    ring: Poses,
    legs: Legs,
    latches: Points,
    latch_states: [Texts; 3],
    contacts: [ContactRows; PairClass::ALL.len()],
    peaks: Arrows,
    labels: Labels,
    face_labels: Labels,
    table: Texts,
    fidelity: Texts,
    events: Texts,
    curves: [Curves; CURVES.len()],
}

#[derive(Default)]
struct ContactRows {
    points: Spots,
    normal: Arrows,
    friction: Arrows,
}

/// Points of the present contacts; written when there are some, and once when they are gone.
#[derive(Default)]
struct Spots {
    rows: Points,
    positions: Vec<[f32; 3]>,
    shown: bool,
}

impl Spots {
    fn end_row(&mut self, time: i64, colour: u32) {
        let n = self.positions.len();
        if n > 0 || self.shown {
            self.rows.push(time, &self.positions, &vec![colour; n]);
        }
        self.shown = n > 0;
        self.positions.clear();
    }
}

/// Plots, in the order of [`push_curves`].
const CURVES: [&str; 12] = [
    paths::PORT_FORCE,
    paths::PORT_MOMENT,
    paths::POSITION,
    paths::ATTITUDE,
    paths::VELOCITY,
    paths::RATE,
    paths::RING_DEFLECTION,
    paths::RING_TILT,
    paths::ENERGY,
    paths::LATCH_GAP,
    paths::GAP_ACTIVE,
    paths::GAP_PASSIVE,
];

/// Values of the plots, in the order of [`CURVES`].
fn push_curves(
    curves: &mut [Curves; CURVES.len()],
    time: i64,
    s: &Scalars,
    petals: [usize; 2],
    latch_count: usize,
) {
    let f = s.port_force_n;
    let e = &s.energy;
    let mm = |m: [f64; 3]| m.map(|g| 1e3 * g);
    let (latches, gaps) = (mm(s.latch_gap_m), s.petal_gap_m.map(mm));
    let energies = [
        e.kinetic_relative_j,
        e.stored_j,
        e.dissipated_friction_j,
        e.dissipated_contact_j,
        e.dissipated_attenuator_j,
    ];
    let values: [&[f64]; CURVES.len()] = [
        &[f.x, f.y, f.z, s.contact_normal_sum_n],
        &s.port_moment_nm.to_array(),
        &s.relative_position_m.to_array(),
        &s.relative_attitude_deg.to_array(),
        &s.relative_velocity_m_s.to_array(),
        &s.relative_rate_deg_s.to_array(),
        &s.ring_deflection_mm.to_array(),
        &s.ring_tilt_deg.to_array(),
        &energies,
        &latches[..latch_count],
        &gaps[0][..petals[0]],
        &gaps[1][..petals[1]],
    ];
    for (curve, v) in core::iter::zip(curves, values) {
        // What is not there has no gaps: no curve at all.
        if !v.is_empty() {
            curve.push(time, v);
        }
    }
}

impl SceneWriter {
    /// Starts the recording and writes all that does not change. `pair_names[i]` names pair `i` of
    /// the contacts, as in "active ring · passive petal 2'"; how often a name says "petal", and
    /// whether it says "latch", decides the colour. An existing file is replaced.
    ///
    /// # Errors
    /// [`ViewError::Create`] when the file cannot be made, [`ViewError::Encode`] when rerun refuses
    /// a part of the scene.
    pub fn create(
        path: &Path,
        scene: &SceneModel<'_>,
        pair_names: &[String],
    ) -> Result<Self, ViewError> {
        Self::start(path, scene, pair_names, Part::Alone)
    }

    /// Streams to a viewer that is open instead of a file, at `url` (see [`crate::LIVE_URL`]). What was
    /// recorded since is sent by [`Self::push`]. Calls may wait while the viewer does not keep up:
    /// not for a thread that keeps time.
    ///
    /// # Errors
    /// [`ViewError::NoViewer`] when none answers there within two seconds, [`ViewError::Encode`]
    /// when rerun refuses a part of the scene, [`ViewError::WithoutLive`] in a build without the
    /// cargo feature `live`.
    pub fn live(
        url: &str,
        scene: &SceneModel<'_>,
        pair_names: &[String],
    ) -> Result<Self, ViewError> {
        let rec = Stream::connect(url, scene.scenario)?;
        Self::begin(rec, PathBuf::from(url), scene, pair_names, Part::Alone)
    }

    /// Sends what was recorded so far, for viewers that look on.
    ///
    /// # Errors
    /// [`ViewError::Encode`] when rerun refuses the data.
    pub fn push(&mut self) -> Result<(), ViewError> {
        self.send()
    }

    /// The same for run A of a comparison, whose run B is written by [`Self::ghost`].
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn create_compared(
        path: &Path,
        scene: &SceneModel<'_>,
        pair_names: &[String],
    ) -> Result<Self, ViewError> {
        Self::start(path, scene, pair_names, Part::First)
    }

    /// A writer for run B into the same recording: its mechanism in grey, its curves paler and
    /// thinner than those of A, in the same plots. `shift_ns` is added to all its times. Finish it
    /// before the writer of A.
    ///
    /// # Errors
    /// [`ViewError::Encode`] when rerun refuses a part of the scene.
    pub fn ghost(
        &self,
        scene: &SceneModel<'_>,
        pair_names: &[String],
        shift_ns: i64,
    ) -> Result<Self, ViewError> {
        scene::log_ghost(&self.rec, scene).map_err(|e| ViewError::encode(paths::SCENE, e))?;
        let rec = self.rec.clone();
        Ok(Self::with(rec, self.path.clone(), scene, pair_names, Part::Ghost, shift_ns))
    }

    fn start(
        path: &Path,
        scene: &SceneModel<'_>,
        pair_names: &[String],
        part: Part,
    ) -> Result<Self, ViewError> {
        let rec = Stream::create(path, scene.scenario)?;
        Self::begin(rec, path.to_owned(), scene, pair_names, part)
    }

    /// Writes all that does not change.
    fn begin(
        rec: Stream,
        path: PathBuf,
        scene: &SceneModel<'_>,
        pair_names: &[String],
        part: Part,
    ) -> Result<Self, ViewError> {
        let m = scene.mechanism;
        let compared = part == Part::First;
        let (eye, face_on) = (Eye::new(m), Eye::face_on(m));
        let look = blueprint::Look { eye, face_on, compared, with_rig: scene.with_rig };
        blueprint::send(&rec, &blueprint::docking(&look))
            .map_err(|e| ViewError::encode("blueprint", e))?;
        scene::log_static(&rec, scene, compared).map_err(|e| ViewError::encode(paths::SCENE, e))?;
        Ok(Self::with(rec, path, scene, pair_names, part, 0))
    }

    fn with(
        rec: Stream,
        path: PathBuf,
        scene: &SceneModel<'_>,
        pair_names: &[String],
        part: Part,
        shift: i64,
    ) -> Self {
        let m = scene.mechanism;
        let eye = Eye::new(m);
        let pairs = pair_names.iter().enumerate().map(|(i, name)| Pair {
            name: name.clone(),
            class: PairClass::of(pair_names, i),
            now_n: 0.0,
            now_friction_n: 0.0,
            now_depth_m: 0.0,
            now_point: DVec3::ZERO,
            places: 0,
            peak: None,
            slot: None,
        });
        let ghost = part == Part::Ghost;
        Self {
            rec,
            path,
            part,
            shift,
            x_chaser_port: scene.chaser.x_body_port,
            x_target_port: scene.target.x_body_port,
            legs: if ghost { vec![] } else { scene::legs(m) },
            latch_points: scene::latch_points(m).map(|p| p.map(f32x3)),
            latch_count: scene::shown_latches(m),
            pairs: pairs.collect(),
            slots: slots(&eye),
            eye,
            face: Eye::face_on(m),
            reach: reach(m),
            petals: [&m.active, &m.passive].map(scene::petal_count),
            shown_latches: None,
            summary: Summary { due: true, ..Summary::default() },
            trace: Trace::default(),
            rows: Rows::default(),
            frames: 0,
            last: 0,
            x_3r: Pose::IDENTITY,
        }
    }

    /// Takes in an instant that is not drawn, so that peaks and the trace of contacts are those of
    /// every tick and not of the frames alone. Of the curves only the forces count. [`Self::frame`]
    /// does this too.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn tick(&mut self, f: &Frame<'_>) -> Result<(), ViewError> {
        let time = self.check(f)?;
        let x_wr = f.x_world_ring;
        self.observe(time, f.contacts, &x_wr.inverse());
        self.loads(time, f.scalars);
        Ok(())
    }

    /// Records one instant.
    ///
    /// # Errors
    /// [`ViewError::Frame`] with all problems of a frame that cannot be drawn (a pose or contact
    /// that is not finite, a pair without a name, a latch state above 3); nothing of it is recorded
    /// then. [`ViewError::Encode`] when rerun refuses the data.
    pub fn frame(&mut self, f: &Frame<'_>) -> Result<(), ViewError> {
        let time = self.check(f)?;
        let x_3w = (f.x_world_chaser * self.x_chaser_port).inverse();
        let x_3r = x_3w * f.x_world_ring;
        (self.last, self.x_3r) = (time, x_3r);
        self.rows.ring.push(time, &x_3r);
        self.rows.target.push(time, &(x_3w * f.x_world_target * self.x_target_port));
        if !self.legs.is_empty() {
            let ends = self.legs.iter().map(|[a, b]| [*a, x_3r.transform_point(*b)]);
            self.rows.legs.push(time, ends.map(|e| (e, style::LEG)));
        }
        self.latches(time, f.latches);
        self.observe(time, f.contacts, &f.x_world_ring.inverse());
        self.trace.end_row(time);
        self.contacts(time, f.contacts, &x_3w);
        self.loads(time, f.scalars);
        self.summarise(time, &x_3r, false);
        push_curves(&mut self.rows.curves, time, f.scalars, self.petals, self.latch_count);
        self.frames += 1;
        if self.frames >= BATCH { self.send() } else { Ok(()) }
    }

    fn loads(&mut self, time: i64, s: &Scalars) {
        let l = &mut self.summary;
        l.port_force.set(time, s.port_force_n.length());
        l.port_moment.set(time, s.port_moment_nm.length());
        l.between_force.set(time, s.between_force_n);
        l.between_moment.set(time, s.between_moment_nm);
    }

    /// Records an event; `kind` is shown in a column of its own ("contact", "latch", "outcome"). Figures of
    /// `fidelity` also stand in a view of their own.
    ///
    /// # Errors
    /// [`ViewError::Frame`] when the time is beyond what the viewer can show (292 years).
    pub fn event(&mut self, time: SimTime, kind: &str, text: &str) -> Result<(), ViewError> {
        let nanos = self.nanos(time).map_err(|p| frame_error(time, vec![p]))?;
        self.last = self.last.max(nanos);
        if kind == "fidelity" && self.part != Part::Ghost {
            self.rows.fidelity.push(nanos, "", as_list(text));
        }
        self.rows.events.push(nanos, kind, format!("{}{text}", self.part.prefix()));
        Ok(())
    }

    /// Time in the recording, ns.
    fn nanos(&self, time: SimTime) -> Result<i64, String> {
        let shifted = i64::try_from(time.nanos()).ok().and_then(|t| t.checked_add(self.shift));
        shifted.ok_or_else(|| {
            format!("time: {} ns, the viewer shows up to {} ns", time.nanos(), i64::MAX)
        })
    }

    /// Writes what is left and closes the file.
    ///
    /// # Errors
    /// [`ViewError::Write`] when the file could not be written to its end, [`ViewError::Encode`]
    /// when rerun refuses the data.
    pub fn finish(mut self) -> Result<(), ViewError> {
        let x_3r = self.x_3r;
        self.summarise(self.last, &x_3r, true);
        self.send()?;
        let (rec, path) = (self.rec.clone(), self.path.clone());
        drop(self);
        rec.close(&path)
    }

    /// Time of the frame in ns, if all of it can be drawn.
    fn check(&self, f: &Frame<'_>) -> Result<i64, ViewError> {
        let time = self.nanos(f.time);
        let mut problems: Vec<String> = time.as_ref().err().cloned().into_iter().collect();
        for (name, pose) in [
            ("x_world_chaser", &f.x_world_chaser),
            ("x_world_target", &f.x_world_target),
            ("x_world_ring", &f.x_world_ring),
        ] {
            if !pose.is_finite() {
                problems.push(format!("{name}: {:?} m, {:?} is not finite", pose.p, pose.q));
            }
        }
        for (i, c) in f.contacts.iter().enumerate() {
            if c.pair >= self.pairs.len() {
                problems.push(format!(
                    "contacts[{i}].pair: {}, but only {} pairs were named",
                    c.pair,
                    self.pairs.len()
                ));
            }
            for (name, v, unit) in [
                ("point_w_m", c.point_w_m, "m"),
                ("normal_force_w_n", c.normal_force_w_n, "N"),
                ("friction_w_n", c.friction_w_n, "N"),
                ("depth_m", DVec3::splat(c.depth_m), "m"),
            ] {
                if !v.is_finite() {
                    problems.push(format!("contacts[{i}].{name}: {v:?} {unit} is not finite"));
                }
            }
        }
        for (i, state) in f.latches.iter().enumerate() {
            if usize::from(*state) >= style::LATCH_NAMES.len() {
                problems.push(format!("latches[{i}]: {state}, allowed are 0 to 3"));
            }
        }
        match time {
            Ok(time) if problems.is_empty() => Ok(time),
            _ => Err(frame_error(f.time, problems)),
        }
    }

    /// Latches, written when one changes.
    fn latches(&mut self, time: i64, states: [u8; 3]) {
        let before = self.shown_latches.replace(states);
        if before == Some(states) {
            return;
        }
        if let Some(points) = self.latch_points.filter(|_| self.part != Part::Ghost) {
            let colours = states.map(|s| style::LATCH_COLOURS[usize::from(s)]);
            self.rows.latches.push(time, &points, &colours);
        }
        for (i, state) in states.into_iter().enumerate().take(self.latch_count) {
            if before.map(|b| b[i]) != Some(state) {
                let name = style::LATCH_NAMES[usize::from(state)];
                self.rows.latch_states[i].push(time, "", name.to_owned());
            }
        }
    }

    /// What touches now, its peaks, and the trace.
    fn observe(&mut self, time: i64, contacts: &[ContactArrow], x_rw: &Pose) {
        for pair in &mut self.pairs {
            (pair.now_n, pair.places) = (0.0, 0);
        }
        for c in contacts {
            let pair = &mut self.pairs[c.pair];
            let size = c.force_n();
            let point_r = x_rw.transform_point(c.point_w_m);
            pair.places += 1;
            if size >= pair.now_n {
                (pair.now_n, pair.now_depth_m) = (size, c.depth_m);
                pair.now_friction_n = c.friction_w_n.length();
                pair.now_point = point_r;
            }
            if pair.peak.is_none_or(|p| size > p.force_n) {
                let force = x_rw.q * c.normal_force_w_n;
                pair.peak = Some(Peak { force_n: size, time, point: point_r, force });
            }
            if pair.class != PairClass::Latch {
                self.trace.add(point_r, self.part.shade(pair.class.colour()));
            }
        }
    }

    /// Contact points and arrows.
    fn contacts(&mut self, time: i64, contacts: &[ContactArrow], x_3w: &Pose) {
        for c in contacts {
            let class = self.pairs[c.pair].class;
            let colour = self.part.shade(class.colour());
            let point = x_3w.transform_point(c.point_w_m);
            let normal = x_3w.q * c.normal_force_w_n;
            let friction = x_3w.q * c.friction_w_n;
            let rows = &mut self.rows.contacts[class as usize];
            rows.points.positions.push(f32x3(point));
            rows.normal.add(point, normal * style::METRES_PER_NEWTON, colour);
            if friction.length() >= FRICTION_FROM_N {
                rows.friction.add(point, friction * style::METRES_PER_NEWTON, style::paled(colour));
            }
        }
        for (class, rows) in core::iter::zip(PairClass::ALL, &mut self.rows.contacts) {
            rows.points.end_row(time, self.part.shade(class.colour()));
            rows.normal.end_row(time);
            rows.friction.end_row(time);
        }
    }

    /// Table, labels, and the peaks of pairs that do not touch now. Chattering contacts would write
    /// them every millisecond: they wait, and come again at the end.
    fn summarise(&mut self, time: i64, x_3r: &Pose, end: bool) {
        let touching: BTreeSet<usize> =
            (0..self.pairs.len()).filter(|i| self.pairs[*i].places > 0).collect();
        let s = &mut self.summary;
        // Caught latches push for the rest of the run: they alone are no reason to hurry.
        let busy = touching.iter().any(|i| self.pairs[*i].class != PairClass::Latch);
        s.due |= busy || s.touching != touching;
        let wait = match (end, s.due) {
            (true, _) => 1,
            (_, true) => SUMMARY_PERIOD_NS,
            (_, false) => QUIET_PERIOD_NS,
        };
        if s.written.is_some_and(|w| time - w < wait) {
            return;
        }
        (s.touching, s.due, s.written) = (touching, false, Some(time));
        if self.part != Part::Ghost {
            self.label(time, x_3r);
        }

        let mut order: Vec<&Pair> = self.pairs.iter().filter(|p| p.peak.is_some()).collect();
        // What pushes now comes first, then what has pushed most.
        let key = |p: &Pair| (p.now_n, p.peak.map_or(0.0, |k| k.force_n));
        order.sort_by(|a, b| {
            let ((a, a_peak), (b, b_peak)) = (key(a), key(b));
            b.total_cmp(&a).then(b_peak.total_cmp(&a_peak))
        });
        self.rows.table.push(time, "", table(time, &order, &self.summary));
    }

    /// Peaks of pairs that do not touch now, and the labels of both views.
    fn label(&mut self, time: i64, x_3r: &Pose) {
        for pair in self.pairs.iter_mut().filter(|p| p.places > 0 && p.slot.is_none()) {
            let at = self.eye.seen_at(x_3r.transform_point(pair.now_point));
            pair.slot = take_slot(&mut self.slots, at);
        }
        let mut around = Around::new(self.face, self.reach);
        for pair in &self.pairs {
            let Some(peak) = pair.peak else { continue };
            let colour = pair.class.colour();
            let name = short(&pair.name);
            let (text, point, shade) = if pair.places > 0 {
                let point = x_3r.transform_point(pair.now_point);
                let text = format!("{}  {name}", style::newtons(pair.now_n));
                self.rows.face_labels.add(text.clone(), around.place(point), point, colour);
                (text, point, colour)
            } else {
                let shade = style::faded(colour, 0x90);
                let arrow = peak.force * style::METRES_PER_NEWTON;
                self.rows.peaks.add(peak.point, arrow, shade);
                let text = format!("peak was {}  {name}", style::newtons(peak.force_n));
                (text, x_3r.transform_point(peak.point), shade)
            };
            if let Some(slot) = pair.slot {
                self.rows.labels.add(text, self.slots[slot].point, point, shade);
            }
        }
        self.rows.peaks.end_row(time);
        self.rows.labels.end_row(time);
        self.rows.face_labels.end_row(time);
    }

    /// Sends what was gathered.
    fn send(&mut self) -> Result<(), ViewError> {
        self.frames = 0;
        let (rec, rows, part) = (&self.rec, &mut self.rows, self.part);
        let at = |path: &str| part.path(path);
        rows.target.send(rec, &at(paths::TARGET))?;
        rows.ring.send(rec, &at(paths::ACTIVE))?;
        rows.legs.send(rec, &at(paths::LEGS), style::LEG_RADIUS_M)?;
        let latch = Radius::new_scene_units(style::LATCH_RADIUS_M);
        rows.latches.send(rec, &at(paths::LATCHES), latch)?;
        for (i, states) in rows.latch_states.iter_mut().enumerate() {
            states.send_states(rec, &at(&paths::latch_state(i)))?;
        }
        for (class, c) in core::iter::zip(PairClass::ALL, &mut rows.contacts) {
            let path = at(&format!("{}/{}", paths::CONTACTS, class.key()));
            let radius = Radius::new_scene_units(0.013);
            c.points.rows.send(rec, &format!("{path}/point"), radius)?;
            c.normal.send(rec, &format!("{path}/normal"), 5.0)?;
            c.friction.send(rec, &format!("{path}/friction"), 2.5)?;
        }
        rows.peaks.send(rec, &at(paths::PEAKS), 3.0)?;
        rows.labels.send(rec, &at(paths::LABELS))?;
        rows.face_labels.send(rec, &at(paths::FACE_LABELS))?;
        rows.table.send_markdown(rec, &at(paths::TABLE))?;
        rows.fidelity.send_markdown(rec, paths::FIDELITY)?;
        rows.events.send_log(rec, &at(paths::EVENTS))?;
        for (curve, path) in core::iter::zip(&mut rows.curves, CURVES) {
            curve.send(rec, &at(path))?;
        }
        self.trace.send(rec, &at(paths::TRACE))
    }
}

impl Drop for SceneWriter {
    fn drop(&mut self) {
        // After `finish` nothing is left. Otherwise there is nobody to tell.
        let _ = self.send();
    }
}

/// `what: a; b` as a heading and a list.
fn as_list(text: &str) -> String {
    let (what, all) = text.split_once(": ").unwrap_or(("", text));
    let lines: Vec<String> = all.split("; ").map(|l| format!("- {l}")).collect();
    format!("**{what}**\n\n{}\n", lines.join("\n"))
}

impl Trace {
    /// Adds a point in `r3`, unless there is one of that colour nearby.
    fn add(&mut self, point: DVec3, colour: u32) {
        let cell = (point / TRACE_CELL_M).round().to_array().map(|x| x as i64);
        if self.cells.insert((cell, colour)) {
            self.positions.push(f32x3(point));
            self.colours.push(colour);
            self.grown = true;
        }
    }

    /// Writes the points at the next frame, if some were added.
    fn end_row(&mut self, time: i64) {
        if !core::mem::take(&mut self.grown) {
            return;
        }
        self.rows.push(time, &self.positions, &self.colours);
        if self.positions.len() >= TRACE_SEGMENT {
            self.positions.clear();
            self.colours.clear();
            self.full.push(core::mem::take(&mut self.rows));
        }
    }

    fn send(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        let path = |segment| format!("{path}/{segment:03}");
        let radius = Radius::new_scene_units(0.004);
        for mut rows in self.full.drain(..) {
            rows.send(rec, &path(self.segment), radius)?;
            self.segment += 1;
        }
        self.rows.send(rec, &path(self.segment), radius)
    }
}

/// Places for labels around the mechanism in the view along the axis, each at the azimuth of what it
/// speaks of, none over another.
struct Around {
    eye: Eye,
    /// m.
    reach: f64,
    taken: Vec<[f64; 2]>,
}

impl Around {
    fn new(eye: Eye, reach: f64) -> Self {
        Self { eye, reach, taken: Vec::new() }
    }

    /// Point for the label of `point`, in `e3`, m.
    fn place(&mut self, point: DVec3) -> DVec3 {
        // A label is about so large in half heights of the view.
        const WIDTH: f64 = 0.62;
        const HEIGHT: f64 = 0.11;
        let [x, y] = self.eye.seen_at(point);
        let (sin, cos) = f64::atan2(y, x).sin_cos();
        let radius = self.reach / (HALF_HEIGHT * (self.eye.target - self.eye.position).length());
        let (x, mut y) = (cos * (radius + 0.16), sin * (radius + 0.16));
        let step = if y > 0.0 { -HEIGHT } else { HEIGHT };
        let hit = |x: f64, y: f64, t: &[f64; 2]| {
            (t[0] - x).abs() < WIDTH && (t[1] - y).abs() < 0.95 * HEIGHT
        };
        while self.taken.iter().any(|t| hit(x, y, t)) {
            y += step;
        }
        self.taken.push([x, y]);
        self.eye.point([x, y], 1.0)
    }
}

/// The free place nearest in height on the same side, or else on the other.
fn take_slot(slots: &mut [Slot], [x, y]: [f64; 2]) -> Option<usize> {
    let far = |s: &Slot| (s.seen_at[1] - y).abs() + if s.seen_at[0] * x < 0.0 { 2.0 } else { 0.0 };
    let free = slots.iter().enumerate().filter(|(_, s)| !s.taken);
    let (i, _) = free.min_by(|a, b| far(a.1).total_cmp(&far(b.1)))?;
    slots[i].taken = true;
    Some(i)
}

fn frame_error(time: SimTime, problems: Vec<String>) -> ViewError {
    ViewError::Frame { time_s: time.seconds(), problems }
}

/// "A1 · P ring": short enough for a label in the scene; petals have these names there.
fn short(name: &str) -> String {
    [("petal ", ""), ("active ring", "A ring"), ("passive ring", "P ring")]
        .iter()
        .fold(name.to_owned(), |n, (long, short)| n.replace(long, short))
        .replace("active ", "A")
        .replace("passive ", "P")
}

fn seconds(time: i64) -> f64 {
    let size = SimTime::from_nanos(time.unsigned_abs()).seconds();
    if time < 0 { -size } else { size }
}

/// Markdown: loads at the port and every pair that ever touched, the strongest first.
fn table(time: i64, order: &[&Pair], summary: &Summary) -> String {
    let count = |latch: bool| {
        let of_kind = |p: &&&Pair| p.places > 0 && (p.class == PairClass::Latch) == latch;
        order.iter().filter(of_kind).count()
    };
    let mut touch = match count(false) {
        0 => "no surfaces touch".to_owned(),
        1 => "1 pair of surfaces touches".to_owned(),
        n => format!("{n} pairs of surfaces touch"),
    };
    match count(true) {
        0 => {}
        1 => touch.push_str(", 1 latch holds"),
        n => {
            let _ = write!(touch, ", {n} latches hold");
        }
    }
    let mut t = format!("**At {:.3} s {touch}.** ", seconds(time));
    // Writing to a string cannot fail.
    for (name, force, moment) in [
        ("Between the sides", summary.between_force, summary.between_moment),
        ("At e3", summary.port_force, summary.port_moment),
    ] {
        let _ = write!(
            t,
            "{name}: {} (peak {} at {:.3} s), {:.0} N·m (peak {:.0} N·m at {:.3} s). ",
            style::newtons(force.now),
            style::newtons(force.peak),
            seconds(force.peak_time),
            moment.now,
            moment.peak,
            seconds(moment.peak_time),
        );
    }
    t.push_str("\n\n");
    if order.is_empty() {
        t.push_str("No contact so far.\n");
        return t;
    }
    t.push_str("| pair | now | friction | depth | peak | at |\n|---|---|---|---|---|---|\n");
    for p in order.iter().take(SUMMARY_ROWS) {
        let now = if p.places > 0 {
            let [force, friction] = [p.now_n, p.now_friction_n].map(style::newtons);
            if p.class == PairClass::Latch {
                format!("**{force}** | {friction} | –")
            } else {
                format!("**{force}** | {friction} | {:.2} mm", 1e3 * p.now_depth_m)
            }
        } else {
            "– | – | –".to_owned()
        };
        if let Some(k) = p.peak {
            let (peak, at) = (style::newtons(k.force_n), seconds(k.time));
            let _ = writeln!(t, "| {} | {now} | {peak} | {at:.3} s |", p.name);
        }
    }
    if order.len() > SUMMARY_ROWS {
        let _ = writeln!(t, "\nand {} weaker pairs.", order.len() - SUMMARY_ROWS);
    }
    t.push_str(
        "\nStrongest place of each pair, peaks over every tick. Arrows: force on the active side, \
         1 kN = 0.5 m; thin and pale: friction.\n",
    );
    t
}
