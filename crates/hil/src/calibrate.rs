//! What the force sensors carry, where their zeros are and how late they are, found by motions in which
//! nothing touches (§5).
//!
//! Tilts to all sides turn the weight and part it from the zero; sines along and about all axes bring
//! in inertia. A sine is looked at by what swings with it in readings and in the measured motion of
//! the plate, so no acceleration is differentiated sample by sample, and zero and drift fall out.
//! Mass, mass centre and inertia enter the wrench linearly; the time by which the reading is later
//! than the motion turns its phase, and all sines together give one time.
//!
//! Sensor A stands still and measures no motion. Its lateness is found in a touch: a light stick in its frame, on the
//! third harmonic of a sine that strikes both ends, against the deflection of the stick, which follows from the measured
//! positions.

use core::f64::consts::TAU;

use docktwin_control::{
    excitation::{Sine, along, displacement},
    harmonic::Harmonic,
    one_sided::Interface,
    sensing::{put_back, taken_off},
};
use docktwin_core::{DMat3, DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{RigSensors, SixAxisSensor};
use docktwin_physics::mounted::{Carried, Payload};
use docktwin_rigport::{
    message::{Capabilities, six, wrench},
    rig::Rig,
};
use nalgebra::{Complex, DMatrix, DVector, SVector};

use crate::{
    clock::Clock,
    drive::{Drive, DriveError, Sample},
};

type C = Complex<f64>;
/// Mass, mass times mass centre, inertia about the sensor (xx, yy, zz, xy, xz, yz), zero of B.
const UNKNOWNS: usize = 16;
type Row = SVector<f64, UNKNOWNS>;

/// How the rig is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateSetup {
    /// The sensors as the rig's file says.
    pub sensors: RigSensors,
    /// Where it is moved about, `X_34`.
    pub place: Pose,
    /// Tilt in pitch and in yaw, each way, rad.
    pub tilt_rad: f64,
    /// Frequency of the sines, Hz, 0.5 to 10.
    pub hz: f64,
    /// Their amplitudes along the axes, m, and about them, rad.
    pub amplitude: [f64; 2],
    /// A touch that also finds the lateness of sensor A; needs a light stick in its frame.
    pub touch: Option<Touch>,
}

/// A sine that strikes the frame of the stick at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Degree of freedom, 0 to 2.
    pub dof: usize,
    /// Amplitude, m: beyond the play.
    pub amplitude_m: f64,
    /// Frequency, Hz.
    pub hz: f64,
    /// Free play of the stick to either side, m.
    pub play_m: f64,
}

impl CalibrateSetup {
    /// About a place, 0.08 rad of tilt, sines of 6 mm and 6 mrad at 3 Hz, no touch.
    #[must_use]
    pub const fn at(place: Pose, sensors: RigSensors) -> Self {
        Self { sensors, place, tilt_rad: 0.08, hz: 3.0, amplitude: [6e-3, 6e-3], touch: None }
    }
}

/// Why nothing was calibrated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    /// The drive ended.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// There is no sensor A.
    #[error("the rig has no sensor A (capability bit 12), and nothing to calibrate without it")]
    NoSensor,
    /// There is no sensor B, and no touch.
    #[error(
        "the rig has no sensor B (capability bit 13), so that how late A is can be found alone: take a light stick and \
         touch its frame (--touch-mm), or go without a calibration, a run takes its own tare"
    )]
    NothingToFind,
    /// Too few measurements.
    #[error("too few measurements came of a motion: see what delays the rig or the loop")]
    TooFew,
    /// The readings do not follow the motion.
    #[error(
        "sensor B does not measure the motion of the plate: see that it is alive and carries something"
    )]
    Blind,
    /// The accelerometers do not.
    #[error(
        "axis {axis} of the accelerometers reads {gain:.2} times the motion of the plate: see their axes, \
         signs and units"
    )]
    Accelerometer {
        /// 0 to 2 along X, Y, Z, 3 to 5 about them.
        axis: usize,
        /// Reading over motion.
        gain: f64,
    },
    /// The touch was none.
    #[error("the touch was not measured by sensor A: take a larger amplitude, or see the stick")]
    NoTouch,
}

/// The force sensors as calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Where, `X_34`.
    pub place: Pose,
    /// Reading of A with nothing touching: zero and weight of what it carries.
    pub tare_a: Wrench,
    /// From the instant of a position sample to that of a sample of A of the same stamp, s, beyond the second order of
    /// the file: the delay of the sensor's chain. Only after a touch.
    pub delay_a_s: Option<f64>,
    /// Sensor B, where there is one.
    pub of_b: Option<SensorB>,
    /// Delay of the accelerometers, where the rig has them.
    pub accelerometer_delay_s: Option<f64>,
}

