//! Round numbers along an axis.

/// Ticks of an axis, in its own coordinate, with their labels.
pub(crate) struct Ticks {
    /// (coordinate, label)
    pub(crate) at: Vec<(f64, String)>,
    /// Power of ten the labels leave to the unit.
    pub(crate) exponent: i32,
}

/// About `count` round numbers between `from` and `to`.
pub(crate) fn linear(from: f64, to: f64, count: f64) -> Ticks {
    let rough = (to - from) / count.max(1.0);
    let magnitude = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|s| s * magnitude)
        .find(|s| *s >= rough * (1.0 - 1e-9))
        .unwrap_or(magnitude);
    let largest = from.abs().max(to.abs());
    #[expect(clippy::cast_possible_truncation, reason = "exponents of f64")]
    let exponent = if (1e-2..1e5).contains(&largest) {
        0
    } else {
        ((largest.log10() / 3.0).floor() * 3.0) as i32
    };
    let unit = 10f64.powi(exponent);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 12")]
    let decimals = (-(step / unit).log10() + 1e-9).ceil().clamp(0.0, 12.0) as usize;
    let mut at = Vec::new();
    let first = (from / step - 1e-6).ceil();
    for k in 0..200 {
        let value = (first + f64::from(k)) * step;
        if value > to + 1e-6 * step {
            break;
        }
        at.push((value, number(value / unit, decimals)));
    }
    Ticks { at, exponent }
}

/// Decades between 10^`from` and 10^`to`, or round numbers where there are fewer than two.
pub(crate) fn log(from: f64, to: f64) -> Ticks {
    let digits: &[f64] = match to - from {
        span if span > 2.5 => &[1.0],
        span if span > 1.2 => &[1.0, 3.0],
        _ => &[1.0, 2.0, 3.0, 5.0, 7.0],
    };
    // Powers or plain numbers, not both on one axis.
    let plain = from >= -3.0 - 1e-9 && to < 5.3;
    let mut at = Vec::new();
    #[expect(clippy::cast_possible_truncation, reason = "exponents of f64")]
    for e in from.floor() as i32..=to.ceil() as i32 {
        for d in digits {
            let x = f64::from(e) + d.log10();
            if (from - 1e-9..=to + 1e-9).contains(&x) {
                let decimals = usize::try_from(-e).unwrap_or(0);
                let text = if plain {
                    number(d * 10f64.powi(e), decimals)
                } else if *d > 1.0 {
                    format!("{d}·{}", power(e))
                } else {
                    power(e)
                };
                at.push((x, text));
            }
        }
    }
    Ticks { at, exponent: 0 }
}

/// With a true minus sign, never a minus zero.
pub(crate) fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// `10⁻⁶`
pub(crate) fn power(e: i32) -> String {
    let plain = e.to_string();
    let digits = plain.chars().map(|c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        d => char::from_u32(0x2070 + d.to_digit(10).unwrap_or(0)).unwrap_or(d),
    });
    format!("10{}", digits.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(t: &Ticks) -> Vec<&str> {
        t.at.iter().map(|(_, l)| l.as_str()).collect()
    }

    #[test]
    fn oracle_ticks_are_round_and_inside() {
        assert_eq!(labels(&linear(-0.31, 0.92, 5.0)), ["0.0", "0.5"]);
        assert_eq!(labels(&linear(-0.31, 0.92, 7.0)), ["−0.2", "0.0", "0.2", "0.4", "0.6", "0.8"]);
        assert_eq!(labels(&linear(0.0, 2500.0, 5.0)), ["0", "500", "1000", "1500", "2000", "2500"]);
        let large = linear(0.0, 4.2e5, 4.0);
        assert_eq!((labels(&large), large.exponent), (vec!["0", "200", "400"], 3));
        let small = linear(0.0, 4.2e-5, 4.0);
        assert_eq!((labels(&small), small.exponent), (vec!["0", "20", "40"], -6));
    }

    #[test]
    fn oracle_decades() {
        assert_eq!(labels(&log(-1.0, 2.0)), ["0.1", "1", "10", "100"]);
        assert_eq!(labels(&log(0.0, 1.0)), ["1", "2", "3", "5", "7", "10"]);
        assert_eq!(labels(&log(3.0, 6.0)), ["10³", "10⁴", "10⁵", "10⁶"]);
        assert_eq!(labels(&log(-8.0, -5.0)), ["10⁻⁸", "10⁻⁷", "10⁻⁶", "10⁻⁵"]);
    }
}
