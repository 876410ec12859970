//! Records of irradiance on surfaces, by indirect light and by even skies.
//!
//! They serve the diffuse part of rough surfaces; gloss, and what shines, is traced. Radii follow the harmonic mean distance to other
//! surfaces (Ward et al. 1988).

use super::{
    Candidate, Counted, Kind, Light, MORE_RAYS, SAME_SURFACE, View, first_rays, quiet_enough,
    record, relative_slope,
};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use tyndall_cache::{Cache, Record};
use tyndall_math::Ray;
use tyndall_scene::Scene;
use tyndall_transport::irradiance::irradiance;
use tyndall_transport::path::Reach;
use tyndall_transport::walls::Walls;
use tyndall_transport::world::{Geometry, SurfaceHit};

/// Directions of a record at an error of 1 go with the square of this.
const RAYS_GAIN: f32 = 0.5;
/// Radii at an error of 1, in harmonic mean distances.
const RADIUS_GAIN: f32 = 2.0;
/// Smallest and largest radius in pixels.
const FOOTPRINTS: [f32; 2] = [1.5, 24.0];
/// A record is not valid farther than this share of its radius above or below its plane.
const THICKNESS: f32 = 0.2;

/// Where a record on a surface is valid.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(in crate::integrator) struct Side {
    normal: Vec3,
    walls: Walls,
    /// Other surfaces are so close that light changes from pixel to pixel: here, nothing is interpolated.
    crowded: bool,
}

/// A cache of irradiance over π.
pub(in crate::integrator) type SurfaceCache = Cache<3, Side>;

/// Whether records serve the surface.
pub(in crate::integrator) fn holds(hit: &SurfaceHit) -> bool {
    !hit.bsdf.is_shiny()
}

/// Irradiance over π by the light that records hold at `p` on a surface with the unit `normal` towards the viewer, where records are valid.
pub(in crate::integrator) fn lookup(cache: &SurfaceCache, p: Vec3, normal: Vec3) -> Option<Vec3> {
    let crowded = Cell::new(false);
    let found = cache.lookup_where(p, |side, offset| {
        let holds = side.holds(p, normal, offset);
        crowded.set(crowded.get() || holds && side.crowded);
        holds
    });
    found.filter(|_| !crowded.get()).map(Vec3::from)
}

impl Side {
    /// On surfaces with about this unit `normal`, whatever walls stand around.
    pub(super) fn open(normal: Vec3) -> Self {
        Self {
            normal,
            walls: Walls::NONE,
            crowded: false,
        }
    }

    fn holds(&self, p: Vec3, normal: Vec3, offset: Vec3) -> bool {
        self.normal.dot(normal) >= SAME_SURFACE
            && self.normal.dot(offset).abs() < THICKNESS
            && self.walls.hold(p)
    }
}

/// Light on the surfaces that the camera sees: indirect light, and that of skies.
pub(in crate::integrator) struct Surfaces<'s> {
    pub(in crate::integrator) scene: &'s Scene,
    pub(in crate::integrator) reach: Reach<'s>,
    pub(in crate::integrator) seed: u64,
    /// Whether light straight from skies is held, too.
    pub(in crate::integrator) sky: bool,
    /// Target error of what the records hold.
    pub(in crate::integrator) error: f32,
}

impl Surfaces<'_> {
    /// Paths of a record's first attempt.
    pub(in crate::integrator) fn n_rays(&self) -> usize {
        first_rays(RAYS_GAIN, self.error)
    }

    /// What a camera ray meets, where records hold the light on it.
    pub(super) fn hit<G: Geometry>(geometry: &G, ray: &Ray) -> Option<SurfaceHit> {
        geometry.intersect(ray, f32::INFINITY).filter(holds)
    }
}

/// The point that a camera ray meets, where a record is wanted.
pub(super) fn point_on(scene: &Scene, view: &View, ray: &Ray) -> Option<Candidate> {
    let hit = Surfaces::hit(&scene.geometry, ray)?;
    Some(Candidate {
        position: hit.position,
        normal: hit.bsdf.normal(),
        footprint: view.footprint(hit.t),
        ray: *ray,
    })
}

/// Whether records are valid at the point.
pub(super) fn covers(cache: &SurfaceCache, candidate: &Candidate) -> bool {
    let p = candidate.position;
    cache.covers_where(p, |side, offset| side.holds(p, candidate.normal, offset))
}

impl Kind for Surfaces<'_> {
    type Tag = Side;

    fn most_radius(&self, candidate: &Candidate) -> f32 {
        FOOTPRINTS[1] * candidate.footprint
    }

    fn points_on(&self, view: &View, ray: &Ray, _: f32, visit: impl FnMut(Candidate)) {
        point_on(self.scene, view, ray).map(visit);
    }

    fn covers(&self, cache: &SurfaceCache, candidate: &Candidate) -> bool {
        covers(cache, candidate)
    }

    fn record(
        &self,
        geometry: &Counted<'_>,
        candidate: &Candidate,
        index: u64,
        _round: usize,
    ) -> Option<(Record<3>, Side)> {
        let world = geometry.world(self.scene);
        let hit = Self::hit(geometry, &candidate.ray)?;
        let key = Light::Surface.key(self.seed, index);
        let g = quiet_enough(self.error, |attempt| {
            let n_rays = self.n_rays() * MORE_RAYS.pow(attempt as u32);
            irradiance(&world, &hit, n_rays, self.sky, self.reach, key)
        });
        let [least, most] = FOOTPRINTS.map(|n| n * candidate.footprint);
        // Lengths over which irradiance changes: to other surfaces, and its own relative gradient.
        let inverse = 1.0 / g.harmonic_mean_distance + relative_slope(&g);
        let radius = (RADIUS_GAIN * self.error.sqrt()).clamp(0.05, 1.0) / inverse;
        let radius = radius.min(most).min(g.walls.beyond);
        let crowded = radius < least;
        let radius = radius.max(least);
        let side = Side {
            normal: hit.bsdf.normal(),
            walls: g.walls,
            crowded,
        };
        let value = (g.value, g.value_error);
        Some((record(hit.position, radius, value, g.gradient)?, side))
    }
}
