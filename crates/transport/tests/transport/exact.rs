//! The path tracer and the gather of records against exact solutions of radiative transfer.
//!
//! Values: Sun et al. 2005 (airlight), Davison 1947 and Case and Zweifel 1967 (infinite medium), and integral equations
//! for the sphere, computed to eight digits and more outside this project.

use crate::rig::{Estimate, Lamps, OPEN, Room, fog, pixel, sphere};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose, Ray};
use tyndall_media::{
    Asymmetry, HenyeyGreenstein, Media, Medium, MediumParams, PhaseFunction, Region,
};
use tyndall_transport::World;
use tyndall_transport::gather::{self, GatherPattern};
use tyndall_transport::path::Reach;

fn hg(g: f32) -> PhaseFunction {
    PhaseFunction::HenyeyGreenstein(HenyeyGreenstein::new(Asymmetry::new(g).unwrap()))
}

#[test]
fn airlight_of_a_lamp_beside_the_ray_is_exact() {
    // σs, σt, t0, h, then isotropic, HG −0.5, 0.5, 0.9, Rayleigh. The rows with a finite ray of 6 m differ from these by < 1e-5.
    let rows = [
        (
            0.5,
            1.0,
            2.0,
            1.0,
            [
                0.004466580927,
                0.002171208651,
                0.006069084823,
                0.001848727281,
                0.004440118985,
            ],
        ),
        (
            1.0,
            1.0,
            3.0,
            2.0,
            [
                0.0007033791283,
                0.0002724808992,
                0.0009597241821,
                0.000243616825,
                0.0006934166238,
            ],
        ),
        (
            0.5,
            1.0,
            2.0,
            1e-3,
            [
                16.83526224,
                23.60257898,
                23.94972583,
                107.749008,
                18.91711971,
            ],
        ),
        (
            0.5,
            1.0,
            2.0,
            1e-6,
            [
                16916.75437,
                23988.34788,
                23989.12467,
                108267.7866,
                19031.29823,
            ],
        ),
        (
            0.5,
            1.0,
            -1.0,
            0.75,
            [
                0.00243058488,
                0.007696717608,
                0.0005948031704,
                7.506172204e-05,
                0.00317744027,
            ],
        ),
    ];
    for (sigma_s, sigma_t, t0, h, exact) in rows {
        // The lamp stands at the origin, where f32 resolves how close the ray passes.
        let lamps = Lamps::points(&[(Vec3::ZERO, 1.0)]);
        let ray = Ray::new(Vec3::new(-t0, h, 0.0), Vec3::X);
        let phases = [
            PhaseFunction::Isotropic,
            hg(-0.5),
            hg(0.5),
            hg(0.9),
            PhaseFunction::Rayleigh,
        ];
        for (phase, exact) in phases.into_iter().zip(exact) {
            let media = fog(sigma_t, sigma_s / sigma_t, Region::Everywhere, phase);
            let world = World {
                geometry: &OPEN,
                lights: &lamps,
                media: &media,
            };
            // A sharp lobe beside the lamp varies most along the ray: seven times the samples hold the same bound.
            let n = if phase == hg(0.9) { 1_400_000 } else { 200_000 };
            let (layers, estimate) = pixel(&world, ray, Some(1), n);
            assert_eq!(layers.multiple, Vec3::ZERO);
            estimate.check(&format!("airlight h {h} {phase:?}"), exact, 5e-3, 1e-4);
        }
    }
}

#[test]
fn all_orders_beside_a_lamp_in_endless_fog_are_exact() {
    let rows = [
        (0.5, 3.0, 1.0, 0.000366021974),
        (0.5, 0.0, 2.0, 0.000223101629),
        (0.9, 3.0, 0.25, 0.00668568228),
        (0.9, 0.0, 2.0, 0.00206576405),
    ];
    for (albedo, t0, h, exact) in rows {
        let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / PI)]);
        let media = fog(1.0, albedo, Region::Everywhere, PhaseFunction::Isotropic);
        let world = World {
            geometry: &OPEN,
            lights: &lamps,
            media: &media,
        };
        let (_, estimate) = pixel(
            &world,
            Ray::new(Vec3::new(-t0, h, 0.0), Vec3::X),
            None,
            400_000,
        );
        estimate.check(
            &format!("pixel c {albedo} t0 {t0} h {h}"),
            exact,
            7e-3,
            1e-4,
        );
    }
}

