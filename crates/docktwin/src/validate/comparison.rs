//! Two recordings of a docking, held against the requirements.

use std::collections::BTreeMap;

use docktwin_core::{DQuat, DVec3, Euler};
use docktwin_record::{RecordError, Summary};
use serde::Serialize;

use crate::failure::Failure;

/// Relative position until the first latch, m.
const POSITION_M: f64 = 1e-3;
/// Relative attitude until the first latch, rad.
const ANGLE_RAD: f64 = 0.1 * core::f64::consts::PI / 180.0;
/// Peak force, share.
const PEAK: f64 = 0.05;

/// One engine's run.
pub(super) struct Side {
    pub(super) summary: Summary,
    pub(super) time_s: Vec<f64>,
    /// `e4` from `e3`, in `e3`, m.
    pub(super) position_m: Vec<DVec3>,
    /// `e4` to `e3`.
    pub(super) attitude: Vec<DQuat>,
    /// F4, N.
    pub(super) port4_n: Vec<f64>,
    last_contact_s: Option<f64>,
}

impl Side {
    /// From the columns of a run.
    pub(super) fn new(
        table: &BTreeMap<String, Vec<f64>>,
        summary: Summary,
    ) -> Result<Self, Failure> {
        let column = |name: &str| {
            table.get(name).ok_or_else(|| RecordError::Absent {
                what: format!("the column `{name}`"),
                path: docktwin_record::files::TABLE.into(),
            })
        };
        let vector = |name: &str, unit: &str| -> Result<Vec<DVec3>, RecordError> {
            let [x, y, z] = ["x", "y", "z"].map(|a| column(&format!("{name}_{a}_{unit}")));
            let (x, y, z) = (x?, y?, z?);
            Ok((0..x.len()).map(|i| DVec3::new(x[i], y[i], z[i])).collect())
        };
        let time_s = column("time_s")?.clone();
        let depth = column("contact_depth_m")?;
        let attitude = vector("relative_attitude", "rad")?
            .into_iter()
            .map(|e| Euler { roll: e.x, pitch: e.y, yaw: e.z }.to_quat())
            .collect();
        let last_contact_s = depth.iter().rposition(|d| *d > 0.0).map(|i| time_s[i]);
        Ok(Self {
            summary,
            position_m: vector("relative_position", "m")?,
            attitude,
            port4_n: vector("port4_force", "n")?.into_iter().map(DVec3::length).collect(),
            last_contact_s,
            time_s,
        })
    }

    /// Pose at a time, between ticks along the straight line; `None` outside of the run.
    fn at(&self, t: f64) -> Option<(DVec3, DQuat)> {
        let next = self.time_s.partition_point(|x| *x < t);
        let (Some(after), Some(q)) = (self.time_s.get(next), self.attitude.get(next)) else {
            return None;
        };
        let p = self.position_m[next];
        if *after <= t {
            return Some((p, *q));
        }
        let i = next.checked_sub(1)?;
        let share = (t - self.time_s[i]) / (after - self.time_s[i]);
        Some((self.position_m[i].lerp(p, share), self.attitude[i].slerp(*q, share)))
    }

    fn first_latch_s(&self) -> Option<f64> {
        self.summary.latches_s.iter().flatten().copied().reduce(f64::min)
    }

    fn latch_order(&self) -> Vec<usize> {
        let mut caught: Vec<(f64, usize)> =
            (1..).zip(&self.summary.latches_s).filter_map(|(i, t)| t.map(|t| (t, i))).collect();
        caught.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        caught.into_iter().map(|(_, i)| i).collect()
    }
}

/// A line of the comparison.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    what: &'static str,
    docktwin: String,
    mujoco: String,
    difference: String,
    /// In words; null where nothing is required.
    required: Option<&'static str>,
    /// Null where nothing is required.
    pass: Option<bool>,
}

/// Both runs beside each other.
#[derive(Debug, Serialize)]
pub(super) struct Comparison {
    scenario: String,
    engine: String,
    engine_step_s: f64,
    /// Whether everything required holds.
    pub(super) within: bool,
    /// At first contact; where one of them has none, at the start.
    pub(super) aligned: bool,
    /// Time of docktwin's and of MuJoCo's run that belong together, s.
    pub(super) zero_s: [f64; 2],
    /// What ends the time over which poses are judged.
    until: &'static str,
    /// That end in docktwin's time, s.
    pub(super) until_s: f64,
    /// Instants over which poses are judged.
    ticks_judged: usize,
    /// Largest difference of relative position until then, m.
    position_m: f64,
    /// Largest angle between both relative attitudes until then, rad.
    angle_rad: f64,
    /// The same without alignment, from the common start, m.
    position_from_start_m: f64,
    /// To the end of the shorter run, m.
    position_whole_m: f64,
    /// To the end of the shorter run, rad.
    angle_whole_rad: f64,
    /// Relative.
    peak_force_difference: f64,
    /// Relative.
    impulse_difference: f64,
    /// In docktwin's time.
    #[serde(skip)]
    pub(super) difference: Vec<(f64, DVec3, f64)>,
    /// The same in words.
    rows: Vec<Row>,
}

