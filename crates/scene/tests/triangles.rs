//! Rays against triangles: nothing leaks, nothing differs from trying every triangle, nothing is NaN.
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::sync::Arc;
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_scene::material::Material;
use tyndall_scene::mesh::TriangleMesh;
use tyndall_scene::texture::{Filter, Texture, TextureRef};
use tyndall_scene::triangles::{Surfaces, Triangles};
use tyndall_scene::watertight::ShearedRay;
use tyndall_transport::Geometry;

/// Independent random numbers for case `index` of the test named by `seed`.
fn random(seed: u64, index: u64) -> Sampler {
    Sampler::new(
        Key {
            seed,
            purpose: Purpose::Probe,
            index,
        },
        0,
    )
}

fn mesh(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh {
        normals: vec![Vec3::ZERO; positions.len()],
        materials: vec![0; indices.len()],
        positions,
        indices,
        ..TriangleMesh::default()
    }
}

fn triangles_of(mesh: TriangleMesh, material: Material) -> Triangles {
    let surfaces = Surfaces {
        mesh,
        materials: vec![material],
        textures: Vec::new(),
    };
    Triangles::new(Arc::new(surfaces), HashMap::new())
}

fn triangles(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Triangles {
    triangles_of(mesh(positions, indices), Material::default())
}

/// A closed sphere of radius 1 around the origin: an icosahedron whose faces are cut in four, `levels` times.
fn icosphere(levels: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let g = (1.0 + 5f32.sqrt()) / 2.0;
    let mut positions: Vec<Vec3> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .map(|p| Vec3::from(p).normalize())
    .to_vec();
    let mut indices: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32, positions: &mut Vec<Vec3>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        indices = indices
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] =
                    [(a, b), (b, c), (c, a)].map(|(p, q)| middle(p, q, &mut positions));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (positions, indices)
}

/// Rays from inside the sphere: at its faces, at points of its edges, at its corners, and along the axes.
fn ray_from_inside(
    positions: &[Vec3],
    indices: &[[u32; 3]],
    center: Vec3,
    seed: u64,
    i: u64,
) -> Ray {
    let mut u = random(seed, i);
    let origin = center + warp::uniform_sphere(u.next_2d()) * (0.9 * u.next_1d());
    let corners = indices[(u.next_1d() * indices.len() as f32) as usize]
        .map(|corner| positions[corner as usize]);
    let target = match i % 4 {
        0 => return Ray::new(origin, warp::uniform_sphere(u.next_2d())),
        1 => corners[0].lerp(corners[1], u.next_1d()),
        2 => corners[2],
        _ => {
            let axes = [
                Vec3::X,
                Vec3::Y,
                Vec3::Z,
                Vec3::NEG_X,
                Vec3::NEG_Y,
                Vec3::NEG_Z,
            ];
            // Straight at a corner, with zeros of both signs in the direction.
            let axis = axes[(u.next_1d() * 6.0) as usize];
            return Ray::new(corners[0] * (1.0 - axis.abs()) + center * axis.abs(), axis);
        }
    };
    Ray::new(origin, (target - origin).normalize())
}

#[test]
fn no_ray_leaves_a_closed_sphere_through_faces_edges_or_corners() {
    let (positions, indices) = icosphere(4);
    let sphere = triangles(positions.clone(), indices.clone());
    let leaks = (0..1_000_000)
        .map(|i| ray_from_inside(&positions, &indices, Vec3::ZERO, 1, i))
        // Straight rays at corners may start on the hull itself, where leaving is right.
        .filter(|ray| ray.origin.length() < 0.99)
        .filter(|ray| {
            sphere.intersect(ray, f32::INFINITY).is_none() || !sphere.occluded(ray, f32::INFINITY)
        })
        .count();
    assert_eq!(leaks, 0);
}

#[test]
fn no_ray_leaves_a_sphere_far_from_the_origin_where_coordinates_are_coarse() {
    // Embree's test of watertightness stands here; a unit in the last place is 1/64 m.
    let center = Vec3::new(148_376.0, 1_234.0, -223_423.0);
    let (positions, indices) = icosphere(2);
    let positions: Vec<Vec3> = positions.iter().map(|p| p * 20.0 + center).collect();
    let sphere = triangles(positions.clone(), indices.clone());
    let leaks = (0..300_000)
        .map(|i| {
            let ray = ray_from_inside(&positions, &indices, center, 2, i);
            if i % 4 == 3 {
                // Axis-aligned rays through the middle.
                Ray::new(center, ray.direction)
            } else {
                ray
            }
        })
        .filter(|ray| {
            sphere.intersect(ray, f32::INFINITY).is_none() || !sphere.occluded(ray, f32::INFINITY)
        })
        .count();
    assert_eq!(leaks, 0);
}

