//! The validation test of the paper, §7.4: a spring stick between two stops, run through the body
//! programme in six degrees of freedom and the whole loop, and what Table 4 asks of it.

use core::time::Duration;

use docktwin_control::{compensation::Compensation, safety::Trip, sensing::SensorScheme};
use docktwin_core::{DMat3, DVec3, PERIOD_NS, Pose};
use docktwin_hil::{
    clock::Clock,
    scheduler::{ArmError, Idle, Loop, LoopSetup, RigParameters, SetupProblems, TickRecord},
};
use docktwin_model::{DockingMechanism, HydraulicPreset, Rig as RigModel, Spacecraft};
use docktwin_physics::{
    body::BodyState,
    mechanism::{CHASER, RING, System, TARGET},
    reduced::Inputs,
};
use docktwin_rigport::{
    message::Capabilities,
    rig::{Rig, RigError},
};

/// One row of Table 4, or the one at 5 Hz that the paper does not have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Natural frequency as printed, Hz.
    pub frequency_hz: f64,
    /// Nominal length of the stick as printed, m.
    pub length_m: f64,
    /// Stiffness of the stick, N/m.
    pub stiffness_n_m: f64,
    /// m1 = m2 as printed, kg.
    pub mass_kg: f64,
    /// Approach speed v0, m/s; not printed, from the strength of the rod.
    pub speed_m_s: f64,
    /// R_e and R_T of the paper in X and in Y.
    pub paper: Option<[[f64; 2]; 2]>,
}

const fn row(
    frequency_hz: f64,
    long: bool,
    mass_kg: f64,
    speed_m_s: f64,
    paper: Option<[[f64; 2]; 2]>,
) -> Row {
    let (length_m, stiffness_n_m) = if long { (0.140, 35.4e3) } else { (0.100, 94.4e3) };
    Row { frequency_hz, length_m, stiffness_n_m, mass_kg, speed_m_s, paper }
}

/// Table 4 and a seventh row at 5 Hz.
pub const TABLE_4: [Row; 7] = [
    row(0.235, true, 32423.0, 0.0089, Some([[0.985, 1.005], [0.9725, 1.019]])),
    row(0.471, true, 8106.0, 0.0178, Some([[0.987, 1.007], [0.973, 1.019]])),
    row(0.941, true, 2026.0, 0.0355, Some([[0.95, 0.988], [0.96, 1.016]])),
    row(1.731, false, 1597.0, 0.038, Some([[0.992, 0.975], [0.96, 1.051]])),
    row(2.308, false, 898.0, 0.051, Some([[0.99, 1.034], [0.95, 1.045]])),
    row(2.884, false, 575.0, 0.063, Some([[0.975, 1.005], [0.983, 1.032]])),
    row(5.0, false, 191.3, 0.11, None),
];

/// A degree of freedom of `X_34`: X, Y, Z, roll, pitch, yaw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis(usize);

impl Axis {
    /// All six, by name.
    pub const ALL: [(&'static str, Self); 6] = [
        ("x", Self(0)),
        ("y", Self(1)),
        ("z", Self(2)),
        ("roll", Self(3)),
        ("pitch", Self(4)),
        ("yaw", Self(5)),
    ];

    /// Name as on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::ALL[self.0].0
    }

    /// 0 to 5 for X, Y, Z, roll, pitch, yaw.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0
    }

    /// True for a rotation.
    #[must_use]
    pub const fn turns(self) -> bool {
        self.0 > 2
    }

    /// Its unit vector in `e3`.
    #[must_use]
    pub fn unit(self) -> DVec3 {
        [DVec3::X, DVec3::Y, DVec3::Z][self.0 % 3]
    }

    /// Coordinate of a pose counted from the middle of the stick's frame, m; rotations at `lever_m`.
    #[must_use]
    pub fn of_pose(self, x_34: &Pose, docked_m: f64, lever_m: f64) -> f64 {
        if self.turns() {
            x_34.q.to_scaled_axis().dot(self.unit()) * lever_m
        } else {
            (x_34.p - DVec3::X * docked_m).dot(self.unit())
        }
    }
}

