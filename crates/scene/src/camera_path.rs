//! A camera that moves through key views along a smooth curve, as `camera: Path([…])` of a scene file writes it.

use crate::camera::{Camera, CameraError};
use crate::hermite;
use glam::{DVec3, Vec3};

/// A view that a path meets at one frame; known to be a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraKey {
    frame: f32,
    eye: Vec3,
    target: Vec3,
    up: Vec3,
    yfov: f32,
}

/// Values that make no camera path.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraPathError {
    /// A key's frame is not a number of a frame.
    #[error("frame {frame} cannot be; it is a finite number from 0 on")]
    Frame {
        /// The frame asked for.
        frame: f32,
    },
    /// A key is no camera.
    #[error(transparent)]
    View(#[from] CameraError),
    /// A key stands before, or at, the one it follows.
    #[error(
        "frame {frame} does not come after {before}, the frame of the key before it; frames increase from key to key"
    )]
    Order {
        /// The key's frame.
        frame: f32,
        /// Frame of the key before it.
        before: f32,
    },
}

impl CameraKey {
    /// The view at `frame`, from 0 on and not only whole: from `eye` (m) towards `target` (m), with `up` towards the top of the
    /// image and a vertical field of view of `yfov` radians.
    ///
    /// # Errors
    /// If `frame` is negative or not finite, or as [`Camera::look_at`].
    pub fn new(
        frame: f32,
        eye: Vec3,
        target: Vec3,
        up: Vec3,
        yfov: f32,
    ) -> Result<Self, CameraPathError> {
        if !(frame >= 0.0 && frame.is_finite()) {
            return Err(CameraPathError::Frame { frame });
        }
        Camera::look_at(eye, target, up, yfov)?;
        Ok(Self {
            frame,
            eye,
            target,
            up,
            yfov,
        })
    }
}

/// A camera that moves: at least one key, with frames that increase strictly.
///
/// Between two keys eye, target, up and field of view each run along a cubic p(u), u = (f − f₀) / (f₁ − f₀), whose slopes at
/// the keys are finite differences of the keys beside them, per frame:
///
/// mᵢ = (pᵢ₊₁ − pᵢ₋₁) / (fᵢ₊₁ − fᵢ₋₁), and at the first and the last key (p₁ − p₀) / (f₁ − f₀) of the only interval there
///
/// Catmull and Rom 1974, "A class of local interpolating splines", for frames at any distance from each other. Position and
/// direction are continuous with their derivatives, and two keys make a straight line at even speed. Differences across
/// both intervals, rather than a parabola through three keys, overshoot little where a long rest meets a short move. Before
/// the first key and after the last the camera stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// All keys but the last, of which there may be none.
    earlier: Vec<CameraKey>,
    last: CameraKey,
}

impl CameraPath {
    /// A path of one key, on which the camera stands still.
    pub fn new(key: CameraKey) -> Self {
        Self {
            earlier: Vec::new(),
            last: key,
        }
    }

    /// Goes on to `key`.
    ///
    /// # Errors
    /// If its frame does not come after that of the last key.
    pub fn push(&mut self, key: CameraKey) -> Result<(), CameraPathError> {
        let (frame, before) = (key.frame, self.last.frame);
        if frame <= before {
            return Err(CameraPathError::Order { frame, before });
        }
        self.earlier.push(std::mem::replace(&mut self.last, key));
        Ok(())
    }

    /// Frames of the first and the last key.
    pub fn span(&self) -> [f32; 2] {
        [self.key(0).frame, self.last.frame]
    }

    /// The camera at `frame`, which need not be whole; at a key exactly the key's.
    ///
    /// # Errors
    /// As [`Camera::look_at`], where the curves between two keys meet in a view that is none: the eye on the target, up along
    /// the view, or a field of view outside (0, π).
    pub fn at(&self, frame: f32) -> Result<Camera, CameraError> {
        let view = match self.earlier.partition_point(|key| key.frame <= frame) {
            _ if frame >= self.last.frame => self.last,
            0 => *self.key(0),
            next => self.between(next, frame),
        };
        Camera::look_at(view.eye, view.target, view.up, view.yfov)
    }

    /// Key number `index`, or the last where there are fewer.
    fn key(&self, index: usize) -> &CameraKey {
        self.earlier.get(index).unwrap_or(&self.last)
    }

