//! Replicates of pixels and records, whose spread is the standard error.
//!
//! Samples within a replicate are stratified against each other; replicates are independent, so that z is what it says.

use super::world::{Lamps, Solids};
use super::{Budget, Row};
use glam::Vec3;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose, Ray, Sampler};
use tyndall_transport::gather::{self, Derivatives, GatherPattern, Towards};
use tyndall_transport::inscatter::{self, Order};
use tyndall_transport::layers::LayerVisitor;
use tyndall_transport::path::{FirstEvent, Reach, Start, trace};

/// The world of the benchmarks.
pub(super) type World<'a> = tyndall_transport::World<'a, Solids, Lamps>;

/// Independent replicates of each pixel.
const REPLICATES: usize = 256;
/// Independent records at each point.
const RECORDS: usize = 128;
/// Relative standard error aimed at.
const TARGET: f64 = 0.0045;
/// Share of the samples that a pilot run takes to learn how noisy a place is.
const PILOT: f64 = 0.1;
/// Least and largest factor by which a pilot changes the number of samples.
const FACTORS: [f64; 2] = [0.1, 4.0];
/// Relative error of f32 path tracing: positions, optical depths and sums of some ten factors.
pub(super) const ROUNDING: f64 = 3e-5;
/// The same for gradients, which are sums of terms of both signs.
const GRADIENT_ROUNDING: f64 = 3e-4;

impl Budget {
    /// This budget with as many samples as a pilot run says are needed. The pilot has random numbers of its own: its luck
    /// is not that of the run, which a rule for stopping would make it.
    fn after(&self, pilot: impl FnOnce(&Budget) -> (f64, f64)) -> Self {
        let (mean, error) = pilot(&Budget {
            seed: self.seed ^ 1 << 63,
            share: self.share * PILOT,
            ..*self
        });
        let [least, most] = FACTORS;
        let relative = error / mean.abs().max(f64::MIN_POSITIVE);
        // A quick run aims at less in proportion.
        let factor = (relative / TARGET).powi(2) * PILOT * self.share;
        let factor = if factor.is_nan() { 1.0 } else { factor };
        Self {
            share: self.share * factor.clamp(least, most),
            ..*self
        }
    }

    fn key(&self, replicate: usize) -> Key {
        Key {
            seed: self.seed,
            purpose: Purpose::Probe,
            index: (self.task << 32) | replicate as u64,
        }
    }
}

/// Colour channels to look at: their mean, or one of them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Channel {
    Mean,
    One(usize),
}

impl Channel {
    fn of(self, v: Vec3) -> f64 {
        match self {
            Channel::Mean => f64::from(v.element_sum()) / 3.0,
            Channel::One(c) => f64::from(v[c]),
        }
    }
}

/// Radiance of paths that start along `ray` of two random numbers, from `samples` paths in the full run, more or fewer where a
/// pilot run says that its error asks for them.
pub(super) fn pixel(
    world: &World<'_>,
    budget: &Budget,
    samples: usize,
    max_depth: Option<u32>,
    channel: Channel,
    ray: impl Fn([f32; 2]) -> Ray,
) -> Welford {
    let run = |budget: &Budget| {
        let n = (budget.samples(samples) / REPLICATES).max(1);
        let mut replicates = Welford::new();
        for replicate in 0..REPLICATES {
            let mut sum = 0.0;
            for i in 0..n {
                let mut sampler = Sampler::new(budget.key(replicate), i as u64);
                let start = Start {
                    ray: ray(sampler.next_2d()),
                    hit: None,
                    first: FirstEvent::Any,
                    reach: Reach::depth(max_depth),
                };
                let mut visitor = LayerVisitor::default();
                trace(world, &start, &mut sampler, &mut visitor);
                sum += channel.of(visitor.layers.beauty());
            }
            replicates.push(sum / n as f64);
        }
        replicates
    };
    run(&budget.after(|pilot| estimate(&run(pilot))))
}

/// Mean and standard error.
pub(super) fn estimate(replicates: &Welford) -> (f64, f64) {
    (replicates.mean(), replicates.standard_error())
}

/// What light to look at in a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    /// Light straight from emitters.
    Single,
    /// All other light.
    Multiple,
    /// All light.
    All,
}

/// A point at which light is gathered, and its exact value and gradient.
pub(super) struct Point {
    pub(super) x: Vec3,
    /// Towards the eye, `None` to weight all directions alike.
    pub(super) towards: Option<Vec3>,
    pub(super) light: Light,
    pub(super) value: f64,
    pub(super) gradient: [f64; 3],
}

/// The rows of one point: value, gradient along the exact gradient, and across it.
///
/// Each of the independent records takes `rays` directions in the full run, or more where a pilot run says that the value's error
/// asks for them; single scattering takes as many samples.
pub(super) fn point_rows(
    world: &World<'_>,
    budget: &Budget,
    (family, name): (&'static str, &str),
    rays: usize,
    point: &Point,
) -> Vec<Row> {
    let exact = glam::DVec3::from(point.gradient);
    let along = exact.normalize_or(glam::DVec3::Y);
    let across = along.any_orthonormal_vector();
    let run = |budget: &Budget| {
        let mut spread = [Welford::new(); 3];
        let rays = budget.samples(rays);
        let pattern = GatherPattern::new(rays);
        for replicate in 0..RECORDS {
            let key = budget.key(replicate);
            let (value, gradient) = measure(world, key, (rays, &pattern), point);
            let gradient = glam::DVec3::from(gradient);
            let numbers = [value, gradient.dot(along), gradient.dot(across)];
            for (spread, number) in spread.iter_mut().zip(numbers) {
                spread.push(number);
            }
        }
        spread
    };
    let asked = budget.after(|pilot| estimate(&run(pilot)[0]));
    // Never fewer than planned: gradients need them.
    let [value, slope, side] = &run(&Budget {
        share: asked.share.max(budget.share),
        ..*budget
    });
    let rounding = GRADIENT_ROUNDING * exact.length().max(point.value);
    vec![
        Row::random(
            family,
            format!("{name}: value"),
            estimate(value),
            point.value,
            ROUNDING * point.value,
        ),
        Row::random(
            family,
            format!("{name}: gradient"),
            estimate(slope),
            exact.length(),
            rounding,
        ),
        Row::random(
            family,
            format!("{name}: gradient across"),
            estimate(side),
            0.0,
            rounding,
        ),
    ]
}

/// Value and gradient at `point`, means of the colour channels.
fn measure(
    world: &World<'_>,
    key: Key,
    (rays, pattern): (usize, &GatherPattern),
    point: &Point,
) -> (f64, [f64; 3]) {
    let (mut value, mut gradient) = (0.0, [0.0; 3]);
    let mut add = |part: Vec3, slopes: [Vec3; 3]| {
        value += Channel::Mean.of(part);
        for (axis, sum) in gradient.iter_mut().enumerate() {
            *sum += Channel::Mean.of(Vec3::from(slopes.map(|s| s[axis])));
        }
    };
    if point.light != Light::Single {
        let g = gather::multiple_towards(
            world,
            point.x,
            point.towards.map(Towards::Direction),
            pattern,
            Derivatives::Aware,
            Reach::default(),
            key,
        );
        add(g.value, g.gradient);
    }
    if point.light != Light::Multiple {
        let asked = (Order::Gradient, Derivatives::Aware);
        let found = inscatter::single(world, point.x, point.towards, rays, asked, key);
        add(found.value, found.gradient);
    }
    (value, gradient)
}
