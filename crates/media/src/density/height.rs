//! Exponential height fog along a ray: column, its inverse, and moments of its gradient, all in closed form.
//!
//! In scale heights above the base a ray climbs as s(t) = s₀ + k t, so the density exp(−max(0, s)) is elementary on either
//! side of the base. Every form below is written from its thinner or its denser end so that nothing overflows or cancels.
//!
//! On the base, where the density has a kink, derivatives are those from above. A point that may lie below it by rounding alone counts
//! as above, for the density's gradient and for whether the ray crosses the base alike: two answers would not fit together.

use crate::gradient::GRAZING;
use crate::line::Line;

/// exp(−max(0, s₀ + k t)).
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeightProfile {
    /// s₀: height of the ray's origin above the base, in scale heights.
    start: f64,
    /// k: scale heights climbed per metre of the ray.
    slope: f64,
    /// 1/H, per metre.
    inverse_scale_height: f64,
    /// Of s₀, in scale heights.
    rounding: f64,
}

/// What heights may be off by, relative to what they are the sums of: some roundings of f64, 10⁻⁷ of one of f32.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl HeightProfile {
    pub(crate) fn new(base: f32, scale_height: f32, line: &Line) -> Self {
        let inverse_scale_height = 1.0 / f64::from(scale_height);
        let (y, base) = (line.origin.y, f64::from(base));
        Self {
            start: (y - base) * inverse_scale_height,
            slope: line.direction.y * inverse_scale_height,
            inverse_scale_height,
            rounding: ROUNDING * (y.abs() + base.abs()) * inverse_scale_height,
        }
    }

    /// s(t), in scale heights above the base.
    fn height(&self, t: f64) -> f64 {
        // Written out for a level ray: 0 · ∞ is NaN.
        if self.slope == 0.0 {
            self.start
        } else {
            self.start + self.slope * t
        }
    }

    pub(crate) fn value(&self, t: f64) -> f64 {
        (-self.height(t).max(0.0)).exp()
    }

    /// Whether the ray is above the base at `t`, or on it, or may be but for rounding.
    fn is_above(&self, t: f64) -> bool {
        let height = self.height(t);
        let rounding = self.rounding + ROUNDING * (height - self.start).abs();
        // Infinitely far below this is NaN, and false.
        height + rounding >= 0.0
    }

    /// ∂ρ/∂y at `t`: −ρ/H above the base and on it, 0 below.
    pub(crate) fn vertical_gradient(&self, t: f64) -> f64 {
        if self.is_above(t) {
            -self.value(t) * self.inverse_scale_height
        } else {
            0.0
        }
    }

    /// The distance in [`t0`, `t1`] nearest to where a ray that is not level crosses the base.
    fn crossing(&self, t0: f64, t1: f64) -> f64 {
        (-self.start / self.slope).max(t0).min(t1)
    }

    /// The parts of [`t0`, `t1`] below and above the base; an absent part has its end at or before its start.
    fn split(&self, t0: f64, t1: f64) -> [(f64, f64); 2] {
        let nothing = (t0, t0);
        if self.slope == 0.0 {
            return if self.start < 0.0 {
                [(t0, t1), nothing]
            } else {
                [nothing, (t0, t1)]
            };
        }
        let crossing = self.crossing(t0, t1);
        if self.slope > 0.0 {
            [(t0, crossing), (crossing, t1)]
        } else {
            [(crossing, t1), (t0, crossing)]
        }
    }

    pub(crate) fn column(&self, t0: f64, t1: f64) -> f64 {
        let [below, above] = self.split(t0, t1);
        length(below) + self.column_above(above)
    }

    /// ∫ exp(−s) dt over a part above the base: `ρ (1 − e^(−|k| l))/|k|`, ρ the density at its lower end, l its length.
    fn column_above(&self, (t0, t1): (f64, f64)) -> f64 {
        let l = length((t0, t1));
        if l == 0.0 {
            return 0.0;
        }
        let densest = self.value(if self.slope < 0.0 { t1 } else { t0 });
        if densest == 0.0 {
            // Above 745 scale heights not even f64 knows the density: no fog, also over an infinite level ray.
            return 0.0;
        }
        let k = self.slope.abs();
        let w = if k == 0.0 { 0.0 } else { k * l };
        // Below 1e-8 the next term of the series, w²/6, is under the rounding of f64.
        densest
            * if w < 1e-8 {
                l * (1.0 - 0.5 * w)
            } else {
                -(-w).exp_m1() / k
            }
    }

    /// The smallest t ≥ `t0` with column(`t0`, t) = `column` > 0, infinite where the whole ray holds less.
    pub(crate) fn invert(&self, t0: f64, column: f64) -> f64 {
        let (s, k) = (self.height(t0), self.slope);
        let l = if s <= 0.0 {
            let to_base = if k > 0.0 { -s / k } else { f64::INFINITY };
            if column <= to_base {
                column
            } else {
                to_base + climb(1.0, k, column - to_base)
            }
        } else if k >= 0.0 {
            climb((-s).exp(), k, column)
        } else {
            let to_base = s / -k;
            let above = -(-s).exp_m1() / -k;
            if column < above {
                descend(s, -k, column).min(to_base)
            } else {
                to_base + (column - above)
            }
        };
        t0 + l
    }

    /// ∫ ∂ρ/∂y dt and ∫ t ∂ρ/∂y dt, with ∂ρ/∂y = −ρ/H above the base and 0 below.
    pub(crate) fn gradient_moments(&self, t0: f64, t1: f64) -> [f64; 2] {
        let [_, above] = self.split(t0, t1);
        let zeroth = self.column_above(above);
        if zeroth == 0.0 {
            return [0.0; 2];
        }
        let (end, first) = self.moment_from_denser_end(above);
        [zeroth, end * zeroth + first].map(|m| -m * self.inverse_scale_height)
    }

    /// ∫ tʲ ∂²ρ/∂y² dt for j = 0, 1, 2, with ∂²ρ/∂y² = ρ/H² above the base and 0 below.
    ///
    /// On the base ∂ρ/∂y falls by 1/H, which adds −tʲ/(H |∂y/∂t|) where the ray crosses it; the slope ∂y/∂t is kept above
    /// [`GRAZING`]. A ray that ends on the base crosses it where it comes from below.
    pub(crate) fn hessian_moments(&self, t0: f64, t1: f64) -> [f64; 3] {
        let [_, above] = self.split(t0, t1);
        let zeroth = self.column_above(above);
        let mut moments = [0.0; 3];
        if zeroth > 0.0 {
            let (end, first) = self.moment_from_denser_end(above);
            let second = self.value(end) * moment(2, self.slope.abs(), length(above));
            moments = [
                zeroth,
                end * zeroth + first,
                end * (end * zeroth + 2.0 * first) + second,
            ];
        }
        if self.is_above(t0) != self.is_above(t1) {
            let t = self.crossing(t0, t1);
            let kink = 1.0 / self.slope.abs().max(GRAZING * self.inverse_scale_height);
            moments[0] -= kink;
            moments[1] -= kink * t;
            moments[2] -= kink * t * t;
        }
        moments.map(|m| m * self.inverse_scale_height * self.inverse_scale_height)
    }

    /// The denser end e of a part above the base, and ∫ (t − e) ρ dt over the part.
    fn moment_from_denser_end(&self, (a, b): (f64, f64)) -> (f64, f64) {
        let (end, sign) = if self.slope < 0.0 {
            (b, -1.0)
        } else {
            (a, 1.0)
        };
        let moment = self.value(end) * moment(1, self.slope.abs(), b - a);
        (end, sign * moment)
    }
}