/// Sensor B as calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorB {
    /// Its reading without what it carries.
    pub zero: Wrench,
    /// What it carries, seen from it.
    pub payload: Payload,
    /// As [`Calibration::delay_a_s`].
    pub delay_s: f64,
    /// Root mean square of what swings with the sines and is not explained, N and N·m.
    pub rest: [f64; 2],
}

impl Calibration {
    /// The file's sensor (0: A, 1: B) with its delay as calibrated; as the file says without one.
    #[must_use]
    pub fn sensor(&self, which: usize, file: &SixAxisSensor) -> SixAxisSensor {
        let found = if which == 0 { self.delay_a_s } else { self.of_b.map(|b| b.delay_s) };
        let delay_s = found.unwrap_or(file.delay_s);
        SixAxisSensor { delay_s, ..*file }
    }

    /// Lag of sensor B less that of the accelerometers, s; by the file where nothing was calibrated.
    #[must_use]
    pub fn accelerometers_ahead_s(&self, file: &RigSensors) -> f64 {
        accelerometers_ahead_s(&RigSensors {
            force: self.sensor(1, &file.force),
            accelerometer: file.accelerometer.map(|a| SixAxisSensor {
                delay_s: self.accelerometer_delay_s.unwrap_or(a.delay_s),
                ..a
            }),
            ..*file
        })
    }

    /// Lateness of a slow force in the readings of a sensor, s.
    #[must_use]
    pub fn lag_s(&self, which: usize, file: &SixAxisSensor) -> f64 {
        Interface::of_sensor(&self.sensor(which, file)).lag_s()
    }
}

/// Lag of sensor B less that of the accelerometers as the rig's file says, s.
#[must_use]
pub fn accelerometers_ahead_s(file: &RigSensors) -> f64 {
    file.accelerometer.map_or(0.0, |a| {
        Interface::of_sensor(&file.force).lag_s() - Interface::of_sensor(&a).lag_s()
    })
}

/// What swings in a sine: displacement of the plate, readings of B.
#[derive(Clone, Copy, Debug)]
struct Swing {
    rate_rad_s: f64,
    motion: [C; 6],
    b: [C; 6],
    /// Accelerometers, where there are any.
    accelerations: Option<[C; 6]>,
}

const SETTLE_S: f64 = 0.5;
const REST_S: f64 = 1.0;
/// Time at which a sine is looked at, s.
const SINE_S: f64 = 4.0;
/// Multiples of a sine that are separated.
const MULTIPLES: usize = 5;
/// Rounds in which lateness and masses settle on each other.
const ROUNDS: u32 = 8;

/// The wrench that a payload makes, by unknowns: gravity and acceleration of the sensor in its axes.
/// What goes with the square of angular velocity swings twice as fast and is left out.
fn rows(gravity: DVec3, acceleration: &Twist, zero: f64) -> [Row; 6] {
    let mut out = [Row::zeros(); 6];
    let (g, alpha) = (gravity - acceleration.v, acceleration.w);
    let mut put = |unknown: usize, w: Wrench| {
        for (row, x) in out.iter_mut().zip(six(w.f, w.m)) {
            row[unknown] = x;
        }
    };
    put(0, Wrench { f: g, m: DVec3::ZERO });
    for (i, e) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        put(1 + i, Wrench { f: -alpha.cross(e), m: e.cross(g) });
        put(10 + i, Wrench { f: e * zero, m: DVec3::ZERO });
        put(13 + i, Wrench { f: DVec3::ZERO, m: e * zero });
    }
    let a = alpha.to_array();
    for (k, (i, j)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
        let mut m = [0.0; 3];
        m[i] -= a[j];
        if i != j {
            m[j] -= a[i];
        }
        put(4 + k, Wrench { f: DVec3::ZERO, m: DVec3::from_array(m) });
    }
    out
}

impl Swing {
    /// What swings of gravity and motion at sensor B, in its axes: real and imaginary part.
    fn carried(&self, q_34: DQuat, gravity_4: DVec3) -> [Carried; 2] {
        let w2 = self.rate_rad_s * self.rate_rad_s;
        [false, true].map(|im| {
            let x = self.motion.map(|c| if im { c.im } else { c.re });
            let p = q_34.conjugate() * DVec3::new(x[0], x[1], x[2]);
            let turn = q_34.conjugate() * DVec3::new(x[3], x[4], x[5]);
            let acceleration = Twist { v: p * -w2, w: turn * -w2 };
            // Turning the sensor turns gravity back in its axes.
            Carried { gravity: gravity_4.cross(turn), acceleration, ..Carried::default() }
        })
    }
}