#[test]
fn scenes_of_any_size_are_as_tight() {
    let (positions, indices) = icosphere(2);
    for size in [1e-20, 1e-4, 1e6, 1e15] {
        let positions: Vec<Vec3> = positions.iter().map(|p| p * size).collect();
        let sphere = triangles(positions, indices.clone());
        for i in 0..20_000 {
            let mut u = random(3, i);
            let origin = warp::uniform_sphere(u.next_2d()) * (0.9 * size * u.next_1d());
            let ray = Ray::new(origin, warp::uniform_sphere(u.next_2d()));
            let hit = sphere.intersect(&ray, f32::INFINITY).unwrap();
            // The faces of the hull are up to 4 % inside the sphere.
            let distance = hit.position.length() / size;
            assert!((0.95..1.0001).contains(&distance), "{size}: {distance}");
            assert!((ray.at(hit.t) - hit.position).length() < 1e-5 * size);
            assert!(hit.normal.dot(ray.direction) < 0.0);
        }
    }
}

#[test]
fn no_ray_meets_again_the_triangle_it_leaves() {
    // Sizes from a millimetre to a kilometre, up to a hundred times as far from the origin, needles of 1 : 1000, and
    // directions down to 10⁻⁴ above the surface.
    for i in 0..100_000 {
        let mut s = random(77, i);
        let mut vec = || Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()) * 2.0 - 1.0;
        let [a, b, c, shift, from, turn] = std::array::from_fn(|_| vec());
        let mut power = |from: f32, to: f32| 10f32.powf(from + (to - from) * s.next_1d());
        let size = power(-3.0, 3.0);
        let shift = shift * power(-4.0, 2.0) * size;
        let needle = [a, a + (b - a) * power(-3.0, 0.0), c];
        let corners = needle.map(|p| p * size + shift);
        let (origin_at, cos) = (power(-2.0, 1.0) * size, power(-4.0, 0.0));

        let [u, v, w] = warp::uniform_triangle(s.next_2d());
        let target = corners[0] * u + corners[1] * v + corners[2] * w;
        let origin = target + from * origin_at;
        let ray = Ray::new(origin, (target - origin).normalize());
        let one = triangles(corners.to_vec(), vec![[0, 1, 2]]);
        // Where the ray grazes a needle, rounding makes it miss.
        let Some(hit) = one.intersect(&ray, f32::INFINITY) else {
            continue;
        };
        let tangent = turn.cross(hit.normal).normalize();
        let w_i = (tangent * (1.0 - cos * cos).sqrt() + hit.normal * cos).normalize();
        let leaving = hit.spawn(w_i);
        assert!(
            !one.occluded(&leaving, f32::INFINITY),
            "{corners:?} met again from {leaving:?}"
        );
    }
}

#[test]
fn a_hit_closer_than_a_tenth_of_a_millimetre_is_found() {
    let (positions, indices) = icosphere(2);
    let sphere = triangles(positions, indices);
    for i in 0..10_000 {
        let direction = warp::uniform_sphere(random(4, i).next_2d());
        let hit = sphere
            .intersect(&Ray::new(Vec3::ZERO, direction), f32::INFINITY)
            .unwrap();
        let near = Ray::new(direction * (hit.t - 2e-6), direction);
        assert!(sphere.occluded(&near, 1e-4));
        assert!(sphere.intersect(&near, 1e-4).unwrap().t < 5e-6);
    }
}

#[test]
fn vertical_rays_upon_a_plain_of_squares_all_land() {
    let n = 64;
    let at = |i: u32, k: u32| i * (n + 1) + k;
    let positions = (0..=n)
        .flat_map(|i| (0..=n).map(move |k| Vec3::new(i as f32, 0.0, k as f32)))
        .collect();
    let indices = (0..n)
        .flat_map(|i| (0..n).map(move |k| (i, k)))
        .flat_map(|(i, k)| {
            [
                [at(i, k), at(i, k + 1), at(i + 1, k + 1)],
                [at(i, k), at(i + 1, k + 1), at(i + 1, k)],
            ]
        })
        .collect();
    let plain = triangles(positions, indices);
    for i in 0..200_000 {
        let mut u = random(5, i);
        let [mut x, mut z] = u.next_2d().map(|u| u * n as f32);
        if i % 3 > 0 {
            x = x.round().clamp(1.0, n as f32 - 1.0);
        }
        if i % 3 > 1 {
            z = z.round().clamp(1.0, n as f32 - 1.0);
        }
        for down in [Vec3::NEG_Y, Vec3::new(-0.0, -1.0, -0.0)] {
            let ray = Ray::new(Vec3::new(x, 100.0, z), down);
            let hit = plain.intersect(&ray, f32::INFINITY).unwrap();
            assert_eq!((hit.t, hit.normal), (100.0, Vec3::Y));
        }
    }
}

