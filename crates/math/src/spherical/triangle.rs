//! Even sampling of the solid angle of a triangle.

use glam::{DVec3, Vec3};

/// A triangle projected onto the unit sphere around a point.
///
/// With unit vectors v₀, v₁, v₂ to the corners the solid angle is
///
/// ```text
/// Ω = 2 atan2(G₀, G₁ + G₂),  G₀ = |det(v₀, v₁, v₂)|,  G₁ = v₀·v₂ + v₁·v₂,  G₂ = 1 + v₀·v₁
/// ```
///
/// (van Oosterom and Strackee 1983, equation 8). Sampling cuts off a part u₀Ω by a point v₂' on the arc from v₀ to v₂, then
/// goes along the arc from v₁ to v₂', evenly in the cosine. Let o = λv₀ + μv₂ halve the angle between v₀ and v₂', so that
/// v₂' = k o − v₀ with k = 2 v₀·o/o·o. Then det(v₀, v₁, v₂') = kμG₀ and 1 + v₀·v₁ + v₀·v₂' + v₁·v₂' = k (λG₂ + μG₁); their
/// ratio is tan(u₀Ω/2) for
///
/// ```text
/// λ = G₀ cos(u₀Ω/2) − G₁ sin(u₀Ω/2),  μ = G₂ sin(u₀Ω/2)
/// ```
///
/// Peters 2021, "BRDF Importance Sampling for Polygonal Lights", section 4; Arvo 1995 gives the same map through angles
/// of the triangle, whose differences cancel for small and for thin ones.
///
/// All in f64: corners are differences of f32 positions, exact there, and G₀ of a lamp of angle α is of order α².
#[derive(Clone, Copy, Debug)]
pub struct SphericalTriangle {
    /// Unit vectors to the corners.
    v: [DVec3; 3],
    /// Distances of the corners, in metres.
    r: [f64; 3],
    g: [f64; 3],
    solid_angle: f64,
}

/// A direction towards a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TriangleSample {
    /// Unit direction from the point to the triangle.
    pub direction: Vec3,
    /// Distance to the triangle, in metres.
    pub distance: f32,
    /// Weights of the three corners at the point hit; each in [0, 1], sum 1.
    pub barycentric: [f32; 3],
}

impl SphericalTriangle {
    /// The triangle with the given `corners` as seen from `p`; `None` where it is seen edge-on, or fills no solid angle that
    /// f32 could hold.
    pub fn new(p: Vec3, corners: [Vec3; 3]) -> Option<Self> {
        let p = p.as_dvec3();
        let to_corner = corners.map(|c| c.as_dvec3() - p);
        let r = to_corner.map(DVec3::length);
        let v = [0, 1, 2].map(|i| to_corner[i] / r[i]);
        let [a, b, c] = to_corner;
        // From edges: det(a, b, c) of a distant triangle is a small difference of large products.
        let g_0 = a.dot((b - a).cross(c - a)).abs() / (r[0] * r[1] * r[2]);
        let g_1 = v[0].dot(v[2]) + v[1].dot(v[2]);
        let g_2 = 1.0 + v[0].dot(v[1]);
        let solid_angle = 2.0 * g_0.atan2(g_1 + g_2);
        // g_0 = 0 inside the triangle's own plane, where the angle jumps from 0 to 2π at the edge.
        (g_0 > 0.0 && solid_angle > f64::from(f32::MIN_POSITIVE)).then_some(Self {
            v,
            r,
            g: [g_0, g_1, g_2],
            solid_angle,
        })
    }

    /// Solid angle in steradians, in (0, 2π); the density of [`SphericalTriangle::sample`] is one over it.
    pub fn solid_angle(&self) -> f32 {
        self.solid_angle as f32
    }

