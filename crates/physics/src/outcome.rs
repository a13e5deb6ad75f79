//! What became of a docking, and when (§3, outcomes in their order).

use docktwin_core::{DVec3, Pose, Twist};
use docktwin_model::DockingMechanism;

use crate::{
    limits::LimitPassed,
    mechanism::{LatchPhase, MechanismState},
};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// A load, travel or depth limit was passed.
    LimitExceeded,
    /// All three latched.
    Captured,
    /// One or two latches, or slow contact, for too long or at the end.
    Jammed,
    /// Never inside the guided zone.
    Missed,
    /// Left again, opening, beyond the petal height.
    Rebounded,
}

impl Outcome {
    /// Name as in `summary.json`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LimitExceeded => "limit_exceeded",
            Self::Captured => "captured",
            Self::Jammed => "jammed",
            Self::Missed => "missed",
            Self::Rebounded => "rebounded",
        }
    }
}

/// One look at the relative motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Time, s.
    pub time_s: f64,
    /// Pose of the passive ring's centre with axes of `e4`, in `r3`.
    pub x_ring: Pose,
    /// Motion of `e4` against `e3` at the passive ring's centre, in `e3`.
    pub relative: Twist,
    /// Whether any surfaces touch.
    pub touching: bool,
    /// The first limit passed up to now, in any step.
    pub limit: Option<LimitPassed>,
}

/// Watches a run and judges it.
#[derive(Clone, Debug, Default)]
pub struct Monitor {
    first_contact_s: Option<f64>,
    last_contact_s: Option<f64>,
    guided: bool,
    touched_guided: bool,
    settled_s: Option<f64>,
    separated_s: Option<f64>,
    limit: Option<LimitPassed>,
    jam_since_s: Option<f64>,
    jammed_s: Option<f64>,
    closest_m: f64,
    closest_seen: bool,
    offset_at_closest_m: f64,
    captured_s: Option<f64>,
    latched: usize,
    /// How many there are.
    latches: usize,
    /// Whether they are latches with places of their own.
    own: bool,
}

/// The judgement.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// What happened.
    pub outcome: Outcome,
    /// When it was decided, s.
    pub time_s: f64,
    /// Why, in one line.
    pub reason: String,
}

impl Monitor {
    /// First touch, s.
    #[must_use]
    pub const fn first_contact_s(&self) -> Option<f64> {
        self.first_contact_s
    }

    /// A limit that was passed.
    #[must_use]
    pub const fn limit(&self) -> Option<&LimitPassed> {
        self.limit.as_ref()
    }

    /// Number of latches as it is told: three of a mechanism without any.
    const fn counted(&self) -> usize {
        if self.own { self.latches } else { 3 }
    }

    /// Called every tick.
    pub fn observe(&mut self, m: &DockingMechanism, state: &MechanismState, o: &Observation) {
        let rules = &m.outcome;
        let offset = DVec3::new(0.0, o.x_ring.p.y, o.x_ring.p.z).length();
        let height = |s: &docktwin_model::SideGeometry| {
            let guides = s.petals.map_or(0.0, |p| p.height_m + 0.5 * p.thickness_m)
                + s.ring.section_radius_m;
            guides.max(s.surfaces_top_m().unwrap_or(0.0))
        };
        let petals = height(&m.active).max(height(&m.passive));
        if o.touching {
            self.first_contact_s.get_or_insert(o.time_s);
            self.last_contact_s = Some(o.time_s);
        }
        if !self.closest_seen || o.x_ring.p.x < self.closest_m {
            self.closest_seen = true;
            self.closest_m = o.x_ring.p.x;
            self.offset_at_closest_m = offset;
        }
        // The guided zone: the sides touch or their petals overlap axially, and the centres are near
        // enough sideways.
        let beside = o.touching || o.x_ring.p.x <= 2.0 * petals;
        if beside && offset <= rules.guided_radius_m {
            self.guided = true;
            self.touched_guided |= o.touching;
        }
        self.limit = self.limit.or(o.limit);
        self.latches = m.latch_count();
        self.latched = state.all_latches().filter(|l| l.phase == LatchPhase::Latched).count();
        self.own = !m.own_latches.is_empty();
        self.captured_s = state.captured_s();

        let slow = o.relative.v.length() < rules.settled_speed_m_s
            && o.relative.w.length() < rules.settled_rate_rad_s;
        if self.captured_s.is_some() {
            self.settled_s = if slow { self.settled_s.or(Some(o.time_s)) } else { None };
            return;
        }
        let hanging = self.latched > 0 || (o.touching && slow);
        self.jam_since_s = if hanging { self.jam_since_s.or(Some(o.time_s)) } else { None };
        if self.jam_since_s.is_some_and(|since| o.time_s - since > rules.jam_time_s) {
            self.jammed_s.get_or_insert(o.time_s);
        }
        let opening = o.relative.v.x > 0.0;
        if opening && !o.touching && o.x_ring.p.x > petals && self.first_contact_s.is_some() {
            self.separated_s.get_or_insert(o.time_s);
        } else if o.touching {
            self.separated_s = None;
        }
    }

