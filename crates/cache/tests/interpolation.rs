//! What a lookup gives for fields whose answers are known.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use glam::Vec3;
use tyndall_cache::{Cache, Record};

/// A lattice of records over [−1, 1]³ that samples `field`: value and gradient at a point.
fn lattice<const N: usize>(
    spacing: f32,
    radius: f32,
    mut field: impl FnMut(Vec3) -> ([f32; N], [Vec3; N]),
) -> Cache<N> {
    let steps = (1.0 / spacing).round() as i32;
    let axis = || (-steps..=steps).map(move |i| i as f32 * spacing);
    let mut records = Vec::new();
    for x in axis() {
        for y in axis() {
            for z in axis() {
                let position = Vec3::new(x, y, z);
                let (value, gradient) = field(position);
                records.push(Record {
                    position,
                    radius,
                    value,
                    gradient,
                    variance: [0.0; N],
                });
            }
        }
    }
    let mut cache = Cache::new();
    cache.insert(records).unwrap();
    cache
}

/// Points in [−1, 1]³ by the additive recurrence of the plastic numbers (Roberts 2018).
fn points(n: usize) -> impl Iterator<Item = Vec3> {
    (0..n).map(|i| {
        let part = |step: f64| ((0.5 + step * i as f64).fract() * 2.0 - 1.0) as f32;
        Vec3::new(
            part(0.819_172_513),
            part(0.671_043_607),
            part(0.549_700_478),
        )
    })
}

fn assert_close(found: f32, expected: f32, tolerance: f32, p: Vec3) {
    assert!(
        (found - expected).abs() <= tolerance * expected,
        "{found} instead of {expected} at {p}"
    );
}

#[test]
fn a_constant_field_is_returned_to_rounding() {
    let cache = lattice(0.25, 0.5, |_| ([1.0, 0.7, 0.0], [Vec3::ZERO; 3]));
    for p in points(1000) {
        let value = cache.lookup(p).unwrap();
        // ln 1 = 0 has no rounding of its own, but the quotient of the sums of 0.7's logarithm has, and so has exp.
        assert_eq!(value[0], 1.0);
        assert_close(value[1], 0.7, 5e-7, p);
        assert_eq!(value[2], 0.0);
    }
}

#[test]
fn an_exponential_field_is_returned_to_rounding() {
    let slope = Vec3::new(-2.0, 0.5, 1.0);
    let exponential = |p: Vec3| (slope.dot(p)).exp();
    let cache = lattice(0.25, 0.5, |p| ([exponential(p)], [exponential(p) * slope]));
    for p in points(1000) {
        // Logarithms up to 3.5 are rounded to 2e-7, at the record, in its slope and in the sums.
        assert_close(cache.lookup(p).unwrap()[0], exponential(p), 2e-6, p);
    }
}

#[test]
fn a_zero_record_scales_its_neighbour_by_its_share_of_the_weight() {
    let record = |x, value: [f32; 2]| Record {
        position: Vec3::new(x, 0.0, 0.0),
        radius: 1.0,
        value,
        gradient: [Vec3::ZERO; 2],
        variance: [0.0; 2],
    };
    let mut cache = Cache::new();
    let records = vec![record(0.0, [4.0, 0.0]), record(0.8, [0.0, 0.0])];
    cache.insert(records).unwrap();
    let lookup = |x| cache.lookup(Vec3::new(x, 0.0, 0.0)).unwrap();
    // Half-way the weights are equal; left of the zero record's ball it has none. exp(ln 4) is off by an ulp or two.
    let middle = Vec3::new(0.4, 0.0, 0.0);
    assert_close(lookup(0.4)[0], 2.0, 5e-7, middle);
    assert_close(lookup(-0.3)[0], 4.0, 5e-7, middle);
    for x in [-0.3, 0.0, 0.4, 0.8, 1.5] {
        assert_eq!(lookup(x)[1], 0.0, "no light from nowhere at {x}");
    }
    assert_eq!(lookup(1.5)[0], 0.0);
}

#[test]
fn unequal_neighbours_meet_in_their_geometric_mean() {
    // exact-benchmarks E5 (4): the price of log space.
    let record = |x, value| Record {
        position: Vec3::new(x, 0.0, 0.0),
        radius: 1.0,
        value: [value],
        gradient: [Vec3::ZERO],
        variance: [0.0; 1],
    };
    let mut cache = Cache::new();
    cache
        .insert(vec![record(-0.5, 1.0), record(0.5, 1e-6)])
        .unwrap();
    // ln 1e-6 = −13.8 is rounded to 5e-7.
    assert_close(cache.lookup(Vec3::ZERO).unwrap()[0], 1e-3, 1e-6, Vec3::ZERO);
}

