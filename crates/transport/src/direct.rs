//! Light that arrives straight from the lights, by one sample of one light.

use crate::light_choice::LightChoice;
use crate::single::unoccluded;
use crate::world::{Geometry, LightSample, Lights, SurfaceHit, World};
use glam::Vec3;

/// Light from one direction.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// Unit direction to the light.
    pub w_i: Vec3,
    /// Radiance that arrives over the density of the sample: sr × W/(m² sr).
    pub radiance: Vec3,
    /// The way to the light.
    pub light: LightSample,
}

/// Light that arrives at `p` in a medium; `choice` picks the light and `u` the place on it.
pub fn in_medium<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    choice: f32,
    u: [f32; 2],
) -> Option<DirectSample> {
    sample(world, p, None, choice, u)
}

/// Light that arrives at the front of the surface at `hit`.
pub fn on_surface<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    hit: &SurfaceHit,
    choice: f32,
    u: [f32; 2],
) -> Option<DirectSample> {
    sample(world, hit.position, Some(hit), choice, u)
}

fn sample<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    choice: f32,
    u: [f32; 2],
) -> Option<DirectSample> {
    let sigma = world.media.at(p).sigma_t.element_sum() / 3.0;
    let normal = hit.map(|hit| hit.normal);
    let (light, chance) = LightChoice::at(world.lights, p, normal, sigma).sample(choice)?;
    let s = world.lights.sample(light, p, u)?;
    if normal.is_some_and(|n| n.dot(s.w_i) <= 0.0) {
        return None;
    }
    let radiance = s.radiance / (chance * s.pdf);
    if !radiance.is_finite() || radiance.max_element() <= 0.0 {
        return None;
    }
    let origin = hit.map_or(p, |hit| hit.spawn(s.w_i).origin);
    let arrives = unoccluded(world, origin, p, &s)?;
    Some(DirectSample {
        w_i: s.w_i,
        radiance: radiance * arrives,
        light: s,
    })
}
