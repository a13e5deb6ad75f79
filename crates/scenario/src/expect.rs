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

impl Bound {
    const ANY: Self = Self { above: None, below: None, near: None };

    /// Whether it asks for nothing.
    #[must_use]
    pub fn is_any(&self) -> bool {
        *self == Self::ANY
    }
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
    /// What a run without a rig must come to.
    pub run: RunBounds,
    /// Speed at which the ports part after contact, without a rig, m/s.
    pub exit_speed_m_s: Bound,
    /// What a run against a rig must come to.
    pub hil: HilBounds,
    /// How near a run against a rig must come to the simulated system.
    pub fidelity: Vec<FidelityBounds>,
}

/// Times and peaks that a run of either kind must come to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunBounds {
    /// Time of first contact, s.
    pub first_contact_s: Bound,
    /// Time of capture, s.
    pub capture_s: Bound,
    /// Simulated time of the run, s.
    pub duration_s: Bound,
    /// Peak force at the port, N.
    pub peak_force_n: Bound,
    /// Peak moment at the port, N·m.
    pub peak_moment_nm: Bound,
    /// Greatest depth of contact, m.
    pub peak_penetration_m: Bound,
    /// Contact impulse, N·s.
    pub impulse_ns: Bound,
}

/// What only a run against a rig can be judged by; figures of the first contact and the whole run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HilBounds {
    /// Times and peaks, as measured.
    pub run: RunBounds,
    /// `fidelity.R_e`.
    pub r_e: Bound,
    /// `fidelity.R_T`.
    pub r_t: Bound,
    /// `fidelity.delta_energy`: what the loop gained.
    pub delta_energy: Bound,
    /// Size of `fidelity.first_contact_difference_s`, s.
    pub first_contact_difference_s: Bound,
}

/// The two comparisons of a run against a rig with the simulated system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// What the bodies' programme received.
    Felt,
    /// What the article on the rig bore.
    Hardware,
}

impl Compared {
    /// Words by which scenario and summary name them.
    pub const WORDS: [(&'static str, Self); 2] =
        [("felt", Self::Felt), ("hardware", Self::Hardware)];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, x)| *x == self).map_or("", |(w, _)| w)
    }
}

/// From first contact, over what the figures of a comparison count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Window {
    /// To the first latch of the simulated system.
    ToFirstLatch,
    /// To one second after its capture.
    ToCapture,
    /// To the end of the run.
    WholeRun,
}

impl Window {
    /// Words by which scenario and summary name them.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("to_first_latch", Self::ToFirstLatch),
        ("to_capture", Self::ToCapture),
        ("whole_run", Self::WholeRun),
    ];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, x)| *x == self).map_or("", |(w, _)| w)
    }
}

/// Bounds of one comparison over one window; the figures are those of `fidelity` in the summary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FidelityBounds {
    /// Which comparison.
    pub of: Compared,
    /// Which window.
    pub window: Window,
    /// Peak force over that of the simulated system.
    pub peak_force_ratio: Bound,
    /// Peak moment over that of the simulated system.
    pub peak_moment_ratio: Bound,
    /// NRMS of the force.
    pub nrms_force: Bound,
    /// NRMS of the moment.
    pub nrms_moment: Bound,
    /// NRMS of the position.
    pub nrms_pose: Bound,
    /// NRMS of the attitude.
    pub nrms_attitude: Bound,
    /// Impulse over that of the simulated system.
    pub impulse_ratio: Bound,
    /// Energy that the ports gave too much.
    pub delta_energy: Bound,
    /// Size of the difference of the worst latch, s; whatever the window.
    pub latch_difference_s: Bound,
    /// Size of the difference of capture, s; whatever the window.
    pub capture_difference_s: Bound,
}

/// One bound with its names: the key of each end in the file, and the word of the figure.
struct Row<'a> {
    figure: &'static str,
    unit: &'static str,
    /// Of the lower end, of the upper one, and of the value to be met.
    keys: [&'static str; 3],
    bound: &'a Bound,
}

impl Row<'_> {
    /// The keys that the scenario gives of it.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        let b = self.bound;
        let there = [b.above.is_some(), b.below.is_some(), b.near.is_some()];
        self.keys.into_iter().zip(there).filter(|(_, there)| *there).map(|(key, _)| key)
    }
}

/// A row of times.
const fn time<'a>(figure: &'static str, keys: [&'static str; 2], bound: &'a Bound) -> Row<'a> {
    Row { figure, unit: "s", keys: [keys[0], keys[1], ""], bound }
}

/// A row of a figure without unit.
const fn share<'a>(figure: &'static str, keys: [&'static str; 2], bound: &'a Bound) -> Row<'a> {
    Row { figure, unit: "", keys: [keys[0], keys[1], ""], bound }
}