/// The rows of what swings.
fn swing_rows(s: &Swing, q_34: DQuat, gravity_4: DVec3) -> [[Row; 6]; 2] {
    s.carried(q_34, gravity_4).map(|c| rows(c.gravity, &c.acceleration, 0.0))
}

fn swing<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    place: &Pose,
    sine: &Sine,
    off: [f64; 2],
) -> Result<Swing, CalibrateError> {
    let mut h = Harmonic::<18>::new(TAU * sine.hz, MULTIPLES);
    let mut measured = true;
    let window = sine.ramp_s + SETTLE_S..sine.ramp_s + sine.steady_s;
    drive.run(
        sine.duration_s(),
        |t| sine.at(t),
        |s| {
            if window.contains(&s.time_s) {
                let mut x = [0.0; 18];
                x[..6].copy_from_slice(&displacement(place, &s.x_34));
                let felt = put_back(&wrench(&s.measurement.sensor_b), off);
                x[6..12].copy_from_slice(&six(felt.f, felt.m));
                x[12..].copy_from_slice(&s.measurement.plate_acceleration);
                measured &= s.measurement.has(Capabilities::ACCELEROMETER);
                h.push(s.time_s, &x);
            }
        },
    )?;
    drive.rest(SETTLE_S, |_| ())?;
    let x = h.found().ok_or(CalibrateError::TooFew)?.amplitude[0];
    let take = |from: usize| core::array::from_fn(|i| x[from + i]);
    let accelerations = measured.then(|| take(12));
    Ok(Swing { rate_rad_s: TAU * sine.hz, motion: take(0), b: take(6), accelerations })
}

/// Means at rest: readings of A and B, and `X_34`.
fn at_rest<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    place: &Pose,
    off: [f64; 2],
) -> Result<([Wrench; 2], Pose), CalibrateError> {
    drive.go(place)?;
    drive.rest(SETTLE_S, |_| ())?;
    let (mut sum, mut n, mut last) = ([Wrench::ZERO; 2], 0.0, *place);
    drive.rest(REST_S, |s: &Sample| {
        sum[0] += wrench(&s.measurement.sensor_a);
        sum[1] += put_back(&wrench(&s.measurement.sensor_b), off);
        n += 1.0;
        last = s.x_34;
    })?;
    if n < 50.0 {
        return Err(CalibrateError::TooFew);
    }
    Ok((sum.map(|w| Wrench { f: w.f / n, m: w.m / n }), last))
}

/// Drives the rig through tilts and sines and leaves it at the place.
///
/// # Errors
/// See [`CalibrateError`].
pub fn calibrate<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &CalibrateSetup,
) -> Result<Calibration, CalibrateError> {
    if !drive.capabilities().contains(Capabilities::SENSOR_A) {
        return Err(CalibrateError::NoSensor);
    }
    // What a dead zone takes off the readings of B.
    let off = taken_off(&setup.sensors.force);
    if !drive.capabilities().contains(Capabilities::SENSOR_B) {
        let touch = setup.touch.ok_or(CalibrateError::NothingToFind)?;
        let (mean, _) = at_rest(drive, &setup.place, off)?;
        return Ok(Calibration {
            place: setup.place,
            tare_a: mean[0],
            delay_a_s: Some(delay_of_a(drive, setup, &touch)?),
            of_b: None,
            accelerometer_delay_s: None,
        });
    }
    let rig = drive.setup().rig.clone();
    let gravity_4 = |x_34: &Pose| (rig.x_b0 * rig.x_03 * *x_34).q.conjugate() * rig.gravity_m_s2;
    let place = setup.place;
    let mut still: Vec<([Row; 6], [f64; 6])> = Vec::new();
    let mut tare_a = None;
    for (dof, sign) in [(0, 0.0), (4, 1.0), (4, -1.0), (5, 1.0), (5, -1.0)] {
        let turn = DQuat::from_scaled_axis(along(dof, sign * setup.tilt_rad).w);
        let (mean, x_34) = at_rest(drive, &Pose::new(place.p, (turn * place.q).normalize()), off)?;
        tare_a.get_or_insert(mean[0]);
        still.push((rows(gravity_4(&x_34), &Twist::default(), 1.0), six(mean[1].f, mean[1].m)));
    }
    drive.go(&place)?;
    let periods = (SINE_S * setup.hz).ceil();
    let mut swings = Vec::new();
    for dof in 0..6 {
        let amplitude = setup.amplitude[dof / 3];
        let steady_s = SETTLE_S + periods / setup.hz;
        let sine = Sine { about: place, dof, amplitude, hz: setup.hz, ramp_s: 0.5, steady_s };
        swings.push(swing(drive, &place, &sine, off)?);
    }
    let g4 = gravity_4(&place);
    let force = &setup.sensors.force;
    let known = solve(&still, &swings, place.q, g4, force)?;
    let accelerometer_delay_s = match &setup.sensors.accelerometer {
        Some(file) => {
            accelerometers_late_s(&swings, place.q, g4, file)?.map(|late_s| file.delay_s + late_s)
        }
        None => None,
    };
    let mut out = Calibration {
        place,
        tare_a: tare_a.unwrap_or_default(),
        delay_a_s: None,
        of_b: Some(SensorB {
            zero: known.zero,
            payload: known.payload,
            delay_s: force.delay_s + known.late_s,
            rest: known.rest,
        }),
        accelerometer_delay_s,
    };
    if let Some(touch) = setup.touch {
        out.delay_a_s = Some(delay_of_a(drive, setup, &touch)?);
    }
    Ok(out)
}

