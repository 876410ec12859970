//! Scattered light at one point: value and gradient of single and multiple scattering, with standard errors.
//!
//! Single scattering is sampled towards the lights and by the phase function, with exact derivatives of every sample and the motion of
//! shadows; multiple scattering is that of one fresh record, or of paths and finite differences where the ground truth is asked for.

mod paths;

pub use paths::by_paths;
pub use tyndall_transport::gather::Derivatives;

use crate::options::Integrator;
use glam::{DMat3, Vec3};
use serde::Serialize;
use tyndall_math::{Key, Purpose};
use tyndall_scene::Scene;
use tyndall_transport::Lights;
use tyndall_transport::gather::{self, GatherPattern, Towards};
use tyndall_transport::inscatter::{self, Inscattered, Order};
use tyndall_transport::path::Reach;

/// What to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeOptions {
    /// The point, in metres.
    pub at: Vec3,
    /// The direction in which the scattered light leaves, of any length; may be left out where scattering is isotropic.
    pub towards: Option<Vec3>,
    /// Gather directions, or paths.
    pub samples: u32,
    /// How multiple scattering is found.
    pub integrator: Integrator,
    /// Whether gradients know of moving silhouettes; differences of paths always do.
    pub derivatives: Derivatives,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Most samples of a probe: a gather keeps some 200 bytes for each.
const MAX_SAMPLES: u32 = 10_000_000;

/// Why a probe cannot be answered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProbeError {
    /// Too few to average over.
    #[error(
        "--samples is {0}, but it must be at least 2: standard errors come from the spread of samples"
    )]
    FewSamples(u32),
    /// More than memory holds.
    #[error(
        "--samples is {0}, but it must be at most {MAX_SAMPLES}; their noise is far below f32 rounding then"
    )]
    ManySamples(u32),
    /// The point is where a lamp without extent stands.
    #[error("--at is ({}, {}, {}), where a point light stands: scattered light is infinite there; choose a point beside it", .0.x, .0.y, .0.z)]
    AtLamp(Vec3),
    /// The point is not a place.
    #[error("--at is ({}, {}, {}), but all of its numbers must be finite", .0.x, .0.y, .0.z)]
    Point(Vec3),
    /// The direction has no direction.
    #[error("--dir is ({}, {}, {}), but it must have a finite length above 0", .0.x, .0.y, .0.z)]
    Direction(Vec3),
    /// The result depends on a direction that was not given.
    #[error(
        "the media of this scene do not scatter equally in all directions: give the direction in which the light leaves with --dir X,Y,Z"
    )]
    DirectionMissing,
}

/// In-scattered radiance ∫ p L dω, without the scattering coefficient, and how it changes with the point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Part {
    /// Red, green, blue, W/(m² sr).
    pub value: [f32; 3],
    /// Standard error of the value.
    pub stderr: [f32; 3],
    /// ∂/∂x, ∂/∂y, ∂/∂z per metre, for red, green and blue.
    pub gradient: [[f32; 3]; 3],
    /// Standard error of the gradient.
    pub gradient_stderr: [[f32; 3]; 3],
    /// Second derivatives per square metre, 3 × 3 for red, green and blue, where they are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hessian: Option<[[[f64; 3]; 3]; 3]>,
    /// Standard error of the Hessian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hessian_stderr: Option<[[[f64; 3]; 3]; 3]>,
}

impl From<Inscattered> for Part {
    fn from(found: Inscattered) -> Self {
        let rows = |hessian: [DMat3; 3]| hessian.map(|h| h.to_cols_array_2d());
        Self {
            value: found.value.into(),
            stderr: found.value_error.into(),
            gradient: found.gradient.map(Into::into),
            gradient_stderr: found.gradient_error.map(Into::into),
            hessian: found.hessian.map(rows),
            hessian_stderr: found.hessian_error.map(rows),
        }
    }
}

/// What `tyndall probe` tells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// Light straight from emitters.
    pub single: Part,
    /// Light that was scattered or reflected before, or that media emit.
    pub multiple: Part,
    /// Extinction at the point, per metre.
    pub sigma_t: [f32; 3],
    /// Scattering at the point, per metre.
    pub sigma_s: [f32; 3],
}

/// Measures scattered light in `scene`. Outside of media the light that an isotropic medium would scatter there is told.
///
/// # Errors
/// A point or direction that is none, fewer than two samples, or a missing direction where scattering depends on it.
pub fn probe(scene: &Scene, options: &ProbeOptions) -> Result<Probe, ProbeError> {
    if options.samples < 2 {
        return Err(ProbeError::FewSamples(options.samples));
    }
    if options.samples > MAX_SAMPLES {
        return Err(ProbeError::ManySamples(options.samples));
    }
    if !options.at.is_finite() {
        return Err(ProbeError::Point(options.at));
    }
    // Nearer than coordinates can tell, 1/r² and its gradient leave the range of f32.
    let least = f32::EPSILON * options.at.abs().max_element() + f32::MIN_POSITIVE.sqrt();
    if scene.lights.distance_to_point_lights(options.at) <= least {
        return Err(ProbeError::AtLamp(options.at));
    }
    let towards = match options.towards {
        Some(direction) => Some(
            direction
                .try_normalize()
                .ok_or(ProbeError::Direction(direction))?,
        ),
        None if scene.media.is_isotropic() => None,
        None => return Err(ProbeError::DirectionMissing),
    };
    let world = scene.world();
    let max_depth = scene.settings.max_depth;
    let samples = options.samples as usize;
    let key = Key {
        seed: options.seed,
        purpose: Purpose::Probe,
        index: 0,
    };
    let (single, multiple) = match options.integrator {
        Integrator::Path => by_paths(&world, options.at, towards, samples, max_depth, key),
        Integrator::Cache => {
            let g = gather::multiple_towards(
                &world,
                options.at,
                towards.map(Towards::Direction),
                &GatherPattern::new(samples),
                options.derivatives,
                Reach::depth(max_depth),
                key,
            );
            let multiple = Part {
                value: g.value.to_array(),
                stderr: g.value_error.to_array(),
                gradient: g.gradient.map(Into::into),
                gradient_stderr: g.gradient_error.map(Into::into),
                hessian: None,
                hessian_stderr: None,
            };
            let asked = (Order::Hessian, options.derivatives);
            let single = inscatter::single(&world, options.at, towards, samples, asked, key);
            (single.into(), multiple)
        }
    };
    let medium = scene.media.at(options.at);
    Ok(Probe {
        single,
        multiple,
        sigma_t: medium.sigma_t.to_array(),
        sigma_s: medium.sigma_s.to_array(),
    })
}

#[cfg(test)]
mod tests;
