//! Single scattering along a ray segment: light that reaches the segment straight from a light and is scattered once.
//!
//! A light is chosen for the whole segment, then the distance by a mixture of equiangular sampling around the light
//! (Kulla and Fajardo 2012), which cancels the pole of 1/r², and of sampling by transmittance.

use crate::free_flight::{FreeFlight, Stop};
use crate::light_choice::LightChoice;
use crate::world::{Geometry, LightSample, Lights, World};
use glam::Vec3;
use smallvec::SmallVec;
use tyndall_math::{Ray, offset_origin, warp::Equiangular};
use tyndall_media::{MediumPoint, transmittance};

/// Share of equiangular samples where the light is near enough to have a place.
pub(crate) const EQUIANGULAR_SHARE: f32 = 0.5;
/// With fewer probes a light is as well served by samples.
const LEAST_PROBES: f32 = 1.5;
/// On an endless segment the light is chosen for the part that lets through more than e⁻⁸ of the light in the clearest
/// channel.
const CHOICE_DEPTH: f32 = 8.0;

/// Samples single scattering on one segment.
#[derive(Clone, Debug)]
pub struct SegmentLight<'f, 'm> {
    ray: Ray,
    flight: &'f FreeFlight<'m>,
    choice: LightChoice<'m>,
    /// Lights that are left out here: shafts bring their light.
    taken: SmallVec<[usize; 4]>,
}

/// The density with which [`SegmentLight::sample`] would have found lights from one of its distances.
#[derive(Clone, Debug)]
pub struct DensityAt<'m> {
    ray: Ray,
    range: (f32, f32),
    choice: LightChoice<'m>,
    t: f32,
    by_transmittance: f32,
}

impl DensityAt<'_> {
    /// Density per metre of picking `light` and this distance.
    pub fn of<L: Lights>(&self, lights: &L, light: usize) -> f32 {
        let chance = self.choice.pdf(light);
        if chance <= 0.0 {
            return 0.0;
        }
        let (start, end) = self.range;
        chance
            * lights.pivot(light).map_or(self.by_transmittance, |pivot| {
                mixed(
                    &Equiangular::new(&self.ray, pivot, start, end),
                    self.t,
                    self.by_transmittance,
                )
            })
    }
}

/// Density per metre of a distance `t` from the two ways of picking one.
pub(crate) fn mixed(equiangular: &Equiangular, t: f32, by_transmittance: f32) -> f32 {
    EQUIANGULAR_SHARE * equiangular.pdf(t) + (1.0 - EQUIANGULAR_SHARE) * by_transmittance
}

/// Light scattered once on a segment.
#[derive(Clone, Debug)]
pub struct SegmentSample<'m> {
    /// Where on the ray the light is scattered.
    pub stop: Stop,
    /// T σs p L towards the ray's origin, over the sample's density.
    pub value: Vec3,
    /// The medium at that point.
    pub medium: MediumPoint<'m>,
    /// The way from there to the light.
    pub light: LightSample,
    /// Density per metre and steradian of this sample, all choices included.
    pub pdf: f32,
}

impl<'f, 'm> SegmentLight<'f, 'm> {
    /// Prepares for `ray`; `None` where nothing on it scatters or there is no light.
    pub fn new<G: Geometry, L: Lights>(
        world: &World<'m, G, L>,
        ray: &Ray,
        flight: &'f FreeFlight<'m>,
    ) -> Option<Self> {
        if !flight.can_stop() || world.lights.count() == 0 {
            return None;
        }
        let (start, end) = flight.segment().range();
        let end = if end.is_finite() {
            end
        } else {
            finite_end(flight)
        };
        let length = end - start;
        let depth = flight.segment().optical_depth(end).element_sum() / 3.0;
        let from = Ray::new(ray.at(start), ray.direction);
        Some(Self {
            ray: *ray,
            flight,
            choice: LightChoice::along(
                world.lights,
                &from,
                length,
                depth / length.max(f32::MIN_POSITIVE),
            ),
            taken: SmallVec::new(),
        })
    }

