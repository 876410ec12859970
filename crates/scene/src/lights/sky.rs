//! Light of one colour from all directions.

use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::{Ray, warp};
use tyndall_transport::LightSample;
use tyndall_transport::importance::mean;

/// A constant environment.
#[derive(Clone, Copy, Debug)]
pub struct SkyLight {
    radiance: Vec3,
}

impl SkyLight {
    /// A sky of `radiance` (W/(m² sr)) in every direction.
    pub fn new(radiance: Vec3) -> Self {
        Self { radiance }
    }

    /// Radiance, W/(m² sr), the same from everywhere.
    pub fn radiance(&self) -> Vec3 {
        self.radiance
    }

    /// Integral of the radiance over all directions, W/m².
    pub fn fluence(&self) -> Vec3 {
        self.radiance * (4.0 * PI)
    }

    pub(super) fn importance(&self, _p: Vec3, normal: Option<Vec3>) -> f32 {
        mean(self.fluence()) * surface_share(normal)
    }

    pub(super) fn importance_along(&self, _ray: &Ray, t_max: f32) -> f32 {
        mean(self.fluence()) * t_max
    }

    pub(super) fn sample(&self, _p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        Some(LightSample {
            w_i: warp::uniform_sphere(u),
            distance: f32::INFINITY,
            radiance: self.radiance,
            pdf: self.pdf(),
            delta: false,
            normal: Vec3::ZERO,
            size: 0.0,
        })
    }

    pub(super) fn pdf(&self) -> f32 {
        0.25 / PI
    }
}

/// Irradiance over fluence for light from everywhere: a surface sees half of it at a mean cosine of one half.
pub(super) fn surface_share(normal: Option<Vec3>) -> f32 {
    if normal.is_some() { 0.25 } else { 1.0 }
}
