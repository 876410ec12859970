//! Distances at which light scatters along a segment, sampled for all colour channels at once.
//!
//! A channel is picked by the path's throughput and the density is the mixture over channels (spectral multiple
//! importance sampling, Wilkie et al. 2014), so coloured extinction costs no variance in the channels not picked.

use crate::world::{Geometry, SurfaceHit, World};
use glam::Vec3;
use tyndall_math::Ray;
use tyndall_media::{Media, Segment, absorptance, transmittance};

/// Samples scattering distances on a [`Segment`] in proportion to σt T.
#[derive(Clone, Debug)]
pub struct FreeFlight<'m> {
    segment: Segment<'m>,
    total: Vec3,
    /// Chance of each channel for flights that may pass the whole segment.
    weights: Vec3,
    /// Chance of each channel for flights that must end on the segment; zero where the segment is clear.
    inside_weights: Vec3,
    /// 1 − T of the whole segment.
    stopped: Vec3,
}

/// A place where a flight ends.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Distance along the segment's ray.
    pub t: f32,
    /// Transmittance up to there.
    pub transmittance: Vec3,
    /// σt T, per metre.
    flux: Vec3,
}

impl<'m> FreeFlight<'m> {
    /// Flights along `segment` of a path with RGB `throughput` (not negative, not all zero).
    pub fn new(segment: Segment<'m>, throughput: Vec3) -> Self {
        let total = segment.total();
        let weights = if segment.is_grey() {
            // Channels alike: picking one would only cut the random numbers' strata into three.
            Vec3::X
        } else {
            throughput / throughput.element_sum()
        };
        let inside = Vec3::select(total.cmpgt(Vec3::ZERO), weights, Vec3::ZERO);
        let sum = inside.element_sum();
        Self {
            total,
            weights,
            inside_weights: if sum > 0.0 { inside / sum } else { Vec3::ZERO },
            stopped: absorptance(total),
            segment,
        }
    }

    /// As [`FreeFlight::new`] for a ray of which no more is asked than [`FreeFlight::sample`] with the number `u`, and what follows from it:
    /// it is known as far as that flight gets.
    pub fn for_one(media: &'m Media, ray: &Ray, t_max: f32, throughput: Vec3, u: f32) -> Self {
        // The larger of what the number means where channels are alike and where one is picked.
        let (_, rest) = pick(throughput / throughput.element_sum(), u);
        let enough = -(-u.max(rest)).ln_1p();
        Self::new(media.segment_until(ray, t_max, enough), throughput)
    }

    /// The surface that `ray` meets, and flights up to it of a path that all channels follow alike.
    pub fn to_surface<G: Geometry, L>(
        world: &World<'m, G, L>,
        ray: &Ray,
    ) -> (Option<SurfaceHit>, Self) {
        let hit = world.geometry.intersect(ray, f32::INFINITY);
        let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
        (hit, Self::new(world.media.segment(ray, t_max), Vec3::ONE))
    }

    /// The segment flown along.
    pub fn segment(&self) -> &Segment<'m> {
        &self.segment
    }

    /// Transmittance of the whole segment.
    pub fn transmittance(&self) -> Vec3 {
        transmittance(self.total)
    }

    /// What the densities of a flight that ends at distance `t` are made of.
    pub fn stop(&self, t: f32) -> Stop {
        let transmittance = transmittance(self.segment.optical_depth(t));
        Stop {
            t,
            transmittance,
            flux: self.segment.sigma_t(t) * transmittance,
        }
    }

    /// Whether the path can scatter anywhere on the segment.
    pub fn can_stop(&self) -> bool {
        self.inside_weights.max_element() > 0.0
    }

    /// Samples where the flight ends; `None` when it passes the whole segment.
    pub fn sample(&self, u: f32) -> Option<f32> {
        let (channel, u) = pick(self.weights, u);
        let tau = -(-u).ln_1p();
        if tau >= self.total[channel] {
            return None;
        }
        self.segment.distance_at(channel, tau)
    }

    /// Density per metre of a flight that ends at `stop`: Σ w σt T.
    pub fn pdf(&self, stop: &Stop) -> f32 {
        mixture(self.weights, stop.flux)
    }

    /// Chance of passing the whole segment: Σ w T.
    pub fn pass(&self) -> f32 {
        mixture(self.weights, self.transmittance())
    }

    /// Samples where a flight ends that is known to end on the segment; needs [`FreeFlight::can_stop`].
    pub fn sample_inside(&self, u: f32) -> Option<f32> {
        let (channel, u) = pick(self.inside_weights, u);
        self.inside(channel, u)
    }

    /// Density per metre of [`FreeFlight::sample_inside`]: Σ w σt T / (1 − T of all).
    pub fn pdf_inside(&self, stop: &Stop) -> f32 {
        mixture(self.inside_weights, stop.flux / self.stopped)
    }

    /// Chance that [`FreeFlight::sample_inside`] stays short of distance `t`, Σ w (1 − T) / (1 − T of all), and its slope,
    /// which is its density per metre.
    pub(crate) fn cdf_inside(&self, t: f32) -> (f32, f32) {
        let stopped = absorptance(self.segment.optical_depth(t));
        let flux = self.segment.sigma_t(t) * (1.0 - stopped);
        (
            mixture(self.inside_weights, stopped / self.stopped),
            mixture(self.inside_weights, flux / self.stopped),
        )
    }

    /// Distances between which the first share `u` of the flights of [`FreeFlight::sample_inside`] has ended, channels by
    /// themselves and thus all together; the same twice where the channels are alike.
    pub(crate) fn quantile_inside(&self, u: f32) -> Option<(f32, f32)> {
        (0..3)
            .filter(|&c| self.inside_weights[c] > 0.0)
            .filter_map(|c| self.inside(c, u))
            .map(|t| (t, t))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// The distance at which a share `u` of the flights of one channel that end on the segment has ended.
    fn inside(&self, channel: usize, u: f32) -> Option<f32> {
        let tau = -(-u * self.stopped[channel]).ln_1p();
        // Rounding may carry τ to the very end of the segment.
        self.segment
            .distance_at(channel, tau.min(self.total[channel] * (1.0 - f32::EPSILON)))
    }
}

/// Σ w x over the channels that can be picked; a channel of weight 0 stays out even if x is not finite.
fn mixture(weights: Vec3, x: Vec3) -> f32 {
    Vec3::select(weights.cmpgt(Vec3::ZERO), weights * x, Vec3::ZERO).element_sum()
}

/// Picks a channel with chance `weights` and returns what is left of the random number, again uniform in [0, 1).
fn pick(weights: Vec3, u: f32) -> (usize, f32) {
    let mut below = 0.0;
    let mut last = (0, 0.0);
    for c in 0..3 {
        if weights[c] > 0.0 {
            let rest = (u - below) / weights[c];
            if rest < 1.0 {
                return (c, rest.max(0.0));
            }
            below += weights[c];
            last = (c, 1.0 - f32::EPSILON);
        }
    }
    last
}
