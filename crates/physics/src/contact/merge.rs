//! How neighbouring samples of one pair of surfaces become places of contact.
//!
//! A pair of surfaces is measured along a one-parameter family (the azimuth of a ring, the rulings
//! of a petal), divided into intervals, each with its deepest point: depth δᵢ, contact point cᵢ,
//! normal nᵢ.
//!
//! **One place.** Samples of one place count once, by a soft maximum of temperature ε
//! (`merge_depth_m`): `δ̂ = ε ln Σ exp(δᵢ/ε)`. Its derivatives `wᵢ = exp((δᵢ − δ̂)/ε)` are positive and
//! add up to one, so the stiffness stays exactly k whatever the number of intervals, forces only
//! push, and a touch spread evenly around a ring acts at its centre. More intervals shift the
//! surface by at most ε ln m, some hundredths of a millimetre.
//!
//! **Two places** of one pair (rings that cross, a ring on both edges of a petal) are separate when
//! the surfaces part between them, and become one when the saddle δₛ between them rises to the lower
//! peak. With C = (δₛ/min(δ₁, δ₂))², the stored energy is
//! `U = (1 − C)(U(δ̂₁) + U(δ̂₂)) + C U(δ̂₁₂)`; for sharp peaks this is U(δ₁) + U(δ₂) − U(δₛ), each peak
//! counted by how far it stands above the saddle. The forces are the exact gradient of U, so the
//! saddles carry forces of the other sign, which cancel that of a peak as it merges.
//! Around a ring there are two saddles; they count by their soft maximum, like the peaks by their
//! soft minimum.

use docktwin_core::DVec3;
use docktwin_model::NormalLaw;

use super::law;

/// Deepest point of one interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Position in the family (azimuth or ruling parameter).
    pub(crate) u: f64,
    /// Depth, m; negative when apart.
    pub(crate) depth: f64,
    /// Contact point.
    pub(crate) c: DVec3,
    /// Unit normal from the active to the passive surface.
    pub(crate) n: DVec3,
    /// Stiffness at this point, N/mⁿ.
    pub(crate) k: f64,
    /// Derivative of the stored energy by tangential displacement of the passive side, divided by
    /// the energy, 1/m: −∂ln k/∂x.
    pub(crate) softening: DVec3,
}

impl Sample {
    pub(crate) const NONE: Self = Self {
        u: 0.0,
        depth: f64::NEG_INFINITY,
        c: DVec3::ZERO,
        n: DVec3::ZERO,
        k: 0.0,
        softening: DVec3::ZERO,
    };
}

/// A resultant of samples: where and how a pair pushes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merged {
    pub(crate) u: f64,
    pub(crate) depth: f64,
    pub(crate) point: DVec3,
    /// Σ w n: force on the passive side per newton.
    pub(crate) dir: DVec3,
    /// Σ w (c − point) × n: moment about `point` per newton.
    pub(crate) couple: DVec3,
    /// Elastic force, N; negative at a saddle.
    pub(crate) elastic_n: f64,
    /// Part of the normal force that rubs, 0 … 1.
    pub(crate) rubbing: f64,
    /// Tangential elastic force on the passive side, N.
    pub(crate) slide_n: DVec3,
    /// Root-mean-square distance of the samples from `point`, m: the lever of the friction that
    /// resists turning about the normal.
    pub(crate) spread_m: f64,
    /// Stored energy that this entry accounts for, J.
    pub(crate) energy_j: f64,
}

impl Merged {
    pub(crate) const ZERO: Self = Self {
        u: 0.0,
        depth: 0.0,
        point: DVec3::ZERO,
        dir: DVec3::ZERO,
        couple: DVec3::ZERO,
        elastic_n: 0.0,
        rubbing: 0.0,
        slide_n: DVec3::ZERO,
        spread_m: 0.0,
        energy_j: 0.0,
    };
}

/// At most two places and the saddles between them.
pub(crate) type Places = ([Option<Merged>; 4], f64);

struct Soft {
    depth: f64,
    m: Merged,
    k: f64,
}