struct Known {
    payload: Payload,
    zero: Wrench,
    late_s: f64,
    rest: [f64; 2],
}

/// By how much later than their own lag the accelerometers are, s, from all sines together.
///
/// # Errors
/// One of them measures something else than the plate's motion.
fn accelerometers_late_s(
    swings: &[Swing],
    q_34: DQuat,
    g4: DVec3,
    file: &SixAxisSensor,
) -> Result<Option<f64>, CalibrateError> {
    let (mut across, mut square) = (0.0, 0.0);
    let (mut along, mut squares) = ([0.0; 6], [0.0; 6]);
    for s in swings {
        let (w, Some(read)) = (s.rate_rad_s, s.accelerations) else { return Ok(None) };
        let moves = s.carried(q_34, g4).map(|c| {
            let [v, w] = c.feels();
            six(v, w)
        });
        for (i, read) in unlagged(&read, w, file, 0.0).into_iter().enumerate() {
            let m = C::new(moves[0][i], moves[1][i]);
            across -= w * (m.conj() * read).im;
            square += w * w * m.norm_sqr();
            along[i] += (m.conj() * read).re;
            squares[i] += m.norm_sqr();
        }
    }
    for axis in 0..6 {
        let gain = along[axis] / squares[axis];
        if (gain - 1.0).abs() > LARGEST_GAIN_ERROR || !gain.is_finite() {
            return Err(CalibrateError::Accelerometer { axis, gain });
        }
    }
    Ok(Some(across / square))
}

/// Far above the scale factor's tolerance, far below a wrong axis.
const LARGEST_GAIN_ERROR: f64 = 0.2;

/// A reading before the sensor's lag, brought forward by `late_s`.
fn unlagged(b: &[C; 6], rate_rad_s: f64, sensor: &SixAxisSensor, late_s: f64) -> [C; 6] {
    let h = Interface::of_sensor(sensor).at(rate_rad_s / TAU);
    let turn = C::new(0.0, rate_rad_s * late_s).exp() / h;
    b.map(|x| x * turn)
}