impl RunBounds {
    fn rows(&self) -> [Row<'_>; 7] {
        [
            time(
                "first contact",
                ["first_contact_after_s", "first_contact_before_s"],
                &self.first_contact_s,
            ),
            time("capture", ["capture_after_s", "capture_before_s"], &self.capture_s),
            time("duration", ["duration_after_s", "duration_before_s"], &self.duration_s),
            Row {
                figure: "peak force",
                unit: "N",
                keys: ["peak_force_above_n", "peak_force_below_n", "peak_force_n"],
                bound: &self.peak_force_n,
            },
            Row {
                figure: "peak moment",
                unit: "N·m",
                keys: ["peak_moment_above_nm", "peak_moment_below_nm", ""],
                bound: &self.peak_moment_nm,
            },
            Row {
                figure: "peak penetration",
                unit: "m",
                keys: ["", "peak_penetration_below_m", ""],
                bound: &self.peak_penetration_m,
            },
            Row {
                figure: "impulse",
                unit: "N·s",
                keys: ["impulse_above_ns", "impulse_below_ns", "impulse_ns"],
                bound: &self.impulse_ns,
            },
        ]
    }

    fn failures(&self, run: &Measured) -> Vec<String> {
        let got = [
            run.first_contact_s,
            run.capture_s,
            Some(run.duration_s),
            Some(run.peak_force_n),
            Some(run.peak_moment_nm),
            Some(run.peak_penetration_m),
            Some(run.impulse_ns),
        ];
        self.rows()
            .iter()
            .zip(got)
            .filter_map(|(r, x)| r.bound.failure(r.figure, r.unit, x, "there was none"))
            .collect()
    }
}

impl HilBounds {
    fn rows(&self) -> [Row<'_>; 4] {
        [
            share("R_e", ["R_e_above", "R_e_below"], &self.r_e),
            share("R_T", ["R_T_above", "R_T_below"], &self.r_t),
            share("delta_energy", ["delta_energy_above", "delta_energy_below"], &self.delta_energy),
            time(
                "first_contact_difference_s",
                ["", "first_contact_difference_below_s"],
                &self.first_contact_difference_s,
            ),
        ]
    }
}

impl FidelityBounds {
    fn rows(&self) -> [Row<'_>; 10] {
        [
            share(
                "peak_force_ratio",
                ["peak_force_ratio_above", "peak_force_ratio_below"],
                &self.peak_force_ratio,
            ),
            share(
                "peak_moment_ratio",
                ["peak_moment_ratio_above", "peak_moment_ratio_below"],
                &self.peak_moment_ratio,
            ),
            share("nrms_force", ["", "nrms_force_below"], &self.nrms_force),
            share("nrms_moment", ["", "nrms_moment_below"], &self.nrms_moment),
            share("nrms_pose", ["", "nrms_pose_below"], &self.nrms_pose),
            share("nrms_attitude", ["", "nrms_attitude_below"], &self.nrms_attitude),
            share(
                "impulse_ratio",
                ["impulse_ratio_above", "impulse_ratio_below"],
                &self.impulse_ratio,
            ),
            share("delta_energy", ["delta_energy_above", "delta_energy_below"], &self.delta_energy),
            time("latch_difference_s", ["", "latch_difference_below_s"], &self.latch_difference_s),
            time(
                "capture_difference_s",
                ["", "capture_difference_below_s"],
                &self.capture_difference_s,
            ),
        ]
    }

    /// Whether it bounds nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows().iter().all(|r| r.bound.is_any())
    }

    /// The figure of a row in the summary, by the dotted key below `fidelity`; a size where only sizes count.
    fn figure(&self, name: &str, of: &dyn Fn(&str) -> Option<f64>) -> Option<f64> {
        let side = self.of.word();
        match name {
            // The worst of all; one that is missing is no figure.
            "latch_difference_s" => (0..3).try_fold(0.0_f64, |worst, i| {
                Some(worst.max(of(&format!("{side}.{name}.{i}"))?.abs()))
            }),
            "capture_difference_s" => of(&format!("{side}.{name}")).map(f64::abs),
            _ => of(&format!("{side}.{}.{name}", self.window.word())),
        }
    }

    /// `hardware.to_capture.nrms_force`; differences of times belong to no window.
    fn name(&self, figure: &str) -> String {
        let side = self.of.word();
        if figure.ends_with("_difference_s") {
            format!("{side}.{figure}")
        } else {
            format!("{side}.{}.{figure}", self.window.word())
        }
    }
}