/// Soft maximum over the samples whose indices satisfy `member`.
fn soft(samples: &[Sample], eps: f64, member: impl Fn(usize) -> bool) -> Option<Soft> {
    let peak = samples
        .iter()
        .enumerate()
        .filter(|(i, _)| member(*i))
        .map(|(_, s)| s.depth)
        .fold(f64::NEG_INFINITY, f64::max);
    if peak == f64::NEG_INFINITY {
        return None;
    }
    let mut c2 = 0.0;
    let (mut sum, mut c, mut dir, mut torque, mut k, mut u, mut soften) =
        (0.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0, 0.0, DVec3::ZERO);
    let mut best = f64::NEG_INFINITY;
    for (_, s) in samples.iter().enumerate().filter(|(i, _)| member(*i)) {
        let x = (s.depth - peak) / eps;
        if x < -23.0 {
            continue; // below 1e-10 of the force
        }
        let w = x.exp();
        sum += w;
        c += s.c * w;
        c2 += s.c.length_squared() * w;
        dir += s.n * w;
        torque += s.c.cross(s.n) * w;
        k += s.k * w;
        soften += s.softening * w;
        if s.depth > best {
            best = s.depth;
            u = s.u;
        }
    }
    let inv = 1.0 / sum;
    let (point, dir) = (c * inv, dir * inv);
    let depth = peak + eps * sum.ln();
    Some(Soft {
        depth,
        k: k * inv,
        m: Merged {
            u,
            depth,
            point,
            dir,
            couple: torque * inv - point.cross(dir),
            elastic_n: 0.0,
            rubbing: 1.0,
            slide_n: soften * inv,
            spread_m: (c2 * inv - point.length_squared()).max(0.0).sqrt(),
            energy_j: 0.0,
        },
    })
}

/// Lowest sample strictly between `from` and `to`, walking upwards (cyclically when `closed`).
fn lowest_between(samples: &[Sample], from: usize, to: usize) -> Option<usize> {
    let n = samples.len();
    let mut best = None;
    let mut i = (from + 1) % n;
    while i != to {
        if best.is_none_or(|b: usize| samples[i].depth < samples[b].depth) {
            best = Some(i);
        }
        i = (i + 1) % n;
    }
    best
}

/// The peak that stands out most beside the highest one, with the saddles between them: one on an
/// open family, two around a closed one. Neighbouring samples are never two peaks.
fn second_peak(
    samples: &[Sample],
    top: usize,
    closed: bool,
) -> Option<(usize, usize, Option<usize>)> {
    let n = samples.len();
    let mut found = None;
    let mut best = 0.0;
    for j in 0..n {
        let d = samples[j].depth;
        if j == top || d <= 0.0 {
            continue;
        }
        let left = if j > 0 {
            samples[j - 1].depth
        } else if closed {
            samples[n - 1].depth
        } else {
            f64::NEG_INFINITY
        };
        let right = if j + 1 < n {
            samples[j + 1].depth
        } else if closed {
            samples[0].depth
        } else {
            f64::NEG_INFINITY
        };
        if d < left || d < right {
            continue;
        }
        let (lo, hi) = (top.min(j), top.max(j));
        let Some(inner) = lowest_between(samples, lo, hi) else { continue };
        let outer = if closed {
            // Neighbours across the seam of the circle have no valley between them: one peak.
            let Some(outer) = lowest_between(samples, hi, lo) else { continue };
            Some(outer)
        } else {
            None
        };
        let saddle =
            samples[inner].depth.max(outer.map_or(f64::NEG_INFINITY, |o| samples[o].depth));
        let stands = d * d - saddle.max(0.0).powi(2);
        if stands > best {
            best = stands;
            found = Some((j, inner, outer));
        }
    }
    found
}

/// All samples as one place.
pub(crate) fn single(samples: &[Sample], eps: f64, normal: &NormalLaw) -> Places {
    let Some(all) = soft(samples, eps, |_| true) else {
        return ([None; 4], f64::NEG_INFINITY);
    };
    if all.depth <= 0.0 {
        return ([None; 4], all.depth);
    }
    let energy = law::stored_energy(normal, all.k, all.depth);
    let mut m = all.m;
    m.elastic_n = law::elastic_force(normal, all.k, all.depth);
    m.slide_n *= energy;
    m.energy_j = energy;
    ([Some(m), None, None, None], all.depth)
}

