//! Weights that turn squared differences into the project's relative error.
//!
//! Shared by the film, which stops at a target error, and by `compare`, so that both mean the same number.

use rayon::prelude::*;

/// Weights w = 1/(r² + 0.01 mean(r)²) for every value of the `smooth` reference, whose channels all have one length.
///
/// `mean` is that of the reference before it was smoothed, over all pixels and channels: lone lit pixels on black leave no trace
/// in their medians. f64, since r² leaves the range of f32 for radiances beyond 10^±19. A black reference has infinite
/// weights: see [`weighted`].
pub fn weights(smooth: &[Vec<f32>], mean: f64) -> Vec<Vec<f64>> {
    let floor = floor(mean);
    smooth
        .iter()
        .map(|channel| channel.iter().map(|&r| weight(r, floor)).collect())
        .collect()
}

/// What keeps weights of dark pixels finite, for a reference of this mean: 0.01 mean².
pub(crate) fn floor(mean: f64) -> f64 {
    0.01 * mean.powi(2)
}

/// The weight of one value `r` of the smooth reference.
pub(crate) fn weight(r: f32, floor: f64) -> f64 {
    1.0 / (f64::from(r).powi(2) + floor)
}

/// Mean over all pixels and channels.
pub fn mean(image: &[Vec<f32>]) -> f64 {
    let n = image.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    image.iter().flatten().map(|&r| f64::from(r)).sum::<f64>() / n
}

/// A squared difference times its weight; no difference is no error, whatever the weight.
pub fn weighted(squared: f64, weight: f64) -> f64 {
    if squared == 0.0 {
        0.0
    } else {
        squared * weight
    }
}

/// The median of the 5 × 5 pixels around every pixel of one channel; beyond the border the image is mirrored, border pixels repeated.
pub fn median_5x5(channel: &[f32], width: usize, height: usize) -> Vec<f32> {
    let mut out = vec![0.0; channel.len()];
    if width == 0 || height == 0 {
        return out;
    }
    out.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let rows: [usize; 5] = std::array::from_fn(|k| mirrored(y, k, height) * width);
        for (x, median) in row.iter_mut().enumerate() {
            let columns: [usize; 5] = std::array::from_fn(|k| mirrored(x, k, width));
            let mut window: [f32; 25] =
                std::array::from_fn(|k| channel[rows[k / 5] + columns[k % 5]]);
            *median = *window.select_nth_unstable_by(12, f32::total_cmp).1;
        }
    });
    out
}

/// Index `i + k − 2`, folded back at either end of `0..n`: … 1 0 | 0 1 … n−1 | n−1 n−2 …
fn mirrored(i: usize, k: usize, n: usize) -> usize {
    let period = 2 * n;
    let j = (i + k + 2 * period - 2) % period;
    j.min(period - 1 - j)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_ignores_lone_bright_pixels() {
        let mut channel = vec![2.0; 7 * 6];
        channel[17] = 1e6;
        channel[0] = 1e6;
        // The corner pixel enters its own window four times by mirroring and is still outvoted by 21.
        assert_eq!(median_5x5(&channel, 7, 6), vec![2.0; 42]);
    }

    #[test]
    fn the_median_of_a_ramp_is_the_ramp_away_from_the_border() {
        let ramp: Vec<f32> = (0..63).map(|i| (i % 9) as f32).collect();
        let median = median_5x5(&ramp, 9, 7);
        for y in 0..7 {
            assert_eq!(median[y * 9 + 2..y * 9 + 7], [2.0, 3.0, 4.0, 5.0, 6.0]);
            assert_eq!((median[y * 9], median[y * 9 + 8]), (1.0, 7.0));
        }
    }

    #[test]
    fn images_smaller_than_the_window_are_mirrored_as_often_as_needed() {
        assert_eq!(median_5x5(&[3.0], 1, 1), [3.0]);
        // Columns 1 0 | 0 1 | 1 around the first pixel, 0 0 1 | 1 0 around the second.
        assert_eq!(median_5x5(&[1.0, 5.0], 2, 1), [5.0, 1.0]);
    }

    #[test]
    fn weights_follow_their_formula() {
        let image = [vec![1.0, 3.0], vec![0.0, 4.0]];
        let w = weights(&image, mean(&image));
        let floor = 0.01 * 4.0;
        for (w, r) in w.iter().flatten().zip([1.0f64, 3.0, 0.0, 4.0]) {
            assert!((w * (r * r + floor) - 1.0).abs() < 1e-15);
        }
        assert_eq!(weighted(0.0, f64::INFINITY), 0.0);
    }
}
