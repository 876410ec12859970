//! Where a frame is seen from, and how many pixels it has.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use tyndall_math::Ray;
use tyndall_scene::Camera;

/// A camera and the frame it fills.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct View {
    camera: Camera,
    /// Width and height in pixels.
    frame: [u32; 2],
}

impl View {
    pub(crate) fn new(camera: Camera, frame: [u32; 2]) -> Self {
        Self { camera, frame }
    }

    /// Width and height in pixels.
    pub(crate) fn frame(&self) -> [u32; 2] {
        self.frame
    }

    /// Where the camera stands.
    pub(crate) fn eye(&self) -> Vec3 {
        self.camera.eye()
    }

    /// The ray through a point of the frame, in pixels from its upper left corner.
    pub(crate) fn ray(&self, x: f32, y: f32) -> Ray {
        let [w, h] = self.frame;
        self.camera.ray(x, y, w, h)
    }

    /// As [`View::ray`], for a point in shares of the frame.
    pub(crate) fn ray_at(&self, [u, v]: [f32; 2]) -> Ray {
        let [w, h] = self.frame;
        self.ray(u * w as f32, v * h as f32)
    }

    /// The pixel in which a point is seen, column and row; `None` outside the frame.
    pub(crate) fn pixel(&self, p: Vec3) -> Option<[u32; 2]> {
        let [w, h] = self.frame;
        let [x, y] = self.camera.project(p, w, h)?;
        let is_inside = x >= 0.0 && y >= 0.0 && x < w as f32 && y < h as f32;
        is_inside.then_some([x as u32, y as u32])
    }

    /// Width of a pixel in metres at `distance` metres from the eye.
    pub(crate) fn footprint(&self, distance: f32) -> f32 {
        self.camera.footprint(distance, self.frame[1])
    }
}

/// At most `n` of some views, evenly spread among them, the first included.
pub(crate) fn spread(views: &[View], n: usize) -> impl Iterator<Item = &View> {
    let n = n.min(views.len());
    (0..n).map(move |i| &views[i * views.len() / n])
}
