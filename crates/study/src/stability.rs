//! What can be tested on a rig: contact frequency over delay over what is believed wrongly, for every method against
//! the delay.
//!
//! A cell is one test of Table 4 ([`crate::table4`]): the frequency is that of its row, the delay is that of the rig and
//! so many ticks more, which the loop knows, and the mismatch is what it does not know. All four figures of the first
//! contact count: R_e, R_T, peak and the RMS error of the force.

use docktwin_control::compensation::Compensation;
use docktwin_core::PERIOD_NS;
use docktwin_hil::scheduler::RigParameters;
use docktwin_model::HydraulicPreset;
use serde::{Deserialize, Serialize};

use crate::{
    Progress,
    parallel::in_parallel,
    table4::{Axis, TABLE_4, VibroTest},
    vibro_impact::{
        ContactFigures, EmulatedTestError, RigDraw, VibroImpactError, VibroModels, VibroOptions,
        on_emulated_rig,
    },
};

/// What is believed wrongly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mismatch {
    /// Nothing.
    None,
    /// The delay: the lead is longer by this than it should be, s.
    Lead(f64),
    /// The stick, which is so many times as stiff as believed.
    Stiffness(f64),
}

impl Mismatch {
    /// What an identification and a mechanism as built leave: half a tick and a tick, a fifth of the stiffness.
    pub const ALL: [Self; 7] = [
        Self::None,
        Self::Lead(-1e-3),
        Self::Lead(-5e-4),
        Self::Lead(5e-4),
        Self::Lead(1e-3),
        Self::Stiffness(0.8),
        Self::Stiffness(1.25),
    ];

    /// In words.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::None => "as believed".to_owned(),
            Self::Lead(s) => format!("lead {:+.1} ms", s * 1e3),
            Self::Stiffness(by) => format!("stiffness x {by}"),
        }
    }
}

/// What is run.
#[derive(Clone, Debug, PartialEq)]
pub struct StabilityOptions {
    /// Methods, each with any lead: it gets that of its cell.
    pub methods: Vec<Compensation>,
    /// The axis that moves.
    pub axis: Axis,
    /// Ticks by which every command is held back, which the loop knows.
    pub added_ticks: Vec<usize>,
    /// What is believed wrongly.
    pub mismatches: Vec<Mismatch>,
    /// Oil volume; without one, the rig file's default.
    pub preset: Option<HydraulicPreset>,
    /// Seed of the sensors' noise.
    pub seed: u64,
}

impl StabilityOptions {
    fn of_test(&self, compensation: Compensation, added_ticks: usize) -> VibroOptions {
        let (preset, seed) = (self.preset, self.seed);
        VibroOptions { preset, seed, added_ticks, ..VibroOptions::new(compensation) }
    }
}

/// One test with one method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Name of the method.
    pub method: String,
    /// Row of Table 4, from 1.
    pub case: usize,
    /// Frequency of the contact, Hz.
    pub frequency_hz: f64,
    /// Delay beyond that of the rig, s.
    pub added_s: f64,
    /// What is believed wrongly.
    pub mismatch: Mismatch,
    /// The first contact; `None` where none began and ended before a limit stopped the test.
    pub contact: Option<ContactFigures>,
    /// The limit that stopped the test.
    pub stopped_by: Option<String>,
}

impl Cell {
    /// Largest of what R_e, R_T and the peak are off by and the RMS error of the force, parts of one; `None` without
    /// a contact.
    #[must_use]
    pub fn worst(&self) -> Option<f64> {
        let c = self.contact?;
        let off = [c.r_e - 1.0, c.r_t - 1.0, c.peak_force_ratio - 1.0, c.nrms_force];
        off.iter().all(|x| x.is_finite()).then(|| off.iter().fold(0.0, |m: f64, x| m.max(x.abs())))
    }

    /// Whether all figures are within a part of one.
    #[must_use]
    pub fn within(&self, part: f64) -> bool {
        self.worst().is_some_and(|x| x <= part)
    }
}

/// The map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stability {
    /// Name of the rig.
    pub rig: String,
    /// Lag of plate and sensor that is believed, s.
    pub lead_s: f64,
    /// Axis that moved.
    pub axis: String,
    /// By method, delay, mismatch and row.
    pub cells: Vec<Cell>,
}

