//! What the parts of a render cost against each other: lookups against shadow rays, and a record of 1 000 directions against 2 000 closest
//! hits, in the Sponza atrium where that asset stands beside the workspace.
#![allow(missing_docs, reason = "criterion's macros make public functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use std::hint::black_box;
use std::path::Path;
use tyndall_cache::{Cache, Record, Segment};
use tyndall_math::testing::sampler;
use tyndall_math::{Key, Purpose, Ray, warp};
use tyndall_scene::{LoadOptions, Scene, load_str};
use tyndall_transport::field::{CellWidths, Field, Filling};
use tyndall_transport::gather::{self, GatherPattern};
use tyndall_transport::path::Reach;
use tyndall_transport::world::Geometry;

/// Points of one march, and rays that are shot in turn.
const N: usize = 512;

/// The atrium in haze under the sun.
const SPONZA: &str = "Scene(
    gltf: \"sponza.gltf\",
    camera: LookAt(eye: (-8, 2, 0), target: (8, 4, 0), vfov: 60),
    lights: [Directional(direction: (0.2, -1, 0.3), irradiance: (20, 18, 15)), Sky(radiance: (0.5, 0.7, 1))],
    media: [Medium(sigma_t: (0.05, 0.05, 0.05), albedo: (0.9, 0.9, 0.9))],
)";

/// A unit cube of records of which eight hold a point on the average.
fn cache(n: usize) -> Cache<3> {
    let radius = (8.0 / (n as f32 * 4.0 / 3.0 * std::f32::consts::PI)).cbrt();
    let record = |index| {
        let mut u = sampler(1, index);
        let [x, y] = u.next_2d();
        Record {
            position: Vec3::new(x, y, u.next_1d()),
            radius,
            value: [0.3 + x, 0.2, 0.1 + y],
            gradient: [Vec3::new(y, -0.5, x), Vec3::X, Vec3::ZERO],
            variance: [1e-4; 3],
        }
    };
    let mut cache = Cache::new();
    if let Err(error) = cache.insert((0..n as u64).map(record).collect()) {
        panic!("the benchmark's records are valid: {error}");
    }
    cache
}

/// Lookups one by one and a march, per point; neighbours are 1/27 of a radius apart.
fn lookups(criterion: &mut Criterion) {
    for n in [10_000, 1_000_000] {
        let cache = cache(n);
        let segment = Segment {
            origin: Vec3::new(0.1, 0.3, 0.2),
            direction: Vec3::new(0.8, 0.5, 0.4) * (1e4 / n as f32).cbrt(),
            range: [0.0, 1.0],
        };
        let ts: Vec<f32> = (0..N).map(|i| i as f32 / N as f32).collect();
        let mut next = (0..N).cycle();
        let mut point = || segment.at(ts[next.next().unwrap_or(0)]);
        let mut group = criterion.benchmark_group(format!("{n} records"));
        group.bench_function("lookup", |b| b.iter(|| cache.lookup(black_box(point()))));
        let crossings = cache.crossings(&segment);
        group.bench_function(format!("march past {N} points"), |b| {
            b.iter(|| crossings.march(&ts, |(), _, _| true, |_, value| _ = black_box(value)));
        });
        group.finish();
    }
}

/// Rays in all directions from points within the middle of the scene's box.
fn rays(scene: &Scene) -> Vec<Ray> {
    let bounds = scene.geometry.bounds();
    let extent = (bounds.max - bounds.min) * 0.4;
    let ray = |index| {
        let mut u = sampler(1, index);
        let [x, y] = u.next_2d();
        let place = Vec3::new(x, y, u.next_1d()) - 0.5;
        Ray::new(
            bounds.center() + extent * place,
            warp::uniform_sphere(u.next_2d()),
        )
    };
    (0..8 * N as u64).map(ray).collect()
}

/// A field of what 20 000 walks found.
fn field(scene: &Scene) -> Field {
    let world = scene.world();
    let widths = CellWidths::around(&[scene.camera.eye()], 1.0 / 24.0, 1e-4);
    let mut found = Vec::new();
    for walk in 0..20_000 {
        let mut u = sampler(1, walk);
        let [x, y] = u.next_2d();
        Filling::walk(&world, scene.camera.ray(x, y, 1, 1), &mut u, &mut found);
    }
    Field::new(world.geometry, world.media, widths, &found)
}

fn sponza(criterion: &mut Criterion) {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets/scenes/sponza_dabrovic");
    let scene = match load_str(SPONZA, &folder, &LoadOptions::default()) {
        Ok(scene) => scene,
        Err(error) => return eprintln!("sponza is left out: {error}"),
    };
    let rays = rays(&scene);
    let mut next = (0..rays.len()).cycle();
    let mut ray = || rays[next.next().unwrap_or(0)];
    let far = scene.geometry.bounds().diagonal();
    let mut group = criterion.benchmark_group("sponza");
    group.bench_function("shadow ray", |b| {
        b.iter(|| scene.geometry.occluded(black_box(&ray()), far));
    });
    group.bench_function("closest hit", |b| {
        b.iter(|| scene.geometry.intersect(black_box(&ray()), f32::INFINITY));
    });
    let pattern = GatherPattern::new(1000);
    let field = field(&scene);
    let reach = |field| Reach {
        max_depth: None,
        field,
    };
    group.sample_size(20);
    for (name, reach) in [
        ("record, paths to their end", reach(None)),
        ("record, paths into a field", reach(Some(&field))),
    ] {
        let mut index = 0;
        group.bench_function(name, |b| {
            b.iter(|| {
                index += 1;
                let purpose = Purpose::Record;
                let key = Key {
                    seed: 1,
                    purpose,
                    index,
                };
                gather::multiple(&scene.world(), ray().origin, &pattern, reach, key)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, lookups, sponza);
criterion_main!(benches);
