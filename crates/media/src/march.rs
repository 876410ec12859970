//! Optical depth through any extinction field, by marching, with the derivatives of what was marched.
//!
//! For media that have no closed form: noise, sums of blobs. A [`MovingSegment`] says how the segment follows a
//! moving point, and its sample points and step lengths move with it, so that gradient and Hessian are exactly those of
//! the marched sum.
//!
//! ```
//! use glam::DVec3;
//! use tyndall_media::march::even_steps;
//! use tyndall_media::{ExtinctionField, MovingSegment};
//!
//! /// Smoke around the origin, e^(−|p|²) per metre.
//! struct Smoke;
//!
//! impl ExtinctionField for Smoke {
//!     fn value(&self, p: DVec3) -> f64 {
//!         (-p.length_squared()).exp()
//!     }
//!     fn gradient(&self, p: DVec3) -> DVec3 {
//!         -2.0 * self.value(p) * p
//!     }
//! }
//!
//! let (lamp, x) = (DVec3::new(-1.0, 0.5, 0.0), DVec3::new(0.5, 0.2, 0.1));
//! let (_, gradient) = MovingSegment::to(lamp, x).optical_depth_gradient(&Smoke, even_steps(32));
//! // Moving x straight away from the lamp adds the extinction at x.
//! let away = (x - lamp).normalize();
//! assert!((away.dot(gradient) - Smoke.value(x)).abs() < 1e-6);
//! ```

use crate::gradient::GRAZING;
use glam::{DMat3, DVec3};
use std::iter;
use tyndall_math::Jet;

/// Extinction as a function of position.
///
/// Everywhere finite, and continuous: where it jumps, a gradient lacks the motion of the jump.
pub trait ExtinctionField {
    /// Extinction σt at `p`, per metre.
    fn value(&self, p: DVec3) -> f64;

    /// ∇σt at `p`; on a kink that of either side.
    fn gradient(&self, p: DVec3) -> DVec3;
}

/// Extinction that has second derivatives.
///
/// The gradient must be continuous for marched Hessians to be those of the optical depth: a trilinear grid has its exact
/// Hessian in each cell, but lacks the kinks on their faces.
pub trait SmoothExtinctionField: ExtinctionField {
    /// The Hessian of σt at `p`, symmetric.
    fn hessian(&self, p: DVec3) -> DMat3;
}

/// A segment that follows a point, and how: the same motion for every field marched along it.
///
/// Sample points are p(s) = o + s v for s in [0, 1], and τ = r ∫₀¹ σt(p(s)) ds with the length r. When the point moves by h,
/// p(s) moves by J h, J = Jₒ + s Jᵥ, so that the mean m = ∫ σt ds has ∇m = ∫ Jᵀ ∇σt ds and Hm = ∫ Jᵀ Hσt J ds; the
/// derivatives of τ = r m follow by the product rule. Jarosz, Donner, Zwicker and Jensen 2008, "Radiance caching for
/// participating media", march the gradient of the first kind so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingSegment {
    /// o.
    origin: DVec3,
    /// v.
    span: DVec3,
    /// Jₒ.
    d_origin: DMat3,
    /// Jᵥ.
    d_span: DMat3,
    /// r.
    length: Jet,
}

impl MovingSegment {
    /// From a fixed point to one that moves: points follow by their fraction s of the way, and the length changes.
    ///
    /// Where the points coincide to f32, optical depth and derivatives are 0. In the limit of small steps
    /// n · ∇τ = σt(`moving`), n being the direction.
    pub fn to(fixed: DVec3, moving: DVec3) -> Self {
        let way = Jet::point(moving) - fixed;
        let span = way.value();
        Self {
            origin: fixed,
            span,
            d_origin: DMat3::ZERO,
            d_span: DMat3::IDENTITY,
            // As the closed forms do: inverse powers of a smaller distance might overflow.
            length: if span.length() < f64::from(f32::MIN_POSITIVE) {
                Jet::ZERO
            } else {
                way.length()
            },
        }
    }

