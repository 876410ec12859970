//! How many records does a field need? Caches a made-up field at several tolerances and prints the error of each cache.
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use glam::Vec3;
use tyndall_cache::{Cache, CacheError, Record};

/// Lamps of a hazy room, 1 × 1 × 1: position and strength. One stands outside.
const LAMPS: [(Vec3, f32); 3] = [
    (Vec3::new(0.2, 1.1, 0.3), 1.0),
    (Vec3::new(0.9, -0.2, 0.8), 0.6),
    (Vec3::new(2.5, 0.5, 0.5), 4.0),
];

/// Extinction of the haze per unit of length.
const SIGMA_T: f32 = 1.5;

/// The field to be cached, with a radius of ε ΣLⱼ/Σ|∇Lⱼ| over the lamps j (Jarosz et al. 2008).
fn sample(position: Vec3, epsilon: f32) -> Record<1> {
    let (mut value, mut gradient, mut sum_of_norms) = (0.0, Vec3::ZERO, 0.0);
    for (lamp, strength) in LAMPS {
        let r = position.distance(lamp);
        let light = strength * (-SIGMA_T * r).exp() / (r * r);
        let slope = -light * (SIGMA_T + 2.0 / r) * (position - lamp) / r;
        value += light;
        gradient += slope;
        sum_of_norms += slope.length();
    }
    Record {
        position,
        radius: (epsilon * value / sum_of_norms).clamp(0.005, 0.5),
        value: [value],
        gradient: [gradient],
        variance: [0.0; 1],
    }
}

/// Point `i` of an even sequence in the room: an additive recurrence with the plastic numbers (Roberts 2018).
fn point(i: usize) -> Vec3 {
    let part = |step: f64| (0.5 + step * i as f64).fract() as f32;
    Vec3::new(
        part(0.819_172_513_396_164),
        part(0.671_043_606_703_789),
        part(0.549_700_477_901_97),
    )
}

/// Records wherever a point of the sequence finds none, a batch at a time.
fn fill(epsilon: f32, n_points: usize) -> Result<Cache<1>, CacheError> {
    const BATCH: usize = 2048;
    let mut cache = Cache::new();
    for first in (0..n_points).step_by(BATCH) {
        let mut batch: Vec<Record<1>> = Vec::new();
        for p in (first..first + BATCH).map(point) {
            let holds = |record: &Record<1>| record.position.distance(p) < record.radius;
            if !cache.covers(p) && !batch.iter().any(holds) {
                batch.push(sample(p, epsilon));
            }
        }
        cache.insert(batch)?;
    }
    cache.clamp_radii(1.0)?;
    Ok(cache)
}

fn main() -> Result<(), CacheError> {
    println!("tolerance  records  mean error  99 % of points below");
    for epsilon in [1.0, 0.5, 0.25, 0.125] {
        let cache = fill(epsilon, 100_000)?;
        let mut errors = Vec::new();
        // Points that had no part in the filling.
        for p in (200_000..220_000).map(point) {
            if let Some([found]) = cache.lookup(p) {
                errors.push((found / sample(p, epsilon).value[0] - 1.0).abs());
            }
        }
        errors.sort_by(f32::total_cmp);
        let mean = errors.iter().sum::<f32>() / errors.len() as f32;
        let quantile = errors.get(errors.len() * 99 / 100).unwrap_or(&0.0);
        println!(
            "{epsilon:9}  {:7}  {:8.3} %  {:8.3} %",
            cache.len(),
            100.0 * mean,
            100.0 * quantile
        );
    }
    Ok(())
}