fn solve(
    still: &[([Row; 6], [f64; 6])],
    swings: &[Swing],
    q_34: DQuat,
    gravity_4: DVec3,
    sensor: &SixAxisSensor,
) -> Result<Known, CalibrateError> {
    let turned: Vec<_> = swings.iter().map(|s| swing_rows(s, q_34, gravity_4)).collect();
    let n = 6 * still.len() + 12 * swings.len();
    let mut a = DMatrix::<f64>::zeros(n, UNKNOWNS);
    let lines = still.iter().map(|x| &x.0).chain(turned.iter().flatten());
    for (i, row) in lines.flatten().enumerate() {
        a.row_mut(i).copy_from(&row.transpose());
    }
    let svd = a.clone().svd(true, true);
    let mut late_s = 0.0;
    let (mut x, mut b) = (DVector::zeros(UNKNOWNS), DVector::zeros(n));
    for _ in 0..ROUNDS {
        let mut put = 0;
        let mut line = |b: &mut DVector<f64>, values: [f64; 6]| {
            for v in values {
                b[put] = v;
                put += 1;
            }
        };
        for (_, read) in still {
            line(&mut b, *read);
        }
        for s in swings {
            let read = unlagged(&s.b, s.rate_rad_s, sensor, late_s);
            line(&mut b, read.map(|c| c.re));
            line(&mut b, read.map(|c| c.im));
        }
        x = svd.solve(&b, 1e-12).map_err(|_| CalibrateError::Blind)?;
        // What is left of the phase, all sines together.
        let (mut across, mut square) = (0.0, 0.0);
        for (s, rows) in swings.iter().zip(&turned) {
            let w = s.rate_rad_s;
            let read = unlagged(&s.b, w, sensor, late_s);
            for (i, r) in read.into_iter().enumerate() {
                let m = C::new(
                    rows[0][i].dot(&x.fixed_rows::<UNKNOWNS>(0)),
                    rows[1][i].dot(&x.fixed_rows::<UNKNOWNS>(0)),
                );
                across -= w * (m.conj() * r).im;
                square += w * w * m.norm_sqr();
            }
        }
        if square <= 0.0 || !square.is_finite() {
            return Err(CalibrateError::Blind);
        }
        late_s += across / square;
    }
    let left = &a * &x - b;
    let mut rest = [0.0; 2];
    for (i, e) in left.iter().enumerate() {
        rest[i % 6 / 3] += e * e;
    }
    #[expect(clippy::cast_precision_loss, reason = "a hundred rows")]
    let rest = rest.map(|s: f64| (2.0 * s / n as f64).sqrt());
    let u: Row = x.fixed_rows::<UNKNOWNS>(0).into_owned();
    let mass = u[0];
    if mass <= 0.0 || !mass.is_finite() {
        return Err(CalibrateError::Blind);
    }
    let com = DVec3::new(u[1], u[2], u[3]) / mass;
    let about_sensor =
        DMat3::from_cols_array_2d(&[[u[4], u[7], u[8]], [u[7], u[5], u[9]], [u[8], u[9], u[6]]]);
    // Steiner: from the sensor to the mass centre.
    let outer = DMat3::from_cols(com * com.x, com * com.y, com * com.z);
    let steiner = (DMat3::from_diagonal(DVec3::splat(com.length_squared())) - outer) * mass;
    Ok(Known {
        payload: Payload { mass_kg: mass, com_m: com, inertia_kg_m2: about_sensor - steiner },
        zero: Wrench { f: DVec3::new(u[10], u[11], u[12]), m: DVec3::new(u[13], u[14], u[15]) },
        late_s,
        rest,
    })
}

impl Touch {
    fn sine(&self, place: &Pose) -> Sine {
        let steady_s = SETTLE_S + (SINE_S * self.hz).ceil() / self.hz;
        let Self { dof, amplitude_m: amplitude, hz, .. } = *self;
        Sine { about: *place, dof, amplitude, hz, ramp_s: 1.0, steady_s }
    }
}

/// Delay of sensor A beyond its second order, s, by a touch: the force of a stick follows its deflection, which is what
/// the plate has moved beyond the play.
fn delay_of_a<R: Rig, K: Clock>(
    drive: &mut Drive<R, K>,
    setup: &CalibrateSetup,
    touch: &Touch,
) -> Result<f64, CalibrateError> {
    const THIRD: usize = 2;
    let place = setup.place;
    let sine = touch.sine(&place);
    let window = sine.ramp_s + SETTLE_S..sine.ramp_s + sine.steady_s;
    let mut h = Harmonic::<2>::new(TAU * sine.hz, MULTIPLES);
    drive.run(
        sine.duration_s(),
        |t| sine.at(t),
        |s| {
            if window.contains(&s.time_s) {
                let way = displacement(&place, &s.x_34)[touch.dof];
                let deflection = way - way.clamp(-touch.play_m, touch.play_m);
                h.push(s.time_s, &[deflection, s.measurement.sensor_a[touch.dof]]);
            }
        },
    )?;
    drive.rest(SETTLE_S, |_| ())?;
    let [deflection, a] = h.found().ok_or(CalibrateError::TooFew)?.amplitude[THIRD];
    let rate_rad_s = TAU * sine.hz * 3.0;
    if a.norm() < LEAST_TOUCH_N || deflection.norm() <= 0.0 {
        return Err(CalibrateError::NoTouch);
    }
    // The stick presses with its deflection on A and against it on the plate: the sign is left open.
    let read = a * Interface::of_sensor(&setup.sensors.force).at(rate_rad_s / TAU).inv();
    let apart = read * deflection.conj();
    let apart = if apart.re < 0.0 { -apart } else { apart };
    Ok(setup.sensors.force.delay_s - apart.arg() / rate_rad_s)
}

/// Least third harmonic of a touch, N.
const LEAST_TOUCH_N: f64 = 5.0;