    /// Takes from the lights to sample those without extent that could bring much, and deals `probes` out to them in
    /// proportion, for [`Shafts`](crate::shafts::Shafts).
    ///
    /// Returned are the lights and how many probes each gets. A light with a place gets half as many for its share: its
    /// distances cost more, and its 1/r² leaves less of the ray where shadows matter. One that would get fewer than
    /// 1.5 of them even were lights with extent counted in stays with the samples.
    pub fn take_shafts<L: Lights>(
        &mut self,
        lights: &L,
        probes: u32,
    ) -> SmallVec<[(usize, u32); 4]> {
        let singles = |extended: bool| {
            let singles = self.choice.singles();
            singles.filter(move |&(light, _)| lights.has_extent(light) == extended)
        };
        // What is judged in clusters counts as lights without extent.
        let all = 1.0 - singles(true).map(|(_, chance)| chance).sum::<f32>();
        let taken: SmallVec<[(usize, u32); 4]> = singles(false)
            .filter_map(|(light, chance)| {
                let probes = match lights.pivot(light) {
                    Some(_) => 0.5 * probes as f32,
                    None => probes as f32,
                };
                (probes * chance >= LEAST_PROBES)
                    .then(|| (light, (probes * chance / all).round() as u32))
            })
            .collect();
        if !taken.is_empty() {
            self.taken.extend(taken.iter().map(|&(light, _)| light));
            self.choice = self.choice.without(&self.taken);
        }
        taken
    }

    /// Takes skies and environment images from the lights to sample: someone else brings their light.
    pub fn take_sky<L: Lights>(&mut self, lights: &L) {
        self.taken.extend_from_slice(lights.environment());
        self.choice = self.choice.without(&self.taken);
    }

    /// Whether lights are left for [`SegmentLight::sample`].
    pub fn has_lights<L: Lights>(&self, lights: &L) -> bool {
        self.taken.len() < lights.count()
    }

    /// The ray the segment lies on.
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// Flights along the segment.
    pub fn flight(&self) -> &FreeFlight<'m> {
        self.flight
    }

    /// The density with which lights are found from `stop`.
    pub fn density_at(self, stop: &Stop) -> DensityAt<'m> {
        DensityAt {
            ray: self.ray,
            range: self.flight.segment().range(),
            choice: self.choice,
            t: stop.t,
            by_transmittance: self.flight.pdf_inside(stop),
        }
    }

    /// Samples a light, a distance and a way to the light, and tests whether it is free.
    ///
    /// `u` picks the light, `v` the distance, `w` the direction.
    pub fn sample<G: Geometry, L: Lights>(
        &self,
        world: &World<'m, G, L>,
        u: f32,
        v: f32,
        w: [f32; 2],
    ) -> Option<SegmentSample<'m>> {
        let (light, chance) = self.choice.sample(u)?;
        if self.taken.contains(&light) {
            return None;
        }
        let (start, end) = self.flight.segment().range();
        let equiangular = world
            .lights
            .pivot(light)
            .map(|pivot| Equiangular::new(&self.ray, pivot, start, end));
        let t = match &equiangular {
            Some(equiangular) if v < EQUIANGULAR_SHARE => {
                equiangular.sample(v / EQUIANGULAR_SHARE).0
            }
            Some(_) => self
                .flight
                .sample_inside((v - EQUIANGULAR_SHARE) / (1.0 - EQUIANGULAR_SHARE))?,
            None => self.flight.sample_inside(v)?,
        };
        let scattered = Scattered::at(world, &self.ray, self.flight, t, light, w)?;
        let by_transmittance = self.flight.pdf_inside(&scattered.stop);
        let distance_pdf = equiangular
            .as_ref()
            .map_or(by_transmittance, |e| mixed(e, t, by_transmittance));
        let pdf = chance * distance_pdf * scattered.light.pdf;
        let value = scattered.over(pdf)?;
        let arrives = unoccluded(world, scattered.x, scattered.x, &scattered.light)?;
        Some(SegmentSample {
            stop: scattered.stop,
            value: value * arrives,
            medium: scattered.medium,
            light: scattered.light,
            pdf,
        })
    }
}

/// Light that is on its way to a point of a ray and scattered there towards the ray's origin, should nothing stand between.
#[derive(Clone, Debug)]
pub(crate) struct Scattered<'m> {
    pub(crate) stop: Stop,
    pub(crate) x: Vec3,
    pub(crate) medium: MediumPoint<'m>,
    pub(crate) light: LightSample,
    /// T σs p L.
    flux: Vec3,
}