    /// A direction spread evenly over the solid angle.
    pub fn sample(&self, u: [f32; 2]) -> TriangleSample {
        let [v_0, v_1, v_2] = self.v;
        let [g_0, g_1, g_2] = self.g;
        let (sin, cos) = (0.5 * f64::from(u[0]) * self.solid_angle).sin_cos();
        let lambda = g_0 * cos - g_1 * sin;
        let mu = g_2 * sin;
        let o = v_0 * lambda + v_2 * mu;
        let k = 2.0 * v_0.dot(o) / o.length_squared();
        let cut = o * k - v_0;

        // cosθ = 1 − u₁ d from v₁, where d = 1 − v₁·v₂' comes from the chord; t = sinθ over the sine of the whole arc.
        let d = 0.5 * (v_1 - cut).length_squared();
        let u_1 = f64::from(u[1]);
        let t = (u_1 * (2.0 - u_1 * d) / (2.0 - d)).sqrt();
        let from_v_1 = 1.0 - u_1 * d - t * (1.0 - d);

        // direction = Σ βᵢ vᵢ; the point hit is Σ bᵢ cᵢ with bᵢ = distance βᵢ/rᵢ.
        let beta = [t * (k * lambda - 1.0), from_v_1, t * k * mu];
        let direction = v_1 * from_v_1 + cut * t;
        let weights = [0, 1, 2].map(|i| beta[i].max(0.0) / self.r[i]);
        let sum: f64 = weights.iter().sum();
        TriangleSample {
            direction: direction.normalize().as_vec3(),
            distance: (1.0 / sum) as f32,
            barycentric: weights.map(|w| (w / sum) as f32),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::testing::{Directions, assert_conforms};
    use proptest::prelude::*;
    use std::f64::consts::PI;

    const OCTANT: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

    /// Whether a direction from the origin meets the triangle, in f64.
    fn meets(corners: [Vec3; 3], w: Vec3) -> bool {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        let w = w.as_dvec3();
        let side = [a.cross(b).dot(w), b.cross(c).dot(w), c.cross(a).dot(w)];
        let outward = a.cross(b).dot(c).signum();
        side.iter().all(|s| s * outward >= 0.0)
    }

    #[test]
    fn solid_angles_of_known_triangles_are_exact() {
        let octant = SphericalTriangle::new(Vec3::ZERO, OCTANT).unwrap();
        assert!((octant.solid_angle - PI / 2.0).abs() < 1e-14);
        // A face of a regular tetrahedron around its centre: a quarter of the sphere.
        let face = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0]].map(Vec3::from);
        let face = SphericalTriangle::new(Vec3::ZERO, face).unwrap();
        assert!((face.solid_angle - PI).abs() < 1e-14);
        // A right triangle of legs 1 mm, 1 km away: area over squared distance, to (size/distance)².
        let far = [[0.0, 0.0], [0.001, 0.0], [0.0, 0.001]].map(|[x, y]| Vec3::new(x, y, 1000.0));
        let far = SphericalTriangle::new(Vec3::ZERO, far).unwrap();
        let leg = f64::from(0.001_f32);
        assert!((far.solid_angle / (0.5 * leg * leg * 1e-6) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_triangle_seen_edge_on_or_without_area_is_refused() {
        assert!(
            SphericalTriangle::new(Vec3::splat(1.0 / 3.0), [Vec3::X, Vec3::X, Vec3::Z]).is_none()
        );
        assert!(SphericalTriangle::new(Vec3::ZERO, [Vec3::X, Vec3::Y, -Vec3::X]).is_none());
        assert!(SphericalTriangle::new(Vec3::X, OCTANT).is_none());
    }

    fn check_conformance(seed: u64, corners: [Vec3; 3]) {
        let triangle = SphericalTriangle::new(Vec3::ZERO, corners).unwrap();
        let v = triangle.v.map(|v| v.as_vec3());
        let axis = (v[0] + v[1] + v[2]).normalize();
        let cos_min = v.iter().map(|w| w.dot(axis)).fold(1.0, f32::min);
        let pdf = 1.0 / triangle.solid_angle();
        assert_conforms(
            &Directions::cap(axis, cos_min),
            seed,
            |u| Some((triangle.sample(u).direction, pdf)),
            |w| if meets(corners, w) { pdf } else { 0.0 },
        );
    }

    #[test]
    fn samples_are_even_over_large_thin_and_near_triangles() {
        check_conformance(21, OCTANT);
        check_conformance(22, [Vec3::X, Vec3::Y, Vec3::new(0.9, 0.1, 0.05)]);
        // A point 1 mm above a triangle of 1 m: nearly a hemisphere.
        check_conformance(
            23,
            [[-0.5, -0.5], [0.7, -0.4], [-0.1, 0.6]].map(|[x, y]| Vec3::new(x, y, 0.001)),
        );
        // 10 cm, 4 m away.
        check_conformance(
            24,
            [[0.0, 0.0], [0.1, 0.0], [0.03, 0.09]].map(|[x, y]| Vec3::new(x, y, 4.0)),
        );
    }

    proptest! {
        #[test]
        fn barycentric_weights_distance_and_direction_name_the_same_point(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0f32..1.0)),
            distance in 0.0f32..10.0, u in prop::array::uniform2(0.0f32..1.0)
        ) {
            let corners = corners.map(|c| Vec3::from(c) + Vec3::new(0.0, 0.0, 1.1 + distance));
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            prop_assume!(area > 1e-2);
            let triangle = SphericalTriangle::new(Vec3::ZERO, corners);
            prop_assume!(triangle.is_some_and(|t| t.solid_angle() > 1e-5));
            let s = triangle.unwrap().sample(u);
            let [b_0, b_1, b_2] = s.barycentric;
            let hit = corners[0] * b_0 + corners[1] * b_1 + corners[2] * b_2;
            prop_assert!(s.barycentric.iter().all(|b| (0.0..=1.0).contains(b)));
            // A few roundings of distances up to 15.
            prop_assert!((s.direction * s.distance - hit).length() < 1e-5, "{s:?} {hit}");
        }
    }
}
