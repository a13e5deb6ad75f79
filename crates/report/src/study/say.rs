//! Numbers in words.

/// A number with three digits and its unit, in the unit's usual multiple.
pub(super) fn say(x: f64, unit: &str) -> String {
    let digits = |v: f64| match v.abs() {
        a if a >= 99.95 => format!("{v:.0}"),
        a if a >= 9.995 => format!("{v:.1}"),
        a if a >= 0.9995 => format!("{v:.2}"),
        _ => format!("{v:.3}"),
    };
    match unit {
        "m" => format!("{} mm", digits(x * 1e3)),
        "rad" => format!("{} deg", digits(x.to_degrees())),
        _ if x.abs() >= 1e4 => format!("{x:.2e} {unit}"),
        _ if x.abs() < 5e-4 => format!("0 {unit}"),
        _ => format!("{} {unit}", digits(x)),
    }
}

#[cfg(test)]
mod tests {
    use super::say;

    #[test]
    fn oracle_numbers_are_told_with_three_digits() {
        assert_eq!(say(0.1234, "m"), "123 mm");
        assert_eq!(say(-0.000_95, "m"), "-0.950 mm");
        assert_eq!(say(0.174_532_9, "rad"), "10.0 deg");
        assert_eq!(say(3e5, "N/m"), "3.00e5 N/m");
        assert_eq!(say(1e-7, "N"), "0 N");
        assert_eq!(say(800.04, "N/m"), "800 N/m");
    }
}
