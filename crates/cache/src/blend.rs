//! How records become one value: a weighted mean of their logarithms, extrapolated along their gradients.
//! Logarithms and scaled gradients are kept ready per record, so that a lookup costs one `exp` a channel and no `ln`.

use crate::record::Record;
use glam::Vec3;
use std::f32::consts::LN_2;

/// Each half of a record's extrapolation, by its own gradient and by the blended one, changes the logarithm by at most this much:
/// a factor of 4 in all, as far as a log-linear field is believed.
const MAX_EXTRAPOLATION: f32 = 0.7;

/// Bound on |∇ln L|·R; far above [`MAX_EXTRAPOLATION`] and far below overflow.
const MAX_SLOPE: f64 = 1e6;

/// Weight of a record at the distance (1 − s)·R, 0 < s ≤ 1.
///
/// w = 3s² − 2s³: C¹, 1 at the record, 0 with slope 0 at the rim, so that nothing pops where a ball ends.
#[inline]
pub(crate) fn weight(s: f32) -> f32 {
    s * s * (3.0 - 2.0 * s)
}

/// What a record adds to a blend; 64 bytes, a line of the processor's cache, for three channels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape<const N: usize> {
    /// ln L per channel, −∞ where L = 0.
    pub(crate) ln_value: [f32; N],
    /// R ∇ln L per channel, 0 where L = 0.
    pub(crate) slope: [Vec3; N],
    /// How far noise lowers the mean of ln L per channel: ½v/(1 + 1.5v) with v = Var L/L². 0 where L = 0.
    ///
    /// For a true value of 1 and normal noise of variance s², E ln L = −s²/2 − 3s⁴/4 + …, and as v divides by the noisy value
    /// E v = s² + 3s⁴ + …: of the two second-order terms −1.5 · ½v² is left. Never above ⅓.
    pub(crate) lowered: [f32; N],
    pub(crate) radius: f32,
}

impl<const N: usize> Shape<N> {
    pub(crate) fn new(record: &Record<N>) -> Self {
        let relative = |channel: usize, x: f64| match f64::from(record.value[channel]) {
            0.0 => 0.0,
            value => x / value,
        };
        Self {
            ln_value: record.value.map(f32::ln),
            // In f64: the quotient of f32 numbers may overflow.
            slope: std::array::from_fn(|channel| {
                let gradient = record.gradient[channel].as_dvec3() * f64::from(record.radius);
                let slope = gradient * relative(channel, 1.0);
                slope.clamp_length_max(MAX_SLOPE).as_vec3()
            }),
            lowered: std::array::from_fn(|channel| {
                let variance = f64::from(record.variance[channel]);
                let relative = relative(channel, relative(channel, variance));
                (0.5 * relative / (1.0 + 1.5 * relative)) as f32
            }),
            radius: record.radius,
        }
    }
}

/// The running sums of one lookup.
///
/// With weights normalised to Σ w = 1, offsets dₖ = p − xₖ and gradients gₖ = ∇ln Lₖ, per channel:
///
/// ln L = Σ w (ln Lₖ + ½ gₖ·dₖ) + ½ (Σ w g)·(Σ w d) + Σ w (1 − w) nₖ
///
/// Each record is extended by the mean of its own gradient and the blended one at `p`, as the trapezoidal rule integrates
/// the slope between the two points: an error of −½ dᵀHd a record, which never has the sign of the curvature, becomes one of
/// −½ d̄ᵀHd̄ with d̄ = Σ w d, and vanishes where records stand around `p`. The last term answers the noise of the records:
/// it lowers the mean of each logarithm by nₖ ≈ ½ Var Lₖ/Lₖ², of which the blend's own noise, Σ w² nₖ, gives back a part in the
/// exponential. Left over are terms of second order in the variance: skewed noise, and the noise of gradients.
///
/// Records with Lₖ = 0 have no logarithm: the sums leave them out, and the result is scaled by the others' share of the
/// weight. Both halves of the extrapolation are clamped to ±0.7, and the result to [½ min Lₖ, 2 max Lₖ].
///
/// Jarosz et al. 2008, "Radiance caching for participating media", for the blend in logarithms; the trapezoidal gradient,
/// the correction for noise, the rules for zeros and the clamps are ours. Exact for constant and exponential fields.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend<const N: usize> {
    /// Σw
    weight: f32,
    /// Sums over records with Lₖ > 0.
    channels: [Sums; N],
}

