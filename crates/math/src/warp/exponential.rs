//! Distances that fall off exponentially and end at a given length.

/// Distances in [0, length) with density ∝ e^(−σt): free paths that are known to end on a segment.
#[derive(Clone, Copy, Debug)]
pub struct TruncatedExponential {
    sigma: f32,
    length: f32,
    /// 1 − e^(−σ length), the probability of ending on the segment.
    mass: f32,
}

impl TruncatedExponential {
    /// `sigma` ≥ 0 per metre and `length` > 0 metres, which may be infinite where `sigma` > 0.
    pub fn new(sigma: f32, length: f32) -> Self {
        debug_assert!(sigma >= 0.0 && length > 0.0 && (sigma > 0.0 || length.is_finite()));
        Self {
            sigma,
            length,
            mass: -(-sigma * length).exp_m1(),
        }
    }

    /// A distance in metres and its density per metre.
    pub fn sample(&self, u: f32) -> (f32, f32) {
        // In a vacuum, or one too thin for f32 to tell, the density is even.
        let t = if self.mass > 0.0 {
            -(-u * self.mass).ln_1p() / self.sigma
        } else {
            u * self.length
        };
        let t = t.min(self.length);
        (t, self.pdf(t))
    }

    /// Density per metre at distance `t`; 0 outside the segment.
    pub fn pdf(&self, t: f32) -> f32 {
        if !(0.0..=self.length).contains(&t) {
            0.0
        } else if self.mass > 0.0 {
            self.sigma * (-self.sigma * t).exp() / self.mass
        } else {
            1.0 / self.length
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Distances, assert_conforms};

    #[test]
    fn distances_fall_off_exponentially_on_thin_thick_and_endless_segments() {
        for (seed, sigma, length) in [
            (71, 0.7, 3.0),
            (72, 0.0, 3.0),
            (73, 1e-9, 3.0),
            (74, 1e-40, 3.0),
            (75, 40.0, 3.0),
            (76, 2.0, f32::INFINITY),
        ] {
            let d = TruncatedExponential::new(sigma, length);
            let scale = if sigma * length > 1.0 {
                1.0 / sigma
            } else {
                length
            };
            let mut edges: Vec<f32> = (0..40).map(|i| scale * 0.15 * i as f32).collect();
            edges.retain(|&e| e < length);
            edges.push(length);
            assert_conforms(
                &Distances::between(edges),
                seed,
                |u| Some(d.sample(u[0])),
                |t| d.pdf(t),
            );
        }
    }
}
