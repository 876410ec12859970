//! One conformance test for every sampler: what it draws, what it says it drew, and its density must agree.
//!
//! Counts in cells are compared with the integral of the density over them (Pearson's χ²). A [`Domain`] cuts what a
//! sampler returns into cells: [`Directions`], [`Distances`] and [`UnitSquare`] serve most of them.

use crate::{Frame, Key, Purpose, Sampler, stats::chi_square_test};
use glam::Vec3;
use rand_pcg::{Pcg32, rand_core::Rng};
use std::fmt::Debug;

/// Probability that [`assert_conforms`] rejects a correct sampler, were its seed not fixed.
pub const FALSE_ALARM_RATE: f64 = 1e-6;

/// Random numbers for a test: those of a `seed`, and of one `index` of many.
pub fn sampler(seed: u64, index: u64) -> Sampler {
    let key = Key {
        seed,
        purpose: Purpose::Probe,
        index,
    };
    Sampler::new(key, 0)
}

/// Samples drawn.
const N_SAMPLES: u32 = 200_000;
/// Points at which the density is evaluated in each cell.
const N_POINTS: u32 = 4096;
/// Error of the integral of a density over all cells, from [`N_POINTS`] a cell and the jumps it may have.
const MASS_TOLERANCE: f64 = 2e-3;
/// Relative difference of the density sampled and evaluated: f32 evaluated in two ways.
const PDF_TOLERANCE: f32 = 1e-3;

/// The set a sampler draws from, cut into cells.
pub trait Domain {
    /// What the sampler returns.
    type Point: Copy + Debug;

    /// Number of cells; together they hold every point.
    fn n_cells(&self) -> usize;

    /// The cell that holds `p`.
    fn cell(&self, p: Self::Point) -> usize;

    /// The point of `cell` at `u` in [0, 1)², and the measure per unit of u there: the mean of measure × density over u
    /// is the mass of the cell.
    fn point(&self, cell: usize, u: [f64; 2]) -> (Self::Point, f64);
}

/// Checks that `sample` draws with the density it returns, that this is what `pdf` says, and that the density is normalised.
///
/// `sample` may return `None`; the χ² test then also holds the share of such samples against what the density lacks to 1.
/// One sample in a thousand may disagree with `pdf`: a point rounded across an edge of the density.
///
/// # Panics
///
/// Where one of them fails, with the numbers. A correct sampler fails for [`FALSE_ALARM_RATE`] of all seeds; the
/// numbers are independent (not stratified, which would make χ² too small) and fixed by `seed`.
#[track_caller]
pub fn assert_conforms<D: Domain>(
    domain: &D,
    seed: u64,
    mut sample: impl FnMut([f32; 2]) -> Option<(D::Point, f32)>,
    pdf: impl Fn(D::Point) -> f32,
) {
    let mut random = Pcg32::new(seed, 1);
    let mut uniform = || (random.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0);
    let mut observed = vec![0_u64; domain.n_cells()];
    let (mut n_none, mut n_disagreeing) = (0_u64, 0_u32);
    for _ in 0..N_SAMPLES {
        let Some((p, density)) = sample([uniform(), uniform()]) else {
            n_none += 1;
            continue;
        };
        assert!(
            density > 0.0 && density.is_finite(),
            "{p:?} was drawn with density {density}"
        );
        if (pdf(p) - density).abs() > PDF_TOLERANCE * density {
            n_disagreeing += 1;
            assert!(
                n_disagreeing <= N_SAMPLES / 1000,
                "{p:?} was drawn with density {density}, but pdf says {}",
                pdf(p)
            );
        }
        observed[domain.cell(p)] += 1;
    }

    let mass: Vec<f64> = (0..domain.n_cells())
        .map(|cell| cell_mass(domain, cell, &pdf))
        .collect();
    let total: f64 = mass.iter().sum();
    let mut expected: Vec<f64> = mass.iter().map(|m| m * f64::from(N_SAMPLES)).collect();
    if n_none == 0 {
        assert!(
            (total - 1.0).abs() < MASS_TOLERANCE,
            "the density integrates to {total}"
        );
    } else {
        observed.push(n_none);
        expected.push((1.0 - total).max(0.0) * f64::from(N_SAMPLES));
    }
    let result = chi_square_test(&observed, &expected);
    assert!(
        result.p_value >= FALSE_ALARM_RATE,
        "drawn and stated densities differ: {result:?}"
    );
}

