//! Second derivatives of optical depth: closed forms, differences, and what must stay finite.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::{DMat3, DVec3, Vec3};
use proptest::prelude::*;
use std::f64::consts::PI;
use tyndall_math::{Jet, Ray};
use tyndall_media::{Density, Media, Medium, MediumParams, Region};

/// The two ends of the benchmark's segment; the second is the one that moves.
const A: DVec3 = DVec3::new(0.25, 0.125, -0.5);
const B: DVec3 = DVec3::new(1.75, 1.5, 0.75);

fn one(region: Region, density: Density, sigma_t: f32) -> Media {
    let params = MediumParams {
        region,
        density,
        ..MediumParams::new(Vec3::splat(sigma_t), Vec3::ONE)
    };
    Media::new(vec![Medium::new(params).unwrap()])
}

fn fog(base: f32, scale_height: f32) -> Density {
    Density::Height { base, scale_height }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

fn norm(m: DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Equal in value, gradient and Hessian to `tolerance` of each one's size.
fn assert_near(found: &Jet, expected: &Jet, tolerance: f64) {
    assert!(
        (found.value - expected.value).abs() <= tolerance * expected.value.abs()
            && (found.gradient - expected.gradient).length()
                <= tolerance * expected.gradient.length()
            && norm(found.hessian - expected.hessian) <= tolerance * norm(expected.hessian),
        "{found:?} instead of {expected:?}"
    );
}

/// (1 − e^(−w))/w and its first two derivatives, by their series: for |w| up to some 4.
fn mean_exponential(w: f64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    // Σ (−w)ⁿ/(n + 1)!, differentiated term by term; forty terms leave 4⁴⁰/40!, some 1e-24.
    let mut term = 1.0;
    for n in 0..40 {
        let n = f64::from(n);
        sums[0] += term;
        sums[1] -= term * (n + 1.0) / (n + 2.0);
        sums[2] += term * (n + 1.0) / (n + 3.0);
        term *= -w / (n + 2.0);
    }
    sums
}

/// τ = σ(a) r E(w), w = k (b − a) · y, in the field σ e^(−k y), with its derivatives by b.
fn exponential(sigma: f64, k: f64, a: DVec3, b: DVec3) -> Jet {
    let r = a.distance(b);
    let n = (b - a) / r;
    let at_a = sigma * (-k * a.y).exp();
    let [e, d_e, d2_e] = mean_exponential(k * (b.y - a.y));
    let across = DMat3::IDENTITY - outer(n, n);
    let y = DVec3::Y;
    Jet {
        value: at_a * r * e,
        gradient: at_a * (n * e + r * k * d_e * y),
        hessian: at_a
            * (e * across / r
                + k * d_e * (outer(n, y) + outer(y, n))
                + r * k * k * d2_e * outer(y, y)),
    }
}

#[test]
fn homogeneous_fog_has_the_hessian_of_the_distance() {
    let sigma_t = 0.75;
    let media = one(Region::Everywhere, Density::Constant(1.0), sigma_t);
    for b in [B, A + DVec3::Y, A + 1e-6 * DVec3::X, 1e6 * B] {
        let r = A.distance(b);
        let n = (b - A) / r;
        let sigma_t = f64::from(sigma_t);
        let exact = Jet {
            value: sigma_t * r,
            gradient: sigma_t * n,
            hessian: (DMat3::IDENTITY - outer(n, n)) * (sigma_t / r),
        };
        for tau in media.optical_depth_jet(A, b) {
            assert_near(&tau, &exact, 1e-14);
        }
        let [rigid, ..] = media.optical_depth_jet_rigid(A, n, r);
        assert!(rigid.gradient.length() < 1e-15 && norm(rigid.hessian) < 1e-15);
    }
}

#[test]
fn exponential_fog_has_its_exact_hessian_down_to_level_segments() {
    // Of the benchmark, 0.9 e^(−1.3 y), to all its digits: what the closed form of this test is worth.
    let exact = exponential(0.9, 1.3, A, B);
    assert!((exact.value / 0.8509967169603773 - 1.0).abs() < 1e-14);
    let gradient = DVec3::new(
        0.22382379404985264,
        -0.19134142939663748,
        0.18651982837487718,
    );
    assert!((exact.gradient - gradient).length() < 1e-14);

    // As a height fog with a base below the segment, and coefficients as f32 knows them.
    let (sigma_t, scale_height, base) = (0.9_f32, (1.0 / 1.3_f64) as f32, -1.0_f32);
    let media = one(Region::Everywhere, fog(base, scale_height), sigma_t);
    let k = 1.0 / f64::from(scale_height);
    let sigma = f64::from(sigma_t) * (k * f64::from(base)).exp();
    for rise in [
        1.375, 0.5, 1e-2, 1e-3, 1e-5, 1e-7, 1e-12, 0.0, -1e-9, -1e-4, -0.3, -1.0,
    ] {
        let b = B.with_y(A.y + rise);
        let [tau, ..] = media.optical_depth_jet(A, b);
        assert_near(&tau, &exponential(sigma, k, A, b), 1e-12);
        // The other way round: the symmetry of the formula is not used by the code.
        let [tau, ..] = media.optical_depth_jet(b, A);
        assert_near(&tau, &exponential(sigma, k, b, A), 1e-12);
        // Translated, the field is only multiplied by e^(−k h).
        let n = (b - A).normalize();
        let [tau, ..] = media.optical_depth_jet_rigid(A, n, A.distance(b));
        let value = exponential(sigma, k, A, b).value;
        let exact = Jet {
            value,
            gradient: -k * value * DVec3::Y,
            hessian: k * k * value * outer(DVec3::Y, DVec3::Y),
        };
        assert_near(&tau, &exact, 1e-12);
    }
}

#[test]
fn endless_rays_have_the_derivatives_of_what_is_above() {
    let media = one(Region::Everywhere, fog(0.0, 2.0), 0.5);
    // σt H e^(−y/H)/slope above the base, linear in height below.
    let d = DVec3::new(0.6, 0.8, 0.0);
    let [above, ..] = media.optical_depth_jet_rigid(DVec3::Y, d, f64::INFINITY);
    let tau = 1.25 * (-0.5_f64).exp();
    let exact = Jet {
        value: tau,
        gradient: -0.5 * tau * DVec3::Y,
        hessian: 0.25 * tau * outer(DVec3::Y, DVec3::Y),
    };
    assert_near(&above, &exact, 1e-14);
    let [below, ..] = media.optical_depth_jet_rigid(-DVec3::Y, d, f64::INFINITY);
    assert_near(&below, &Jet::linear(1.25 * 1.5, -0.625 * DVec3::Y), 1e-14);
    // Level, all fog there is: no light comes through, wherever the origin moves.
    let endless = media.optical_depth_jet_rigid(DVec3::Y, DVec3::X, f64::INFINITY);
    assert_eq!(endless, [Jet::from(f64::INFINITY); 3]);
    assert_eq!((-endless[0]).exp().gradient, DVec3::ZERO);
}

/// Fixed lamp, moving point, isotropic and Henyey–Greenstein fog: the benchmark's light that has scattered once.
#[test]
fn a_lamp_in_fog_has_its_exact_hessian_when_written_in_jets() {
    let (lamp, intensity) = (DVec3::new(1.1, -0.4, 1.6), 2.5);
    let x = DVec3::new(0.3, 0.2, 0.1);
    let w = DVec3::new(0.2, 0.3, -0.9).normalize();
    let media = one(Region::Everywhere, Density::Constant(1.0), 0.8);
    let rows = [
        // (g, radiance, gradient, Hessian)
        (
            0.0,
            0.014470994365050189,
            [
                0.012261502426130694,
                -0.00919612681959802,
                0.02299031704899505,
            ],
            [
                [
                    -0.0001656523331424594,
                    -0.011370919274640682,
                    0.028427298186601703,
                ],
                [
                    -0.011370919274640682,
                    -0.006798688576682857,
                    -0.021320473639951276,
                ],
                [
                    0.028427298186601703,
                    -0.021320473639951276,
                    0.03797430606721482,
                ],
            ],
        ),
        (
            0.5,
            0.03409774815960881,
            [
                0.06261379008927302,
                -0.018713630366640734,
                0.03736850518316383,
            ],
            [
                [
                    0.10769333570745783,
                    -0.05025465971046406,
                    0.09982121367060852,
                ],
                [
                    -0.05025465971046406,
                    -0.043968871089868924,
                    -0.04015262284599376,
                ],
                [
                    0.09982121367060852,
                    -0.04015262284599376,
                    0.026235841597043327,
                ],
            ],
        ),
        (
            0.9,
            0.010903925816867588,
            [
                0.031911035711437954,
                -0.0049425828682479805,
                0.0060262258655097885,
            ],
            [
                [
                    0.11373874071216832,
                    -0.020731507989832004,
                    0.02296998519188622,
                ],
                [
                    -0.020731507989832004,
                    -0.02359718007750491,
                    -0.011083938633284957,
                ],
                [
                    0.02296998519188622,
                    -0.011083938633284957,
                    -0.0036764126265842367,
                ],
            ],
        ),
        (
            -0.7,
            0.0017733201980903723,
            [
                0.0010601700483935418,
                -0.0011656880178197541,
                0.0030377402050575848,
            ],
            [
                [
                    -0.0005250775857964712,
                    -0.0010056245025939175,
                    0.002597768947278716,
                ],
                [
                    -0.0010056245025939175,
                    -0.00045946234121692895,
                    -0.0027848424762435676,
                ],
                [
                    0.002597768947278716,
                    -0.0027848424762435676,
                    0.0057098652848107554,
                ],
            ],
        ),
    ];
    for (g, value, gradient, hessian) in rows {
        let way = Jet::point(x) - lamp;
        let mu = (way / way.length()).dot_fixed(w);
        let d: f64 = 1.0 + g * g - 2.0 * g * mu.value;
        let p = (1.0 - g * g) / (4.0 * PI * d.powf(1.5));
        let phase = mu.map(p, 3.0 * g * p / d, 15.0 * g * g * p / (d * d));
        let [tau, ..] = media.optical_depth_jet(lamp, x);
        let found = phase * (-tau).exp() * intensity / way.dot(way);
        let exact = Jet {
            value,
            gradient: gradient.into(),
            hessian: DMat3::from_cols_array_2d(&hessian),
        };
        // 0.8 in f32 is 1.5e-8 larger, and the depth about 1.5.
        assert_near(&found, &exact, 1e-7);
    }
}

#[test]
fn coinciding_points_have_no_depth_and_no_derivatives() {
    let media = one(Region::Everywhere, fog(0.0, 1.0), 2.0);
    assert_eq!(media.optical_depth_jet(A, A), [Jet::ZERO; 3]);
}

fn any_region() -> impl Strategy<Value = Region> {
    prop_oneof![
        Just(Region::Everywhere),
        Just(Region::Box {
            min: Vec3::new(-1.0, -0.5, -0.8),
            max: Vec3::new(0.7, 1.0, 1.1)
        }),
        Just(Region::Sphere {
            center: Vec3::new(0.1, 0.2, -0.3),
            radius: 1.1
        }),
    ]
}

fn any_density() -> impl Strategy<Value = Density> {
    prop_oneof![
        Just(Density::Constant(0.7)),
        (-1.0f32..1.0, -1.0f32..1.5).prop_map(|(base, log)| fog(base, 10f32.powf(log))),
    ]
}

fn any_point() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-2.0f32..2.0).prop_map(Vec3::from)
}

