//! How a scene's camera moves, and over which frames.

use crate::camera::{Camera, CameraError};
use crate::camera_path::CameraPath;
use crate::gltf::CameraAnimation;
use std::ops::RangeInclusive;

/// How a camera moves from frame to frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CameraMotion {
    /// Along the curve of a scene file.
    Path(CameraPath),
    /// As an animation of a glTF file moves it.
    Animation {
        /// Where it stands at each time.
        animation: CameraAnimation,
        /// Vertical field of view in radians, in (0, π).
        yfov: f32,
        /// Frames per second: frame f is shown at f / fps seconds.
        fps: f32,
    },
}

/// There is no view at some frame of a moving camera.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the moving camera has no view at frame {frame}: {source}")]
pub struct FrameError {
    /// The frame.
    pub frame: f32,
    /// What is wrong there.
    pub source: CameraError,
}

impl CameraMotion {
    /// The camera at `frame`, which need not be whole. Before the first and after the last frame it stands still, and what is
    /// not a number is the first frame.
    ///
    /// # Errors
    /// Where the motion passes through something that is no view, as when the eye meets its target.
    pub fn at(&self, frame: f32) -> Result<Camera, FrameError> {
        let camera = match self {
            Self::Path(path) => path.at(frame),
            // In f32, as keyframes are: a frame then comes out at the very keyframe that was made for it.
            Self::Animation {
                animation,
                yfov,
                fps,
            } => animation
                .at(frame / fps)
                .and_then(|pose| Camera::placed(&pose, *yfov)),
        };
        camera.map_err(|source| FrameError { frame, source })
    }

    /// Where the motion starts and ends, in frames from 0 on and not only whole.
    pub fn span(&self) -> [f32; 2] {
        match self {
            Self::Path(path) => path.span(),
            Self::Animation { animation, fps, .. } => animation.span().map(|time| time * fps),
        }
    }

    /// All frames in which the camera moves, with those at which it starts and ends.
    ///
    /// A motion that starts or ends between two frames takes the outer one in.
    pub fn frames(&self) -> RangeInclusive<u32> {
        // Times stored in f32 seconds come out a rounding beside whole frames.
        const ROUNDING: f32 = 1e-3;
        let [first, last] = self.span();
        (first + ROUNDING).floor() as u32..=(last - ROUNDING).ceil() as u32
    }

    /// Length of the way of the eye, in metres: the sum over straight pieces between [`N_PIECES`](Self::N_PIECES) + 1 even
    /// steps in time. Places without a view are passed over.
    pub fn length(&self) -> f64 {
        let [first, last] = self.span();
        let mut before = None;
        let mut length = 0.0;
        for i in 0..=Self::N_PIECES {
            let u = i as f32 / Self::N_PIECES as f32;
            let Ok(camera) = self.at(first + u * (last - first)) else {
                continue;
            };
            let eye = camera.eye().as_dvec3();
            length += before.map_or(0.0, |before| eye.distance(before));
            before = Some(eye);
        }
        length
    }

    /// Pieces by which [`length`](Self::length) is measured; a half circle comes out (π/4096)² / 24 = 2·10⁻⁸ too short.
    pub const N_PIECES: u32 = 4096;
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::camera_path::CameraKey;
    use glam::Vec3;

    /// From (0, 0, 0) to (3, 0, 4) between these frames.
    fn line(first: f32, last: f32) -> CameraMotion {
        let key =
            |frame, eye: Vec3| CameraKey::new(frame, eye, eye - Vec3::Z, Vec3::Y, 1.0).unwrap();
        let mut path = CameraPath::new(key(first, Vec3::ZERO));
        path.push(key(last, Vec3::new(3.0, 0.0, 4.0))).unwrap();
        CameraMotion::Path(path)
    }

    #[test]
    fn frames_hold_the_whole_motion_and_no_more() {
        for (first, last, frames) in [
            (0.0, 47.0, 0..=47),
            (3.0, 4.0, 3..=4),
            (0.5, 47.5, 0..=48),
            (1.000_1, 46.999_9, 1..=47),
            (0.999_9, 47.000_1, 1..=47),
            (0.0, 1e7, 0..=10_000_000),
            (0.0, 1e-6, 0..=0),
        ] {
            assert_eq!(line(first, last).frames(), frames, "{first} {last}");
        }
    }

    #[test]
    fn the_length_is_that_of_the_eyes_way() {
        for (first, last) in [(0.0, 1.0), (5.0, 1000.0)] {
            // Rounding of 4096 differences of f32 positions: at most 4096 × 2 × 2^-23.
            assert!((line(first, last).length() - 5.0).abs() < 1e-3);
        }
    }

    #[test]
    fn a_frame_without_view_is_named() {
        let key = |frame, z: f32| {
            let eye = Vec3::new(0.0, 0.0, z);
            CameraKey::new(frame, eye, Vec3::ZERO, Vec3::Y, 1.0).unwrap()
        };
        let mut path = CameraPath::new(key(10.0, 2.0));
        path.push(key(14.0, -2.0)).unwrap();
        let motion = CameraMotion::Path(path);
        let error = motion.at(12.0).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the moving camera has no view at frame 12: eye and target are the same point [0, 0, 0]; they must differ"
        );
        assert!(
            (motion.length() - 4.0).abs() < 1e-3,
            "the place is passed over"
        );
    }
}