    /// The curves at `frame`, which lies between key number `next`, at least 1, and the key before it.
    fn between(&self, next: usize, frame: f32) -> CameraKey {
        let (from, to) = (self.key(next - 1), self.key(next));
        let start = f64::from(from.frame);
        let length = f64::from(to.frame) - start;
        let [a, ma, b, mb] = hermite::weights((f64::from(frame) - start) / length);
        // Neighbours that are missing at either end are the end itself, which leaves the difference over one interval.
        let (before, after) = (self.key(next.saturating_sub(2)), self.key(next + 1));
        let slope_from = length / (f64::from(to.frame) - f64::from(before.frame));
        let slope_to = length / (f64::from(after.frame) - start);
        let curve = |p: fn(&CameraKey) -> DVec3| {
            a * p(from)
                + ma * slope_from * (p(to) - p(before))
                + b * p(to)
                + mb * slope_to * (p(after) - p(from))
        };
        CameraKey {
            frame,
            eye: curve(|key| key.eye.as_dvec3()).as_vec3(),
            target: curve(|key| key.target.as_dvec3()).as_vec3(),
            up: curve(|key| key.up.as_dvec3()).as_vec3(),
            yfov: curve(|key| DVec3::splat(key.yfov.into())).x as f32,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn key(frame: f32, eye: [f32; 3], target: [f32; 3]) -> CameraKey {
        CameraKey::new(frame, eye.into(), target.into(), Vec3::Y, 0.8).unwrap()
    }

    fn path(keys: &[CameraKey]) -> CameraPath {
        let mut path = CameraPath::new(keys[0]);
        for &key in &keys[1..] {
            path.push(key).unwrap();
        }
        path
    }

    /// Around a corner and up, at uneven frames.
    fn winding() -> [CameraKey; 4] {
        [
            key(2.0, [0.0, 1.0, 0.0], [0.0, 1.0, -5.0]),
            key(10.5, [3.0, 1.5, -4.0], [9.0, 1.0, -6.0]),
            key(13.0, [5.0, 2.0, -4.5], [11.0, 3.0, -3.0]),
            key(40.0, [6.0, 1.0, 2.0], [6.0, 1.0, 9.0]),
        ]
    }

    #[test]
    fn keys_are_met_exactly_and_the_camera_stands_still_beyond_both_ends() {
        let keys = winding();
        let path = path(&keys);
        let camera = |key: &CameraKey| {
            Camera::look_at(key.eye, key.target, key.up, key.yfov).map_err(CameraPathError::View)
        };
        for key in &keys {
            assert_eq!(path.at(key.frame).map_err(Into::into), camera(key));
        }
        for (frame, key) in [
            (0.0, &keys[0]),
            (-3.0, &keys[0]),
            (f32::NEG_INFINITY, &keys[0]),
            (f32::NAN, &keys[0]),
            (40.1, &keys[3]),
            (f32::INFINITY, &keys[3]),
        ] {
            assert_eq!(
                path.at(frame).map_err(Into::into),
                camera(key),
                "frame {frame}"
            );
        }
        assert_eq!(path.span(), [2.0, 40.0]);
        let alone = CameraPath::new(keys[1]);
        assert_eq!(alone.at(99.0).map_err(Into::into), camera(&keys[1]));
        assert_eq!(alone.span(), [10.5, 10.5]);
    }

    #[test]
    fn two_keys_are_a_straight_line_at_even_speed() {
        let (a, b) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(5.0, 2.0, -9.0));
        let turned = |frame, eye: Vec3, yfov| {
            CameraKey::new(frame, eye, eye - Vec3::Z, Vec3::Y, yfov).unwrap()
        };
        let path = path(&[turned(4.0, a, 0.5), turned(20.0, b, 0.9)]);
        for i in 0..=16u8 {
            let u = f32::from(i) / 16.0;
            let camera = path.at(4.0 + f32::from(i)).unwrap();
            // Rounding of f32 coordinates below 16.
            assert!((camera.eye() - a.lerp(b, u)).length() < 2e-6, "{u}");
            assert!((camera.forward() - Vec3::NEG_Z).length() < 1e-6);
            assert!((camera.yfov() - (0.5 + 0.4 * u)).abs() < 1e-6);
        }
    }

    #[test]
    fn a_curve_through_four_keys_has_the_values_worked_out_by_hand() {
        // x: 0, 1, 4, 4 at frames 0, 2, 4, 8. Slopes: at 2, (4 - 0) / 4 = 1; at 4, (4 - 1) / 6 = 1/2; at the ends 1/2 and 0.
        let at = |frame, x| key(frame, [x, 0.0, 0.0], [x, 0.0, -1.0]);
        let path = path(&[at(0.0, 0.0), at(2.0, 1.0), at(4.0, 4.0), at(8.0, 4.0)]);
        // Half way p = (p0 + p1) / 2 + h (m0 - m1) / 8.
        for (frame, x) in [
            (1.0, 0.5 + 2.0 * (0.5 - 1.0) / 8.0),
            (3.0, 2.5 + 2.0 * (1.0 - 0.5) / 8.0),
            (6.0, 4.0 + 4.0 * (0.5 - 0.0) / 8.0),
        ] {
            assert_eq!(path.at(frame).unwrap().eye().x, x, "frame {frame}");
        }
    }

    #[test]
    fn position_and_direction_and_their_speeds_have_no_jumps_at_keys() {
        let keys = winding();
        let path = path(&keys);
        // As far as f32 tells positions of a few metres, and their differences, apart.
        const STEP: f32 = 1.0 / 64.0;
        for key in &keys[1..3] {
            let [before, at, after] =
                [-STEP, 0.0, STEP].map(|step| path.at(key.frame + step).unwrap());
            let check = |what: &str, v: fn(&Camera) -> Vec3| {
                let (left, right) = (v(&at) - v(&before), v(&after) - v(&at));
                assert!(left.length() < 0.02 && right.length() < 0.02, "{what}");
                // Accelerations here stay below 1 per frame squared, which STEP squared makes 2.4e-4.
                assert!((right - left).length() < 2.5e-4, "{what} {left} {right}");
            };
            check("position", Camera::eye);
            check("direction", Camera::forward);
        }
    }

    #[test]
    fn views_that_vanish_between_keys_are_errors() {
        let mut through = path(&[
            key(0.0, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
            key(2.0, [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]),
        ]);
        let eye = Vec3::ZERO;
        assert_eq!(through.at(1.0), Err(CameraError::NoDirection { eye }));
        assert!(through.at(0.9).is_ok());
        let over = path(&[
            key(0.0, [0.0, 0.0, 0.0], [0.0, 2.0, 1.0]),
            key(2.0, [0.0, 0.0, 0.0], [0.0, 2.0, -1.0]),
        ]);
        assert!(matches!(over.at(1.0), Err(CameraError::UpAlongView { .. })));
        let order = through.push(key(2.0, [0.0; 3], [1.0; 3]));
        assert_eq!(
            order,
            Err(CameraPathError::Order {
                frame: 2.0,
                before: 2.0
            })
        );
    }

    #[test]
    fn impossible_keys_say_why() {
        for (frame, target, yfov, part) in [
            (-1.0, Vec3::Z, 1.0, "frame -1 cannot be"),
            (f32::NAN, Vec3::Z, 1.0, "frame NaN cannot be"),
            (f32::INFINITY, Vec3::Z, 1.0, "frame inf cannot be"),
            (0.0, Vec3::ZERO, 1.0, "same point"),
            (0.0, Vec3::Y, 1.0, "parallel"),
            (0.0, Vec3::Z, 4.0, "(0, 180)"),
        ] {
            let error = CameraKey::new(frame, Vec3::ZERO, target, Vec3::Y, yfov).unwrap_err();
            assert!(error.to_string().contains(part), "{error}");
        }
    }

    fn any_key() -> impl Strategy<Value = CameraKey> {
        let coordinate = || prop_oneof![-5.0f32..5.0, -1e12f32..1e12, Just(0.0f32)];
        let point = move || [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from);
        let frame = prop_oneof![0.0f32..100.0, 0.0f32..1e7, Just(0.0f32)];
        (frame, point(), point(), point(), 0.001f32..3.1).prop_filter_map(
            "a camera",
            |(frame, eye, target, up, yfov)| {
                CameraKey::new(frame, eye, target, up.normalize_or_zero(), yfov).ok()
            },
        )
    }

    proptest! {
        #[test]
        fn random_paths_give_finite_orthonormal_cameras_or_an_error(
            mut keys in prop::collection::vec(any_key(), 1..6),
            places in prop::collection::vec(-0.1f32..1.1, 32),
        ) {
            keys.sort_by(|a, b| a.frame.total_cmp(&b.frame));
            keys.dedup_by(|a, b| a.frame == b.frame);
            let path = path(&keys);
            let [first, last] = path.span();
            for place in places {
                let Ok(camera) = path.at(first + place * (last - first)) else {
                    continue;
                };
                prop_assert!(camera.eye().is_finite());
                prop_assert!(camera.yfov() > 0.0 && camera.yfov() < std::f32::consts::PI);
                // Rays through the centre and one half height to the right of it and above it.
                let [forward, right, up] = [(1.0, 1.0), (2.0, 1.0), (1.0, 0.0)]
                    .map(|(x, y)| camera.ray(x, y, 2, 2).direction);
                let across = |v: Vec3| (v - forward * v.dot(forward)).normalize_or_zero();
                for v in [forward, right, up] {
                    prop_assert!((v.length() - 1.0).abs() < 1e-5, "{camera:?}");
                }
                // Narrow fields of view leave rays too few digits of difference: 1e-7 of rounding against 0.005.
                if camera.yfov() > 0.01 {
                    prop_assert!(across(right).dot(across(up)).abs() < 1e-3, "{camera:?}");
                }
            }
        }
    }
}
