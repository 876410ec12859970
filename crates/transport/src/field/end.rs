//! Ends a path on its present stretch: one place in the medium and the surface behind it tell all light that comes along the ray.
//!
//! What lies near is known too coarsely where light changes most: there, light straight from lights is sampled.

use super::{Field, FieldLight, Part};
use crate::direct;
use crate::free_flight::FreeFlight;
use crate::gather;
use crate::path::{Reach, Source, Vertex, Visitor, source};
use crate::single::SegmentLight;
use crate::world::{Geometry, Lights, SurfaceHit, World};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;
use tyndall_math::{Ray, Sampler};

/// The part of a path's numbers that stands in for what no cell knows.
const UNKNOWN: u64 = 0xf1e1d;

/// Light that leaves the medium at `x` in the direction `w_o` by one path, where no cell knows it.
fn traced<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    (x, w_o): (Vec3, Vec3),
    part: Part,
    sampler: &mut Sampler,
) -> FieldLight {
    let mut sampler = sampler.branch(UNKNOWN);
    let direct = match part {
        Part::Indirect => None,
        Part::All => direct::sample(world, x, None, sampler.next_1d(), sampler.next_2d()),
    };
    // Direct light is asked for only where media scatter alike in all directions.
    let direct = direct.map_or(Vec3::ZERO, |s| s.radiance * (0.25 * FRAC_1_PI));
    FieldLight {
        value: direct + gather::one(world, (x, w_o), Reach::default(), &mut sampler),
        gradient: [Vec3::ZERO; 3],
    }
}

/// A gradient over the value it belongs to, of either sign; 0 where there is no value.
fn relative(gradient: Vec3, value: f32) -> Vec3 {
    let relative = gradient / value;
    if relative.is_finite() {
        relative
    } else {
        Vec3::ZERO
    }
}

impl Field {
    /// Tells `visitor` the light that scatters in media along `ray` and on the surface it ends on; false, and nothing told, where the
    /// field knows too little of that surface, or where that is too `close` for cells to be read.
    ///
    /// Light straight from emitters and light that media emit is left to the caller.
    pub(crate) fn end<'m, G: Geometry, L: Lights>(
        &self,
        world: &World<'m, G, L>,
        (ray, hit): (&Ray, Option<&SurfaceHit>),
        flight: &FreeFlight<'m>,
        (throughput, close): (Vec3, bool),
        sampler: &mut Sampler,
        visitor: &mut impl Visitor,
    ) -> bool {
        let [u, choice] = sampler.next_2d();
        let reflected = match hit {
            None => None,
            Some(hit) => match self.surface(world.geometry, ray, hit, close) {
                None => return false,
                Some(known) => Some((hit, known)),
            },
        };
        let near = self.near(ray.origin);
        let mut tell = |value: Vec3, vertex: Vertex<'_, '_>, source: Source| {
            if value.is_finite() && value != Vec3::ZERO {
                visitor.light(throughput * value, Some(vertex), source);
            }
        };
        if flight.can_stop()
            && let Some(t) = flight.sample_inside(u)
        {
            let x = ray.at(t);
            let part = if t < near { Part::Indirect } else { Part::All };
            let medium = world.media.at(x);
            let w_o = -ray.direction;
            let light = match part {
                Part::All => self.medium(world.geometry, x, part),
                Part::Indirect => self.leaving(world.geometry, (x, &medium), w_o),
            };
            let light = light.unwrap_or_else(|| traced(world, (x, w_o), part, sampler));
            let stop = flight.stop(t);
            let value =
                stop.transmittance * medium.sigma_s * light.value / flight.pdf_inside(&stop);
            let log_gradient = std::array::from_fn(|c| relative(light.gradient[c], light.value[c]));
            tell(
                value,
                Vertex::Medium(x, &medium),
                Source::Scattered(log_gradient),
            );
            let flight = FreeFlight::new(
                world
                    .media
                    .segment(ray, near.min(flight.segment().range().1)),
                Vec3::ONE,
            );
            if let Some(lights) = SegmentLight::new(world, ray, &flight) {
                let (v, w) = (sampler.next_1d(), sampler.next_2d());
                if let Some(s) = lights.sample(world, choice, v, w) {
                    let x = ray.at(s.stop.t);
                    tell(s.value, Vertex::Medium(x, &s.medium), source(x, &s.light));
                }
            }
        }
        if let Some((hit, (radiance, part))) = reflected {
            let vertex = Vertex::Surface(hit.position, hit.normal);
            let arrives = flight.transmittance();
            tell(
                arrives * radiance,
                vertex,
                Source::Scattered([Vec3::ZERO; 3]),
            );
            if part == Part::Indirect
                && let Some(s) =
                    direct::sample(world, hit.position, Some(hit), choice, sampler.next_2d())
            {
                let value = arrives * hit.bsdf.eval(-ray.direction, s.w_i) * s.radiance;
                tell(value, vertex, source(hit.position, &s.light));
            }
        }
        true
    }
}
