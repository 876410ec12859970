//! Light that media emit along a ray, sampled at one distance.
//!
//! Distances follow transmittance, and are spread evenly as well where the segment is finite, because a medium may emit
//! without attenuating.

use crate::free_flight::{FreeFlight, Stop};
use crate::world::World;
use glam::Vec3;
use tyndall_math::Ray;
use tyndall_media::MediumPoint;

/// Emission seen at one distance.
#[derive(Clone, Debug)]
pub struct EmissionSample<'m> {
    /// Distance along the ray.
    pub t: f32,
    /// T ε over the density of `t`, W/(m² sr).
    pub value: Vec3,
    /// The medium there.
    pub medium: MediumPoint<'m>,
}

/// Samples ∫ T ε dt along the segment of `flight`; `None` where nothing emits.
pub fn sample<'m, G, L>(
    world: &World<'m, G, L>,
    ray: &Ray,
    flight: &FreeFlight<'m>,
    u: f32,
) -> Option<EmissionSample<'m>> {
    if !world.media.emits() {
        return None;
    }
    let (stop, pdf) = distance(flight, u)?;
    let t = stop.t;
    let medium = world.media.at(ray.at(t));
    let value = stop.transmittance * medium.emission / pdf;
    (value.is_finite() && value != Vec3::ZERO).then_some(EmissionSample { t, value, medium })
}

/// A distance and its density per metre.
fn distance(flight: &FreeFlight<'_>, u: f32) -> Option<(Stop, f32)> {
    let (start, end) = flight.segment().range();
    let even = 1.0 / (end - start);
    let share = match (even > 0.0 && even.is_finite(), flight.can_stop()) {
        (true, true) => 0.5,
        (true, false) => 1.0,
        (false, true) => 0.0,
        (false, false) => return None,
    };
    let t = if u < share {
        start + (end - start) * (u / share)
    } else {
        flight.sample_inside((u - share) / (1.0 - share))?
    };
    let stop = flight.stop(t);
    let mut pdf = (1.0 - share)
        * if share < 1.0 {
            flight.pdf_inside(&stop)
        } else {
            0.0
        };
    if share > 0.0 {
        pdf += share * even;
    }
    Some((stop, pdf))
}
