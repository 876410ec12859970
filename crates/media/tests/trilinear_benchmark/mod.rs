//! The benchmark of trilinear cells (E1): its samples, and the exact optical depths and gradients of three segments.

use glam::DVec3;

/// 5 × 4 × 3 samples, this far apart.
pub(crate) const SPACING: DVec3 = DVec3::new(0.5, 0.75, 1.0);

/// The sample in a column, row and layer.
pub(crate) fn sample(i: i32, j: i32, k: i32) -> f64 {
    let hash = 7 * i + 13 * j + 29 * k + 3 * i * j + 5 * j * k + 11 * i * k;
    f64::from(hash % 17 + 1) / 8.0
}

/// From, to, τ, and ∇τ as the second point moves.
pub(crate) const ROWS: [(DVec3, DVec3, f64, [f64; 3]); 3] = [
    (
        DVec3::new(0.1, 0.2, 0.3),
        DVec3::new(1.9, 2.0, 1.7),
        2.3436509463205435,
        [0.41019725183158096, 0.8422238999423247, 0.20201558111902357],
    ),
    (
        DVec3::new(1.95, 0.05, 1.9),
        DVec3::new(0.05, 2.2, 0.1),
        3.3432550026037515,
        [
            -0.7483679289805344,
            0.7106652301353559,
            -0.020261573099377747,
        ],
    ),
    (
        DVec3::new(0.3, 1.1, 0.05),
        DVec3::new(0.3, 1.1, 1.95),
        1.9106874999999999,
        [
            -1.6080729166666665,
            -0.37142361111111105,
            1.0570833333333332,
        ],
    ),
];
