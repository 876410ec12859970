//! Unbiased volumetric path tracing, one path at a time.
//!
//! Light is looked for at every vertex and along every segment (next-event estimation) and by the path itself, weighted
//! by multiple importance sampling. A [`Visitor`] sees every contribution and decides where it belongs.

use crate::emission;
use crate::field::Field;
use crate::free_flight::FreeFlight;
use crate::lamp_directions::LampDirections;
use crate::light_choice::LightChoice;
use crate::single::{DensityAt, SegmentLight, unoccluded};
use crate::world::{Geometry, LightSample, Lights, SurfaceHit, World};
use glam::Vec3;
use tyndall_math::{Ray, Sampler};
use tyndall_media::{MediumPoint, transmittance};

/// Sets of four sample dimensions each stretch of a path owns; the camera owns the first.
const SETS_PER_STRETCH: u32 = 3;
/// Scattering events before Russian roulette may end a path.
const ROULETTE_AFTER: u32 = 3;
/// Paths are put at risk once their throughput is below the inverse of this. At 1 the relative variance of a pixel of the
/// shipped Cornell box was 3.9 a sample, at 4 (with the power heuristic) 2.9, for 1.2 times the time (2026-11-22).
const ROULETTE_GAIN: f32 = 4.0;
/// Smallest chance of survival: bounds the weight a survivor gains.
const SURVIVAL_MIN: f32 = 0.1;
/// A path that keeps its throughput for ever (albedo 1 without a way out) is ended at this rate after [`LONG_PATH`] events.
const LONG_SURVIVAL: f32 = 0.98;
const LONG_PATH: u32 = 128;

/// Share of directions that pass close to lamps, after scattering in a medium and at a surface in fog.
const LAMP_SHARE_MEDIUM: f32 = 0.5;
const LAMP_SHARE_SURFACE: f32 = 0.25;

/// A field is read where scatterings leave less than this of the first band of directions that it does not hold. Cornell box with g = 0.7
/// and light from above: `multiple` 4.4 % too bright with 0.06, 1.5 % with 0.004, and no better with 0.0005 (2026-11-23).
const SHARPNESS: f32 = 0.004;

/// Where a path scattered.
#[derive(Clone, Copy, Debug)]
pub enum Vertex<'v, 'm> {
    /// In a medium.
    Medium(Vec3, &'v MediumPoint<'m>),
    /// On a surface: position and unit geometric normal.
    Surface(Vec3, Vec3),
}

/// Where a contribution's light comes from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// A point on a light and the unit normal of the emitter there, zero for a point light.
    Point(Vec3, Vec3),
    /// Infinitely far away in this unit direction.
    Far(Vec3),
    /// The medium itself emits where the path ends.
    Medium,
    /// The last vertex scatters light whose way is not followed; how that light changes when the vertex moves, per metre and as a
    /// share of it, by colour channel.
    Scattered([Vec3; 3]),
}

/// How far paths are followed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reach<'f> {
    /// Most scattering events between light and the start of the path; `None` for no limit.
    pub max_depth: Option<u32>,
    /// Light behind the first scattering that need not be followed; asked only where depth has no limit.
    pub field: Option<&'f Field>,
}

impl Reach<'_> {
    /// Paths of at most `max_depth` scattering events, or of any number.
    pub fn depth(max_depth: Option<u32>) -> Self {
        Self {
            max_depth,
            field: None,
        }
    }

    /// What is left of it behind one scattering.
    pub(crate) fn behind_one(self) -> Self {
        Self {
            max_depth: self.max_depth.map(|d| d.saturating_sub(1)),
            ..self
        }
    }
}

/// Receives a path's vertices and what it gathers.
pub trait Visitor {
    /// The path scattered at `vertex` and goes on from there.
    fn vertex(&mut self, vertex: Vertex<'_, '_>);

    /// `value` arrives at the start of the path from `source` after the path's vertices so far and, where given, one more
    /// vertex `last` beside the path.
    fn light(&mut self, value: Vec3, last: Option<Vertex<'_, '_>>, source: Source);
}

/// What a path's first stretch may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstEvent {
    /// Scatter or pass as chance has it.
    Any,
    /// Reach the surface: what media do on the first stretch is attenuation alone.
    Surface,
    /// Scatter in a medium; single scattering on the first stretch is left to the caller.
    Medium,
}

/// A path about to start.
#[derive(Clone, Copy, Debug)]
pub struct Start<'f> {
    /// First stretch of the path, towards the scene.
    pub ray: Ray,
    /// The surface `ray` meets, where the caller knows it already.
    pub hit: Option<Option<SurfaceHit>>,
    /// What the first stretch may do.
    pub first: FirstEvent,
    /// How far it goes.
    pub reach: Reach<'f>,
}

