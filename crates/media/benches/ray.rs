//! What a ray through media costs: `cargo bench -p tyndall-media`.

#![allow(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3, IVec3, Vec3};
use std::hint::black_box;
use std::sync::Arc;
use tyndall_math::Ray;
use tyndall_media::grid::{Grid, GridEdge, VoxelsBuilder};
use tyndall_media::{Density, Media, Medium, MediumParams, PhaseFunction, Region};

fn media(params: Vec<MediumParams>) -> Media {
    Media::new(
        params
            .into_iter()
            .filter_map(|p| Medium::new(p).ok())
            .collect(),
    )
}

/// 96³ voxels of different values in a cube of 4 m.
fn noise() -> Option<Density> {
    let mut builder =
        VoxelsBuilder::new(0.0, [IVec3::ZERO, IVec3::splat(95)], 1728, 1 << 30).ok()?;
    for x in 0..12 {
        for y in 0..12 {
            for z in 0..12 {
                let brick = std::array::from_fn(|i| (i * 31 % 7) as f32);
                builder.set_brick(IVec3::new(x, y, z) * 8, &brick);
            }
        }
    }
    let voxels = Arc::new(builder.finish().ok()?.voxels);
    let map = DAffine3 {
        translation: DVec3::splat(-2.0),
        ..DAffine3::from_scale(DVec3::splat(4.0 / 96.0))
    };
    let grid = Grid::new(voxels, map, 0.1, GridEdge::Background).ok()?;
    Some(Density::Grid(Arc::new(grid)))
}

fn rays(c: &mut Criterion) {
    let Some(density) = noise() else {
        return;
    };
    let fog = MediumParams::new(Vec3::splat(0.2), Vec3::splat(0.9));
    let boxed = MediumParams {
        region: Region::Box {
            min: Vec3::splat(-2.0),
            max: Vec3::splat(2.0),
        },
        ..fog.clone()
    };
    let height = MediumParams {
        density: Density::Height {
            base: 0.0,
            scale_height: 2.0,
        },
        ..fog.clone()
    };
    let smoke = MediumParams {
        density,
        ..fog.clone()
    };
    let scenes = [
        ("grid", media(vec![smoke])),
        ("everywhere", media(vec![fog.clone()])),
        ("box", media(vec![boxed.clone()])),
        ("height", media(vec![height.clone()])),
        ("box_and_height", media(vec![boxed, height])),
    ];
    let ray = Ray::new(Vec3::new(-3.0, 1.0, 0.5), Vec3::new(0.96, 0.28, 0.0));
    for (name, media) in &scenes {
        let mut group = c.benchmark_group(*name);
        group.bench_function("optical_depth", |b| {
            b.iter(|| media.optical_depth(black_box(&ray), 9.0));
        });
        group.bench_function("segment", |b| {
            b.iter(|| media.segment(black_box(&ray), 9.0));
        });
        let segment = media.segment(&ray, 9.0);
        group.bench_function("distance_at", |b| {
            b.iter(|| segment.distance_at(black_box(1), black_box(0.5)));
        });
        group.bench_function("gradient", |b| {
            b.iter(|| media.optical_depth_gradient(black_box(ray.origin), ray.at(9.0)));
        });
        group.bench_function("at", |b| {
            b.iter(|| media.at(black_box(Vec3::new(0.5, 1.0, 0.0))));
        });
    }
}

fn phase(c: &mut Criterion) {
    let hg = |g| PhaseFunction::henyey_greenstein(g).unwrap_or_default();
    let double = PhaseFunction::mixture(&[(0.7, hg(0.8)), (0.3, hg(-0.3))]);
    for (name, phase) in [
        ("isotropic", PhaseFunction::Isotropic),
        ("henyey_greenstein", hg(0.7)),
        ("rayleigh", PhaseFunction::Rayleigh),
        ("double_henyey_greenstein", double.unwrap_or_default()),
    ] {
        let mut group = c.benchmark_group(name);
        group.bench_function("eval", |b| {
            b.iter(|| phase.eval(black_box(Vec3::X), black_box(Vec3::Y)));
        });
        group.bench_function("sample", |b| {
            b.iter(|| phase.sample(black_box(Vec3::X), black_box([0.3, 0.7])));
        });
    }
}

criterion_group!(benches, rays, phase);
criterion_main!(benches);
