//! Where a medium is: everywhere, in a box, or in a ball.
//!
//! Regions are closed sets; rays are clipped in f64, so that camera, lamp or record may sit anywhere, on the boundary too.

use crate::line::Line;
use glam::{DVec3, Vec3};
use tyndall_math::{Aabb, Ray};

/// The part of space that a medium fills.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Region {
    /// All of space.
    #[default]
    Everywhere,
    /// An axis-aligned box.
    Box {
        /// Smallest coordinates, metres.
        min: Vec3,
        /// Largest coordinates, metres; above `min` in each.
        max: Vec3,
    },
    /// A ball.
    Sphere {
        /// Centre, metres.
        center: Vec3,
        /// Radius, metres; positive.
        radius: f32,
    },
}

impl Region {
    /// Whether `p` lies inside or on the boundary.
    pub fn contains(&self, p: Vec3) -> bool {
        match *self {
            Self::Everywhere => true,
            Self::Box { min, max } => Aabb { min, max }.contains(p),
            Self::Sphere { center, radius } => p.distance_squared(center) <= radius * radius,
        }
    }

    /// The distances at which `ray` enters and leaves the region, cut to [0, `t_max`]; `None` where no length is left.
    ///
    /// `t_max` may be infinite. A ray that runs inside a face of a box counts as inside, one that touches an edge or a
    /// ball does not.
    pub fn clip(&self, ray: &Ray, t_max: f32) -> Option<(f32, f32)> {
        self.clip_line(&ray.into(), t_max.into())
            .map(|(t0, t1)| (t0 as f32, t1 as f32))
    }

    /// Distance in metres from `p` to the nearest boundary point, from inside or outside; infinite for [`Region::Everywhere`].
    pub fn distance_to_boundary(&self, p: Vec3) -> f32 {
        match *self {
            Self::Everywhere => f32::INFINITY,
            Self::Box { min, max } => {
                // Negative inside, per axis; the largest is the nearest face.
                let beyond = (min - p).max(p - max);
                let outside = beyond.max(Vec3::ZERO).length();
                if outside > 0.0 {
                    outside
                } else {
                    -beyond.max_element()
                }
            }
            Self::Sphere { center, radius } => (p.distance(center) - radius).abs(),
        }
    }

    /// The smallest box around the region; `None` where it has no bounds.
    pub fn bounds(&self) -> Option<Aabb> {
        match *self {
            Self::Everywhere => None,
            Self::Box { min, max } => Some(Aabb { min, max }),
            Self::Sphere { center, radius } => Some(Aabb {
                min: center - radius,
                max: center + radius,
            }),
        }
    }

    /// [`Region::clip`] in f64.
    #[inline]
    pub(crate) fn clip_line(&self, line: &Line, t_max: f64) -> Option<(f64, f64)> {
        let (enter, leave) = match *self {
            Self::Everywhere => (0.0, t_max),
            Self::Box { min, max } => clip_box(line, min.as_dvec3(), max.as_dvec3())?,
            Self::Sphere { center, radius } => clip_sphere(line, center.as_dvec3(), radius.into())?,
        };
        let (t0, t1) = (enter.max(0.0), leave.min(t_max));
        (t0 < t1).then_some((t0, t1))
    }

    /// The outward unit normal at a point `p` of the boundary; zero for [`Region::Everywhere`].
    pub(crate) fn normal(&self, p: DVec3) -> DVec3 {
        match *self {
            Self::Everywhere => DVec3::ZERO,
            Self::Box { min, max } => {
                let below = p - min.as_dvec3();
                let above = p - max.as_dvec3();
                let to_face = below.abs().min(above.abs());
                let axis = to_face.min_position();
                let side = if below[axis].abs() < above[axis].abs() {
                    -1.0
                } else {
                    1.0
                };
                side * DVec3::AXES[axis]
            }
            Self::Sphere { center, .. } => (p - center.as_dvec3()).normalize_or_zero(),
        }
    }

    /// How fast the outward normal turns along the boundary, in radians per metre: 1/radius, 0 where it is flat.
    pub(crate) fn curvature(&self) -> f64 {
        match *self {
            Self::Everywhere | Self::Box { .. } => 0.0,
            Self::Sphere { radius, .. } => 1.0 / f64::from(radius),
        }
    }
}

