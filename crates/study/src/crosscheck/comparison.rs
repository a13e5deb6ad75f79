//! Two recordings of a docking, held against the requirements.

use std::collections::BTreeMap;

use docktwin_core::{DQuat, DVec3, Euler};
use docktwin_record::{Outcome, RecordError, Summary};
use serde::{Deserialize, Serialize};

use super::EngineResult;
use crate::number::null_is_nan;

/// Largest difference of relative position until the first latch, m.
pub const POSITION_M: f64 = 1e-3;
/// Largest angle between both relative attitudes until the first latch, rad: 0.1°.
pub const ANGLE_RAD: f64 = 0.1 * core::f64::consts::PI / 180.0;
/// Largest difference of the peak forces, a fraction.
pub const PEAK_FORCE: f64 = 0.05;

/// One engine's run.
#[derive(Clone, Debug)]
pub struct Side {
    /// Its summary.
    pub summary: Summary,
    /// Time of every row, s, rising.
    pub time_s: Vec<f64>,
    /// `e4` from `e3`, in `e3`, m, at every time.
    pub position_m: Vec<DVec3>,
    /// `R_34` at every time.
    pub attitude: Vec<DQuat>,
    /// |F4| at every time, N.
    pub port4_n: Vec<f64>,
    /// Time of the last row with a depth above 0, s.
    pub last_contact_s: Option<f64>,
}

impl Side {
    /// From the columns of a run (`telemetry.parquet`, by name) and its summary.
    ///
    /// # Errors
    /// A column that is needed is absent.
    pub fn new(table: &BTreeMap<String, Vec<f64>>, summary: Summary) -> Result<Self, RecordError> {
        let column = |name: &str| {
            table.get(name).ok_or_else(|| RecordError::Absent {
                what: format!("the column `{name}`"),
                remedy: "rehearse again with this version",
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

    /// Pose at a time, between rows along the straight line; `None` outside of the run.
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

    /// Numbers of the latches, from 1, in the order in which they caught.
    fn latch_order(&self) -> Vec<usize> {
        let mut caught: Vec<(f64, usize)> =
            (1..).zip(&self.summary.latches_s).filter_map(|(i, t)| t.map(|t| (t, i))).collect();
        caught.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        caught.into_iter().map(|(_, i)| i).collect()
    }
}

/// A quantity of both runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compared<T> {
    /// Of docktwin.
    pub docktwin: T,
    /// Of the second engine.
    pub mujoco: T,
}

impl<T> Compared<T> {
    fn of([a, b]: &[Side; 2], value: impl Fn(&Side) -> T) -> Self {
        Self { docktwin: value(a), mujoco: value(b) }
    }
}

/// What ends the time over which poses are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Until {
    /// The first latch that caught, of either run.
    #[serde(rename = "first latch")]
    FirstLatch,
    /// No latch caught: the last contact, of the run where it comes first.
    #[serde(rename = "last contact")]
    LastContact,
    /// Nothing touched: the end of docktwin's run.
    #[serde(rename = "end")]
    End,
}

impl Until {
    /// In words, as serialised.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::FirstLatch => "first latch",
            Self::LastContact => "last contact",
            Self::End => "end",
        }
    }
}

/// Both runs beside each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CrossCheck {
    /// The comparison in figures.
    pub summary: ComparisonSummary,
    /// What passes and what does not.
    pub passes: Passes,
    /// How the runs ended.
    pub outcome: Compared<Outcome>,
    /// First contact, s.
    pub first_contact_s: Compared<Option<f64>>,
    /// Numbers of the latches, from 1, in the order in which they caught.
    pub latch_order: Compared<Vec<usize>>,
    /// Every latch, s.
    pub latches_s: Vec<Compared<Option<f64>>>,
    /// Capture, s.
    pub capture_s: Compared<Option<f64>>,
    /// Peak force, N.
    pub peak_force_n: Compared<f64>,
    /// Impulse of the contact force, N·s.
    pub impulse_ns: Compared<f64>,
    /// Difference of the poses over the whole of the shorter run.
    pub differences: Vec<PoseDifference>,
}