#[test]
fn spheres_under_a_uniform_sky_are_exact() {
    // Radius, albedo, impact over radius, radiance.
    let rows = [
        (0.5, 0.5, 0.05, 0.620510966),
        (1.0, 0.9, 0.5, 0.850197215),
        (3.0, 0.9, 0.9, 0.757320682),
        (8.0, 0.5, 0.5, 0.143859797),
        (8.0, 0.99, 0.05, 0.88676283),
    ];
    for (radius, albedo, impact, exact) in rows {
        let lamps = Lamps::sky(1.0);
        let media = fog(1.0, albedo, sphere(radius), PhaseFunction::Isotropic);
        let world = World {
            geometry: &OPEN,
            lights: &lamps,
            media: &media,
        };
        let ray = Ray::new(Vec3::new(-2.0 * radius, impact * radius, 0.0), Vec3::X);
        let (_, estimate) = pixel(&world, ray, None, 200_000);
        estimate.check(&format!("sphere R {radius} c {albedo}"), exact, 5e-3, 1e-5);
    }
}

#[test]
fn a_lamp_and_a_sky_add_up() {
    // E3.6 (a) and (b) by superposition: lights chosen by importance must not favour one another. R = 1, c = 0.9, b = 0.5 R.
    for power in [4.0f32, 40.0, 400.0] {
        let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 * power / PI)]).with_sky(1.0);
        let media = fog(1.0, 0.9, sphere(1.0), PhaseFunction::Isotropic);
        let world = World {
            geometry: &OPEN,
            lights: &lamps,
            media: &media,
        };
        let ray = Ray::new(Vec3::new(-2.0, 0.5, 0.0), Vec3::X);
        let (_, estimate) = pixel(&world, ray, None, 60_000);
        let exact = 0.850197215 + 0.0144271722 * f64::from(power);
        estimate.check(&format!("lamp of {power} W under a sky"), exact, 1e-2, 1e-4);
    }
}

#[test]
fn equal_lamps_in_one_place_add_up_in_a_room_with_walls() {
    // E3.7, R = 1, c = 0.9, ρ = 0.5: seven lamps share the power of one. Surfaces, media and roulette all choose lights.
    let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / (7.0 * PI)); 7]);
    let room = Room {
        radius: 1.0,
        reflectance: 0.5,
        emission: 0.0,
    };
    let media = fog(1.0, 0.9, sphere(1.0), PhaseFunction::Isotropic);
    let world = World {
        geometry: &room,
        lights: &lamps,
        media: &media,
    };
    let ray = Ray::new(Vec3::new(-0.866 * 0.9999, 0.5 * 0.9999, 0.0), Vec3::X);
    let (_, estimate) = pixel(&world, ray, None, 40_000);
    estimate.check("seven lamps in a room", 0.0312182537, 2e-2, 3e-4);
}

#[test]
fn unequal_lamps_apart_add_up_in_a_room_with_walls() {
    let places = [
        (Vec3::new(0.5, 0.1, 0.0), 1.0),
        (Vec3::new(-0.4, 0.3, 0.5), 0.05),
        (Vec3::new(0.0, -0.6, -0.2), 0.3),
    ];
    let room = Room {
        radius: 1.0,
        reflectance: 0.7,
        emission: 0.0,
    };
    let media = fog(1.5, 0.8, sphere(1.0), PhaseFunction::Isotropic);
    let seen = |lamps: &[(Vec3, f32)]| {
        let lamps = Lamps::points(lamps);
        let world = World {
            geometry: &room,
            lights: &lamps,
            media: &media,
        };
        let ray = Ray::new(Vec3::new(-0.866 * 0.9999, 0.5 * 0.9999, 0.0), Vec3::X);
        pixel(&world, ray, None, 40_000).1
    };
    let all = seen(&places);
    let single: Vec<Estimate> = places.iter().map(|lamp| seen(&[*lamp])).collect();
    let sum: f64 = single.iter().map(Estimate::mean).sum();
    let error = single
        .iter()
        .map(Estimate::error)
        .fold(all.error(), f64::hypot);
    println!("together {:.5}, apart {sum:.5} ± {error:.5}", all.mean());
    assert!((all.mean() - sum).abs() < 4.5 * error);
    assert!(error < 0.03 * sum);
}

