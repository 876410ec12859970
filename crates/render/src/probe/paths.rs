//! The ground truth at a point: paths for the value, and central differences of them for the gradient.
//!
//! Paths on both sides of the point share their random numbers, so that most of their noise cancels in the difference.

use super::Part;
use glam::Vec3;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Ray, Sampler};
use tyndall_transport::batches::in_batches;
use tyndall_transport::gather::{self, GatherDirections};
use tyndall_transport::inscatter::Inscatter;
use tyndall_transport::path::Reach;
use tyndall_transport::{Geometry, Lights, World};

/// The step of the differences as a share of the length over which light changes: its square is their relative error.
const STEP: f32 = 0.02;
/// Surfaces are looked for in so many directions.
const LOOKS: u64 = 64;

/// Single and multiple scattering at `x` towards `towards` (any direction where `None`), from `samples` paths.
///
/// `max_depth` counts the scattering at `x` itself.
pub fn by_paths<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Vec3>,
    samples: usize,
    max_depth: Option<u32>,
    key: Key,
) -> (Part, Part) {
    let step = STEP * length(world, x, key);
    let here = Place::new(world, x, towards, max_depth);
    let around = Vec3::AXES
        .map(|axis| [step, -step].map(|h| Place::new(world, x + h * axis, towards, max_depth)));
    let spread = in_batches(samples, key, |key, n| {
        let mut sums = [0.0; 2 * NUMBERS];
        for i in 0..n as u64 {
            let mut parts = here.sample(key, i).map(|value| [value; 4]);
            for (axis, [ahead, behind]) in around.iter().enumerate() {
                let (ahead, behind) = (ahead.sample(key, i), behind.sample(key, i));
                for (part, (a, b)) in parts.iter_mut().zip(ahead.into_iter().zip(behind)) {
                    let slope = (a - b) / (2.0 * step);
                    for (c, gradient) in part[1..].iter_mut().enumerate() {
                        gradient[axis] = slope[c];
                    }
                }
            }
            let numbers = parts.iter().flatten().flat_map(|v| v.to_array());
            for (sum, number) in sums.iter_mut().zip(numbers) {
                *sum += f64::from(number);
            }
        }
        sums.map(|sum| sum / n as f64)
    });
    let (single, multiple) = spread.split_at(NUMBERS);
    (part(single), part(multiple))
}

/// Of a part: the value, then its gradient by channel.
const NUMBERS: usize = 3 + 9;

fn part(spread: &[Welford]) -> Part {
    let triple = |k: usize, f: fn(&Welford) -> f64| [0, 1, 2].map(|i| f(&spread[3 * k + i]) as f32);
    Part {
        value: triple(0, Welford::mean),
        stderr: triple(0, Welford::standard_error),
        gradient: [1, 2, 3].map(|k| triple(k, Welford::mean)),
        gradient_stderr: [1, 2, 3].map(|k| triple(k, Welford::standard_error)),
        hessian: None,
        hessian_stderr: None,
    }
}

/// The length over which light may change at `x`: to the nearest surface, lamp or boundary, or a free path; 1 m without any.
fn length<G: Geometry, L: Lights>(world: &World<'_, G, L>, x: Vec3, key: Key) -> f32 {
    let directions = GatherDirections::new(world, x, None);
    let surface = (0..LOOKS)
        .filter_map(|i| {
            let w = directions.sample(Sampler::new(key, i).next_2d()).w_i;
            world.geometry.intersect(&Ray::new(x, w), f32::INFINITY)
        })
        .map(|hit| hit.t)
        .fold(f32::INFINITY, f32::min);
    let sigma = world.media.at(x).sigma_t.max_element();
    let shortest = surface
        .min(world.lights.distance_to_point_lights(x))
        .min(world.media.distance_to_boundary(x))
        .min(1.0 / sigma);
    // Never below what f32 coordinates can tell apart.
    let least = 1e3 * f32::EPSILON * x.abs().max_element().max(f32::MIN_POSITIVE.sqrt());
    if shortest.is_finite() {
        shortest.max(least / STEP)
    } else {
        1.0
    }
}

/// A point from which paths start.
struct Place<'w, 'm, G, L> {
    world: &'w World<'m, G, L>,
    x: Vec3,
    point: Inscatter<'w, 'm, G, L>,
    directions: GatherDirections<'m>,
    max_depth: Option<u32>,
}

impl<'w, 'm, G: Geometry, L: Lights> Place<'w, 'm, G, L> {
    fn new(
        world: &'w World<'m, G, L>,
        x: Vec3,
        towards: Option<Vec3>,
        max_depth: Option<u32>,
    ) -> Self {
        Self {
            world,
            x,
            point: Inscatter::new(world, x, towards),
            directions: GatherDirections::new(world, x, towards),
            max_depth,
        }
    }

    /// Single and multiple scattering by one path.
    fn sample(&self, key: Key, i: u64) -> [Vec3; 2] {
        let mut sampler = Sampler::new(key, i);
        let multiple = gather::one_of(
            &self.directions,
            self.world,
            self.x,
            Reach::depth(self.max_depth),
            &mut sampler,
        );
        [self.point.value(key, i), multiple]
    }
}
