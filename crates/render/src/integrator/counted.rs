//! Geometry that counts the rays it is asked about.
//!
//! Each row of the image and each record has a counter of its own, so threads do not wait for one another.

use std::sync::atomic::{AtomicU64, Ordering};
use tyndall_math::Ray;
use tyndall_scene::{LightSet, Scene, Triangles};
use tyndall_transport::world::{Geometry, SurfaceHit, World};

/// The triangles of a scene, with a count of closest-hit and shadow rays.
pub(crate) struct Counted<'s> {
    triangles: &'s Triangles,
    rays: AtomicU64,
}

impl<'s> Counted<'s> {
    pub(crate) fn new(scene: &'s Scene) -> Self {
        Self {
            triangles: &scene.geometry,
            rays: AtomicU64::new(0),
        }
    }

    /// The scene as light sees it, its rays counted here.
    pub(crate) fn world<'w>(&'w self, scene: &'w Scene) -> World<'w, Self, LightSet> {
        World {
            geometry: self,
            lights: &scene.lights,
            media: &scene.media,
        }
    }

    pub(crate) fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }
}

impl Geometry for Counted<'_> {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        self.rays.fetch_add(1, Ordering::Relaxed);
        self.triangles.intersect(ray, t_max)
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.rays.fetch_add(1, Ordering::Relaxed);
        self.triangles.occluded(ray, t_max)
    }
}