impl<'m> Scattered<'m> {
    /// At distance `t`, along the direction that `w` picks towards `light`.
    pub(crate) fn at<G: Geometry, L: Lights>(
        world: &World<'m, G, L>,
        ray: &Ray,
        flight: &FreeFlight<'m>,
        t: f32,
        light: usize,
        w: [f32; 2],
    ) -> Option<Self> {
        let stop = flight.stop(t);
        if stop.transmittance.max_element() <= 0.0 {
            return None;
        }
        let x = ray.at(t);
        let medium = world.media.at(x);
        let light = world.lights.sample(light, x, w)?;
        let scattering = medium.scattering(-ray.direction, light.w_i);
        Some(Self {
            flux: stop.transmittance * scattering * light.radiance,
            stop,
            x,
            medium,
            light,
        })
    }

    /// T σs p L over a density; `None` where it is zero or not a number.
    pub(crate) fn over(&self, pdf: f32) -> Option<Vec3> {
        let value = self.flux / pdf;
        (value.is_finite() && value.max_element() > 0.0).then_some(value)
    }
}

/// A distance on an endless segment beyond which little light is scattered in any channel.
fn finite_end(flight: &FreeFlight<'_>) -> f32 {
    let total = flight.segment().total();
    (0..3)
        .filter(|&c| total[c] > 0.0)
        .filter_map(|c| {
            let depth = (0.999 * total[c]).min(CHOICE_DEPTH);
            flight.segment().distance_at(c, depth)
        })
        .fold(flight.segment().range().0, f32::max)
}

/// Transmittance from `p` to the light that `light` samples from there; `None` where a surface stands between.
///
/// `origin` is where the shadow ray starts: `p` itself in a medium, a little off the surface elsewhere. The ray is aimed anew
/// at the sampled point, moved off the light's own surface likewise, so that no light shades itself however near or far
/// from the world's origin it stands.
pub fn unoccluded<G: Geometry, L>(
    world: &World<'_, G, L>,
    origin: Vec3,
    p: Vec3,
    light: &LightSample,
) -> Option<Vec3> {
    passing(world, origin, p, light, Passes::AsItDoes)
}

/// How light passes through media.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Passes {
    /// Attenuated by all of them.
    AsItDoes,
    /// Attenuated down to 1/e and from there on all or none, by a number in [0, 1): right on average, and in thick smoke most ways need not
    /// be followed to their ends.
    ByChance(f32),
}

/// Optical depth behind which light passes by chance.
const CHANCE_DEPTH: f32 = 1.0;

/// As [`unoccluded`], of light that passes through media as said.
pub(crate) fn passing<G: Geometry, L>(
    world: &World<'_, G, L>,
    origin: Vec3,
    p: Vec3,
    light: &LightSample,
    passes: Passes,
) -> Option<Vec3> {
    let (ray, distance) = shadow_ray(origin, p, light)?;
    if world.geometry.occluded(&ray, distance) {
        return None;
    }
    if world.media.is_empty() {
        return Some(Vec3::ONE);
    }
    match passes {
        Passes::AsItDoes => Some(transmittance(world.media.optical_depth(&ray, distance))),
        Passes::ByChance(u) => {
            let end = CHANCE_DEPTH - (-u).ln_1p();
            let tau = world.media.optical_depth_until(&ray, distance, end);
            // By the clearest channel, so that the others are attenuated further.
            let beyond = (tau.min_element() - CHANCE_DEPTH).max(0.0);
            (beyond + CHANCE_DEPTH < end).then(|| transmittance(tau - beyond))
        }
    }
}

/// The ray from `origin` to the light that `light` samples from `p`, and how far surfaces on it count.
pub(crate) fn shadow_ray(origin: Vec3, p: Vec3, light: &LightSample) -> Option<(Ray, f32)> {
    if light.distance.is_infinite() {
        return Some((Ray::new(origin, light.w_i), light.distance));
    }
    let point = p + light.w_i * light.distance;
    let target = if light.normal == Vec3::ZERO {
        point
    } else {
        offset_origin(point, light.normal, light.size)
    };
    let distance = target.distance(origin);
    let direction = (target - origin).try_normalize()?;
    // Rounding of the distance itself.
    let distance = distance * (1.0 - 4.0 * f32::EPSILON);
    Some((Ray::new(origin, direction), distance))
}
