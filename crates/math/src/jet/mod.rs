//! Values with their first and second derivatives: forward-mode automatic differentiation to second order.
//!
//! A formula written in [`Jet`]s instead of numbers gives its gradient and Hessian along with its value, exact to rounding.

mod vector;

pub use vector::JetVec3;

use glam::{DMat3, DVec3};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A function of a point, expanded to second order around it.
///
/// f(x + h) = f + ∇f · h + ½ hᵀ Hf h + O(|h|³)
///
/// Operators and [`Jet::map`] carry the three through a formula by the rules of differentiation (Griewank and Walther
/// 2008, *Evaluating Derivatives*, chapter 13). An `f64` is a constant: it enters with `from`. The Hessian stays symmetric
/// to the last bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// f, the value.
    pub value: f64,
    /// ∇f, the first derivatives.
    pub gradient: DVec3,
    /// Hf, the second derivatives; symmetric.
    pub hessian: DMat3,
}

impl Jet {
    /// The constant 0.
    pub const ZERO: Self = Self {
        value: 0.0,
        gradient: DVec3::ZERO,
        hessian: DMat3::ZERO,
    };

    /// A function that is linear around the point.
    pub fn linear(value: f64, gradient: DVec3) -> Self {
        Self {
            value,
            gradient,
            ..Self::ZERO
        }
    }

    /// The coordinates of a point `x` that moves: what differentiation starts from.
    pub fn point(x: DVec3) -> JetVec3 {
        JetVec3 {
            x: Self::linear(x.x, DVec3::X),
            y: Self::linear(x.y, DVec3::Y),
            z: Self::linear(x.z, DVec3::Z),
        }
    }

    /// A function φ of this one, from φ, φ′ and φ″ at its value.
    ///
    /// ∇(φ∘f) = φ′ ∇f,  H(φ∘f) = φ′ Hf + φ″ ∇f ∇fᵀ
    #[inline]
    pub fn map(self, phi: f64, d_phi: f64, d2_phi: f64) -> Self {
        Self {
            value: phi,
            gradient: d_phi * self.gradient,
            hessian: d_phi * self.hessian + d2_phi * outer(self.gradient, self.gradient),
        }
    }

    /// √f, for f > 0: at 0 a root has no derivatives.
    pub fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        let slope = 0.5 / root;
        self.map(root, slope, -0.5 * slope / self.value)
    }

    /// e^f; 0 with derivatives 0 where f = −∞ is constant.
    pub fn exp(self) -> Self {
        let exp = self.value.exp();
        self.map(exp, exp, exp)
    }

    /// ln f, for f > 0.
    pub fn ln(self) -> Self {
        let recip = self.value.recip();
        self.map(self.value.ln(), recip, -recip * recip)
    }

    /// 1/f, for f ≠ 0.
    pub fn recip(self) -> Self {
        let recip = self.value.recip();
        let square = recip * recip;
        self.map(recip, -square, 2.0 * square * recip)
    }

    /// Whether value and derivatives are all finite.
    pub fn is_finite(&self) -> bool {
        self.value.is_finite() && self.gradient.is_finite() && self.hessian.is_finite()
    }
}

/// a bᵀ.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// a bᵀ + b aᵀ.
fn symmetric_outer(a: DVec3, b: DVec3) -> DMat3 {
    outer(a, b) + outer(b, a)
}

impl From<f64> for Jet {
    fn from(value: f64) -> Self {
        Self {
            value,
            ..Self::ZERO
        }
    }
}

impl Neg for Jet {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            value: -self.value,
            gradient: -self.gradient,
            hessian: -self.hessian,
        }
    }
}

impl Add for Jet {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
            hessian: self.hessian + other.hessian,
        }
    }
}

impl AddAssign for Jet {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Jet {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Jet {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            gradient: self.value * other.gradient + other.value * self.gradient,
            hessian: self.value * other.hessian
                + other.value * self.hessian
                + symmetric_outer(self.gradient, other.gradient),
        }
    }
}

impl Div for Jet {
    type Output = Self;

    /// From f = q g: ∇f = q ∇g + g ∇q and Hf = q Hg + g Hq + ∇q ∇gᵀ + ∇g ∇qᵀ, solved for q and its derivatives.
    #[inline]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let gradient = (self.gradient - value * other.gradient) / other.value;
        let hessian =
            self.hessian - value * other.hessian - symmetric_outer(gradient, other.gradient);
        Self {
            value,
            gradient,
            hessian: hessian / other.value,
        }
    }
}

impl Add<f64> for Jet {
    type Output = Self;

    fn add(self, constant: f64) -> Self {
        Self {
            value: self.value + constant,
            ..self
        }
    }
}

impl Sub<f64> for Jet {
    type Output = Self;

    fn sub(self, constant: f64) -> Self {
        self + -constant
    }
}

impl Mul<f64> for Jet {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            gradient: self.gradient * factor,
            hessian: self.hessian * factor,
        }
    }
}

impl Div<f64> for Jet {
    type Output = Self;

