//! Records of light scattered in media: multiple scattering, or light straight from skies.
//!
//! Their radii follow the lengths over which the field changes; none reaches past the walls around it.

use super::{
    ATTEMPTS, Candidate, Counted, Kind, Light, MORE_RAYS, View, first_rays, quiet_enough, record,
    relative_slope,
};
use crate::integrator::view::spread;
use glam::Vec3;
use tyndall_cache::{Cache, Record};
use tyndall_math::{Key, Ray, Sampler, warp};
use tyndall_scene::Scene;
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::gather::{self, GatherPattern};
use tyndall_transport::path::Reach;
use tyndall_transport::walls::Walls;
use tyndall_transport::world::{Geometry, Lights, World};

/// Points on each camera ray, evenly spread in transmittance.
const POINTS_PER_RAY: u32 = 8;
/// Radii at an error of 1, in lengths over which the field changes. On the shipped Cornell box at 256 × 192, error 0.03: 20 000
/// records and 41 s of filling with 2, with 4 (and surfaces counting half) 1 200 records, 4 s, and half the error (2026-11-22).
const RADIUS_GAIN: f32 = 4.0;
/// Directions of a record at an error of 1 go with the square of this; about eight records blend at a point.
const RAYS_GAIN: f32 = 0.9;
/// As [`RAYS_GAIN`] for light from skies, whose rays cost little and find it through windows alone.
const SKY_RAYS_GAIN: f32 = 1.8;
/// Smallest and largest radius as shares of the length over which the view looks into the fog.
const RADIUS_RANGE: [f32; 2] = [0.01, 0.25];
/// Smallest radius in pixels seen from the camera: detail below half a pixel is averaged away. A whole pixel was too much:
/// where the field bends towards the edge of a medium, all pixels erred to one side (furnace, 24 × 24: +0.2 % in the mean).
const SMALLEST_FOOTPRINT: f32 = 0.5;

/// Records are moved this far off surfaces, as a share of the length over which the view looks into the fog.
const CLEARANCE: f32 = 0.04;
/// Rays that look for the nearest surface.
const CLEARANCE_RAYS: u64 = 32;

/// Views that tell how far cameras see, at most.
const VIEWS: usize = 16;

/// A cache of light in media; records are tagged with the walls they do not reach past.
pub(in crate::integrator) type MediaCache = Cache<3, Walls>;

/// What records in media hold.
#[derive(Clone, Copy)]
pub(in crate::integrator) enum Holds<'s> {
    /// Multiple scattering, along paths that go so far.
    Multiple(Reach<'s>),
    /// Single scattering of light from skies and environment images.
    Sky,
}

/// Light scattered along the camera's rays.
pub(in crate::integrator) struct Media<'s> {
    scene: &'s Scene,
    holds: Holds<'s>,
    seed: u64,
    error: f32,
    /// Directions of each attempt at a record.
    patterns: [GatherPattern; ATTEMPTS],
    /// Mean length over which camera rays see into the media, in metres.
    view: f32,
}

impl<'s> Media<'s> {
    /// Rays of a record's first attempt.
    pub(in crate::integrator) fn n_rays(&self) -> usize {
        self.patterns[0].n_rays()
    }

    /// For a target `error` of what the records hold.
    pub(in crate::integrator) fn new(
        scene: &'s Scene,
        views: &[View],
        holds: Holds<'s>,
        seed: u64,
        error: f32,
    ) -> Self {
        let gain = match holds {
            Holds::Multiple(_) => RAYS_GAIN,
            Holds::Sky => SKY_RAYS_GAIN,
        };
        let n_rays = first_rays(gain, error);
        Self {
            scene,
            holds,
            seed,
            error,
            patterns: std::array::from_fn(|attempt| {
                GatherPattern::new(n_rays * MORE_RAYS.pow(attempt as u32))
            }),
            view: view_length(scene, views),
        }
    }
}

/// In-scattered radiance of the light that records hold at `p`, where they are valid.
pub(in crate::integrator) fn lookup(cache: &MediaCache, p: Vec3) -> Option<Vec3> {
    cache
        .lookup_where(p, |walls, _| walls.hold(p))
        .map(Vec3::from)
}

/// What the record nearest to `p` within `reach` metres knows, on the same side of its walls: for the few points that no record covers.
pub(in crate::integrator) fn nearest(cache: &MediaCache, p: Vec3, reach: f32) -> Option<Vec3> {
    let mut nearest: Option<(f32, usize)> = None;
    cache.for_each_near(p, reach, |index, record| {
        let distance = record.position.distance_squared(p);
        let walls = &cache.tags()[index];
        if walls.hold(p)
            && distance < walls.beyond * walls.beyond
            && nearest.is_none_or(|n| (distance, index) < n)
        {
            nearest = Some((distance, index));
        }
    });
    nearest.map(|(_, index)| cache.records()[index].value.into())
}

