//! Exponential height fog along a ray: column, its inverse, and moments of its gradient, all in closed form.
//!
//! In scale heights above the base a ray climbs as s(t) = s₀ + k t, so the density exp(−max(0, s)) is elementary on either
//! side of the base. Every form below is written from its thinner or its denser end so that nothing overflows or cancels.

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
}

impl HeightProfile {
    pub(crate) fn new(base: f32, scale_height: f32, line: &Line) -> Self {
        let inverse_scale_height = 1.0 / f64::from(scale_height);
        Self {
            start: (line.origin.y - f64::from(base)) * inverse_scale_height,
            slope: line.direction.y * inverse_scale_height,
            inverse_scale_height,
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

    /// The parts of [`t0`, `t1`] below and above the base; an absent part has its end at or before its start.
    fn split(&self, t0: f64, t1: f64) -> [(f64, f64); 2] {
        let nothing = (t0, t0);
        if self.slope == 0.0 {
            return if self.start <= 0.0 {
                [(t0, t1), nothing]
            } else {
                [nothing, (t0, t1)]
            };
        }
        let crossing = (-self.start / self.slope).max(t0).min(t1);
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
        let (a, b) = above;
        let l = b - a;
        let k = self.slope.abs();
        // Distances are measured from the denser end, in whose density the remainder ∫ v ρ dv is written.
        let first = if self.slope < 0.0 {
            b * zeroth - self.value(b) * first_moment(k, l)
        } else {
            a * zeroth + self.value(a) * first_moment(k, l)
        };
        [zeroth, first].map(|m| -m * self.inverse_scale_height)
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

/// ∫₀^l v e^(−k v) dv = (1 − e^(−w)(1 + w))/k², w = k l.
fn first_moment(k: f64, l: f64) -> f64 {
    let w = k * l;
    if w < 1e-2 {
        // Series Σ (−w)ⁿ/(n! (n + 2)); the first term left out is w⁵/840, under 1e-12.
        return l * l * (0.5 - w * (1.0 / 3.0 - w * (1.0 / 8.0 - w * (1.0 / 30.0 - w / 144.0))));
    }
    // (1 + w) e^(−w) is 0 in f64 from w = 752 on, and NaN for infinite w.
    let rest = if w < 800.0 {
        (-w).exp() * (1.0 + w)
    } else {
        0.0
    };
    (1.0 - rest) / (k * k)
}
