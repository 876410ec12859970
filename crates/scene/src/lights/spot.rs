//! A lamp without extent that shines into a cone, as in `KHR_lights_punctual`.

use super::point::towards_lamp;
use glam::{DVec3, Vec3};
use std::f32::consts::{PI, TAU};
use tyndall_math::{Jet, Ray, warp::Equiangular};
use tyndall_transport::LightSample;
use tyndall_transport::importance::{bounded, facing, mean};
use tyndall_transport::light_tree::{Cone, LightBounds};

/// A lamp whose intensity falls off between two cones around an axis.
///
/// I(θ) = I₀ saturate((cosθ − cosθₒ) / (cosθᵢ − cosθₒ))²
///
/// * θᵢ, θₒ – half-angles of the inner and the outer cone.
/// * I₀ – intensity on the axis, W/sr.
/// * θ – angle between the axis and the direction from the lamp.
///
/// glTF's `KHR_lights_punctual`, "Inner and Outer Cone Angles", without the floor of 0.001 in its example; equal angles make
/// a hard edge. Cosines are held as 1 − cosθ = 2 sin²(θ/2), which keeps the digits of narrow cones.
#[derive(Clone, Copy, Debug)]
pub struct SpotLight {
    position: Vec3,
    direction: Vec3,
    intensity: Vec3,
    outer_cone: f32,
    inner_versine: f32,
    outer_versine: f32,
}

impl SpotLight {
    /// A lamp at `position` (metres) that shines along the unit `direction` with radiant `intensity` (W/sr) on the axis,
    /// full within the half-angle `inner_cone` and zero beyond `outer_cone` (radians, 0 ≤ inner ≤ outer ≤ π).
    pub fn new(
        position: Vec3,
        direction: Vec3,
        intensity: Vec3,
        inner_cone: f32,
        outer_cone: f32,
    ) -> Self {
        let versine = |angle: f32| 2.0 * (0.5 * angle).sin().powi(2);
        Self {
            position,
            direction,
            intensity,
            outer_cone,
            inner_versine: versine(inner_cone),
            outer_versine: versine(outer_cone),
        }
    }

    /// Where the lamp hangs, in metres.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Radiant intensity on the axis, W/sr.
    pub fn intensity(&self) -> Vec3 {
        self.intensity
    }

    /// Radiant power, in W: 2π I₀ (1 − cosθᵢ + (cosθᵢ − cosθₒ)/3), the integral of I(θ).
    pub fn power(&self) -> Vec3 {
        let ramp = self.outer_versine - self.inner_versine;
        self.intensity * (TAU * (self.inner_versine + ramp / 3.0))
    }

    /// Its place and its cone, with a margin against rounding.
    pub(super) fn bounds(&self) -> LightBounds {
        const MARGIN: f32 = 1e-3;
        let cone = Cone {
            axis: self.direction,
            half_angle: (self.outer_cone + MARGIN).min(PI),
        };
        LightBounds {
            center: self.position,
            radius: 0.0,
            cone,
            intensity: bounded(mean(self.power()) / cone.solid_angle()),
        }
    }

    /// The falloff for light that leaves the lamp along the unit vector `w`, in [0, 1].
    fn falloff(&self, w: Vec3) -> f32 {
        let versine = 0.5 * (w - self.direction).length_squared();
        if versine <= self.inner_versine {
            return if self.outer_versine > 0.0 { 1.0 } else { 0.0 };
        }
        if versine >= self.outer_versine {
            return 0.0;
        }
        let ramp = (self.outer_versine - versine) / (self.outer_versine - self.inner_versine);
        ramp * ramp
    }

    /// ln of the falloff, up to a constant, with its derivatives when the lit point `p` moves: 2 ln (c − cosθₒ) on the ramp,
    /// c = w·a; 0 elsewhere.
    pub(super) fn ln_falloff(&self, p: DVec3) -> Jet {
        let offset = Jet::point(p) - self.position.as_dvec3();
        let axis = self.direction.as_dvec3().normalize();
        let cosine = (offset / offset.length()).dot_fixed(axis);
        let versine = 1.0 - cosine.value;
        if versine > self.inner_versine.into() && versine < self.outer_versine.into() {
            (cosine - (1.0 - f64::from(self.outer_versine))).ln() * 2.0
        } else {
            Jet::ZERO
        }
    }

    pub(super) fn importance(&self, p: Vec3, normal: Option<Vec3>) -> f32 {
        let Some(w) = (p - self.position).try_normalize() else {
            return f32::MAX;
        };
        let fluence = mean(self.intensity) * self.falloff(w) / self.position.distance_squared(p);
        fluence * facing(p, normal, self.position, 0.0)
    }