#[test]
fn nothing_jumps_where_a_ball_ends() {
    let record = |x, value: [f32; 2]| Record {
        position: Vec3::new(x, 0.0, 0.0),
        radius: 1.0,
        value,
        gradient: [Vec3::new(1.0, 2.0, 0.0); 2],
        variance: [0.0; 2],
    };
    let mut cache = Cache::new();
    let records = vec![record(0.0, [3.0, 5.0]), record(0.9, [7.0, 0.0])];
    cache.insert(records).unwrap();
    for rim in [-0.1_f32, 1.0] {
        let step = 1e-4;
        let [before, after] =
            [rim - step, rim + step].map(|x| cache.lookup(Vec3::new(x, 0.0, 0.0)).unwrap());
        for channel in 0..2 {
            // The values' own gradients, about 2.2 per unit of length, change them by 5e-4 over this step, and the
            // weights by 3 (step)² near the rim. A jump would be of the size of the values.
            let change = (after[channel] - before[channel]).abs();
            assert!(change < 1e-3, "{before:?} and {after:?} at {rim}");
        }
    }
}

#[test]
fn the_error_around_a_point_light_falls_with_the_radius() {
    // σt = 0.5, light at (0, 0, 3): exp(−σt r)/r², ∇ ln = −(σt + 2/r) (p − light)/r.
    let light = Vec3::new(0.0, 0.0, 3.0);
    let field = |p: Vec3| {
        let d = p - light;
        let r = d.length();
        let value = (-0.5 * r).exp() / (r * r);
        ([value], [value * -(0.5 + 2.0 / r) * d / r])
    };
    let mean_error = |spacing: f32| {
        let cache = lattice(spacing, 2.0 * spacing, field);
        let error = |p| (cache.lookup(p).unwrap()[0] / field(p).0[0] - 1.0).abs();
        points(500).map(error).sum::<f32>() / 500.0
    };
    let errors = [0.5, 0.25, 0.125].map(mean_error);
    // The log-linear blend is of first order, its error falls with the square of the radius: by 4, less near the border.
    assert!(errors[1] < errors[0] / 3.0, "{errors:?}");
    assert!(errors[2] < errors[1] / 3.0, "{errors:?}");
    assert!(errors[2] < 2e-3, "{errors:?}");
}

#[test]
fn one_record_errs_in_a_ball_as_the_exact_benchmark_says() {
    // exact-benchmarks E5: for σt = 0 and a light at distance 1 the mean error over a ball is 5 % of the mean at
    // R = 0.361251 with log-space gradients.
    let optimal_radius = 0.361_251_23;
    let field = |p: Vec3| 1.0 / (p - Vec3::Z).length_squared();
    let record = Record {
        position: Vec3::ZERO,
        // Much larger than the ball tried, so that only the extrapolation is at work.
        radius: 10.0,
        value: [1.0],
        gradient: [Vec3::new(0.0, 0.0, 2.0)],
        variance: [0.0; 1],
    };
    let mut cache = Cache::new();
    cache.insert(vec![record]).unwrap();
    let (mut error, mut truth) = (0.0, 0.0);
    for p in points(200_000).filter(|p| p.length_squared() < 1.0) {
        let p = p * optimal_radius;
        error += f64::from((cache.lookup(p).unwrap()[0] - field(p)).abs());
        truth += f64::from(field(p));
    }
    // 10⁵ points of a low-discrepancy sequence: their mean is off by about 1e-3 relatively.
    let found: f64 = error / truth;
    assert!((found - 0.05).abs() < 2e-4, "{found}");
}

#[test]
fn curvature_cancels_where_records_stand_around_a_point() {
    // ln L = −p²: every tangent lies above it, by d² for a record at distance d.
    let field = |p: Vec3| {
        let value = (-p.length_squared()).exp();
        ([value], [-2.0 * p * value])
    };
    let cache = lattice(0.25, 0.5, field);
    let mut mean = 0.0;
    for p in points(1000).map(|p| 0.5 * p) {
        mean += (cache.lookup(p).unwrap()[0] / field(p).0[0]).ln() / 1000.0;
    }
    // Records weigh in at 0.2 from a point on the average: tangents alone would err by +0.04. With d̄ a tenth of that, a hundredth
    // of it is left, and the quartic terms.
    assert!(mean.abs() < 1e-3, "{mean}");
}

#[test]
fn noise_that_records_own_up_to_does_not_darken() {
    // Records of 1 with 10 and 30 % of noise, uniform over [1 − √3 σ, 1 + √3 σ] by SplitMix64 (Steele et al. 2014).
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1_u32 << 24) as f32
    };
    for sigma in [0.1_f32, 0.3] {
        let noisy = |_| {
            let value = 1.0 + sigma * 3.0_f32.sqrt() * (2.0 * uniform() - 1.0);
            ([value], [Vec3::ZERO])
        };
        let mut records = lattice(0.0625, 0.15, noisy).records().to_vec();
        for record in &mut records {
            record.variance = [sigma * sigma];
        }
        let mut cache = Cache::new();
        cache.insert(records).unwrap();
        let mean = points(5000)
            .map(|p| cache.lookup(p).unwrap()[0])
            .sum::<f32>()
            / 5000.0;
        // Left over: of the next order 0.3 σ⁴ (E ln = −½σ² − 0.45σ⁴ for uniform noise, corrected by ½σ² + ¾σ⁴), and the mean of
        // the noise itself: 35 937 records, of which the 5 000 points see each with its own weight; 6 of their standard errors.
        let bound = 0.3 * sigma.powi(4) + 6.0 * sigma / 35_937.0_f32.sqrt();
        assert!((mean - 1.0).abs() < bound, "{sigma}: {mean} ± {bound}");
    }
}