/// Places of contact of one pair.
pub(crate) fn places(samples: &[Sample], closed: bool, eps: f64, normal: &NormalLaw) -> Places {
    let none = ([None; 4], f64::NEG_INFINITY);
    let Some(all) = soft(samples, eps, |_| true) else { return none };
    if all.depth <= 0.0 {
        return ([None; 4], all.depth);
    }
    let finish = |mut m: Merged, elastic: f64, energy: f64, rubbing: f64| {
        m.elastic_n = elastic;
        m.rubbing = rubbing;
        m.slide_n *= energy;
        m.energy_j = energy;
        Some(m)
    };
    let energy = |s: &Soft| law::stored_energy(normal, s.k, s.depth);
    let elastic = |s: &Soft| law::elastic_force(normal, s.k, s.depth);

    let top =
        (0..samples.len()).fold(0, |b, i| if samples[i].depth > samples[b].depth { i } else { b });
    let Some((second, inner, outer)) = second_peak(samples, top, closed) else {
        return single(samples, eps, normal);
    };
    let (lo, hi) = (top.min(second), top.max(second));
    // Basin of `hi`: from the saddle between lo and hi up to the other one.
    let in_hi = |i: usize| match outer {
        Some(o) if o < lo => i >= inner || i < o,
        Some(o) => i >= inner && i < o,
        None => i >= inner,
    };
    let (Some(a), Some(b)) = (soft(samples, eps, |i| !in_hi(i)), soft(samples, eps, in_hi)) else {
        return single(samples, eps, normal);
    };
    // Soft extremes, so that nothing jumps when peaks or saddles change places.
    let (da, db) = (samples[lo].depth, samples[hi].depth);
    let (lower, weight_a) = {
        let (value, w) = soft_pair(-da, -db, eps);
        ((-value).max(1e-12), w)
    };
    let d_in = samples[inner].depth;
    let d_out = outer.map_or(f64::NEG_INFINITY, |o| samples[o].depth);
    let (d_saddle, weight_in) = soft_pair(d_in, d_out, eps);
    let depth_s = d_saddle.max(0.0);
    let sigma = (depth_s / lower).clamp(0.0, 1.0);
    let c = sigma * sigma;
    let (ua, ub, uall) = (energy(&a), energy(&b), energy(&all));
    let excess = ua + ub - uall;
    let share = |s: &Soft| ((s.depth - all.depth) / eps).exp();
    let f_all = elastic(&all);
    let (pull, lift) = if sigma < 1.0 {
        (-2.0 * sigma * excess / lower, 2.0 * c * excess / lower)
    } else {
        (0.0, 0.0)
    };
    let fa = (1.0 - c) * elastic(&a) + c * f_all * share(&a) + lift * weight_a;
    let fb = (1.0 - c) * elastic(&b) + c * f_all * share(&b) + lift * (1.0 - weight_a);
    // The lower peak loses its friction first, as it merges.
    let (ga, gb) = ((da - depth_s).max(0.0) + 1e-12, (db - depth_s).max(0.0) + 1e-12);
    let rub = |f: f64, other: f64, own: f64| {
        if f <= 0.0 { 0.0 } else { (1.0 + pull * other / (own + other) / f).clamp(0.0, 1.0) }
    };
    let (ea, eb) = ((1.0 - c) * ua + c * uall * share(&a), (1.0 - c) * ub + c * uall * share(&b));
    let saddle = |index: Option<usize>, weight: f64| {
        let s = &samples[index?];
        (pull * weight < 0.0).then_some(Merged {
            u: s.u,
            depth: s.depth,
            point: s.c,
            dir: s.n,
            elastic_n: pull * weight,
            ..Merged::ZERO
        })
    };
    (
        [
            finish(a.m, fa, ea, rub(fa, gb, ga)),
            finish(b.m, fb, eb, rub(fb, ga, gb)),
            saddle(Some(inner), weight_in),
            saddle(outer, 1.0 - weight_in),
        ],
        all.depth,
    )
}