/// Share by which b differs from a.
fn share(a: f64, b: f64) -> f64 {
    if a.to_bits() == b.to_bits() { 0.0 } else { (b / a - 1.0).abs() }
}

/// Angle between two attitudes, exact for small ones, rad.
fn angle(a: DQuat, b: DQuat) -> f64 {
    let d = a.conjugate() * b;
    2.0 * d.xyz().length().atan2(d.w.abs())
}

/// B against A, B's clock being ahead by `shift`: time of A, difference of position and angle.
fn differences(a: &Side, b: &Side, shift: f64) -> Vec<(f64, DVec3, f64)> {
    (0..a.time_s.len())
        .filter_map(|i| {
            let t = a.time_s[i];
            let (p, q) = b.at(t + shift)?;
            Some((t, p - a.position_m[i], angle(a.attitude[i], q)))
        })
        .collect()
}

/// Largest position and angle before a time, and over how many instants. What is no number is the
/// worst of all.
fn worst(of: &[(f64, DVec3, f64)], until_s: f64) -> (f64, f64, usize) {
    let larger = |so_far: f64, now: f64| if now.is_nan() { f64::INFINITY } else { so_far.max(now) };
    of.iter()
        .filter(|(t, ..)| *t <= until_s)
        .fold((0.0, 0.0, 0), |(p, q, n), (_, d, w)| (larger(p, d.length()), larger(q, *w), n + 1))
}

