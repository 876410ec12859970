//! How optical depth and its gradient change when an end of its segment moves: second derivatives, exact.
//!
//! A moving point tilts or shifts the line, and slides its ends and its crossings of boundaries along it. With these
//! motions as jets, the column is expanded to second order in them.

use crate::Medium;
use crate::density::Profile;
use crate::gradient::{GRAZING, OPAQUE};
use crate::line::Line;
use glam::{DMat3, DVec3};
use tyndall_math::{Jet, JetVec3};

/// A stretch of a line that moves with a point, to second order in the motion of that point.
#[derive(Clone, Copy, Debug)]
struct MovingLine {
    /// The line where the point is at rest.
    line: Line,
    /// How far the line's origin has moved.
    origin: JetVec3,
    /// How far the line's direction has turned.
    direction: JetVec3,
    /// The distance at which the stretch begins, 0 at rest.
    start: Jet,
    /// The distance at which the stretch ends; may be infinite.
    end: Jet,
}

impl MovingLine {
    /// From a fixed point to one that moves; `None` where they coincide.
    fn between(fixed: DVec3, moving: DVec3) -> Option<Self> {
        // Nearer than an f32 can tell from 0, the inverse powers of the distance might overflow.
        if fixed.distance(moving) < f64::from(f32::MIN_POSITIVE) {
            return None;
        }
        let way = Jet::point(moving) - fixed;
        let length = way.length();
        let direction = way / length;
        let at_rest = direction.value();
        Some(Self {
            line: Line {
                origin: fixed,
                direction: at_rest,
            },
            origin: DVec3::ZERO.into(),
            direction: direction - at_rest,
            start: Jet::ZERO,
            end: length,
        })
    }

    /// From a point that moves, in a direction that stays.
    ///
    /// Of the motion only the part across the line moves the line; the part along it slides both ends, so that along the
    /// line only the ends count, exactly and grazing or not.
    fn translated(line: Line, length: f64) -> Self {
        let motion = Jet::point(DVec3::ZERO);
        let d = line.direction;
        let along = motion.dot_fixed(d / d.length_squared());
        Self {
            line,
            origin: motion - along * d,
            direction: DVec3::ZERO.into(),
            start: along,
            end: along + length,
        }
    }

    /// How far the line has moved at distance `t`.
    fn displacement(&self, t: f64) -> JetVec3 {
        self.origin + self.direction * t
    }

    /// The column of `medium` along the stretch.
    ///
    /// With the line moved by u + t v, C = ∫ ρ dt + ∫ ∇ρ · (u + t v) dt + ½ ∫ (u + t v)ᵀ Hρ (u + t v) dt, between ends that
    /// slide.
    fn column(&self, medium: &Medium) -> Jet {
        let Some((t0, t1)) = medium.clip(&self.line, self.end.value) else {
            return Jet::ZERO;
        };
        let profile = medium.density().along(&self.line);
        let column = profile.column(t0, t1);
        if column > OPAQUE {
            return column.into();
        }
        let start = if t0 > 0.0 {
            self.crossing(medium, t0)
        } else {
            self.start
        };
        let end = if t1 < self.end.value {
            self.crossing(medium, t1)
        } else {
            self.end
        };
        self.varied(&profile, t0, t1) + column + self.gained(&profile, end)
            - self.gained(&profile, start)
    }

    /// What the column gains between ends that stay, because the line moves to where the density is another.
    fn varied(&self, profile: &Profile<'_>, t0: f64, t1: f64) -> Jet {
        let (u, v) = (self.origin, self.direction);
        if let Profile::Constant(_) = profile {
            return Jet::ZERO;
        }
        let [g0, g1] = profile.gradient_moments(t0, t1);
        let [h0, h1, h2] = profile.hessian_moments(t0, t1);
        u.dot_fixed(g0)
            + v.dot_fixed(g1)
            + (product(u, h0, u) + product(v, h2, v)) * 0.5
            + product(u, h1, v)
    }

    /// What the column gains where its end at rest slides on to `end`, δ farther: δ (ρ + ∇ρ · (u + t v + ½ δ d)), the
    /// density half way.
    fn gained(&self, profile: &Profile<'_>, end: Jet) -> Jet {
        let t = end.value;
        if t.is_infinite() {
            // A finite column has no density left there.
            return Jet::ZERO;
        }
        let slide = end - t;
        let half_way = self.displacement(t) + slide * (0.5 * self.line.direction);
        slide * (half_way.dot_fixed(profile.gradient(t)) + profile.value(t))
    }

    /// The distance near `t` at which the moved line crosses the boundary of `medium`.
    ///
    /// A point that has moved by m from the boundary lies on it where N · m + ½ κ m · m = 0, N being the outward normal
    /// and κ the curvature. With m = u + t v + δ d this is solved for δ by Newton's method from δ = 0, whose two steps
    /// give the first and the second derivatives, with N · d kept above [`GRAZING`] in both.
    fn crossing(&self, medium: &Medium, t: f64) -> Jet {
        let d = self.line.direction;
        let (normal, curvature) = medium.boundary(self.line.at(t));
        let cosine = normal.dot(d);
        let cosine = cosine.abs().max(GRAZING).copysign(cosine);
        let moved = self.displacement(t);
        let slide = moved.dot_fixed(normal) * (-1.0 / cosine);
        let moved = moved + slide * d;
        let excess =
            slide * self.direction.dot_fixed(normal) + moved.dot(moved) * (0.5 * curvature);
        slide - excess * (1.0 / cosine) + t
    }
}

/// aᵀ M b, for a symmetric matrix that stays.
fn product(a: JetVec3, m: DMat3, b: JetVec3) -> Jet {
    a.x * b.dot_fixed(m.x_axis) + a.y * b.dot_fixed(m.y_axis) + a.z * b.dot_fixed(m.z_axis)
}

/// [`Media::optical_depth_jet`](crate::Media::optical_depth_jet) of a list of media.
pub(crate) fn of_end(media: &[Medium], fixed: DVec3, moving: DVec3) -> [Jet; 3] {
    MovingLine::between(fixed, moving).map_or([Jet::ZERO; 3], |line| optical_depth(media, &line))
}

/// [`Media::optical_depth_jet_rigid`](crate::Media::optical_depth_jet_rigid) of a list of media.
pub(crate) fn of_translation(media: &[Medium], line: Line, length: f64) -> [Jet; 3] {
    optical_depth(media, &MovingLine::translated(line, length))
}

fn optical_depth(media: &[Medium], line: &MovingLine) -> [Jet; 3] {
    let mut tau = [Jet::ZERO; 3];
    for medium in media.iter().filter(|m| !m.is_vacuum()) {
        let column = line.column(medium);
        for (tau, sigma_t) in tau.iter_mut().zip(medium.sigma_t().to_array()) {
            // Never 0 · ∞.
            if sigma_t > 0.0 {
                *tau += column * f64::from(sigma_t);
            }
        }
    }
    tau
}
