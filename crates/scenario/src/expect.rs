use core::fmt;

/// The ways in which a run may end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExpectedOutcome {
    /// All three latches caught, and motion decayed or time ended.
    Captured,
    /// In contact inside the guided zone, and parted.
    Rebounded,
    /// Never inside the guided zone.
    Missed,
    /// One or two latches caught, or in slow contact, for too long.
    Jammed,
    /// A limit of the mechanism was passed.
    LimitExceeded,
    /// Stopped by the safety supervisor.
    Stopped,
}

impl ExpectedOutcome {
    /// Words by which scenario and summary name the outcomes.
    pub const WORDS: [(&'static str, Self); 6] = [
        ("captured", Self::Captured),
        ("rebounded", Self::Rebounded),
        ("missed", Self::Missed),
        ("jammed", Self::Jammed),
        ("limit_exceeded", Self::LimitExceeded),
        ("stopped", Self::Stopped),
    ];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, o)| *o == self).map_or("", |(w, _)| w)
    }
}

impl fmt::Display for ExpectedOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A value that must be met within a relative tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// The value, in the unit of its field.
    pub value: f64,
    /// Largest relative deviation.
    pub tolerance: f64,
}

/// A quantity of the run and what is asked of it; every part may be absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bound {
    /// At least.
    pub above: Option<f64>,
    /// At most.
    pub below: Option<f64>,
    /// Within a tolerance.
    pub near: Option<Target>,
}

/// What makes the verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Expect {
    /// How the run must end.
    pub outcome: ExpectedOutcome,
    /// How a run against a rig must end, where that is something else.
    pub hil_outcome: Option<ExpectedOutcome>,
    /// Why physics gives this.
    pub because: String,
    /// Time of first contact, s.
    pub first_contact_s: Bound,
    /// Time of capture, s.
    pub capture_s: Bound,
    /// Peak force at the port, N.
    pub peak_force_n: Bound,
    /// Peak moment at the port, N·m.
    pub peak_moment_nm: Bound,
    /// Greatest depth of contact, m.
    pub peak_penetration_m: Bound,
    /// Contact impulse, N·s.
    pub impulse_ns: Bound,
    /// Speed at which the ports part after contact, m/s.
    pub exit_speed_m_s: Bound,
}

/// What a run came to, for [`Expect::failures`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// How it ended.
    pub outcome: ExpectedOutcome,
    /// Time of first contact, s.
    pub first_contact_s: Option<f64>,
    /// Time of capture, s.
    pub capture_s: Option<f64>,
    /// Peak force at the port, N.
    pub peak_force_n: f64,
    /// Peak moment at the port, N·m.
    pub peak_moment_nm: f64,
    /// Greatest depth of contact, m.
    pub peak_penetration_m: f64,
    /// Contact impulse, N·s.
    pub impulse_ns: f64,
    /// Speed at which the ports parted after the last contact, m/s; `None` while together.
    pub exit_speed_m_s: Option<f64>,
}

impl Expect {
    /// What is expected of a run against a rig: the outcome alone. Bounds are of the docking without a
    /// rig; the deviation of the rig is reported as fidelity.
    #[must_use]
    pub fn of_hil(&self) -> Self {
        let any = Bound::default();
        Self {
            outcome: self.hil_outcome.unwrap_or(self.outcome),
            first_contact_s: any,
            capture_s: any,
            peak_force_n: any,
            peak_moment_nm: any,
            peak_penetration_m: any,
            impulse_ns: any,
            exit_speed_m_s: any,
            ..self.clone()
        }
    }

    /// What the run did not meet, one line each; empty means that it passed.
    #[must_use]
    pub fn failures(&self, run: &Measured) -> Vec<String> {
        let mut lines = Vec::new();
        if run.outcome != self.outcome {
            lines.push(format!(
                "ended as {} instead of {} ({})",
                run.outcome, self.outcome, self.because
            ));
        }
        let mut check = |name: &str, unit: &str, bound: &Bound, got: Option<f64>| {
            lines.extend(bound.failure(name, unit, got));
        };
        check("first contact", "s", &self.first_contact_s, run.first_contact_s);
        check("capture", "s", &self.capture_s, run.capture_s);
        check("peak force", "N", &self.peak_force_n, Some(run.peak_force_n));
        check("peak moment", "N·m", &self.peak_moment_nm, Some(run.peak_moment_nm));
        check("peak penetration", "m", &self.peak_penetration_m, Some(run.peak_penetration_m));
        check("impulse", "N·s", &self.impulse_ns, Some(run.impulse_ns));
        check("exit speed", "m/s", &self.exit_speed_m_s, run.exit_speed_m_s);
        lines
    }
}

impl Bound {
    fn failure(&self, name: &str, unit: &str, got: Option<f64>) -> Option<String> {
        if *self == Self::default() {
            return None;
        }
        let Some(x) = got else { return Some(format!("{name}: there was none")) };
        // A NaN fails every bound.
        let low = self.above.filter(|b| x < *b || x.is_nan()).map(|b| format!("at least {b}"));
        let high = self.below.filter(|b| x > *b || x.is_nan()).map(|b| format!("at most {b}"));
        let off = self
            .near
            .filter(|t| (x - t.value).abs() > t.tolerance * t.value.abs() || x.is_nan())
            .map(|t| format!("{} ± {} %", t.value, 100.0 * t.tolerance));
        let wanted = low.or(high).or(off)?;
        Some(format!("{name} {x} {unit}, expected {wanted} {unit}"))
    }
}
