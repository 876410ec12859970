//! What holds for any media and any ray.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::Vec3;
use proptest::prelude::*;
use tyndall_math::Ray;
use tyndall_media::{Density, Media, Medium, MediumParams, Region};

fn point(size: f32) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-size..size).prop_map(Vec3::from)
}

fn direction() -> impl Strategy<Value = Vec3> {
    prop_oneof![
        4 => point(1.0).prop_filter_map("too short for a direction", Vec3::try_normalize),
        1 => prop::sample::select(vec![Vec3::X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::new(0.6, 0.0, -0.8)]),
    ]
}

fn region() -> impl Strategy<Value = Region> {
    prop_oneof![
        Just(Region::Everywhere),
        (point(3.0), prop::array::uniform3(0.1f32..4.0)).prop_map(|(min, size)| Region::Box {
            min,
            max: min + Vec3::from(size)
        }),
        (point(3.0), 0.1f32..3.0).prop_map(|(center, radius)| Region::Sphere { center, radius }),
    ]
}

fn density() -> impl Strategy<Value = Density> {
    prop_oneof![
        Just(Density::Constant(1.0)),
        (0.1f32..1.0).prop_map(Density::Constant),
        (-3.0f32..3.0, -1.0f32..1.5).prop_map(|(base, log)| Density::Height {
            base,
            scale_height: 10f32.powf(log)
        }),
    ]
}

fn coefficient() -> impl Strategy<Value = f32> {
    prop_oneof![1 => Just(0.0), 5 => (-3.0f32..1.5).prop_map(|log| 10f32.powf(log))]
}

fn media() -> impl Strategy<Value = Media> {
    let medium = (region(), density(), prop::array::uniform3(coefficient())).prop_map(
        |(region, density, sigma_t)| {
            let params = MediumParams {
                region,
                density,
                ..MediumParams::new(sigma_t.into(), Vec3::ONE)
            };
            Medium::new(params).unwrap()
        },
    );
    prop::collection::vec(medium, 0..6).prop_map(Media::new)
}

fn length() -> impl Strategy<Value = f32> {
    prop_oneof![0.01f32..20.0, Just(f32::INFINITY)]
}

