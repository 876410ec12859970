//! Emissive surfaces are found alike by rays that meet them and by samples towards them.
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::Vec3;
use std::sync::Arc;
use tyndall_math::stats::{Welford, z_test};
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_scene::lights::{Light, LightSet};
use tyndall_scene::material::Material;
use tyndall_scene::mesh::TriangleMesh;
use tyndall_scene::triangles::{Surfaces, Triangles};
use tyndall_transport::{Geometry, Lights};

/// A one-sided rectangle of radiance 2 and a double-sided triangle of radiance 5, neither in front of the other.
fn scene() -> (Triangles, LightSet) {
    let positions: Vec<Vec3> = [
        [-1.0, -0.5, 2.0],
        [-1.0, 0.5, 2.0],
        [1.0, 0.5, 2.0],
        [1.0, -0.5, 2.0],
        [0.0, -2.0, -1.0],
        [1.0, -2.0, -1.0],
        [0.0, -1.5, -0.5],
    ]
    .map(Vec3::from)
    .to_vec();
    let lamp = |radiance: f32, double_sided| Material {
        emissive: Vec3::splat(radiance),
        double_sided,
        ..Material::default()
    };
    let surfaces = Arc::new(Surfaces {
        mesh: TriangleMesh {
            normals: vec![Vec3::ZERO; positions.len()],
            positions,
            indices: vec![[0, 1, 2], [4, 5, 6], [0, 2, 3]],
            materials: vec![0, 1, 0],
            ..TriangleMesh::default()
        },
        materials: vec![lamp(2.0, false), lamp(5.0, true)],
        textures: Vec::new(),
    });
    let (lights, light_of_triangle) = LightSet::new([], &surfaces);
    (Triangles::new(surfaces, light_of_triangle), lights)
}

fn random(index: u64) -> Sampler {
    let key = Key {
        seed: 21,
        purpose: Purpose::Probe,
        index,
    };
    Sampler::new(key, 0)
}

#[test]
fn rectangles_become_one_light_and_odd_triangles_another() {
    let (_, lights) = scene();
    let kinds: Vec<_> = lights.list().iter().collect();
    assert!(matches!(kinds[..], [Light::Quad(_), Light::Triangle(_)]));
    // π A L: 2 m² at 2, and both sides of a triangle of legs 1 and √½ at 5.
    let power: f32 = kinds.iter().map(|light| light.power(0.0).x).sum();
    let exact = std::f32::consts::PI * (2.0 * 2.0 + 2.0 * 5.0 * 0.5 * 0.5f32.sqrt());
    assert!(
        (power / exact - 1.0).abs() < 1e-6,
        "rounding only: {power} {exact}"
    );
}

#[test]
fn a_sample_towards_a_light_is_a_ray_that_meets_it_with_the_same_radiance_and_density() {
    let (geometry, lights) = scene();
    let (mut n_samples, mut n_met) = (0, 0);
    for i in 0..20_000 {
        let mut u = random(i);
        let p = warp::uniform_sphere(u.next_2d()) * 4.0;
        for light in 0..lights.count() {
            let Some(s) = lights.sample(light, p, u.next_2d()) else {
                continue;
            };
            n_samples += 1;
            let ray = Ray::new(p, s.w_i);
            let Some(hit) = geometry.intersect(&ray, s.distance * 1.001) else {
                continue;
            };
            if hit.light != Some(light) {
                continue;
            }
            n_met += 1;
            // A direction's rounding moves a grazing hit along the light.
            let cosine = s.w_i.dot(s.normal).abs();
            assert!((hit.t / s.distance - 1.0).abs() * cosine < 1e-5);
            assert_eq!(hit.emission, s.radiance);
            assert!((hit.normal - s.normal).length() < 1e-6);
            assert_eq!(lights.pdf(light, p, s.w_i), s.pdf);
        }
    }
    // The rest is hidden by the other light, or rounded across an edge.
    assert!(n_met > n_samples * 9 / 10, "{n_met} of {n_samples}");
}

#[test]
fn rays_in_all_directions_and_samples_of_the_lights_see_the_same_fluence() {
    let (geometry, lights) = scene();
    for p in [
        Vec3::ZERO,
        Vec3::new(0.4, -1.0, 1.0),
        Vec3::new(0.3, -2.5, -0.9),
        Vec3::new(0.0, 0.0, 3.0),
    ] {
        let (mut by_rays, mut by_samples) = (Welford::new(), Welford::new());
        for i in 0..200_000 {
            let mut u = random(i);
            let ray = Ray::new(p, warp::uniform_sphere(u.next_2d()));
            let met = geometry.intersect(&ray, f32::INFINITY);
            let emission = met.map_or(0.0, |hit| hit.emission.x);
            by_rays.push(f64::from(emission * 4.0 * std::f32::consts::PI));
            let sampled: f32 = (0..lights.count())
                .filter_map(|light| lights.sample(light, p, u.next_2d()))
                .map(|s| {
                    let before = s.distance * 0.999;
                    let blocked = geometry.occluded(&Ray::new(p, s.w_i), before);
                    if blocked { 0.0 } else { s.radiance.x / s.pdf }
                })
                .sum();
            by_samples.push(f64::from(sampled));
        }
        let error = by_rays.standard_error().hypot(by_samples.standard_error());
        // False alarms: 4 points at one in a million.
        let p_value = z_test(by_rays.mean(), error, by_samples.mean());
        assert!(
            p_value > 1e-6,
            "{p}: {} {}",
            by_rays.mean(),
            by_samples.mean()
        );
    }
}
