//! Records of light scattered in media: multiple scattering, or light straight from skies.
//!
//! Their radii follow the lengths over which the field changes; none reaches past the walls around it.

use super::{
    ATTEMPTS, Candidate, Counted, Kind, Light, MORE_RAYS, View, first_rays, quiet_enough, record,
    relative_slope,
};
use crate::integrator::view::spread;
use glam::Vec3;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::sync::Arc;
use tyndall_cache::{Cache, Record, weight};
use tyndall_math::{Key, Ray, Sampler, warp};
use tyndall_media::MediumPoint;
use tyndall_scene::Scene;
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::gather::{self, GatherPattern, Towards, What};
use tyndall_transport::lobe::{Lobe, MOST_ORDER};
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

/// What the first band left out of directions may hold, over the error asked for. Fog of g = 0.3 seen from several eyes, asked for 3 %:
/// without the second band `multiple` was 5 % too dark (2026-11-23).
const UNHELD: f32 = 0.5;
/// Views that tell how far cameras see, at most.
const VIEWS: usize = 16;

/// A cache of light in media.
pub(in crate::integrator) type MediaCache = Cache<3, Known>;

/// What a record in a medium knows beside its value.
#[derive(Clone, Deserialize, Serialize)]
pub(in crate::integrator) struct Known {
    /// The walls it does not reach past.
    walls: Walls,
    /// Directions of the light where the value is its mean over all directions: coefficients above band 0 over that mean.
    directions: Option<Arc<[Vec3]>>,
}

impl Known {
    /// A value that is what one direction gets, or all get alike, valid within `walls`.
    pub(super) fn within(walls: Walls) -> Self {
        Self {
            walls,
            directions: None,
        }
    }
}

/// For whom records are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(in crate::integrator) enum For {
    /// All eyes, as media scatter alike in all directions.
    #[default]
    Any,
    /// The eye at one place.
    Eye(Vec3),
    /// All eyes, by directions of light up to this band.
    All(#[serde(deserialize_with = "order")] usize),
}

/// The highest band of directions, as far as there may be one.
fn order<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    let order = usize::deserialize(deserializer)?;
    let is_held = (1..=MOST_ORDER).contains(&order);
    let fault = || D::Error::custom("directions of light have more bands than there may be");
    is_held.then_some(order).ok_or_else(fault)
}

impl For {
    /// The cheapest way that keeps the `error` of scattered light for `views`; where that is for one eye, it is that of the first.
    pub(in crate::integrator) fn views(scene: &Scene, views: &[View], error: f32) -> Self {
        if scene.media.is_isotropic() {
            return Self::Any;
        }
        let eye = views[0].eye();
        if views.iter().all(|view| view.eye() == eye) {
            return Self::Eye(eye);
        }
        // What is left out counts for each of the band's functions, by the square of its moment where the light was scattered before.
        let times = if scene.lights.has_even_skies() { 1 } else { 2 };
        let is_enough = |order: &usize| {
            let unheld = scene.media.largest_moment(order + 1);
            (2 * order + 3) as f32 * unheld.powi(times) <= UNHELD * error
        };
        (1..=MOST_ORDER)
            .find(is_enough)
            .map_or(Self::Eye(eye), Self::All)
    }

    /// Whether records for it are for the eye of `view`.
    pub(in crate::integrator) fn serves(self, view: &View) -> bool {
        match self {
            Self::Any | Self::All(_) => true,
            Self::Eye(eye) => eye == view.eye(),
        }
    }

    /// Those of `views` that records for it serve.
    pub(in crate::integrator) fn served(self, views: &[View]) -> Vec<View> {
        let is_served = |view: &&View| self.serves(view);
        views.iter().filter(is_served).copied().collect()
    }

    /// What the light of records is for a place in `medium` and the direction `w_o`.
    pub(in crate::integrator) fn lobe(self, medium: &MediumPoint<'_>, w_o: Vec3) -> Option<Lobe> {
        match self {
            Self::Any | Self::Eye(_) => None,
            Self::All(order) => Some(Lobe::new(medium, w_o, order)),
        }
    }
}

/// Light scattered along the camera's rays.
pub(in crate::integrator) struct Media<'s> {
    scene: &'s Scene,
    what: What<'s>,
    for_whom: For,
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

    /// For a target `error` of `what` the records hold.
    pub(in crate::integrator) fn new(
        scene: &'s Scene,
        views: &[View],
        (what, for_whom): (What<'s>, For),
        seed: u64,
        error: f32,
    ) -> Self {
        let gain = match what {
            What::Scattered(_) => RAYS_GAIN,
            What::Sky => SKY_RAYS_GAIN,
        };
        let n_rays = first_rays(gain, error);
        Self {
            scene,
            what,
            for_whom,
            seed,
            error,
            patterns: std::array::from_fn(|attempt| {
                GatherPattern::new(n_rays * MORE_RAYS.pow(attempt as u32))
            }),
            view: view_length(scene, views),
        }
    }
}