/// Integral of `pdf` over one cell.
fn cell_mass<D: Domain>(domain: &D, cell: usize, pdf: impl Fn(D::Point) -> f32) -> f64 {
    // The plastic-number sequence (Roberts 2018): even in the plane for any number of points.
    const STEP: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
    let sum: f64 = (0..N_POINTS)
        .map(|i| {
            let u = STEP.map(|s| (0.5 + s * f64::from(i)).fract());
            let (p, measure) = domain.point(cell, u);
            f64::from(pdf(p)) * measure
        })
        .sum();
    sum / f64::from(N_POINTS)
}

/// Directions, in equal cells of a cap around an axis and one cell for the rest of the sphere.
#[derive(Clone, Copy, Debug)]
pub struct Directions {
    frame: Frame,
    cos_min: f64,
}

/// Cells of a cap along cosθ and around the axis.
const CAP_CELLS: [usize; 2] = [12, 24];

impl Directions {
    /// The whole sphere.
    pub fn sphere() -> Self {
        Self::cap(Vec3::Z, -1.0)
    }

    /// A cap of cosine `cos_min` around the unit vector `axis`: choose it to fit a density that is narrow.
    pub fn cap(axis: Vec3, cos_min: f32) -> Self {
        Self {
            frame: Frame::from_normal(axis),
            cos_min: f64::from(cos_min),
        }
    }
}

impl Domain for Directions {
    type Point = Vec3;

    fn n_cells(&self) -> usize {
        CAP_CELLS[0] * CAP_CELLS[1] + usize::from(self.cos_min > -1.0)
    }

    fn cell(&self, p: Vec3) -> usize {
        let local = self.frame.to_local(p).as_dvec3();
        // 1 − cosθ from sinθ close to the axis, where the f32 cosine has lost it.
        let sin_2 = local.x * local.x + local.y * local.y;
        let one_minus_cos = if local.z > 0.7 {
            sin_2 / (1.0 + (1.0 - sin_2).sqrt())
        } else {
            1.0 - local.z
        };
        let height = one_minus_cos / (1.0 - self.cos_min);
        if height >= 1.0 && self.cos_min > -1.0 {
            return CAP_CELLS[0] * CAP_CELLS[1];
        }
        let turn = (local.y.atan2(local.x) / std::f64::consts::TAU).rem_euclid(1.0);
        let index = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        index(height, CAP_CELLS[0]) * CAP_CELLS[1] + index(turn, CAP_CELLS[1])
    }

    fn point(&self, cell: usize, u: [f64; 2]) -> (Vec3, f64) {
        let (one_minus_cos, turn, measure) = if cell == CAP_CELLS[0] * CAP_CELLS[1] {
            let low = 1.0 - self.cos_min;
            let rest = 2.0 - low;
            (low + u[0] * rest, u[1], std::f64::consts::TAU * rest)
        } else {
            let cap = 1.0 - self.cos_min;
            let height = ((cell / CAP_CELLS[1]) as f64 + u[0]) / CAP_CELLS[0] as f64;
            let turn = ((cell % CAP_CELLS[1]) as f64 + u[1]) / CAP_CELLS[1] as f64;
            let n_cells = (CAP_CELLS[0] * CAP_CELLS[1]) as f64;
            (height * cap, turn, std::f64::consts::TAU * cap / n_cells)
        };
        let sin = (one_minus_cos * (2.0 - one_minus_cos)).sqrt();
        let (s, c) = (turn * std::f64::consts::TAU).sin_cos();
        let local = glam::DVec3::new(sin * c, sin * s, 1.0 - one_minus_cos).as_vec3();
        (self.frame.to_world(local), measure)
    }
}

/// Distances, or any real numbers, in cells between the given edges.
#[derive(Clone, Debug)]
pub struct Distances {
    edges: Vec<f32>,
}