    fn div(self, divisor: f64) -> Self {
        Self {
            value: self.value / divisor,
            gradient: self.gradient / divisor,
            hessian: self.hessian / divisor,
        }
    }
}

impl Mul<DVec3> for Jet {
    type Output = JetVec3;

    /// A fixed vector, scaled by this.
    fn mul(self, v: DVec3) -> JetVec3 {
        JetVec3 {
            x: self * v.x,
            y: self * v.y,
            z: self * v.z,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// x² y + 3 z − ½ x z, written out.
    fn cubic(p: DVec3) -> Jet {
        Jet {
            value: p.x * p.x * p.y + 3.0 * p.z - 0.5 * p.x * p.z,
            gradient: DVec3::new(2.0 * p.x * p.y - 0.5 * p.z, p.x * p.x, 3.0 - 0.5 * p.x),
            hessian: DMat3::from_cols_array_2d(&[
                [2.0 * p.y, 2.0 * p.x, -0.5],
                [2.0 * p.x, 0.0, 0.0],
                [-0.5, 0.0, 0.0],
            ]),
        }
    }

    /// |p|² + 1, written out; above 0.
    fn quadric(p: DVec3) -> Jet {
        Jet {
            value: p.length_squared() + 1.0,
            gradient: 2.0 * p,
            hessian: 2.0 * DMat3::IDENTITY,
        }
    }

    fn distance(a: Jet, b: Jet) -> f64 {
        let columns = |m: DMat3| m.to_cols_array();
        let hessians = columns(a.hessian).into_iter().zip(columns(b.hessian));
        hessians
            .map(|(a, b)| (a - b).abs())
            .chain([
                (a.value - b.value).abs(),
                (a.gradient - b.gradient).abs().max_element(),
            ])
            .fold(0.0, f64::max)
    }

    /// Gradient and Hessian are central differences of value and gradient, and the Hessian is symmetric.
    fn check(name: &str, f: impl Fn(DVec3) -> Jet, p: DVec3) {
        let h = 1e-5;
        let jet = f(p);
        for (i, axis) in DVec3::AXES.into_iter().enumerate() {
            let (after, before) = (f(p + h * axis), f(p - h * axis));
            let slope = (after.value - before.value) / (2.0 * h);
            let column = (after.gradient - before.gradient) / (2.0 * h);
            // h² and rounding over h, each some 1e-10, times third derivatives of some hundred near the corners.
            let scale = 1.0 + jet.gradient.length() + column.length();
            assert!((jet.gradient[i] - slope).abs() < 1e-7 * scale, "{name}");
            assert!(
                (jet.hessian.col(i) - column).length() < 1e-7 * scale,
                "{name}: {} {column}",
                jet.hessian.col(i)
            );
        }
        assert_eq!(jet.hessian, jet.hessian.transpose(), "{name}");
    }

    fn any_point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.5f64..1.5).prop_map(DVec3::from)
    }

    proptest! {
        #[test]
        fn every_operation_has_the_derivatives_of_its_value(p in any_point()) {
            let (f, g) = (cubic, quadric);
            check("sum", |p| f(p) + g(p), p);
            check("difference", |p| f(p) - g(p), p);
            check("product", |p| f(p) * g(p), p);
            check("quotient", |p| f(p) / g(p), p);
            check("negative", |p| -f(p), p);
            check("constants", |p| ((f(p) + 2.0) * 3.0 - 1.0) / 7.0, p);
            check("root", |p| g(p).sqrt(), p);
            check("exponential", |p| (f(p) * 0.3).exp(), p);
            check("logarithm", |p| g(p).ln(), p);
            check("reciprocal", |p| g(p).recip(), p);
            check("sine", |p| {
                let (sin, cos) = f(p).value.sin_cos();
                f(p).map(sin, cos, -sin)
            }, p);
        }

        #[test]
        fn the_rules_of_algebra_hold_for_derivatives_too(p in any_point()) {
            let (f, g) = (cubic(p), quadric(p));
            // Some ten roundings of numbers up to a thousand.
            for (a, b) in [
                (f * g / g, f),
                (f / g, f * g.recip()),
                (f * (f + g), f * f + f * g),
                (g.ln().exp(), g),
                (g.sqrt() * g.sqrt(), g),
                ((f * 0.1).exp() * (g * 0.1).exp(), ((f + g) * 0.1).exp()),
                ((f - g) * (f + g), f * f - g * g),
            ] {
                prop_assert!(distance(a, b) < 1e-11, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn written_out_polynomials_and_their_jets_are_the_same() {
        let p = DVec3::new(0.3, -1.2, 0.7);
        let JetVec3 { x, y, z } = Jet::point(p);
        assert!(distance(x * x * y + z * 3.0 - x * z * 0.5, cubic(p)) < 1e-14);
        assert!(distance(x * x + y * y + z * z + 1.0, quadric(p)) < 1e-14);
    }

    #[test]
    fn no_light_through_infinite_depth_has_no_derivatives() {
        assert_eq!(Jet::from(f64::NEG_INFINITY).exp(), Jet::ZERO);
        assert!(Jet::linear(-1e300, DVec3::splat(1e150)).exp().is_finite());
    }
}
