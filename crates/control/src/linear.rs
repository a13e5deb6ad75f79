//! The rig at one pose as a linear, sampled system: closed-loop poles and frequency response.
//!
//! Legs with equation (10) and the valve in front, coupled by the mass matrix of the plate and by
//! the stiffness of a payload; the controllers as they run, sample by sample, computing delay
//! included. Friction, orifice and limits are what it leaves out.

use core::f64::consts::TAU;

use docktwin_physics::hydraulics::LegParameters;
use nalgebra::{Complex, DMatrix, DVector, Matrix6};

use crate::leg::{LegController, LegTuning};

/// States of a leg in the plant: length, speed, force of the oil, spool as speed, its rate.
const PLANT: usize = 5;
/// States of a leg's controller: the high-pass, two of the lead, the waiting command.
const CONTROLLER: usize = 4;
const LEGS: usize = 6;

type C = Complex<f64>;

/// What is linearised.
#[derive(Clone, Copy, Debug)]
pub struct LinearInputs {
    /// Rates of the legs per velocity of the plate (v, ω), m/s per (m/s, rad/s).
    pub jacobian: Matrix6<f64>,
    /// Mass matrix of plate and legs for that velocity, kg, kg·m, kg·m².
    pub mass: Matrix6<f64>,
    /// Mass matrix that the feed-forward believes.
    pub believed_mass: Matrix6<f64>,
    /// Stiffness of the payload for displacements of the plate (Δp, Δθ), N/m, N, N·m.
    pub payload: Matrix6<f64>,
    /// The legs as they are.
    pub leg: LegParameters,
    /// The legs as the controllers believe them to be.
    pub believed_leg: LegParameters,
    /// Tuning of all controllers.
    pub tuning: LegTuning,
    /// From command to controller, s.
    pub dead_time_s: f64,
}

/// A pole in the plane of s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pole {
    /// Size, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, 1 for a decaying real pole, negative if unstable.
    pub damping: f64,
    /// Real and imaginary part, rad/s.
    pub s: [f64; 2],
}

/// The closed loop, sample by sample.
#[derive(Clone, Debug)]
pub struct LinearRig {
    inputs: LinearInputs,
    inverse_jacobian: Matrix6<f64>,
    /// Transition over one sample, and what targets (l, v, F of every leg) put in.
    transition: DMatrix<f64>,
    drive: DMatrix<f64>,
}

impl LinearRig {
    /// Linearises. `None` where the Jacobian or the mass matrix is singular.
    #[must_use]
    pub fn new(inputs: LinearInputs) -> Option<Self> {
        let t = inputs.tuning.sample_s();
        let ji = inputs.jacobian.try_inverse()?;
        // W = J M⁻¹ Jᵀ: accelerations of the legs per leg force.
        let w = inputs.jacobian * inputs.mass.try_inverse()? * inputs.jacobian.transpose();
        let k = ji.transpose() * inputs.payload * ji;
        let p = &inputs.leg;
        let (np, nc) = (PLANT * LEGS, CONTROLLER * LEGS);

        // The plant, continuous, with the held command as further, constant states.
        let mut a = DMatrix::<f64>::zeros(np + LEGS, np + LEGS);
        let wk = w * k;
        let valve = TAU * p.valve.natural_frequency_hz;
        for i in 0..LEGS {
            let s = |state: usize| state * LEGS + i;
            a[(s(0), s(1))] = 1.0;
            for j in 0..LEGS {
                a[(s(1), j)] = -wk[(i, j)];
                a[(s(1), LEGS + j)] = -w[(i, j)] * p.oil.viscous_n_s_m;
                a[(s(1), 2 * LEGS + j)] = w[(i, j)];
            }
            a[(s(2), s(1))] = -p.oil.oil_spring_n_m();
            a[(s(2), s(2))] = -p.oil.leakage_m3_s_pa * p.pressure_per_volume();
            a[(s(2), s(3))] = p.oil.oil_spring_n_m();
            a[(s(3), s(4))] = 1.0;
            a[(s(4), s(3))] = -valve * valve;
            a[(s(4), s(4))] = -2.0 * p.valve.damping_ratio * valve;
            a[(s(4), np + i)] = valve * valve * p.no_load_speed_m_s();
        }
        let step = (a * t).exp();

        // The controllers. The command that waits is held over the sample that follows.
        let controller = LegController::new(inputs.tuning, inputs.believed_leg);
        let (high_pass, lead) = controller.sections();
        let (ha, hb, hc, hd) = high_pass.state_space();
        let (la, lb, lc, ld) = lead.state_space();
        let (kp, gamma) = (inputs.tuning.position_gain_1_s, inputs.tuning.pressure_gain_m_s_n);
        let unit = 1.0 / inputs.believed_leg.no_load_speed_m_s();
        let n = np + nc;
        let mut f = DMatrix::<f64>::zeros(n, n);
        let mut b = DMatrix::<f64>::zeros(n, 3 * LEGS);
        f.view_mut((0, 0), (np, np)).copy_from(&step.view((0, 0), (np, np)));
        for i in 0..LEGS {
            let c = |state: usize| np + state * LEGS + i;
            for row in 0..np {
                for j in 0..LEGS {
                    f[(row, np + 3 * LEGS + j)] = step[(row, np + j)];
                }
            }
            let (len, force) = (i, 2 * LEGS + i);
            let (rl, rv, rf) = (i, LEGS + i, 2 * LEGS + i);
            // Excess e = F_ref − F; its high-pass y = C x + D e; opening o.
            // A first-order section leaves its second memory at zero.
            f[(c(0), c(0))] += ha[0][0];
            f[(c(0), force)] -= hb[0];
            b[(c(0), rf)] += hb[0];
            let opening_f =
                [(c(0), unit * gamma * hc[0]), (force, -unit * gamma * hd), (len, -unit * kp)];
            let opening_b = [(rl, unit * kp), (rv, unit), (rf, unit * gamma * hd)];
            let rows = [(c(1), lb[0]), (c(2), lb[1]), (c(3), ld)];
            for (row, gain) in rows {
                for (col, x) in opening_f {
                    f[(row, col)] += gain * x;
                }
                for (col, x) in opening_b {
                    b[(row, col)] += gain * x;
                }
            }
            for r in 0..2 {
                f[(c(1 + r), c(1))] += la[r][0];
                f[(c(1 + r), c(2))] += la[r][1];
                f[(c(3), c(1 + r))] += lc[r];
            }
        }
        Some(Self { inputs, inverse_jacobian: ji, transition: f, drive: b })
    }

