//! How optical depth changes when the ends of its segment move.
//!
//! Moving an end shears the segment: it meets denser or thinner medium (∇ρ), its own end gains or loses length, and the
//! points where it enters and leaves regions slide along it. All three are exact here.

use crate::Medium;
use crate::line::Line;
use crate::segment::depth;
use glam::{DVec3, Vec3};

/// Optical depth between two points and its gradients with respect to each, one per colour channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EndGradients {
    /// Optical depth, per channel.
    pub tau: Vec3,
    /// Gradient with respect to moving the first point, per metre, for each channel.
    pub d_a: [Vec3; 3],
    /// Gradient with respect to moving the second point, per metre, for each channel.
    pub d_b: [Vec3; 3],
}

/// The smallest cosine between ray and boundary normal by which the sideways motion of a crossing is divided.
///
/// A ray that grazes a boundary leaves it arbitrarily far away when tilted; the true gradient grows like 1/cosine (at a
/// ball) or jumps (at a box). Clamped, a gradient stays under 10³ times the extinction there.
pub(crate) const GRAZING: f64 = 1e-3;

/// Columns above this have no gradient, in metres: ten thousand light years of fog let no light through, and their
/// gradient might not fit into an f32.
pub(crate) const OPAQUE: f64 = 1e20;

/// One medium's column along a segment, and what its derivatives are made of.
///
/// With n the direction and r the length, ∂τ/∂b = n ρ(b) + shear₁/r and ∂τ/∂a = −n ρ(a) + shear₀ − shear₁/r, where the
/// j-th shear is `∫ tʲ ∇ρ dt` plus the crossings' motion, both perpendicular to n. Along n only the ends count: moving b
/// along the ray adds ρ(b), whatever lies between, so that n·∂τ/∂b = σt(b) holds exactly, grazing or not.
#[derive(Clone, Copy, Debug)]
struct ColumnGradient {
    column: f64,
    /// n ρ at the first end, 0 where the medium does not reach it.
    start: DVec3,
    /// n ρ at the second end, 0 where the medium does not reach it.
    end: DVec3,
    shear: [DVec3; 2],
}

impl ColumnGradient {
    /// A medium that the segment does not meet, or whose column on it is infinite or nearly so: no light comes through
    /// that, nor does any when it is moved.
    fn flat(column: f64) -> Self {
        Self {
            column,
            start: DVec3::ZERO,
            end: DVec3::ZERO,
            shear: [DVec3::ZERO; 2],
        }
    }

    /// The column of `medium` along `line` from 0 to `length`, which may be infinite.
    fn new(medium: &Medium, line: &Line, length: f64) -> Self {
        let Some((t0, t1)) = medium.clip(line, length) else {
            return Self::flat(0.0);
        };
        let profile = medium.density().along(line);
        let column = profile.column(t0, t1);
        if column > OPAQUE {
            return Self::flat(column);
        }
        let n = line.direction.normalize();
        let across = |v: DVec3| v - n * n.dot(v);
        // Per metre of sideways motion at the crossing it slides by −N⊥/(N·n) along the ray; N is the outward normal.
        let slide = |t: f64| {
            let (normal, _) = medium.boundary(line.at(t));
            let cosine = normal.dot(n);
            across(normal) * (-profile.value(t) / cosine.abs().max(GRAZING).copysign(cosine))
        };
        let mut result = Self {
            shear: profile.gradient_moments(t0, t1).map(across),
            ..Self::flat(column)
        };
        if t0 > 0.0 {
            let motion = slide(t0);
            result.shear[0] -= motion;
            result.shear[1] -= motion * t0;
        } else {
            result.start = n * profile.value(t0);
        }
        if t1 < length {
            let motion = slide(t1);
            result.shear[0] += motion;
            result.shear[1] += motion * t1;
        } else {
            result.end = n * profile.value(t1);
        }
        result
    }

    /// Gradient with respect to the first end of a segment of finite `length`.
    fn d_a(&self, length: f64) -> DVec3 {
        self.shear[0] - self.shear[1] / length - self.start
    }

    /// Gradient with respect to the second end of a segment of finite `length`.
    fn d_b(&self, length: f64) -> DVec3 {
        self.shear[1] / length + self.end
    }

    /// Gradient when both ends move together.
    fn rigid(&self) -> DVec3 {
        self.shear[0] + self.end - self.start
    }
}

/// [`Media::optical_depth_gradient`](crate::Media::optical_depth_gradient) of a list of media.
pub(crate) fn of_ends(media: &[Medium], a: DVec3, b: DVec3) -> EndGradients {
    let mut sum = EndGradients::default();
    let Some((line, length)) = Line::between(a, b) else {
        return sum;
    };
    for medium in media {
        let c = ColumnGradient::new(medium, &line, length);
        sum.tau += depth(medium.sigma_t(), c.column);
        add(&mut sum.d_a, medium, c.d_a(length));
        add(&mut sum.d_b, medium, c.d_b(length));
    }
    sum
}

/// [`Media::optical_depth_gradient_rigid`](crate::Media::optical_depth_gradient_rigid) of a list of media.
pub(crate) fn of_translation(media: &[Medium], line: &Line, length: f64) -> (Vec3, [Vec3; 3]) {
    let mut tau = Vec3::ZERO;
    let mut gradient = [Vec3::ZERO; 3];
    for medium in media {
        let c = ColumnGradient::new(medium, line, length);
        tau += depth(medium.sigma_t(), c.column);
        add(&mut gradient, medium, c.rigid());
    }
    (tau, gradient)
}

