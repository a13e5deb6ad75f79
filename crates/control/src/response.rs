//! Frequency response of the running, nonlinear rig: one degree of freedom of the port is driven,
//! all six are measured.
//!
//! Degrees of freedom are X, Y, Z, roll, pitch, yaw of `e4` against `e3`, in axes of `e3`:
//! displacement of the origin of `e4` (m) and rotation vector (rad) from the pose it swings about. The
//! response is taken from the pose that is commanded to the pose the plate really has, so dead time,
//! feed-forward and friction are in it.

use core::f64::consts::TAU;

use docktwin_core::{DVec3, Pose, Twist, Wrench};
use docktwin_model::PositionLoop;
use docktwin_physics::{
    platform::Platform,
    rig::{PortSpring, RigFault},
};
use nalgebra::{Complex, Matrix6, Vector6};

use crate::{
    excitation::{along, displaced, displacement, swinging},
    feedforward::{MotionError, PlateMotion},
    linear::{LinearInputs, LinearRig, Pole},
    planner::smooth,
    rig::{ClosedRig, DriveSetup, HydraulicSetup, RigSetup, SetupError, TICK_S},
};

type C = Complex<f64>;

/// Where the rig is measured and what it carries.
#[derive(Clone, Debug)]
pub struct Bench {
    /// The rig.
    pub setup: RigSetup,
    /// Pose `X_34` to swing about.
    pub x_34: Pose,
    /// Spring at the origin of `e4`, N/m along the axes of `e3`, without force at `x_34`.
    pub payload_n_m: DVec3,
    /// A rotation counts as a displacement at this lever, m: couplings are compared so.
    pub lever_m: f64,
    /// Whether the commanded motion is known ahead by the valve's delay (1 ms), as a predictor
    /// knows it. Without, jerk is held over that time, which costs a few percent at 10 Hz where a
    /// mode is as low as 15 Hz.
    pub foreseen: bool,
}

/// A rig as a linear model.
#[derive(Clone, Debug)]
pub enum LinearModel {
    /// On oil, with its controllers.
    Oil(Box<LinearRig>),
    /// Legs with equal position loops: every degree of freedom follows as a leg does, whatever the plate carries.
    Loop(PositionLoop),
}

impl LinearModel {
    /// From the commanded degrees of freedom to those of the plate at a frequency, Hz.
    #[must_use]
    pub fn response(&self, hz: f64) -> Option<Matrix6<C>> {
        match self {
            Self::Oil(rig) => rig.response(hz),
            Self::Loop(l) => Some(Matrix6::from_diagonal_element(l.response(hz))),
        }
    }

    /// The poles, slowest first.
    #[must_use]
    pub fn poles(&self) -> Option<Vec<Pole>> {
        match self {
            Self::Oil(rig) => rig.poles(),
            Self::Loop(l) => {
                let (w, z) = (TAU * l.natural_frequency_hz, l.damping_ratio);
                let s = match z {
                    None => vec![[-w, 0.0]],
                    Some(z) if z < 1.0 => {
                        let swing = w * (1.0 - z * z).sqrt();
                        vec![[-z * w, swing], [-z * w, -swing]]
                    }
                    Some(z) => {
                        let apart = w * (z * z - 1.0).sqrt();
                        vec![[-z * w + apart, 0.0], [-z * w - apart, 0.0]]
                    }
                };
                let pole = |s: [f64; 2]| {
                    let size = s[0].hypot(s[1]);
                    Pole { s, frequency_hz: size / TAU, damping: -s[0] / size }
                };
                Some(s.into_iter().map(pole).collect())
            }
        }
    }
}

/// Why a measurement stopped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ResponseError {
    /// The rig cannot be built.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The motion cannot be commanded.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The rig failed on the way.
    #[error("the rig failed under the test signal: {0}")]
    Rig(RigFault),
    /// A signal that cannot be measured.
    #[error("the test signal has a degree of freedom over 5, or no frequency, amplitude or period")]
    Signal,
}

/// Response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Frequency, Hz.
    pub hz: f64,
    /// From the driven degree of freedom to all six, rotations times the bench's lever; per unit of
    /// the drive, a rotation taken in the same way.
    pub response: [C; 6],
    /// Share of the driven degree of freedom's motion that follows the drive linearly, 0 to 1.
    pub coherence: f64,
}