/// A test: a row, the axes that move, and the speed along each as part of the row's.
#[derive(Clone, Debug)]
pub struct VibroTest {
    /// The row.
    pub row: Row,
    /// The axis that is judged.
    pub axis: Axis,
    /// Spacecraft and stick.
    pub system: System,
    /// The same as the loop believes it.
    pub believed: System,
    /// The spacecraft in the middle of the frame, moving.
    pub bodies: [BodyState; 3],
    spacecraft: [Spacecraft; 2],
    docked_m: f64,
    lever_m: f64,
    play_m: f64,
}

impl VibroTest {
    /// A row along one axis, or along several at once (then the first is judged). `mechanism` has the
    /// stick; `spacecraft` gives everything but mass and inertia, its port at the mass centre.
    ///
    /// `None` when the mechanism has no stick.
    #[must_use]
    pub fn new(
        row: Row,
        axes: &[Axis],
        spacecraft: &Spacecraft,
        mechanism: &DockingMechanism,
    ) -> Option<Self> {
        let mut mechanism = mechanism.clone();
        let stick = mechanism.stick.as_mut()?;
        stick.stiffness_n_m = row.stiffness_n_m;
        let (lever_m, play_m) = (stick.lever_m, stick.play_m());
        let docked_m = mechanism.docked_length_m();
        let mut body = spacecraft.clone();
        body.mass_kg = row.mass_kg;
        let inertia = row.mass_kg * lever_m * lever_m;
        body.inertia_kg_m2 = DMat3::from_diagonal(DVec3::splat(inertia));
        // Both mass centres in the middle of the frame: a force there turns neither.
        let mut chaser = body.clone();
        chaser.x_body_port = Pose::from_translation(DVec3::X * -docked_m);
        body.x_body_port = Pose::IDENTITY;
        let system = System::new(&chaser, &body, mechanism);
        // Both move, so that their common mass centre rests.
        let half = 0.5 * row.speed_m_s;
        let (mut v, mut w) = (DVec3::ZERO, DVec3::ZERO);
        for a in axes {
            if a.turns() { w += a.unit() * (half / lever_m) } else { v += a.unit() * half }
        }
        let at = |i: usize, sign: f64| {
            BodyState::new(&system.mass()[i], Pose::IDENTITY, v * sign, w * sign)
        };
        let mut bodies = [at(CHASER, -1.0), at(RING, 0.0), at(TARGET, 1.0)];
        system.follow(&mut bodies);
        let axis = *axes.first()?;
        let believed = system.clone();
        let spacecraft = [chaser, body];
        Some(Self { row, axis, system, believed, bodies, spacecraft, docked_m, lever_m, play_m })
    }

    /// The same test with a stick that the loop does not know: `stiffness` times as stiff, and with `play_m` more
    /// play to either side. It is judged by what it has.
    #[must_use]
    pub fn with_stick(&self, stiffness: f64, play_m: f64) -> Self {
        let mut out = self.clone();
        let mut mechanism = self.system.mechanism().clone();
        if let Some(stick) = &mut mechanism.stick {
            stick.stiffness_n_m *= stiffness;
            stick.frame_opening_m += 2.0 * play_m;
            out.row.stiffness_n_m = stick.stiffness_n_m;
            out.play_m = stick.play_m();
            let [chaser, target] = &self.spacecraft;
            out.system = System::new(chaser, target, mechanism);
        }
        out
    }

    /// Free flight that may lead to the start: the stick stays clear of its frame, s.
    #[must_use]
    pub fn run_up_s(&self) -> f64 {
        2.0 * 0.8 * self.play_m / self.row.speed_m_s
    }

    /// T_v of (17), s.
    #[must_use]
    pub fn contact_time_s(&self) -> f64 {
        core::f64::consts::PI / self.rate_rad_s()
    }

    /// Natural rate of the contact, rad/s.
    #[must_use]
    pub fn rate_rad_s(&self) -> f64 {
        (2.0 * self.row.stiffness_n_m / self.row.mass_kg).sqrt()
    }