    /// ∫ I dt / r² over the part of the ray inside the outer cone, with the mean falloff at a few of its points.
    pub(super) fn importance_along(&self, ray: &Ray, t_max: f32) -> f32 {
        /// Points looked at; between them may be a brighter one, hence never less than [`LEAST`].
        const POINTS: [f32; 4] = [0.125, 0.375, 0.625, 0.875];
        const LEAST: f32 = 0.01;
        let Some((start, end)) = self.clip(ray, t_max) else {
            return 0.0;
        };
        let distances = Equiangular::new(ray, self.position, start, end);
        let falloff = POINTS.map(|u| {
            let p = ray.at(distances.sample(u).0);
            self.falloff((p - self.position).normalize_or_zero())
        });
        let mean_falloff = falloff.iter().sum::<f32>() / POINTS.len() as f32;
        mean(self.intensity) * mean_falloff.max(LEAST) * distances.angle_over_distance()
    }

    pub(super) fn sample(&self, p: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        towards_lamp(p, self.position, |w_i| self.intensity * self.falloff(-w_i))
    }

    /// The distances between which `ray` can be inside the outer cone; a little too wide rather than too narrow.
    ///
    /// A point x = o + t d is inside where (x − l)·a ≥ cosθ |x − l|. Both sides squared give c(t) = c₂t² + 2c₁t + c₀ ≥ 0
    /// with c = ((x − l)·a)² − cos²θ |x − l|², on the side of the apex where (x − l)·a ≥ 0. For half-angles up to 90° the
    /// cone is convex, so what it keeps of a ray is one interval.
    fn clip(&self, ray: &Ray, t_max: f32) -> Option<(f32, f32)> {
        /// Widens the cone, against rounding.
        const MARGIN: f64 = 1e-3;
        let theta = f64::from(self.outer_cone) + MARGIN;
        if theta >= f64::from(PI) / 2.0 {
            return Some((0.0, t_max));
        }
        let axis = self.direction.as_dvec3();
        let d = ray.direction.as_dvec3();
        let o: DVec3 = ray.origin.as_dvec3() - self.position.as_dvec3();
        let cos2 = theta.cos() * theta.cos();
        let (da, oa) = (d.dot(axis), o.dot(axis));
        let c2 = da * da - cos2 * d.length_squared();
        let c1 = da * oa - cos2 * d.dot(o);
        let c0 = oa * oa - cos2 * o.length_squared();
        let inside = |t: f64| {
            let x = o + d * t;
            x.dot(axis) >= theta.cos() * x.length()
        };
        // The ray's ends and the crossings of the double cone cut it into pieces; those inside are neighbours.
        let t_max = f64::from(t_max);
        // Without a real crossing the nearest approach serves: through the apex the two coincide, to within rounding.
        let root = (c1 * c1 - c2 * c0).max(0.0).sqrt();
        // −c₁ ∓ root without cancellation, and the other root by Vieta. `max` also turns 0/0 into 0.
        let q = -(c1 + root.copysign(c1));
        let first = (q / c2).max(0.0).min(t_max);
        let second = (c0 / q).max(0.0).min(t_max);
        let cuts = [0.0, first.min(second), first.max(second), t_max];
        let mut pieces = cuts
            .windows(2)
            .filter(|piece| piece[1] > piece[0] && inside(0.5 * (piece[0] + piece[1])));
        let first = pieces.next()?;
        let last = pieces.next_back().unwrap_or(first);
        Some((first[0] as f32, (last[1] as f32).min(t_max as f32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    fn spot(inner_degrees: f32, outer_degrees: f32) -> SpotLight {
        let (inner, outer) = (inner_degrees.to_radians(), outer_degrees.to_radians());
        SpotLight::new(Vec3::ZERO, Vec3::Z, Vec3::splat(3.0), inner, outer)
    }

    fn at_degrees(angle: f32) -> Vec3 {
        let angle = angle.to_radians();
        Vec3::new(angle.sin(), 0.0, angle.cos())
    }

    #[test]
    fn the_ramp_lies_exactly_between_the_cosines_of_the_two_angles() {
        let light = spot(20.0, 40.0);
        let (inner, outer) = (20f32.to_radians().cos(), 40f32.to_radians().cos());
        for angle in [
            0.0, 10.0, 19.9, 20.1, 25.0, 30.0, 35.0, 39.9, 40.1, 90.0, 180.0f32,
        ] {
            let cos = angle.to_radians().cos();
            let expected = ((cos - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2);
            let found = light.falloff(at_degrees(angle));
            // The textbook form's own cancellation: 6e-8 / 0.17, doubled by the square.
            assert!((found - expected).abs() < 2e-6, "{angle}: {found}");
        }
    }

    #[test]
    fn the_derivatives_of_the_falloff_are_its_slopes() {
        let light = spot(20.0, 40.0);
        let falloff = |p: Vec3| light.falloff(p.normalize());
        for angle in [10.0, 25.0, 33.0, 50.0] {
            let p = 2.0 * at_degrees(angle);
            let slope = Vec3::from(Vec3::AXES.map(|axis| {
                let [a, b] = [p + 0.01 * axis, p - 0.01 * axis].map(falloff);
                if a + b > 0.0 {
                    (a - b) / (0.01 * (a + b))
                } else {
                    0.0
                }
            }));
            // Third derivative over the step: (0.01 / 0.2)² of it.
            let p = p.as_dvec3();
            let found = light.ln_falloff(p);
            assert!(
                (found.gradient.as_vec3() - slope).length() <= 5e-3 * slope.length(),
                "{angle}: {found:?} {slope}"
            );
            for (i, axis) in DVec3::AXES.into_iter().enumerate() {
                let [a, b] = [1e-5, -1e-5].map(|h| light.ln_falloff(p + h * axis).gradient);
                // Rounding over the step.
                assert!((found.hessian.col(i) - (a - b) / 2e-5).length() < 1e-7);
            }
        }
    }

    #[test]
    fn equal_angles_make_a_hard_edge_and_a_cone_of_no_width_is_dark() {
        let light = spot(30.0, 30.0);
        assert_eq!(light.falloff(at_degrees(29.99)), 1.0);
        assert_eq!(light.falloff(at_degrees(30.01)), 0.0);
        assert_eq!(spot(0.0, 0.0).falloff(Vec3::Z), 0.0);
        assert_eq!(spot(0.0, 0.0).power(), Vec3::ZERO);
    }

    #[test]
    fn narrow_cones_keep_their_ramp() {
        // At a tenth of a degree, cosines differ from 1 by 1.5e-6 only.
        let light = spot(0.05, 0.1);
        let found = light.falloff(at_degrees(0.075));
        // (θo² − θ²) / (θo² − θi²) for small angles; tolerance is an f32 direction's 1e-7 rad against 1.3e-3 rad.
        let expected = ((0.01 - 0.005_625) / (0.01 - 0.0025) as f32).powi(2);
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
    }

    #[test]
    fn power_is_the_integral_of_the_intensity() {
        for (inner, outer) in [(0.0, 45.0), (30.0, 30.0), (10.0, 90.0), (60.0, 170.0)] {
            let light = spot(inner, outer);
            let n = 20_000;
            let integral: f64 = (0..n)
                .map(|i| {
                    let cos = 1.0 - 2.0 * (i as f32 + 0.5) / n as f32;
                    let w = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                    f64::from(3.0 * light.falloff(w)) * 4.0 * std::f64::consts::PI / n as f64
                })
                .sum();
            // Midpoint rule; a hard edge costs at most one of 20 000 strips, of some thousand inside.
            let found = f64::from(light.power().x);
            assert!((found / integral - 1.0).abs() < 1e-3, "{found} {integral}");
        }
    }

    #[test]
    fn importance_along_a_ray_is_zero_only_where_the_cone_is_missed() {
        // Rays of many positions and directions: wherever a sample on the ray is lit, the estimate is positive.
        let light = spot(5.0, 25.0);
        let (mut n_lit, mut n_zero) = (0, 0);
        for i in 0..20_000u32 {
            let u = |k: u32| ((i * 5 + k).wrapping_mul(2_654_435_769) >> 8) as f32 / 16_777_216.0;
            let origin = (Vec3::new(u(0), u(1), u(2)) - 0.5) * 6.0;
            let direction = tyndall_math::warp::uniform_sphere([u(3), u(4)]);
            let ray = Ray::new(origin, direction);
            let importance = light.importance_along(&ray, 5.0);
            assert!(importance.is_finite() && importance >= 0.0);
            let lit = (0..200).any(|k| light.importance(ray.at(k as f32 * 0.025), None) > 0.0);
            assert!(!lit || importance > 0.0, "{ray:?}");
            n_lit += u32::from(lit);
            n_zero += u32::from(importance == 0.0);
        }
        assert!(n_lit > 1000 && n_zero > 1000, "{n_lit} {n_zero}");
    }

    #[test]
    fn rays_from_the_apex_along_the_axis_and_across_wide_cones_are_kept() {
        assert!(spot(5.0, 25.0).importance_along(&Ray::new(Vec3::ZERO, Vec3::Z), 5.0) > 0.0);
        assert!(spot(5.0, 25.0).importance_along(&Ray::new(Vec3::NEG_Z, Vec3::Z), 5.0) > 0.0);
        let wide = SpotLight::new(Vec3::ZERO, Vec3::Z, Vec3::ONE, 0.0, FRAC_PI_2);
        assert!(wide.importance_along(&Ray::new(Vec3::X + Vec3::NEG_Z, Vec3::Z), 5.0) > 0.0);
    }
}