/// How the last vertex could also have found a light, for multiple importance sampling.
enum Rival<'l> {
    /// The path has just started: nothing else looks for lights from here.
    None,
    /// Next-event estimation at a surface.
    Surface { choice: LightChoice<'l>, pdf: f32 },
    /// Next-event estimation along the segment on which the vertex lies.
    Segment {
        density: DensityAt<'l>,
        /// Density of the path's own way: free flight times phase function.
        pdf: f32,
    },
}

impl Rival<'_> {
    /// Weight of finding `light` in direction `w_i` from `p` by the path's own sampling (power heuristic).
    fn weight<L: Lights>(&self, lights: &L, light: usize, p: Vec3, w_i: Vec3) -> f32 {
        let (own, other) = match self {
            Rival::None => return 1.0,
            Rival::Surface { choice, pdf } => (*pdf, choice.pdf(light)),
            Rival::Segment { density, pdf } => (*pdf, density.of(lights, light)),
        };
        if other <= 0.0 {
            return 1.0;
        }
        power_heuristic(own, other * lights.pdf(light, p, w_i))
    }
}

/// Power heuristic with exponent 2 (Veach and Guibas 1995): light sampling is much the better way to most lights here,
/// and the square keeps the rare luckless hit from shining through.
fn power_heuristic(own: f32, other: f32) -> f32 {
    // Infinite densities occur (a lamp on the ray); the other way then never loses.
    let ratio = other / own;
    if own.is_infinite() {
        1.0
    } else {
        1.0 / (1.0 + ratio * ratio)
    }
}

/// Traces one path and tells `visitor` all light it finds.
pub fn trace<'m, G: Geometry, L: Lights>(
    world: &World<'m, G, L>,
    start: &Start<'_>,
    sampler: &mut Sampler,
    visitor: &mut impl Visitor,
) {
    let mut ray = start.ray;
    let mut known_hit = start.hit;
    let mut throughput = Vec3::ONE;
    let mut rival = Rival::None;
    let mut first = start.first;
    let mut events = 0;
    // Whether the last scattering blurs what lies beyond it, so that cells of light do not show; and whether a field was too coarse once.
    let (mut blurred, mut refused) = (true, false);
    // How much the scatterings so far leave of the finest directions that the field does not hold: paths start behind one.
    let unheld = start.reach.field.map_or(0.0, Field::unheld);
    let mut sharpness = unheld;
    let may_scatter = |events: u32| start.reach.max_depth.is_none_or(|max| events < max);

    loop {
        sampler.start_set(1 + events * SETS_PER_STRETCH);
        let hit = known_hit
            .take()
            .unwrap_or_else(|| world.geometry.intersect(&ray, f32::INFINITY));
        let t_max = hit.map_or(f32::INFINITY, |h| h.t);
        let flight = FreeFlight::new(world.media.segment(&ray, t_max), throughput);

        // Emitters the path itself meets: attenuated, never left to the chance of passing.
        if first != FirstEvent::Medium {
            let seen = throughput * flight.transmittance();
            match &hit {
                Some(hit) => seen_surface(world, &ray, hit, seen, &rival, visitor),
                None => seen_environment(world, &ray, seen, &rival, visitor),
            }
        }

        if let (Some(field), FirstEvent::Any, None) = (
            start
                .reach
                .field
                .filter(|_| blurred && sharpness * unheld <= SHARPNESS),
            first,
            start.reach.max_depth,
        ) {
            // Light that media emit is sampled; all that scatters on the stretch or at its end is read.
            let end = (&ray, hit.as_ref());
            if field.end(world, end, &flight, (throughput, refused), sampler, visitor) {
                emitted(world, &ray, &flight, throughput, sampler.next_1d(), visitor);
                return;
            }
            refused = true;
        }
        let lights = if first == FirstEvent::Any && !flight.segment().is_empty() {
            let [u, v] = sampler.next_2d();
            let w = sampler.next_2d();
            emitted(world, &ray, &flight, throughput, v, visitor);
            let lights = SegmentLight::new(world, &ray, &flight);
            if let (Some(lights), true) = (&lights, may_scatter(events)) {
                scattered_once(world, lights, throughput, (u, v, w), visitor);
            }
            lights
        } else {
            None
        };
        if !may_scatter(events) {
            return;
        }

        sampler.start_set(2 + events * SETS_PER_STRETCH);
        let [free, lobe] = sampler.next_2d();
        let direction = sampler.next_2d();
        let stop = match first {
            FirstEvent::Any => flight.sample(free),
            FirstEvent::Surface => None,
            FirstEvent::Medium if flight.can_stop() => flight.sample_inside(free),
            FirstEvent::Medium => return,
        };
        // Drawn from this stretch's own sets: a number that also chose the next light would bias that choice.
        let roulette;
        match (stop, &hit) {
            (Some(t), _) => {
                let x = ray.at(t);
                let stop = flight.stop(t);
                let medium = world.media.at(x);
                let w_o = -ray.direction;
                // There is no choice of lobes here.
                roulette = lobe;
                let lamps = lamps_in_fog(world.lights, x, &medium);
                let w_i = scattered_direction(&medium, &lamps, w_o, direction);
                let direction_pdf = direction_pdf(&medium, &lamps, w_o, w_i);
                let pdf = if first == FirstEvent::Medium {
                    flight.pdf_inside(&stop)
                } else {
                    flight.pdf(&stop)
                } * direction_pdf;
                throughput *= stop.transmittance * medium.scattering(w_o, w_i) / pdf;
                visitor.vertex(Vertex::Medium(x, &medium));
                rival = lights.map_or(Rival::None, |lights| Rival::Segment {
                    density: lights.density_at(&stop),
                    pdf,
                });
                blurred = true;
                sharpness *= unheld;
                ray = Ray::new(x, w_i);
            }
            (None, Some(hit)) => {
                throughput *= match first {
                    FirstEvent::Surface => flight.transmittance(),
                    _ => flight.transmittance() / flight.pass(),
                };
                visitor.vertex(Vertex::Surface(hit.position, hit.normal));
                let w_o = -ray.direction;
                sampler.start_set(3 + events * SETS_PER_STRETCH);
                let sigma = mean(world.media.at(hit.position).sigma_t);
                let choice = LightChoice::at(world.lights, hit.position, Some(hit.normal), sigma);
                let u;
                [u, roulette] = sampler.next_2d();
                let w = sampler.next_2d();
                let share = if sigma > 0.0 { LAMP_SHARE_SURFACE } else { 0.0 };
                let lamps = LampDirections::new(world.lights, hit.position, &choice, share, sigma);
                lit_surface(
                    world,
                    hit,
                    w_o,
                    (&choice, &lamps),
                    throughput,
                    (u, w),
                    visitor,
                );
                let Some(w_i) = reflected_direction(hit, &lamps, w_o, lobe, direction) else {
                    return;
                };
                let pdf = reflection_pdf(hit, &lamps, w_o, w_i);
                throughput *= hit.bsdf.eval(w_o, w_i) / pdf;
                rival = Rival::Surface { choice, pdf };
                blurred = !hit.bsdf.is_shiny();
                if blurred {
                    sharpness = 0.0;
                }
                ray = hit.spawn(w_i);
            }
            (None, None) => return,
        }
        first = FirstEvent::Any;
        events += 1;

        let strongest = throughput.max_element();
        if !strongest.is_finite() || strongest <= 0.0 {
            return;
        }
        if events > ROULETTE_AFTER {
            let limit = if events > LONG_PATH {
                LONG_SURVIVAL
            } else {
                1.0
            };
            let survival = (ROULETTE_GAIN * strongest).clamp(SURVIVAL_MIN, limit);
            if survival < 1.0 {
                if roulette >= survival {
                    return;
                }
                throughput /= survival;
            }
        }
    }
}

