//! Even sampling of the solid angle of a rectangle.

use glam::{DVec3, Vec3};

/// A rectangle projected onto the unit sphere around a point.
///
/// In a frame along its edges, with the point at the origin, the rectangle is [x₀, x₁] × [y₀, y₁] at height z. The solid
/// angle F(x) between x = 0 and x, with rⱼ² = x² + yⱼ² + z² at the corners there, is
///
/// ```text
/// F(x) = atan(x y₁/(z r₁)) − atan(x y₀/(z r₀)) = asin(c b₁) − asin(c b₀)
/// c = x/√(x² + z²),  bⱼ = yⱼ/√(yⱼ² + z²)
/// ```
///
/// so Ω = F(x₁) − F(x₀), and F(x) = φ is solved by c = sin φ/√(b₀² + b₁² − 2 b₀ b₁ cos φ): c b₀ and c b₁ are sines of angles that
/// differ by φ. Within the strip at x, y/√(x² + y² + z²) is spread evenly.
///
/// Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles", whose map this is; they
/// write Ω and φ as sums of four angles less 2π, which leaves no digit of a small rectangle. Here differences of
/// nearly equal y are taken before the angles, and all is f64: errors are some 10⁻¹⁶ over the angle that an edge fills.
/// Squares of f32 lengths neither overflow nor vanish in f64, so roots are plain, not `hypot`.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    /// Unit vectors along the edges and from the point to the plane.
    axes: [DVec3; 3],
    x: [f64; 2],
    y: [f64; 2],
    z: f64,
    b: [f64; 2],
    /// b₁ − b₀.
    b_difference: f64,
    /// F at x₀ and x₁.
    f: [f64; 2],
}

/// A direction towards a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct RectangleSample {
    /// Unit direction from the point to the rectangle.
    pub direction: Vec3,
    /// Distance to the rectangle, in metres.
    pub distance: f32,
    /// Position along the two edges, each in [0, 1].
    pub uv: [f32; 2],
}

impl SphericalRectangle {
    /// The rectangle with `corner` and perpendicular `edges` (metres) as seen from `p`; `None` where `p` lies in its plane
    /// or the solid angle is too small for f32.
    ///
    /// What the second edge holds along the first is dropped: edges of a turned f32 lamp are perpendicular to 10⁻⁷.
    pub fn new(p: Vec3, corner: Vec3, edges: [Vec3; 2]) -> Option<Self> {
        let to_corner = corner.as_dvec3() - p.as_dvec3();
        let [e_x, e_y] = edges.map(|e| e.as_dvec3());
        let width = e_x.length();
        let axis_x = e_x / width;
        let e_y = e_y - axis_x * e_y.dot(axis_x);
        let height = e_y.length();
        let axis_y = e_y / height;
        let normal = axis_x.cross(axis_y);
        let z = to_corner.dot(normal);
        let x_0 = to_corner.dot(axis_x);
        let y_0 = to_corner.dot(axis_y);
        let (x, y) = ([x_0, x_0 + width], [y_0, y_0 + height]);
        let rectangle = Self {
            axes: [axis_x, axis_y, normal * z.signum()],
            x,
            y,
            z: z.abs(),
            b: y.map(|y| y / root(y, z)),
            b_difference: sine_difference(y, height, z.abs()),
            f: x.map(|x| strip(x, y, height, z.abs())),
        };
        let solid_angle = rectangle.f[1] - rectangle.f[0];
        (z != 0.0 && solid_angle > f64::from(f32::MIN_POSITIVE)).then_some(rectangle)
    }

    /// Solid angle in steradians, in (0, 2π); the density of [`SphericalRectangle::sample`] is one over it.
    pub fn solid_angle(&self) -> f32 {
        (self.f[1] - self.f[0]) as f32
    }

