//! Rules that give a record its radius from the field and its derivatives at the record alone. Each is a formula; what the
//! formulas are worth is told by the best radius.

use super::field::Local;

/// R = α Σ Lₖ / Σ ‖∇Lₖ‖ over the lights k.
///
/// * `alpha` – without unit; proportional to √t for records with gradients.
///
/// Jarosz et al. 2008, "Radiance caching for participating media".
pub(super) fn sum_of_norms(local: &Local, alpha: f64) -> f64 {
    alpha * local.value / local.gradient_norms
}

/// R = α Σ Lₖ / ‖Σ ∇Lₖ‖, infinite where gradients cancel.
pub(super) fn norm_of_sum(local: &Local, alpha: f64) -> f64 {
    alpha * local.value / local.gradient.abs()
}

/// R = (10 t / (3 m))^½  with  m = ⟨|wᵀ H w|⟩ over directions w,  H = ∇∇ ln L.
///
/// * `t` – relative error allowed over the ball.
///
/// For E = L exp(∇ln L·Δ) the ratio is E/L(x + Δ) = exp(−½ Δᵀ H Δ + …), so that in leading order
/// ∫|E − L| / ∫L = mean over the ball of ½ |Δᵀ H Δ| = ½ · ⅗ R² · m = t. No constant is fitted.
pub(super) fn hessian(local: &Local, t: f64) -> f64 {
    let (along, across) = log_hessian(local);
    (10.0 * t / (3.0 * mean_curvature(along, across))).sqrt()
}

/// R = κ (10 t / Σ |λᵢ|)^½ over the eigenvalues λᵢ of H: [`hessian`] with Σ |λᵢ|/3 ≥ m, which needs no integral where all three
/// differ.
///
/// * `kappa` – without unit, above 1: what the bound gives away.
///
/// ½ Σ |λᵢ| Δᵢ² has the mean R² Σ |λᵢ|/10 over the ball. Schwarzhaupt et al. 2012 take the same bound on surfaces.
pub(super) fn hessian_bound(local: &Local, t: f64, kappa: f64) -> f64 {
    let (along, across) = log_hessian(local);
    kappa * (10.0 * t / (along.abs() + 2.0 * across.abs())).sqrt()
}

/// Eigenvalues of H = ∇∇L/L − ∇L ∇Lᵀ/L², along the axis and (twice) across it.
fn log_hessian(local: &Local) -> (f64, f64) {
    let slope = local.gradient / local.value;
    (
        local.along / local.value - slope * slope,
        local.across / local.value,
    )
}

/// ⟨|wᵀ H w|⟩ over directions w, for the eigenvalues a along an axis and b, b across it.
///
/// = ∫₀¹ |b + (a − b) μ²| dμ, in two parts where the sign changes, at μ² = b/(b − a).
fn mean_curvature(a: f64, b: f64) -> f64 {
    let integral = |mu: f64| b * mu + (a - b) * mu.powi(3) / 3.0;
    if a * b >= 0.0 {
        return integral(1.0).abs();
    }
    let zero = (b / (b - a)).sqrt();
    integral(zero).abs() + (integral(1.0) - integral(zero)).abs()
}

#[cfg(test)]
mod tests {
    use super::super::field::PointLights;
    use super::*;
    use tyndall_math::quadrature::gauss_legendre;

    #[test]
    fn mean_curvature_is_the_mean_over_directions() {
        for (a, b) in [
            (2.0, 1.0),
            (-2.0, -1.0),
            (2.0, -3.0),
            (-1.0, 5.0),
            (0.0, 1.0),
        ] {
            let mean: f64 = gauss_legendre(400)
                .iter()
                .map(|(mu, w)| 0.5 * w * (b + (a - b) * mu * mu).abs())
                .sum();
            let found = mean_curvature(a, b);
            // The kink costs the rule its order: an error of 1/400² times the slope, up to 10.
            assert!((found - mean).abs() < 1e-4, "{a}, {b}: {found}, {mean}");
        }
    }

    #[test]
    fn exponential_decay_along_the_axis_has_no_curvature() {
        // From far away a light's field is exp(−σt z): H falls to 2/r² along the axis and −(σt + 2/r)/r across it.
        let field = PointLights {
            sigma_t: 3.0,
            lights: vec![-100.0],
        };
        let (along, across) = log_hessian(&field.local(0.0));
        assert!((along - 2e-4).abs() < 1e-12, "{along}");
        assert!((across + 0.0302).abs() < 1e-12, "{across}");
    }
}
