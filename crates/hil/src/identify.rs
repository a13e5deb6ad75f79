//! Identification of a rig by driving it through the rig port (§5, §6). Each step needs the result
//! of the one before: null bias at standstill, flow gain on a slow move, then the delay from time
//! stamps, then the frequency response at the amplitude of a contact.
//!
//! Bias and gain are looked for where there are valves, and the rig reports openings, lengths and forces; the
//! figures of the legs where it reports lengths. Delay and response need the plate's pose alone.

use core::f64::consts::TAU;

use docktwin_control::{
    excitation::{Cruise, Sine, along, displacement},
    feedforward::LegCorrections,
    harmonic::Harmonic,
    one_sided::{FrequencyPoint, Interface},
};
use docktwin_core::Pose;
use docktwin_model::SixAxisSensor;
use docktwin_physics::hydraulics::LegParameters;
use nalgebra::Complex;

use docktwin_rigport::{message::Capabilities, rig::Rig};

use crate::{
    clock::Clock,
    drive::{Drive, DriveError, Sample},
};

/// What is to be identified, and where.
#[derive(Clone, Debug)]
pub struct IdentifySetup {
    /// The legs as their controllers believe them to be; `None` where no oil moves them.
    pub legs: Option<[LegParameters; 6]>,
    /// Pose about which the rig is measured, `X_34`.
    pub place: Pose,
    /// Free way along X about the place, m: a slow move goes out and back. With a shorter way it is
    /// slower, and the flow gain is less accurate.
    pub room_m: f64,
    /// Degrees of freedom whose response is measured: X, Y, Z, roll, pitch, yaw as 0 to 5.
    pub dofs: Vec<usize>,
    /// Frequencies, Hz, 0.1 to 20.
    pub hz: Vec<f64>,
    /// A rotation counts as a displacement at this lever, m.
    pub lever_m: f64,
}

/// Natural frequencies of Table 4, the row at 5 Hz, and two above, Hz.
pub const FREQUENCIES_HZ: [f64; 9] = [0.235, 0.471, 0.941, 1.731, 2.308, 2.884, 5.0, 7.0, 10.0];

/// Amplitude of a contact of Table 4, m: the peak deflection of the rod, used as the amplitude of
/// the excitation; above them, what a rig of this size follows.
#[must_use]
pub fn contact_amplitude_m(hz: f64) -> f64 {
    if hz < 1.2 {
        6.0e-3
    } else if hz < 6.0 {
        3.5e-3
    } else {
        2.0e-3
    }
}

/// Why nothing was identified.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// The drive ended.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// No valve openings.
    #[error(
        "the rig says that it reports valve openings (capability bit 11), and they are 0 throughout: have the \
         rig fill them in, or clear the bit, and do without null bias and flow gain"
    )]
    NoSpool,
    /// Too few measurements.
    #[error("too few measurements came of a motion: see what delays the rig or the loop")]
    TooFew,
    /// A degree of freedom or frequency that does not exist.
    #[error(
        "degrees of freedom are 0 to 5, frequencies 0.1 to 20 Hz, the free way is above 5 mm: mend \
         the set-up"
    )]
    Setup,
}

/// Response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponsePoint {
    /// Degree of freedom that is driven, 0 to 5.
    pub dof: usize,
    /// Frequency, Hz.
    pub hz: f64,
    /// Amplitude of the excitation, m or rad.
    pub amplitude: f64,
    /// G_MSim: from the motion commanded for an instant to the motion at that instant.
    pub gain: Complex<f64>,
    /// Largest response of another degree of freedom, rotations at the lever.
    pub coupling: f64,
    /// Root mean square of what does not swing with the drive, over the amplitude's.
    pub rest: f64,
}

/// Standstill and slow move under some corrections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// The valves, where there are any and their openings are measured.
    pub valves: Option<ValvePass>,
    /// The legs, where their lengths are measured.
    pub legs: Option<LegPass>,
    /// Lag of the plate on the slow move, s.
    pub lag_s: f64,
}

/// What a pass finds of the valves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValvePass {
    /// Null bias of every valve, parts of full stroke.
    pub null_bias: [f64; 6],
    /// Flow gain of every valve over what its controller believes.
    pub flow_gain: [f64; 6],
    /// Sliding friction of every leg, N: half of what the oil pushes more on the way out than back.
    pub friction_n: [f64; 6],
}

/// What a pass finds of the legs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegPass {
    /// Length error at standstill, m, commanded less measured.
    pub hold_error_m: [f64; 6],
    /// Lag of every leg on the slow move, s; equal lags are delay, the rest is gain.
    pub lag_s: [f64; 6],
}