/// Gradient and Hessian are central differences of value and gradient; rows where two step lengths disagree, across a kink
/// or near grazing, say nothing.
fn check_differences(f: impl Fn(DVec3) -> Jet) -> Result<(), TestCaseError> {
    let jet = f(DVec3::ZERO);
    prop_assert_eq!(jet.hessian, jet.hessian.transpose());
    for (i, axis) in DVec3::AXES.into_iter().enumerate() {
        let [(coarse, coarse_column), (slope, column)] = [2e-5, 1e-5].map(|h| {
            let (after, before) = (f(h * axis), f(-h * axis));
            (
                (after.value - before.value) / (2.0 * h),
                (after.gradient - before.gradient) / (2.0 * h),
            )
        });
        // Both err by less where the function is smooth on the scale of a centimetre; rounding over h is 1e-10.
        let tolerance = 1e-7 * (1.0 + jet.gradient.length() + norm(jet.hessian));
        if (coarse - slope).abs() > tolerance || (coarse_column - column).length() > tolerance {
            continue;
        }
        prop_assert!(
            (jet.gradient[i] - slope).abs() < tolerance,
            "{jet:?} {slope}"
        );
        prop_assert!(
            (jet.hessian.col(i) - column).length() < 3.0 * tolerance,
            "{jet:?} {i} {column}"
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn hessians_are_the_differences_of_gradients(
        region in any_region(), density in any_density(), a in any_point(), b in any_point()
    ) {
        prop_assume!(a.distance(b) > 0.05);
        let (a, b) = (a.as_dvec3(), b.as_dvec3());
        let media = one(region, density.clone(), 1.0);
        check_differences(|h| media.optical_depth_jet(a, b + h)[0])?;
        let direction = (b - a).normalize();
        for length in [a.distance(b), f64::INFINITY] {
            let moved = |h| media.optical_depth_jet_rigid(a + h, direction, length)[0];
            if moved(DVec3::ZERO).value.is_finite() {
                check_differences(moved)?;
            }
        }
    }

    #[test]
    fn value_and_gradient_are_those_of_the_gradient_to_rounding(
        region in any_region(), density in any_density(), a in any_point(), b in any_point(), endless in prop::bool::ANY
    ) {
        prop_assume!(a != b);
        let media = one(region, density, 0.5);
        // Some roundings of f32, of the result or of the extinction, 0.5, in a direction of nearly unit length.
        let near = |jet: &Jet, tau: f32, gradient: Vec3| {
            (jet.value == f64::from(tau) || (jet.value - f64::from(tau)).abs() <= 2e-7 * jet.value)
                && (jet.gradient - gradient.as_dvec3()).length() <= 3e-7 * (0.5 + jet.gradient.length())
        };
        let jet = media.optical_depth_jet(a.as_dvec3(), b.as_dvec3())[1];
        let ends = media.optical_depth_gradient(a, b);
        prop_assert!(near(&jet, ends.tau.y, ends.d_b[1]), "{jet:?} {ends:?}");

        let length = if endless { f32::INFINITY } else { a.distance(b) };
        let ray = Ray::new(a, (b - a).normalize());
        let direction = ray.direction.as_dvec3();
        let jet = media.optical_depth_jet_rigid(a.as_dvec3(), direction, length.into())[1];
        let (tau, gradient) = media.optical_depth_gradient_rigid(&ray, length);
        prop_assert!(near(&jet, tau.y, gradient[1]), "{jet:?} {tau} {gradient:?}");
    }

    #[test]
    fn along_the_line_only_the_density_at_the_end_counts(
        region in any_region(), density in any_density(), a in any_point(), b in any_point()
    ) {
        prop_assume!(a.distance(b) > 0.01);
        let media = one(region, density.clone(), 1.0);
        prop_assume!(region.distance_to_boundary(b) > 1e-5);
        let n = (b - a).as_dvec3().normalize();
        let [tau, ..] = media.optical_depth_jet(a.as_dvec3(), b.as_dvec3());
        let sigma_t = if region.contains(b) { density.value(b) } else { 0.0 };
        prop_assert!((n.dot(tau.gradient) - f64::from(sigma_t)).abs() < 1e-6 * f64::from(density.value(b).max(density.value(a))));
    }
}

/// Everything that could overflow, cancel or divide by 0: far and near, dense and empty, grazing within 1e-15.
#[test]
fn all_derivatives_are_finite_and_symmetric_at_the_extremes() {
    let regions = [
        Region::Everywhere,
        Region::Box {
            min: -Vec3::ONE,
            max: Vec3::ONE,
        },
        Region::Sphere {
            center: Vec3::ZERO,
            radius: 1.0,
        },
    ];
    let densities = [
        Density::Constant(1.0),
        Density::Constant(0.0),
        fog(0.0, 1.0),
        fog(1.0, 1e-6),
        fog(-1.0, 1e6),
    ];
    let mut directions = DVec3::AXES.to_vec();
    for tilt in [1e-300, 1e-40, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.3] {
        directions.push(DVec3::new(1.0, tilt, 0.0).normalize());
        directions.push(DVec3::new(1.0, -tilt, tilt).normalize());
        directions.push(DVec3::new(tilt, -1.0, 0.0).normalize());
    }
    let origins = [
        DVec3::ZERO,
        DVec3::Y,
        DVec3::new(-2.0, 1.0, 0.0),
        DVec3::new(-2.0, 1.0 - 1e-12, 0.0),
        DVec3::new(0.0, -1.0, 0.5),
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(1e5, 1e5, -1e5),
        DVec3::new(0.0, 1e6, 0.0),
    ];
    let lengths = [
        0.0,
        1e-300,
        1e-30,
        1e-6,
        1e-3,
        1.0,
        2.0,
        1e3,
        1e6,
        f64::INFINITY,
    ];
    for region in regions {
        for density in &densities {
            for sigma_t in [0.0, 1e-6, 1.0, 1e6] {
                let media = one(region, density.clone(), sigma_t);
                for origin in origins {
                    for &direction in &directions {
                        for length in lengths {
                            let rigid = media.optical_depth_jet_rigid(origin, direction, length);
                            check_finite(&rigid[0], &(region, density, origin, direction, length));
                            if length.is_finite() {
                                let end = origin + direction * length;
                                for (a, b) in [(origin, end), (end, origin)] {
                                    let [tau, ..] = media.optical_depth_jet(a, b);
                                    check_finite(&tau, &(region, density, a, b));
                                    assert!(tau.value.is_finite());
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn all_derivatives_are_finite_at_any_scale(
        region in any_region(), density in any_density(), log_sigma in -6.0f32..6.0, log_scale in -6.0f64..6.0,
        log_length in -6.0f64..6.0, a in any_point(), direction in any_point(), log_tilt in -16.0f64..0.0
    ) {
        let media = one(region, density.clone(), 10f32.powf(log_sigma));
        let tilt = 10f64.powf(log_tilt);
        let a = a.as_dvec3() * 10f64.powf(log_scale);
        prop_assume!(direction.length() > 1e-3);
        let direction = (direction.as_dvec3() * DVec3::new(1.0, tilt, 1.0)).normalize();
        let length = 10f64.powf(log_length);
        let b = a + direction * length;
        check_finite(&media.optical_depth_jet(a, b)[2], &(region, &density, a, b));
        for length in [length, f64::INFINITY] {
            let tau = media.optical_depth_jet_rigid(a, direction, length)[2];
            check_finite(&tau, &(region, &density, a, direction, length));
        }
    }
}

/// Derivatives are finite and the Hessian symmetric, and so they are of the transmittance.
fn check_finite(tau: &Jet, case: &impl std::fmt::Debug) {
    assert!(tau.value >= 0.0, "{case:?}: {tau:?}");
    assert!(
        tau.gradient.is_finite() && tau.hessian.is_finite(),
        "{case:?}: {tau:?}"
    );
    assert_eq!(tau.hessian, tau.hessian.transpose(), "{case:?}");
    let transmittance = (-*tau).exp();
    assert!(transmittance.is_finite(), "{case:?}: {transmittance:?}");
}

/// On the kink of a height fog derivatives are those from above, beside it those of its side, however the line leaves.
#[test]
fn at_the_base_derivatives_are_those_of_one_side() {
    let regions = [
        Region::Everywhere,
        // Its floor is the base.
        Region::Box {
            min: Vec3::new(-4.0, 0.3, -4.0),
            max: Vec3::new(4.0, 3.0, 4.0),
        },
        // Its ceiling is.
        Region::Box {
            min: Vec3::new(-4.0, -3.0, -4.0),
            max: Vec3::new(4.0, 0.3, 4.0),
        },
    ];
    let base = 0.3_f32;
    let heights = [
        (base.next_down(), -1.0),
        (base, 1.0),
        (base.next_up(), 1.0),
        (base + 0.5, 1.0),
        (base - 0.5, -1.0),
    ];
    let mut cases = 0;
    for region in regions {
        let media = one(region, fog(base, 0.7), 0.6);
        for (y, side) in heights {
            let x = DVec3::new(0.2, y.into(), -0.1);
            for rise in [-2.0, -0.4, -0.1, 0.0, 0.1, 0.4, 2.0] {
                for lateral in [0.0, 0.3, 1.0] {
                    let way = DVec3::new(lateral, rise, 0.5 * lateral);
                    // As transport finds the point: not to the last digit.
                    let fixed = x + way.length() * way.normalize();
                    let on_boundary = region.distance_to_boundary(x.as_vec3()) < 0.1;
                    if way == DVec3::ZERO || on_boundary {
                        continue;
                    }
                    check_one_side(
                        &|h| media.optical_depth_jet(fixed, x + h)[0],
                        side,
                        &(region, y, way),
                    );
                    let n = way.normalize();
                    let rigid = |h| media.optical_depth_jet_rigid(x + h, n, way.length())[0];
                    check_one_side(&rigid, side, &(region, y, way));
                    cases += 2;
                }
            }
        }
    }
    assert_eq!(cases, 360);
}

/// The Hessian is the difference of gradients, upwards or downwards to one side of a kink.
fn check_one_side(f: &dyn Fn(DVec3) -> Jet, side: f64, case: &dyn std::fmt::Debug) {
    let jet = f(DVec3::ZERO);
    let h = 1e-5;
    for (i, axis) in DVec3::AXES.into_iter().enumerate() {
        let at = |k: f64| f(k * side * h * axis).gradient;
        // Sideways at the same height the function is smooth; up and down the difference is one-sided, of second order.
        let column = if i == 1 {
            (4.0 * at(1.0) - 3.0 * at(0.0) - at(2.0)) / (2.0 * side * h)
        } else {
            (at(1.0) - at(-1.0)) / (2.0 * side * h)
        };
        // h² of fourth derivatives, some hundred; rounding over h.
        let error = (jet.hessian.col(i) - column).length();
        assert!(
            error < 1e-6,
            "{case:?} {i}: {} {column}",
            jet.hessian.col(i)
        );
    }
}