    /// From a point that moves, along the unit vector `direction` over a finite `length` that stays.
    pub fn rigid(origin: DVec3, direction: DVec3, length: f64) -> Self {
        debug_assert!(length.is_finite(), "an endless segment cannot be marched");
        Self {
            origin,
            span: direction * length,
            d_origin: DMat3::IDENTITY,
            d_span: DMat3::ZERO,
            length: length.into(),
        }
    }

    /// From a point that moves, along the unit vector `direction` that stays, to a plane at the finite distance `length`.
    ///
    /// ∇r = −N/(N · d), N being the plane's unit `normal` to either side; |N · d| is taken as at least 10⁻³, so that a
    /// grazing plane gives |∇r| ≤ 10³.
    pub fn onto_plane(origin: DVec3, direction: DVec3, length: f64, normal: DVec3) -> Self {
        let cosine = normal.dot(direction);
        let d_length = normal * (-1.0 / cosine.abs().max(GRAZING).copysign(cosine));
        Self {
            d_span: DMat3::from_cols(
                direction * d_length.x,
                direction * d_length.y,
                direction * d_length.z,
            ),
            length: Jet::linear(length, d_length),
            ..Self::rigid(origin, direction, length)
        }
    }

    /// Optical depth through `field` and its gradient with respect to the moving point.
    ///
    /// `breaks` are the ascending fractions of the way at which steps end and begin; none for a single step. Those not in
    /// (0, 1), NaN of a face that is never crossed among them, are passed over. In each step the rule is that of Gauss and
    /// Legendre with two points, exact for cubics: where the breaks are the cell faces of a trilinear grid, τ and ∇τ are
    /// exact. Elsewhere errors fall with the fourth power of the step.
    pub fn optical_depth_gradient(
        &self,
        field: &impl ExtinctionField,
        breaks: impl IntoIterator<Item = f64>,
    ) -> (f64, DVec3) {
        let tau = self.march(breaks, |p, jacobian| {
            Jet::linear(field.value(p), jacobian.transpose() * field.gradient(p))
        });
        (tau.value, tau.gradient)
    }

    /// Optical depth through `field` with gradient and Hessian with respect to the moving point.
    ///
    /// `breaks` as for [`MovingSegment::optical_depth_gradient`].
    pub fn optical_depth_jet(
        &self,
        field: &impl SmoothExtinctionField,
        breaks: impl IntoIterator<Item = f64>,
    ) -> Jet {
        self.march(breaks, |p, jacobian| Jet {
            value: field.value(p),
            gradient: jacobian.transpose() * field.gradient(p),
            hessian: jacobian.transpose() * field.hessian(p) * jacobian,
        })
    }

    /// r m, with m the mean of σt as a function of the moving point, sampled by `sigma_t(p, J)`.
    fn march(
        &self,
        breaks: impl IntoIterator<Item = f64>,
        sigma_t: impl Fn(DVec3, DMat3) -> Jet,
    ) -> Jet {
        let mut mean = Jet::ZERO;
        for (s, weight) in nodes(breaks) {
            let p = self.origin + self.span * s;
            mean += sigma_t(p, self.d_origin + self.d_span * s) * weight;
        }
        self.length * mean
    }
}

/// The breaks between `n` steps of the same length.
pub fn even_steps(n: usize) -> impl Iterator<Item = f64> {
    (1..n).map(move |i| i as f64 / n as f64)
}

/// Fractions and weights of the composite two-point rule of Gauss and Legendre on [0, 1]: in a step the middle ± its
/// length/√12, weighing half of it each (Abramowitz and Stegun 25.4.29).
fn nodes(breaks: impl IntoIterator<Item = f64>) -> impl Iterator<Item = (f64, f64)> {
    let mut begin = 0.0;
    let steps = breaks.into_iter().chain(iter::once(1.0)).map(move |end| {
        // In this order NaN gives `begin`.
        let step = (begin, end.max(begin).min(1.0));
        begin = step.1;
        step
    });
    steps.flat_map(|(begin, end)| {
        let (middle, length) = (0.5 * (begin + end), end - begin);
        let offset = length / 12_f64.sqrt();
        [middle - offset, middle + offset].map(|s| (s, 0.5 * length))
    })
}