impl Point {
    /// Gain of the driven degree of freedom, dB.
    #[must_use]
    pub fn gain_db(&self, dof: usize) -> f64 {
        20.0 * self.response[dof].norm().log10()
    }

    /// Its phase, degrees, negative when late.
    #[must_use]
    pub fn phase_deg(&self, dof: usize) -> f64 {
        self.response[dof].arg().to_degrees()
    }

    /// Largest response of another degree of freedom.
    #[must_use]
    pub fn cross_coupling(&self, dof: usize) -> f64 {
        (0..6).filter(|i| *i != dof).map(|i| self.response[i].norm()).fold(0.0, f64::max)
    }
}

/// A signal and its first three derivatives.
type Signal = [f64; 4];

/// A sine that begins softly: its envelope is a smooth step of `RAMP_S`.
fn sine(amplitude: f64, w: f64, t: f64) -> Signal {
    const RAMP_S: f64 = 0.3;
    let [e, e1, e2, e3] = smooth(t / RAMP_S);
    let envelope = [e, e1 / RAMP_S, e2 / RAMP_S.powi(2), e3 / RAMP_S.powi(3)];
    swinging(envelope, w, t).map(|x| amplitude * x)
}

/// A sine whose frequency swings from `from` to `to` (Hz) and back in `period` (s), for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Driven degree of freedom, 0 to 5.
    pub dof: usize,
    /// Amplitude, m or rad.
    pub amplitude: f64,
    /// Lowest frequency, Hz.
    pub from_hz: f64,
    /// Highest frequency, Hz.
    pub to_hz: f64,
    /// Time of one sweep up and down, s; a longer one has finer resolution.
    pub period_s: f64,
    /// Sweeps that are evaluated, after one that settles.
    pub sweeps: u32,
}

impl Sweep {
    fn at(&self, t: f64) -> Signal {
        let r = TAU / self.period_s;
        // A whole number of cycles in a period, so that it repeats without a jump.
        let mean = (0.5 * (self.from_hz + self.to_hz) * self.period_s).round() / self.period_s;
        let half = 0.5 * (self.to_hz - self.from_hz);
        let (sr, cr) = (r * t).sin_cos();
        let phase = TAU * (mean * t - half / r * sr);
        let p1 = TAU * (mean - half * cr);
        let p2 = TAU * half * r * sr;
        let p3 = TAU * half * r * r * cr;
        let (s, c) = phase.sin_cos();
        let a = self.amplitude;
        [
            a * s,
            a * p1 * c,
            a * (p2 * c - p1 * p1 * s),
            a * (p3 * c - 3.0 * p1 * p2 * s - p1 * p1 * p1 * c),
        ]
    }
}

impl Bench {
    fn motion(&self, platform: &Platform, dof: usize, s: Signal) -> PlateMotion {
        let m = displaced(&self.x_34, dof, s);
        PlateMotion::of_docking(platform, &m.x_34, &[m.twist, m.acceleration, m.jerk])
    }

    /// Displacement of `e4` from the pose it swings about, rotations times the lever.
    fn displacement(&self, x_34: &Pose) -> [f64; 6] {
        let [x, y, z, roll, pitch, yaw] = displacement(&self.x_34, x_34);
        [x, y, z, roll * self.lever_m, pitch * self.lever_m, yaw * self.lever_m]
    }

    fn spring(&self, platform: &Platform) -> PortSpring {
        let x_bp = platform.plate_from_docking(&self.x_34);
        // A wrench or twist in e3 comes to eb by the same rotation.
        let turn = |v: DVec3| platform.plate_twist(&self.x_34, &Twist { v, w: DVec3::ZERO }).v;
        let axes = [turn(DVec3::X), turn(DVec3::Y), turn(DVec3::Z)];
        let port = platform.wrench_from_port(&x_bp, &Wrench { f: DVec3::X, m: DVec3::ZERO });
        // The port in ep, from the moment that forces at it make.
        let lever = |f: DVec3| platform.wrench_from_port(&x_bp, &Wrench { f, m: DVec3::ZERO });
        let (y, z) = (lever(DVec3::Y), lever(DVec3::Z));
        // r = ½ Σ fᵢ × (r × fᵢ) over three orthogonal unit forces.
        let arm = 0.5 * (port.f.cross(port.m) + y.f.cross(y.m) + z.f.cross(z.m));
        let k = self.payload_n_m;
        let along = |f: fn(DVec3) -> f64| {
            k.x * f(axes[0]).powi(2) + k.y * f(axes[1]).powi(2) + k.z * f(axes[2]).powi(2)
        };
        PortSpring {
            port_m: x_bp.q.conjugate() * arm,
            rest_m: x_bp.p + arm,
            stiffness_n_m: DVec3::new(along(|v| v.x), along(|v| v.y), along(|v| v.z)),
        }
    }