fn add(gradient: &mut [Vec3; 3], medium: &Medium, of_column: DVec3) {
    for (channel, sum) in gradient.iter_mut().enumerate() {
        *sum += medium.sigma_t()[channel] * of_column.as_vec3();
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::{Density, MediumParams, Region};
    use proptest::prelude::*;

    fn medium(region: Region, density: Density) -> Medium {
        Medium::new(MediumParams {
            region,
            density,
            ..MediumParams::new(Vec3::ONE, Vec3::ONE)
        })
        .unwrap()
    }

    fn any_medium() -> impl Strategy<Value = Medium> {
        let region = prop_oneof![
            Just(Region::Everywhere),
            Just(Region::Box {
                min: Vec3::new(-1.0, -0.5, -0.8),
                max: Vec3::new(0.7, 1.0, 1.1)
            }),
            Just(Region::Sphere {
                center: Vec3::new(0.1, 0.2, -0.3),
                radius: 1.1
            }),
        ];
        let density = prop_oneof![
            Just(Density::Constant(0.7)),
            (-1.0f32..1.0, -1.0f32..1.5).prop_map(|(base, log_scale)| Density::Height {
                base,
                scale_height: 10f32.powf(log_scale)
            }),
        ];
        (region, density).prop_map(|(region, density)| medium(region, density))
    }

    fn any_point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-2.0f64..2.0).prop_map(DVec3::from)
    }

    /// Central differences of `f` in three directions; `None` where two step lengths disagree, across a kink.
    fn differences(f: impl Fn(DVec3) -> f64) -> Option<DVec3> {
        let [coarse, fine] = [2e-5, 1e-5].map(|h| {
            DVec3::from_array(DVec3::AXES.map(|axis| (f(h * axis) - f(-h * axis)) / (2.0 * h)))
        });
        // Both err by less than 1e-8 where the function is smooth on the scale of a centimetre.
        (coarse - fine)
            .abs()
            .max_element()
            .lt(&1e-7)
            .then_some(fine)
    }

    fn column(medium: &Medium, a: DVec3, b: DVec3) -> f64 {
        let (line, length) = Line::between(a, b).unwrap();
        ColumnGradient::new(medium, &line, length).column
    }

    proptest! {
        #[test]
        fn gradients_of_both_ends_are_central_differences(medium in any_medium(), a in any_point(), b in any_point()) {
            prop_assume!(a.distance(b) > 0.05);
            let (line, length) = Line::between(a, b).unwrap();
            let exact = ColumnGradient::new(&medium, &line, length);
            let d_a = differences(|h| column(&medium, a + h, b));
            let d_b = differences(|h| column(&medium, a, b + h));
            prop_assume!(d_a.is_some() && d_b.is_some());
            prop_assert!((exact.d_a(length) - d_a.unwrap()).length() < 1e-7, "{exact:?} {d_a:?}");
            prop_assert!((exact.d_b(length) - d_b.unwrap()).length() < 1e-7, "{exact:?} {d_b:?}");
        }

        #[test]
        fn the_gradient_of_a_translation_is_a_central_difference(
            medium in any_medium(), origin in any_point(), target in any_point(), endless in prop::bool::ANY
        ) {
            prop_assume!(origin.distance(target) > 0.05);
            let (line, mut length) = Line::between(origin, target).unwrap();
            if endless {
                length = f64::INFINITY;
            }
            let moved = |h: DVec3| ColumnGradient::new(&medium, &Line { origin: origin + h, ..line }, length);
            let exact = moved(DVec3::ZERO);
            if exact.column.is_infinite() {
                prop_assert_eq!(exact.rigid(), DVec3::ZERO);
                return Ok(());
            }
            let difference = differences(|h| moved(h).column);
            prop_assume!(difference.is_some());
            prop_assert!((exact.rigid() - difference.unwrap()).length() < 1e-7, "{exact:?} {difference:?}");
        }
    }

    #[test]
    fn grazing_rays_have_finite_gradients_that_still_add_the_extinction_at_their_end() {
        let ball = Region::Sphere {
            center: Vec3::ZERO,
            radius: 1.0,
        };
        let cube = Region::Box {
            min: -Vec3::ONE,
            max: Vec3::ONE,
        };
        for (region, inside) in [
            (ball, DVec3::new(0.0, 0.0, 1.0)),
            (cube, DVec3::new(0.0, 0.0, 1.0)),
        ] {
            let medium = medium(region, Density::Constant(1.0));
            for depth in [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4] {
                // From a point `depth` under the surface, almost along it, to far outside.
                let a = inside - depth * DVec3::Z;
                for b in [
                    DVec3::new(9.0, 0.0, 1.0),
                    DVec3::new(9.0, 0.0, 1.0 + 1e-7),
                    DVec3::new(0.0, 9.0, 1.1),
                ] {
                    let (line, length) = Line::between(a, b).unwrap();
                    let c = ColumnGradient::new(&medium, &line, length);
                    for gradient in [c.d_a(length), c.d_b(length), c.rigid()] {
                        assert!(
                            gradient.is_finite() && gradient.length() <= 2.0 / GRAZING,
                            "{region:?} {depth} {b}: {gradient}"
                        );
                    }
                    assert!(c.d_b(length).dot(line.direction).abs() < 1e-9);
                    assert!((c.d_a(length).dot(line.direction) + c.start.length()).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn coinciding_points_have_no_depth_and_no_gradient() {
        let media = [medium(Region::Everywhere, Density::Constant(1.0))];
        assert_eq!(
            of_ends(&media, DVec3::ONE, DVec3::ONE),
            EndGradients::default()
        );
    }
}
