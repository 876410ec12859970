//! What a segment's list of records holds, and what a march gives where answers are known.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use glam::Vec3;
use tyndall_cache::{Cache, Crossing, Record, Segment};

fn record<const N: usize>(position: Vec3, radius: f32, value: [f32; N]) -> Record<N> {
    Record {
        position,
        radius,
        value,
        gradient: [Vec3::new(0.3, -0.2, 0.1); N],
        variance: [0.01; N],
    }
}

#[test]
fn balls_are_entered_and_left_where_geometry_says() {
    let mut cache = Cache::new();
    let ball = |x, y, radius| record(Vec3::new(x, y, 0.0), radius, [1.0]);
    cache
        .insert(vec![
            ball(8.0, 0.6, 1.0),
            ball(3.0, 0.0, 2.0),
            ball(3.0, 2.5, 2.0),
            ball(0.0, 0.0, 0.01),
            ball(-9.0, 0.0, 1.0),
        ])
        .unwrap();
    let mut segment = Segment {
        origin: Vec3::ZERO,
        direction: Vec3::new(2.0, 0.0, 0.0),
        range: [0.0, f32::INFINITY],
    };
    let check = |segment: &Segment, expected: &[(usize, f32, f32)]| {
        let found: Vec<Crossing> = cache.crossings(segment).iter().collect();
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, &(index, enter, exit)) in found.iter().zip(expected) {
            assert_eq!(found.index, index);
            // The documented part in 10⁵.
            assert!((found.enter - enter).abs() <= 1e-5 * exit, "{found:?}");
            assert!((found.exit - exit).abs() <= 1e-5 * exit, "{found:?}");
        }
    };
    let first = (3, 0.0, 0.005);
    check(&segment, &[first, (1, 0.5, 2.5), (0, 3.6, 4.4)]);
    segment.range[1] = 2.0;
    check(&segment, &[first, (1, 0.5, 2.0)]);
}

#[test]
fn a_march_through_many_channels_and_zeros_agrees_with_lookups() {
    // Five channels are two groups; the last one is dark in places, and records are steep in others.
    let mut records = Vec::new();
    for i in 0..400_u16 {
        let part = |step: f32| (0.5 + step * f32::from(i)).fract();
        let position = Vec3::new(part(0.819_17), part(0.671_04), part(0.549_7));
        let dark = if i % 7 == 0 { 0.0 } else { 0.4 };
        let value = [1.0, 2.0 + part(0.3), 0.1, 1e-3, dark];
        records.push(record(position, 0.15 + 0.2 * part(0.41), value));
    }
    let mut cache = Cache::new();
    cache.insert(records).unwrap();
    let segment = Segment {
        origin: Vec3::new(-0.2, 0.3, 0.1),
        direction: Vec3::new(1.2, 0.4, 0.7),
        range: [-1.0, 2.0],
    };
    for n in [1, 6, 333] {
        let ts: Vec<f32> = (0..n).map(|i| 3.0 * i as f32 / n as f32 - 1.0).collect();
        let mut n_visited = 0;
        cache.crossings(&segment).march(
            &ts,
            |(), _, _| true,
            |t, found| {
                assert_eq!(t, ts[n_visited]);
                n_visited += 1;
                let expected = cache.lookup(segment.at(t));
                assert_eq!(found.is_some(), expected.is_some());
                for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                    // The documented 3 parts in 10⁵.
                    assert!(
                        (found - expected).abs() <= 3e-5 * expected,
                        "{found} at {t}"
                    );
                }
            },
        );
        assert_eq!(n_visited, n);
    }
}

#[test]
#[should_panic(expected = "ascend")]
fn points_that_do_not_ascend_are_refused() {
    let cache = Cache::<1>::new();
    let segment = Segment {
        origin: Vec3::ZERO,
        direction: Vec3::X,
        range: [0.0, 1.0],
    };
    cache
        .crossings(&segment)
        .march(&[0.5, 0.2], |(), _, _| true, |_, _| {});
}
