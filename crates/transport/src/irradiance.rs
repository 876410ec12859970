//! What a cache record on a surface is made of: indirect irradiance, its gradient in the surface's plane and their standard errors.
//!
//! Directions by the cosine start paths. Light straight from emitters is left out, because it is sampled where it is needed, but that of
//! even skies: few of all directions may lead there.

use crate::gather::{BATCHES, Batches, Gathered, batch_key, warp_radius};
use crate::path::{FirstEvent, Reach, Start, straight_from_sky, trace};
use crate::walls::Walls;
use crate::warp_translation::WarpVisitor;
use crate::world::{Geometry, Lights, SurfaceHit, World};
use glam::Vec3;
use tyndall_math::{Frame, Key, Sampler, warp};

/// Rays towards skies for each path.
const SKY_RAYS: usize = 4;

/// Numbers of sky rays among all starts of a batch: from here on, where no path gets to.
const FIRST_SKY_RAY: usize = 1 << 24;

/// Gathers light but that straight from emitters at the surface point `hit`, along `n_rays` paths, rounded up to a multiple of 16; with
/// `sky` also that straight from skies and environment images, along four times as many rays.
///
/// The value is irradiance over π, that is what a white Lambertian surface sends out, W/(m² sr). The gradient is for motion in the
/// surface's plane and takes visibility as constant (Jarosz, Zwicker and Jensen 2008, "Irradiance gradients in the presence of
/// participating media and occlusions", without the occlusions). `reach` counts the reflection at `hit`.
pub fn irradiance<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    hit: &SurfaceHit,
    n_rays: usize,
    sky: bool,
    reach: Reach<'_>,
    key: Key,
) -> Gathered {
    let normal = hit.bsdf.normal();
    let frame = Frame::from_normal(normal);
    let paths = n_rays.div_ceil(BATCHES).max(1);
    let start = |batch: usize, i: usize| {
        let u = Sampler::new(batch_key(key, batch), i as u64).next_2d();
        let w_i = frame.to_world(warp::cosine_hemisphere(u));
        let ray = hit.spawn(w_i.normalize_or(normal));
        // What the geometric normal hides brings nothing, and counts.
        let is_seen = ray.direction.dot(hit.normal) > 0.0;
        is_seen.then(|| Start {
            ray,
            hit: Some(world.geometry.intersect(&ray, f32::INFINITY)),
            first: FirstEvent::Any,
            reach: reach.behind_one(),
        })
    };
    let starts: Vec<Vec<Option<Start<'_>>>> = (0..BATCHES)
        .map(|batch| (0..paths).map(|i| start(batch, i)).collect())
        .collect();
    let hits = || {
        let starts = starts.iter().flatten().flatten();
        starts.filter_map(|start| start.hit.as_ref()?.as_ref())
    };
    let nearest = hits().map(|hit| hit.t).fold(f32::INFINITY, f32::min);
    let inverse: f32 = hits().map(|hit| 1.0 / hit.t.max(f32::MIN_POSITIVE)).sum();
    let radius = warp_radius(world, hit.position, nearest);
    let visitor = || WarpVisitor::on_surface(world.media, hit.position, radius, normal);

    let in_plane = |gradient: Vec3| gradient - normal * normal.dot(gradient);
    let mut scattered = Batches::default();
    for (batch, starts) in starts.iter().enumerate() {
        for (i, start) in starts.iter().enumerate() {
            let mut visitor = visitor();
            if let Some(start) = start {
                let mut sampler = Sampler::new(batch_key(key, batch), i as u64);
                trace(world, start, &mut sampler, &mut visitor);
            }
            scattered.add(batch, visitor.value, visitor.gradient.map(in_plane));
        }
    }
    let mut means = scattered.means();
    let mut variances = scattered.errors().map(|error| error * error);
    let mut gradient_norm = scattered.gradient_norm();
    if sky {
        let mut straight = Batches::default();
        for batch in 0..BATCHES {
            for i in 0..SKY_RAYS * paths {
                let mut visitor = visitor();
                if let Some(start) = start(batch, FIRST_SKY_RAY + i) {
                    straight_from_sky(world, &start, visitor.straight());
                }
                straight.add(batch, visitor.value, visitor.gradient.map(in_plane));
            }
        }
        let (more, errors) = (straight.means(), straight.errors());
        gradient_norm += straight.gradient_norm();
        means = std::array::from_fn(|i| means[i] + more[i]);
        variances = std::array::from_fn(|i| variances[i] + errors[i] * errors[i]);
    }
    let [value, dr, dg, db] = means;
    let [value_error, er, eg, eb] = variances.map(|variance| variance.map(f32::sqrt));
    Gathered {
        value,
        gradient: [dr, dg, db],
        value_error,
        gradient_error: [er, eg, eb],
        gradient_norm,
        nearest,
        harmonic_mean_distance: starts.iter().flatten().flatten().count() as f32 / inverse,
        walls: Walls::new(hits()),
    }
}
