//! Time of 512 lookups, of a march over as many points and of building the index, at 10⁴ and 10⁶ records.
#![allow(missing_docs, reason = "criterion's macros make public functions")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use std::hint::black_box;
use tyndall_cache::{Cache, Record, Segment};

/// Records valid at a point, on the average.
const OVERLAP: f32 = 8.0;

/// Points on one march.
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

/// A slanted way into the middle of the cube past about a hundred records, however many there are: 27 steps are a mean radius.
fn segment(n: usize) -> Segment {
    Segment {
        origin: Vec3::new(0.1, 0.3, 0.2),
        direction: Vec3::new(0.8, 0.5, 0.4) * (1e4 / n as f32).cbrt(),
        range: [0.0, 1.0],
    }
}

fn steps() -> Vec<f32> {
    (0..STEPS)
        .map(|i| (i as f32 + 0.5) / STEPS as f32)
        .collect()
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
        let (segment, ts) = (segment(n), steps());
        let coherent: Vec<Vec3> = ts.iter().map(|&t| segment.at(t)).collect();
        for (name, points) in [("coherent", coherent.clone()), ("scattered", scattered())] {
            group.bench_with_input(BenchmarkId::new(name, n), &points, |b, points| {
                b.iter(|| {
                    for &p in points {
                        black_box(cache.lookup(black_box(p)));
                    }
                });
            });
        }
        let crossings = cache.crossings(&segment);
        group.bench_function(BenchmarkId::new("march", n), |b| {
            b.iter(|| crossings.march(&ts, |_, _, _| true, |_, value| _ = black_box(value)));
        });
        group.bench_function(BenchmarkId::new("crossings", n), |b| {
            b.iter(|| cache.crossings(black_box(&segment)));
        });
        group.bench_with_input(BenchmarkId::new("covers", n), &coherent, |b, points| {
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
