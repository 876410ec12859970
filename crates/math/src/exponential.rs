//! What is left of 1 − e^(−x) after a division by x, without cancellation at x = 0.
//!
//! Means over a segment of an exponential, and their derivatives by optical depth, are made of these two.

/// (1 − e^(−x))/x, the mean of e^(−xt) over t in [0, 1]; 1 at x = 0 and 0 at x = ∞.
pub fn one_minus_exp_over_x(x: f32) -> f32 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// The derivative of [`one_minus_exp_over_x`]: ((1 + x) e^(−x) − 1)/x²; −1/2 at x = 0 and 0 at x = ∞.
pub fn one_minus_exp_over_x_derivative(x: f32) -> f32 {
    // f64: of the leading terms 1/x two cancel, which costs a factor 2/x² of the rounding.
    let x = f64::from(x);
    let derivative = if x.abs() < 1e-4 {
        // The next term, x³/30, is below the rounding of f32.
        -0.5 + x / 3.0 - x * x / 8.0
    } else {
        ((-x).exp() + (-x).exp_m1() / x) / x
    };
    derivative as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_of_an_exponential_matches_its_series_and_limits() {
        // Values to 20 digits from the definition in extended precision.
        for (x, value, derivative) in [
            (0.0, 1.0, -0.5),
            (1e-20, 1.0, -0.5),
            (1e-3, 0.999_500_166_625, -0.499_666_791_633),
            (-1e-3, 1.000_500_166_708, -0.500_333_458_367),
            (1.0, 0.632_120_558_829, -0.264_241_117_657),
            (-2.0, 3.194_528_049_465, -2.097_264_024_733),
            (50.0, 0.02, -0.000_4),
            (f32::INFINITY, 0.0, 0.0),
        ] {
            // Four roundings of f32.
            let close = |a: f32, b: f64| (f64::from(a) - b).abs() <= 2.4e-7 * b.abs();
            assert!(close(one_minus_exp_over_x(x), value), "value at {x}");
            assert!(
                close(one_minus_exp_over_x_derivative(x), derivative),
                "derivative at {x}: {}",
                one_minus_exp_over_x_derivative(x)
            );
        }
    }
}
