//! Distances along a ray in increasing order, gathered where a light is scattered.
//!
//! The density is that of [`SegmentLight`](crate::single::SegmentLight), but drawn by the inverse of its distribution: neighbouring numbers give
//! neighbouring places, so that what changes between two of them can be searched for.

use crate::free_flight::{FreeFlight, Stop};
use crate::single::{EQUIANGULAR_SHARE, mixed};
use glam::Vec3;
use tyndall_math::{Ray, warp::Equiangular};

/// Error of the distribution from which on one more step of Newton's method, which squares it, is the last.
const NEARLY: f32 = 1e-3;

/// An increasing map from [0, 1) to distances on a segment.
#[derive(Clone, Debug)]
pub(crate) struct SegmentWarp<'f, 'm> {
    flight: &'f FreeFlight<'m>,
    equiangular: Option<Equiangular>,
}

impl<'f, 'm> SegmentWarp<'f, 'm> {
    /// For a light at `pivot`, or one infinitely far away.
    pub(crate) fn new(ray: &Ray, flight: &'f FreeFlight<'m>, pivot: Option<Vec3>) -> Self {
        let (start, end) = flight.segment().range();
        Self {
            flight,
            equiangular: pivot.map(|pivot| Equiangular::new(ray, pivot, start, end)),
        }
    }

    /// The distance below which lies the share `u` of the density, in [0, 1).
    ///
    /// F(t) = u, where F = ½ E + ½ C for a light with a place, of the equiangular distribution E and that of flights C, and
    /// F = C for others. The first is solved in the angle E, in which it is bounded and never flat.
    pub(crate) fn distance(&self, u: f32) -> Option<f32> {
        let Some(equiangular) = &self.equiangular else {
            let (low, high) = self.flight.quantile_inside(u)?;
            return Some(solve(low, high, |t| {
                let (below, slope) = self.flight.cdf_inside(t);
                (below - u, slope)
            }));
        };
        const FLIGHT_SHARE: f32 = 1.0 - EQUIANGULAR_SHARE;
        let low = (u - FLIGHT_SHARE).max(0.0) / EQUIANGULAR_SHARE;
        let high = (u / EQUIANGULAR_SHARE).min(1.0_f32.next_down());
        let angle = solve(low, high, |angle| {
            let (t, pdf) = equiangular.sample(angle);
            let (below, slope) = self.flight.cdf_inside(t);
            (
                EQUIANGULAR_SHARE * angle + FLIGHT_SHARE * below - u,
                EQUIANGULAR_SHARE + FLIGHT_SHARE * slope / pdf,
            )
        });
        Some(equiangular.sample(angle).0)
    }

    /// Density per metre.
    pub(crate) fn pdf(&self, stop: &Stop) -> f32 {
        let by_transmittance = self.flight.pdf_inside(stop);
        self.equiangular.map_or(by_transmittance, |equiangular| {
            mixed(&equiangular, stop.t, by_transmittance)
        })
    }
}

/// Where in [`low`, `high`] an increasing function is zero; `f` returns value and slope.
///
/// Newton's method in a shrinking bracket, halved where a step would leave it.
fn solve(mut low: f32, mut high: f32, f: impl Fn(f32) -> (f32, f32)) -> f32 {
    let mut x = 0.5 * (low + high);
    // As many halvings as an f32 has digits; Newton needs about three steps.
    for _ in 0..24 {
        if low >= high {
            return low;
        }
        let (value, slope) = f(x);
        if value > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - value / slope;
        x = if newton >= low && newton <= high {
            newton
        } else {
            0.5 * (low + high)
        };
        if value.abs() <= NEARLY {
            break;
        }
    }
    x
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use tyndall_math::testing::{Distances, assert_conforms};
    use tyndall_media::{Media, Medium, MediumParams, Region};

    #[test]
    fn distances_increase_and_follow_their_density() {
        let medium = |low, high, sigma_t| {
            Medium::new(MediumParams {
                region: Region::Box {
                    min: Vec3::new(low, -9.0, -9.0),
                    max: Vec3::new(high, 9.0, 9.0),
                },
                ..MediumParams::new(sigma_t, Vec3::splat(0.5))
            })
            .unwrap()
        };
        // Overlapping, and one channel sees nothing of the second.
        let media = Media::new(vec![
            medium(0.2, 1.8, Vec3::new(0.2, 1.0, 3.0)),
            medium(1.5, 3.0, Vec3::new(0.7, 0.0, 0.1)),
        ]);
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let flight = FreeFlight::new(media.segment(&ray, 4.0), Vec3::ONE);
        let cells = Distances::between(vec![
            0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 1.7, 1.8, 2.2, 3.0,
        ]);
        let lamp = Vec3::new(0.9, 0.3, 0.0);
        for (seed, pivot) in [(700, None), (701, Some(lamp))] {
            let warp = SegmentWarp::new(&ray, &flight, pivot);
            assert_conforms(
                &cells,
                seed,
                |[u, _]| warp.distance(u).map(|t| (t, warp.pdf(&flight.stop(t)))),
                |t| warp.pdf(&flight.stop(t)),
            );
            let distances: Vec<f32> = (0..100)
                .map(|i| warp.distance(i as f32 / 100.0).unwrap())
                .collect();
            assert!(distances.is_sorted(), "{distances:?}");
        }
    }
}