    /// Runs the rig with a signal and gives every tick's time, drive and displacement to `take`.
    fn run(
        &self,
        dof: usize,
        ticks: u64,
        signal: impl Fn(f64) -> Signal,
        mut take: impl FnMut(u64, f64, [f64; 6]),
    ) -> Result<(), ResponseError> {
        let forward = self.setup.feedforward();
        let platform = forward.platform().clone();
        let spring = self.spring(&platform);
        let mut rig = ClosedRig::new(&self.setup, &platform.plate_from_docking(&self.x_34))?;
        let scale = if dof < 3 { 1.0 } else { self.lever_m };
        #[expect(clippy::cast_precision_loss, reason = "ticks of minutes")]
        let time = |tick: u64| tick as f64 * TICK_S;
        for tick in 0..ticks {
            let arrival = self.motion(&platform, dof, signal(time(tick)));
            let command = if self.foreseen {
                let later = time(tick) + forward.valve_delay_s();
                let valve = self.motion(&platform, dof, signal(later));
                forward.command_paths(&arrival, Some(&valve), None)?
            } else {
                forward.command(&arrival)?
            };
            let m = rig.tick(&command, |x, _| spring.wrench(x)).map_err(ResponseError::Rig)?;
            let after = tick + 1;
            let x = self.displacement(&platform.docking_from_plate(&m.x_bp));
            take(after, signal(time(after))[0] * scale, x);
        }
        Ok(())
    }

    /// Response to a sine of one frequency, after it has settled, over whole periods of at least
    /// `measure_s`.
    ///
    /// # Errors
    /// See [`ResponseError`].
    pub fn stepped_sine(
        &self,
        dof: usize,
        amplitude: f64,
        hz: f64,
        settle_s: f64,
        measure_s: f64,
    ) -> Result<Point, ResponseError> {
        if dof > 5 || !(amplitude > 0.0 && hz > 0.0 && measure_s > 0.0 && settle_s >= 0.0) {
            return Err(ResponseError::Signal);
        }
        // Frequency brought to a whole number of ticks over a whole number of periods.
        let periods = (measure_s * hz).ceil().max(1.0);
        let window = (periods / (hz * TICK_S)).round();
        let w = TAU * periods / (window * TICK_S);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
        let (settle, window) = ((settle_s / TICK_S).ceil() as u64, window as u64);
        let (mut drive, mut out) = (C::ZERO, [C::ZERO; 6]);
        let (mut sum, mut square) = (0.0, 0.0);
        #[expect(clippy::cast_precision_loss, reason = "ticks")]
        let n = window as f64;
        self.run(
            dof,
            settle + window,
            |t| sine(amplitude, w, t),
            |tick, u, x| {
                if tick > settle {
                    #[expect(clippy::cast_precision_loss, reason = "ticks")]
                    let turn = C::new(0.0, -w * tick as f64 * TICK_S).exp();
                    drive += turn * u;
                    for (o, x) in out.iter_mut().zip(x) {
                        *o += turn * x;
                    }
                    sum += x[dof];
                    square += x[dof] * x[dof];
                }
            },
        )?;
        let varying = square - sum * sum / n;
        Ok(Point {
            hz: w / TAU,
            response: out.map(|o| o / drive),
            coherence: (2.0 * out[dof].norm_sqr() / (n * varying)).min(1.0),
        })
    }

