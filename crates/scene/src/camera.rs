//! Where a scene is seen from: a pinhole with square pixels.
//!
//! Row 0 of an image is its top, x grows to the right, and pixel centres lie at +0.5. Built in f64, because differences of
//! positions far from the origin lose digits; rays are f32.

use glam::{Affine3A, DVec3, Vec3};
use serde::{Deserialize, Serialize};
use tyndall_math::{Aabb, Ray};

/// Vertical field of view when a view frames the scene by itself, in radians (40°).
const FRAMING_YFOV: f32 = 0.698_131_7;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Camera {
    eye: Vec3,
    forward: Vec3,
    /// Unit vector to the right of the image, times half the image's height at distance 1.
    right: Vec3,
    /// Unit vector to the top of the image, times half the image's height at distance 1.
    up: Vec3,
}

/// Values that make no camera.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// There is no direction of view.
    #[error("eye and target are the same point {eye}; they must differ")]
    NoDirection {
        /// The point.
        eye: Vec3,
    },
    /// Nothing says which way is up.
    #[error(
        "up {up} is parallel to the view from eye to target; choose an up across it, for example {better}"
    )]
    UpAlongView {
        /// The direction asked for.
        up: Vec3,
        /// An axis that would do.
        better: Vec3,
    },
    /// The field of view is empty or half the world.
    #[error("a vertical field of view of {degrees} degrees cannot be; it lies in (0, 180)")]
    FieldOfView {
        /// The angle asked for.
        degrees: f32,
    },
    /// A transform flattens the camera, is not finite or reaches beyond all bounds.
    #[error(
        "the camera's node transform is not finite, flattens an axis or leads further than 1e12 m from the origin; it must be \
         invertible"
    )]
    Transform,
}

impl Camera {
    /// A camera at `eye` that looks towards `target`, with `up` towards the top of the image and a vertical field of view of
    /// `yfov` radians.
    ///
    /// # Errors
    /// If `eye` and `target` coincide, if `up` is parallel to the view, or if `yfov` is not in (0, π).
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, yfov: f32) -> Result<Self, CameraError> {
        let forward = (target.as_dvec3() - eye.as_dvec3())
            .try_normalize()
            .ok_or(CameraError::NoDirection { eye })?;
        Self::with_axes(eye, forward, up.as_dvec3(), yfov).map_err(|error| match error {
            CameraError::Transform => CameraError::UpAlongView {
                up,
                better: axis_across(forward),
            },
            other => other,
        })
    }

    /// A camera placed by this transform: it looks along its own −Z, with +Y up (glTF 2.0, 3.10.2). Scale does not matter,
    /// and a mirroring transform does not mirror the image.
    ///
    /// # Errors
    /// If the transform is not finite or flattens −Z or +Y, or if `yfov` is not in (0, π).
    pub fn placed(world_from_camera: &Affine3A, yfov: f32) -> Result<Self, CameraError> {
        let eye = Vec3::from(world_from_camera.translation);
        if !eye.is_finite() {
            return Err(CameraError::Transform);
        }
        let axis = |v: Vec3| {
            world_from_camera
                .transform_vector3(v)
                .as_dvec3()
                .try_normalize()
        };
        let forward = axis(Vec3::NEG_Z).ok_or(CameraError::Transform)?;
        let up = axis(Vec3::Y).ok_or(CameraError::Transform)?;
        Self::with_axes(eye, forward, up, yfov)
    }

    /// A camera in front of `bounds` (on their +Z side, looking along −Z) from where all of them is seen in an image of
    /// `aspect` = width / height. `None` for bounds without extent.
    pub fn framing(bounds: &Aabb, aspect: f32) -> Option<Self> {
        let size = bounds.max - bounds.min;
        if bounds.is_empty() || !size.is_finite() || size.max_element() <= 0.0 {
            return None;
        }
        let tan_half_height = (0.5 * FRAMING_YFOV).tan();
        let tan_half_width = tan_half_height * aspect;
        // The nearest face decides: what lies behind it looks smaller. A twentieth of margin all around.
        let distance = 1.05 * (0.5 * size.y / tan_half_height).max(0.5 * size.x / tan_half_width);
        // A wall seen edge on still needs some distance.
        let distance = distance.max(0.5 * size.z);
        let target = bounds.center();
        let eye = target + Vec3::Z * (0.5 * size.z + distance);
        Self::look_at(eye, target, Vec3::Y, FRAMING_YFOV).ok()
    }

    /// `forward` is of unit length; fails with [`CameraError::Transform`] where `up` is parallel to it.
    fn with_axes(eye: Vec3, forward: DVec3, up: DVec3, yfov: f32) -> Result<Self, CameraError> {
        let valid = yfov > 0.0 && yfov < std::f32::consts::PI;
        if !valid {
            let degrees = yfov.to_degrees();
            return Err(CameraError::FieldOfView { degrees });
        }
        // Below a micro-radian between them, f32 input says nothing about which side is right.
        let right = forward.cross(up.normalize_or_zero());
        if right.length() < 1e-6 {
            return Err(CameraError::Transform);
        }
        let right = right.normalize();
        let up = right.cross(forward);
        let half_height = (0.5 * f64::from(yfov)).tan();
        Ok(Self {
            eye,
            forward: forward.as_vec3(),
            right: (right * half_height).as_vec3(),
            up: (up * half_height).as_vec3(),
        })
    }

    /// Where the camera stands, in metres.
    pub fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Unit direction of view.
    pub fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Vertical field of view in radians.
    pub fn yfov(&self) -> f32 {
        2.0 * self.up.length().atan()
    }

    /// The ray through the point (`x`, `y`) of an image of `width` × `height` pixels; x runs right from the left edge, y down
    /// from the top edge, and (0.5, 0.5) is the centre of the first pixel.
    pub fn ray(&self, x: f32, y: f32, width: u32, height: u32) -> Ray {
        let (width, height) = (width as f32, height as f32);
        // In half heights of the image, so that pixels are square.
        let across = (2.0 * x - width) / height;
        let upward = 1.0 - 2.0 * y / height;
        let direction = self.forward + across * self.right + upward * self.up;
        Ray::new(self.eye, direction.normalize())
    }

    /// Where the point `p` is seen in such an image, as [`Camera::ray`] counts, within its borders or beyond; `None` for points that are
    /// not in front of the eye.
    pub fn project(&self, p: Vec3, width: u32, height: u32) -> Option<[f32; 2]> {
        let way = p - self.eye;
        let depth = way.dot(self.forward);
        let half_heights = |axis: Vec3| way.dot(axis) / (depth * axis.length_squared());
        let (width, height) = (width as f32, height as f32);
        let x = 0.5 * (width + height * half_heights(self.right));
        let y = 0.5 * height * (1.0 - half_heights(self.up));
        (depth > 0.0 && x.is_finite() && y.is_finite()).then_some([x, y])
    }

    /// Width of a pixel in metres at `distance` metres from the eye, for an image `height` pixels high: 2 d tan(yfov/2) / height.
    /// Exact at the image's centre; pixels further out see a little less.
    pub fn footprint(&self, distance: f32, height: u32) -> f32 {
        2.0 * distance * self.up.length() / height as f32
    }
}

