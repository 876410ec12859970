//! A walk through the scene that tells how much light there is at each place where it scattered.
//!
//! The light behind a vertex is known once the walk has ended: each vertex hands to the one before what arrives there directly and what
//! it was handed itself.

use super::Asked;
use super::cells::Light;
use crate::direct::{self, LightNumbers};
use crate::emission;
use crate::free_flight::FreeFlight;
use crate::world::{Geometry, Lights, SurfaceHit, World};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;
use tyndall_math::{Frame, Ray, Sampler, warp};
use tyndall_media::MediumPoint;

/// Scattering events after which a walk may end.
const SURE: usize = 6;
/// Scattering events after which a walk may no longer go on for sure, whatever is left of its light.
const LONG: usize = 64;
const LONG_SURVIVAL: f32 = 0.95;
/// Least chance to go on: bounds the weight of those that do.
const SURVIVAL_MIN: f32 = 0.1;
/// Free flights follow each channel at least this much as the brightest.
const LEAST_CHANNEL: f32 = 0.1;
/// Share of a walk's directions that follow a phase function.
const UNEVEN: f32 = 0.5;
/// Sets of four sample dimensions for each stretch.
const SETS_PER_STRETCH: u32 = 3;

/// Light found at one place.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    pub(super) place: Asked,
    /// In a medium the mean radiance over the sphere, on a surface irradiance over π.
    pub(super) light: Light,
    /// The unit direction from which all indirect light comes.
    pub(super) from: Option<Vec3>,
}

impl Found {
    /// Mean radiance over the sphere in a medium, irradiance over π on a surface, W/(m² sr).
    pub fn light(&self) -> Vec3 {
        self.light.all
    }
}

/// A vertex of the walk, until the walk is over.
struct Vertex {
    found: Found,
    /// What leaves towards the vertex before, as far as it is known.
    leaving: Vec3,
    /// Weight of light that arrives along the walk, in `found.light` and in `leaving`.
    carried: [Vec3; 2],
    /// Transmittance and scattering between this vertex and the one before, over their density.
    stretch: Vec3,
    /// Light emitted by media on the stretch before.
    emitted: Vec3,
}

/// Walks from the start of `ray` and appends what light it finds at each scattering.
pub(super) fn walk<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    mut ray: Ray,
    sampler: &mut Sampler,
    found: &mut Vec<Found>,
) {
    let mut vertices: Vec<Vertex> = Vec::with_capacity(16);
    let alike = world.media.is_isotropic();
    // From the start on: it steers which channel free flights follow.
    let mut throughput = Vec3::ONE;
    loop {
        let n = vertices.len();
        sampler.start_set(1 + n as u32 * SETS_PER_STRETCH);
        let [free, emission, choice, roulette] = four(sampler);
        let hit = world.geometry.intersect(&ray, f32::INFINITY);
        let t_max = hit.map_or(f32::INFINITY, |h| h.t);
        // No channel is left out: vertices to come count all of them.
        let steer = throughput.max(Vec3::splat(LEAST_CHANNEL * throughput.max_element()));
        let flight = if world.media.emits() {
            FreeFlight::new(world.media.segment(&ray, t_max), steer)
        } else {
            FreeFlight::for_one(world.media, &ray, t_max, steer, free)
        };
        let emitted =
            emission::sample(world, &ray, &flight, emission).map_or(Vec3::ZERO, |e| e.value);
        let w_o = -ray.direction;
        let light = sampler.next_2d();
        let direction = sampler.next_2d();
        let lights = LightNumbers {
            choice,
            lamp: light,
            sky: sampler.next_2d(),
            // Where depth has a closed form chance would only add noise.
            depth: world.media.has_grids().then(|| sampler.next_1d()),
        };
        let next = match (flight.sample(free), &hit) {
            (Some(t), _) => {
                let stop = flight.stop(t);
                let x = ray.at(t);
                let medium = world.media.at(x);
                let stretch = stop.transmittance * medium.sigma_s / flight.pdf(&stop);
                in_medium(
                    world,
                    (x, &medium, alike),
                    (w_o, stretch),
                    lights,
                    direction,
                )
            }
            (None, Some(hit)) => {
                let stretch = flight.transmittance() / flight.pass();
                on_surface(world, hit, (w_o, stretch), lights, direction)
            }
            (None, None) => {
                if let Some(last) = vertices.last_mut() {
                    receive(last, emitted);
                }
                break;
            }
        };
        let (mut vertex, onward) = next;
        vertex.emitted = emitted;
        // As much light goes on as is not absorbed, so that weights stay near 1; first vertices are too dear to end at.
        let limit = if n > LONG { LONG_SURVIVAL } else { 1.0 };
        let survival = match onward {
            Some((_, albedo)) if n >= SURE => albedo.max(SURVIVAL_MIN).min(limit),
            _ => 1.0,
        };
        vertex.carried = vertex.carried.map(|c| c / survival);
        let [_, leaving] = vertex.carried;
        throughput *= vertex.stretch * leaving;
        if !(throughput.is_finite() && throughput.max_element() > 0.0) {
            // Nothing of what follows reaches the start, but it may reach this vertex.
            throughput = Vec3::ONE;
        }
        vertices.push(vertex);
        match onward {
            Some((onward, _)) if roulette < survival => {
                if let Some(last) = vertices.last_mut() {
                    last.found.from = Some(onward.direction);
                }
                ray = onward;
            }
            _ => break,
        }
    }
    while let Some(vertex) = vertices.pop() {
        if vertex.found.light.all.is_finite() {
            found.push(vertex.found);
        }
        if let Some(last) = vertices.last_mut() {
            receive(last, vertex.emitted + vertex.stretch * vertex.leaving);
        }
    }
}