    /// Time for `contacts` contacts and the flight after the last one, s.
    #[must_use]
    pub fn duration_s(&self, contacts: u32) -> f64 {
        let flight = 2.0 * self.play_m / self.row.speed_m_s;
        (0.9 * flight + 1.1 * self.contact_time_s()) * f64::from(contacts) + 0.1 * flight
    }

    /// What a tick says of the axis that is judged.
    #[must_use]
    pub fn sample(&self, r: &TickRecord, time_s: f64) -> Sample {
        let axis = self.axis;
        let m = &r.measurement;
        let arm = if axis.turns() { 1.0 / self.lever_m } else { 1.0 };
        let along = |w: &[f64; 6]| {
            let k = if axis.turns() { 3 } else { 0 };
            DVec3::new(w[k], w[k + 1], w[k + 2]).dot(axis.unit()) * arm
        };
        let sensed = if axis.turns() { r.ports.port4.m } else { r.ports.port4.f };
        let [b1, b2] = &r.bodies;
        let mass = self.system.mass();
        let speed = if axis.turns() {
            let rate = b2.rate_world(&mass[TARGET]) - b1.rate_world(&mass[CHASER]);
            (b1.q.conjugate() * rate).dot(axis.unit()) * self.lever_m
        } else {
            (b1.q.conjugate() * (b2.v - b1.v)).dot(axis.unit())
        };
        let [x_13, x_24] = self.system.ports();
        let x_34 = (b1.pose() * x_13).inverse() * b2.pose() * x_24;
        Sample {
            time_s,
            body_m: axis.of_pose(&x_34, self.docked_m, self.lever_m),
            speed_m_s: speed,
            measured_m: axis.of_pose(&r.x_34, self.docked_m, self.lever_m),
            true_force_n: m.has(Capabilities::TRUTH).then(|| along(&m.truth_port4)),
            sensed_force_n: sensed.dot(axis.unit()) * arm,
        }
    }

    /// Judges the contacts of a run.
    #[must_use]
    pub fn judge(&self, samples: &[Sample]) -> Vec<Contact> {
        let mut out = Vec::new();
        let mut from = 0;
        while let Some(c) = self.contact(samples, from) {
            from = c.1;
            out.push(c.0);
        }
        out
    }

