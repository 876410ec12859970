//! Nanoseconds per closest hit and per shadow ray: on the Sponza atrium where that asset stands beside the workspace, and
//! on a procedural landscape everywhere.
#![allow(
    missing_docs,
    reason = "criterion's macros write undocumented functions"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use std::collections::HashMap;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_scene::gltf::{self, GltfScene};
use tyndall_scene::material::Material;
use tyndall_scene::mesh::TriangleMesh;
use tyndall_scene::triangles::{Surfaces, Triangles};
use tyndall_transport::Geometry;

/// A hilly landscape of 2 · 256² triangles, under a flat sky of two.
fn landscape() -> Triangles {
    let n = 256_u32;
    let at = |i: u32, k: u32| i * (n + 1) + k;
    let height = |x: f32, z: f32| 6.0 * (0.11 * x).sin() * (0.07 * z).cos() + (0.9 * x + z).sin();
    let positions: Vec<Vec3> = (0..=n)
        .flat_map(|i| (0..=n).map(move |k| (i as f32, k as f32)))
        .map(|(x, z)| Vec3::new(x, height(x, z), z))
        .collect();
    let indices: Vec<[u32; 3]> = (0..n)
        .flat_map(|i| (0..n).map(move |k| (i, k)))
        .flat_map(|(i, k)| {
            [
                [at(i, k), at(i, k + 1), at(i + 1, k + 1)],
                [at(i, k), at(i + 1, k + 1), at(i + 1, k)],
            ]
        })
        .collect();
    let surfaces = Surfaces {
        mesh: TriangleMesh {
            normals: vec![Vec3::ZERO; positions.len()],
            materials: vec![0; indices.len()],
            positions,
            indices,
            ..TriangleMesh::default()
        },
        materials: vec![Material::default()],
        textures: Vec::new(),
    };
    Triangles::new(Arc::new(surfaces), HashMap::new())
}

/// Rays in all directions from points within the middle of the scene's box.
fn rays(scene: &Triangles) -> Vec<Ray> {
    let bounds = scene.bounds();
    let extent = (bounds.max - bounds.min) * 0.4;
    (0..4096)
        .map(|index| {
            let key = Key {
                seed: 1,
                purpose: Purpose::Probe,
                index,
            };
            let mut u = Sampler::new(key, 0);
            let [x, y] = u.next_2d();
            let place = Vec3::new(x, y, u.next_1d()) - 0.5;
            Ray::new(
                bounds.center() + extent * place,
                warp::uniform_sphere(u.next_2d()),
            )
        })
        .collect()
}

fn measure(criterion: &mut Criterion, name: &str, scene: &Triangles) {
    let rays = rays(scene);
    let mut next = (0..rays.len()).cycle();
    let mut ray = move || rays[next.next().unwrap_or(0)];
    let far = scene.bounds().diagonal();
    let mut group = criterion.benchmark_group(name);
    group.bench_function("closest hit", |bench| {
        bench.iter(|| scene.intersect(black_box(&ray()), f32::INFINITY));
    });
    group.bench_function("shadow ray", |bench| {
        bench.iter(|| scene.occluded(black_box(&ray()), far));
    });
    group.finish();
}

fn bench(criterion: &mut Criterion) {
    measure(criterion, "landscape", &landscape());
    let sponza = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/assets/scenes/sponza_dabrovic/sponza.gltf");
    if !sponza.exists() {
        return;
    }
    match gltf::read(&sponza, &gltf::ReadOptions::default()) {
        Ok(GltfScene {
            mesh,
            materials,
            textures,
            ..
        }) => {
            let surfaces = Surfaces {
                mesh,
                materials,
                textures,
            };
            let sponza = Triangles::new(Arc::new(surfaces), HashMap::new());
            measure(criterion, "sponza", &sponza);
        }
        Err(error) => eprintln!("sponza is left out: {error}"),
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
