//! Gradients of fresh records in a room with occluders against central differences of path tracing.
//!
//! The differences were taken with common random numbers at fifty random points of the shipped Cornell box and are stored (see
//! `tests/references/README.md`); what is checked here is the record, silhouettes and all.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(
    clippy::print_stdout,
    reason = "a failure is easier to read beside the other figures"
)]

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Deserialize;
use std::fs;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose};
use tyndall_scene::LoadOptions;
use tyndall_tests::program::workspace;
use tyndall_transport::gather::{Derivatives, GatherPattern, multiple_towards};
use tyndall_transport::path::Reach;

/// Independent records at each point, and their paths.
const RECORDS: u64 = 32;
const RAYS: usize = 1024;
/// Of 150 numbers whose errors have some fifty degrees of freedom, one lies beyond by chance in 40 sets of seeds.
const MAX_Z: f64 = 4.0;
/// Central differences at one point.
#[derive(Deserialize)]
struct Reference {
    /// Metres.
    at: [f32; 3],
    /// For red, green, blue: ∂/∂x, ∂/∂y, ∂/∂z per metre.
    gradient: [[f64; 3]; 3],
    stderr: [[f64; 3]; 3],
}

const GREEN: usize = 1;

/// Largest |z| of the components of the green gradient of records at a point, and how far their mean is off, as a share of the
/// gradient.
fn check(
    scene: &tyndall_scene::Scene,
    (point, reference): (u64, &Reference),
    derivatives: Derivatives,
) -> (f64, f64) {
    let (world, pattern) = (scene.world(), GatherPattern::new(RAYS));
    let x = Vec3::from(reference.at);
    let mut spread = [Welford::new(); 3];
    for record in 0..RECORDS {
        let key = Key {
            seed: 31,
            purpose: Purpose::Record,
            index: point * RECORDS + record,
        };
        let g = multiple_towards(
            &world,
            x,
            None,
            &pattern,
            derivatives,
            Reach::default(),
            key,
        );
        for (spread, slope) in spread.iter_mut().zip(g.gradient[GREEN].to_array()) {
            spread.push(f64::from(slope));
        }
    }
    let exact = DVec3::from(reference.gradient[GREEN]);
    let error = DVec3::from(reference.stderr[GREEN]);
    let mean = DVec3::from_array([0, 1, 2].map(|i| spread[i].mean()));
    let own = DVec3::from_array([0, 1, 2].map(|i| spread[i].standard_error()));
    let z = ((mean - exact) / (own * own + error * error).map(f64::sqrt)).abs();
    let norm = exact.length();
    let (off, z) = ((mean - exact).length() / norm, z.max_element());
    let (own, error) = (own.length() / norm, error.length() / norm);
    println!(
        "{x} {derivatives:?}: |∇L| {norm:.4}, off by {off:.3}, errors {own:.3} and {error:.3}, z {z:.2}"
    );
    (z, off)
}

#[test]
fn gradients_of_records_are_those_of_path_traced_light_at_points_of_the_cornell_box() {
    let scene = workspace().join("assets/cornell_box/cornell_box.ron");
    let scene = tyndall_scene::load(&scene, &LoadOptions::default()).unwrap();
    let text = workspace().join("tests/references/cornell_box_gradients.json");
    let references: Vec<Reference> =
        serde_json::from_str(&fs::read_to_string(text).unwrap()).unwrap();
    assert_eq!(references.len(), 50);

    let [aware, blind] = [Derivatives::Aware, Derivatives::Blind].map(|derivatives| {
        let found: Vec<(f64, f64)> = references
            .par_iter()
            .enumerate()
            .map(|(i, reference)| check(&scene, (i as u64, reference), derivatives))
            .collect();
        let missed = found.iter().filter(|(z, _)| *z > MAX_Z).count();
        let mut off: Vec<f64> = found.iter().map(|(_, off)| *off).collect();
        off.sort_by(f64::total_cmp);
        println!(
            "{derivatives:?}: {missed} points beyond z = {MAX_Z}, median distance {:.3}",
            off[25]
        );
        (missed, off[25])
    });
    assert_eq!(aware.0, 0, "points beyond z = {MAX_Z}");
    // The median holds the noise of the differences, 6 %.
    assert!(aware.1 < 0.1, "median distance {}", aware.1);
    assert!(blind.0 >= 4, "silhouettes make no difference: {}", blind.0);
}

#[test]
fn records_on_surfaces_and_in_corners_are_finite() {
    let scene = workspace().join("assets/cornell_box/cornell_box.ron");
    let scene = tyndall_scene::load(&scene, &LoadOptions::default()).unwrap();
    let (world, pattern) = (scene.world(), GatherPattern::new(RAYS));
    // On the floor, under a block, on the lamp, in a corner, beside it, and far outside.
    for at in [
        [0.0, 0.0, 0.0],
        [0.05, 0.0, -0.1],
        [0.0, 0.5468, 0.0],
        [0.275, 0.0, -0.275],
        [0.275, 1e-7, -0.2749],
        [1e4, -1e4, 1e4],
    ] {
        for (index, derivatives) in [Derivatives::Aware, Derivatives::Blind]
            .into_iter()
            .enumerate()
        {
            let key = Key {
                seed: 32,
                purpose: Purpose::Record,
                index: index as u64,
            };
            let g = multiple_towards(
                &world,
                at.into(),
                None,
                &pattern,
                derivatives,
                Reach::default(),
                key,
            );
            let finite = g.value.is_finite()
                && g.value_error.is_finite()
                && g.gradient
                    .iter()
                    .chain(&g.gradient_error)
                    .all(|v| v.is_finite());
            assert!(finite, "{at:?} {derivatives:?}: {g:?}");
        }
    }
}
