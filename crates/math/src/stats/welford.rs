//! Running mean and variance.

/// Mean and variance of a stream of numbers, in one pass and without cancellation.
///
/// Welford 1962, "Note on a Method for Calculating Corrected Sums of Squares and Products"; merging after Chan et al.
/// 1983, "Algorithms for Computing the Sample Variance".
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Welford {
    count: u64,
    mean: f64,
    /// Σ (x − mean)².
    squares: f64,
}

impl Welford {
    /// Nothing seen yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in `x`.
    pub fn push(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.squares += delta * (x - self.mean);
    }

    /// Takes in all that `other` has seen.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let count = self.count + other.count;
        let delta = other.mean - self.mean;
        let share = other.count as f64 / count as f64;
        self.mean += delta * share;
        self.squares += other.squares + delta * delta * share * self.count as f64;
        self.count = count;
    }

    /// How many numbers were seen.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Their mean; 0 before the first.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased estimate of the variance of one number; infinite with fewer than two.
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            f64::INFINITY
        } else {
            self.squares / (self.count - 1) as f64
        }
    }

    /// Standard error of the mean; infinite with fewer than two numbers.
    pub fn standard_error(&self) -> f64 {
        (self.variance() / self.count.max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_survive_a_large_offset_and_a_merge() {
        let offset = 1e9;
        let (mut whole, mut left, mut right) = (Welford::new(), Welford::new(), Welford::new());
        for i in 0..1000_u32 {
            let x = offset + f64::from(i);
            whole.push(x);
            if i < 300 { &mut left } else { &mut right }.push(x);
        }
        left.merge(&right);
        left.merge(&Welford::new());
        for w in [whole, left] {
            // Mean (n − 1)/2 and variance n (n + 1)/12 of 0 … n − 1.
            assert!((w.mean() - offset - 499.5).abs() < 1e-6);
            assert!((w.variance() - 1000.0 * 1001.0 / 12.0).abs() < 1e-3);
            assert_eq!(w.count(), 1000);
        }
        assert!(Welford::new().standard_error().is_infinite());
    }
}