/// A rig as identified.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Without corrections: bias and gain are taken from here.
    pub found: Pass,
    /// With corrections: delay is taken from here; the rest says what is left.
    pub corrected: Pass,
    /// Speed with a valve fully open, as controllers believe it, m/s; where there are valves.
    pub no_load_speed_m_s: Option<[f64; 6]>,
    /// Where the response was measured, `X_34`.
    pub place: Pose,
    /// G_MSim.
    pub response: Vec<ResponsePoint>,
}

impl Identification {
    /// What undoes null bias and flow gain; nothing where none were found.
    #[must_use]
    pub fn corrections(&self) -> LegCorrections {
        corrections(&self.found, self.no_load_speed_m_s.as_ref())
    }

    /// From the instant a command is for to the instant the plate is there, s; negative when it is
    /// there earlier.
    #[must_use]
    pub const fn delay_s(&self) -> f64 {
        self.corrected.lag_s
    }

    /// G_I = G_MSim · G_FSensor of (8) along one degree of freedom; `sensor` with its delay as
    /// calibrated.
    #[must_use]
    pub fn interface(&self, dof: usize, sensor: &SixAxisSensor) -> Vec<FrequencyPoint> {
        let s = Interface::of_sensor(sensor);
        let of_dof = self.response.iter().filter(|p| p.dof == dof);
        of_dof.map(|p| FrequencyPoint { hz: p.hz, response: p.gain * s.at(p.hz) }).collect()
    }

    /// The lead that undoes the interface, s: its lag by phase in the middle of the band, mean of
    /// the degrees of freedom measured; without any, delay and sensor.
    #[must_use]
    pub fn lead_s(&self, sensor: &SixAxisSensor) -> f64 {
        let s = Interface::of_sensor(sensor);
        let lags: Vec<f64> = (0..6)
            .filter_map(|dof| {
                let points = self.interface(dof, sensor);
                let apart = |p: &FrequencyPoint| (p.hz / BAND_MIDDLE_HZ).ln().abs();
                let near = points.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
                Some(-near.response.arg() / (TAU * near.hz))
            })
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "six at most")]
        let n = lags.len() as f64;
        let lag =
            if lags.is_empty() { self.delay_s() + s.lag_s() } else { lags.iter().sum::<f64>() / n };
        lag.max(0.0)
    }
}

/// Middle of the fast rows of Table 4, Hz.
const BAND_MIDDLE_HZ: f64 = 2.308;

/// A response from gain and phase (rad).
#[must_use]
pub fn polar(gain: f64, phase_rad: f64) -> Complex<f64> {
    Complex::from_polar(gain, phase_rad)
}

fn corrections(p: &Pass, no_load_speed_m_s: Option<&[f64; 6]>) -> LegCorrections {
    let found = p.valves.zip(no_load_speed_m_s);
    found.map_or_else(LegCorrections::default, |(v, full)| LegCorrections {
        bias_m_s: core::array::from_fn(|i| v.null_bias[i] * v.flow_gain[i] * full[i]),
        flow_gain: v.flow_gain,
    })
}

/// Fastest slow move, m/s, its ramps and its steady part, s.
const CRUISE_M_S: f64 = 0.08;
const CRUISE_RAMP_S: f64 = 0.5;
const CRUISE_STEADY_S: f64 = 2.0;
/// What dies away after a change of motion, s.
const SETTLE_S: f64 = 0.5;
/// Rest before the standstill is looked at, and how long it is looked at, s.
const BEFORE_REST_S: f64 = 1.0;
const REST_S: f64 = 2.0;
/// Least time that a sine is looked at, s.
const SINE_S: f64 = 1.5;

/// Means over a motion, and its ends.
#[derive(Clone, Copy, Debug, Default)]
struct Means {
    n: f64,
    spool: [f64; 6],
    force_n: [f64; 6],
    leg_error_m: [f64; 6],
    error: f64,
    first: Option<(f64, [f64; 6])>,
    last: (f64, [f64; 6]),
}

impl Means {
    fn push(&mut self, s: &Sample, wanted_m: &[f64; 6], error: f64) {
        let m = &s.measurement;
        self.n += 1.0;
        for (i, wanted) in wanted_m.iter().enumerate() {
            self.spool[i] += m.valve_spool[i];
            self.force_n[i] += m.leg_force_n[i];
            self.leg_error_m[i] += wanted - m.leg_length_m[i];
        }
        self.error += error;
        self.first.get_or_insert((s.time_s, m.leg_length_m));
        self.last = (s.time_s, m.leg_length_m);
    }

