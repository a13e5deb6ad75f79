//! How near a run against a rig comes to the simulated system: the same spacecraft and mechanism, the
//! same start and control wrenches, no rig (§8).

use docktwin_core::DVec3;
use docktwin_hil::scheduler::TickRecord;
use docktwin_physics::{
    body::BodyState,
    mechanism::{CHASER, System, TARGET},
    reduced::{DockingTwin, Inputs, ReducedTwin},
};
use docktwin_record::Fidelity;

use crate::{
    signals::Instant,
    telemetry::{CONTACT_N, port_speed},
};

/// One tick of either.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    /// F4 on the target, in `e4`, N: true where the rig tells it, else measured.
    pub force_n: DVec3,
    /// `p_34`, m.
    pub position_m: DVec3,
    /// Relative speed of the ports, m/s.
    pub speed_m_s: f64,
    /// Kinetic energy of both spacecraft, J.
    pub kinetic_j: f64,
}

fn kinetic(system: &System, bodies: &[BodyState; 2]) -> f64 {
    [CHASER, TARGET].into_iter().zip(bodies).map(|(k, b)| b.kinetic_energy(&system.mass()[k])).sum()
}

/// What a tick of the loop leaves behind.
#[must_use]
pub fn trace(system: &System, r: &TickRecord) -> Trace {
    let m = &r.measurement;
    let truth = DVec3::from_slice(&m.truth_port4[..3]);
    let told = m.has(docktwin_rigport::message::Capabilities::TRUTH);
    Trace {
        force_n: if told { truth } else { r.ports.port4.f },
        position_m: r.x_34.p,
        speed_m_s: port_speed(system, &r.bodies),
        kinetic_j: kinetic(system, &r.bodies),
    }
}

/// The simulated system tick by tick under the same control wrenches.
#[must_use]
pub fn simulated(
    system: System,
    bodies: [BodyState; 3],
    controls: &[Inputs],
    tick_s: f64,
) -> Vec<Trace> {
    // 0.1 ms, as the reduced twin has by default.
    const STEPS: u32 = 10;
    let h = tick_s / f64::from(STEPS);
    let mut twin = ReducedTwin::new(system, bodies, h);
    controls
        .iter()
        .map(|control| {
            let state = twin.state();
            #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 steps")]
            let now = Instant::new(twin.system(), &state, state.step as f64 * h, h);
            let frames = now.measured.poses();
            let pair = [state.bodies[CHASER], state.bodies[TARGET]];
            let out = Trace {
                force_n: now.port4.f,
                position_m: (frames.x_w3.inverse() * frames.x_w4).p,
                speed_m_s: port_speed(twin.system(), &pair),
                kinetic_j: kinetic(twin.system(), &pair),
            };
            (0..STEPS).for_each(|_| twin.step(control));
            out
        })
        .collect()
}

/// Ticks at which the first contact begins and ends.
fn first_contact(run: &[Trace]) -> Option<(usize, Option<usize>)> {
    let on = |t: &Trace| t.force_n.length() > CONTACT_N;
    let begin = run.iter().position(on)?;
    // A contact that is interrupted for less than 20 ms is one.
    let mut last = begin;
    for (i, t) in run.iter().enumerate().skip(begin) {
        if on(t) {
            last = i;
        } else if i - last > 20 {
            return Some((begin, Some(last)));
        }
    }
    Some((begin, None))
}

/// Compares; everything `None` without contact in both.
#[must_use]
pub fn fidelity(hil: &[Trace], sim: &[Trace]) -> Fidelity {
    let mut out = Fidelity::default();
    let (Some((h0, h1)), Some((s0, s1))) = (first_contact(hil), first_contact(sim)) else {
        return out;
    };
    let peak = |run: &[Trace]| run.iter().map(|t| t.force_n.length()).fold(0.0, f64::max);
    out.peak_force_ratio = Some(peak(hil) / peak(sim));
    #[expect(clippy::cast_precision_loss, reason = "ticks")]
    if let (Some(h1), Some(s1)) = (h1, s1) {
        out.R_T = Some((h1 - h0) as f64 / (s1 - s0).max(1) as f64);
        // Restitution of the first contact: speeds some ticks before and after it.
        let ratio = |run: &[Trace], a: usize, b: usize| {
            let v0 = run[a.saturating_sub(5)].speed_m_s;
            run.get(b + 15).map(|t| t.speed_m_s / v0)
        };
        if let (Some(h), Some(s)) = (ratio(hil, h0, h1), ratio(sim, s0, s1)) {
            out.R_e = Some(h / s);
        }
    }
    let pairs = || hil[h0..].iter().zip(&sim[s0..]);
    let n = pairs().count();
    if n == 0 {
        return out;
    }
    let (mut ef, mut rf) = (0.0, 0.0);
    for (h, s) in pairs() {
        ef += (h.force_n - s.force_n).length_squared();
        rf += s.force_n.length_squared();
    }
    out.nrms_force = Some((ef / rf).sqrt());
    #[expect(clippy::cast_precision_loss, reason = "ticks")]
    let mean = pairs().map(|(_, s)| s.position_m).sum::<DVec3>() / n as f64;
    let (mut ex, mut rx) = (0.0, 0.0);
    for (h, s) in pairs() {
        ex += (h.position_m - s.position_m).length_squared();
        rx += (s.position_m - mean).length_squared();
    }
    out.nrms_pose = Some((ex / rx).sqrt());
    let (h, s) = (&hil[h0 + n - 1], &sim[s0 + n - 1]);
    out.delta_energy = Some((h.kinetic_j - s.kinetic_j) / sim[0].kinetic_j);
    out
}
