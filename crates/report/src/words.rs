//! Numbers as people read them.

/// With a true minus sign.
fn minus(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// Three significant digits.
pub(crate) fn three(x: f64) -> String {
    if !x.is_finite() {
        return "–".to_owned();
    }
    let a = x.abs();
    if a < f64::MIN_POSITIVE {
        return "0".to_owned();
    }
    if a >= 1e6 || (a > 0.0 && a < 1e-4) {
        return exponent(x);
    }
    let decimals = if a >= 99.95 {
        0
    } else if a >= 9.995 {
        1
    } else if a >= 0.9995 {
        2
    } else if a >= 0.09995 {
        3
    } else {
        4
    };
    minus(format!("{x:.decimals$}"))
}

/// `2.4 × 10⁻⁶`
pub(crate) fn exponent(x: f64) -> String {
    if !x.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{x:.1e}");
    let Some((m, e)) = text.split_once('e') else { return text };
    let digits: String = e
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            d => char::from_u32(0x2070 + d.to_digit(10).unwrap_or(0)).unwrap_or(d),
        })
        .collect();
    minus(if e == "0" { m.to_owned() } else { format!("{m} × 10{digits}") })
}

/// `640 N`, `1.91 kN`
pub(crate) fn newtons(f: f64) -> String {
    if f.abs() < 999.5 { format!("{} N", three(f)) } else { format!("{} kN", three(f * 1e-3)) }
}

/// `0.34 µm`, `0.216 mm`, `1.20 m`
pub(crate) fn metres(x: f64) -> String {
    match x.abs() {
        a if a >= 0.1 => format!("{} m", three(x)),
        a if (1e-12..1e-5).contains(&a) => format!("{} µm", three(x * 1e6)),
        _ => format!("{} mm", three(x * 1e3)),
    }
}

/// `14 ms`, `1.20 s`
pub(crate) fn seconds(t: f64) -> String {
    if t.abs() < 0.9995 { format!("{:.0} ms", t * 1e3) } else { format!("{} s", three(t)) }
}

/// An instant, `0.714 s`.
pub(crate) fn at(t: f64) -> String {
    format!("{t:.3} s")
}

/// `31.2 MB`
pub(crate) fn bytes(n: u64) -> String {
    #[expect(clippy::cast_precision_loss, reason = "a size for a reader")]
    let n = n as f64;
    if n < 1e3 {
        format!("{n:.0} B")
    } else if n < 1e6 {
        format!("{} kB", three(n * 1e-3))
    } else {
        format!("{} MB", three(n * 1e-6))
    }
}

/// `1 touch`, `3 touches`
pub(crate) fn count<N: core::fmt::Display + PartialEq + From<u8>>(
    n: N,
    one: &str,
    many: &str,
) -> String {
    if n == N::from(1) { format!("1 {one}") } else { format!("{n} {many}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_numbers_read_well() {
        assert_eq!(newtons(1912.4), "1.91 kN");
        assert_eq!(newtons(999.6), "1.00 kN");
        assert_eq!(newtons(-36.26), "−36.3 N");
        assert_eq!(metres(0.000_216_3), "0.216 mm");
        assert_eq!(metres(1.2e-6), "1.20 µm");
        assert_eq!(seconds(0.014), "14 ms");
        assert_eq!(three(-0.000_01), "−1.0 × 10⁻⁵");
        assert_eq!(exponent(2.4e-6), "2.4 × 10⁻⁶");
        assert_eq!(bytes(27_923_733), "27.9 MB");
        assert_eq!(three(f64::NAN), "–");
        assert_eq!(three(-0.0), "0");
    }
}