    fn done(mut self) -> Result<Self, IdentifyError> {
        if self.n < 50.0 {
            return Err(IdentifyError::TooFew);
        }
        for x in self.spool.iter_mut().chain(&mut self.force_n).chain(&mut self.leg_error_m) {
            *x /= self.n;
        }
        self.error /= self.n;
        Ok(self)
    }

    /// Mean speeds of the legs between the ends, m/s.
    fn speeds_m_s(&self) -> [f64; 6] {
        let (t0, l0) = self.first.unwrap_or(self.last);
        let (t1, l1) = self.last;
        core::array::from_fn(|i| (l1[i] - l0[i]) / (t1 - t0))
    }
}

/// Leak of a leg as speed (m/s), and what its pressure leaves of the valve's flow.
fn leak_and_head(leg: &LegParameters, force_n: f64, direction: f64) -> (f64, f64) {
    let area = leg.oil.area_m2;
    let head = 1.0 - direction.signum() * force_n / (area * leg.valve.supply_pressure_pa);
    (force_n * leg.oil.leakage_m3_s_pa / (area * area), head.max(0.1).sqrt())
}

fn standstill<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &IdentifySetup,
) -> Result<Means, IdentifyError> {
    drive.go(&setup.place)?;
    drive.rest(BEFORE_REST_S, |_| ())?;
    let wanted = drive.platform().at(&drive.platform().plate_from_docking(&setup.place)).length_m;
    let mut means = Means::default();
    drive.rest(REST_S, |s| means.push(s, &wanted, 0.0))?;
    means.done()
}

/// The slow move along X.
fn cruise<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &IdentifySetup,
    speed: f64,
) -> Result<Means, IdentifyError> {
    let (ramp_s, steady_s) = (CRUISE_RAMP_S, CRUISE_STEADY_S);
    let mut c = Cruise { from: setup.place, dof: 0, speed, ramp_s, steady_s };
    c.from.p -= along(0, 0.5 * c.way()).v;
    drive.go(&c.from)?;
    let platform = drive.platform().clone();
    let mut means = Means::default();
    drive.run(
        c.duration_s(),
        |t| c.at(t),
        |s| {
            // Symmetric, so that both directions are measured in the same poses.
            if (ramp_s + SETTLE_S..=ramp_s + steady_s - SETTLE_S).contains(&s.time_s) {
                let x = c.at(s.time_s).x_34;
                let wanted = platform.at(&platform.plate_from_docking(&x)).length_m;
                means.push(s, &wanted, x.p.x - s.x_34.p.x);
            }
        },
    )?;
    means.done()
}

/// Standstill, both ways at full speed, both ways at half of it.
struct Moves {
    still: Means,
    ways: [Means; 2],
    slow: [Means; 2],
    speed: f64,
}

impl Moves {
    fn drive<R: Rig, K: Clock>(
        drive: &mut Drive<R, K>,
        setup: &IdentifySetup,
    ) -> Result<Self, IdentifyError> {
        let still = standstill(drive, setup)?;
        let speed = CRUISE_M_S.min(setup.room_m / (CRUISE_RAMP_S + CRUISE_STEADY_S));
        let ways = [cruise(drive, setup, speed)?, cruise(drive, setup, -speed)?];
        let slow = [cruise(drive, setup, 0.5 * speed)?, cruise(drive, setup, -0.5 * speed)?];
        Ok(Self { still, ways, slow, speed })
    }

    /// Friction holds the plate back by the same at both speeds, delay does not.
    fn lag_s(&self) -> f64 {
        let [ways, slow] = [&self.ways, &self.slow];
        (ways[0].error - ways[1].error - slow[0].error + slow[1].error) / self.speed
    }

    fn legs(&self) -> LegPass {
        let (ways, slow) = (&self.ways, &self.slow);
        let (speeds, slowly) = (ways.map(|m| m.speeds_m_s()), slow.map(|m| m.speeds_m_s()));
        let lag_s = core::array::from_fn(|i| {
            let apart = |m: &[Means; 2]| m[0].leg_error_m[i] - m[1].leg_error_m[i];
            let faster = speeds[0][i] - speeds[1][i] - slowly[0][i] + slowly[1][i];
            (apart(ways) - apart(slow)) / faster
        });
        LegPass { hold_error_m: self.still.leg_error_m, lag_s }
    }