    /// Whether there is nothing more to wait for: a limit passed, attenuation ended, jammed for the
    /// file's time, or parted; none of them while a thrust is on or still to come.
    #[must_use]
    pub fn decided(&self, now_s: f64, thrust_ahead: bool) -> bool {
        let over = self.settled_s.is_some_and(|s| now_s - s > 1.0)
            || self.jammed_s.is_some()
            || self.separated_s.is_some();
        self.limit.is_some() || (over && !thrust_ahead)
    }

    /// The judgement at the end of the run.
    #[must_use]
    pub fn judge(&self, now_s: f64) -> Judgement {
        let of = |outcome, time_s, reason: String| Judgement { outcome, time_s, reason };
        if let Some(l) = &self.limit {
            return of(
                Outcome::LimitExceeded,
                l.time_s,
                format!("{} passed its limit: {:.4} against {:.4}", l.name, l.reached, l.limit),
            );
        }
        if let Some(t) = self.captured_s {
            let how = self.settled_s.map_or_else(
                || "latched to the end of the scenario, attenuation not ended".to_owned(),
                |s| format!("relative motion below the threshold since {s:.3} s"),
            );
            return of(
                Outcome::Captured,
                t,
                if self.own {
                    format!(
                        "{} of {} latches caught at {t:.3} s; {how}",
                        self.latched, self.latches
                    )
                } else {
                    format!("all three latches caught at {t:.3} s; {how}")
                },
            );
        }
        if let Some(t) = self.jammed_s {
            return of(
                Outcome::Jammed,
                t,
                format!("{} of {} latches caught, and no further", self.latched, self.counted()),
            );
        }
        if self.separated_s.is_none() && self.jam_since_s.is_some() {
            return of(
                Outcome::Jammed,
                now_s,
                format!(
                    "{} of {} latches caught when the scenario ended",
                    self.latched,
                    self.counted()
                ),
            );
        }
        if !self.guided || (self.first_contact_s.is_some() && !self.touched_guided) {
            let touch = if self.first_contact_s.is_some() {
                "touched outside"
            } else {
                "never touched; closest outside"
            };
            return of(
                Outcome::Missed,
                self.last_contact_s.unwrap_or(now_s),
                format!(
                    "{touch} the guided zone: centres {:.3} m apart sideways",
                    self.offset_at_closest_m
                ),
            );
        }
        if let (Some(t), true) = (self.separated_s, self.touched_guided) {
            return of(
                Outcome::Rebounded,
                t,
                "separated, opening, beyond the petal height".to_owned(),
            );
        }
        if self.touched_guided {
            return of(
                Outcome::Jammed,
                now_s,
                "inside the guided zone without capture when the scenario ended".to_owned(),
            );
        }
        of(Outcome::Missed, now_s, "no contact before the scenario ended".to_owned())
    }
}