#[test]
fn a_white_furnace_shows_one_everywhere() {
    // Colour channels of different extinction, forward and backward scattering, thin and thick.
    let mixture = PhaseFunction::mixture(&[(0.7, hg(0.8)), (0.3, hg(-0.3))]).unwrap();
    for (sigma, phase) in [
        (Vec3::new(0.2, 1.0, 5.0), PhaseFunction::Isotropic),
        (Vec3::new(0.0, 2.0, 2.0), hg(0.8)),
        (Vec3::splat(8.0), hg(-0.6)),
        (Vec3::splat(4.0), PhaseFunction::Rayleigh),
        (Vec3::splat(4.0), mixture),
    ] {
        let lamps = Lamps::sky(1.0);
        let media = Media::new(vec![
            Medium::new(MediumParams {
                region: sphere(1.0),
                phase,
                ..MediumParams::new(sigma, Vec3::ONE)
            })
            .unwrap(),
        ]);
        let world = World {
            geometry: &OPEN,
            lights: &lamps,
            media: &media,
        };
        let ray = Ray::new(Vec3::new(-2.0, 0.3, 0.0), Vec3::X);
        let (_, estimate) = pixel(&world, ray, None, 200_000);
        estimate.check(&format!("furnace {sigma} {phase:?}"), 1.0, 3e-3, 1e-5);
    }
}

#[test]
fn an_isothermal_furnace_shows_its_temperature() {
    let room = Room {
        radius: 1.5,
        reflectance: 0.4,
        emission: 0.6,
    };
    let sigma = Vec3::new(0.5, 2.0, 1.0);
    let albedo = Vec3::new(0.3, 0.9, 0.0);
    let media = Media::new(vec![
        Medium::new(MediumParams {
            region: sphere(1.0),
            emission: sigma * (Vec3::ONE - albedo),
            ..MediumParams::new(sigma, albedo)
        })
        .unwrap(),
    ]);
    let lamps = Lamps::default();
    let world = World {
        geometry: &room,
        lights: &lamps,
        media: &media,
    };
    let (_, estimate) = pixel(
        &world,
        Ray::new(Vec3::new(0.9, 0.9, 0.0), Vec3::NEG_X),
        None,
        200_000,
    );
    estimate.check("isothermal", 1.0, 3e-3, 1e-5);
}

#[test]
fn a_closed_room_with_fog_and_a_lamp_is_exact() {
    // R, c, then the pixels at impact 0.5 R and 0.9 R; wall reflectance 0.5, lamp of power 1 in the centre. Last the samples that
    // bring the standard error below 0.5 %.
    let rows = [
        (0.5, 0.5, 0.056222844, 0.0527146057, 300_000),
        (1.0, 0.9, 0.0312182537, 0.0223040907, 500_000),
        (3.0, 1.0, 0.00614531122, 0.00421723991, 700_000),
    ];
    for (radius, albedo, half, edge, samples) in rows {
        let room = Room {
            radius,
            reflectance: 0.5,
            emission: 0.0,
        };
        let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / PI)]);
        let media = fog(1.0, albedo, sphere(radius), PhaseFunction::Isotropic);
        let world = World {
            geometry: &room,
            lights: &lamps,
            media: &media,
        };
        for (impact, exact) in [(0.5f32, half), (0.9, edge)] {
            // From just inside the wall along the full chord.
            let x = -(1.0 - impact * impact).sqrt() * radius * 0.9999;
            let ray = Ray::new(Vec3::new(x, impact * radius * 0.9999, 0.0), Vec3::X);
            let (_, estimate) = pixel(&world, ray, None, samples);
            estimate.check(
                &format!("room R {radius} c {albedo} b {impact}"),
                exact,
                5e-3,
                3e-4,
            );
        }
    }
}

/// Checks value and radial gradient of fresh records against fluence and its derivative.
fn check_record(
    name: &str,
    world: &World<'_, Room, Lamps>,
    x: Vec3,
    value: f64,
    slope: f64,
    worst: [f64; 2],
) {
    let (mut values, mut slopes, mut across) = (
        Estimate::default(),
        Estimate::default(),
        Estimate::default(),
    );
    for i in 0..64 {
        let key = Key {
            seed: 5,
            purpose: Purpose::Record,
            index: i,
        };
        let g = gather::multiple(world, x, &GatherPattern::new(1024), Reach::default(), key);
        let n = x.normalize();
        let side = n.any_orthonormal_vector();
        values.add(g.value);
        slopes.add(Vec3::from(g.gradient.map(|d| d.dot(n))));
        across.add(Vec3::from(g.gradient.map(|d| d.dot(side))) + Vec3::splat(slope as f32));
    }
    let f = 0.25 / f64::from(PI);
    values.check(&format!("{name} value"), value * f, worst[0], 1e-4);
    slopes.check(&format!("{name} gradient"), slope * f, worst[1], 1e-3);
    println!(
        "  across: {:.3e} ± {:.1e}",
        across.mean() - slope,
        across.error()
    );
    assert!(
        (across.mean() - slope).abs() < 4.5 * across.error() + 1e-6 * slope.abs(),
        "{name}: sideways gradient"
    );
}

