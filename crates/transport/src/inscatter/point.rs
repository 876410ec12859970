//! A point at which light is scattered, and samples of the light that comes there straight from emitters.

use super::GRAZING;
use super::light_cells::{LightCells, SeenLight};
use super::{Order, second_order};
use crate::light_choice::LightChoice;
use crate::occlusion::Seen;
use crate::single::{shadow_ray, unoccluded};
use crate::world::{Geometry, LightSample, Lights, World};
use glam::{DMat3, Vec3};
use smallvec::SmallVec;
use std::f32::consts::PI;
use tyndall_math::{Key, Ray, Sampler};
use tyndall_media::{MediumPoint, PhaseValue};

/// A point of a world, prepared for samples of the light that it scatters once.
#[derive(Debug)]
pub struct Inscatter<'w, 'm, G, L> {
    pub(super) world: &'w World<'m, G, L>,
    pub(super) x: Vec3,
    pub(super) medium: MediumPoint<'m>,
    choice: LightChoice<'w>,
    /// Towards the eye; any direction where nothing depends on it.
    pub(super) w_o: Vec3,
    /// Weights all directions alike, whatever the medium does.
    pub(super) alike: bool,
}

/// One sample's value and derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) value: Vec3,
    pub(super) gradient: [Vec3; 3],
    pub(super) hessian: [DMat3; 3],
    /// Whether any of it comes from lights with extent.
    pub(super) extended: bool,
}

impl Sample {
    pub(super) const ZERO: Self = Self {
        value: Vec3::ZERO,
        gradient: [Vec3::ZERO; 3],
        hessian: [DMat3::ZERO; 3],
        extended: false,
    };
}

/// A direction drawn towards a light with extent, and what is seen there; `None` where the light sends nothing.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    pub(super) light: usize,
    pub(super) seen: Option<SeenLight>,
}

/// A light's cells are those of a batch's own samples where it is expected to get so many of them.
const OFTEN: f32 = 32.0;
/// Of the rarer lights one, chosen by chance, gets so many directions more.
const FRESH: usize = 64;

impl<'w, 'm, G: Geometry, L: Lights> Inscatter<'w, 'm, G, L> {
    /// For light that leaves `x` along the unit vector `towards`; `None` weights all directions alike.
    pub fn new(world: &'w World<'m, G, L>, x: Vec3, towards: Option<Vec3>) -> Self {
        let medium = world.media.at(x);
        let sigma = medium.sigma_t.element_sum() / 3.0;
        Self {
            world,
            x,
            choice: LightChoice::at(world.lights, x, None, sigma),
            w_o: towards.unwrap_or(Vec3::Y),
            alike: towards.is_none() || world.media.is_isotropic(),
            medium,
        }
    }

    /// An unbiased estimate of the light by sample number `i` of `key`; samples of one key are stratified.
    pub fn value(&self, key: Key, i: u64) -> Vec3 {
        self.sample(key, i, Order::Value, None).value
    }

    /// One sample towards a light and one by the phase function, weighted by the balance heuristic (Veach and Guibas 1995).
    ///
    /// Notes in `draws` what is seen of lights with extent.
    pub(super) fn sample(
        &self,
        key: Key,
        i: u64,
        order: Order,
        draws: Option<&mut Vec<Draw>>,
    ) -> Sample {
        let (mut sampler, choose, at_light) = Self::numbers(key, i);
        sampler.start_set(1);
        let by_phase = sampler.next_2d();
        let mut sum = Sample::ZERO;
        self.towards_light(choose, at_light, order, draws, &mut sum);
        if !self.alike && self.medium.sigma_s != Vec3::ZERO {
            self.by_phase(by_phase, order, &mut sum);
        }
        sum
    }

    /// The numbers that choose a light and a direction towards it.
    fn numbers(key: Key, i: u64) -> (Sampler, f32, [f32; 2]) {
        let mut sampler = Sampler::new(key, i);
        let [choose, _] = sampler.next_2d();
        let at_light = sampler.next_2d();
        (sampler, choose, at_light)
    }

    /// Density with which a direction is sampled by the phase function.
    fn phase_pdf(&self, w_i: Vec3) -> f32 {
        if self.alike {
            0.0
        } else {
            self.medium.phase_pdf(self.w_o, w_i)
        }
    }

