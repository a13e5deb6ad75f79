//! Numbers as JSON has them.

use serde::{Deserialize, Deserializer, Serialize};

/// For `deserialize_with`: JSON has no NaN and no infinity; they are written as null and come back as
/// NaN.
pub(crate) fn null_is_nan<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(d)?.unwrap_or(f64::NAN))
}

/// The same for a pair.
pub(crate) fn null_is_nan_pair<'de, D: Deserializer<'de>>(d: D) -> Result<[f64; 2], D::Error> {
    Ok(<[Option<f64>; 2]>::deserialize(d)?.map(|x| x.unwrap_or(f64::NAN)))
}

/// The largest of all values and 0; NaN when one of them is NaN, so that what could not be computed is
/// never taken for small.
pub(crate) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most: f64, x| if most.is_nan() || x <= most { most } else { x })
}

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// Size, dB; −∞ for zero.
    #[must_use]
    pub fn db(self) -> f64 {
        20.0 * nalgebra::Complex::from(self).norm().log10()
    }

    /// Phase, degrees, −180 to 180.
    #[must_use]
    pub fn phase_deg(self) -> f64 {
        nalgebra::Complex::from(self).arg().to_degrees()
    }

    /// This number divided by another one.
    #[must_use]
    pub fn over(self, other: Self) -> Self {
        (nalgebra::Complex::from(self) / nalgebra::Complex::from(other)).into()
    }
}

impl From<nalgebra::Complex<f64>> for Complex {
    fn from(z: nalgebra::Complex<f64>) -> Self {
        Self { re: z.re, im: z.im }
    }
}

impl From<Complex> for nalgebra::Complex<f64> {
    fn from(z: Complex) -> Self {
        Self { re: z.re, im: z.im }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_what_was_not_computed_is_not_small() {
        assert_eq!(largest([0.5, 2.0, 1.0].into_iter()).to_bits(), 2f64.to_bits());
        assert!(largest([0.5, f64::NAN, 1.0].into_iter()).is_nan());
        assert_eq!(largest(core::iter::empty()).to_bits(), 0f64.to_bits());
    }

    #[test]
    fn invariant_infinite_numbers_come_back_as_nan() {
        #[derive(Serialize, Deserialize)]
        struct Both {
            #[serde(deserialize_with = "null_is_nan")]
            one: f64,
            #[serde(deserialize_with = "null_is_nan_pair")]
            pair: [f64; 2],
        }
        let text = serde_json::to_string(&Both { one: f64::NAN, pair: [f64::INFINITY, 1.5] });
        let text = text.expect("JSON");
        assert_eq!(text, r#"{"one":null,"pair":[null,1.5]}"#);
        let back: Both = serde_json::from_str(&text).expect("JSON");
        assert!(back.one.is_nan() && back.pair[0].is_nan());
        assert_eq!(back.pair[1].to_bits(), 1.5f64.to_bits());
    }

    #[test]
    fn oracle_size_and_phase_of_a_complex_number() {
        let z = Complex { re: 0.0, im: -10.0 };
        assert!((z.db() - 20.0).abs() < 1e-12 && (z.phase_deg() + 90.0).abs() < 1e-12);
        assert_eq!(Complex::from(nalgebra::Complex::from(z)), z);
        assert_eq!(z.over(Complex { re: 0.0, im: 5.0 }), Complex { re: -2.0, im: 0.0 });
    }
}
