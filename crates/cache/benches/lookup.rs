//! Time of a lookup, of a whole march and of building the index, at 10⁴ and 10⁶ records.
#![allow(missing_docs, reason = "criterion's macros make public functions")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use std::hint::black_box;
use tyndall_cache::{Cache, Record};

/// Records valid at a point, on the average.
const OVERLAP: f32 = 8.0;

/// Points on one march through the cube; neighbouring ones are about a thirtieth of a radius apart at 10⁴ records.
const STEPS: usize = 512;

/// Uniform numbers in [0, 1): `SplitMix64` (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1_u32 << 24) as f32
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

/// Records in the unit cube whose radii differ by up to a factor of 3.
fn records(n: usize) -> Vec<Record<3>> {
    let mut random = Random(1);
    // The mean of (R/R₀)³ over R/R₀ uniform in [0.5, 1.5) is 1.25.
    let mean_radius = (OVERLAP / (1.25 * n as f32 * 4.0 / 3.0 * std::f32::consts::PI)).cbrt();
    let record = |_| Record {
        position: random.point(),
        radius: mean_radius * (0.5 + random.next()),
        value: [0.3 + random.next(), 0.2, 0.1 + random.next()],
        gradient: [random.point() - 0.5, random.point(), Vec3::ZERO],
        variance: [0.0; 3],
    };
    (0..n).map(record).collect()
}

/// Points along a slanted ray through the middle of the cube.
fn march() -> Vec<Vec3> {
    let (start, end) = (Vec3::new(0.1, 0.3, 0.2), Vec3::new(0.9, 0.8, 0.6));
    let point = |i| start.lerp(end, (i as f32 + 0.5) / STEPS as f32);
    (0..STEPS).map(point).collect()
}

fn scattered() -> Vec<Vec3> {
    let mut random = Random(2);
    (0..STEPS).map(|_| random.point()).collect()
}

fn lookups(c: &mut Criterion) {
    let mut group = c.benchmark_group("lookup");
    group.throughput(Throughput::Elements(STEPS as u64));
    for n in [10_000, 1_000_000] {
        let mut cache = Cache::new();
        if let Err(error) = cache.insert(records(n)) {
            panic!("the benchmark's records are valid: {error}");
        }
        for (name, points) in [("coherent", march()), ("scattered", scattered())] {
            group.bench_with_input(BenchmarkId::new(name, n), &points, |b, points| {
                b.iter(|| {
                    for &p in points {
                        black_box(cache.lookup(black_box(p)));
                    }
                });
            });
        }
        group.bench_with_input(BenchmarkId::new("covers", n), &march(), |b, points| {
            b.iter(|| points.iter().filter(|&&p| cache.covers(p)).count());
        });
    }
    group.finish();
}

fn building(c: &mut Criterion) {
    let mut group = c.benchmark_group("build");
    group.sample_size(10);
    for n in [10_000, 1_000_000] {
        let records = records(n);
        group.throughput(Throughput::Elements(n as u64));
        group.bench_with_input(BenchmarkId::new("insert", n), &records, |b, records| {
            b.iter(|| {
                let mut cache = Cache::new();
                cache.insert(records.clone()).map(|()| cache)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, lookups, building);
criterion_main!(benches);