    /// The phase function for light from `w_i`, with its derivatives.
    pub(super) fn phase(&self, w_i: Vec3) -> PhaseValue {
        if self.alike {
            PhaseValue {
                value: Vec3::splat(0.25 / PI),
                slope: Vec3::ZERO,
                gradient: [Vec3::ZERO; 3],
            }
        } else {
            self.medium.phase(self.w_o, w_i)
        }
    }

    fn towards_light(
        &self,
        u: f32,
        v: [f32; 2],
        order: Order,
        draws: Option<&mut Vec<Draw>>,
        sum: &mut Sample,
    ) {
        let Some((light, chance)) = self.choice.sample(u) else {
            return;
        };
        let sample = self.world.lights.sample(light, self.x, v);
        let arrives = sample.as_ref().and_then(|s| self.arrives(s));
        if let Some(draws) = draws {
            let seen = sample.as_ref().and_then(|s| self.seen(s, arrives));
            draws.push(Draw { light, seen });
        }
        let (Some(mut s), Some(arrives)) = (sample, arrives) else {
            return;
        };
        let pdf = chance * s.pdf;
        let weight = if s.delta {
            1.0
        } else {
            pdf / (pdf + self.phase_pdf(s.w_i))
        };
        s.radiance *= weight / pdf;
        self.add(&s, Some(light), arrives, order, sum);
    }

    fn by_phase(&self, u: [f32; 2], order: Order, sum: &mut Sample) {
        let (w_i, pdf) = self.medium.sample_phase(self.w_o, u);
        let weight = |light: Option<usize>| {
            let other = light.map_or(0.0, |l| {
                self.choice.pdf(l) * self.world.lights.pdf(l, self.x, w_i)
            });
            1.0 / (pdf + other)
        };
        self.shining(w_i, |mut way, light| {
            way.radiance *= weight(light);
            if let Some(arrives) = self.arrives(&way) {
                self.add(&way, light, arrives, order, sum);
            }
        });
    }

    /// Tells what shines from `w_i`, with its light: the emitter met, or what is infinitely far away.
    pub(super) fn shining(&self, w_i: Vec3, mut found: impl FnMut(LightSample, Option<usize>)) {
        let mut found = |light, distance, radiance, normal, size| {
            let way = LightSample {
                w_i,
                distance,
                radiance,
                pdf: 1.0,
                delta: false,
                normal,
                size,
            };
            found(way, light);
        };
        let ray = Ray::new(self.x, w_i);
        match self.world.geometry.intersect(&ray, f32::INFINITY) {
            Some(hit) => found(hit.light, hit.t, hit.emission, hit.normal, hit.size),
            None => {
                for &light in self.world.lights.environment() {
                    let radiance = self.world.lights.environment_radiance(light, w_i);
                    found(Some(light), f32::INFINITY, radiance, Vec3::ZERO, 0.0);
                }
            }
        }
    }

    /// Transmittance of `way`; `None` where there is no light or a surface stands between.
    pub(super) fn arrives(&self, way: &LightSample) -> Option<Vec3> {
        if !way.radiance.is_finite() || way.radiance == Vec3::ZERO {
            return None;
        }
        unoccluded(self.world, self.x, self.x, way)
    }

    /// Adds p T L of `way`, whose transmittance is `arrives`, with its derivatives.
    fn add(
        &self,
        way: &LightSample,
        light: Option<usize>,
        arrives: Vec3,
        order: Order,
        sum: &mut Sample,
    ) {
        if !way.radiance.is_finite() {
            return;
        }
        let phase = self.phase(way.w_i);
        let value = way.radiance * arrives * phase.value;
        sum.value += value;
        sum.extended |= !way.delta;
        if order == Order::Value {
            return;
        }
        let mut log_gradient = self.way_log_gradient(way, light);
        if !self.alike {
            // The direction turns by (1 − w_i w_iᵀ)/r while the emitter's point stays.
            let d_mu = (self.w_o - self.w_o.dot(way.w_i) * way.w_i) / way.distance;
            for (c, sum) in log_gradient.iter_mut().enumerate() {
                if phase.value[c] > 0.0 {
                    *sum += (d_mu * phase.slope[c] + phase.gradient[c]) / phase.value[c];
                }
            }
        }
        for (c, sum) in sum.gradient.iter_mut().enumerate() {
            *sum += log_gradient[c] * value[c];
        }
        if order == Order::Hessian {
            let hessian = second_order::hessian(self, way, light);
            for (sum, h) in sum.hessian.iter_mut().zip(hessian) {
                *sum += h;
            }
        }
    }