    fn valves(&self, legs: &[LegParameters; 6]) -> Result<ValvePass, IdentifyError> {
        let (still, ways) = (&self.still, &self.ways);
        if [still, &ways[0], &ways[1]].iter().all(|m| m.spool.iter().all(|x| *x == 0.0)) {
            return Err(IdentifyError::NoSpool);
        }
        let speeds = ways.map(|m| m.speeds_m_s());
        let mut out = ValvePass { null_bias: [0.0; 6], flow_gain: [0.0; 6], friction_n: [0.0; 6] };
        for (i, leg) in legs.iter().enumerate() {
            let full = leg.no_load_speed_m_s();
            // Nothing moves: what passes the valve leaks.
            let (leak, head) = leak_and_head(leg, still.force_n[i], still.spool[i]);
            let bias = leak / (full * head) - still.spool[i];
            let gain = |k: usize| {
                let opening = ways[k].spool[i] + bias;
                let (leak, head) = leak_and_head(leg, ways[k].force_n[i], opening);
                (speeds[k][i] + leak) / (full * head * opening)
            };
            out.null_bias[i] = bias;
            out.flow_gain[i] = 0.5 * (gain(0) + gain(1));
            out.friction_n[i] = 0.5
                * (ways[0].force_n[i] - ways[1].force_n[i])
                * (speeds[0][i] - speeds[1][i]).signum();
        }
        Ok(out)
    }
}

/// A pass; `legs` are those whose valves are looked at.
fn pass<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &IdentifySetup,
    legs: Option<&[LegParameters; 6]>,
) -> Result<Pass, IdentifyError> {
    let moves = Moves::drive(drive, setup)?;
    let lengths = drive.capabilities().contains(Capabilities::LEG_LENGTH);
    Ok(Pass {
        valves: legs.map(|legs| moves.valves(legs)).transpose()?,
        legs: lengths.then(|| moves.legs()),
        lag_s: moves.lag_s(),
    })
}

fn response<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &IdentifySetup,
    dof: usize,
    hz: f64,
) -> Result<ResponsePoint, IdentifyError> {
    let lever = |i: usize| if i < 3 { 1.0 } else { setup.lever_m };
    let amplitude = contact_amplitude_m(hz) / lever(dof);
    let periods = (SINE_S * hz).ceil().max(1.0);
    let steady_s = SETTLE_S + periods / hz;
    let sine = Sine { about: setup.place, dof, amplitude, hz, ramp_s: 0.5, steady_s };
    let window = sine.ramp_s + SETTLE_S..sine.ramp_s + steady_s;
    let mut h = Harmonic::<6>::new(TAU * hz, 1);
    drive.run(
        sine.duration_s(),
        |t| sine.at(t),
        |s| {
            if window.contains(&s.time_s) {
                h.push(s.time_s, &displacement(&setup.place, &s.x_34));
            }
        },
    )?;
    drive.rest(SETTLE_S, |_| ())?;
    let found = h.found().ok_or(IdentifyError::TooFew)?;
    // The drive is a sine: Im, that is Re of −j.
    let per_drive = found.amplitude[0].map(|x| x / Complex::new(0.0, -amplitude));
    let others = (0..6).filter(|i| *i != dof);
    let coupling = others.map(|i| per_drive[i].norm() * lever(i) / lever(dof)).fold(0.0, f64::max);
    let rest = found.rest[dof] * core::f64::consts::SQRT_2 / amplitude;
    Ok(ResponsePoint { dof, hz, amplitude, gain: per_drive[dof], coupling, rest })
}

/// Drives the rig through everything and leaves it at the place.
///
/// # Errors
/// See [`IdentifyError`].
pub fn identify<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &IdentifySetup,
) -> Result<Identification, IdentifyError> {
    let band = 0.1..=20.0;
    if setup.dofs.iter().any(|d| *d > 5)
        || setup.hz.iter().any(|f| !band.contains(f))
        || setup.room_m.is_nan()
        || setup.room_m < 5e-3
    {
        return Err(IdentifyError::Setup);
    }
    let needed = Capabilities::VALVE_SPOOL | Capabilities::LEG_LENGTH | Capabilities::LEG_FORCE;
    let valves = setup.legs.as_ref().filter(|_| drive.capabilities().contains(needed));
    drive.correct(LegCorrections::default());
    let no_load_speed_m_s = valves.map(|legs| legs.map(|l| l.no_load_speed_m_s()));
    let found = pass(drive, setup, valves)?;
    // Without valves nothing is corrected, and a second pass would tell the same.
    let corrected = if valves.is_some() {
        drive.correct(corrections(&found, no_load_speed_m_s.as_ref()));
        pass(drive, setup, valves)?
    } else {
        found
    };
    drive.go(&setup.place)?;
    drive.rest(SETTLE_S, |_| ())?;
    let mut points = Vec::new();
    for dof in &setup.dofs {
        for hz in &setup.hz {
            points.push(response(drive, setup, *dof, *hz)?);
        }
    }
    let place = setup.place;
    Ok(Identification { found, corrected, no_load_speed_m_s, place, response: points })
}