/// Radiance that arrives at the vertex along the walk.
fn receive(vertex: &mut Vertex, radiance: Vec3) {
    if radiance.is_finite() {
        let [found, leaving] = vertex.carried;
        vertex.found.light.add(found * radiance);
        vertex.leaving += leaving * radiance;
    }
}

fn four(sampler: &mut Sampler) -> [f32; 4] {
    let ([a, b], [c, d]) = (sampler.next_2d(), sampler.next_2d());
    [a, b, c, d]
}

/// The next stretch of a walk, and the share of light that a vertex does not absorb.
type Onward = Option<(Ray, f32)>;

fn in_medium<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    (x, medium, alike): (Vec3, &MediumPoint<'_>, bool),
    (w_o, stretch): (Vec3, Vec3),
    lights: LightNumbers,
    direction: [f32; 2],
) -> (Vertex, Onward) {
    let even = 0.25 * FRAC_1_PI;
    let (mut lit, mut leaving) = (Vec3::ZERO, Vec3::ZERO);
    for s in direct::from_all(world, x, None, lights) {
        lit += even * s.radiance;
        leaving += medium.phase(w_o, s.w_i).value * s.radiance;
    }
    let w_i = onward_direction(medium, alike, w_o, direction);
    // Half of the directions are spread evenly, which bounds the weight of what cells hold.
    let pdf = if alike {
        even
    } else {
        UNEVEN * medium.phase_pdf(w_o, w_i) + (1.0 - UNEVEN) * even
    };
    let carried = [Vec3::splat(even), medium.phase(w_o, w_i).value].map(|weight| weight / pdf);
    let albedo =
        (medium.sigma_s / medium.sigma_t.max(Vec3::splat(f32::MIN_POSITIVE))).max_element();
    let vertex = Vertex {
        found: Found {
            place: Asked::in_medium(x),
            light: Light::direct(lit),
            from: None,
        },
        leaving,
        carried,
        stretch,
        emitted: Vec3::ZERO,
    };
    let scatters = albedo > 0.0 && carried.iter().all(|c| c.is_finite());
    (vertex, scatters.then(|| (Ray::new(x, w_i), albedo)))
}

/// A direction by the phase function or any direction; all are `alike` where media scatter so.
fn onward_direction(medium: &MediumPoint<'_>, alike: bool, w_o: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    if alike {
        return warp::uniform_sphere([u, v]);
    }
    if u < UNEVEN {
        return medium.sample_phase(w_o, [u / UNEVEN, v]).0;
    }
    let u = ((u - UNEVEN) / (1.0 - UNEVEN)).min(1.0 - f32::EPSILON);
    warp::uniform_sphere([u, v])
}

fn on_surface<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    hit: &SurfaceHit,
    (w_o, stretch): (Vec3, Vec3),
    lights: LightNumbers,
    [u, v]: [f32; 2],
) -> (Vertex, Onward) {
    // Rough, so that no chance reflection of a light outshines a cell.
    let bsdf = hit.bsdf.roughened();
    let normal = bsdf.normal();
    let cosine = |w: Vec3| FRAC_1_PI * normal.dot(w).max(0.0);
    let (mut lit, mut leaving) = (Vec3::ZERO, Vec3::ZERO);
    for s in direct::from_all(world, hit.position, Some(hit), lights) {
        lit += s.radiance * cosine(s.w_i);
        leaving += s.radiance * bsdf.eval(w_o, s.w_i);
    }
    // Gloss asks for directions of its own; half of them keep to the cosine, which bounds the weight of irradiance.
    let gloss = if bsdf.is_lambert() { 0.0 } else { 0.5 };
    let w_i = if u < gloss {
        // The number that chose the light may choose the lobe: the two ways of light only add up.
        bsdf.sample(w_o, lights.choice, [u / gloss, v])
            .map(|s| s.w_i)
    } else {
        let u = ((u - gloss) / (1.0 - gloss)).min(1.0 - f32::EPSILON);
        let local = warp::cosine_hemisphere([u, v]);
        Some(Frame::from_normal(normal).to_world(local).normalize())
    };
    let onward = w_i.filter(|w_i| w_i.dot(hit.normal) > 0.0 && w_i.dot(normal) > 0.0);
    let carried = onward.map_or([Vec3::ZERO; 2], |w_i| {
        let mut pdf = (1.0 - gloss) * cosine(w_i);
        if gloss > 0.0 {
            pdf += gloss * bsdf.pdf(w_o, w_i);
        }
        [Vec3::splat(cosine(w_i) / pdf), bsdf.eval(w_o, w_i) / pdf]
    });
    let vertex = Vertex {
        found: Found {
            place: Asked::on_surface(hit),
            light: Light::direct(lit),
            from: None,
        },
        leaving,
        carried,
        stretch,
        emitted: Vec3::ZERO,
    };
    let onward = onward.filter(|_| carried.iter().all(|c| c.is_finite()));
    let [_, reflected] = carried;
    (
        vertex,
        onward.map(|w_i| (hit.spawn(w_i), reflected.max_element())),
    )
}
