//! The figures of a summary that follow from the ticks.

use docktwin_record::{Outcome, Summary};

use super::FigureDifference;

/// A figure by its key, as text; numbers with all their digits, so that equal means the same bits.
fn figures(s: &Summary) -> Vec<(String, String)> {
    let number = |x: f64| if x.is_nan() { "null".to_owned() } else { format!("{x:?}") };
    let time = |t: Option<f64>| t.map_or("null".to_owned(), number);
    let latches: Vec<String> = s.latches_s.iter().map(|t| time(*t)).collect();
    let out = vec![
        ("state_digest", s.state_digest.clone()),
        ("ticks", s.ticks.to_string()),
        ("duration_s", number(s.duration_s)),
        ("outcome", s.outcome.to_string()),
        ("first_contact_s", time(s.first_contact_s)),
        ("capture_s", time(s.capture_s)),
        ("latches_s", format!("[{}]", latches.join(", "))),
        ("peak_force_n", number(s.peak_force_n)),
        ("peak_moment_nm", number(s.peak_moment_nm)),
        ("impulse_ns", number(s.impulse_ns)),
        ("net_impulse_ns", time(s.net_impulse_ns)),
        ("peak_penetration_m", number(s.peak_penetration_m)),
        ("energy_in_j", number(s.energy_in_j)),
        ("energy_dissipated_j", number(s.energy_dissipated_j)),
        ("energy_balance_error", number(s.energy_balance_error)),
        ("momentum_error", number(s.momentum_error)),
    ];
    let mut out: Vec<(String, String)> =
        out.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    if let Some(f) = &s.fidelity {
        out.extend(f.figures().into_iter().map(|(key, x)| (format!("fidelity.{key}"), time(x))));
    }
    if let Some(c) = &s.compensator {
        let of = [
            ("correction_rms_n", c.correction_rms_n),
            ("residual_rms_n", c.residual_rms_n),
            ("trust_mean", c.trust_mean),
            ("trust_min", c.trust_min),
            ("fell_back_s", c.fell_back_s),
        ];
        out.extend(of.map(|(key, x)| (format!("compensator.{key}"), time(x))));
    }
    out
}

/// How many figures were compared, and the first that differs.
pub(super) fn compare(recorded: &Summary, replayed: &Summary) -> (usize, Option<FigureDifference>) {
    let pairs = figures(recorded).into_iter().zip(figures(replayed));
    // What stopped a run from outside is in no tick.
    let stopped = recorded.outcome == Outcome::Stopped;
    // Not known before 0.3.
    let unknown = |key: &str| key == "net_impulse_ns" && recorded.net_impulse_ns.is_none();
    let left_out = |key: &str| stopped && key == "outcome" || unknown(key);
    let pairs: Vec<_> = pairs.filter(|((key, _), _)| !left_out(key)).collect();
    let count = pairs.len();
    let first = pairs.into_iter().find(|((_, a), (_, b))| a != b);
    let first =
        first.map(|((key, recorded), (_, replayed))| FigureDifference { key, recorded, replayed });
    (count, first)
}
