//! How much light does a ray gather? Integrates a cached field along a segment, by lookups and by one march, and prints both with their times.
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use glam::Vec3;
use std::time::Instant;
use tyndall_cache::{Cache, CacheError, Record, Segment};

const STEPS: usize = 2000;

/// A lamp at the origin in fog: exp(−r)/(0.1 + r²).
fn sample(position: Vec3) -> Record<1> {
    let r = position.length();
    let value = (-r).exp() / (0.1 + r * r);
    let slope = -value * (1.0 + 2.0 * r / (0.1 + r * r));
    Record {
        position,
        radius: 0.15,
        value: [value],
        gradient: [slope * position.normalize_or_zero()],
        variance: [0.0],
    }
}

fn main() -> Result<(), CacheError> {
    // A lattice over [−1, 1]³.
    let axis = |i: usize| i as f32 * 0.1 - 1.0;
    let place = |i: usize| Vec3::new(axis(i % 21), axis(i / 21 % 21), axis(i / 441));
    let mut cache = Cache::new();
    cache.insert((0..21 * 21 * 21).map(|i| sample(place(i))).collect())?;

    let ray = Segment {
        origin: Vec3::new(-1.0, 0.1, -0.2),
        direction: Vec3::X,
        range: [0.0, 2.0],
    };
    let step = 2.0 / STEPS as f32;
    let ts: Vec<f32> = (0..STEPS).map(|i| (i as f32 + 0.5) * step).collect();

    let start = Instant::now();
    let mut looked_up = 0.0;
    for &t in &ts {
        looked_up += step * cache.lookup(ray.at(t)).map_or(0.0, |[value]| value);
    }
    println!("{STEPS} lookups: {looked_up:.5} in {:?}", start.elapsed());

    let start = Instant::now();
    let mut marched = 0.0;
    let crossings = cache.crossings(&ray);
    crossings.march(
        &ts,
        |(), _, _| true,
        |_, value| {
            marched += step * value.map_or(0.0, |[value]| value);
        },
    );
    let n_records = crossings.iter().count();
    println!(
        "a march past {n_records} records: {marched:.5} in {:?}",
        start.elapsed()
    );
    Ok(())
}
