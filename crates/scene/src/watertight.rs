//! Where a ray meets a triangle, so that no ray slips through an edge that two triangles share.
//!
//! The test is double-sided and gives barycentric coordinates. Boxes around triangles are somebody else's concern.

use glam::{DVec3, Vec3, Vec3A};
use tyndall_math::Ray;

/// A ray prepared for many triangles: its axes permuted and sheared so that it points along z.
///
/// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", section 3. Two triangles that share an edge
/// compute that edge's function from the same numbers in the same order, up to the sign, so a ray lies on one side of
/// it for one triangle and on the other for its neighbour. Edge functions that are zero in f32 are computed again in
/// f64, where the products of f32 differences are exact.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: Vec3A,
    /// Permutation and shear as the columns of a matrix. Its ones and zeros multiply and add without rounding, so it
    /// gives the very numbers of the paper's formula, without an index that is known only at run time.
    columns: [Vec3A; 3],
}

/// A point where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance along the ray.
    pub t: f32,
    /// Barycentric weights of the three corners; none is negative, their sum is 1.
    pub barycentric: Vec3,
}

impl ShearedRay {
    /// Prepares `ray`.
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let size = d.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            // Keeps the winding of triangles in the permuted axes.
            std::mem::swap(&mut x, &mut y);
        }
        let mut columns = [Vec3A::ZERO; 3];
        columns[x] = Vec3A::X;
        columns[y] = Vec3A::Y;
        columns[z] = Vec3A::new(-d[x] / d[z], -d[y] / d[z], 1.0 / d[z]);
        Self {
            origin: ray.origin.into(),
            columns,
        }
    }

    /// Where the ray meets the triangle of `corners` at a distance t with 0 < t < `t_max`, from either side.
    pub fn intersect(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        let [x, y, z] = self.columns;
        let [a, b, c] = corners.map(|corner| {
            let p = Vec3A::from(corner) - self.origin;
            x * p.x + y * p.y + z * p.z
        });
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            return intersect_at_an_edge([a, b, c], t_max);
        }
        if u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0 {
            return None;
        }
        let det = u + v + w;
        let t = (u * a.z + v * b.z + w * c.z) / det;
        // Written so that NaN misses.
        (t > 0.0 && t < t_max).then(|| TriangleHit {
            t,
            barycentric: Vec3::new(u, v, w) / det,
        })
    }
}

/// The same test in f64, for a triangle in the ray's sheared axes with an edge function that vanished in f32.
#[cold]
fn intersect_at_an_edge(corners: [Vec3A; 3], t_max: f32) -> Option<TriangleHit> {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    if u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0 {
        return None;
    }
    let det = u + v + w;
    if det == 0.0 {
        // The ray lies in the triangle's plane: it meets the neighbours, or nothing that has an area.
        return None;
    }
    let t = ((u * a.z + v * b.z + w * c.z) / det) as f32;
    (t > 0.0 && t < t_max).then(|| TriangleHit {
        t,
        barycentric: (DVec3::new(u, v, w) / det).as_vec3(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    fn intersect(origin: Vec3, direction: Vec3) -> Option<TriangleHit> {
        ShearedRay::new(&Ray::new(origin, direction)).intersect(&CORNERS, f32::INFINITY)
    }

    #[test]
    fn distance_and_weights_of_a_plain_hit_are_right_from_both_sides() {
        for (z, direction) in [(5.0, Vec3::NEG_Z), (-5.0, Vec3::Z)] {
            let hit = intersect(Vec3::new(0.25, 0.5, z), direction);
            let expected = TriangleHit {
                t: 5.0,
                barycentric: Vec3::new(0.25, 0.25, 0.5),
            };
            assert_eq!(hit, Some(expected));
        }
    }

    #[test]
    fn edges_and_corners_belong_to_the_triangle() {
        for p in [
            Vec3::ZERO,
            Vec3::X,
            Vec3::Y,
            Vec3::X * 0.5,
            Vec3::Y * 0.25,
            Vec3::new(0.5, 0.5, 0.0),
        ] {
            assert!(intersect(p + Vec3::Z, Vec3::NEG_Z).is_some(), "{p}");
        }
    }

    #[test]
    fn rays_that_point_away_or_start_on_the_triangle_or_lie_in_its_plane_miss() {
        assert_eq!(intersect(Vec3::new(0.2, 0.2, 1.0), Vec3::Z), None);
        assert_eq!(intersect(Vec3::new(0.2, 0.2, 0.0), Vec3::Z), None);
        assert_eq!(intersect(Vec3::new(-1.0, 0.2, 0.0), Vec3::X), None);
        assert_eq!(intersect(Vec3::new(-1.0, 0.0, 0.0), Vec3::X), None);
    }

    #[test]
    fn a_hit_lies_strictly_before_the_limit() {
        let ray = ShearedRay::new(&Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z));
        assert!(ray.intersect(&CORNERS, 1.0).is_none());
        assert!(ray.intersect(&CORNERS, 1.000_001).is_some());
        assert!(ray.intersect(&CORNERS, f32::NAN).is_none());
    }

    #[test]
    fn numbers_that_are_not_finite_never_hit() {
        for bad in [f32::NAN, f32::INFINITY] {
            assert_eq!(intersect(Vec3::new(bad, 0.2, 1.0), Vec3::NEG_Z), None);
            let corners = [Vec3::new(bad, 0.0, 0.0), Vec3::X, Vec3::Y];
            let ray = ShearedRay::new(&Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z));
            assert!(ray.intersect(&corners, f32::INFINITY).is_none());
        }
    }
}