#[derive(Clone, Copy, Debug)]
struct Sums {
    /// Σw
    weight: f32,
    /// Σ w (ln Lₖ + ½ gₖ·dₖ + nₖ)
    ln_value: f32,
    /// Σ w g
    gradient: Vec3,
    /// Σ w d
    offset: Vec3,
    /// Σ w² nₖ
    noise: f32,
    /// min and max of ln Lₖ, zeros included
    least: f32,
    most: f32,
}

impl Sums {
    const EMPTY: Self = Self {
        weight: 0.0,
        ln_value: 0.0,
        gradient: Vec3::ZERO,
        offset: Vec3::ZERO,
        noise: 0.0,
        least: f32::INFINITY,
        most: f32::NEG_INFINITY,
    };

    /// The channel's value, where all records together weigh `weight`.
    #[inline]
    fn value(&self, weight: f32) -> f32 {
        if self.weight == 0.0 {
            return 0.0;
        }
        let inverse = 1.0 / self.weight;
        let carried = 0.5 * (self.gradient * inverse).dot(self.offset * inverse);
        // The product of extreme gradients and radii may overflow; nothing is known then.
        let carried = if carried.is_finite() {
            carried.clamp(-MAX_EXTRAPOLATION, MAX_EXTRAPOLATION)
        } else {
            0.0
        };
        let ln = self.ln_value * inverse + carried - self.noise * inverse * inverse;
        let share = self.weight / weight;
        // With a zero among the records `least` is −∞, and so is the lower bound.
        let mut ln = ln.max(self.least - LN_2);
        let bound = self.most + LN_2;
        if ln > bound {
            // share · exp(ln) ≤ 2 max
            ln = ln.min(bound - share.ln());
        }
        (share * ln.exp()).min(f32::MAX)
    }
}

impl<const N: usize> Blend<N> {
    pub(crate) const EMPTY: Self = Self {
        weight: 0.0,
        channels: [Sums::EMPTY; N],
    };

    /// Adds a record with weight `w` and `offset` = (p − x)/R.
    #[inline]
    pub(crate) fn add(&mut self, w: f32, shape: &Shape<N>, offset: Vec3) {
        self.weight += w;
        let d = offset * shape.radius;
        let inverse_radius = 1.0 / shape.radius;
        for (channel, sums) in self.channels.iter_mut().enumerate() {
            let ln_value = shape.ln_value[channel];
            let slope = shape.slope[channel];
            let delta = (0.5 * slope.dot(offset)).clamp(-MAX_EXTRAPOLATION, MAX_EXTRAPOLATION);
            let lowered = shape.lowered[channel];
            // Selections, not branches: which records are zero cannot be foretold.
            let is_positive = ln_value > f32::NEG_INFINITY;
            let own = if is_positive { w } else { 0.0 };
            sums.weight += own;
            sums.ln_value += if is_positive {
                w * (ln_value + delta + lowered)
            } else {
                0.0
            };
            sums.gradient += (own * inverse_radius) * slope;
            sums.offset += own * d;
            sums.noise += own * own * lowered;
            sums.least = min(ln_value, sums.least);
            sums.most = max(ln_value, sums.most);
        }
    }

    /// The blended value; `None` if no record was added.
    #[inline]
    pub(crate) fn value(&self) -> Option<[f32; N]> {
        (self.weight > 0.0).then(|| self.channels.map(|sums| sums.value(self.weight)))
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
            variance: [0.0],
        })
    }

    fn blend(parts: &[(f32, f32, f32)]) -> f32 {
        let mut blend = Blend::EMPTY;
        for &(w, value, delta) in parts {
            // All at one place: each is extrapolated by its own and the mean slope alike.
            blend.add(w, &shape(value, value * delta * Vec3::X), Vec3::X);
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