/// Soft maximum of two numbers, `ε ln(e^(a/ε) + e^(b/ε))`, and its derivative by `a`.
fn soft_pair(a: f64, b: f64, eps: f64) -> (f64, f64) {
    let top = a.max(b);
    let (ea, eb) = (((a - top) / eps).exp(), ((b - top) / eps).exp());
    (top + eps * (ea + eb).ln(), ea / (ea + eb))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPS: f64 = 5e-5;
    const LAW: NormalLaw =
        NormalLaw::HuntCrossley { stiffness: 1e6, exponent: 1.0, damping_s_m: 0.0 };

    fn bumps(f: impl Fn(f64) -> f64, m: usize) -> Vec<Sample> {
        (0..m)
            .map(|i| {
                #[expect(clippy::cast_precision_loss, reason = "small")]
                let u = (i as f64 + 0.5) / m as f64;
                Sample {
                    u,
                    depth: f(u),
                    c: DVec3::new(0.0, u, 0.0),
                    n: DVec3::X,
                    k: 1e6,
                    softening: DVec3::ZERO,
                }
            })
            .collect()
    }

    fn total(f: impl Fn(f64) -> f64, m: usize) -> f64 {
        places(&bumps(f, m), false, EPS, &LAW).0.iter().flatten().map(|p| p.elastic_n).sum()
    }

    #[test]
    fn oracle_one_place_has_stiffness_k_and_two_places_2k() {
        let one = |u: f64| 2e-3 - 0.1 * (u - 0.5).powi(2);
        assert!((total(one, 33) / 2e3 - 1.0).abs() < 0.03);
        // Flat: spread over everything, still one place.
        assert!((total(|_| 2e-3, 33) / 2e3 - 1.0).abs() < 0.1);
        let two = |u: f64| 2e-3 - 0.1 * ((u - 0.5).abs() - 0.25).powi(2) * 4.0;
        assert!((total(two, 65) / 4e3 - 1.0).abs() < 0.05);
    }

    #[test]
    fn invariant_a_peak_on_the_seam_of_a_ring_is_one_place() {
        // The samples on both sides of azimuth zero are equally deep.
        let s = bumps(|u| 2e-3 - 0.02 * (core::f64::consts::PI * u).sin().powi(2), 24);
        let f: f64 = places(&s, true, EPS, &LAW).0.iter().flatten().map(|p| p.elastic_n).sum();
        assert!((f / 2e3 - 1.0).abs() < 0.05, "{f}");
    }

    #[test]
    fn invariant_force_is_continuous_while_two_places_become_one() {
        // A valley of growing height between two unequal peaks.
        let f = |h: f64| {
            total(
                move |u: f64| {
                    let w = (core::f64::consts::PI * (u - 0.25) * 2.0).sin().powi(2);
                    let peaks = if u < 0.5 { 2e-3 } else { 1.7e-3 };
                    if (0.25..0.75).contains(&u) {
                        peaks * (1.0 - w) + w * h
                    } else {
                        peaks - 0.05 * (u - u.clamp(0.25, 0.75)).abs()
                    }
                },
                64,
            )
        };
        let mut last = f(-1e-4);
        for i in 0..400 {
            let now = f(-1e-4 + f64::from(i) * 5e-6);
            assert!((now - last).abs() < 0.02 * last, "step {i}: {last} -> {now}");
            last = now;
        }
        assert!(last < 2.3e3, "one place at the end: {last}");
    }

    #[test]
    fn invariant_forces_are_the_gradient_of_the_energy() {
        let f = |d: &[f64]| {
            let mut s = bumps(|_| 0.0, d.len());
            s.iter_mut().zip(d).for_each(|(s, d)| s.depth = *d);
            places(&s, false, EPS, &LAW)
        };
        let base = [1.2e-3, 2.0e-3, 1.9e-3, 0.7e-3, 0.8e-3, 1.6e-3, 1.1e-3];
        let energy = |d: &[f64]| f(d).0.iter().flatten().map(|p| p.energy_j).sum::<f64>();
        let h = 1e-9;
        let mut up = base;
        let mut down = base;
        up.iter_mut().for_each(|x| *x += h);
        down.iter_mut().for_each(|x| *x -= h);
        let want = (energy(&up) - energy(&down)) / (2.0 * h);
        let got: f64 = f(&base).0.iter().flatten().map(|p| p.elastic_n).sum();
        assert!((got / want - 1.0).abs() < 0.02, "{got} {want}");
    }
}