/// Parts of one that a map tells of.
pub const LEVELS: [f64; 3] = [0.01, 0.02, 0.05];

/// What one method reaches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// Name of the method.
    pub method: String,
    /// Cells that were run.
    pub cells: usize,
    /// Of these, with all figures within 1, 2 and 5 %.
    pub within: [usize; 3],
    /// Highest frequency, Hz, up to which all rows are within 1, 2 and 5 % with nothing believed wrongly and the least
    /// delay that was run; `None` where the first is not.
    pub up_to_hz: [Option<f64>; 3],
    /// The same with the worst of what is believed wrongly.
    pub up_to_hz_mismatched: [Option<f64>; 3],
}

impl Stability {
    /// Names of the methods, in their order.
    #[must_use]
    pub fn methods(&self) -> Vec<&str> {
        let mut out: Vec<&str> = Vec::new();
        for c in &self.cells {
            if !out.contains(&c.method.as_str()) {
                out.push(&c.method);
            }
        }
        out
    }

    /// Delays that were added, s, in their order.
    #[must_use]
    pub fn delays_s(&self) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::new();
        for c in &self.cells {
            if out.iter().all(|s| s.to_bits() != c.added_s.to_bits()) {
                out.push(c.added_s);
            }
        }
        out
    }

    /// Cells of a method.
    pub fn of<'a>(&'a self, method: &'a str) -> impl Iterator<Item = &'a Cell> {
        self.cells.iter().filter(move |c| c.method == method)
    }

    /// What each method reaches.
    #[must_use]
    pub fn reach(&self) -> Vec<Reach> {
        let least_s = self.delays_s().into_iter().fold(f64::INFINITY, f64::min);
        let of = |method: &&str| {
            let cells: Vec<&Cell> = self.of(method).collect();
            let up_to = |part: f64, all: bool| {
                let counts =
                    |c: &&&Cell| c.added_s <= least_s && (all || c.mismatch == Mismatch::None);
                up_to_hz(cells.iter().filter(counts).copied(), part)
            };
            Reach {
                method: (*method).to_owned(),
                cells: cells.len(),
                within: LEVELS.map(|part| cells.iter().filter(|c| c.within(part)).count()),
                up_to_hz: LEVELS.map(|part| up_to(part, false)),
                up_to_hz_mismatched: LEVELS.map(|part| up_to(part, true)),
            }
        };
        self.methods().iter().map(of).collect()
    }

    /// Of the cells in which `other` has all figures within a part of one: how many, and in how many of them `method`
    /// has too.
    #[must_use]
    pub fn held(&self, method: &str, other: &str, part: f64) -> [usize; 2] {
        let theirs = self.of(other).filter(|c| c.within(part));
        let same = |a: &Cell, b: &Cell| {
            (a.case, a.mismatch) == (b.case, b.mismatch)
                && a.added_s.to_bits() == b.added_s.to_bits()
        };
        theirs.fold([0, 0], |[n, held], cell| {
            let too = self.of(method).any(|c| same(c, cell) && c.within(part));
            [n + 1, held + usize::from(too)]
        })
    }
}

/// Highest frequency up to which all cells are within a part of one.
fn up_to_hz<'a>(cells: impl Iterator<Item = &'a Cell>, part: f64) -> Option<f64> {
    let mut rows: Vec<(f64, bool)> = cells.map(|c| (c.frequency_hz, c.within(part))).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let first_out = rows.iter().find(|(_, good)| !good).map_or(f64::INFINITY, |(hz, _)| *hz);
    rows.iter().map(|(hz, _)| *hz).filter(|hz| *hz < first_out).reduce(f64::max)
}