/// Both runs beside each other in figures. Differences are the second engine's less docktwin's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparisonSummary {
    /// Name of the scenario.
    pub scenario: String,
    /// Name and version of the second engine.
    pub engine: String,
    /// Its step, s.
    pub engine_step_s: f64,
    /// Whether everything that is required holds.
    pub within: bool,
    /// Whether the runs are aligned at first contact; where one of them has none, they are compared
    /// from the start.
    pub aligned: bool,
    /// Times of docktwin's and of the second engine's run that belong together, s.
    pub zero_s: [f64; 2],
    /// What ends the time over which poses are judged.
    pub until: Until,
    /// That end in docktwin's time, s.
    pub until_s: f64,
    /// Rows over which poses are judged.
    pub ticks_judged: usize,
    /// Largest difference of relative position until then, m; NaN where a pose is not a number.
    #[serde(deserialize_with = "null_is_nan")]
    pub position_m: f64,
    /// Largest angle between both relative attitudes until then, rad.
    #[serde(deserialize_with = "null_is_nan")]
    pub angle_rad: f64,
    /// Largest difference of position until then without alignment, from the common start, m.
    #[serde(deserialize_with = "null_is_nan")]
    pub position_from_start_m: f64,
    /// Largest difference of position to the end of the shorter run, m.
    #[serde(deserialize_with = "null_is_nan")]
    pub position_whole_m: f64,
    /// Largest angle to the end of the shorter run, rad.
    #[serde(deserialize_with = "null_is_nan")]
    pub angle_whole_rad: f64,
    /// Difference of the peak forces, a fraction of docktwin's.
    #[serde(deserialize_with = "null_is_nan")]
    pub peak_force_difference: f64,
    /// Difference of the impulses, a fraction of docktwin's.
    #[serde(deserialize_with = "null_is_nan")]
    pub impulse_difference: f64,
}

/// What is required, one by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Passes {
    /// The same outcome.
    pub outcome: bool,
    /// The same latches caught in the same order.
    pub latch_order: bool,
    /// Peak force within [`PEAK_FORCE`].
    pub peak_force: bool,
    /// Relative position within [`POSITION_M`]; nothing compared does not pass.
    pub relative_position: bool,
    /// Relative attitude within [`ANGLE_RAD`]; nothing compared does not pass.
    pub relative_attitude: bool,
}

impl Passes {
    /// Whether all of it passes.
    #[must_use]
    pub const fn all(&self) -> bool {
        self.outcome
            && self.latch_order
            && self.peak_force
            && self.relative_position
            && self.relative_attitude
    }
}

/// Difference of the poses at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseDifference {
    /// Time of docktwin's run, s.
    pub time_s: f64,
    /// Relative position of the second engine less docktwin's, in `e3`, m.
    pub position_m: DVec3,
    /// Angle between both relative attitudes, rad, at least 0.
    pub angle_rad: f64,
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

/// B against A, B's clock being ahead by `shift`.
fn differences(a: &Side, b: &Side, shift: f64) -> Vec<PoseDifference> {
    (0..a.time_s.len())
        .filter_map(|i| {
            let time_s = a.time_s[i];
            let (p, q) = b.at(time_s + shift)?;
            Some(PoseDifference {
                time_s,
                position_m: p - a.position_m[i],
                angle_rad: angle(a.attitude[i], q),
            })
        })
        .collect()
}

/// Largest differences before a time, and over how many rows. What is no number is the worst of all.
struct Worst {
    position_m: f64,
    angle_rad: f64,
    rows: usize,
}

impl Worst {
    fn of(all: &[PoseDifference], until_s: f64) -> Self {
        let larger =
            |so_far: f64, now: f64| if now.is_nan() { f64::INFINITY } else { so_far.max(now) };
        let mut out = Self { position_m: 0.0, angle_rad: 0.0, rows: 0 };
        for d in all.iter().filter(|d| d.time_s <= until_s) {
            out.position_m = larger(out.position_m, d.position_m.length());
            out.angle_rad = larger(out.angle_rad, d.angle_rad);
            out.rows += 1;
        }
        out
    }
}