/// The world axis most nearly across a direction.
fn axis_across(direction: DVec3) -> Vec3 {
    let size = direction.abs();
    if size.y <= size.x && size.y <= size.z {
        Vec3::Y
    } else if size.z <= size.x {
        Vec3::Z
    } else {
        Vec3::X
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use glam::Quat;
    use std::f32::consts::{FRAC_PI_2, PI};

    fn close(a: Vec3, b: Vec3) {
        // Rounding of a normalised f32 direction.
        assert!((a - b).length() < 1e-6, "{a} {b}");
    }

    #[test]
    fn points_are_seen_where_the_rays_through_their_pixels_meet_them() {
        let eye = Vec3::new(1.0, 2.0, 3.0);
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::new(0.3, 1.0, 0.0), FRAC_PI_2).unwrap();
        for (x, y, t) in [(0.5, 0.5, 1.0), (100.0, 50.0, 7.0), (180.25, -20.0, 0.1)] {
            let p = camera.ray(x, y, 200, 100).at(t);
            let [u, v] = camera.project(p, 200, 100).unwrap();
            // Pixels of an image 200 wide; rounding of f32 grows as 1/t.
            assert!((u - x).abs() < 2e-3 && (v - y).abs() < 2e-3, "{u} {v}");
        }
        assert_eq!(camera.project(eye + eye, 200, 100), None, "behind");
        assert_eq!(camera.project(eye, 200, 100), None, "at the eye");
    }

    #[test]
    fn the_centre_looks_at_the_target_and_the_corners_span_the_field_of_view() {
        let camera =
            Camera::look_at(Vec3::new(0.0, 1.0, 4.0), Vec3::Y, Vec3::Y, FRAC_PI_2).unwrap();
        let direction = |x, y| camera.ray(x, y, 200, 100).direction;
        close(direction(100.0, 50.0), Vec3::NEG_Z);
        close(direction(100.0, 0.0), Vec3::new(0.0, 1.0, -1.0).normalize());
        close(
            direction(100.0, 100.0),
            Vec3::new(0.0, -1.0, -1.0).normalize(),
        );
        close(
            direction(200.0, 50.0),
            Vec3::new(2.0, 0.0, -1.0).normalize(),
        );
        close(direction(0.0, 0.0), Vec3::new(-2.0, 1.0, -1.0).normalize());
        assert_eq!(
            camera.ray(3.0, 4.0, 200, 100).origin,
            Vec3::new(0.0, 1.0, 4.0)
        );
        assert!((camera.yfov() - FRAC_PI_2).abs() < 1e-6);
    }

    #[test]
    fn up_need_only_lie_on_the_right_side() {
        let tilted = Vec3::new(0.0, 5.0, -3.0);
        let a = Camera::look_at(Vec3::Z, Vec3::ZERO, tilted, 1.0).unwrap();
        let b = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0).unwrap();
        close(
            a.ray(1.0, 2.0, 9, 9).direction,
            b.ray(1.0, 2.0, 9, 9).direction,
        );
    }

    #[test]
    fn a_pixels_footprint_is_the_distance_between_neighbouring_rays() {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::X, Vec3::Y, 0.8).unwrap();
        let at_plane = |y| {
            let direction = camera.ray(320.0, y, 640, 480).direction;
            direction * (7.0 / direction.dot(camera.forward()))
        };
        let measured = (at_plane(239.0) - at_plane(241.0)).length() / 2.0;
        // f32 rounding of two directions of length 7 against 0.01.
        assert!((measured - camera.footprint(7.0, 480)).abs() < 1e-5);
    }

    #[test]
    fn impossible_views_say_why() {
        let check = |eye, target, up, yfov, expected: &str| {
            let message = Camera::look_at(eye, target, up, yfov)
                .unwrap_err()
                .to_string();
            assert!(message.contains(expected), "{message}");
        };
        check(Vec3::X, Vec3::X, Vec3::Y, 1.0, "same point");
        check(Vec3::Y, Vec3::ZERO, Vec3::Y, 1.0, "for example [0, 0, 1]");
        check(
            Vec3::ZERO,
            Vec3::X,
            Vec3::NEG_X,
            1.0,
            "for example [0, 1, 0]",
        );
        for yfov in [0.0, -1.0, PI, 4.0, f32::NAN, f32::INFINITY] {
            check(Vec3::Z, Vec3::ZERO, Vec3::Y, yfov, "(0, 180)");
        }
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        assert_eq!(Camera::placed(&flat, 1.0), Err(CameraError::Transform));
        let broken = Affine3A::from_translation(Vec3::NAN);
        assert_eq!(Camera::placed(&broken, 1.0), Err(CameraError::Transform));
    }

    #[test]
    fn extreme_fields_of_view_give_finite_unit_directions() {
        for degrees in [1e-3_f32, 179.999] {
            let camera =
                Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, degrees.to_radians()).unwrap();
            for (x, y) in [(0.0, 0.0), (16384.0, 1.0), (8192.0, 8192.0)] {
                let direction = camera.ray(x, y, 16384, 16384).direction;
                assert!(
                    (direction.length() - 1.0).abs() < 1e-5,
                    "{degrees} {direction}"
                );
            }
        }
    }

    #[test]
    fn a_placed_camera_looks_along_its_negative_z_whatever_its_scale() {
        let turn = Quat::from_rotation_y(FRAC_PI_2);
        let place = Vec3::new(1.0, 2.0, 3.0);
        for scale in [
            Vec3::ONE,
            Vec3::new(3.0, 0.1, 2.0),
            Vec3::new(-1.0, 1.0, 1.0),
        ] {
            let node = Affine3A::from_scale_rotation_translation(scale, turn, place);
            let camera = Camera::placed(&node, 1.0).unwrap();
            assert_eq!(camera.eye(), place);
            close(camera.forward(), Vec3::NEG_X);
            close(camera.ray(50.0, 50.0, 100, 100).direction, Vec3::NEG_X);
            assert!(camera.ray(50.0, 0.0, 100, 100).direction.y > 0.4);
        }
    }

    #[test]
    fn framing_sees_every_corner_of_the_bounds() {
        for (size, aspect) in [
            (Vec3::ONE, 4.0 / 3.0),
            (Vec3::new(100.0, 1.0, 20.0), 1.0),
            (Vec3::new(0.1, 30.0, 0.0), 2.0),
            (Vec3::new(0.0, 0.0, 5.0), 0.5),
        ] {
            let min = Vec3::new(7.0, -3.0, 2.0);
            let bounds = Aabb {
                min,
                max: min + size,
            };
            let camera = Camera::framing(&bounds, aspect).unwrap();
            let right = camera.right.normalize();
            for corner in 0..8 {
                let pick = |axis: usize| {
                    if corner >> axis & 1 == 0 {
                        bounds.min
                    } else {
                        bounds.max
                    }
                };
                let p = Vec3::new(pick(0).x, pick(1).y, pick(2).z) - camera.eye();
                let depth = p.dot(camera.forward());
                let half_height = depth * camera.up.length();
                assert!(depth > 0.0);
                assert!(p.y.abs() <= half_height && p.dot(right).abs() <= half_height * aspect);
            }
        }
        assert_eq!(Camera::framing(&Aabb::EMPTY, 1.0), None);
        let point = Aabb {
            min: Vec3::ONE,
            max: Vec3::ONE,
        };
        assert_eq!(Camera::framing(&point, 1.0), None);
    }
}