#[test]
fn rays_in_the_plane_of_a_quad_hit_or_miss_but_are_never_nan() {
    let quad = triangles(
        vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 0.0, 1.0), Vec3::Z],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    for i in 0..200_000 {
        let mut u = random(6, i);
        let [x, z] = u.next_2d().map(|u| 3.0 * u - 1.0);
        let angle = u.next_1d() * std::f32::consts::TAU;
        // Exactly in the plane, and tilted by rounding only; from outside, from inside, from a corner.
        let tilt = if i % 2 == 0 { 0.0 } else { 1e-8 };
        let origin = if i % 5 == 0 {
            Vec3::X
        } else {
            Vec3::new(x, 0.0, z)
        };
        let ray = Ray::new(
            origin,
            Vec3::new(angle.cos(), tilt, angle.sin()).normalize(),
        );
        if let Some(hit) = quad.intersect(&ray, f32::INFINITY) {
            assert!(hit.t > 0.0 && hit.t.is_finite());
            assert!(hit.position.is_finite() && hit.normal.is_normalized());
        }
        quad.occluded(&ray, f32::INFINITY);
    }
}

#[test]
fn rays_that_are_not_finite_meet_nothing() {
    let (positions, indices) = icosphere(1);
    let sphere = triangles(positions, indices);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38] {
        for axis in 0..3 {
            let mut ray = Ray::new(Vec3::ZERO, Vec3::X);
            ray.origin[axis] = bad;
            assert!(
                sphere
                    .intersect(&ray, f32::INFINITY)
                    .is_none_or(|hit| hit.t.is_finite())
            );
            let mut ray = Ray::new(Vec3::ZERO, Vec3::X);
            ray.direction[axis] = bad;
            if bad.is_nan() {
                assert!(sphere.intersect(&ray, f32::INFINITY).is_none());
                assert!(!sphere.occluded(&ray, f32::INFINITY));
            }
        }
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        assert_eq!(sphere.occluded(&ray, bad), bad > 0.0);
    }
}

#[test]
fn the_hierarchy_finds_what_trying_every_triangle_finds() {
    let mut positions = Vec::new();
    for i in 0..1500 {
        let mut u = random(7, i);
        let center = Vec3::new(u.next_1d(), u.next_1d(), u.next_1d()) * 10.0;
        let size = if i % 50 == 0 { 8.0 } else { 0.5 };
        for _ in 0..3 {
            positions.push(center + warp::uniform_sphere(u.next_2d()) * (size * u.next_1d()));
        }
    }
    let indices: Vec<[u32; 3]> = (0..1500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let soup = mesh(positions, indices);
    let hierarchy = triangles_of(soup.clone(), Material::default());
    let mut n_hits = 0;
    for i in 0..20_000 {
        let mut u = random(8, i);
        let origin = Vec3::new(u.next_1d(), u.next_1d(), u.next_1d()) * 14.0 - 2.0;
        let ray = Ray::new(origin, warp::uniform_sphere(u.next_2d()));
        let t_max = if i % 2 == 0 { f32::INFINITY } else { 4.0 };
        let sheared = ShearedRay::new(&ray);
        let mut nearest = t_max;
        for triangle in 0..soup.indices.len() {
            if let Some(hit) = sheared.intersect(&soup.corners(triangle), nearest) {
                nearest = hit.t;
            }
        }
        let found = hierarchy.intersect(&ray, t_max).map(|hit| hit.t);
        // Equal to the bit: scaling by a power of two is exact.
        assert_eq!(found, (nearest < t_max).then_some(nearest), "{ray:?}");
        assert_eq!(hierarchy.occluded(&ray, t_max), found.is_some());
        n_hits += u32::from(found.is_some());
    }
    assert!(n_hits > 1_000, "{n_hits}");
}

#[test]
fn a_hundred_thousand_copies_of_one_triangle_build_and_answer() {
    let n = 100_000;
    let copies = triangles(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; n]);
    assert_eq!(copies.len(), n);
    let ray = Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
    assert_eq!(copies.intersect(&ray, 5.0).unwrap().t, 1.0);
}