    /// The first contact that begins and ends behind `from`, and the place after it.
    fn contact(&self, samples: &[Sample], from: usize) -> Option<(Contact, usize)> {
        let force = |s: &Sample| s.true_force_n.unwrap_or(s.sensed_force_n);
        let peak = self.row.speed_m_s * (0.5 * self.row.mass_kg * self.row.stiffness_n_m).sqrt();
        let level = 0.02 * peak;
        let begin = from + samples[from..].iter().position(|s| force(s).abs() > level)?;
        let sign = -force(&samples[begin]).signum();
        let end = begin + samples[begin..].iter().position(|s| force(s) * -sign < level)?;
        // Free flight on both sides, away from the edges.
        let flight = 2.0 * self.play_m / self.row.speed_m_s;
        let (t0, t1) = (samples[begin].time_s, samples[end].time_s);
        let mean = |a: f64, b: f64| {
            let within: Vec<f64> = samples
                .iter()
                .filter(|s| s.time_s >= a && s.time_s <= b)
                .map(|s| s.speed_m_s)
                .collect();
            #[expect(clippy::cast_precision_loss, reason = "ticks")]
            let n = within.len() as f64;
            (n > 0.0).then(|| within.iter().sum::<f64>() / n)
        };
        let v0 = mean(t0 - 0.25 * flight, t0 - 0.02)?;
        if samples.last()?.time_s < t1 + 0.25 * flight {
            return None;
        }
        let v1 = mean(t1 + 0.03, t1 + 0.25 * flight)?;
        let edges =
            |read: &dyn Fn(&Sample) -> f64| Self::edges(samples, begin, end, sign, level, read);
        let (onset, true_s) = edges(&|s| force(s))?;
        let (_, sensed_s) = edges(&|s| s.sensed_force_n)?;
        let w = self.rate_rad_s();
        let (k, v) = (self.row.stiffness_n_m, v0.abs());
        let m_r = 0.5 * self.row.mass_kg;
        let want_peak = v * (k * m_r).sqrt();
        let t_v = self.contact_time_s();
        let (mut ef, mut ex, mut rf, mut rx, mut top) = (0.0, 0.0, 0.0, 0.0, 0.0_f64);
        for s in &samples[begin.saturating_sub(2)..(end + 2).min(samples.len())] {
            let t = s.time_s - onset;
            let (f, x) = if (0.0..=t_v).contains(&t) {
                (want_peak * (w * t).sin(), v / w * (w * t).sin())
            } else if t < 0.0 {
                (0.0, v * t)
            } else {
                (0.0, -v * (t - t_v))
            };
            let got_f = force(s) * -sign;
            // For the hardware the position is where the rod is.
            let got_x = s.measured_m * sign - self.play_m;
            ef += (got_f - f).powi(2);
            ex += (got_x - x).powi(2);
            rf += f * f;
            rx += x * x;
            top = top.max(got_f);
        }
        let r_e = (v1 / v0).abs();
        Some((
            Contact {
                begin_s: onset,
                v0_m_s: v0,
                v1_m_s: v1,
                r_e,
                r_t: true_s / t_v,
                r_t_sensed: sensed_s / t_v,
                peak_ratio: top / want_peak,
                nrms_force: (ef / rf).sqrt(),
                nrms_position: (ex / rx).sqrt(),
                delta_energy: r_e * r_e - 1.0,
            },
            end,
        ))
    }

    /// Onset and duration of a contact, s: crossings of `level`, carried on to zero as a half sine.
    fn edges(
        samples: &[Sample],
        begin: usize,
        end: usize,
        sign: f64,
        level: f64,
        read: &dyn Fn(&Sample) -> f64,
    ) -> Option<(f64, f64)> {
        let at = |i: usize| -> Option<(f64, f64)> {
            samples.get(i).map(|s| (s.time_s, read(s) * -sign))
        };
        let crossing = |i: usize| {
            let ((ta, a), (tb, b)) = (at(i.checked_sub(1)?)?, at(i)?);
            Some(ta + (tb - ta) * (level - a) / (b - a))
        };
        // A sensor comes later than the truth.
        let rise = (begin.saturating_sub(1)..end).find(|i| at(*i).is_some_and(|x| x.1 > level))?;
        let fall = (end.saturating_sub(20).max(rise)..end + 50)
            .find(|i| at(*i).is_some_and(|x| x.1 < level))?;
        let top = (rise..fall).filter_map(&at).map(|x| x.1).fold(0.0, f64::max);
        let (t0, t1) = (crossing(rise)?, crossing(fall)?);
        // Half a sine from zero to zero: the level is reached after asin(level/top)/π of it.
        let part = (level / top).asin() / core::f64::consts::PI;
        let whole = (t1 - t0) / (1.0 - 2.0 * part);
        Some((t0 - part * whole, whole))
    }
}

/// How a test is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VibroSettings {
    /// Oil of the rig that the loop believes in.
    pub preset: HydraulicPreset,
    /// What is believed of it besides; `None` as its file says.
    pub parameters: Option<RigParameters>,
    /// Against the delay.
    pub compensation: Compensation,
    /// Where F4, M4 come from.
    pub scheme: SensorScheme,
    /// Contacts to run through, at least 1.
    pub contacts: u32,
    /// Ticks by which every command is held back.
    pub added_ticks: usize,
    /// Number of the run at the port.
    pub session: u64,
    /// How long to wait for a measurement.
    pub patience: Duration,
}

/// What a run came to.
#[derive(Clone, Debug, PartialEq)]
pub struct VibroRun {
    /// The closed loop, tick by tick.
    pub samples: Vec<Sample>,
    /// The contacts that began and ended in it.
    pub contacts: Vec<Contact>,
    /// The limit that ended it, if one did.
    pub trip: Option<Trip>,
}