/// What ends the time over which poses are judged, and when that is in the time of the first side.
fn until([a, b]: &[Side; 2], shift: f64) -> (Until, f64) {
    let earliest = |x: Option<f64>, y: Option<f64>| match (x, y.map(|y| y - shift)) {
        (Some(x), Some(y)) => Some(x.min(y)),
        (x, y) => x.or(y),
    };
    let latch = earliest(a.first_latch_s(), b.first_latch_s());
    match (latch, earliest(a.last_contact_s, b.last_contact_s)) {
        (Some(t), _) => (Until::FirstLatch, t),
        (None, Some(t)) => (Until::LastContact, t),
        (None, None) => (Until::End, a.time_s.last().copied().unwrap_or(0.0)),
    }
}

/// Compares docktwin's run (first) with the second engine's.
#[must_use]
pub fn compare(scenario: &str, engine: &EngineResult, sides: &[Side; 2]) -> CrossCheck {
    let [a, b] = sides;
    let (sa, sb) = (&a.summary, &b.summary);
    let contact = sa.first_contact_s.zip(sb.first_contact_s);
    let zero_s = contact.map_or([0.0, 0.0], |(x, y)| [x, y]);
    let shift = zero_s[1] - zero_s[0];
    let (until, until_s) = until(sides, shift);
    let differences = differences(a, b, shift);
    let judged = Worst::of(&differences, until_s);
    let whole = Worst::of(&differences, f64::INFINITY);
    let from_start = Worst::of(&self::differences(a, b, 0.0), until_s);
    let peak_force_difference = share(sa.peak_force_n, sb.peak_force_n);
    let latch_order = Compared::of(sides, Side::latch_order);
    let passes = Passes {
        outcome: sa.outcome == sb.outcome,
        latch_order: latch_order.docktwin == latch_order.mujoco,
        peak_force: peak_force_difference <= PEAK_FORCE,
        relative_position: judged.rows > 0 && judged.position_m <= POSITION_M,
        relative_attitude: judged.rows > 0 && judged.angle_rad <= ANGLE_RAD,
    };
    let latches = sa.latches_s.len().max(sb.latches_s.len());
    CrossCheck {
        passes,
        outcome: Compared::of(sides, |s| s.summary.outcome),
        first_contact_s: Compared::of(sides, |s| s.summary.first_contact_s),
        latch_order,
        latches_s: (0..latches)
            .map(|i| Compared::of(sides, |s| s.summary.latches_s.get(i).copied().flatten()))
            .collect(),
        capture_s: Compared::of(sides, |s| s.summary.capture_s),
        peak_force_n: Compared::of(sides, |s| s.summary.peak_force_n),
        impulse_ns: Compared::of(sides, |s| s.summary.impulse_ns),
        summary: ComparisonSummary {
            scenario: scenario.to_owned(),
            engine: engine.engine.clone(),
            engine_step_s: engine.step_s,
            within: passes.all(),
            aligned: contact.is_some(),
            zero_s,
            until,
            until_s,
            ticks_judged: judged.rows,
            position_m: judged.position_m,
            angle_rad: judged.angle_rad,
            position_from_start_m: from_start.position_m,
            position_whole_m: whole.position_m,
            angle_whole_rad: whole.angle_rad,
            peak_force_difference,
            impulse_difference: share(sa.impulse_ns, sb.impulse_ns),
        },
        differences,
    }
}

#[cfg(test)]
mod tests {
    use docktwin_record::Verdict;

    use super::*;

    fn summary(peak_force_n: f64, shift_s: f64) -> Summary {
        Summary {
            first_contact_s: Some(0.1 + shift_s),
            latches_s: vec![Some(0.5 + shift_s), None, Some(0.3 + shift_s)],
            peak_force_n,
            peak_moment_nm: 0.0,
            impulse_ns: 1.0,
            peak_penetration_m: 0.0,
            duration_s: 1.0,
            ticks: 1000,
            wall_s: 1.0,
            realtime_factor: 1.0,
            ..Summary::new("s", Outcome::Captured, Verdict::Pass)
        }
    }

