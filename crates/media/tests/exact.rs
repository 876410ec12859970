//! Optical depth and its gradient against exact values, through the public interface.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::{DVec3, Vec3};
use tyndall_math::Ray;
use tyndall_media::{Density, EndGradients, Media, Medium, MediumParams, Region};

/// The two ends of the benchmark's segment; the second is the one that moves.
const A: Vec3 = Vec3::new(0.25, 0.125, -0.5);
const B: Vec3 = Vec3::new(1.75, 1.5, 0.75);

fn one(params: MediumParams) -> Media {
    Media::new(vec![Medium::new(params).unwrap()])
}

/// The benchmark's exponential field 0.9 exp(−1.3 height) per metre, as a height fog whose base lies below the segment.
fn exponential_field() -> Media {
    let (sigma, rate, base) = (0.9_f64, 1.3_f64, -1.0_f64);
    one(MediumParams {
        density: Density::Height {
            base: base as f32,
            scale_height: (1.0 / rate) as f32,
        },
        ..MediumParams::new(
            Vec3::splat((sigma * (-rate * base).exp()) as f32),
            Vec3::ONE,
        )
    })
}

/// Compares with τ and ∇τ, both computed with 18 digits; 1e-6 covers f32 coefficients, coordinates and results.
fn check(found: &EndGradients, tau: f64, gradient: [f64; 3]) {
    let gradient = DVec3::from(gradient);
    for channel in 0..3 {
        let found_tau = f64::from(found.tau[channel]);
        assert!(
            (found_tau / tau - 1.0).abs() < 1e-6,
            "{found_tau} instead of {tau}"
        );
        let found_gradient = found.d_b[channel].as_dvec3();
        assert!(
            (found_gradient - gradient).length() < 1e-6 * gradient.length(),
            "{found_gradient} instead of {gradient}"
        );
    }
}

#[test]
fn a_constant_field_has_the_exact_depth_and_gradient() {
    let media = one(MediumParams::new(Vec3::splat(0.7), Vec3::ONE));
    // The benchmark is written with z up: its second and third coordinates are exchanged here and below.
    check(
        &media.optical_depth_gradient(A, B),
        1.671685152772495,
        [0.43967609497577953, 0.4030364203944646, 0.36639674581314957],
    );
}

#[test]
fn an_exponential_field_has_the_exact_depth_and_gradient_down_to_level_segments() {
    let media = exponential_field();
    let rows = [
        // (rise of the segment, τ, ∇τ)
        (
            1.375,
            0.8509967169603773,
            [
                0.22382379404985264,
                -0.19134142939663748,
                0.18651982837487718,
            ],
        ),
        (
            1e-3,
            1.4927682123002397,
            [0.5873184868542617, -0.9696975608199422, 0.4894320723785514],
        ),
        (
            1e-5,
            1.4937288167308749,
            [0.5876965836164046, -0.9709177092297611, 0.48974715301367056],
        ),
        (
            1e-7,
            1.4937384288766324,
            [0.5877003654596571, -0.9709299185529705, 0.48975030454971424],
        ),
        (
            0.0,
            1.4937385259696303,
            [0.5877004036601825, -0.9709300418802598, 0.48975033638348536],
        ),
    ];
    for (rise, tau, gradient) in rows {
        let b = Vec3::new(B.x, A.y + rise, B.z);
        let found = media.optical_depth_gradient(A, b);
        check(&found, tau, gradient);
        // Exchanging the ends exchanges their gradients.
        let back = media.optical_depth_gradient(b, A);
        check(
            &EndGradients {
                d_b: back.d_a,
                ..back
            },
            tau,
            gradient,
        );
        // And the depth is that of the ray.
        let ray = Ray::new(A, (b - A).normalize());
        let depth = media.optical_depth(&ray, A.distance(b)).x;
        assert!((f64::from(depth) / tau - 1.0).abs() < 1e-6);
    }
}