impl VibroTest {
    /// The loop of this test.
    ///
    /// # Errors
    /// What of the settings cannot be run.
    pub fn setup(&self, rig: &RigModel, s: &VibroSettings) -> Result<LoopSetup, SetupProblems> {
        #[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
        let tick_s = PERIOD_NS as f64 * 1e-9;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
        let ticks = (self.duration_s(s.contacts) / tick_s) as u64;
        let parameters = s.parameters.unwrap_or_else(|| RigParameters::new(rig, None, None));
        LoopSetup::builder(rig, s.preset, &self.believed, &self.bodies)
            .parameters(parameters)
            .compensation(s.compensation)
            .added_ticks(s.added_ticks)
            .sensors(s.scheme)
            .loads(Some(LOAD_LIMIT), Some(LOAD_LIMIT))
            .run_up_s(self.run_up_s())
            .ticks(ticks)
            .session(s.session)
            .patience(s.patience)
            .build()
    }

    /// Arms a loop made of [`VibroTest::setup`] and runs it to its end; `look` sees every tick.
    ///
    /// # Errors
    /// The loop is not armed, or the rig does not answer any more.
    pub fn run<R: Rig, K: Clock>(
        &self,
        idle: Loop<R, K, Idle>,
        mut look: impl FnMut(&TickRecord),
    ) -> Result<VibroRun, VibroError> {
        let mut running = idle.arm(Vec::new())?.start();
        // Reserved in advance: no allocation in the real-time loop.
        #[expect(clippy::cast_possible_truncation, reason = "minutes at 1 kHz")]
        let mut samples = Vec::with_capacity(running.setup().ticks as usize);
        while !running.finished() {
            let r = running.tick(&Inputs::default())?;
            look(&r);
            if let Some(k) = r.closed_tick {
                #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 ticks")]
                samples.push(self.sample(&r, (k * PERIOD_NS) as f64 * 1e-9));
            }
        }
        let trip = running.stop().end().trip;
        Ok(VibroRun { contacts: self.judge(&samples), samples, trip })
    }
}

/// Load at which the supervisor stops a test, N and N·m. (A real rod is bent permanently at 340 N.)
const LOAD_LIMIT: f64 = 2000.0;

/// Why a test was not run to its end.
#[derive(Debug, thiserror::Error)]
pub enum VibroError {
    /// The settings cannot be run.
    #[error(transparent)]
    Setup(#[from] SetupProblems),
    /// Not armed.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The rig does not answer.
    #[error(transparent)]
    Rig(#[from] RigError),
}

/// One tick of the axis that is judged; rotations at the lever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time since the loop was closed, s.
    pub time_s: f64,
    /// Relative position of the bodies, m from the middle of the frame.
    pub body_m: f64,
    /// Relative speed of the bodies, m/s.
    pub speed_m_s: f64,
    /// Relative position of the mechanisms, measured, m.
    pub measured_m: f64,
    /// True contact force on the target, N; emulated rigs only.
    pub true_force_n: Option<f64>,
    /// The same from the sensors, N.
    pub sensed_force_n: f64,
}

/// One contact as Table 4 judges it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Onset, s.
    pub begin_s: f64,
    /// Speeds before and after, of the body programme, m/s.
    pub v0_m_s: f64,
    /// See `v0_m_s`.
    pub v1_m_s: f64,
    /// (19).
    pub r_e: f64,
    /// (18), T_h from the true force, or from the sensed one where there is no other.
    pub r_t: f64,
    /// (18), T_h from the sensed force.
    pub r_t_sensed: f64,
    /// Peak force over that of the simulated system.
    pub peak_ratio: f64,
    /// RMS error of the force over RMS of the simulated system's, aligned at the onset.
    pub nrms_force: f64,
    /// The same of the position of the rod's end beyond the play.
    pub nrms_position: f64,
    /// ΔE/E0.
    pub delta_energy: f64,
}
