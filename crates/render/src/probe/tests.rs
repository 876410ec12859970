#![allow(clippy::unwrap_used, reason = "tests")]
use super::*;
use tyndall_scene::{LoadOptions, load_str};

const SPOT: &str = "Spot(position: (-1, 0.5, 1), direction: (1.3, -0.5, -0.8), intensity: (4, 2, 1), inner_cone: 2, outer_cone: 30)";

fn scene(media: &str) -> Scene {
    let point = "Point(position: (1.1, -0.4, 1.6), intensity: (2.5, 2.5, 2.5))";
    lit_by(&format!("{point}, {SPOT}"), media)
}

fn lit_by(lights: &str, media: &str) -> Scene {
    let text = format!(
        "Scene(
            camera: LookAt(eye: (0, 0, 5), target: (0, 0, 0), vfov: 40),
            lights: [{lights}],
            media: [{media}],
        )"
    );
    load_str(&text, ".".as_ref(), &LoadOptions::default()).unwrap()
}

const FOG: &str =
    "Medium(sigma_t: (0.8, 0.6, 0.4), albedo: (0.5, 0.9, 1), phase: HenyeyGreenstein(g: 0.6),
    region: Sphere(center: (0, 0, 0), radius: 3), density: Height(base: -1, scale_height: 2))";

fn options(integrator: Integrator, samples: u32) -> ProbeOptions {
    ProbeOptions {
        at: Vec3::new(0.3, 0.2, 0.1),
        towards: Some(Vec3::new(0.2, 0.3, -0.9)),
        samples,
        integrator,
        derivatives: Derivatives::Aware,
        seed: 7,
    }
}

/// Asserts that `a` and `b` agree within 5 of their standard errors and `share` of the largest of them.
/// False alarm: 32 batches each, about 2e-5 a number.
fn assert_close(name: &str, a: [f32; 3], b: [f32; 3], errors: [[f32; 3]; 2], share: f32) {
    let largest = a.map(f32::abs).into_iter().fold(0.0, f32::max);
    for c in 0..3 {
        let error = errors[0][c].hypot(errors[1][c]);
        assert!(
            (a[c] - b[c]).abs() <= 5.0 * error + share * largest,
            "{name}: {a:?} {b:?} ± {error}"
        );
    }
}

#[test]
fn records_and_paths_tell_the_same_light_and_gradients() {
    let scene = scene(FOG);
    let cache = probe(&scene, &options(Integrator::Cache, 16_384)).unwrap();
    let path = probe(&scene, &options(Integrator::Path, 16_384)).unwrap();
    for (name, a, b) in [
        ("single", cache.single, path.single),
        ("multiple", cache.multiple, path.multiple),
    ] {
        assert_close(name, a.value, b.value, [a.stderr, b.stderr], 1e-5);
        for c in 0..3 {
            // Differences over 2 % of a length are good to the square of that, and f32 takes its part.
            assert_close(
                name,
                a.gradient[c],
                b.gradient[c],
                [a.gradient_stderr[c], b.gradient_stderr[c]],
                2e-3,
            );
        }
        assert!(a.value[0] > 0.0 && a.stderr[0] < 0.05 * a.value[0]);
    }
    assert_eq!(cache.sigma_t, path.sigma_t);
    assert!((cache.sigma_s[1] / cache.sigma_t[1] - 0.9).abs() < 1e-6);
}

#[test]
fn the_hessian_is_the_slope_of_the_gradient_and_told_where_it_is_known() {
    // One lamp: with more, the choice among them moves with the point.
    let scene = lit_by(SPOT, FOG);
    let good = options(Integrator::Cache, 64);
    let found = probe(&scene, &good).unwrap();
    assert_eq!(found.multiple.hessian, None);
    assert!(found.single.hessian_stderr.is_some() && found.multiple.hessian_stderr.is_none());
    let path = probe(&scene, &options(Integrator::Path, 16)).unwrap();
    assert_eq!((path.single.hessian, path.multiple.hessian), (None, None));
    let h = 0.01;
    let hessian = found.single.hessian.unwrap();
    for (i, axis) in Vec3::AXES.into_iter().enumerate() {
        let [a, b] = [h, -h].map(|h| {
            let at = good.at + h * axis;
            probe(&scene, &ProbeOptions { at, ..good }).unwrap().single
        });
        for (c, hessian) in hessian.iter().enumerate() {
            let numbers = hessian.iter().flatten();
            let size = numbers.fold(0.0, |most: f64, number| most.max(number.abs()));
            for (j, found) in hessian[i].iter().enumerate() {
                let slope = f64::from(a.gradient[c][j] - b.gradient[c][j]) / f64::from(2.0 * h);
                // (h/r)² of fourth derivatives.
                assert!(
                    (found - slope).abs() < 0.02 * size,
                    "{c} {i} {j}: {found} {slope}"
                );
            }
        }
    }
}

#[test]
fn questions_without_an_answer_are_refused() {
    let forward = scene(FOG);
    let good = options(Integrator::Cache, 16);
    let ask = |scene: &Scene, options: ProbeOptions| probe(scene, &options).unwrap_err();
    let without = ProbeOptions {
        towards: None,
        ..good
    };
    assert_eq!(ask(&forward, without), ProbeError::DirectionMissing);
    assert!(
        probe(&scene(""), &without).is_ok(),
        "nothing depends on it there"
    );
    let nowhere = ProbeOptions {
        towards: Some(Vec3::ZERO),
        ..good
    };
    assert_eq!(ask(&forward, nowhere), ProbeError::Direction(Vec3::ZERO));
    let none = ProbeOptions { samples: 0, ..good };
    assert_eq!(ask(&forward, none), ProbeError::FewSamples(0));
}

#[test]
fn outside_of_media_light_is_told_as_if_it_were_scattered_equally() {
    let fog = "Medium(sigma_t: (1, 1, 1), albedo: (0.9, 0.9, 0.9), region: Sphere(center: (2.6, 0, 0), radius: 2))";
    let found = probe(&scene(fog), &options(Integrator::Cache, 256)).unwrap();
    assert_eq!(found.sigma_t, [0.0; 3]);
    assert!(found.single.value[0] > 0.0 && found.multiple.value[0] > 0.0);
}
