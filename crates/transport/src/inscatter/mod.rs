//! Light that comes straight from emitters and is scattered at one point: value, gradient and Hessian from the same samples.
//!
//! L(x, ω) = ∫ p Lᵣ V H dx′ over the points x′ of all emitters, with ∇p, ∇Lᵣ and ∇H evaluated together with p, Lᵣ and H
//! (Jarosz, Donner, Zwicker and Jensen 2008, "Radiance caching for participating media"):
//!
//! * p – phase function, 1/4π where all directions weigh alike;
//! * Lᵣ = L e^−τ – radiance reduced by the optical depth τ between the points;
//! * V – visibility;
//! * H – cosθ′/r² for a point of a surface, 1/r² for a lamp without extent (L is its intensity), 1 for light from far away.
//!
//! Emitters stay where they are while x moves; light from far away moves with it. Shadows that move are in the gradient where
//! [`Derivatives::Aware`] asks for them (silhouettes of what stands before lights with extent at a finite distance), never in the Hessian. Lamps
//! without extent have hard shadows, which no derivative at a point knows of.

mod edges;
mod light_cells;
mod point;
mod second_order;

pub use point::Inscatter;

use crate::batches::in_batches;
use crate::gather::Derivatives;
use crate::world::{Geometry, Lights, World};
use glam::{DMat3, Vec3};
use point::{Draw, Sample};
use tyndall_math::Key;
use tyndall_math::stats::Welford;

/// Emitters are taken to be seen at no smaller cosine than this where a logarithmic derivative divides by it: what is seen more edge-on
/// than f32 directions can tell.
const GRAZING: f32 = 1e-6;

/// Up to which derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Order {
    /// The value alone.
    Value,
    /// Value and gradient.
    #[default]
    Gradient,
    /// Value, gradient and Hessian.
    Hessian,
}

/// Single scattering at one point.
#[derive(Clone, Copy, Debug)]
pub struct Inscattered {
    /// ∫ p L dω per colour channel, W/(m² sr).
    pub value: Vec3,
    /// Its gradient per metre, one vector per channel; zero unless asked for.
    pub gradient: [Vec3; 3],
    /// Its Hessian per square metre, one symmetric matrix per channel; `None` unless asked for, and where there is none.
    pub hessian: Option<[DMat3; 3]>,
    /// Standard error of the value.
    pub value_error: Vec3,
    /// Standard error of each component of the gradient.
    pub gradient_error: [Vec3; 3],
    /// Mean over the samples of ‖∇L‖, summed over channels, per metre, without silhouettes: gradients that cancel in the sum do not
    /// cancel here.
    pub gradient_norm: f32,
    /// Standard error of each entry of the Hessian, where there is one.
    pub hessian_error: Option<[DMat3; 3]>,
}

/// Light scattered once at `x` towards `towards` (weighting all directions alike where `None`), from `samples` samples.
///
/// Value and its error do not depend on `order` and `derivatives`. The Hessian knows of the kinks that boxes of medium and the base of a
/// height fog make; on the base it is that from above. It has shadows stay, and leaves out that the limb of a curved emitter moves
/// (emitters made of flat pieces have none). There is none for light with extent outside of a ball of medium, whose limb no sample knows.
pub fn single<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Vec3>,
    samples: usize,
    (order, derivatives): (Order, Derivatives),
    key: Key,
) -> Inscattered {
    let point = Inscatter::new(world, x, towards);
    let aware = order >= Order::Gradient && derivatives == Derivatives::Aware;
    let edges = (order == Order::Hessian).then(|| world.media.edges(x));
    let mut extended = false;
    let spread = in_batches(samples, key, |key, n| {
        let mut mean = [0.0; NUMBERS + 1];
        let mut draws: Option<Vec<Draw>> = aware.then(Vec::new);
        for i in 0..n {
            let i = i as u64;
            let mut sample = point.sample(key, i, order, draws.as_mut());
            if let Some(edges) = &edges {
                edges::add(&point, edges, (key, i), &mut sample);
            }
            add(&mut mean, &sample, order, 1.0 / n as f64);
            let norms = sample.gradient.map(Vec3::length);
            mean[NUMBERS] += f64::from(norms.iter().sum::<f32>()) / n as f64;
            extended |= sample.extended;
        }
        if let Some(draws) = draws {
            let moved = Sample {
                gradient: point.silhouettes(key, n, draws),
                ..Sample::ZERO
            };
            add(&mut mean, &moved, Order::Gradient, 1.0);
        }
        mean
    });
    let vector = |k: usize, f: fn(&Welford) -> f64| {
        Vec3::from([0, 1, 2].map(|axis| f(&spread[3 * k + axis]) as f32))
    };
    let known = order == Order::Hessian && !(extended && world.media.has_limb_from(x));
    let hessian = |f: fn(&Welford) -> f64| {
        let matrix =
            |c: usize| DMat3::from_cols_array(&std::array::from_fn(|k| f(&spread[12 + 9 * c + k])));
        known.then(|| [0, 1, 2].map(matrix))
    };
    Inscattered {
        value: vector(0, Welford::mean),
        gradient: [1, 2, 3].map(|k| vector(k, Welford::mean)),
        hessian: hessian(Welford::mean),
        value_error: vector(0, Welford::standard_error),
        gradient_error: [1, 2, 3].map(|k| vector(k, Welford::standard_error)),
        gradient_norm: spread[NUMBERS].mean() as f32,
        hessian_error: hessian(Welford::standard_error),
    }
}

/// Of a sample: value, gradient and Hessian by channel; the norm of its gradient follows them.
const NUMBERS: usize = 3 + 9 + 27;

/// Adds the numbers of a sample; f64 because thousands of terms of both signs are added.
fn add(sums: &mut [f64; NUMBERS + 1], sample: &Sample, order: Order, weight: f64) {
    let (slopes, curvatures) = sums[..NUMBERS].split_at_mut(12);
    let vectors = [sample.value].into_iter().chain(sample.gradient);
    for (sum, number) in slopes.iter_mut().zip(vectors.flat_map(|v| v.to_array())) {
        *sum += f64::from(number) * weight;
    }
    if order == Order::Hessian {
        let numbers = sample.hessian.iter().flat_map(DMat3::to_cols_array);
        for (sum, number) in curvatures.iter_mut().zip(numbers) {
            *sum += number * weight;
        }
    }
}
