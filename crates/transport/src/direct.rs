//! Light that arrives straight from the lights: by one sample of one light, or of skies by a few samples of each.

use crate::light_choice::LightChoice;
use crate::single::{Passes, passing};
use crate::world::{Geometry, LightSample, Lights, SurfaceHit, World};
use glam::Vec3;
use tyndall_math::low_discrepancy::INVERSE_GOLDEN_RATIO;

/// Samples of each sky: few directions meet it where it is seen through windows, and shadow rays are the cheapest part of a vertex. Not so in
/// grids: there they took 60 % of the time that a coarse field of smoke took to fill (2026-11-23).
const SKY_SAMPLES: u32 = 4;
const SKY_SAMPLES_IN_GRIDS: u32 = 1;

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

/// Light that arrives at `p`, in a medium or at the front of the surface at `hit`; `choice` picks the light and `u` the place on it.
pub fn sample<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    choice: f32,
    u: [f32; 2],
) -> Option<DirectSample> {
    let chosen = light_choice(world, p, hit).sample(choice)?;
    towards(world, p, hit, chosen, u, Passes::AsItDoes)
}

/// Numbers for all lights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightNumbers {
    /// Chooses a lamp.
    pub(crate) choice: f32,
    /// A place on it.
    pub(crate) lamp: [f32; 2],
    /// Directions to the sky.
    pub(crate) sky: [f32; 2],
    /// Whether light comes through thick media, where that is left to chance.
    pub(crate) depth: Option<f32>,
}

/// Samples of [`lamps`] and [`sky`] together, for those who average many of them: light through thick smoke arrives by chance.
pub(crate) fn from_all<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    numbers: LightNumbers,
) -> impl Iterator<Item = DirectSample> {
    let passes = numbers.depth.map_or(Passes::AsItDoes, Passes::ByChance);
    let lamp = lamps_that(world, p, hit, (numbers.choice, numbers.lamp), passes);
    let sky = sky_that(world, p, hit, numbers.sky, passes);
    lamp.into_iter().chain(sky)
}

/// As [`sample`], but for skies and environment images: see [`sky`].
pub fn lamps<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    choice: f32,
    u: [f32; 2],
) -> Option<DirectSample> {
    lamps_that(world, p, hit, (choice, u), Passes::AsItDoes)
}

fn lamps_that<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    (choice, u): (f32, [f32; 2]),
    passes: Passes,
) -> Option<DirectSample> {
    let skies = world.lights.environment();
    let lights = light_choice(world, p, hit);
    if skies.is_empty() {
        return towards(world, p, hit, lights.sample(choice)?, u, passes);
    }
    let (light, chance) = lights.without(skies).sample(choice)?;
    if skies.contains(&light) {
        return None;
    }
    towards(world, p, hit, (light, chance), u, passes)
}

/// Light that arrives from skies and environment images at `p`, in a medium or on the surface at `hit`: the sum of the samples is an
/// estimate.
pub fn sky<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    u: [f32; 2],
) -> impl Iterator<Item = DirectSample> {
    sky_that(world, p, hit, u, Passes::AsItDoes)
}

fn sky_that<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    [u, v]: [f32; 2],
    passes: Passes,
) -> impl Iterator<Item = DirectSample> {
    let n = match passes {
        Passes::ByChance(_) => SKY_SAMPLES_IN_GRIDS,
        Passes::AsItDoes => SKY_SAMPLES,
    };
    let spread = move |k: u32| {
        let u = (u + k as f32 / n as f32).fract();
        [u, (v + k as f32 * INVERSE_GOLDEN_RATIO as f32).fract()]
    };
    let skies = world.lights.environment().iter();
    skies.flat_map(move |&light| {
        let chance = n as f32;
        (0..n).filter_map(move |k| towards(world, p, hit, (light, chance), spread(k), passes))
    })
}

fn light_choice<'w, G, L: Lights>(
    world: &World<'w, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
) -> LightChoice<'w> {
    let sigma = world.media.at(p).sigma_t.element_sum() / 3.0;
    LightChoice::at(world.lights, p, hit.map(|hit| hit.normal), sigma)
}

/// One sample of a light that was chosen with a chance, or that as many samples are taken of.
fn towards<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    p: Vec3,
    hit: Option<&SurfaceHit>,
    (light, chance): (usize, f32),
    u: [f32; 2],
    passes: Passes,
) -> Option<DirectSample> {
    let normal = hit.map(|hit| hit.normal);
    let s = world.lights.sample(light, p, u)?;
    if normal.is_some_and(|n| n.dot(s.w_i) <= 0.0) {
        return None;
    }
    let radiance = s.radiance / (chance * s.pdf);
    if !radiance.is_finite() || radiance.max_element() <= 0.0 {
        return None;
    }
    let origin = hit.map_or(p, |hit| hit.spawn(s.w_i).origin);
    let arrives = passing(world, origin, p, &s, passes)?;
    Some(DirectSample {
        w_i: s.w_i,
        radiance: radiance * arrives,
        light: s,
    })
}