    /// A direction spread evenly over the solid angle.
    pub fn sample(&self, u: [f32; 2]) -> RectangleSample {
        let [u, v] = u.map(f64::from);
        let z = self.z;
        let phi = self.f[0] + u * (self.f[1] - self.f[0]);
        let half_sin = (0.5 * phi).sin();
        let c = phi.sin()
            / (self.b_difference * self.b_difference
                + 4.0 * self.b[0] * self.b[1] * half_sin * half_sin)
                .sqrt();
        let x = c * z / ((1.0 - c) * (1.0 + c)).max(0.0).sqrt();
        // `max` and `min` also turn the 0/0 of a rounded-off corner into a point of the rectangle.
        let x = x.max(self.x[0]).min(self.x[1]);

        let d = root(x, z);
        let h_0 = self.y[0] / root(self.y[0], d);
        let h = h_0 + v * sine_difference(self.y, self.y[1] - self.y[0], d);
        let y = h * d / ((1.0 - h) * (1.0 + h)).max(0.0).sqrt();
        let y = y.max(self.y[0]).min(self.y[1]);

        let [axis_x, axis_y, axis_z] = self.axes;
        let to_point = axis_x * x + axis_y * y + axis_z * z;
        let distance = to_point.length();
        let share = |x: f64, [x_0, x_1]: [f64; 2]| ((x - x_0) / (x_1 - x_0)) as f32;
        RectangleSample {
            direction: (to_point / distance).as_vec3(),
            distance: distance as f32,
            uv: [share(x, self.x), share(y, self.y)],
        }
    }
}