#[test]
fn nothing_is_hit_where_there_is_nothing() {
    let nothing = triangles(Vec::new(), Vec::new());
    assert!(nothing.is_empty() && nothing.bounds().is_empty());
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert!(nothing.intersect(&ray, f32::INFINITY).is_none());
    assert!(!nothing.occluded(&ray, f32::INFINITY));
    assert!(!Triangles::new(Arc::default(), HashMap::new()).occluded(&ray, 1.0));
}

const DOWN: Vec3 = Vec3::NEG_Z;

fn lamp(double_sided: bool) -> Triangles {
    let surfaces = Surfaces {
        mesh: mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]),
        materials: vec![Material {
            emissive: Vec3::new(3.0, 2.0, 1.0),
            double_sided,
            ..Material::default()
        }],
        textures: Vec::new(),
    };
    Triangles::new(Arc::new(surfaces), HashMap::from([(0, 7)]))
}

#[test]
fn emission_and_its_light_belong_to_the_front_unless_the_material_is_double_sided() {
    for (double_sided, z, emits) in [
        (false, 1.0, true),
        (false, -1.0, false),
        (true, 1.0, true),
        (true, -1.0, true),
    ] {
        let ray = Ray::new(Vec3::new(0.2, 0.2, z), DOWN * z);
        let hit = lamp(double_sided).intersect(&ray, 5.0).unwrap();
        assert_eq!(hit.emission != Vec3::ZERO, emits);
        assert_eq!(hit.light, emits.then_some(7));
        assert_eq!(hit.normal, Vec3::Z * z);
    }
}

#[test]
fn shading_normals_interpolate_stand_on_the_viewers_side_and_never_face_away() {
    let tilted = Vec3::new(0.6, 0.0, 0.8);
    let mut smooth = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    smooth.normals = vec![Vec3::Z, tilted, Vec3::Z];
    let smooth = triangles_of(smooth, Material::default());
    for z in [1.0, -1.0] {
        let ray = Ray::new(Vec3::new(0.5, 0.25, z), DOWN * z);
        let normal = smooth.intersect(&ray, 5.0).unwrap().bsdf.normal();
        let expected = (Vec3::Z * 0.5 + tilted * 0.5).normalize() * z;
        assert!((normal - expected).length() < 1e-6);
    }
    for i in 0..10_000 {
        let mut u = random(9, i);
        let w = warp::uniform_sphere(u.next_2d());
        let target = Vec3::new(0.3, 0.3, 0.0);
        let hit = smooth.intersect(&Ray::new(target - w, w), 5.0);
        // Rays within rounding of the plane may miss.
        let Some(hit) = hit else { continue };
        let normal = hit.bsdf.normal();
        assert!(normal.is_normalized());
        assert!(normal.dot(hit.normal) > 0.0 && normal.dot(-w) > 0.0, "{w}");
    }
}

#[test]
fn holes_of_an_alpha_mask_let_rays_through_to_what_is_behind() {
    // Left half opaque, right half a hole, before a solid wall.
    let texels = vec![[255, 255, 255, 255], [255, 255, 255, 0]];
    let texture = TextureRef {
        filter: Filter::Nearest,
        ..TextureRef::new(0)
    };
    let square =
        |z: f32| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z));
    let mut both = mesh(
        [square(1.0), square(0.0)].concat(),
        vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    );
    both.materials = vec![1, 1, 0, 0];
    both.uvs[0] = both.positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
    both.colors = vec![Vec4::ONE; 8];
    let mask = Material {
        base_color_texture: Some(texture),
        alpha_cutoff: Some(0.5),
        ..Material::default()
    };
    let surfaces = Surfaces {
        mesh: both,
        materials: vec![Material::default(), mask],
        textures: vec![Texture::new(2, 1, texels).unwrap()],
    };
    let scene = Triangles::new(Arc::new(surfaces), HashMap::new());
    for (x, t) in [(0.25, 1.0), (0.75, 2.0)] {
        let ray = Ray::new(Vec3::new(x, 0.4, 2.0), DOWN);
        assert_eq!(scene.intersect(&ray, 5.0).unwrap().t, t);
        assert_eq!(scene.occluded(&ray, 1.5), t < 1.5);
        assert!(scene.occluded(&ray, 2.5));
    }
}