fn seen_surface<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    ray: &Ray,
    hit: &SurfaceHit,
    throughput: Vec3,
    rival: &Rival<'_>,
    visitor: &mut impl Visitor,
) {
    if hit.emission == Vec3::ZERO {
        return;
    }
    let weight = hit.light.map_or(1.0, |light| {
        rival.weight(world.lights, light, ray.origin, ray.direction)
    });
    visitor.light(
        throughput * hit.emission * weight,
        None,
        Source::Point(hit.position, hit.normal),
    );
}

fn seen_environment<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    ray: &Ray,
    throughput: Vec3,
    rival: &Rival<'_>,
    visitor: &mut impl Visitor,
) {
    for &light in world.lights.environment() {
        let radiance = world.lights.environment_radiance(light, ray.direction);
        let weight = rival.weight(world.lights, light, ray.origin, ray.direction);
        visitor.light(
            throughput * radiance * weight,
            None,
            Source::Far(ray.direction),
        );
    }
}

/// Tells `visitor` the light that comes straight along the first stretch of a path from skies and environment images.
pub(crate) fn straight_from_sky<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    start: &Start<'_>,
    visitor: &mut impl Visitor,
) {
    if let Some(None) = start.hit {
        let tau = world.media.optical_depth(&start.ray, f32::INFINITY);
        seen_environment(world, &start.ray, transmittance(tau), &Rival::None, visitor);
    }
}

/// Light that media emit on the stretch, found at one distance chosen by `u`.
fn emitted<'m, G: Geometry, L: Lights>(
    world: &World<'m, G, L>,
    ray: &Ray,
    flight: &FreeFlight<'m>,
    throughput: Vec3,
    u: f32,
    visitor: &mut impl Visitor,
) {
    if let Some(e) = emission::sample(world, ray, flight, u) {
        let vertex = Vertex::Medium(ray.at(e.t), &e.medium);
        visitor.light(throughput * e.value, Some(vertex), Source::Medium);
    }
}