/// What a run came to, for [`Expect::failures`]. A figure that was not computed is NaN and meets no bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// How it ended.
    pub outcome: ExpectedOutcome,
    /// Time of first contact, s.
    pub first_contact_s: Option<f64>,
    /// Time of capture, s.
    pub capture_s: Option<f64>,
    /// Simulated time, s.
    pub duration_s: f64,
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
    /// How a run against a rig must end.
    #[must_use]
    pub fn outcome_of_hil(&self) -> ExpectedOutcome {
        self.hil_outcome.unwrap_or(self.outcome)
    }

    fn ended_otherwise(&self, expected: ExpectedOutcome, got: ExpectedOutcome) -> Option<String> {
        (got != expected)
            .then(|| format!("ended as {got} instead of {expected} ({})", self.because))
    }

    /// What a run without a rig did not meet, one line each; empty means that it passed.
    #[must_use]
    pub fn failures(&self, run: &Measured) -> Vec<String> {
        let mut lines: Vec<String> =
            self.ended_otherwise(self.outcome, run.outcome).into_iter().collect();
        lines.extend(self.run.failures(run));
        let parted = (run.exit_speed_m_s, "there was none");
        lines.extend(self.exit_speed_m_s.failure("exit speed", "m/s", parted.0, parted.1));
        lines
    }

    /// The same of a run against a rig; `fidelity` gives a figure by its dotted key below `fidelity` of the
    /// summary, `None` for one that is null there.
    #[must_use]
    pub fn hil_failures(
        &self,
        run: &Measured,
        fidelity: &dyn Fn(&str) -> Option<f64>,
    ) -> Vec<String> {
        const NULL: &str = "was not computed (null), so no bound of it is met";
        let outcome = self.outcome_of_hil();
        let mut lines: Vec<String> =
            self.ended_otherwise(outcome, run.outcome).into_iter().collect();
        lines.extend(self.hil.run.failures(run));
        for r in self.hil.rows() {
            // Of this one the size counts.
            let size = |x: f64| if r.figure.ends_with("difference_s") { x.abs() } else { x };
            let got = fidelity(r.figure).map(size);
            lines.extend(r.bound.failure(&format!("fidelity.{}", r.figure), r.unit, got, NULL));
        }
        for bounds in &self.fidelity {
            for r in bounds.rows() {
                let name = format!("fidelity.{}", bounds.name(r.figure));
                let got = bounds.figure(r.figure, fidelity);
                lines.extend(r.bound.failure(&name, r.unit, got, NULL));
            }
        }
        lines
    }

    /// Bounds given that a run without a rig does not judge, by their keys.
    #[must_use]
    pub fn not_judged_without_rig(&self) -> Vec<String> {
        let run = self.hil.run.rows();
        let mut out: Vec<String> = run
            .iter()
            .chain(&self.hil.rows())
            .flat_map(Row::given)
            .map(|key| format!("expect.hil.{key}"))
            .collect();
        for (i, bounds) in self.fidelity.iter().enumerate() {
            let rows = bounds.rows();
            out.extend(
                rows.iter().flat_map(Row::given).map(|k| format!("expect.fidelity.{i}.{k}")),
            );
        }
        out
    }

    /// Bounds given that a run against a rig does not judge, by their keys.
    #[must_use]
    pub fn not_judged_by_hil(&self) -> Vec<String> {
        let rows = self.run.rows();
        let exit = self.exit_speed_m_s.near.map(|_| "exit_speed_m_s");
        let given = rows.iter().flat_map(Row::given).chain(exit);
        given.map(|key| format!("expect.{key}")).collect()
    }

    /// Whether the force of a run against a rig is bounded by its NRMS.
    #[must_use]
    pub fn bounds_nrms_force(&self) -> bool {
        self.fidelity.iter().any(|b| !b.nrms_force.is_any())
    }

    /// Whether the energy that the loop gains is bounded.
    #[must_use]
    pub fn bounds_delta_energy(&self) -> bool {
        !self.hil.delta_energy.is_any() || self.fidelity.iter().any(|b| !b.delta_energy.is_any())
    }
}

impl Bound {
    /// Why a figure does not meet it, if it does not; `none` says what there is instead of a figure.
    fn failure(&self, name: &str, unit: &str, got: Option<f64>, none: &str) -> Option<String> {
        if self.is_any() {
            return None;
        }
        let Some(x) = got else { return Some(format!("{name}: {none}")) };
        if x.is_nan() {
            return Some(format!("{name} was not computed (NaN)"));
        }
        let low = self.above.filter(|b| x < *b).map(|b| format!("at least {b}"));
        let high = self.below.filter(|b| x > *b).map(|b| format!("at most {b}"));
        let off = self
            .near
            .filter(|t| (x - t.value).abs() > t.tolerance * t.value.abs())
            .map(|t| format!("{} ± {} %", t.value, 100.0 * t.tolerance));
        let wanted = low.or(high).or(off)?;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        Some(format!("{name} {x}{unit}, expected {wanted}{unit}"))
    }
}
