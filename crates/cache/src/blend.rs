//! How records become one value: a weighted mean of their logarithms, extrapolated along their gradients.
//! Logarithms and scaled gradients are kept ready per record, so that a lookup costs one `exp` a channel and no `ln`.

use crate::record::Record;
use glam::Vec3;
use std::f32::consts::LN_2;

/// A record changes the logarithm of its value by at most this much (a factor of 4) when it is extrapolated.
const MAX_EXTRAPOLATION: f32 = 1.4;

/// Bound on |∇ln L|·R; far above [`MAX_EXTRAPOLATION`] and far below overflow.
const MAX_SLOPE: f64 = 1e6;

/// Weight of a record at the distance (1 − s)·R, 0 < s ≤ 1.
///
/// w = 3s² − 2s³: C¹, 1 at the record, 0 with slope 0 at the rim, so that nothing pops where a ball ends.
#[inline]
pub(crate) fn weight(s: f32) -> f32 {
    s * s * (3.0 - 2.0 * s)
}

/// What a record adds to a blend; 48 bytes for three channels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape<const N: usize> {
    /// ln L per channel, −∞ where L = 0.
    pub(crate) ln_value: [f32; N],
    /// R ∇ln L per channel, 0 where L = 0.
    pub(crate) slope: [Vec3; N],
}

impl<const N: usize> Shape<N> {
    pub(crate) fn new(record: &Record<N>) -> Self {
        Self {
            ln_value: record.value.map(f32::ln),
            slope: std::array::from_fn(|channel| {
                let value = f64::from(record.value[channel]);
                if value == 0.0 {
                    return Vec3::ZERO;
                }
                // In f64: the quotient of f32 numbers may overflow.
                let slope = record.gradient[channel].as_dvec3() * f64::from(record.radius) / value;
                slope.clamp_length_max(MAX_SLOPE).as_vec3()
            }),
        }
    }
}

/// The running sums of one lookup.
///
/// L = (Σ⁺w/Σw) · exp(Σ⁺ w (ln Lₖ + δₖ) / Σ⁺w),  δₖ = clamp(∇ln Lₖ·(p − xₖ), ±1.4)
///
/// per channel, where Σ⁺ runs over records with Lₖ > 0: a shadowed record (Lₖ = 0) has no logarithm, and takes its
/// weight's share of the light instead of all of it. The result is clamped to [½ min Lₖ, 2 max Lₖ].
///
/// Jarosz et al. 2008, "Radiance caching for participating media", for the blend; the rules for zeros and the clamps are
/// ours. Exact for constant and exponential fields.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend<const N: usize> {
    /// Σw
    weight: f32,
    /// Σ⁺w
    positive: [f32; N],
    /// Σ⁺ w (ln Lₖ + δₖ)
    sum: [f32; N],
    /// min and max of ln Lₖ
    least: [f32; N],
    most: [f32; N],
}

impl<const N: usize> Blend<N> {
    pub(crate) const EMPTY: Self = Self {
        weight: 0.0,
        positive: [0.0; N],
        sum: [0.0; N],
        least: [f32::INFINITY; N],
        most: [f32::NEG_INFINITY; N],
    };

    /// Adds a record with weight `w` and its extrapolation R ∇ln L · (p − x)/R before clamping.
    #[inline]
    pub(crate) fn add(&mut self, w: f32, shape: &Shape<N>, slope_along: impl Fn(Vec3) -> f32) {
        self.weight += w;
        for channel in 0..N {
            let ln_value = shape.ln_value[channel];
            let delta =
                slope_along(shape.slope[channel]).clamp(-MAX_EXTRAPOLATION, MAX_EXTRAPOLATION);
            // Selections, not branches: which records are zero cannot be foretold.
            let is_positive = ln_value > f32::NEG_INFINITY;
            self.positive[channel] += if is_positive { w } else { 0.0 };
            self.sum[channel] += if is_positive {
                w * (ln_value + delta)
            } else {
                0.0
            };
            self.least[channel] = min(ln_value, self.least[channel]);
            self.most[channel] = max(ln_value, self.most[channel]);
        }
    }

