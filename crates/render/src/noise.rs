//! The noise of an image, pixel by pixel, and where more samples would lower it most.
//!
//! The film measures it from its two halves; the render stops by it and deals out samples.

/// What noise adds to the squared error of an image.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Pixels of a row.
    pub(crate) width: usize,
    /// What each pixel adds, row by row.
    pub(crate) squared: Vec<f64>,
    /// Samples each pixel has.
    pub(crate) taken: Vec<u32>,
}

impl Noise {
    /// The error that noise makes: the square root of the mean over pixels.
    pub fn error(&self) -> f64 {
        mean(&self.squared).sqrt()
    }

    /// How many samples each pixel should have so that the error becomes `target`, row by row: in proportion to the root of what a
    /// sample's variance adds to the squared error, which needs the fewest in all. No pixel is told to have fewer than it has, or
    /// more than `growth` times that.
    ///
    /// The variances are means over 3 × 3 pixels: two halves tell little of one.
    pub fn goals(&self, target: f64, growth: u32) -> Vec<u32> {
        let smooth = self.mean_3x3();
        let root: Vec<f64> = (smooth.iter().zip(&self.taken))
            .map(|(v, &n)| (v * f64::from(n)).sqrt())
            .collect();
        // At the border smoothing may lose some of the error.
        let lost = (mean(&self.squared) / mean(&smooth)).max(1.0);
        let scale = lost * mean(&root) / (target * target);
        let goal = |(root, &n): (&f64, &u32)| {
            let most = n.saturating_mul(growth);
            let wanted = (root * scale).ceil().min(f64::from(most)) as u32;
            // Even, so that the halves stay alike.
            wanted.saturating_add(wanted & 1).max(n)
        };
        root.iter().zip(&self.taken).map(goal).collect()
    }

    /// The mean of the 3 × 3 pixels around every pixel; fewer at the border.
    fn mean_3x3(&self) -> Vec<f64> {
        let width = self.width.max(1);
        let height = self.squared.len() / width;
        let around = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        let pixel = |i: usize| {
            let (rows, columns) = (around(i / width, height), around(i % width, width));
            let n = rows.len() * columns.len();
            let sum: f64 = rows
                .flat_map(|y| columns.clone().map(move |x| self.squared[y * width + x]))
                .sum();
            sum / n as f64
        };
        (0..self.squared.len()).map(pixel).collect()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(width: usize, squared: &[f64]) -> Noise {
        Noise {
            width,
            squared: squared.to_vec(),
            taken: vec![8; squared.len()],
        }
    }

    #[test]
    fn even_noise_asks_for_as_many_samples_everywhere() {
        let noise = noise(4, &[0.04; 12]);
        assert!((noise.error() - 0.2).abs() < 1e-12);
        assert_eq!(noise.goals(0.15, 4), [16; 12]);
        assert_eq!(
            noise.goals(0.01, 4),
            [32; 12],
            "no more than fourfold at once"
        );
        assert_eq!(noise.goals(1.0, 4), [8; 12], "no fewer than there are");
    }

    #[test]
    fn samples_go_where_noise_is() {
        let mut squared = [1e-6; 64];
        squared[27] = 1.0;
        let goals = noise(8, &squared).goals(0.05, 4);
        assert_eq!((goals[27], goals[26], goals[63]), (32, 32, 8));
    }

    #[test]
    fn an_error_above_the_target_always_asks_for_samples() {
        // In a corner, where smoothing lowers the mean.
        for target in [0.01, 0.3, 0.5, 0.55, 0.57] {
            let noise = noise(3, &[1.0, 0.0, 0.0]);
            assert!(noise.error() > target);
            assert!(noise.goals(target, 4).iter().sum::<u32>() > 24, "{target}");
        }
    }
}
