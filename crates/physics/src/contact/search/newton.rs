//! Minimum of a smooth function on a box, from a start nearby.

#![expect(clippy::needless_range_loop, reason = "vectors and matrices by their indices")]

/// A value with gradient and matrix of second derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet<const N: usize> {
    pub(crate) f: f64,
    pub(crate) g: [f64; N],
    pub(crate) h: [[f64; N]; N],
}

/// Slopes below this are stationary, in the function's unit per parameter.
const FLAT: f64 = 1e-13;
/// A step this short ends the iteration: Newton's method has squared its error with it.
const SHORT: f64 = 1e-8;

/// Minimises from `z` within `lo` and `hi`: Newton's method on the parameters that are free, with a
/// shift of the second derivatives where they are not positive, at most so many rounds. Never goes up.
pub(crate) fn minimise<const N: usize>(
    z: [f64; N],
    [lo, hi]: [&[f64; N]; 2],
    rounds: usize,
    eval: impl Fn(&[f64; N]) -> Jet<N>,
) -> ([f64; N], Jet<N>) {
    let mut z: [f64; N] = core::array::from_fn(|i| z[i].clamp(lo[i], hi[i]));
    let mut now = eval(&z);
    let mut shift = 0.0;
    for _ in 0..rounds {
        let free = free(&z, lo, hi, &now.g);
        if (0..N).all(|i| !free[i] || now.g[i].abs() < FLAT) {
            break;
        }
        let Some(step) = newton_step(&now, &free, shift) else {
            shift = larger(shift);
            continue;
        };
        let next: [f64; N] = core::array::from_fn(|i| (z[i] + step[i]).clamp(lo[i], hi[i]));
        let moved = (0..N).map(|i| (next[i] - z[i]).abs()).fold(0.0, f64::max);
        if moved <= 0.0 {
            break;
        }
        let there = eval(&next);
        // Where only rounding is left to gain the step is taken all the same.
        if there.f <= now.f + 1e-16 {
            (z, now) = (next, there);
            shift = if shift < 1e-6 { 0.0 } else { 0.1 * shift };
            if moved < SHORT {
                break;
            }
        } else if moved < SHORT {
            break;
        } else {
            shift = larger(shift);
        }
    }
    (z, now)
}

fn larger(shift: f64) -> f64 {
    f64::max(10.0 * shift, 1e-4)
}

/// Which parameters are not held by a bound.
fn free<const N: usize>(z: &[f64; N], lo: &[f64; N], hi: &[f64; N], g: &[f64; N]) -> [bool; N] {
    core::array::from_fn(|i| {
        lo[i] < hi[i] && !(z[i] <= lo[i] && g[i] >= 0.0 || z[i] >= hi[i] && g[i] <= 0.0)
    })
}

/// `−(H + shift)⁻¹ g` on the free parameters; `None` where that is not a way down.
fn newton_step<const N: usize>(at: &Jet<N>, free: &[bool; N], shift: f64) -> Option<[f64; N]> {
    let mut a = [[0.0; N]; N];
    let mut x = [0.0; N];
    for i in 0..N {
        a[i][i] = 1.0;
        if free[i] {
            x[i] = -at.g[i];
            for j in 0..N {
                a[i][j] = if free[j] { at.h[i][j] } else { 0.0 };
            }
            a[i][i] += shift;
        }
    }
    let least: [f64; N] = core::array::from_fn(|i| 1e-9 * a[i][i].abs());
    for i in 0..N {
        if a[i][i] <= least[i] {
            return None;
        }
        for j in i + 1..N {
            let l = a[j][i] / a[i][i];
            for k in i + 1..N {
                a[j][k] -= l * a[i][k];
            }
            x[j] -= l * x[i];
        }
    }
    for i in (0..N).rev() {
        for k in i + 1..N {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
    Some(x)
}

/// Whether a symmetric matrix, given by its upper half, is positive definite.
pub(crate) fn is_positive<const N: usize>(mut m: [[f64; N]; N]) -> bool {
    for i in 0..N {
        if m[i][i] <= 0.0 || m[i][i].is_nan() {
            return false;
        }
        for k in i + 1..N {
            let l = m[i][k] / m[i][i];
            for c in k..N {
                m[k][c] -= l * m[i][c];
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, inside, and against a bound that holds.
    #[test]
    fn oracle_minimum_of_a_curved_valley() {
        let eval = |z: &[f64; 2]| {
            let (x, y) = (z[0], z[1]);
            let r = y - x * x;
            Jet {
                f: (1.0 - x).powi(2) + 100.0 * r * r,
                g: [-2.0 * (1.0 - x) - 400.0 * x * r, 200.0 * r],
                h: [[2.0 - 400.0 * (y - 3.0 * x * x), -400.0 * x], [-400.0 * x, 200.0]],
            }
        };
        let (z, at) = minimise([-1.2, 1.0], [&[-2.0; 2], &[2.0; 2]], 60, eval);
        assert!(at.f < 1e-20 && (z[0] - 1.0).abs() < 1e-9, "{z:?}");
        // With x ≤ 0.5 the least lies at (0.5, 0.25).
        let (z, _) = minimise([-1.2, 1.0], [&[-2.0; 2], &[0.5, 2.0]], 60, eval);
        assert!((z[0] - 0.5).abs() < 1e-12 && (z[1] - 0.25).abs() < 1e-9, "{z:?}");
    }
}
