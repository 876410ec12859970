//! The best radius a record can have: the largest ball in which its extrapolation errs by less than the tolerance. Nothing
//! is rendered; the integrals over the ball are taken by quadrature.

use super::field::PointLights;
use tyndall_math::quadrature::gauss_legendre;

// With four times the nodes, panels and steps, no best radius in E5's rows changes by more than 1e-9, relatively.
/// Nodes from the centre of a ball to its rim.
const RADIAL: usize = 16;
/// Parts of [−1, 1] in which a sign is looked for once.
const PANELS: usize = 8;
/// Nodes in each.
const ANGULAR: usize = 8;

/// How a record's value is carried to other places.
#[derive(Clone, Copy)]
pub(super) enum Extrapolation {
    /// E = L
    Constant,
    /// E = L + ∇L·Δ
    Linear,
    /// E = L exp(∇L·Δ/L), as the cache extrapolates.
    Logarithmic,
}

/// The quadrature that finds best radii.
pub(super) struct Oracle {
    radial: Vec<(f64, f64)>,
    angular: Vec<(f64, f64)>,
}

impl Oracle {
    pub(super) fn new() -> Self {
        Self {
            radial: gauss_legendre(RADIAL),
            angular: gauss_legendre(ANGULAR),
        }
    }

    /// The largest radius of a record at `z` on the axis with a relative error below `t`, at most the distance to a light.
    ///
    /// max R:  ∫_B(R) |E − L| dV / ∫_B(R) L dV < t
    ///
    /// Jarosz et al. 2008, the authors' talk (`exact-benchmarks.md` E5). The error grows with R until it is above ½;
    /// bisection finds where it passes `t`, far beyond the digits written.
    pub(super) fn valid_radius(
        &self,
        field: &PointLights,
        z: f64,
        extrapolation: Extrapolation,
        t: f64,
    ) -> f64 {
        let (mut low, mut high) = (0.0, field.nearest(z));
        for _ in 0..36 {
            let radius = 0.5 * (low + high);
            if self.error(field, z, extrapolation, radius) < t {
                low = radius;
            } else {
                high = radius;
            }
        }
        low
    }

    /// ∫_B |E − L| dV / ∫_B L dV over the ball of `radius` around `z` on the axis.
    ///
    /// dV = 2π s² ds dμ with the distance s from the centre and the cosine μ to the axis, around which all is even.
    fn error(&self, field: &PointLights, z: f64, extrapolation: Extrapolation, radius: f64) -> f64 {
        let local = field.local(z);
        let slope = local.gradient / local.value;
        let extrapolated = |dz: f64| match extrapolation {
            Extrapolation::Constant => local.value,
            Extrapolation::Linear => local.value * (1.0 + slope * dz),
            Extrapolation::Logarithmic => local.value * (slope * dz).exp(),
        };
        let (mut error, mut whole) = (0.0, 0.0);
        for &(u, weight) in &self.radial {
            let s = 0.5 * radius * (1.0 + u);
            let truth = |mu: f64| field.value(z + s * mu, s * s * (1.0 - mu * mu));
            error += weight * s * s * self.absolute(|mu| extrapolated(s * mu) - truth(mu));
            whole += weight * s * s * self.absolute(truth);
        }
        error / whole
    }

    /// ∫₋₁¹ |f(μ)| dμ, the interval cut where f changes its sign, so that what is integrated is smooth.
    fn absolute(&self, f: impl Fn(f64) -> f64) -> f64 {
        let mut sum = 0.0;
        let mut left = (-1.0, f(-1.0));
        for i in 1..=PANELS {
            let edge = 2.0 * i as f64 / PANELS as f64 - 1.0;
            let right = (edge, f(edge));
            if left.1 * right.1 < 0.0 {
                let zero = zero(&f, left, right.0);
                sum += self.smooth(&f, left.0, zero).abs() + self.smooth(&f, zero, right.0).abs();
            } else {
                sum += self.smooth(&f, left.0, right.0).abs();
            }
            left = right;
        }
        sum
    }

    /// ∫ₐᵇ f(μ) dμ
    fn smooth(&self, f: impl Fn(f64) -> f64, a: f64, b: f64) -> f64 {
        let half = 0.5 * (b - a);
        let nodes = self.angular.iter();
        nodes
            .map(|(u, weight)| half * weight * f(a + half * (1.0 + u)))
            .sum()
    }
}

/// Where f changes its sign from that at `a` before `b`. An error δ here adds one of order δ² to the integral: 24 bits do.
fn zero(f: impl Fn(f64) -> f64, (mut a, at_a): (f64, f64), mut b: f64) -> f64 {
    for _ in 0..20 {
        let middle = 0.5 * (a + b);
        if f(middle) * at_a > 0.0 {
            a = middle;
        } else {
            b = middle;
        }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_grows_with_the_ball_and_stays_large() {
        let oracle = Oracle::new();
        for sigma_t in [0.0, 0.5, 2.0, 8.0] {
            let field = PointLights {
                sigma_t,
                lights: vec![-1.0, 1.0],
            };
            for z in [-2.5, -1.3, -0.9, -0.4, 0.0, 0.7] {
                for extrapolation in [
                    Extrapolation::Constant,
                    Extrapolation::Linear,
                    Extrapolation::Logarithmic,
                ] {
                    let mut most = 0.0_f64;
                    for i in 1..40 {
                        let radius = f64::from(i) / 40.0 * field.nearest(z);
                        let error = oracle.error(&field, z, extrapolation, radius);
                        assert!(
                            error > most.min(0.5),
                            "σt {sigma_t}, z {z}, R {radius}: {error}"
                        );
                        most = most.max(error);
                    }
                    assert!(most > 0.2, "σt {sigma_t}, z {z}: {most}");
                }
            }
        }
    }
}
