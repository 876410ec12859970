//! Light that comes straight from emitters and is scattered at the point.
//!
//! ∇L = ∫ L ∇ ln(p T H) over the emitters' points, which stay where they are while the gather point moves (Jarosz, Donner,
//! Zwicker and Jensen 2008, "Radiance caching for participating media"): shadows are taken to stay too.

use super::{Part, Sample, average};
use glam::Vec3;
use tyndall_math::{Key, Ray, Sampler};
use tyndall_media::MediumPoint;
use tyndall_transport::light_choice::LightChoice;
use tyndall_transport::single::unoccluded;
use tyndall_transport::{Geometry, LightSample, Lights, World};

/// Single scattering at `x` towards `towards` (any direction where `None`), from `samples` samples.
///
/// The gradient leaves out that shadows move.
pub fn single<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Vec3>,
    samples: usize,
    key: Key,
) -> Part {
    let point = Point::new(world, x, towards);
    let [part] = average(samples, key, |key, i| [point.sample(key, i, true)]);
    part
}

/// A point at which light is scattered.
pub(super) struct Point<'w, 'm, G, L> {
    world: &'w World<'m, G, L>,
    x: Vec3,
    medium: MediumPoint<'m>,
    choice: LightChoice,
    /// Towards the eye; any direction where nothing depends on it.
    w_o: Vec3,
    /// Weights all directions alike, whatever the medium does.
    alike: bool,
}

/// The way from the point to where light is emitted.
struct Way {
    w_i: Vec3,
    distance: f32,
    /// Unit normal of the emitter, zero where it has none.
    normal: Vec3,
    /// Extent of the emitter in metres, 0 where it has no surface.
    size: f32,
    light: Option<usize>,
    delta: bool,
}

impl<'w, 'm, G: Geometry, L: Lights> Point<'w, 'm, G, L> {
    pub(super) fn new(world: &'w World<'m, G, L>, x: Vec3, towards: Option<Vec3>) -> Self {
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

    /// One sample towards a light and one by the phase function, weighted by the balance heuristic (Veach and Guibas 1995).
    pub(super) fn sample(&self, key: Key, i: u64, gradient: bool) -> Sample {
        let mut sampler = Sampler::new(key, i);
        let [choose, _] = sampler.next_2d();
        let at_light = sampler.next_2d();
        sampler.start_set(1);
        let by_phase = sampler.next_2d();
        let mut sum = Sample::default();
        self.towards_light(choose, at_light, gradient, &mut sum);
        if !self.alike && self.medium.sigma_s != Vec3::ZERO {
            self.by_phase(by_phase, gradient, &mut sum);
        }
        sum
    }

    /// Density with which a direction is sampled by the phase function.
    fn phase_pdf(&self, w_i: Vec3) -> f32 {
        if self.alike {
            0.0
        } else {
            self.medium.phase_pdf(self.w_o, w_i)
        }
    }

    fn towards_light(&self, u: f32, v: [f32; 2], gradient: bool, sum: &mut Sample) {
        let Some((light, chance)) = self.choice.sample(u) else {
            return;
        };
        let Some(s) = self.world.lights.sample(light, self.x, v) else {
            return;
        };
        let pdf = chance * s.pdf;
        let weight = if s.delta {
            1.0
        } else {
            pdf / (pdf + self.phase_pdf(s.w_i))
        };
        let way = Way {
            w_i: s.w_i,
            distance: s.distance,
            normal: s.normal,
            size: s.size,
            light: Some(light),
            delta: s.delta,
        };
        self.add(&way, s.radiance * (weight / pdf), gradient, sum);
    }

    fn by_phase(&self, u: [f32; 2], gradient: bool, sum: &mut Sample) {
        let (w_i, pdf) = self.medium.sample_phase(self.w_o, u);
        let weight = |light: Option<usize>| {
            let other = light.map_or(0.0, |l| {
                self.choice.pdf(l) * self.world.lights.pdf(l, self.x, w_i)
            });
            1.0 / (pdf + other)
        };
        let way = |light, distance, normal, size| Way {
            w_i,
            distance,
            normal,
            size,
            light,
            delta: false,
        };
        let ray = Ray::new(self.x, w_i);
        match self.world.geometry.intersect(&ray, f32::INFINITY) {
            Some(hit) if hit.emission != Vec3::ZERO => {
                let way = way(hit.light, hit.t, hit.normal, hit.size);
                self.add(&way, hit.emission * weight(hit.light), gradient, sum);
            }
            Some(_) => {}
            None => {
                for &light in self.world.lights.environment() {
                    let radiance = self.world.lights.environment_radiance(light, w_i);
                    let way = way(Some(light), f32::INFINITY, Vec3::ZERO, 0.0);
                    self.add(&way, radiance * weight(Some(light)), gradient, sum);
                }
            }
        }
    }

    /// Adds p T `radiance` and its gradient, unless a surface stands in the way.
    fn add(&self, way: &Way, radiance: Vec3, gradient: bool, sum: &mut Sample) {
        if !radiance.is_finite() || radiance == Vec3::ZERO {
            return;
        }
        let light = LightSample {
            w_i: way.w_i,
            distance: way.distance,
            radiance,
            pdf: 1.0,
            delta: way.delta,
            normal: way.normal,
            size: way.size,
        };
        let Some(arrives) = unoccluded(self.world, self.x, self.x, &light) else {
            return;
        };
        let phase = self.medium.phase(self.w_o, way.w_i);
        let weighted = if self.alike {
            Vec3::splat(0.25 * std::f32::consts::FRAC_1_PI)
        } else {
            phase.value
        };
        let value = radiance * arrives * weighted;
        sum.value += value;
        if !gradient {
            return;
        }
        let mut log_gradient = self.way_log_gradient(way);
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
    }

    /// ∇ ln(T H): H = cosθ/r² for a point of a surface, I/r² for a lamp without extent, 1 for light from far away.
    fn way_log_gradient(&self, way: &Way) -> [Vec3; 3] {
        let media = self.world.media;
        if way.distance.is_infinite() {
            let ray = Ray::new(self.x, way.w_i);
            let (_, tau) = media.optical_depth_gradient_rigid(&ray, f32::INFINITY);
            return tau.map(|d| -d);
        }
        let r = way.distance;
        let tau = media.optical_depth_gradient(self.x, self.x + way.w_i * r);
        let geometry = if way.delta {
            let falloff = way.light.map_or(Vec3::ZERO, |l| {
                self.world.lights.grad_ln_intensity(l, self.x)
            });
            2.0 * way.w_i / r + falloff
        } else {
            3.0 * way.w_i / r - way.normal / (r * way.normal.dot(way.w_i))
        };
        tau.d_a.map(|d| geometry - d)
    }
}