/// Visits the points in media on a camera ray, where records are wanted; `offset` from 0 to 1 moves them.
pub(super) fn points_on(
    scene: &Scene,
    (view, ray): (&View, &Ray),
    offset: f32,
    mut visit: impl FnMut(Candidate),
) {
    let (_, flight) = FreeFlight::to_surface(&scene.world(), ray);
    if !flight.can_stop() {
        return;
    }
    for i in 0..POINTS_PER_RAY {
        if let Some(t) = flight.sample_inside((i as f32 + offset) / POINTS_PER_RAY as f32) {
            visit(Candidate {
                position: ray.at(t),
                normal: Vec3::ZERO,
                footprint: view.footprint(t),
                ray: *ray,
            });
        }
    }
}

/// Whether a lookup at the point finds a record.
pub(super) fn covers(cache: &MediaCache, candidate: &Candidate) -> bool {
    let p = candidate.position;
    cache.covers_where(p, |walls, _| walls.hold(p))
}

impl Kind for Media<'_> {
    type Tag = Walls;

    fn most_radius(&self, _: &Candidate) -> f32 {
        RADIUS_RANGE[1] * self.view
    }

    fn points_on(&self, view: &View, ray: &Ray, offset: f32, visit: impl FnMut(Candidate)) {
        points_on(self.scene, (view, ray), offset, visit);
    }

    fn covers(&self, cache: &MediaCache, candidate: &Candidate) -> bool {
        covers(cache, candidate)
    }

    fn record(
        &self,
        geometry: &Counted<'_>,
        candidate: &Candidate,
        index: u64,
        round: usize,
    ) -> Option<(Record<3>, Walls)> {
        let world = geometry.world(self.scene);
        let light = match self.holds {
            Holds::Multiple(_) => Light::Multiple,
            Holds::Sky => Light::Single,
        };
        let key = light.key(self.seed, index);
        // Moved, a record may miss the point that asked for it.
        let x = if round == 0 {
            clear_of_surfaces(&world, candidate.position, CLEARANCE * self.view, key)
        } else {
            candidate.position
        };
        let g = quiet_enough(self.error, |attempt| {
            let pattern = &self.patterns[attempt];
            match self.holds {
                Holds::Multiple(reach) => gather::multiple(&world, x, pattern, reach, key),
                Holds::Sky => gather::sky(&world, x, pattern, key),
            }
        });
        // Lengths over which the field changes: to surfaces, to lamps, to the edge of a medium (where the field falls off
        // ever faster) unless it lies behind a surface, a free path, and its own relative gradient. Surfaces count half: they
        // are near on one side, and light does not end there. Edges count more: at half, the furnace was 0.25 % too bright.
        let edge = world.media.distance_to_boundary(x);
        let edge = if edge < g.nearest { 1.5 / edge } else { 0.0 };
        let lamps = match self.holds {
            Holds::Multiple(_) => 1.0 / world.lights.distance_to_point_lights(x),
            Holds::Sky => 0.0,
        };
        let inverse = 0.5 / g.harmonic_mean_distance
            + lamps
            + edge
            + world.media.at(x).sigma_t.element_sum() / 3.0
            + relative_slope(&g);
        // What is left of the interpolant's error grows with the square of the radius.
        let radius = (RADIUS_GAIN * self.error.sqrt()).clamp(0.1, 1.0) / inverse;
        let [least, most] = RADIUS_RANGE;
        let radius = radius
            .max(SMALLEST_FOOTPRINT * candidate.footprint)
            .clamp(least * self.view, most * self.view)
            .min(g.walls.beyond);
        let value = (g.value, g.value_error);
        Some((record(x, radius, value, g.gradient)?, g.walls))
    }
}

/// Mean length over which camera rays see into the media, in metres.
fn view_length(scene: &Scene, views: &[View]) -> f32 {
    let world = scene.world();
    let (mut sum, mut n) = (0.0, 0.0);
    let places = (0..64).map(|i| [i % 8, i / 8].map(|n| (n as f32 + 0.5) / 8.0));
    for (place, view) in places.flat_map(|place| spread(views, VIEWS).map(move |v| (place, v))) {
        let ray = view.ray_at(place);
        let (_, flight) = FreeFlight::to_surface(&world, &ray);
        if flight.can_stop() {
            let start = flight.segment().range().0;
            if let Some(t) = flight.sample_inside(0.9) {
                sum += t - start;
                n += 1.0;
            }
        }
    }
    if n > 0.0 { sum / n } else { 1.0 }
}

/// The point, moved away from the nearest surface until it is `clearance` off or half-way to what lies opposite.
///
/// A record may not reach past a surface. At a wall it would be tiny; a little off, one does for many.
fn clear_of_surfaces<G: Geometry, L>(
    world: &World<'_, G, L>,
    x: Vec3,
    clearance: f32,
    key: Key,
) -> Vec3 {
    let nearest = (0..CLEARANCE_RAYS)
        .filter_map(|i| {
            let w = warp::uniform_sphere(Sampler::new(key, i).next_2d());
            world.geometry.intersect(&Ray::new(x, w), 2.0 * clearance)
        })
        .min_by(|a, b| a.t.total_cmp(&b.t));
    let Some(hit) = nearest else {
        return x;
    };
    let height = (x - hit.position).dot(hit.normal);
    if height >= clearance {
        return x;
    }
    let away = Ray::new(x, hit.normal);
    let wanted = clearance - height.max(0.0);
    let room = world.geometry.intersect(&away, 2.0 * wanted);
    away.at(room.map_or(wanted, |hit| 0.5 * hit.t))
}