/// Kay and Kajiya 1986 (slabs), with directions parallel to a slab decided by the origin instead of by 0/0.
#[inline]
pub(crate) fn clip_box(line: &Line, min: DVec3, max: DVec3) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (o, d) = (line.origin[axis], line.direction[axis]);
        if d == 0.0 {
            if o < min[axis] || o > max[axis] {
                return None;
            }
            continue;
        }
        // f64 has room for the reciprocal of every f32 but 0, denormal ones too.
        let per_metre = 1.0 / d;
        let (a, b) = ((min[axis] - o) * per_metre, (max[axis] - o) * per_metre);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    Some((enter, leave))
}

/// From the foot of the perpendicular, which does not cancel as the textbook's discriminant does.
#[inline]
fn clip_sphere(line: &Line, center: DVec3, radius: f64) -> Option<(f64, f64)> {
    // The f32 direction is of unit length to rounding only.
    let length_squared = line.direction.length_squared();
    let middle = (center - line.origin).dot(line.direction) / length_squared;
    let offset = (line.at(middle) - center).length_squared();
    let half = ((radius * radius - offset) / length_squared).sqrt();
    // NaN, no chord, fails the comparison.
    (half > 0.0).then_some((middle - half, middle + half))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const INF: f32 = f32::INFINITY;
    const CUBE: Region = Region::Box {
        min: Vec3::ZERO,
        max: Vec3::ONE,
    };
    const BALL: Region = Region::Sphere {
        center: Vec3::ONE,
        radius: 2.0,
    };

    #[test]
    fn rays_are_clipped_from_outside_inside_faces_edges_and_along_axes() {
        let rows = [
            // (region, origin, direction, t_max, clipped)
            (
                Region::Everywhere,
                [9.0, 9.0, 9.0],
                Vec3::X,
                INF,
                Some((0.0, INF)),
            ),
            (
                Region::Everywhere,
                [9.0, 9.0, 9.0],
                Vec3::X,
                2.0,
                Some((0.0, 2.0)),
            ),
            (CUBE, [-1.0, 0.5, 0.5], Vec3::X, INF, Some((1.0, 2.0))),
            (CUBE, [-1.0, 0.5, 0.5], Vec3::X, 1.25, Some((1.0, 1.25))),
            (CUBE, [-1.0, 0.5, 0.5], Vec3::X, 1.0, None),
            (CUBE, [-1.0, 0.5, 0.5], Vec3::NEG_X, INF, None),
            (CUBE, [0.25, 0.5, 0.5], Vec3::X, INF, Some((0.0, 0.75))),
            // Origin on a face: inwards, outwards, along the face; along an edge; beside the box.
            (CUBE, [0.0, 0.5, 0.5], Vec3::X, INF, Some((0.0, 1.0))),
            (CUBE, [0.0, 0.5, 0.5], Vec3::NEG_X, INF, None),
            (CUBE, [0.0, 0.5, 0.5], Vec3::Y, INF, Some((0.0, 0.5))),
            (CUBE, [0.0, -1.0, 0.0], Vec3::Y, INF, Some((1.0, 2.0))),
            (CUBE, [0.5, 1.5, 0.5], Vec3::X, INF, None),
            (
                CUBE,
                [0.5, -0.0, 0.5],
                Vec3::new(1.0, -0.0, 0.0),
                INF,
                Some((0.0, 0.5)),
            ),
            // Through a corner only.
            (CUBE, [-1.0, 1.0, 0.5], Vec3::new(0.6, 0.8, 0.0), INF, None),
            (BALL, [1.0, 1.0, -4.0], Vec3::Z, INF, Some((3.0, 7.0))),
            (BALL, [1.0, 1.0, 1.0], Vec3::Z, INF, Some((0.0, 2.0))),
            (BALL, [1.0, 1.0, 1.0], Vec3::Z, 1.5, Some((0.0, 1.5))),
            // On the ball: inwards, outwards, touching; past it.
            (BALL, [3.0, 1.0, 1.0], Vec3::NEG_X, INF, Some((0.0, 4.0))),
            (BALL, [3.0, 1.0, 1.0], Vec3::X, INF, None),
            (BALL, [3.0, 1.0, 1.0], Vec3::Y, INF, None),
            (BALL, [3.0, -9.0, 1.0], Vec3::Y, INF, None),
            (BALL, [1.0, 1.0, 9.0], Vec3::Z, INF, None),
        ];
        for (region, origin, direction, t_max, expected) in rows {
            let ray = Ray::new(origin.into(), direction);
            assert_eq!(
                region.clip(&ray, t_max),
                expected,
                "{region:?} {ray:?} {t_max}"
            );
        }
    }

    #[test]
    fn a_small_ball_far_away_is_clipped_to_f32_rounding() {
        let ball = Region::Sphere {
            center: Vec3::new(0.0, 0.0, 50_000.0),
            radius: 0.25,
        };
        let ray = Ray::new(Vec3::new(0.15, 0.0, 0.0), Vec3::Z);
        let (t0, t1) = ball
            .clip_line(&(&ray).into(), f64::INFINITY)
            .unwrap_or_default();
        // Chord 2√(0.25² − 0.15²) = 0.4; the radicand in f32 alone would be off by 100 %.
        assert!((t1 - t0 - 0.4).abs() < 1e-7, "{t0} {t1}");
    }

    #[test]
    fn distances_to_the_boundary_are_measured_from_both_sides() {
        let rows = [
            (CUBE, [0.5, 0.6, 0.5], 0.4),
            (CUBE, [0.5, 3.0, 0.5], 2.0),
            (CUBE, [-3.0, 5.0, 0.5], 5.0),
            (CUBE, [0.0, 0.5, 0.5], 0.0),
            (BALL, [1.0, 1.0, 1.5], 1.5),
            (BALL, [1.0, 1.0, 6.0], 3.0),
            (Region::Everywhere, [0.0, 0.0, 0.0], INF),
        ];
        for (region, p, expected) in rows {
            let found = region.distance_to_boundary(p.into());
            assert!(
                found == expected || (found - expected).abs() < 1e-6,
                "{region:?} {p:?}: {found}"
            );
        }
    }

    #[test]
    fn bounds_enclose_the_region() {
        assert_eq!(Region::Everywhere.bounds(), None);
        assert_eq!(
            CUBE.bounds(),
            Some(Aabb {
                min: Vec3::ZERO,
                max: Vec3::ONE
            })
        );
        assert_eq!(
            BALL.bounds(),
            Some(Aabb {
                min: Vec3::splat(-1.0),
                max: Vec3::splat(3.0)
            })
        );
    }

    fn point(range: std::ops::Range<f32>) -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(range).prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn a_ray_is_inside_between_the_clip_ends_and_outside_elsewhere(
            ball in prop::bool::ANY, origin in point(-4.0..4.0), target in point(-1.0..2.0), t in 0.0f32..12.0
        ) {
            prop_assume!(origin.distance(target) > 1e-3);
            let region = if ball { BALL } else { CUBE };
            let ray = Ray::new(origin, (target - origin).normalize());
            let inside = region.clip(&ray, INF).is_some_and(|(t0, t1)| (t0..=t1).contains(&t));
            // Near the boundary f32 coordinates decide; a tenth of a millimetre is far above their rounding.
            prop_assume!(region.distance_to_boundary(ray.at(t)) > 1e-4);
            prop_assert_eq!(inside, region.contains(ray.at(t)));
        }

        #[test]
        fn normals_point_out_of_the_region(ball in prop::bool::ANY, target in point(0.05..0.95), toward in point(-1.0..1.0)) {
            prop_assume!(toward.length() > 0.1);
            let region = if ball { BALL } else { CUBE };
            let line = Line::from(&Ray::new(target, toward.normalize()));
            let (_, t1) = region.clip_line(&line, 100.0).ok_or(TestCaseError::fail("the origin lies inside"))?;
            let (p, normal) = (line.at(t1), region.normal(line.at(t1)));
            prop_assert!((normal.length() - 1.0).abs() < 1e-12);
            prop_assert!(normal.dot(line.direction) > 0.0);
            prop_assert!(!region.contains((p + 1e-3 * normal).as_vec3()));
            prop_assert!(region.contains((p - 1e-3 * normal).as_vec3()));
        }
    }
}