/// Runs the map on the emulated rig, on all cores.
///
/// # Errors
/// Oil that the rig does not have is asked for, the mechanism has no stick, or the rig cannot be emulated.
pub fn stability(
    models: &VibroModels<'_>,
    options: &StabilityOptions,
    progress: &mut (dyn Progress + Send),
) -> Result<Stability, VibroImpactError<EmulatedTestError>> {
    options.of_test(Compensation::None, 0).check(models.rig).map_err(VibroImpactError::Options)?;
    let believed = RigParameters::new(models.rig, None, None);
    let mut plan = Vec::new();
    for method in &options.methods {
        for added in &options.added_ticks {
            for mismatch in &options.mismatches {
                plan.extend((1..=TABLE_4.len()).map(|case| (*method, *added, *mismatch, case)));
            }
        }
    }
    let cells = in_parallel(plan.len(), progress, |i| {
        let (method, added, mismatch, case) = plan[i];
        cell(models, options, &believed, (method, added, mismatch, case))
    })?;
    Ok(Stability {
        rig: models.rig.name.clone(),
        lead_s: believed.lead_s,
        axis: options.axis.name().to_owned(),
        cells,
    })
}

fn cell(
    models: &VibroModels<'_>,
    options: &StabilityOptions,
    believed: &RigParameters,
    (method, added, mismatch, case): (Compensation, usize, Mismatch, usize),
) -> Result<Cell, VibroImpactError<EmulatedTestError>> {
    #[expect(clippy::cast_precision_loss, reason = "30 ticks at most, of 1e6 ns")]
    let added_s = added as f64 * PERIOD_NS as f64 * 1e-9;
    let off_s = if let Mismatch::Lead(s) = mismatch { s } else { 0.0 };
    let lead_s = (believed.lead_s + added_s + off_s).max(0.0);
    let row = TABLE_4[case - 1];
    let no_stick = || VibroImpactError::NoStick { mechanism: models.stick.name.clone() };
    let test = VibroTest::new(row, &[options.axis], models.spacecraft, models.stick)
        .ok_or_else(no_stick)?;
    let test = if let Mismatch::Stiffness(by) = mismatch { test.with_stick(by, 0.0) } else { test };
    let of_test = options.of_test(method.with_lead_s(lead_s), added);
    let run = on_emulated_rig(models.rig, &of_test, &test, RigDraw::File)?.run;
    Ok(Cell {
        method: method.name().to_owned(),
        case,
        frequency_hz: row.frequency_hz,
        added_s,
        mismatch,
        contact: run.contacts.first().map(ContactFigures::from),
        stopped_by: run.trip.map(|t| t.limit.name().to_owned()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(method: &str, hz: f64, off: f64) -> Cell {
        let contact = ContactFigures {
            r_e: 1.0 + off,
            r_t: 1.0,
            r_t_sensed: 1.0,
            peak_force_ratio: 1.0,
            nrms_force: 0.0,
            nrms_position: 0.0,
            delta_energy: 0.0,
            begin_s: 0.0,
            v0_m_s: 1.0,
            v1_m_s: 1.0,
        };
        Cell {
            method: method.to_owned(),
            case: 1,
            frequency_hz: hz,
            added_s: 0.0,
            mismatch: Mismatch::None,
            contact: Some(contact),
            stopped_by: None,
        }
    }

    #[test]
    fn oracle_a_region_ends_at_the_first_row_that_is_out() {
        let mut cells = vec![cell("a", 1.0, 0.001), cell("a", 2.0, 0.03), cell("a", 3.0, 0.001)];
        cells.extend([cell("b", 1.0, -0.015), cell("b", 2.0, 0.06)]);
        for (i, c) in cells.iter_mut().enumerate() {
            c.case = [1, 2, 3, 1, 2][i];
        }
        let map = Stability { rig: String::new(), lead_s: 0.0, axis: "x".to_owned(), cells };
        let reach = map.reach();
        assert_eq!(reach[0].within, [2, 2, 3]);
        assert_eq!(reach[0].up_to_hz, [Some(1.0), Some(1.0), Some(3.0)]);
        assert_eq!(reach[1].up_to_hz, [None, Some(1.0), Some(1.0)]);
        assert_eq!(map.held("a", "b", 0.02), [1, 1]);
        assert_eq!(map.held("b", "a", 0.02), [2, 1]);
        let nothing = Cell { contact: None, ..cell("a", 1.0, 0.0) };
        assert!(!nothing.within(1.0) && nothing.worst().is_none());
    }
}