/// The largest extinction any point can have in a channel; densities here are at most 1.
fn most(media: &Media, channel: usize) -> f32 {
    media.list().iter().map(|m| m.sigma_t()[channel]).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn distance_is_the_inverse_of_optical_depth(
        media in media(), origin in point(4.0), direction in direction(), t_max in length(),
        fraction in 0.0f32..1.0, channel in 0usize..3
    ) {
        let ray = Ray::new(origin, direction);
        let segment = media.segment(&ray, t_max);
        let total = segment.total()[channel];
        prop_assert!(!total.is_nan());
        if total == 0.0 {
            prop_assert_eq!(segment.distance_at(channel, 1e-6), None);
            return Ok(());
        }
        let tau = fraction * total.min(20.0);
        let t = segment.distance_at(channel, tau).ok_or(TestCaseError::fail("within the total"))?;
        let (first, last) = segment.range();
        prop_assert!(first <= t && t <= last);
        let back = segment.optical_depth(t)[channel];
        // Rounding of t to f32, and of sums of up to five terms.
        let tolerance = most(&media, channel) * f32::EPSILON * t + 2e-6 * tau;
        prop_assert!((back - tau).abs() <= tolerance, "{} instead of {}", back, tau);
        if total.is_finite() {
            prop_assert_eq!(segment.distance_at(channel, total * 1.0001), None);
        }
    }

    #[test]
    fn distance_grows_with_optical_depth_and_optical_depth_with_distance(
        media in media(), origin in point(4.0), direction in direction(), t_max in length(), channel in 0usize..3
    ) {
        let ray = Ray::new(origin, direction);
        let segment = media.segment(&ray, t_max);
        let total = segment.total()[channel].min(20.0);
        let (mut t, mut tau) = (0.0, 0.0);
        for i in 0..100 {
            let Some(next) = segment.distance_at(channel, total * i as f32 / 100.0) else {
                break;
            };
            prop_assert!(next >= t);
            t = next;
            let next = segment.optical_depth(t_max.min(20.0) * i as f32 / 100.0)[channel];
            // Sums of f32 terms round each for itself.
            prop_assert!(next >= tau * (1.0 - 1e-6));
            tau = next;
        }
    }

    #[test]
    fn a_sampled_distance_lies_in_a_medium(
        media in media(), origin in point(4.0), direction in direction(), tau in 0.0f32..3.0, channel in 0usize..3
    ) {
        let ray = Ray::new(origin, direction);
        let segment = media.segment(&ray, 1e3);
        if let Some(t) = segment.distance_at(channel, tau) {
            prop_assert!(segment.sigma_t(t)[channel] > 0.0 || direction.y > 0.0);
        }
    }

    #[test]
    fn the_segment_and_the_shadow_ray_agree_and_a_ray_in_two_parts_adds_up(
        media in media(), origin in point(4.0), direction in direction(), t_max in 0.01f32..20.0, cut in 0.0f32..1.0
    ) {
        let ray = Ray::new(origin, direction);
        let whole = media.optical_depth(&ray, t_max);
        prop_assert_eq!(whole, media.segment(&ray, t_max).total());
        let middle = cut * t_max;
        let parts = media.optical_depth(&ray, middle)
            + media.optical_depth(&Ray::new(ray.at(middle), direction), t_max - middle);
        for channel in 0..3 {
            // The middle point is rounded to f32 coordinates, up to 24; the two rays run a rounding apart,
            // which matters most where one grazes a ball: a chord of c changes by the radius times that over c.
            let tolerance = 2e-6 * whole[channel] + most(&media, channel) * 6e-3;
            prop_assert!((whole[channel] - parts[channel]).abs() <= tolerance);
        }
    }

    #[test]
    fn moving_an_end_along_the_ray_adds_the_extinction_there(media in media(), a in point(4.0), b in point(4.0)) {
        prop_assume!(a.distance(b) > 0.1);
        // At a boundary either side may be meant.
        prop_assume!(media.distance_to_boundary(a) > 1e-4 && media.distance_to_boundary(b) > 1e-4);
        let found = media.optical_depth_gradient(a, b);
        let n = (b - a).normalize();
        for channel in 0..3 {
            let (d_a, d_b) = (found.d_a[channel], found.d_b[channel]);
            prop_assert!(d_a.is_finite() && d_b.is_finite());
            let start = media.at(a).sigma_t[channel];
            let end = media.at(b).sigma_t[channel];
            // f32 dot products of gradients that may be far larger across the ray than along it; and extinction in f32 itself
            // errs by the rounding of its exponent, many scale heights up by more than one unit in the last place.
            let exponent = |sigma: f32| {
                if sigma > 0.0 {
                    1.0 + (most(&media, channel) / sigma).max(1.0).ln()
                } else {
                    1.0
                }
            };
            prop_assert!((n.dot(d_a) + start).abs() <= 2e-6 * (start * exponent(start) + d_a.length()));
            prop_assert!((n.dot(d_b) - end).abs() <= 2e-6 * (end * exponent(end) + d_b.length()));
        }
        let (tau, rigid) = media.optical_depth_gradient_rigid(&Ray::new(a, n), a.distance(b));
        for channel in 0..3 {
            prop_assert!((tau[channel] - found.tau[channel]).abs() <= 3e-6 * (tau[channel] + most(&media, channel)));
            let both = found.d_a[channel] + found.d_b[channel];
            // The direction is rounded to f32; where a ray grazes a boundary that changes the gradient itself.
            let scale = most(&media, channel) + found.d_a[channel].length() + found.d_b[channel].length();
            let grazing = scale * scale / most(&media, channel).max(1e-6);
            prop_assert!((rigid[channel] - both).length() <= 1e-5 * scale + 1e-5 * grazing);
        }
    }

    #[test]
    fn nothing_is_ever_nan(
        media in media(), origin in prop_oneof![point(4.0), point(1e6), point(1e30)], direction in direction(),
        t_max in prop_oneof![Just(0.0), 1e-30f32..1e30, Just(f32::MAX), Just(f32::INFINITY)]
    ) {
        let ray = Ray::new(origin, direction);
        let segment = media.segment(&ray, t_max);
        prop_assert!(!segment.total().is_nan() && !segment.optical_depth(t_max).is_nan());
        prop_assert!(!(-media.optical_depth(&ray, t_max)).exp().is_nan());
        let (tau, gradient) = media.optical_depth_gradient_rigid(&ray, t_max);
        prop_assert!(!tau.is_nan() && gradient.iter().all(|g| g.is_finite()));
        let ends = media.optical_depth_gradient(origin, ray.at(t_max.min(1e30)));
        prop_assert!(!ends.tau.is_nan() && ends.d_a.iter().chain(&ends.d_b).all(|g| g.is_finite()));
        for tau in [0.0, 1e-30, 1.0, 1e30, f32::INFINITY] {
            let t = segment.distance_at(0, tau);
            prop_assert!(t.is_none_or(|t| (0.0..=t_max).contains(&t)));
        }
        let point = media.at(origin);
        prop_assert!(point.sigma_t.is_finite() && point.grad_ln_sigma_s().iter().all(|g| g.is_finite()));
    }
}