    /// The blended value; `None` if no record was added.
    #[inline]
    pub(crate) fn value(&self) -> Option<[f32; N]> {
        (self.weight > 0.0).then(|| std::array::from_fn(|channel| self.channel(channel)))
    }

    #[inline]
    fn channel(&self, channel: usize) -> f32 {
        let positive = self.positive[channel];
        if positive == 0.0 {
            return 0.0;
        }
        let share = positive / self.weight;
        // With a zero among the records `least` is −∞, and so is the lower bound.
        let mut ln = (self.sum[channel] / positive).max(self.least[channel] - LN_2);
        let bound = self.most[channel] + LN_2;
        if ln > bound {
            // share · exp(ln) ≤ 2 max
            ln = ln.min(bound - share.ln());
        }
        (share * ln.exp()).min(f32::MAX)
    }
}

/// Without `f32::min`'s rules for NaN, which cost instructions; nothing here is NaN.
#[inline]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// See [`min`].
#[inline]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn shape(value: f32, gradient: Vec3) -> Shape<1> {
        Shape::new(&Record {
            position: Vec3::ZERO,
            radius: 1.0,
            value: [value],
            gradient: [gradient],
        })
    }

    fn blend(parts: &[(f32, f32, f32)]) -> f32 {
        let mut blend = Blend::EMPTY;
        for &(w, value, delta) in parts {
            blend.add(w, &shape(value, Vec3::ZERO), |_| delta);
        }
        blend.value().unwrap()[0]
    }

    fn check(parts: &[(f32, f32, f32)], expected: f32) {
        let found = blend(parts);
        // A logarithm of up to 14 rounded to f32 is off by 5e-7, and so is its exponential, relatively.
        assert!(
            (found - expected).abs() <= 1e-6 * expected,
            "{parts:?}: {found} instead of {expected}"
        );
    }

    #[test]
    fn unequal_neighbours_blend_to_their_geometric_mean() {
        // exact-benchmarks E5: (1, 1e-6) blends to 0.001, not to 0.5.
        check(&[(0.5, 1.0, 0.0), (0.5, 1e-6, 0.0)], 1e-3);
        check(&[(0.3, 2.0, 0.0), (0.1, 2e-4, 0.0)], 0.2);
    }

    #[test]
    fn zero_records_take_their_share_of_the_weight() {
        check(&[(0.5, 8.0, 0.0), (0.25, 0.0, 0.0), (0.5, 2.0, 0.0)], 3.2);
        check(&[(0.5, 0.0, 0.0), (0.25, 0.0, 0.0)], 0.0);
        check(&[(1e-12, 0.0, 0.0), (1.0, 3.0, 0.0)], 3.0);
    }

    #[test]
    fn extrapolation_stays_between_half_the_least_and_twice_the_greatest_record() {
        check(&[(1.0, 3.0, 0.5)], 3.0 * 0.5_f32.exp());
        check(&[(1.0, 3.0, 100.0)], 6.0);
        check(&[(1.0, 3.0, -100.0)], 1.5);
        check(&[(1.0, 3.0, 1.4), (1.0, 5.0, 1.4)], 10.0);
        // With a zero record the bound holds for the scaled result.
        check(&[(1.0, 3.0, 1.4), (3.0, 0.0, 0.0)], 0.75 * 1.4_f32.exp());
        check(&[(3.0, 3.0, 1.4), (1.0, 0.0, 0.0)], 6.0);
    }

    #[test]
    fn values_at_the_ends_of_f32_stay_finite() {
        for value in [f32::MAX, f32::MIN_POSITIVE, 1e-45] {
            for delta in [-1e30, 0.0, 1e30] {
                let found = blend(&[(1.0, value, delta)]);
                assert!(
                    found.is_finite() && found >= 0.0,
                    "{value} with {delta}: {found}"
                );
            }
            let steep = shape(value, Vec3::new(f32::MAX, -f32::MAX, 1.0));
            assert!(steep.slope[0].is_finite());
        }
    }
}