/// In-scattered radiance of the light that records hold at `p`, where they are valid; in the direction of a `lobe` where they know
/// directions.
pub(in crate::integrator) fn lookup(
    cache: &MediaCache,
    p: Vec3,
    lobe: Option<&Lobe>,
) -> Option<Vec3> {
    let Some(lobe) = lobe else {
        let value = cache.lookup_where(p, |known, _| known.walls.hold(p));
        return value.map(Vec3::from);
    };
    // The mean is blended in logarithms; the shares of directions, which may be below zero, by the same weights as they are.
    let (mut total, mut turned) = (0.0, Vec3::ZERO);
    let mean = cache.lookup_where(p, |known, offset| {
        let holds = known.walls.hold(p);
        if holds {
            let w = weight(1.0 - offset.length());
            total += w;
            turned += w * known.turned(lobe);
        }
        holds
    })?;
    Some(Vec3::from(mean) * (1.0 + turned / total).max(Vec3::ZERO))
}

impl Known {
    /// Light in the direction of `lobe` beyond the mean, over the mean.
    fn turned(&self, lobe: &Lobe) -> Vec3 {
        let directions = self.directions.as_ref();
        directions.map_or(Vec3::ZERO, |directions| lobe.scatters(directions))
    }
}

/// What the record nearest to `p` within `reach` metres knows, on the same side of its walls: for the few points that no record covers.
pub(in crate::integrator) fn nearest(
    cache: &MediaCache,
    p: Vec3,
    lobe: Option<&Lobe>,
    reach: f32,
) -> Option<Vec3> {
    let mut nearest: Option<(f32, usize)> = None;
    cache.for_each_near(p, reach, |index, record| {
        let distance = record.position.distance_squared(p);
        let walls = &cache.tags()[index].walls;
        if walls.hold(p)
            && distance < walls.beyond * walls.beyond
            && nearest.is_none_or(|n| (distance, index) < n)
        {
            nearest = Some((distance, index));
        }
    });
    nearest.map(|(_, index)| {
        let turned = lobe.map_or(Vec3::ZERO, |lobe| cache.tags()[index].turned(lobe));
        Vec3::from(cache.records()[index].value) * (1.0 + turned).max(Vec3::ZERO)
    })
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
    cache.covers_where(p, |known, _| known.walls.hold(p))
}

impl Kind for Media<'_> {
    type Tag = Known;

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
    ) -> Option<(Record<3>, Known)> {
        let world = geometry.world(self.scene);
        let light = match self.what {
            What::Scattered(_) => Light::Multiple,
            What::Sky => Light::Single,
        };
        let key = light.key(self.seed, index);
        // Moved, a record may miss the point that asked for it.
        let x = if round == 0 {
            clear_of_surfaces(&world, candidate.position, CLEARANCE * self.view, key)
        } else {
            candidate.position
        };
        let eye = Some(Towards::Eye(candidate.ray.origin));
        let mut directions = None;
        let g = quiet_enough(self.error, |attempt| {
            let pattern = &self.patterns[attempt];
            if let For::All(order) = self.for_whom {
                let (found, bands) = gather::incident(&world, x, self.what, order, pattern, key);
                directions = Some((found.value, bands));
                return found;
            }
            gather::towards(&world, x, eye, self.what, pattern, key)
        });
        let directions = directions.map(|(mean, bands)| shares(mean, &bands));
        // Lengths over which the field changes: to surfaces, to lamps, to the edge of a medium (where the field falls off
        // ever faster) unless it lies behind a surface, a free path, and its own relative gradient. Surfaces count half: they
        // are near on one side, and light does not end there. Edges count more: at half, the furnace was 0.25 % too bright.
        let edge = world.media.distance_to_boundary(x);
        let edge = if edge < g.nearest { 1.5 / edge } else { 0.0 };
        let lamps = match self.what {
            What::Scattered(_) => 1.0 / world.lights.distance_to_point_lights(x),
            What::Sky => 0.0,
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
        let known = Known {
            walls: g.walls,
            directions,
        };
        Some((record(x, radius, value, g.gradient)?, known))
    }
}

/// Coefficients of light over its `mean`; none of a channel without light.
fn shares(mean: Vec3, bands: &[Vec3]) -> Arc<[Vec3]> {
    let is_lit = mean.cmpgt(Vec3::ZERO);
    let share = |&c: &Vec3| {
        let share = Vec3::select(is_lit, c / mean, Vec3::ZERO);
        if share.is_finite() { share } else { Vec3::ZERO }
    };
    bands.iter().map(share).collect()
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
