//! Worlds and records that a careless index would choke on, and inputs that are refused.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use glam::Vec3;
use tyndall_cache::{Cache, CacheError, Field, Record};

fn record(position: Vec3, radius: f32) -> Record<1> {
    Record {
        position,
        radius,
        value: [2.0],
        gradient: [Vec3::ZERO],
        variance: [0.0; 1],
    }
}

fn cache_of(records: Vec<Record<1>>) -> Cache<1> {
    let mut cache = Cache::new();
    cache.insert(records).unwrap();
    cache
}

#[test]
fn each_record_is_found_among_radii_from_tiny_to_huge() {
    let records: Vec<_> = (-37..=37)
        .map(|exponent| {
            let scale = 10_f32.powi(exponent);
            record(Vec3::new(scale, -scale, 0.0), 0.5 * scale)
        })
        .collect();
    let cache = cache_of(records.clone());
    for record in records {
        assert!(cache.coverage(record.position) >= 1.0, "{record:?}");
        assert!(
            cache.covers(record.position + 0.25 * record.radius),
            "{record:?}"
        );
        assert!(cache.covers(record.position * 0.75), "{record:?}");
    }
}

#[test]
fn many_records_at_one_position_are_all_blended() {
    let position = Vec3::new(1.0, 2.0, 3.0);
    let cache = cache_of(vec![record(position, 0.1); 10_000]);
    assert_eq!(cache.coverage(position), 10_000.0);
    // The sum of 10⁴ equal terms in f32 is off by at most 10⁴ · 6e-8, and so is the sum of weights, in the same way.
    assert!((cache.lookup(position).unwrap()[0] - 2.0).abs() < 1e-3);
}

#[test]
fn records_closer_than_the_grid_can_tell_far_from_the_origin_are_found() {
    let far = 1e9_f32;
    let position = |i: u32| Vec3::new(f32::from_bits(far.to_bits() + i), -far, far);
    let cache = cache_of((0..100).map(|i| record(position(i), 1e-3)).collect());
    for i in 0..100 {
        assert_eq!(cache.coverage(position(i)), 1.0);
    }
}

#[test]
fn clamped_radii_grow_no_faster_than_the_slope_and_stay_when_clamped_again() {
    let place = |i: u32| {
        Vec3::new(
            (i * 37 % 101) as f32,
            (i * 53 % 97) as f32,
            (i * 71 % 89) as f32,
        ) / 10.0
    };
    let radius = |i: u32| 10_f32.powi((i % 7) as i32 - 3);
    let mut cache = cache_of((0..500).map(|i| record(place(i), radius(i))).collect());
    for slope in [1.0, 0.5] {
        let before = cache.records().to_vec();
        cache.clamp_radii(slope).unwrap();
        let clamped = cache.records().to_vec();
        for (a, old) in clamped.iter().zip(&before) {
            assert!(a.radius <= old.radius);
            for b in &clamped {
                // To the documented part in 10⁶ of the radius, and rounding.
                let bound = b.radius + slope * a.position.distance(b.position);
                assert!(a.radius <= bound * (1.0 + 2e-6), "{a:?} beside {b:?}");
            }
        }
        cache.clamp_radii(slope).unwrap();
        assert_eq!(cache.records(), clamped, "a second time changes nothing");
    }
}

#[test]
fn new_radii_take_effect_in_lookups() {
    let mut cache = cache_of(vec![record(Vec3::ZERO, 1.0), record(Vec3::X * 8.0, 1.0)]);
    let p = Vec3::X * 4.0;
    assert!(!cache.covers(p));
    cache.set_radii(&[1.0, 5.0]).unwrap();
    assert!(cache.covers(p));
    assert_eq!(cache.records()[1].radius, 5.0);
}

#[test]
fn invalid_records_are_refused_with_index_and_field_and_leave_the_cache_alone() {
    let good = record(Vec3::ZERO, 1.0);
    let mut cache = cache_of(vec![good]);
    let rows = [
        (
            Record {
                position: Vec3::new(0.0, f32::NAN, 0.0),
                ..good
            },
            Field::Position,
        ),
        (
            Record {
                radius: 0.0,
                ..good
            },
            Field::Radius,
        ),
        (
            Record {
                radius: -1.0,
                ..good
            },
            Field::Radius,
        ),
        (
            Record {
                radius: f32::INFINITY,
                ..good
            },
            Field::Radius,
        ),
        (
            Record {
                radius: f32::NAN,
                ..good
            },
            Field::Radius,
        ),
        (
            Record {
                radius: 1e-40,
                ..good
            },
            Field::Radius,
        ),
        (
            Record {
                value: [-1e-9],
                ..good
            },
            Field::Value { channel: 0 },
        ),
        (
            Record {
                value: [f32::INFINITY],
                ..good
            },
            Field::Value { channel: 0 },
        ),
        (
            Record {
                value: [f32::NAN],
                ..good
            },
            Field::Value { channel: 0 },
        ),
        (
            Record {
                gradient: [Vec3::NEG_INFINITY],
                ..good
            },
            Field::Gradient { channel: 0 },
        ),
        (
            Record {
                variance: [-1.0],
                ..good
            },
            Field::Variance { channel: 0 },
        ),
        (
            Record {
                variance: [f32::NAN],
                ..good
            },
            Field::Variance { channel: 0 },
        ),
    ];
    for (bad, expected) in rows {
        match cache.insert(vec![good, good, bad]) {
            Err(CacheError::InvalidRecord {
                index: 2, field, ..
            }) => assert_eq!(field, expected),
            other => panic!("{bad:?} gave {other:?}"),
        }
        assert_eq!(cache.records(), [good]);
    }
    assert_eq!(
        cache.set_radii(&[1.0, 2.0]),
        Err(CacheError::RadiusCount {
            given: 2,
            records: 1
        })
    );
    assert_eq!(
        cache.set_radii(&[-2.0]),
        Err(CacheError::InvalidRadius {
            index: 0,
            value: -2.0
        })
    );
    assert_eq!(
        cache.clamp_radii(-1.0),
        Err(CacheError::InvalidSlope { slope: -1.0 })
    );
    assert_eq!(cache.records(), [good]);
}

#[test]
fn an_empty_cache_answers_every_question() {
    let mut cache = cache_of(Vec::new());
    assert!(cache.is_empty());
    assert_eq!(cache.len(), 0);
    assert_eq!(cache.lookup(Vec3::ZERO), None);
    assert!(!cache.covers(Vec3::ZERO));
    assert_eq!(cache.coverage(Vec3::ZERO), 0.0);
    cache.for_each_near(Vec3::ZERO, f32::INFINITY, |_, _| {
        panic!("no record is near")
    });
    cache.clamp_radii(1.0).unwrap();
    cache.set_radii(&[]).unwrap();
}
