//! Means with their errors, and tests that say how likely a deviation is by chance.
//!
//! All of it is f64: sums are long and tail probabilities small.

mod gamma;
mod welford;

pub use welford::Welford;

use gamma::upper_gamma;

/// Probability that a standard normal variable lies at least `z` from 0, on either side.
///
/// erfc(|z|/√2) = Q(1/2, z²/2).
pub fn normal_p_value(z: f64) -> f64 {
    upper_gamma(0.5, 0.5 * z * z)
}

/// Probability that `mean`, of standard error `error`, lies so far from `expected` or farther by chance.
///
/// 0 where the error is 0 and the values differ. Holds for means of many samples (the normal limit).
pub fn z_test(mean: f64, error: f64, expected: f64) -> f64 {
    let difference = mean - expected;
    if difference == 0.0 {
        1.0
    } else {
        normal_p_value(difference / error)
    }
}

/// Probability that a variable of Student's t-distribution with `degrees_of_freedom` is at least as far from 0 as `t`.
///
/// By the normal variable of the same chance, to a relative error of some per cent in chances down to 10⁻⁹ from 10 degrees of
/// freedom on: z = (8n + 1)/(8n + 3) √(n ln(1 + t²/n)). Wallace 1959, "Bounds on normal approximations to Student's and the
/// chi-square distributions", equation 1.7.
pub fn student_t_p_value(t: f64, degrees_of_freedom: f64) -> f64 {
    let n = degrees_of_freedom;
    let z = (8.0 * n + 1.0) / (8.0 * n + 3.0) * (n * (t * t / n).ln_1p()).sqrt();
    normal_p_value(z)
}

/// Probability that a χ² variable of `degrees_of_freedom` reaches `statistic`.
pub fn chi_square_p_value(statistic: f64, degrees_of_freedom: f64) -> f64 {
    upper_gamma(0.5 * degrees_of_freedom, 0.5 * statistic)
}

/// What [`chi_square_test`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// Σ (observed − expected)²/expected over the pooled cells.
    pub statistic: f64,
    /// Pooled cells less one.
    pub degrees_of_freedom: usize,
    /// Probability of such a statistic or a larger one by chance.
    pub p_value: f64,
}

/// Fewest counts expected of a cell; below, the statistic is not χ² distributed and cells are pooled.
const MIN_EXPECTED: f64 = 10.0;

/// Pearson's test of `observed` counts against `expected` ones; both of equal length and, but for rounding, of equal sum.
///
/// Cells in which fewer than 10 counts are expected are pooled, smallest first.
pub fn chi_square_test(observed: &[u64], expected: &[f64]) -> ChiSquare {
    debug_assert_eq!(observed.len(), expected.len());
    let mut cells: Vec<(f64, f64)> = expected
        .iter()
        .zip(observed)
        .map(|(&e, &o)| (e, o as f64))
        .collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pools: Vec<(f64, f64)> = Vec::with_capacity(cells.len());
    for (e, o) in cells {
        match pools.last_mut() {
            Some(pool) if pool.0 < MIN_EXPECTED => *pool = (pool.0 + e, pool.1 + o),
            _ => pools.push((e, o)),
        }
    }
    // The last pool may still be too small; it joins the one before.
    if let Some(&(e, o)) = pools.last()
        && e < MIN_EXPECTED
        && pools.len() > 1
    {
        pools.pop();
        if let Some(pool) = pools.last_mut() {
            *pool = (pool.0 + e, pool.1 + o);
        }
    }
    let statistic = pools.iter().map(|(e, o)| (o - e).powi(2) / e).sum();
    let degrees_of_freedom = pools.len().saturating_sub(1);
    ChiSquare {
        statistic,
        degrees_of_freedom,
        p_value: if degrees_of_freedom == 0 {
            1.0
        } else {
            chi_square_p_value(statistic, degrees_of_freedom as f64)
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tail_probabilities_match_tables() {
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-10 * b;
        // erfc(z/√2) for z = 1, 1.959964…, 5.
        assert!(close(normal_p_value(1.0), 0.317_310_507_862_914_1));
        assert!(close(normal_p_value(-1.959_963_984_540_054), 0.05));
        assert!(close(normal_p_value(5.0), 5.733_031_437_583_869e-7));
        // Two degrees of freedom: e^(−x/2); four: e^(−x/2) (1 + x/2).
        for x in [0.1_f64, 1.0, 10.0, 100.0, 1000.0] {
            assert!(close(chi_square_p_value(x, 2.0), (-0.5 * x).exp()));
            assert!(close(
                chi_square_p_value(x, 4.0),
                (-0.5 * x).exp() * (1.0 + 0.5 * x)
            ));
        }
        assert_eq!(chi_square_p_value(0.0, 7.0), 1.0);
        assert_eq!(normal_p_value(f64::INFINITY), 0.0);
    }

    #[test]
    fn student_s_distribution_meets_its_tables() {
        // Two-sided points of the usual tables: 10 and 23 degrees of freedom.
        for (t, n, p) in [
            (2.228, 10.0, 0.05),
            (4.587, 10.0, 0.001),
            (2.069, 23.0, 0.05),
            (3.768, 23.0, 0.001),
        ] {
            let found = student_t_p_value(t, n);
            assert!((found / p - 1.0).abs() < 0.04, "{t} {n}: {found}");
        }
    }

    #[test]
    fn a_fair_die_passes_and_a_loaded_one_does_not() {
        let fair = chi_square_test(&[103, 95, 99, 110, 92, 101], &[100.0; 6]);
        assert_eq!(fair.degrees_of_freedom, 5);
        assert!(fair.p_value > 0.5);
        let loaded = chi_square_test(&[180, 84, 84, 84, 84, 84], &[100.0; 6]);
        assert!(loaded.p_value < 1e-6);
    }

    #[test]
    fn cells_with_few_counts_are_pooled() {
        let pooled = chi_square_test(&[100, 3, 2, 6, 100], &[100.0, 4.0, 3.0, 4.0, 100.0]);
        assert_eq!(pooled.degrees_of_freedom, 2);
        assert_eq!(pooled.statistic, 0.0);
        // Ten and ten again, and five more in the second.
        let small = chi_square_test(&[1; 25], &[1.0; 25]);
        assert_eq!((small.degrees_of_freedom, small.statistic), (1, 0.0));
        let impossible = chi_square_test(&[100, 100, 0], &[0.0, 100.0, 100.0]);
        assert!(impossible.p_value < 1e-6);
    }

    #[test]
    fn a_mean_three_errors_away_is_a_three_sigma_event() {
        assert!((z_test(10.3, 0.1, 10.0) - 0.002_699_796).abs() < 1e-8);
        assert_eq!(z_test(1.0, 0.0, 1.0), 1.0);
        assert_eq!(z_test(2.0, 0.0, 1.0), 0.0);
    }
}