    /// ∇ ln(T H): H = cosθ/r² for a point of a surface, I/r² for a lamp without extent, 1 for light from far away.
    ///
    /// At grazing incidence, cosθ below [`GRAZING`], its gradient is bounded.
    fn way_log_gradient(&self, way: &LightSample, light: Option<usize>) -> [Vec3; 3] {
        let media = self.world.media;
        if way.distance.is_infinite() {
            let ray = Ray::new(self.x, way.w_i);
            let (_, tau) = media.optical_depth_gradient_rigid(&ray, f32::INFINITY);
            return tau.map(|d| -d);
        }
        let r = way.distance;
        let tau = media.optical_depth_gradient(self.x, self.x + way.w_i * r);
        let geometry = if way.delta {
            let falloff = light.map_or(Vec3::ZERO, |l| {
                let ln_intensity = self.world.lights.ln_intensity(l, self.x.as_dvec3());
                ln_intensity.gradient.as_vec3()
            });
            2.0 * way.w_i / r + falloff
        } else {
            let cosine = (-way.normal.dot(way.w_i)).max(GRAZING);
            3.0 * way.w_i / r + way.normal / (r * cosine)
        };
        tau.d_a.map(|d| geometry - d)
    }

    /// What is seen towards `light`, whose transmittance is `arrives`; `None` for lamps without extent and for light from far away.
    fn seen(&self, light: &LightSample, arrives: Option<Vec3>) -> Option<SeenLight> {
        if light.delta
            || light.distance.is_infinite()
            || !light.radiance.is_finite()
            || light.radiance == Vec3::ZERO
        {
            return None;
        }
        let seen = match arrives {
            Some(transmittance) => Seen::light(self.x, light, light.radiance * transmittance),
            None => {
                let (ray, t_max) = shadow_ray(self.x, self.x, light)?;
                let hit = self.world.geometry.intersect(&ray, t_max)?;
                Seen::new(light.w_i, Some(hit), SmallVec::new())
            }
        };
        Some(SeenLight {
            seen,
            pdf: light.pdf,
        })
    }

    /// What moving silhouettes add to the gradient of a batch of `n` samples of `key` that have drawn `draws`.
    ///
    /// Lights that are drawn often have their cells among these; of the others one, chosen by its chance among them and weighted
    /// by the inverse, is drawn from anew.
    pub(super) fn silhouettes(&self, key: Key, n: usize, mut draws: Vec<Draw>) -> [Vec3; 3] {
        let often = |light: usize| self.choice.pdf(light) * n as f32 >= OFTEN;
        let mut sum = [Vec3::ZERO; 3];
        let mut add = |draws: &[Draw], weight: f32| {
            let moved = LightCells::new(draws).gradient(self.x, |w_i: Vec3| self.phase(w_i).value);
            for (sum, moved) in sum.iter_mut().zip(moved) {
                *sum += moved * weight;
            }
        };
        draws.sort_by_key(|draw| draw.light);
        for draws in draws.chunk_by(|a, b| a.light == b.light) {
            if often(draws[0].light) {
                add(draws, 1.0);
            }
        }
        let (mut light, mut rare) = (None, 0.0);
        let mut sampler = Sampler::new(key, n as u64).branch(1);
        for l in (0..self.world.lights.count()).filter(|&l| !often(l)) {
            // Each takes the place of those before by its share of the sum: one pass, one choice.
            let chance = self.choice.pdf(l);
            rare += chance;
            if sampler.next_1d() * rare < chance {
                light = Some((l, chance));
            }
        }
        if let Some((light, chance)) = light {
            let draws: Vec<Draw> = (n..n + FRESH)
                .map(|i| {
                    let (_, _, v) = Self::numbers(key, i as u64);
                    let sample = self.world.lights.sample(light, self.x, v);
                    let seen = sample.and_then(|s| self.seen(&s, self.arrives(&s)));
                    Draw { light, seen }
                })
                .collect();
            add(&draws, rare / chance);
        }
        sum
    }
}
