//! Coarse fields of light against exact solutions: what they hold, and what records that end in them find.

use crate::rig::{Estimate, Lamps, OPEN, fog, sphere};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_media::{PhaseFunction, Region};
use tyndall_transport::field::{CellWidths, Field, Filling, Part};
use tyndall_transport::gather::{self, GatherPattern};
use tyndall_transport::path::Reach;
use tyndall_transport::{Bsdf, Geometry, SurfaceHit, World};

/// A field filled by walks from `x` in all directions.
fn field<G: Geometry>(
    world: &World<'_, G, Lamps>,
    x: Vec3,
    widths: CellWidths,
    seed: u64,
    walks: u64,
) -> Field {
    fields(world, &[x], widths, seed, walks)
}

/// A field filled by `walks` from each of `places` in all directions.
fn fields<G: Geometry>(
    world: &World<'_, G, Lamps>,
    places: &[Vec3],
    widths: CellWidths,
    seed: u64,
    walks: u64,
) -> Field {
    let key = Key {
        seed,
        purpose: Purpose::Field,
        index: 0,
    };
    let mut found = Vec::new();
    for walk in 0..walks {
        for &x in places {
            let mut sampler = Sampler::new(key, walk);
            let ray = Ray::new(x, warp::uniform_sphere(sampler.next_2d()));
            Filling::walk(world, ray, &mut sampler, &mut found);
        }
    }
    Field::new(world.geometry, world.media, widths, &found)
}

#[test]
fn records_that_end_in_a_field_are_right_in_endless_fog() {
    // E3.1: albedo, distance, fluence, its derivative.
    let rows = [
        (0.5, 1.0_f32, 0.05869513751, -0.1485246),
        (0.9, 1.0, 0.1432838615, -0.2579211),
    ];
    let lamps = Lamps::points(&[(Vec3::ZERO, 0.25 / PI)]);
    for (albedo, r, phi, slope) in rows {
        let media = fog(1.0, albedo, Region::Everywhere, PhaseFunction::Isotropic);
        let world = World {
            geometry: &OPEN,
            lights: &lamps,
            media: &media,
        };
        let x = Vec3::new(0.6, -0.48, 0.64) * r;
        let (mut values, mut slopes) = (Estimate::default(), Estimate::default());
        // Each record has a field of its own: what fields err by is part of the standard error.
        for seed in 0..12 {
            let field = field(&world, x, CellWidths::even(0.125), seed, 40_000);
            let key = Key {
                seed,
                purpose: Purpose::Record,
                index: 0,
            };
            let reach = Reach {
                max_depth: None,
                field: Some(&field),
            };
            let g = gather::multiple(&world, x, &GatherPattern::new(2000), reach, key);
            values.add(g.value);
            slopes.add(Vec3::from(g.gradient.map(|d| d.dot(x / r))));
        }
        let r = f64::from(r);
        let uncollided = (-r).exp() / (4.0 * f64::from(PI) * r * r);
        let [value, slope] = [phi - uncollided, slope + uncollided * (1.0 + 2.0 / r)]
            .map(|fluence| fluence * 0.25 / f64::from(PI));
        values.check(&format!("c {albedo} r {r} value"), value, 0.03, 1e-3);
        slopes.check(&format!("c {albedo} r {r} gradient"), slope, 0.06, 1e-3);
    }
}

#[test]
fn light_in_a_furnace_is_one() {
    let lamps = Lamps::sky(1.0);
    let media = fog(2.0, 1.0, sphere(1.0), PhaseFunction::Isotropic);
    let world = World {
        geometry: &OPEN,
        lights: &lamps,
        media: &media,
    };
    let field = field(&world, Vec3::ZERO, CellWidths::even(0.125), 1, 200_000);
    // Standard errors of cells are not told; fields of other seeds show how far a mean of this many walks strays: 0.3 %.
    let light: f64 = (0..200)
        .map(|i| {
            let key = Key {
                seed: 2,
                purpose: Purpose::Probe,
                index: 0,
            };
            let mut sampler = Sampler::new(key, i);
            let p = warp::uniform_sphere(sampler.next_2d()) * 0.95 * sampler.next_1d();
            f64::from(field.medium(world.geometry, p, Part::All).unwrap().value.x) / 200.0
        })
        .sum();
    println!("{light:.4}");
    assert!((light - 1.0).abs() < 4.0 * 0.003, "{light}");
}

#[test]
fn light_does_not_pass_from_one_side_of_a_wall_to_the_other() {
    /// A thin wall at x = 0.04 without end, amid cells of 0.125.
    struct Wall;

    impl Geometry for Wall {
        fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
            let t = (0.04 - ray.origin.x) / ray.direction.x;
            let position = ray.at(t).with_x(0.04);
            let normal = Vec3::X * -ray.direction.x.signum();
            (t > 0.0 && t < t_max).then(|| SurfaceHit {
                t,
                position,
                normal,
                bsdf: Bsdf::lambert(Vec3::splat(0.5), normal),
                emission: Vec3::ZERO,
                light: None,
                size: 1.0,
            })
        }

        fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
            self.intersect(ray, t_max).is_some()
        }
    }

    let lamps = Lamps::points(&[(Vec3::new(0.3, 0.0, 0.0), 1.0)]);
    let media = fog(1.0, 0.9, sphere(1.0), PhaseFunction::Isotropic);
    let world = World {
        geometry: &Wall,
        lights: &lamps,
        media: &media,
    };
    let lit = field(
        &world,
        Vec3::new(0.2, 0.0, 0.0),
        CellWidths::even(0.125),
        1,
        5_000,
    );
    let dark = field(
        &world,
        Vec3::new(-0.2, 0.0, 0.0),
        CellWidths::even(0.125),
        1,
        5_000,
    );
    let both = fields(
        &world,
        &[Vec3::new(0.2, 0.0, 0.0), Vec3::new(-0.2, 0.0, 0.0)],
        CellWidths::even(0.125),
        1,
        5_000,
    );
    for i in 0..50 {
        let p = Vec3::new(0.0, 0.01 * i as f32, 0.003 * i as f32);
        let read = |field: &Field, x: f32| {
            field
                .medium(&Wall, p.with_x(x), Part::All)
                .map(|l| l.value.x)
        };
        assert!(read(&lit, 0.05).is_some_and(|light| light > 0.0));
        assert_eq!(read(&lit, 0.03), None, "nothing is known behind the wall");
        assert_eq!(read(&dark, 0.03), Some(0.0));
        assert_eq!(read(&both, 0.03), Some(0.0));
        assert!(read(&both, 0.05).is_some_and(|light| light > 0.0));
    }
}