/// √(x² + y²).
fn root(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// y₁/√(y₁² + d²) − y₀/√(y₀² + d²), where `height` = y₁ − y₀: on one side of 0 as (y₁² − y₀²) d² over a sum.
fn sine_difference(y: [f64; 2], height: f64, d: f64) -> f64 {
    let [y_0, y_1] = y;
    let [r_0, r_1] = y.map(|y| root(y, d));
    if y_0 * y_1 > 0.0 {
        height * (y_0 + y_1) * d * d / (r_0 * r_1 * (y_1 * r_0 + y_0 * r_1))
    } else {
        y_1 / r_1 - y_0 / r_0
    }
}

/// F(x): the solid angle between x = 0 and x.
fn strip(x: f64, y: [f64; 2], height: f64, z: f64) -> f64 {
    let d = root(x, z);
    let [r_0, r_1] = y.map(|y| root(y, d));
    // tan of a difference; both tangents times z r.
    let opposite = x * z * sine_difference(y, height, d) * r_0 * r_1;
    let adjacent = z * z * r_0 * r_1 + x * x * y[0] * y[1];
    opposite.atan2(adjacent)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::testing::{Directions, assert_conforms};
    use std::f64::consts::PI;

    fn omega(p: Vec3, corner: [f32; 3], edges: [[f32; 3]; 2]) -> f64 {
        let r = SphericalRectangle::new(p, corner.into(), edges.map(Vec3::from)).unwrap();
        r.f[1] - r.f[0]
    }

    #[test]
    fn solid_angles_of_known_rectangles_are_exact() {
        // A face of a cube from its centre: 4π/6. From a corner, three faces share an octant.
        let face = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        assert!((omega(Vec3::ZERO, [-1.0, -1.0, 1.0], face) - 4.0 * PI / 6.0).abs() < 1e-14);
        assert!((omega(Vec3::ZERO, [0.0, 0.0, -2.0], face) - PI / 6.0).abs() < 1e-14);
        // |x| < 1, |y| < 0.5 at z = 2 from (0.3, 0.2, 0.1), by van Oosterom and Strackee 1983 in extended precision.
        let lamp = omega(
            Vec3::new(0.3, 0.2, 0.1),
            [-1.0, -0.5, 2.0],
            [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        );
        // The point is rounded to f32, and the gradient of Ω there is 0.4 per metre.
        assert!((lamp - 0.458_401_504_649).abs() < 1e-8);
        // 1 mm square, 1 km away and 1 km aside: cosθ/r² = 1000/(2·10⁶)^1.5 per m².
        let far = omega(
            Vec3::ZERO,
            [1000.0, 0.0, 1000.0],
            [[1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0]],
        );
        let side = f64::from(1e-3_f32);
        assert!((far / (side * side * 1000.0 / 2e6_f64.powf(1.5)) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_rectangle_seen_edge_on_or_without_area_is_refused() {
        let new = |p, edges| SphericalRectangle::new(p, Vec3::ZERO, edges);
        assert!(new(Vec3::splat(0.5).with_z(0.0), [Vec3::X, Vec3::Y]).is_none());
        assert!(new(Vec3::Z, [Vec3::X, Vec3::ZERO]).is_none());
        assert!(new(Vec3::Z, [Vec3::X, Vec3::X]).is_none());
    }

    fn check_conformance(seed: u64, corner: Vec3, edges: [Vec3; 2]) {
        let rectangle = SphericalRectangle::new(Vec3::ZERO, corner, edges).unwrap();
        let pdf = 1.0 / rectangle.solid_angle();
        let normal = edges[0].cross(edges[1]).as_dvec3();
        let meets = |w: Vec3| {
            let w = w.as_dvec3();
            let t = corner.as_dvec3().dot(normal) / w.dot(normal);
            let hit = w * t - corner.as_dvec3();
            t > 0.0
                && edges.iter().all(|e| {
                    let e = e.as_dvec3();
                    (0.0..=1.0).contains(&(hit.dot(e) / e.length_squared()))
                })
        };
        let corners = [
            corner,
            corner + edges[0],
            corner + edges[1],
            corner + edges[0] + edges[1],
        ];
        let axis = corners
            .iter()
            .map(|c| c.normalize())
            .sum::<Vec3>()
            .normalize();
        let cos_min = corners
            .iter()
            .map(|c| c.normalize().dot(axis))
            .fold(1.0, f32::min);
        assert_conforms(
            &Directions::cap(axis, cos_min),
            seed,
            |u| {
                let s = rectangle.sample(u);
                let hit = corner + edges[0] * s.uv[0] + edges[1] * s.uv[1];
                // A few roundings of the coordinates.
                let error = (s.direction * s.distance - hit).length();
                assert!(error < 2e-6 * hit.length().max(1.0), "{s:?} is not {hit}");
                Some((s.direction, pdf))
            },
            |w| if meets(w) { pdf } else { 0.0 },
        );
    }

    #[test]
    fn samples_are_even_over_centred_oblique_near_and_small_rectangles() {
        check_conformance(31, Vec3::new(-1.0, -0.5, 2.0), [Vec3::X * 2.0, Vec3::Y]);
        check_conformance(32, Vec3::new(0.5, 3.0, -0.4), [Vec3::X, Vec3::Y * 5.0]);
        // 1 mm from a lamp of a square metre.
        check_conformance(33, Vec3::new(-0.3, -0.6, 0.001), [Vec3::X, Vec3::Y]);
        // 10 cm, 4 m away, turned.
        let turned = [Vec3::new(0.06, 0.08, 0.0), Vec3::new(-0.08, 0.06, 0.0)];
        check_conformance(34, Vec3::new(1.0, 2.0, 4.0), turned);
    }

    #[test]
    fn samples_of_a_distant_rectangle_keep_all_digits_of_their_place() {
        // 10 cm at 10 km fills 10⁻¹⁰ sr: u and v then map linearly, up to the size over the distance.
        let edges = [Vec3::X * 0.1, Vec3::Y * 0.1];
        let corner = Vec3::new(3000.0, -2000.0, 10_000.0);
        let r = SphericalRectangle::new(Vec3::ZERO, corner, edges).unwrap();
        for u in [[0.0, 0.0], [0.25, 0.5], [0.9, 0.1]] {
            let s = r.sample(u);
            assert!(
                (s.uv[0] - u[0]).abs() < 1e-4 && (s.uv[1] - u[1]).abs() < 1e-4,
                "{s:?}"
            );
        }
    }
}
