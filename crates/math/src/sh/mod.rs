//! Real spherical harmonics: smooth functions of direction as a short list of numbers.
//!
//! Orthonormal, without the Condon–Shortley sign, coefficient (l, m) at index l² + l + m. Band 1 is √(3/4π) (y, z, x).

mod basis;
mod zonal;

pub use basis::Basis;
pub use zonal::{convolve_zonal, legendre_moments};

use glam::Vec3;
use std::f32::consts::PI;

/// Number of coefficients of bands 0 to `order`.
pub const fn n_coefficients(order: usize) -> usize {
    (order + 1) * (order + 1)
}

/// φ = ∫ L dω of the radiance whose coefficients begin with `c_00`: √(4π) c₀₀.
pub fn fluence(c_00: Vec3) -> Vec3 {
    c_00 * (4.0 * PI).sqrt()
}

/// F = ∫ ω L dω, one vector per colour, of the radiance with band 1 `[c₁₋₁, c₁₀, c₁₁]`: √(4π/3) (c₁₁, c₁₋₁, c₁₀).
pub fn vector_flux(band_1: [Vec3; 3]) -> [Vec3; 3] {
    let [y, z, x] = band_1.map(|c| c * (4.0 * PI / 3.0).sqrt());
    [0, 1, 2].map(|channel| Vec3::new(x[channel], y[channel], z[channel]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::sphere;
    use glam::DVec3;

    #[test]
    fn fluence_and_flux_of_coefficients_are_the_integrals_of_the_radiance() {
        let lobe = Vec3::new(0.48, -0.6, 0.64);
        let radiance = |w: Vec3| {
            let bump = (2.0 * (w.dot(lobe) - 1.0)).exp();
            Vec3::new(bump, 1.0, w.x * w.x + 0.5 * w.z)
        };
        let basis = Basis::new(4);
        let c = basis.project(24, radiance);
        let mut phi = DVec3::ZERO;
        let mut flux = [DVec3::ZERO; 3];
        for (w, weight) in sphere(24) {
            let l = radiance(w.as_vec3()).as_dvec3() * weight;
            phi += l;
            for channel in 0..3 {
                flux[channel] += w * l[channel];
            }
        }
        // Roundings of f32 coefficients up to 4 and of their f32 basis.
        assert!((fluence(c[0]).as_dvec3() - phi).length() < 1e-5);
        for (a, b) in vector_flux([c[1], c[2], c[3]]).iter().zip(flux) {
            assert!((a.as_dvec3() - b).length() < 1e-5, "{a} {b}");
        }
    }
}
