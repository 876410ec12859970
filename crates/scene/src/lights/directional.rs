//! Parallel light from infinitely far away, such as the sun's.

use glam::Vec3;
use tyndall_math::Ray;
use tyndall_transport::LightSample;
use tyndall_transport::importance::{facing, mean};

/// Light that travels in one direction everywhere.
#[derive(Clone, Copy, Debug)]
pub struct DirectionalLight {
    direction: Vec3,
    irradiance: Vec3,
}

impl DirectionalLight {
    /// Light travelling along the unit `direction` with `irradiance` (W/m²) on a plane perpendicular to it.
    pub fn new(direction: Vec3, irradiance: Vec3) -> Self {
        Self {
            direction,
            irradiance,
        }
    }

    /// Unit direction in which the light travels.
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// Irradiance on a plane perpendicular to the direction, W/m².
    pub fn irradiance(&self) -> Vec3 {
        self.irradiance
    }

    pub(super) fn importance(&self, p: Vec3, normal: Option<Vec3>) -> f32 {
        // The fluence of parallel light is its perpendicular irradiance.
        mean(self.irradiance) * facing(p, normal, p - self.direction, 0.0)
    }

    pub(super) fn importance_along(&self, _ray: &Ray, t_max: f32) -> f32 {
        mean(self.irradiance) * t_max
    }

    pub(super) fn sample(&self, _p: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        Some(LightSample {
            w_i: -self.direction,
            distance: f32::INFINITY,
            radiance: self.irradiance,
            pdf: 1.0,
            delta: true,
            normal: Vec3::ZERO,
            size: 0.0,
        })
    }
}
