//! What a compensator with a model did over a run.

use docktwin_control::compensation::{Compensation, Gained};
use docktwin_hil::scheduler::TickRecord;
use docktwin_record::CompensatorSummary;

use crate::event::RunEvent;

/// Sums over the closed loop.
#[derive(Clone, Debug)]
pub(super) struct Compensated {
    method: Compensation,
    ticks: u64,
    correction_n2: f64,
    residual_n2: f64,
    trust: f64,
    least_trust: f64,
    fell_back_s: Option<f64>,
}

impl Compensated {
    pub(super) const fn new(method: Compensation) -> Self {
        Self {
            method,
            ticks: 0,
            correction_n2: 0.0,
            residual_n2: 0.0,
            trust: 0.0,
            least_trust: 1.0,
            fell_back_s: None,
        }
    }

    /// Takes a tick of the closed loop in; tells when the model is given up.
    pub(super) fn take(&mut self, r: &TickRecord, time_s: f64) -> Option<RunEvent> {
        let report = r.compensator_report?;
        let residual = report.residual.port4.f;
        self.ticks += 1;
        self.correction_n2 += r.correction.map_or(0.0, |c| c.port4.f.length_squared());
        self.residual_n2 += residual.length_squared();
        self.trust += report.trust;
        self.least_trust = self.least_trust.min(report.trust);
        let new = report.fallen_back && self.fell_back_s.is_none();
        new.then(|| {
            self.fell_back_s = Some(time_s);
            RunEvent::FellBack { method: self.method.name(), residual_n: residual.length() }
        })
    }

    pub(super) fn summary(&self) -> CompensatorSummary {
        #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
        let n = self.ticks as f64;
        let known = |x: f64| (self.ticks > 0).then_some(x);
        CompensatorSummary {
            name: self.method.name().to_owned(),
            lead_s: self.method.lead_s(),
            correction_rms_n: known((self.correction_n2 / n).sqrt()),
            residual_rms_n: known((self.residual_n2 / n).sqrt()),
            trust_mean: known(self.trust / n),
            trust_min: known(self.least_trust),
            fell_back_s: self.fell_back_s,
        }
    }

    /// For a reader, where the model was given up.
    pub(super) fn warning(&self) -> Option<String> {
        self.fell_back_s.map(|t| {
            format!(
                "`{}` gave its model up at {t:.3} s: what was measured was too far from what it expected; from \
                 then on its command alone compensates",
                self.method.name()
            )
        })
    }
}

/// What has been said of the loop's energy.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EnergyTold {
    told: bool,
    damped: bool,
}

impl EnergyTold {
    /// Tells once that the loop gains energy, and once that it is damped.
    pub(super) fn take(&mut self, r: &TickRecord) -> Option<RunEvent> {
        let g = r.gained?;
        let new = g.damped && !self.damped || g.told && !self.told;
        (self.damped, self.told) = (self.damped || g.damped, self.told || g.told);
        let Gained { share, energy_j, damped, .. } = g;
        new.then_some(RunEvent::EnergyGained { share, energy_j, damped })
    }
}