impl Distances {
    /// Cells between ascending `edges`; the last edge may be infinite. All samples must lie between the outermost.
    pub fn between(edges: Vec<f32>) -> Self {
        debug_assert!(edges.len() >= 2 && edges.is_sorted());
        Self { edges }
    }

    /// `n` equal cells from `min` to `max`.
    pub fn even(min: f32, max: f32, n: usize) -> Self {
        let edge = |i: usize| min + (max - min) * (i as f32 / n as f32);
        Self::between((0..=n).map(edge).collect())
    }
}

impl Domain for Distances {
    type Point = f32;

    fn n_cells(&self) -> usize {
        self.edges.len() - 1
    }

    fn cell(&self, p: f32) -> usize {
        let above = self.edges.partition_point(|&e| e <= p);
        above.saturating_sub(1).min(self.n_cells() - 1)
    }

    fn point(&self, cell: usize, u: [f64; 2]) -> (f32, f64) {
        let (low, high) = (f64::from(self.edges[cell]), f64::from(self.edges[cell + 1]));
        if high.is_finite() {
            ((low + u[0] * (high - low)) as f32, high - low)
        } else {
            // t = low + s u/(1 − u) covers the half line; s makes cells of any scale alike.
            let scale = low.abs().max(1.0);
            let rest = 1.0 - u[0];
            ((low + scale * u[0] / rest) as f32, scale / (rest * rest))
        }
    }
}

/// Points of the unit square, in equal cells.
#[derive(Clone, Copy, Debug)]
pub struct UnitSquare {
    /// Cells along each side.
    pub n: [usize; 2],
}

impl Domain for UnitSquare {
    type Point = [f32; 2];

    fn n_cells(&self) -> usize {
        self.n[0] * self.n[1]
    }

    fn cell(&self, p: [f32; 2]) -> usize {
        let index = |x: f32, n: usize| ((f64::from(x) * n as f64) as usize).min(n - 1);
        index(p[1], self.n[1]) * self.n[0] + index(p[0], self.n[0])
    }

    fn point(&self, cell: usize, u: [f64; 2]) -> ([f32; 2], f64) {
        let corner = [cell % self.n[0], cell / self.n[0]];
        let along = |axis: usize| ((corner[axis] as f64 + u[axis]) / self.n[axis] as f64) as f32;
        ([along(0), along(1)], 1.0 / self.n_cells() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    fn even(u: [f32; 2]) -> Vec3 {
        crate::warp::uniform_sphere(u)
    }

    #[test]
    fn cells_hold_the_points_they_produce() {
        let domain = Directions::cap(Vec3::new(0.6, 0.0, -0.8), 0.3);
        for cell in 0..domain.n_cells() {
            let (p, _) = domain.point(cell, [0.37, 0.61]);
            assert_eq!(domain.cell(p), cell);
        }
    }

    #[test]
    fn an_even_sampler_passes() {
        assert_conforms(
            &Directions::sphere(),
            1,
            |u| Some((even(u), 0.25 / PI)),
            |_| 0.25 / PI,
        );
    }

    #[test]
    fn a_sampler_that_fails_half_the_time_passes_with_half_the_density() {
        assert_conforms(
            &Directions::sphere(),
            2,
            |u| {
                let w = even(u);
                (w.z > 0.0).then_some((w, 0.25 / PI))
            },
            |w| if w.z > 0.0 { 0.25 / PI } else { 0.0 },
        );
    }

    #[test]
    #[should_panic(expected = "drawn and stated densities differ")]
    fn a_sampler_five_percent_off_is_caught() {
        let pdf = |w: Vec3| (1.0 + 0.05 * w.z) * 0.25 / PI;
        assert_conforms(
            &Directions::sphere(),
            3,
            |u| Some((even(u), pdf(even(u)))),
            pdf,
        );
    }

    #[test]
    #[should_panic(expected = "integrates to")]
    fn a_density_without_norm_is_caught() {
        assert_conforms(
            &Directions::sphere(),
            4,
            |u| Some((even(u), 0.24 / PI)),
            |_| 0.24 / PI,
        );
    }
}
