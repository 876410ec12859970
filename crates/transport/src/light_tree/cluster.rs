//! A cluster of lights, and how much light it could bring.
//!
//! The estimates err on the side of too much: a cluster that seems to bring much is looked at more closely and found out.

use super::{Cone, LightBounds};
use crate::importance::{facing, inverse_square_along};
use glam::Vec3;
use std::f32::consts::PI;
use std::ops::Range;
use tyndall_math::{Aabb, Ray};

/// Radii within which a cluster is too near to be judged as one. With 2, choices among the lights of the street have 1.05
/// times the second moment of those by the importance of each light; with 1.5 it is 1.12, with 1 it is 2 (2026-11-22).
const NEAR: f32 = 2.0;

/// Lights that lie next to each other.
#[derive(Clone, Debug)]
pub(crate) struct Cluster {
    /// Mean of the lights' centres by intensity.
    pub(crate) center: Vec3,
    /// All its lights lie within it, metres.
    radius: f32,
    /// Whether its lights shine in all directions.
    everywhere: bool,
    /// Around it any of the lights shines.
    axis: Vec3,
    /// Cosine and sine of the half-angle around the axis.
    cos_sin: [f32; 2],
    /// Sum of the lights' intensities, each as if it shone this way, W/sr.
    intensity: f32,
    /// Its lights, as places in the tree's order.
    pub(crate) places: Range<u32>,
    /// Indices of the two clusters it is made of; `None` for a single light.
    pub(crate) halves: Option<[u32; 2]>,
}

impl Cluster {
    /// The cluster of `members`, whose places begin at `first`.
    pub(super) fn new(members: &[(u32, LightBounds)], first: u32) -> Self {
        let lights = || members.iter().map(|(_, light)| light);
        let intensity: f32 = lights().map(|light| light.intensity).sum();
        let mean: Vec3 = lights()
            .map(|light| light.center * (light.intensity / intensity))
            .sum();
        let center = if mean.is_finite() {
            mean
        } else {
            // Without light there is no mean.
            let grow = |bounds: Aabb, light: &LightBounds| bounds.grow(light.center);
            lights().fold(Aabb::EMPTY, grow).center()
        };
        let cone = lights().map(|light| light.cone).reduce(Cone::union);
        let cone = cone.unwrap_or(Cone::SPHERE);
        Self {
            center,
            radius: lights()
                .map(|light| light.center.distance(center) + light.radius)
                .fold(0.0, f32::max),
            everywhere: cone.half_angle >= PI,
            axis: cone.axis,
            cos_sin: [cone.half_angle.cos(), cone.half_angle.sin()],
            intensity,
            places: first..first + members.len() as u32,
            halves: None,
        }
    }

    /// Estimate of the fluence that its lights bring to `p`; `None` where `p` is too near to judge them as one.
    pub(crate) fn importance(&self, p: Vec3, normal: Option<Vec3>) -> Option<f32> {
        let offset = p - self.center;
        let distance_squared = offset.length_squared();
        if self.is_near(distance_squared) {
            return None;
        }
        if !self.everywhere && !self.shines(offset, distance_squared) {
            return Some(0.0);
        }
        let fluence = self.intensity / distance_squared;
        Some(fluence * facing(p, normal, self.center, self.radius))
    }

    /// Estimate of the integral of [`Cluster::importance`] over `ray` from 0 to the finite `t_max`; `None` where the ray passes too
    /// near.
    pub(crate) fn importance_along(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        let t = (self.center - ray.origin).dot(ray.direction);
        let nearest = ray.at(t.clamp(0.0, t_max)) - self.center;
        let distance_squared = nearest.length_squared();
        if self.is_near(distance_squared) {
            return None;
        }
        if !self.everywhere && !self.shines_along(ray, t_max, t, distance_squared) {
            return Some(0.0);
        }
        Some(self.intensity * inverse_square_along(ray, self.center, 0.0, [0.0, t_max]))
    }

    fn is_near(&self, distance_squared: f32) -> bool {
        distance_squared <= NEAR * NEAR * self.radius * self.radius
    }

    /// Whether any of its lights may shine to the point at `offset` from the centre, no nearer than a distance given by its square.
    ///
    /// Seen from there a light may stand off the centre by δ, sinδ = radius/distance: the cone is wider by so much.
    fn shines(&self, offset: Vec3, distance_squared: f32) -> bool {
        let [cos, sin] = self.cos_sin;
        let sin_delta_squared = self.radius * self.radius / distance_squared;
        let (sin_delta, cos_delta) = (sin_delta_squared.sqrt(), (1.0 - sin_delta_squared).sqrt());
        let all_directions = cos <= -cos_delta;
        all_directions
            || offset.dot(self.axis) >= offset.length() * (cos * cos_delta - sin * sin_delta)
    }