    /// Response to a repeated swept sine at every `hz`, from the cross spectra of whole sweeps,
    /// averaged over `half_band_hz` to either side: coherence falls where the rig does not answer
    /// linearly.
    ///
    /// # Errors
    /// See [`ResponseError`].
    pub fn swept_sine(
        &self,
        sweep: &Sweep,
        hz: &[f64],
        half_band_hz: f64,
    ) -> Result<Vec<Point>, ResponseError> {
        let s = sweep;
        if s.dof > 5
            || !(s.amplitude > 0.0 && s.from_hz > 0.0 && s.to_hz > s.from_hz && s.period_s > 0.0)
            || s.sweeps == 0
        {
            return Err(ResponseError::Signal);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
        let window = (s.period_s / TICK_S).round() as u64;
        let mut record = Vec::new();
        self.run(
            s.dof,
            window * u64::from(s.sweeps + 1),
            |t| s.at(t),
            |tick, u, x| {
                if tick > window {
                    record.push((u, x));
                }
            },
        )?;
        #[expect(clippy::cast_precision_loss, reason = "ticks")]
        let resolution = 1.0 / (window as f64 * TICK_S);
        Ok(hz
            .iter()
            .map(|f| {
                let (first, last) =
                    (((f - half_band_hz) / resolution).ceil(), (f + half_band_hz) / resolution);
                let (mut uu, mut yy, mut yu) = (0.0, 0.0, [C::ZERO; 6]);
                let mut bin = first.max(1.0);
                while bin <= last {
                    let w = TAU * bin * resolution * TICK_S;
                    // One spectrum per sweep.
                    #[expect(clippy::cast_possible_truncation, reason = "ticks")]
                    for part in record.chunks_exact(window as usize) {
                        let (mut u, mut y) = (C::ZERO, [C::ZERO; 6]);
                        let step = C::new(0.0, -w).exp();
                        let mut turn = C::new(1.0, 0.0);
                        for (drive, x) in part {
                            u += turn * drive;
                            for (y, x) in y.iter_mut().zip(x) {
                                *y += turn * x;
                            }
                            turn *= step;
                        }
                        uu += u.norm_sqr();
                        yy += y[s.dof].norm_sqr();
                        for (yu, y) in yu.iter_mut().zip(y) {
                            *yu += y * u.conj();
                        }
                    }
                    bin += 1.0;
                }
                Point {
                    hz: *f,
                    response: yu.map(|x| x / uu),
                    coherence: (yu[s.dof].norm_sqr() / (uu * yy)).min(1.0),
                }
            })
            .collect())
    }

    /// The linear model of this bench, in the same degrees of freedom (rotations in rad). Legs are
    /// taken as the first one is. `None` in a singular pose.
    #[must_use]
    pub fn linear(&self) -> Option<LinearModel> {
        match &self.setup.drive {
            DriveSetup::Hydraulic(oil) => {
                self.linear_on_oil(oil).map(|rig| LinearModel::Oil(Box::new(rig)))
            }
            DriveSetup::Loops { loops, .. } => Some(LinearModel::Loop(loops[0])),
        }
    }

    fn linear_on_oil(&self, oil: &HydraulicSetup) -> Option<LinearRig> {
        let matrix = |platform: &Platform| {
            let c = platform.at(&platform.plate_from_docking(&self.x_34));
            let columns: [Vector6<f64>; 6] = core::array::from_fn(|i| {
                let t = platform.plate_twist(&self.x_34, &along(i, 1.0));
                Vector6::new(t.v.x, t.v.y, t.v.z, t.w.x, t.w.y, t.w.z)
            });
            let port = Matrix6::from_columns(&columns);
            (c.jacobian() * port, port.transpose() * platform.mass_matrix(&c) * port)
        };
        let (jacobian, mass) = matrix(&self.setup.platform);
        let (_, believed_mass) = matrix(&self.setup.believed_platform);
        let k = self.payload_n_m;
        LinearRig::new(LinearInputs {
            jacobian,
            mass,
            believed_mass,
            payload: Matrix6::from_diagonal(&Vector6::new(k.x, k.y, k.z, 0.0, 0.0, 0.0)),
            leg: oil.legs[0],
            believed_leg: oil.believed_legs[0],
            tuning: oil.tuning,
            dead_time_s: self.setup.dead_time_s,
        })
    }

    /// Response of the linear model at `hz` from every degree of freedom, scaled as a measured
    /// [`Point`].
    #[must_use]
    pub fn linear_points(&self, linear: &LinearModel, hz: f64) -> Option<[Point; 6]> {
        let g = linear.response(hz)?;
        let lever = |i: usize| if i < 3 { 1.0 } else { self.lever_m };
        Some(core::array::from_fn(|dof| Point {
            hz,
            response: core::array::from_fn(|i| g[(i, dof)] * (lever(i) / lever(dof))),
            coherence: 1.0,
        }))
    }

    /// [`Bench::linear_points`] from one degree of freedom.
    #[must_use]
    pub fn linear_point(&self, linear: &LinearModel, dof: usize, hz: f64) -> Option<Point> {
        self.linear_points(linear, hz)?.get(dof).copied()
    }
}