#[test]
fn records_know_how_noisy_they_are() {
    // The spread of values over independent keys against the standard errors told.
    let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / PI)]).with_sky(0.02);
    let media = fog(1.0, 0.8, sphere(3.0), PhaseFunction::Isotropic);
    let world = World {
        geometry: &OPEN,
        lights: &lamps,
        media: &media,
    };
    let n_records = 400;
    let (mut values, mut slopes) = (Welford::new(), Welford::new());
    let (mut told_value, mut told_slope) = (0.0, 0.0);
    for index in 0..n_records {
        let key = Key {
            seed: 21,
            purpose: Purpose::Record,
            index,
        };
        let g = gather::multiple(
            &world,
            Vec3::new(0.9, 0.3, -0.2),
            &GatherPattern::new(256),
            Reach::default(),
            key,
        );
        values.push(f64::from(g.value.x));
        slopes.push(f64::from(g.gradient[0].x));
        told_value += f64::from(g.value_error.x).powi(2) / n_records as f64;
        told_slope += f64::from(g.gradient_error[0].x).powi(2) / n_records as f64;
    }
    for (name, spread, told) in [
        ("value", values.variance(), told_value),
        ("gradient", slopes.variance(), told_slope),
    ] {
        println!("{name}: variance {spread:.3e}, told {told:.3e}");
        // A variance of 400 nearly normal values has a standard error of 7 %, six of them with allowance for their tails.
        assert!(
            (told / spread - 1.0).abs() < 0.45,
            "{name}: {told} of {spread}"
        );
    }
}

#[test]
fn records_in_endless_fog_have_the_exact_value_and_gradient() {
    let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / PI)]);
    // Albedo, distance, multiple-scattered fluence, its derivative.
    let uncollided = |r: f64| -(-r).exp() / (4.0 * f64::from(PI) * r * r) * (1.0 + 2.0 / r);
    let rows = [
        (0.5, 1.0, 0.029420221750844015, -0.14852455843208978),
        (0.5, 2.0, 0.005235213823025481, -0.01330375828994354),
        (0.8, 1.0, 0.07813767398380965, -0.2205923665135125),
        (0.8, 2.0, 0.019373395608200485, -0.028697865205121),
    ];
    for (albedo, r, phi, slope) in rows {
        let media = fog(1.0, albedo, Region::Everywhere, PhaseFunction::Isotropic);
        let world = World {
            geometry: &OPEN,
            lights: &lamps,
            media: &media,
        };
        let x = Vec3::new(0.6, -0.48, 0.64) * r as f32;
        check_record(
            &format!("fog c {albedo} r {r}"),
            &world,
            x,
            phi,
            slope - uncollided(r),
            [0.02, 0.05],
        );
    }
}

#[test]
fn records_in_a_closed_room_have_the_exact_gradient() {
    // E3.7 by superposition: φ = φ_point + L_wall φ_env, c = 0.9, R = 1, ρ = 0.5; fluence at 0.5 R.
    let room = Room {
        radius: 1.0,
        reflectance: 0.5,
        emission: 0.0,
    };
    let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / PI)]);
    let media = fog(1.0, 0.9, sphere(1.0), PhaseFunction::Isotropic);
    let world = World {
        geometry: &room,
        lights: &lamps,
        media: &media,
    };
    let r = 0.5f64;
    let uncollided = (-r).exp() / (4.0 * f64::from(PI) * r * r);
    let wall = 0.01974963133;
    let phi = 0.43296826 + wall * 11.1788301;
    let slope = -1.686006 + wall * 0.7742707;
    check_record(
        "room",
        &world,
        Vec3::new(0.3, -0.24, 0.32),
        phi - uncollided,
        slope + uncollided * (1.0 + 2.0 / r),
        [0.02, 0.05],
    );
}