#[test]
fn shells_with_gaps_and_overlaps_add_up() {
    let shell = |min: f32, max: f32, sigma_t: f32| {
        Medium::new(MediumParams {
            region: Region::Box {
                min: Vec3::new(min, -1.0, -1.0),
                max: Vec3::new(max, 1.0, 1.0),
            },
            ..MediumParams::new(Vec3::splat(sigma_t), Vec3::ONE)
        })
        .unwrap()
    };
    // 1 m of 0.5; a gap of 1 m; 2 m of 0.25 with 1 m of 2 inside.
    let media = Media::new(vec![
        shell(0.0, 1.0, 0.5),
        shell(2.0, 4.0, 0.25),
        shell(2.5, 3.5, 2.0),
    ]);
    let ray = Ray::new(Vec3::new(-1.0, 0.0, 0.0), Vec3::X);
    for (t, tau) in [
        (1.0, 0.0),
        (1.5, 0.25),
        (2.0, 0.5),
        (2.9, 0.5),
        (3.5, 0.625),
        (4.5, 2.875),
        (9.0, 3.0),
    ] {
        assert!(
            (media.optical_depth(&ray, t).y - tau).abs() < 1e-6,
            "at {t}"
        );
        assert!(
            (media.segment(&ray, 100.0).optical_depth(t).y - tau).abs() < 1e-6,
            "at {t}"
        );
    }
    let segment = media.segment(&ray, f32::INFINITY);
    assert_eq!(segment.range(), (1.0, 5.0));
    for (tau, t) in [
        (0.0, 1.0),
        (0.25, 1.5),
        (0.5, 2.0),
        (0.5625, 3.25),
        (1.75, 4.0),
        (3.0, 5.0),
    ] {
        assert!(
            (segment.distance_at(1, tau).unwrap() - t).abs() < 1e-6,
            "for {tau}"
        );
    }
    assert_eq!(segment.distance_at(1, 3.001), None);
}

#[test]
fn a_box_split_in_two_is_the_same_medium() {
    let part = |min: Vec3, max: Vec3| {
        Medium::new(MediumParams {
            region: Region::Box { min, max },
            density: Density::Height {
                base: 0.0,
                scale_height: 0.5,
            },
            ..MediumParams::new(Vec3::new(1.0, 3.0, 0.0), Vec3::ONE)
        })
        .unwrap()
    };
    let (min, max) = (-Vec3::ONE, Vec3::ONE);
    let whole = Media::new(vec![part(min, max)]);
    let halves = Media::new(vec![
        part(min, max.with_x(0.25)),
        part(min.with_x(0.25), max),
    ]);
    let (a, b) = (Vec3::new(-2.0, -0.9, 0.3), Vec3::new(1.5, 0.8, -0.2));
    let (one, two) = (
        whole.optical_depth_gradient(a, b),
        halves.optical_depth_gradient(a, b),
    );
    assert!(one.tau.abs_diff_eq(two.tau, 1e-6));
    for channel in 0..3 {
        assert!(one.d_a[channel].abs_diff_eq(two.d_a[channel], 3e-6));
        assert!(one.d_b[channel].abs_diff_eq(two.d_b[channel], 3e-6));
    }
}

#[test]
fn channels_far_apart_or_empty_keep_to_themselves() {
    let media = one(MediumParams::new(
        Vec3::new(0.002, 0.0, 10_000.0),
        Vec3::ONE,
    ));
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let tau = media.optical_depth(&ray, 50.0);
    assert!(
        (tau - Vec3::new(0.1, 0.0, 500_000.0))
            .abs()
            .cmple(1e-6 * tau)
            .all()
    );
    let endless = media.optical_depth(&ray, f32::INFINITY);
    assert_eq!(endless, Vec3::new(f32::INFINITY, 0.0, f32::INFINITY));
    assert_eq!((-endless).exp(), Vec3::new(0.0, 1.0, 0.0));
    let segment = media.segment(&ray, f32::INFINITY);
    assert_eq!(segment.total(), endless);
    assert_eq!(segment.distance_at(0, 0.1), Some(50.0));
    assert_eq!(segment.distance_at(1, 0.1), None);
    assert!((segment.distance_at(2, 1.0).unwrap() - 1e-4).abs() < 1e-10);
    let (rigid, gradient) = media.optical_depth_gradient_rigid(&ray, f32::INFINITY);
    assert_eq!(rigid, endless);
    assert_eq!(gradient, [Vec3::ZERO; 3]);
}

#[test]
fn vacuum_meets_nothing() {
    let media = one(MediumParams::new(Vec3::ZERO, Vec3::ONE));
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert!(media.is_empty() && media.segment(&ray, 1.0).is_empty());
    assert_eq!(media.optical_depth(&ray, f32::INFINITY), Vec3::ZERO);
    assert_eq!(media.list().len(), 1);
    assert!(media.distance_to_boundary(Vec3::ZERO).is_infinite());
    assert!(media.bounds().unwrap().is_empty());
}