    /// Whether any of its lights may shine to some point of the ray, whose line comes nearest at `t`, and the ray itself no
    /// nearer than a distance given by its square.
    ///
    /// With the axis' share A along the offset h of the line's nearest point and its share B along the ray, the cosine between
    /// the axis and the direction to the point s beyond is (A + sB)/√(h² + s²): largest at s = B h²/A where A is positive,
    /// else at an end.
    fn shines_along(&self, ray: &Ray, t_max: f32, t: f32, distance_squared: f32) -> bool {
        let offset = ray.at(t) - self.center;
        let (across, along) = (offset.dot(self.axis), ray.direction.dot(self.axis));
        let shines = |t: f32| self.shines(ray.at(t) - self.center, distance_squared);
        if across > 0.0 {
            let brightest = t + along * offset.length_squared() / across;
            shines(brightest.clamp(0.0, t_max))
        } else {
            shines(0.0) || shines(t_max)
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use tyndall_math::{Key, Purpose, Sampler, warp};

    /// Three spots within 1 m of the origin whose cones of 0.3 rad point roughly along +X.
    fn spots() -> Vec<(u32, LightBounds)> {
        [(Vec3::X, 0.0), (Vec3::Y, 0.1), (Vec3::NEG_Z, -0.2)]
            .into_iter()
            .map(|(center, angle)| LightBounds {
                center,
                radius: 0.0,
                cone: Cone {
                    axis: Vec3::new(f32::cos(angle), f32::sin(angle), 0.0),
                    half_angle: 0.3,
                },
                intensity: 2.0,
            })
            .map(|light| (0, light))
            .collect()
    }

    #[test]
    fn where_a_light_shines_its_cluster_does_along_rays_too() {
        let spots = spots();
        let cluster = Cluster::new(&spots, 0);
        let lit = |p: Vec3| {
            spots
                .iter()
                .any(|(_, l)| l.cone.axis.angle_between(p - l.center) < 0.3)
        };
        let (mut n_lit, mut n_dark) = (0, 0);
        for index in 0..20_000 {
            let key = Key {
                seed: 2,
                purpose: Purpose::Probe,
                index,
            };
            let mut random = Sampler::new(key, 0);
            let p = warp::uniform_sphere(random.next_2d()) * (20.0 * random.next_1d());
            let ray = Ray::new(p, warp::uniform_sphere(random.next_2d()));
            let n_steps = 50;
            let any_lit = (0..=n_steps).any(|i| lit(ray.at(0.2 * i as f32)));
            let (at, along) = (
                cluster.importance(p, None),
                cluster.importance_along(&ray, 10.0),
            );
            assert!(!lit(p) || at != Some(0.0), "{p}");
            assert!(!any_lit || along != Some(0.0), "{ray:?}");
            n_lit += u32::from(any_lit);
            n_dark += u32::from(along == Some(0.0));
        }
        assert!(n_lit > 1000 && n_dark > 1000, "{n_lit} {n_dark}");
    }

    #[test]
    fn near_a_cluster_nothing_is_said_and_far_away_it_is_one_lamp() {
        let cluster = Cluster::new(&spots(), 0);
        for p in [cluster.center, Vec3::X, Vec3::new(0.0, 1.5, 0.0)] {
            assert_eq!(cluster.importance(p, None), None);
            let passing = Ray::new(p - Vec3::X * 9.0, Vec3::X);
            assert_eq!(cluster.importance_along(&passing, 20.0), None);
        }
        let found = cluster
            .importance(cluster.center + Vec3::X * 100.0, None)
            .unwrap();
        assert!((found / 6e-4 - 1.0).abs() < 1e-5, "rounding: {found}");
    }

    #[test]
    fn lights_without_power_or_without_distance_make_a_cluster_too() {
        let mut dark = spots();
        for (_, light) in &mut dark {
            light.intensity = 0.0;
        }
        assert_eq!(
            Cluster::new(&dark, 0).importance(Vec3::X * 9.0, None),
            Some(0.0)
        );
        let together = [spots()[0]; 3];
        let cluster = Cluster::new(&together, 0);
        assert!(cluster.radius < 1e-6 && cluster.importance(Vec3::X * 2.0, None) > Some(5.9));
    }
}
