//! Vectors whose coordinates are jets: differences, lengths and cosines of points that move.

use super::Jet;
use glam::DVec3;
use std::ops::{Add, Div, Mul, Sub};

/// A vector that depends on a point, with first and second derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JetVec3 {
    /// First coordinate.
    pub x: Jet,
    /// Second coordinate.
    pub y: Jet,
    /// Third coordinate.
    pub z: Jet,
}

impl JetVec3 {
    /// The vector itself, without derivatives.
    pub fn value(self) -> DVec3 {
        DVec3::new(self.x.value, self.y.value, self.z.value)
    }

    /// Scalar product.
    pub fn dot(self, other: Self) -> Jet {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Scalar product with a vector that stays.
    pub fn dot_fixed(self, v: DVec3) -> Jet {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// Length, for any vector but 0, where it has no derivatives.
    pub fn length(self) -> Jet {
        self.dot(self).sqrt()
    }
}

impl From<DVec3> for JetVec3 {
    fn from(v: DVec3) -> Self {
        Self {
            x: v.x.into(),
            y: v.y.into(),
            z: v.z.into(),
        }
    }
}

impl Add for JetVec3 {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            x: self.x + other.x,
            y: self.y + other.y,
            z: self.z + other.z,
        }
    }
}

impl Sub for JetVec3 {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self {
            x: self.x - other.x,
            y: self.y - other.y,
            z: self.z - other.z,
        }
    }
}

impl Sub<DVec3> for JetVec3 {
    type Output = Self;

    fn sub(self, v: DVec3) -> Self {
        Self {
            x: self.x - v.x,
            y: self.y - v.y,
            z: self.z - v.z,
        }
    }
}

impl Mul<f64> for JetVec3 {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            x: self.x * factor,
            y: self.y * factor,
            z: self.z * factor,
        }
    }
}

impl Div<Jet> for JetVec3 {
    type Output = Self;

    fn div(self, divisor: Jet) -> Self {
        Self {
            x: self.x / divisor,
            y: self.y / divisor,
            z: self.z / divisor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    /// Every column of the difference is at most this.
    fn near(a: DMat3, b: DMat3, tolerance: f64) -> bool {
        (a - b).to_cols_array().iter().all(|d| d.abs() <= tolerance)
    }

    #[test]
    fn distance_and_cosine_have_the_derivatives_of_the_textbook() {
        let (lamp, w) = (
            DVec3::new(1.1, -0.4, 1.6),
            DVec3::new(0.2, 0.3, -0.9).normalize(),
        );
        for x in [
            DVec3::new(0.3, 0.2, 0.1),
            DVec3::new(-40.0, 9.0, 2.0),
            lamp + 1e-3 * DVec3::Y,
        ] {
            let v = Jet::point(x) - lamp;
            let r = v.length();
            let direction = v / r;
            let n = direction.value();
            let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
            // Rounding, a few times.
            let eps = 1e-14;
            assert!((r.gradient - n).length() < eps);
            let h = (DMat3::IDENTITY - outer(n, n)) * r.value.recip();
            assert!(near(r.hessian, h, eps / r.value));
            // Of the cosine μ = n · w: ∇μ = (w − μ n)/r, Hμ = (−w nᵀ − n wᵀ − μ I + 3 μ n nᵀ)/r².
            let mu = direction.dot_fixed(w);
            let slope = (w - mu.value * n) / r.value;
            assert!((mu.gradient - slope).length() < eps / r.value);
            let h = (3.0 * mu.value * outer(n, n)
                - outer(w, n)
                - outer(n, w)
                - mu.value * DMat3::IDENTITY)
                * r.value.powi(-2);
            assert!(near(mu.hessian, h, eps / (r.value * r.value)));
            // Of 1/r²: −2 n/r³ and (8 n nᵀ − 2 I)/r⁴.
            let inverse_square = v.dot(v).recip();
            let fourth = r.value.powi(-4);
            let slope = -2.0 * n * r.value.powi(-3);
            assert!((inverse_square.gradient - slope).length() < eps * r.value.powi(-3));
            let h = (8.0 * outer(n, n) - 2.0 * DMat3::IDENTITY) * fourth;
            assert!(near(inverse_square.hessian, h, 3.0 * eps * fourth));
        }
    }

    #[test]
    fn vectors_add_scale_and_multiply_by_coordinate() {
        let p = Jet::point(DVec3::new(1.0, 2.0, 3.0));
        let fixed = DVec3::new(-1.0, 0.5, 2.0);
        assert_eq!(p - fixed, p - JetVec3::from(fixed));
        assert_eq!((p + p).value(), (p * 2.0).value());
        assert_eq!(p.dot(fixed.into()), p.dot_fixed(fixed));
        assert_eq!((p.x * fixed).y, p.x * 0.5);
    }
}