impl Comparison {
    /// Compares docktwin's run with the other.
    pub(super) fn new(scenario: &str, engine: &str, step_s: f64, [a, b]: &[Side; 2]) -> Self {
        let (sa, sb) = (&a.summary, &b.summary);
        let contact = sa.first_contact_s.zip(sb.first_contact_s);
        let zero_s = contact.map_or([0.0, 0.0], |(x, y)| [x, y]);
        let shift = zero_s[1] - zero_s[0];
        let earliest = |x: Option<f64>, y: Option<f64>| match (x, y.map(|y| y - shift)) {
            (Some(x), Some(y)) => Some(x.min(y)),
            (x, y) => x.or(y),
        };
        let end = a.time_s.last().copied().unwrap_or(0.0);
        let latch = earliest(a.first_latch_s(), b.first_latch_s());
        let (until, until_s) = match (latch, earliest(a.last_contact_s, b.last_contact_s)) {
            (Some(t), _) => ("first latch", t),
            (None, Some(t)) => ("last contact", t),
            (None, None) => ("end", end),
        };
        let difference = differences(a, b, shift);
        let (position_m, angle_rad, ticks_judged) = worst(&difference, until_s);
        let (position_whole_m, angle_whole_rad, _) = worst(&difference, f64::INFINITY);
        let (position_from_start_m, ..) = worst(&differences(a, b, 0.0), until_s);
        let peak_force_difference = share(sa.peak_force_n, sb.peak_force_n);
        let impulse_difference = share(sa.impulse_ns, sb.impulse_ns);
        let orders = [a, b].map(Side::latch_order);

        let seconds = |t: Option<f64>| t.map_or("–".to_owned(), |t| format!("{t:.4} s"));
        let later = |x: Option<f64>, y: Option<f64>| {
            x.zip(y).map_or("–".to_owned(), |(x, y)| format!("{:+.2} ms", (y - x) * 1e3))
        };
        let time = |what, x: Option<f64>, y: Option<f64>| Row {
            what,
            docktwin: seconds(x),
            mujoco: seconds(y),
            difference: later(x, y),
            required: None,
            pass: None,
        };
        let same = |yes: bool| if yes { "same" } else { "different" }.to_owned();
        let order = |o: &[usize]| {
            let words: Vec<String> = o.iter().map(ToString::to_string).collect();
            if words.is_empty() { "none caught".to_owned() } else { words.join(" ") }
        };
        let mut rows = vec![
            Row {
                what: "outcome",
                docktwin: sa.outcome.to_string(),
                mujoco: sb.outcome.to_string(),
                difference: same(sa.outcome == sb.outcome),
                required: Some("same"),
                pass: Some(sa.outcome == sb.outcome),
            },
            time("first contact", sa.first_contact_s, sb.first_contact_s),
            Row {
                what: "latch order",
                docktwin: order(&orders[0]),
                mujoco: order(&orders[1]),
                difference: same(orders[0] == orders[1]),
                required: Some("same"),
                pass: Some(orders[0] == orders[1]),
            },
        ];
        for (i, what) in ["latch 1", "latch 2", "latch 3"].into_iter().enumerate() {
            let of = |s: &Summary| s.latches_s.get(i).copied().flatten();
            if of(sa).or(of(sb)).is_some() {
                rows.push(time(what, of(sa), of(sb)));
            }
        }
        rows.push(time("capture", sa.capture_s, sb.capture_s));
        rows.push(Row {
            what: "peak force",
            docktwin: format!("{:.1} N", sa.peak_force_n),
            mujoco: format!("{:.1} N", sb.peak_force_n),
            difference: format!("{:.3} %", peak_force_difference * 100.0),
            required: Some("5 %"),
            pass: Some(peak_force_difference <= PEAK),
        });
        rows.push(Row {
            what: "impulse",
            docktwin: format!("{:.2} N·s", sa.impulse_ns),
            mujoco: format!("{:.2} N·s", sb.impulse_ns),
            difference: format!("{:.3} %", impulse_difference * 100.0),
            required: None,
            pass: None,
        });
        // Nothing compared is nothing shown.
        let some = ticks_judged > 0;
        for (what, difference, required, pass) in [
            (
                "relative position",
                format!("{:.4} mm", position_m * 1e3),
                "1 mm",
                some && position_m <= POSITION_M,
            ),
            (
                "relative attitude",
                format!("{:.5}°", angle_rad.to_degrees()),
                "0.1°",
                some && angle_rad <= ANGLE_RAD,
            ),
        ] {
            let none = String::new();
            rows.push(Row {
                what,
                docktwin: none.clone(),
                mujoco: none,
                difference,
                required: Some(required),
                pass: Some(pass),
            });
        }
        Self {
            scenario: scenario.to_owned(),
            engine: engine.to_owned(),
            engine_step_s: step_s,
            within: rows.iter().all(|r| r.pass != Some(false)),
            aligned: contact.is_some(),
            zero_s,
            until,
            until_s,
            ticks_judged,
            position_m,
            angle_rad,
            position_from_start_m,
            position_whole_m,
            angle_whole_rad,
            peak_force_difference,
            impulse_difference,
            difference,
            rows,
        }
    }

    /// The comparison in words.
    pub(super) fn lines(&self) -> Vec<String> {
        let mut out = vec![
            format!(
                "{}: docktwin (reduced twin) and {} (RK4, {} ms), law held equal",
                self.scenario,
                self.engine,
                self.engine_step_s * 1e3
            ),
            format!(
                "{:<18} {:>14} {:>14} {:>12} {:>10}",
                "", "docktwin", "MuJoCo", "difference", "required"
            ),
        ];
        for r in &self.rows {
            let verdict = match r.pass {
                Some(true) => "  pass",
                Some(false) => "  FAIL",
                None => "",
            };
            let line = format!(
                "{:<18} {:>14} {:>14} {:>12} {:>10}{verdict}",
                r.what,
                r.docktwin,
                r.mujoco,
                r.difference,
                r.required.unwrap_or("")
            );
            out.push(line.trim_end().to_owned());
        }
        let from = if self.aligned { "first contact" } else { "the start: not both touch" };
        out.push(format!(
            "Relative pose is the worst of {} ticks until the {}, aligned at {from}; without alignment \
             {:.4} mm; to the end {:.3} mm and {:.4}°.",
            self.ticks_judged,
            self.until,
            self.position_from_start_m * 1e3,
            self.position_whole_m * 1e3,
            self.angle_whole_rad.to_degrees(),
        ));
        out.push(if self.within { "within the requirements" } else { "NOT within" }.to_owned());
        out
    }
}

#[cfg(test)]
mod tests {
    use docktwin_record::{Outcome, SUMMARY_SCHEMA, StepUs, Verdict};

    use super::*;