/// Light that reaches the stretch straight from a light and is scattered into the path there.
fn scattered_once<'m, G: Geometry, L: Lights>(
    world: &World<'m, G, L>,
    lights: &SegmentLight<'_, 'm>,
    throughput: Vec3,
    (u, v, w): (f32, f32, [f32; 2]),
    visitor: &mut impl Visitor,
) {
    let Some(s) = lights.sample(world, u, v, w) else {
        return;
    };
    let x = lights.ray().at(s.stop.t);
    let weight = if s.light.delta {
        1.0
    } else {
        let lamps = lamps_in_fog(world.lights, x, &s.medium);
        let w_o = -lights.ray().direction;
        let own = lights.flight().pdf(&s.stop) * direction_pdf(&s.medium, &lamps, w_o, s.light.w_i);
        power_heuristic(s.pdf, own)
    };
    visitor.light(
        throughput * s.value * weight,
        Some(Vertex::Medium(x, &s.medium)),
        source(x, &s.light),
    );
}

/// Direct light on the surface the path has reached.
fn lit_surface<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    hit: &SurfaceHit,
    w_o: Vec3,
    (choice, lamps): (&LightChoice<'_>, &LampDirections),
    throughput: Vec3,
    (u, w): (f32, [f32; 2]),
    visitor: &mut impl Visitor,
) {
    let Some((light, chance)) = choice.sample(u) else {
        return;
    };
    let Some(s) = world.lights.sample(light, hit.position, w) else {
        return;
    };
    if s.w_i.dot(hit.normal) <= 0.0 {
        return;
    }
    let pdf = chance * s.pdf;
    let value = throughput * hit.bsdf.eval(w_o, s.w_i) * s.radiance / pdf;
    if !value.is_finite() || value.max_element() <= 0.0 {
        return;
    }
    let Some(arrives) = unoccluded(world, hit.spawn(s.w_i).origin, hit.position, &s) else {
        return;
    };
    let weight = if s.delta {
        1.0
    } else {
        power_heuristic(pdf, reflection_pdf(hit, lamps, w_o, s.w_i))
    };
    visitor.light(value * arrives * weight, None, source(hit.position, &s));
}

/// The lamps as seen from a point in a medium.
pub(crate) fn lamps_in_fog<L: Lights>(
    lights: &L,
    x: Vec3,
    medium: &MediumPoint<'_>,
) -> LampDirections {
    let sigma = mean(medium.sigma_t);
    let choice = LightChoice::at(lights, x, None, sigma);
    LampDirections::new(lights, x, &choice, LAMP_SHARE_MEDIUM, sigma)
}

fn mean(v: Vec3) -> f32 {
    v.element_sum() / 3.0
}

/// A direction by the phase function or around a lamp.
fn scattered_direction(
    medium: &MediumPoint<'_>,
    lamps: &LampDirections,
    w_o: Vec3,
    u: [f32; 2],
) -> Vec3 {
    if u[0] < lamps.share() {
        lamps.sample(u)
    } else {
        let rest = (u[0] - lamps.share()) / (1.0 - lamps.share());
        medium
            .sample_phase(w_o, [rest.min(1.0 - f32::EPSILON), u[1]])
            .0
    }
}

fn direction_pdf(medium: &MediumPoint<'_>, lamps: &LampDirections, w_o: Vec3, w_i: Vec3) -> f32 {
    (1.0 - lamps.share()) * medium.phase_pdf(w_o, w_i) + lamps.pdf(w_i)
}

/// A direction by reflection or around a lamp; `None` where it leads into the surface.
fn reflected_direction(
    hit: &SurfaceHit,
    lamps: &LampDirections,
    w_o: Vec3,
    lobe: f32,
    u: [f32; 2],
) -> Option<Vec3> {
    let w_i = if lobe < lamps.share() {
        lamps.sample([lobe, u[1]])
    } else {
        let rest = (lobe - lamps.share()) / (1.0 - lamps.share());
        hit.bsdf.sample(w_o, rest, u)?.w_i
    };
    (w_i.dot(hit.normal) > 0.0).then_some(w_i)
}

fn reflection_pdf(hit: &SurfaceHit, lamps: &LampDirections, w_o: Vec3, w_i: Vec3) -> f32 {
    (1.0 - lamps.share()) * hit.bsdf.pdf(w_o, w_i) + lamps.pdf(w_i)
}

pub(crate) fn source(p: Vec3, s: &LightSample) -> Source {
    if s.distance.is_finite() {
        Source::Point(p + s.w_i * s.distance, s.normal)
    } else {
        Source::Far(s.w_i)
    }
}
