//! The field of the report: light scattered once from point lights on an axis in even, isotropic fog. It is known in closed
//! form with both its derivatives.

use std::f64::consts::PI;

/// Point lights on the z axis, of 1 W each.
///
/// Their field is the fluence rate, in W/m²; σs/4π times it is scattered, a factor on which no radius depends.
pub(super) struct PointLights {
    /// Extinction, 1/m.
    pub(super) sigma_t: f64,
    /// Their places on the axis, in metres.
    pub(super) lights: Vec<f64>,
}

/// The field at a point on the axis.
pub(super) struct Local {
    /// L = Σ Lₖ over the lights.
    pub(super) value: f64,
    /// Σ ∂Lₖ/∂z, all there is of the gradient.
    pub(super) gradient: f64,
    /// Σ ‖∇Lₖ‖
    pub(super) gradient_norms: f64,
    /// ∂²L/∂z², an eigenvalue of the Hessian.
    pub(super) along: f64,
    /// ∂²L/∂x² = ∂²L/∂y², the other one.
    pub(super) across: f64,
}

impl PointLights {
    /// L = Σ exp(−σt rₖ)/(4π rₖ²) at `z` on the axis and `rho_2` from it, squared.
    pub(super) fn value(&self, z: f64, rho_2: f64) -> f64 {
        let lights = self.lights.iter();
        lights
            .map(|light| {
                let r_2 = (z - light).powi(2) + rho_2;
                (-self.sigma_t * r_2.sqrt()).exp() / (4.0 * PI * r_2)
            })
            .sum()
    }

    /// Value and derivatives at `z` on the axis, not in a light.
    ///
    /// With f(r) = exp(−σt r)/(4π r²):  f′ = −(σt + 2/r) f,  f″ = ((σt + 2/r)² + 2/r²) f; the Hessian of f(‖x‖) has the
    /// eigenvalues f″ along x and f′/r across it.
    pub(super) fn local(&self, z: f64) -> Local {
        let mut local = Local {
            value: 0.0,
            gradient: 0.0,
            gradient_norms: 0.0,
            along: 0.0,
            across: 0.0,
        };
        for light in &self.lights {
            let r = (z - light).abs();
            let f = (-self.sigma_t * r).exp() / (4.0 * PI * r * r);
            let slope = self.sigma_t + 2.0 / r;
            local.value += f;
            local.gradient -= slope * f * (z - light).signum();
            local.gradient_norms += slope * f;
            local.along += (slope * slope + 2.0 / (r * r)) * f;
            local.across -= slope * f / r;
        }
        local
    }

    /// Distance from `z` on the axis to the nearest light.
    pub(super) fn nearest(&self, z: f64) -> f64 {
        let distances = self.lights.iter().map(|light| (z - light).abs());
        distances.fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let field = PointLights {
            sigma_t: 0.7,
            lights: vec![-1.0, 1.5],
        };
        let h = 1e-4;
        for z in [-1.8, -0.3, 0.2, 0.9, 2.5] {
            let local = field.local(z);
            let [before, here, after] = [-h, 0.0, h].map(|dz| field.value(z + dz, 0.0));
            let beside = field.value(z, h * h);
            // The rule's own error is of order h²; second differences lose half the digits, 1e-16/h².
            let check = |found: f64, exact: f64| {
                assert!(
                    (found - exact).abs() < 1e-5 * local.value,
                    "{found}, {exact} at {z}"
                );
            };
            check(here, local.value);
            check((after - before) / (2.0 * h), local.gradient);
            check((after - 2.0 * here + before) / (h * h), local.along);
            check(2.0 * (beside - here) / (h * h), local.across);
        }
    }
}
