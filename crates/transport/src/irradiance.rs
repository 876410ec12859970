//! What a cache record on a surface is made of: indirect irradiance, its gradient in the surface's plane and their standard errors.
//!
//! Directions by the cosine start paths; light straight from emitters is left out, because it is sampled where it is needed.

use crate::gather::{BATCHES, Batches, Gathered, batch_key, warp_radius};
use crate::path::{FirstEvent, Reach, Start, trace};
use crate::walls::Walls;
use crate::warp_translation::WarpVisitor;
use crate::world::{Geometry, Lights, SurfaceHit, World};
use tyndall_math::{Frame, Key, Ray, Sampler, warp};

/// Gathers indirect light at the surface point `hit` along `n_rays` directions, rounded up to a multiple of 16.
///
/// The value is irradiance over π, that is what a white Lambertian surface sends out, W/(m² sr). The gradient is for motion in the
/// surface's plane and takes visibility as constant (Jarosz, Zwicker and Jensen 2008, "Irradiance gradients in the presence of
/// participating media and occlusions", without the occlusions). `reach` counts the reflection at `hit`.
pub fn irradiance<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    hit: &SurfaceHit,
    n_rays: usize,
    reach: Reach<'_>,
    key: Key,
) -> Gathered {
    let normal = hit.bsdf.normal();
    let frame = Frame::from_normal(normal);
    let paths = n_rays.div_ceil(BATCHES).max(1);
    let sampler = |batch: usize, i: usize| Sampler::new(batch_key(key, batch), i as u64);
    let rays = (0..BATCHES).flat_map(|batch| {
        (0..paths).map(move |i| {
            let local = warp::cosine_hemisphere(sampler(batch, i).next_2d());
            (batch, i, frame.to_world(local).normalize_or(normal))
        })
    });
    let starts: Vec<(usize, usize, Ray, Option<SurfaceHit>)> = rays
        .filter(|(.., w_i)| w_i.dot(hit.normal) > 0.0)
        .map(|(batch, i, w_i)| {
            let ray = hit.spawn(w_i);
            (batch, i, ray, world.geometry.intersect(&ray, f32::INFINITY))
        })
        .collect();
    let hits = || starts.iter().filter_map(|(.., hit)| hit.as_ref());
    let nearest = hits().map(|hit| hit.t).fold(f32::INFINITY, f32::min);
    let inverse: f32 = hits().map(|hit| 1.0 / hit.t.max(f32::MIN_POSITIVE)).sum();
    let radius = warp_radius(world, hit.position, nearest);
    let mut batches = Batches::default();
    for &(batch, i, ray, met) in &starts {
        let start = Start {
            ray,
            hit: Some(met),
            first: FirstEvent::Any,
            reach: reach.behind_one(),
        };
        let mut visitor = WarpVisitor::on_surface(world.media, hit.position, radius, normal);
        trace(world, &start, &mut sampler(batch, i), &mut visitor);
        let in_plane = visitor.gradient.map(|g| g - normal * normal.dot(g));
        batches.add(batch, visitor.value, in_plane);
    }
    // Directions that the geometric normal hides bring nothing, and count.
    let share = starts.len() as f32 / (paths * BATCHES) as f32;
    let [value, dr, dg, db] = batches.means().map(|mean| mean * share);
    let [value_error, er, eg, eb] = batches.errors().map(|error| error * share);
    Gathered {
        value,
        gradient: [dr, dg, db],
        value_error,
        gradient_error: [er, eg, eb],
        nearest,
        harmonic_mean_distance: starts.len() as f32 / inverse,
        walls: Walls::new(hits()),
    }
}