    fn summary(peak_force_n: f64, shift_s: f64) -> Summary {
        Summary {
            schema_version: SUMMARY_SCHEMA,
            tool_version: String::new(),
            scenario: "s".to_owned(),
            seed: 0,
            state_digest: String::new(),
            outcome: Outcome::Captured,
            verdict: Verdict::Pass,
            failure_reason: None,
            first_contact_s: Some(0.1 + shift_s),
            capture_s: None,
            latches_s: vec![Some(0.5 + shift_s), None, Some(0.3 + shift_s)],
            peak_force_n,
            peak_moment_nm: 0.0,
            impulse_ns: 1.0,
            peak_penetration_m: 0.0,
            energy_in_j: f64::NAN,
            energy_dissipated_j: f64::NAN,
            energy_balance_error: f64::NAN,
            momentum_error: f64::NAN,
            duration_s: 1.0,
            ticks: 1000,
            wall_s: 1.0,
            realtime_factor: 1.0,
            step_us: StepUs::default(),
            loop_: None,
            fidelity: None,
            safety: None,
            recording: None,
        }
    }

    /// Closing at 0.2 m/s and rolling at 0.1 rad/s, `shift_s` later, `off_m` beside until 0.4 s.
    fn side(shift_s: f64, off_m: f64, off_rad: f64, peak_n: f64) -> Side {
        let time_s: Vec<f64> = (0..1001).map(|i| f64::from(i) * 1e-3).collect();
        let at = |t: f64| t - shift_s;
        let off = |t: f64, x: f64| if t < 0.25 { x } else { 100.0 * x };
        Side {
            position_m: time_s
                .iter()
                .map(|t| DVec3::new(1.0 - 0.2 * at(*t), off(at(*t), off_m), 0.0))
                .collect(),
            attitude: time_s
                .iter()
                .map(|t| DQuat::from_rotation_x(0.1 * at(*t) + off(at(*t), off_rad)))
                .collect(),
            port4_n: vec![0.0; time_s.len()],
            last_contact_s: Some(0.9),
            summary: summary(peak_n, shift_s),
            time_s,
        }
    }

    fn of(a: Side, b: Side) -> Comparison {
        Comparison::new("s", "MuJoCo", 2e-4, &[a, b])
    }

    #[test]
    fn invariant_each_requirement_is_judged_by_itself() {
        let plain = || side(0.0, 0.0, 0.0, 100.0);
        let failed = |c: &Comparison| -> Vec<&str> {
            c.rows.iter().filter(|r| r.pass == Some(false)).map(|r| r.what).collect()
        };
        // Up to 0.25 s only: what comes later, up to the latch at 0.3 s, is a hundred times larger.
        assert!(of(plain(), side(0.0, 0.9e-5, 1e-5, 104.9)).within);
        let c = of(plain(), side(0.0, 1.1e-5, 0.0, 100.0));
        assert_eq!((failed(&c), c.within), (vec!["relative position"], false));
        let c = of(plain(), side(0.0, 0.0, 2e-5, 100.0));
        assert_eq!(failed(&c), ["relative attitude"]);
        let c = of(plain(), side(0.0, 0.0, 0.0, 94.9));
        assert_eq!(failed(&c), ["peak force"]);
        let mut b = plain();
        b.summary.latches_s = vec![Some(0.3), None, Some(0.5)];
        assert_eq!(failed(&of(plain(), b)), ["latch order"]);
        let mut b = plain();
        b.summary.outcome = Outcome::Jammed;
        assert_eq!(failed(&of(plain(), b)), ["outcome"]);
        let mut b = plain();
        b.position_m[200].y = f64::NAN;
        assert_eq!(failed(&of(plain(), b)), ["relative position"]);
    }

    #[test]
    fn invariant_runs_are_aligned_between_ticks() {
        // The same motion 10.4 ms later: equal when aligned, 2 mm off when not.
        let c = of(side(0.0, 0.0, 0.0, 100.0), side(0.0104, 0.0, 0.0, 100.0));
        assert!(c.within && c.aligned, "{:?}", c.rows);
        assert!(c.position_m < 1e-12 && c.angle_rad < 1e-12, "{} {}", c.position_m, c.angle_rad);
        assert!((c.position_from_start_m - 0.00208).abs() < 1e-9, "{}", c.position_from_start_m);
        assert!((c.until_s - 0.3).abs() < 1e-12 && c.until == "first latch");
    }

    #[test]
    fn invariant_a_contact_of_one_alone_is_no_agreement() {
        let mut b = side(0.0, 0.0, 0.0, 0.0);
        b.summary.first_contact_s = None;
        let c = of(side(0.0, 0.0, 0.0, 100.0), b);
        assert!(!c.within && !c.aligned);
    }
}
