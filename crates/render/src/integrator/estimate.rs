//! The error of a finished image, measured on pixels evaluated afresh.
//!
//! At pixels chosen at random two independent unbiased evaluations r1, r2, which the image did not use, stand for the
//! truth: (x − r1)(x − r2) w has the squared error of x as its mean, however noisy r1 and r2 are.

use super::camera::{Camera, Tally};
use super::has_passed;
use super::view::View;
use crate::film::Film;
use crate::options::{Phase, Progress};
use crate::relative::{mean, median_5x5, weighted, weights};
use crate::stats::ErrorEstimate;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_scene::Scene;
use tyndall_transport::path::Reach;

/// Most pixels evaluated.
const MOST_PIXELS: usize = 1024;
/// Share of the image's samples that the evaluations may take, where [`SAMPLES`] leave the choice.
const SHARE: f64 = 0.25;
/// Fewest and most samples of one evaluation.
const SAMPLES: [u64; 2] = [4, 4096];
/// Half-width of a 95 % interval in standard errors.
const Z_95: f64 = 1.96;

/// What is measured.
pub(super) struct Estimate<'s> {
    pub(super) scene: &'s Scene,
    pub(super) view: View,
    pub(super) max_depth: Option<u32>,
    pub(super) seed: u64,
    /// When to stop with the pixels evaluated by then.
    pub(super) deadline: Option<Instant>,
}

/// One pixel's terms, means over colour channels.
struct Term {
    squared: f64,
    difference: f64,
    reference: f64,
    tally: Tally,
}

impl Estimate<'_> {
    /// Measures the error of `film`'s image; `None` where it is black throughout or time is up.
    ///
    /// After the deadline no pixel is begun: like the number of samples, this number then depends on the machine.
    pub(super) fn run(
        &self,
        film: &Film,
        progress: &dyn Progress,
    ) -> (Option<ErrorEstimate>, Tally) {
        let crop = film.crop();
        let (width, height) = (crop.width as usize, crop.height as usize);
        let colour = film.colour();
        let smooth = colour.each_ref().map(|c| median_5x5(c, width, height));
        let weights = weights(&smooth, mean(&colour));
        let budget = film.mean_samples() * (width * height) as f64 * SHARE;
        let pixels = MOST_PIXELS.min(width * height);
        let samples = ((budget / (2.0 * pixels as f64)) as u64).clamp(SAMPLES[0], SAMPLES[1]);
        let done = AtomicUsize::new(0);
        let terms: Vec<Option<Term>> = (0..pixels)
            .into_par_iter()
            .map(|i| {
                if has_passed(self.deadline) || progress.is_cancelled() {
                    return None;
                }
                let pixel = self.pixel(i, pixels, width * height);
                let x = DVec3::from_array(std::array::from_fn(|c| f64::from(colour[c][pixel])));
                let w = DVec3::from_array(std::array::from_fn(|c| weights[c][pixel]));
                let place = [
                    crop.x + (pixel % width) as u32,
                    crop.y + (pixel / width) as u32,
                ];
                let term = self.term(i, place, x, w, samples);
                let n = done.fetch_add(1, Ordering::Relaxed) + 1;
                progress.update(Phase::Estimate, n as f32 / pixels as f32, 0);
                Some(term)
            })
            .collect();
        let mut tally = Tally::default();
        let (mut squared, mut difference, mut reference) =
            (Welford::new(), Welford::new(), Welford::new());
        for term in terms.iter().flatten() {
            tally.add(&term.tally);
            squared.push(term.squared);
            difference.push(term.difference);
            reference.push(term.reference);
        }
        let mean = reference.mean();
        // Black throughout, or lit nowhere but in the evaluations: nothing to relate an error to.
        if mean.is_nan() || mean <= 0.0 || !squared.mean().is_finite() {
            return (None, tally);
        }
        let root = |x: f64| x.max(0.0).sqrt();
        let half = Z_95 * squared.standard_error();
        let bias = difference.mean() / mean;
        let bias_half = Z_95 * difference.standard_error() / mean;
        let estimate = ErrorEstimate {
            value: root(squared.mean()),
            ci95: [root(squared.mean() - half), root(squared.mean() + half)],
            bias,
            bias_ci95: [bias - bias_half, bias + bias_half],
            samples: squared.count(),
        };
        (Some(estimate), tally)
    }

    fn key(&self, index: u64) -> Key {
        Key {
            seed: self.seed,
            purpose: Purpose::Validation,
            index,
        }
    }

    /// The pixel of draw number `i` of `n`: one in each of n equal stretches of the image's `count` pixels in reading order.
    fn pixel(&self, i: usize, n: usize, count: usize) -> usize {
        let u = f64::from(Sampler::new(self.key(u64::MAX), i as u64).next_1d());
        (((i as f64 + u) / n as f64 * count as f64) as usize).min(count - 1)
    }

    /// Evaluates the pixel in column and row `place`, whose value in the image is `x`, twice.
    fn term(&self, i: usize, place: [u32; 2], x: DVec3, w: DVec3, samples: u64) -> Term {
        let camera = Camera::new(self.scene, self.view, Reach::depth(self.max_depth));
        let [column, row] = place;
        let evaluate = |half: u64| {
            let key = self.key(2 * i as u64 + half);
            let sum: DVec3 = (0..samples)
                .map(|s| camera.path_traced(column, row, &mut Sampler::new(key, s)))
                .map(|p| (p.surface + p.single + p.multiple + p.emission).as_dvec3())
                .filter(|sum| sum.is_finite())
                .sum();
            sum / samples as f64
        };
        let (r1, r2) = (evaluate(0), evaluate(1));
        let reference = (r1 + r2) * 0.5;
        Term {
            squared: (0..3)
                .map(|c| weighted((x[c] - r1[c]) * (x[c] - r2[c]), w[c]))
                .sum::<f64>()
                / 3.0,
            difference: (x - reference).element_sum() / 3.0,
            reference: reference.element_sum() / 3.0,
            tally: camera.tally(),
        }
    }
}
