//! Cubic Hermite interpolation, on which camera paths and glTF's cubic splines run.

/// Weights of a cubic between two keys: of the value and the slope at the first, then of the value and the slope at the second.
///
/// p(u) = (2u³ − 3u² + 1) p₀ + (u³ − 2u² + u) m₀ + (−2u³ + 3u²) p₁ + (u³ − u²) m₁
///
/// * `u` – where between the keys, from 0 to 1; slopes m are per unit of u.
///
/// glTF 2.0, appendix C.5. Exactly 1, 0, 0, 0 at u = 0 and 0, 0, 1, 0 at u = 1, so that keys are met without rounding.
pub(crate) fn weights(u: f64) -> [f64; 4] {
    let (u2, u3) = (u * u, u * u * u);
    [
        2.0 * u3 - 3.0 * u2 + 1.0,
        u3 - 2.0 * u2 + u,
        3.0 * u2 - 2.0 * u3,
        u3 - u2,
    ]
}

#[cfg(test)]
mod tests {
    use super::weights;

    #[test]
    fn values_and_slopes_at_both_ends_are_met_and_cubics_reproduced() {
        assert_eq!(weights(0.0), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(weights(1.0), [0.0, 0.0, 1.0, 0.0]);
        // u³ has values 0, 1 and slopes 0, 3; 1 has values 1, 1 and no slopes. Products of f64 round at 1e-16.
        for u in [0.1, 0.5, 0.8] {
            let [_, _, value, slope] = weights(u);
            assert!((value + 3.0 * slope - u * u * u).abs() < 1e-15);
            let [first, _, second, _] = weights(u);
            assert!((first + second - 1.0).abs() < 1e-15);
        }
    }
}
