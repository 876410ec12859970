//! How records become one value: a weighted mean of their logarithms, extrapolated along their gradients.
//! Channels lie side by side in groups of four: a lookup costs one `exp` a channel and no `ln`.

use crate::shape::{Shape, WIDTH};
use glam::{Vec3, Vec4};
use std::f32::consts::LN_2;

/// Each half of a record's extrapolation, by its own gradient and by the blended one, changes the logarithm by at most this much:
/// a factor of 4 in all, as far as a log-linear field is believed.
pub(crate) const MAX_EXTRAPOLATION: f32 = 0.7;

/// Weight of a record at the distance (1 − s)·R, 0 < s ≤ 1.
///
/// w = 3s² − 2s³: C¹, 1 at the record, 0 with slope 0 at the rim, so that nothing pops where a ball ends.
#[inline]
pub fn weight(s: f32) -> f32 {
    s * s * (3.0 - 2.0 * s)
}

/// [`weight`] at four points, from their squared distances as shares of R².
#[inline]
pub(crate) fn weights(squared: Vec4) -> Vec4 {
    let s = 1.0 - sqrt(squared);
    s * s * (3.0 - 2.0 * s)
}

/// The running sums of a lookup, for a group of channels.
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
struct Sums {
    // Over records with Lₖ > 0:
    /// Σw
    weight: Vec4,
    /// Σ w (ln Lₖ + ½ gₖ·dₖ + nₖ)
    ln_value: Vec4,
    /// Σ w g by axis
    gradient: [Vec4; 3],
    /// Σ w d by axis
    offset: [Vec4; 3],
    /// Σ w² nₖ
    noise: Vec4,
    // Over all records: min and max of ln Lₖ.
    least: Vec4,
    most: Vec4,
}

impl Sums {
    const EMPTY: Self = Self {
        weight: Vec4::ZERO,
        ln_value: Vec4::ZERO,
        gradient: [Vec4::ZERO; 3],
        offset: [Vec4::ZERO; 3],
        noise: Vec4::ZERO,
        least: Vec4::INFINITY,
        most: Vec4::NEG_INFINITY,
    };

    /// Adds a record with weight `w` and `offset` = (p − x)/R.
    #[inline]
    fn add(&mut self, w: f32, shape: &Shape, offset: Vec3) {
        let ln_value = Vec4::from(shape.ln_value);
        let lowered = Vec4::from(shape.lowered);
        let slope = shape.slope.map(Vec4::from);
        let delta = 0.5 * dot(slope, offset.to_array().map(Vec4::splat));
        let delta = clamp(delta);
        // Selections, not branches: which records are zero cannot be foretold.
        let is_positive = ln_value.cmpgt(Vec4::NEG_INFINITY);
        let own = Vec4::select(is_positive, Vec4::splat(w), Vec4::ZERO);
        self.weight += own;
        self.ln_value += Vec4::select(is_positive, w * (ln_value + delta + lowered), Vec4::ZERO);
        let inverse_radius = 1.0 / shape.radius;
        let d = offset * shape.radius;
        for axis in 0..3 {
            self.gradient[axis] += own * inverse_radius * slope[axis];
            self.offset[axis] += own * d[axis];
        }
        self.noise += own * own * lowered;
        self.least = ln_value.min(self.least);
        self.most = ln_value.max(self.most);
    }

    /// The blended values, where all records together weigh `weight`; 0 where no record is positive.
    #[inline]
    fn value(&self, weight: f32) -> Vec4 {
        let is_positive = self.weight.cmpgt(Vec4::ZERO);
        // 1 for lanes whose answer is known to be 0: they need no arithmetic of their own.
        let own = Vec4::select(is_positive, self.weight, Vec4::ONE);
        let inverse = 1.0 / own;
        let mean = |sum: [Vec4; 3]| sum.map(|axis| axis * inverse);
        let carried = 0.5 * dot(mean(self.gradient), mean(self.offset));
        // The product of extreme gradients and radii may overflow; nothing is known then.
        let carried = clamp(Vec4::select(carried.is_finite_mask(), carried, Vec4::ZERO));
        let ln = self.ln_value * inverse + carried - self.noise * inverse * inverse;
        let share = own / weight;
        // With a zero among the records `least` is −∞, and so is the lower bound.
        let mut ln = ln.max(self.least - LN_2);
        let bound = self.most + LN_2;
        let is_above = is_positive & ln.cmpgt(bound);
        if is_above.any() {
            // share · exp(ln) ≤ 2 max
            ln = Vec4::select(is_above, ln.min(bound - share.map(f32::ln)), ln);
        }
        let ln = Vec4::select(is_positive, ln, Vec4::ZERO);
        let value = (share * ln.map(f32::exp)).min(Vec4::splat(f32::MAX));
        Vec4::select(is_positive, value, Vec4::ZERO)
    }
}

/// The sums of a lookup at one point: groups of channels side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend<const N: usize> {
    /// Σw over all records
    weight: f32,
    /// By group; more than there are.
    groups: [Sums; N],
}

impl<const N: usize> Blend<N> {
    pub(crate) const EMPTY: Self = Self {
        weight: 0.0,
        groups: [Sums::EMPTY; N],
    };

    /// Adds a record, by the groups of its channels, with weight `w` and `offset` = (p − x)/R.
    #[inline]
    pub(crate) fn add(&mut self, w: f32, shapes: &[Shape], offset: Vec3) {
        self.weight += w;
        for (sums, shape) in self.groups.iter_mut().zip(shapes) {
            sums.add(w, shape, offset);
        }
    }

    /// The blended value; `None` if no record was added.
    #[inline]
    pub(crate) fn value(&self) -> Option<[f32; N]> {
        (self.weight > 0.0).then(|| {
            let mut value = [0.0; N];
            for (channels, sums) in value.chunks_mut(WIDTH).zip(&self.groups) {
                let group = sums.value(self.weight).to_array();
                channels.copy_from_slice(&group[..channels.len()]);
            }
            value
        })
    }
}

/// One instruction, once compiled.
#[inline]
fn sqrt(x: Vec4) -> Vec4 {
    Vec4::from(x.to_array().map(f32::sqrt))
}

/// To ±0.7.
#[inline]
pub(crate) fn clamp(extrapolation: Vec4) -> Vec4 {
    extrapolation
        .max(Vec4::splat(-MAX_EXTRAPOLATION))
        .min(Vec4::splat(MAX_EXTRAPOLATION))
}

#[inline]
pub(crate) fn dot(a: [Vec4; 3], b: [Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::record::Record;

    fn shape(value: f32, gradient: Vec3) -> Shape {
        let record = Record {
            position: Vec3::ZERO,
            radius: 1.0,
            value: [value],
            gradient: [gradient],
            variance: [0.0],
        };
        Shape::new(&record, 0)
    }

    fn blend(parts: &[(f32, f32, f32)]) -> f32 {
        let mut blend = Blend::<1>::EMPTY;
        for &(w, value, delta) in parts {
            // All at one place: each is extrapolated by its own and the mean slope alike.
            blend.add(w, &[shape(value, value * delta * Vec3::X)], Vec3::X);
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
        }
    }
}
