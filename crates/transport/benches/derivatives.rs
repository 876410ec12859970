//! What derivatives cost: single scattering from a rectangle in forward fog, and a record in a closed room with a lamp.
#![allow(missing_docs, reason = "criterion's macros make public functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use std::hint::black_box;
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_media::{PhaseFunction, Region};
use tyndall_transport::World;
use tyndall_transport::gather::{self, Derivatives, GatherDirections, GatherPattern};
use tyndall_transport::inscatter::{self, Inscatter, Order};
use tyndall_transport::path::Reach;

#[allow(
    dead_code,
    unreachable_pub,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "shared with the tests, which use all of it"
)]
#[path = "../tests/transport/rig.rs"]
mod rig;
#[allow(dead_code, reason = "shared with the tests, which use all of it")]
#[path = "../tests/transport/stage.rs"]
mod stage;

const SAMPLES: usize = 1024;
const KEY: Key = Key {
    seed: 1,
    purpose: Purpose::Probe,
    index: 0,
};

fn single(c: &mut Criterion) {
    let stage = stage::Stage::lamp(stage::Lamp::Card {
        card: stage::Card {
            corner: Vec3::new(-1.0, -0.5, 2.0),
            edges: [Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
        },
        radiance: 1.0,
    });
    let phase = PhaseFunction::henyey_greenstein(0.7).unwrap_or_default();
    let media = rig::fog(0.8, 0.5, Region::Everywhere, phase);
    let world = World {
        geometry: &stage,
        lights: &stage,
        media: &media,
    };
    let (x, towards) = (
        Vec3::new(0.3, 0.2, 0.1),
        Some(Vec3::new(0.2, 0.3, -0.9).normalize()),
    );
    let mut group = c.benchmark_group("single");
    group.bench_function("samples of the value", |b| {
        b.iter(|| {
            let point = Inscatter::new(&world, black_box(x), towards);
            (0..SAMPLES as u64)
                .map(|i| point.value(KEY, i))
                .sum::<Vec3>()
        });
    });
    for (name, asked) in [
        ("value", (Order::Value, Derivatives::Blind)),
        ("gradient, blind", (Order::Gradient, Derivatives::Blind)),
        ("gradient, aware", (Order::Gradient, Derivatives::Aware)),
        ("hessian", (Order::Hessian, Derivatives::Aware)),
    ] {
        group.bench_function(name, |b| {
            b.iter(|| inscatter::single(&world, black_box(x), towards, SAMPLES, asked, KEY));
        });
    }
    group.finish();
}

fn record(c: &mut Criterion) {
    let room = rig::Room {
        radius: 3.0,
        reflectance: 0.5,
        emission: 0.0,
    };
    let lamps = rig::Lamps::points(&[(Vec3::new(1.1, -0.4, 1.6), 2.5)]);
    let media = rig::fog(0.8, 0.9, Region::Everywhere, PhaseFunction::Isotropic);
    let world = World {
        geometry: &room,
        lights: &lamps,
        media: &media,
    };
    let x = Vec3::new(0.3, 0.2, 0.1);
    let pattern = GatherPattern::new(SAMPLES);
    let mut group = c.benchmark_group("record");
    group.sample_size(20);
    group.bench_function("value", |b| {
        b.iter(|| {
            let directions = GatherDirections::new(&world, black_box(x), None);
            (0..pattern.n_rays() as u64)
                .map(|i| {
                    gather::one_of(
                        &directions,
                        &world,
                        x,
                        Reach::default(),
                        &mut Sampler::new(KEY, i),
                    )
                })
                .sum::<Vec3>()
        });
    });
    for (name, derivatives) in [
        ("gradient, blind", Derivatives::Blind),
        ("gradient, aware", Derivatives::Aware),
    ] {
        group.bench_function(name, |b| {
            b.iter(|| {
                gather::multiple_towards(
                    &world,
                    black_box(x),
                    None,
                    &pattern,
                    derivatives,
                    Reach::default(),
                    KEY,
                )
            });
        });
    }
    group.finish();
}

criterion_group!(benches, single, record);
criterion_main!(benches);