    /// Closing at 0.2 m/s and rolling at 0.1 rad/s, `shift_s` later, `off_m` beside until 0.25 s.
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

    fn of(a: Side, b: Side) -> CrossCheck {
        compare("s", &super::super::second::tests::result(), &[a, b])
    }

    #[test]
    fn invariant_each_requirement_is_judged_by_itself() {
        let plain = || side(0.0, 0.0, 0.0, 100.0);
        let good = Passes {
            outcome: true,
            latch_order: true,
            peak_force: true,
            relative_position: true,
            relative_attitude: true,
        };
        let judged = |b: Side| {
            let c = of(plain(), b);
            assert_eq!(c.summary.within, c.passes.all());
            c.passes
        };
        // Up to 0.25 s only: what comes later, up to the latch at 0.3 s, is a hundred times larger.
        assert_eq!(judged(side(0.0, 0.9e-5, 1e-5, 104.9)), good);
        let far = judged(side(0.0, 1.1e-5, 0.0, 100.0));
        assert_eq!(far, Passes { relative_position: false, ..good });
        let turned = judged(side(0.0, 0.0, 2e-5, 100.0));
        assert_eq!(turned, Passes { relative_attitude: false, ..good });
        let weak = judged(side(0.0, 0.0, 0.0, 94.9));
        assert_eq!(weak, Passes { peak_force: false, ..good });
        let mut b = plain();
        b.summary.latches_s = vec![Some(0.3), None, Some(0.5)];
        assert_eq!(judged(b), Passes { latch_order: false, ..good });
        let mut b = plain();
        b.summary.outcome = Outcome::Jammed;
        assert_eq!(judged(b), Passes { outcome: false, ..good });
        let mut b = plain();
        b.position_m[200].y = f64::NAN;
        assert_eq!(judged(b), Passes { relative_position: false, ..good });
        let mut b = plain();
        b.summary.peak_force_n = f64::NAN;
        assert_eq!(judged(b), Passes { peak_force: false, ..good });
        // Nothing compared is nothing shown.
        let mut b = plain();
        b.time_s.iter_mut().for_each(|t| *t += 100.0);
        let c = judged(b);
        assert_eq!(c, Passes { relative_position: false, relative_attitude: false, ..good });
    }

    #[test]
    fn invariant_runs_are_aligned_between_ticks() {
        // The same motion 10.4 ms later: equal when aligned, 2 mm off when not.
        let c = of(side(0.0, 0.0, 0.0, 100.0), side(0.0104, 0.0, 0.0, 100.0)).summary;
        assert!(c.within && c.aligned, "{c:?}");
        assert!(c.position_m < 1e-12 && c.angle_rad < 1e-12, "{} {}", c.position_m, c.angle_rad);
        assert!((c.position_from_start_m - 0.00208).abs() < 1e-9, "{}", c.position_from_start_m);
        assert!((c.until_s - 0.3).abs() < 1e-12 && c.until == Until::FirstLatch);
    }

    #[test]
    fn invariant_a_contact_of_one_alone_is_no_agreement() {
        let mut b = side(0.0, 0.0, 0.0, 0.0);
        b.summary.first_contact_s = None;
        let c = of(side(0.0, 0.0, 0.0, 100.0), b).summary;
        assert!(!c.within && !c.aligned);
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let found = of(side(0.0, 1e-5, 1e-5, 100.0), side(0.0104, 0.0, 0.0, 101.0));
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<CrossCheck>(&text).expect("JSON"), found);
        assert!(text.contains(r#""until":"first latch""#), "{text}");
        let mut b = side(0.0, 0.0, 0.0, 100.0);
        b.position_m[200].y = f64::NAN;
        let text = serde_json::to_string(&of(side(0.0, 0.0, 0.0, 100.0), b).summary).expect("JSON");
        let back: ComparisonSummary = serde_json::from_str(&text).expect("JSON");
        assert!(back.position_m.is_nan() && !back.within);
    }
}