    /// All poles, slowest first; `None` if the eigenvalues are not found.
    #[must_use]
    pub fn poles(&self) -> Option<Vec<Pole>> {
        let t = self.inputs.tuning.sample_s();
        // Lengths, forces and rates differ by ten orders of magnitude: unbalanced, the QR iteration
        // does not converge.
        let mut balanced = self.transition.clone();
        nalgebra::linalg::balancing::balance_parlett_reinsch(&mut balanced);
        // Shifted: the iteration compares with the diagonal, and poles at zero, dead within a sample,
        // would leave it nothing to compare with.
        const SHIFT: f64 = 2.0;
        let n = balanced.nrows();
        balanced += DMatrix::identity(n, n) * SHIFT;
        let schur = balanced.try_schur(1e-10, 100_000)?;
        let mut out: Vec<Pole> = schur
            .complex_eigenvalues()
            .iter()
            .map(|z| z - C::new(SHIFT, 0.0))
            // What dies within a sample is no motion.
            .filter(|z| z.norm() > 1e-3)
            .map(|z| {
                let s = z.ln() / t;
                let size = s.norm();
                Pole {
                    frequency_hz: size / TAU,
                    damping: if size > 0.0 { -s.re / size } else { 1.0 },
                    s: [s.re, s.im],
                }
            })
            .collect();
        out.sort_by(|a, b| {
            a.frequency_hz.total_cmp(&b.frequency_hz).then(a.s[1].total_cmp(&b.s[1]))
        });
        Some(out)
    }

    /// The least damping ratio of all poles below `limit_hz`; negative when unstable, `None` if the
    /// eigenvalues are not found.
    #[must_use]
    pub fn least_damping(&self, limit_hz: f64) -> Option<f64> {
        let poles = self.poles()?;
        Some(
            poles
                .iter()
                .filter(|p| p.frequency_hz < limit_hz)
                .map(|p| p.damping)
                .fold(1.0, f64::min),
        )
    }

    /// From commanded to true motion of the plate at `hz`: (Δp, Δθ) to (Δp, Δθ), dead time included.
    ///
    /// The feed-forward is the one of [`crate::feedforward`]: mass of the pose, acceleration and jerk,
    /// flow ahead by the valve's delay.
    #[must_use]
    pub fn response(&self, hz: f64) -> Option<Matrix6<C>> {
        let i = &self.inputs;
        let s = C::new(0.0, TAU * hz);
        let m = &i.believed_leg;
        let ahead = (s * i.tuning.valve_delay_s(m)).exp();
        // Targets for a unit motion of every degree of freedom.
        let j = i.jacobian.map(|x| C::new(x, 0.0));
        let force = (self.inverse_jacobian.transpose() * i.believed_mass).map(|x| s * s * x)
            + j * (s * m.oil.viscous_n_s_m);
        let leak = m.oil.leakage_m3_s_pa / (m.oil.area_m2 * m.oil.area_m2);
        let flow = (j * s + force * (s / m.oil.oil_spring_n_m() + leak)) * ahead;
        let mut targets = DMatrix::<C>::zeros(3 * LEGS, LEGS);
        targets.view_mut((0, 0), (LEGS, LEGS)).copy_from(&j);
        targets.view_mut((LEGS, 0), (LEGS, LEGS)).copy_from(&flow);
        targets.view_mut((2 * LEGS, 0), (LEGS, LEGS)).copy_from(&force);
        let legs = self.lengths(hz, targets)?;
        let late = (-s * i.dead_time_s).exp();
        Some(self.inverse_jacobian.map(|x| C::new(x, 0.0)) * legs * late)
    }

    /// Lengths of the legs at `hz` for columns of targets: lengths, flow speeds, forces of all legs, in
    /// the sample in which the controllers take them.
    pub(crate) fn lengths(&self, hz: f64, targets: DMatrix<C>) -> Option<Matrix6<C>> {
        let z = C::new(0.0, TAU * hz * self.inputs.tuning.sample_s()).exp();
        let n = self.transition.nrows();
        let system = DMatrix::<C>::from_diagonal(&DVector::from_element(n, z))
            - self.transition.map(|x| C::new(x, 0.0));
        let x = system.lu().solve(&(self.drive.map(|x| C::new(x, 0.0)) * targets))?;
        Some(x.fixed_view::<LEGS, LEGS>(0, 0).into_owned())
    }
}
