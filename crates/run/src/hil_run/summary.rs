//! What a summary says of loop and supervisor.

use docktwin_record::{LatenessUs, LoopSummary, PhaseUs, SafetySummary, StepUs};

use super::Ended;

#[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
fn microseconds(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

pub(super) fn milliseconds(ns: u64) -> f64 {
    microseconds(ns) * 1e-3
}

/// Computing time of whole ticks of the loop.
pub(super) fn step_summary(ended: &Ended) -> StepUs {
    let compute = ended.times.compute.latencies();
    StepUs {
        p50: microseconds(compute.p50_ns),
        p99: microseconds(compute.p99_ns),
        p999: microseconds(compute.p999_ns),
        max: microseconds(compute.max_ns),
        n: compute.n,
    }
}

pub(super) fn loop_summary(ended: &Ended) -> LoopSummary {
    let l = ended.times.lateness.latencies();
    LoopSummary {
        period_us: 1000.0,
        late: ended.late,
        missed: ended.missed,
        lateness_us: LatenessUs {
            p50: microseconds(l.p50_ns),
            p99: microseconds(l.p99_ns),
            p999: microseconds(l.p999_ns),
            max: microseconds(l.max_ns),
        },
        phases: ended
            .times
            .phases
            .iter()
            .map(|(name, l)| {
                let phase = PhaseUs {
                    p50: microseconds(l.p50_ns),
                    p99: microseconds(l.p99_ns),
                    max: microseconds(l.max_ns),
                };
                (name.to_owned(), phase)
            })
            .collect(),
        lead_ms: Some(ended.leads_s[0] * 1e3),
        believed_lead_ms: Some(ended.leads_s[1] * 1e3),
    }
}

pub(super) fn safety_summary(ended: &Ended) -> SafetySummary {
    let trips = ended.end.trip.map(|t| {
        format!("tick {}: {} {:.4}, allowed {:.4}", t.tick, t.limit.name(), t.value, t.allowed)
    });
    SafetySummary {
        state: if ended.end.trip.is_some() { "stopped" } else { "normal" }.to_owned(),
        trips: trips.into_iter().collect(),
        min_margin: ended
            .end
            .margins
            .iter()
            .map(|(limit, margin)| (limit.name().to_owned(), margin))
            .collect(),
    }
}