/// Length of a part, 0 where it is absent.
fn length((t0, t1): (f64, f64)) -> f64 {
    // Not a difference and a maximum: both ends may be infinite.
    if t1 > t0 { t1 - t0 } else { 0.0 }
}

/// The way l along which fog of `density` at its start, thinning out as e^(−k l), holds `column`: −ln(1 − k column/density)/k.
fn climb(density: f64, k: f64, column: f64) -> f64 {
    let x = column / density;
    if k == 0.0 {
        x
    } else if x * k < 1.0 {
        -(-x * k).ln_1p() / k
    } else {
        f64::INFINITY
    }
}

/// The way l along which fog at height `s`, entered downwards, holds `column`: ln(1 + k column e^s)/k.
fn descend(s: f64, k: f64, column: f64) -> f64 {
    let (density, gained) = ((-s).exp(), k * column);
    if gained < density {
        (gained / density).ln_1p() / k
    } else {
        // The start may be so high that its density is 0; here it is only added.
        (s + (density + gained).ln()) / k
    }
}

/// ∫₀^l vʲ e^(−k v) dv for j = 1, 2, the incomplete gamma function γ(j + 1, w)/kʲ⁺¹ with w = k l.
///
/// The series lʲ⁺¹ e^(−w) Σ wⁿ/((j + 1) … (j + 1 + n)), whose terms are all positive (Abramowitz and Stegun 6.5.29), for
/// small w; the closed form (j! − e^(−w) Σ wⁱ j!/i!)/kʲ⁺¹ from w = ½ on, where it cancels two digits at most.
fn moment(j: i32, k: f64, l: f64) -> f64 {
    let w = k * l;
    if w < 0.5 {
        let mut n = f64::from(j + 1);
        let mut term = 1.0 / n;
        let mut sum = term;
        while term > sum * f64::EPSILON {
            n += 1.0;
            term *= w / n;
            sum += term;
        }
        return l.powi(j + 1) * (-w).exp() * sum;
    }
    let (factorial, polynomial) = if j == 1 {
        (1.0, 1.0 + w)
    } else {
        (2.0, 2.0 + w * (2.0 + w))
    };
    // The rest is 0 in f64 from w = 760 on, and NaN for infinite w.
    let rest = if w < 800.0 {
        (-w).exp() * polynomial
    } else {
        0.0
    };
    (factorial - rest) / k.powi(j + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall_math::quadrature::gauss_legendre;

    #[test]
    fn moments_of_an_exponential_are_those_of_a_fine_quadrature() {
        let rule = gauss_legendre(64);
        for k in [0.0, 1e-9, 1e-3, 0.03, 0.166, 0.167, 0.5, 2.0, 9.0] {
            for j in [1, 2] {
                let l = 3.0;
                let integrand = |v: f64| v.powi(j) * (-k * v).exp();
                let integral: f64 = rule
                    .iter()
                    .map(|(x, weight)| 0.5 * l * weight * integrand(0.5 * l * (1.0 + x)))
                    .sum();
                // Rounding, and two digits cancelled.
                assert!(
                    (moment(j, k, l) / integral - 1.0).abs() < 2e-14,
                    "j = {j}, k = {k}"
                );
            }
        }
        assert_eq!(moment(2, 0.5, f64::INFINITY), 16.0);
    }
}
