//! One conformance test for every light: what is drawn, what is said of it, and what it adds up to.

use super::*;
use crate::material::Material;
use crate::mesh::TriangleMesh;
use crate::texture::{Filter, Texture, TextureRef};
use glam::Vec2;
use tyndall_math::stats::{Welford, z_test};
use tyndall_math::testing::{Directions, FALSE_ALARM_RATE, assert_conforms};
use tyndall_math::{Key, Purpose, Sampler, warp};
use tyndall_transport::importance::mean;

/// The point of the benchmarks E2b.
const P: Vec3 = Vec3::new(0.3, 0.2, 0.1);

/// The rectangle of the benchmarks E2b, 2 m × 1 m at z = 2, facing down upon [`P`], of radiance 1.
fn rectangle(double_sided: bool) -> Light {
    Light::Quad(QuadLight::new(
        Vec3::new(-1.0, -0.5, 2.0),
        [Vec3::Y, Vec3::X * 2.0],
        Vec3::ONE,
        double_sided,
    ))
}

fn triangle(corners: [Vec3; 3], double_sided: bool) -> Light {
    let emission = Emission::Constant(Vec3::ONE);
    Light::Triangle(TriangleLight::new(corners, emission, double_sided))
}

/// A texture whose left half is black and whose right half is white, over a triangle of the mesh.
fn half_lit_triangle(corners: [Vec3; 3]) -> Arc<Surfaces> {
    let map = TextureRef {
        filter: Filter::Nearest,
        ..TextureRef::new(0)
    };
    let texels = vec![[0, 0, 0, 255], [255; 4]];
    Arc::new(Surfaces {
        mesh: TriangleMesh {
            positions: corners.to_vec(),
            normals: vec![Vec3::ZERO; 3],
            uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::Y], Vec::new()],
            indices: vec![[0, 1, 2]],
            materials: vec![0],
            ..TriangleMesh::default()
        },
        materials: vec![Material {
            emissive: Vec3::splat(2.0),
            emissive_texture: Some(map),
            ..Material::default()
        }],
        textures: Texture::new(2, 1, texels).into_iter().collect(),
    })
}

/// An image with black texels, a sun, and everything between.
fn image(width: usize, height: usize) -> EnvironmentImage {
    let texels = (0..width * height)
        .map(|i| match (i * 7 + i / width * 3 + 4) % 11 {
            0..=3 => Vec3::ZERO,
            4 => Vec3::new(40.0, 30.0, 20.0),
            k => Vec3::new(k as f32, 1.0, 0.5),
        })
        .collect();
    EnvironmentImage::new(width, height, texels).unwrap()
}

fn environment(image: EnvironmentImage) -> Light {
    Light::Environment(EnvironmentLight::new(image, 0.5, 1.0))
}

/// Independent uniform pairs.
fn pairs(seed: u64) -> impl Iterator<Item = [f32; 2]> {
    (0..).map(move |index| {
        let key = Key {
            seed,
            purpose: Purpose::Probe,
            index,
        };
        Sampler::new(key, 0).next_2d()
    })
}

/// Whether direction `w` from `p` meets the polygon of `corners`, in f64.
fn meets(p: Vec3, corners: &[Vec3], w: Vec3) -> bool {
    let w = w.as_dvec3();
    let at = |i: usize| corners[i % corners.len()].as_dvec3() - p.as_dvec3();
    let sides: Vec<f64> = (0..corners.len())
        .map(|i| at(i).cross(at(i + 1)).dot(w))
        .collect();
    // The triple products alone also hold for the opposite direction.
    let normal = (at(1) - at(0)).cross(at(2) - at(0));
    let ahead = at(0).dot(normal) * w.dot(normal) > 0.0;
    ahead && (sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0))
}

/// χ² test of `light` at `p`; `found` says which directions meet it.
fn check(light: &Light, p: Vec3, domain: &Directions, found: impl Fn(Vec3) -> bool) {
    assert_conforms(
        domain,
        11,
        |u| light.sample(p, u).map(|s| (s.w_i, s.pdf)),
        |w| if found(w) { light.pdf(p, w) } else { 0.0 },
    );
}

#[test]
fn flat_lights_draw_what_they_say_from_near_and_far_from_the_front_and_the_back() {
    let corners = [
        Vec3::new(-1.0, -0.5, 2.0),
        Vec3::new(-1.0, 0.5, 2.0),
        Vec3::new(1.0, 0.5, 2.0),
        Vec3::new(1.0, -0.5, 2.0),
    ];
    for p in [
        P,
        Vec3::new(0.2, 0.1, 1.99),
        Vec3::new(3.0, 0.0, 1.5),
        Vec3::new(10.0, -40.0, -90.0),
        Vec3::new(0.3, 0.2, 3.0),
    ] {
        let center = corners.iter().sum::<Vec3>() / 4.0;
        let to_center = center - p;
        // A cap around the light: the farthest corner and a little more.
        let axis = to_center.normalize();
        let narrowest = corners
            .iter()
            .map(|c| (c - p).normalize().dot(axis))
            .fold(1.0, f32::min);
        let domain = Directions::cap(axis, 1.0 - 1.2 * (1.0 - narrowest));
        check(&rectangle(true), p, &domain, |w| meets(p, &corners, w));
        for half in [[0, 1, 2], [0, 2, 3]] {
            let half = half.map(|i| corners[i]);
            check(&triangle(half, true), p, &domain, |w| meets(p, &half, w));
        }
    }
}

#[test]
fn skies_and_images_draw_what_they_say() {
    let sphere = Directions::sphere();
    check(&Light::Sky(SkyLight::new(Vec3::ONE)), P, &sphere, |_| true);
    for (width, height) in [(1, 1), (2, 1), (1, 3), (24, 12)] {
        check(&environment(image(width, height)), P, &sphere, |_| true);
    }
}

/// Mean of radiance × `weight` / density over samples must be `exact`; false alarms: one in a million.
fn check_integral(light: &Light, p: Vec3, weight: impl Fn(&LightSample) -> f32, exact: f64) {
    let mut sum = Welford::new();
    for u in pairs(12).take(100_000) {
        let value = light
            .sample(p, u)
            .map_or(0.0, |s| s.radiance.x * weight(&s) / s.pdf);
        sum.push(f64::from(value));
    }
    // Rounding of f32 where the estimator has no variance.
    let rounding = 1e-6 * exact;
    let p_value = z_test(sum.mean(), sum.standard_error() + rounding, exact);
    assert!(p_value >= FALSE_ALARM_RATE, "{} {exact}", sum.mean());
}

#[test]
fn the_rectangle_of_the_benchmarks_sends_what_the_closed_forms_say() {
    // exact-benchmarks E2b: solid angle, irradiance upon +Z, and fluence/4π behind an extinction of 0.8 per metre.
    for double_sided in [false, true] {
        let light = rectangle(double_sided);
        check_integral(&light, P, |_| 1.0, 0.458_401_504_649);
        check_integral(&light, P, |s| s.w_i.z, 0.432_636_239_506);
        let damped = |s: &LightSample| (-0.8 * s.distance).exp() / (4.0 * PI);
        check_integral(&light, P, damped, 0.007_282_578_897_52);
    }
    let corners = [[-1.0, -0.5], [-1.0, 0.5], [1.0, 0.5], [1.0, -0.5]];
    let corners = corners.map(|[x, y]| Vec3::new(x, y, 2.0));
    let halves = [[0, 1, 2], [0, 2, 3]].map(|t| triangle(t.map(|i| corners[i]), false));
    let whole: f32 = halves.iter().map(|half| 1.0 / half.pdf(P, Vec3::Z)).sum();
    assert!(
        (f64::from(whole) / 0.458_401_504_649 - 1.0).abs() < 1e-6,
        "rounding only"
    );
}

#[test]
fn samples_lie_on_the_light() {
    for (light, z) in [(rectangle(false), 2.0), (rectangle(true), 2.0)] {
        for u in pairs(13).take(10_000) {
            let s = light.sample(P, u).unwrap();
            let point = P + s.w_i * s.distance;
            assert!((point.z - z).abs() < 1e-6 && s.w_i.is_normalized());
            assert!(point.x.abs() < 1.000_001 && point.y.abs() < 0.500_001);
            assert_eq!(s.normal, Vec3::NEG_Z);
        }
    }
}

#[test]
fn a_one_sided_emitter_seen_from_behind_or_from_its_plane_sends_nothing() {
    let corners = [
        Vec3::new(0.0, 0.0, 2.0),
        Vec3::new(0.0, 1.0, 2.0),
        Vec3::new(1.0, 0.0, 2.0),
    ];
    for z in [2.0, 2.5, 100.0] {
        let p = Vec3::new(0.25, 0.25, z);
        for light in [rectangle(false), triangle(corners, false)] {
            assert!(light.sample(p, [0.4, 0.6]).is_none());
            assert_eq!(light.pdf(p, Vec3::NEG_Z), 0.0);
            assert_eq!(light.importance(p, None), 0.0);
        }
    }
}

#[test]
fn a_textured_triangle_sends_the_radiance_at_each_of_its_points() {
    let corners = [
        Vec3::new(0.0, 0.0, 2.0),
        Vec3::new(0.0, 1.0, 2.0),
        Vec3::new(1.0, 0.0, 2.0),
    ];
    let (set, light_of_triangle) = LightSet::new([], &half_lit_triangle(corners));
    assert_eq!(light_of_triangle, HashMap::from([(0, 0)]));
    let light = &set.list()[0];
    // u runs along y: lit where y > 1/2, a triangle of legs 1/2 and radiance 2. Its own fluence is 2 Ω.
    let lit = [
        Vec3::new(0.0, 0.5, 2.0),
        Vec3::new(0.0, 1.0, 2.0),
        Vec3::new(0.5, 0.5, 2.0),
    ];
    let solid_angle = 1.0 / f64::from(triangle(lit, false).pdf(P, Vec3::Z));
    check_integral(light, P, |_| 1.0, 2.0 * solid_angle);
    // A quarter of the area at radiance 2.
    let power = light.power(1.0).x / (PI * 0.5 * 0.5);
    assert!(
        (power - 1.0).abs() < 0.05,
        "as the lattice of the mean sees it: {power}"
    );
}

#[test]
fn holes_of_an_emitting_triangle_send_nothing() {
    let corners = [
        Vec3::new(0.0, 0.0, 2.0),
        Vec3::new(0.0, 1.0, 2.0),
        Vec3::new(1.0, 0.0, 2.0),
    ];
    let mut surfaces = half_lit_triangle(corners);
    let inner = Arc::get_mut(&mut surfaces).unwrap();
    let texels = vec![[255, 255, 255, 0], [255; 4]];
    inner.textures = Texture::new(2, 1, texels).into_iter().collect();
    inner.materials[0].alpha_cutoff = Some(0.5);
    inner.materials[0].base_color_texture = inner.materials[0].emissive_texture.take();
    let (set, _) = LightSet::new([], &surfaces);
    let (whole, hole) = (2.0 * triangle(corners, false).power(1.0).x, 0.75);
    let share = set.list()[0].power(1.0).x / whole;
    assert!(
        (share - (1.0 - hole)).abs() < 0.02,
        "as the lattice sees it: {share}"
    );
    for u in pairs(17).take(1000) {
        if let Some(s) = set.list()[0].sample(P, u) {
            assert!((P + s.w_i * s.distance).y > 0.499_999);
        }
    }
}

#[test]
fn a_black_texture_is_no_light() {
    let mut surfaces = half_lit_triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
    Arc::get_mut(&mut surfaces).unwrap().mesh.uvs[0] = vec![Vec2::splat(0.25); 3];
    let (set, light_of_triangle) = LightSet::new([], &surfaces);
    assert!(set.list().is_empty() && light_of_triangle.is_empty());
}

/// Integral of the first channel over all directions, by a fine midpoint rule.
fn bilinear_fluence(light: &EnvironmentLight) -> f64 {
    let n = 512;
    let mut sum = 0.0;
    for i in 0..n {
        let theta = PI * (i as f32 + 0.5) / n as f32;
        for k in 0..2 * n {
            let (sin_phi, cos_phi) = (PI * (k as f32 + 0.5) / n as f32).sin_cos();
            let w = Vec3::new(theta.sin() * sin_phi, theta.cos(), theta.sin() * cos_phi);
            sum += f64::from(light.radiance(w).x * theta.sin());
        }
    }
    sum * std::f64::consts::PI.powi(2) / f64::from(n * n)
}

#[test]
fn the_light_of_an_image_is_the_sum_over_its_texels() {
    for (width, height, tolerance) in [(1, 1, 1e-4), (64, 32, 5e-3)] {
        let light = EnvironmentLight::new(image(width, height), 0.5, 1.0);
        check_integral(
            &Light::Environment(light.clone()),
            P,
            |_| 1.0,
            bilinear_fluence(&light),
        );
        // Radiance is bilinear between texels and not constant on them: the sums differ where rows change their sine.
        let ratio = bilinear_fluence(&light) / f64::from(light.fluence().x);
        assert!((ratio - 1.0).abs() < tolerance, "{ratio}");
    }
    let white = EnvironmentImage::new(1, 1, vec![Vec3::ONE]).unwrap();
    let white = EnvironmentLight::new(white, 3.0, 0.0);
    assert!((white.fluence() / (12.0 * PI) - 1.0).length() < 1e-6);
    let sky = SkyLight::new(Vec3::splat(3.0));
    check_integral(&Light::Sky(sky), P, |_| 1.0, 12.0 * std::f64::consts::PI);
}

#[test]
fn images_stand_as_the_contract_says() {
    // Six columns by three rows, each texel its own colour.
    let texels: Vec<Vec3> = (0..18).map(|i| Vec3::splat(i as f32)).collect();
    let image = EnvironmentImage::new(6, 3, texels).unwrap();
    let at = |rotation: f32, w: Vec3| {
        EnvironmentLight::new(image.clone(), 1.0, rotation.to_radians())
            .radiance(w)
            .x
    };
    // The centre of the image, between columns 2 and 3, lies towards −Z; u grows towards +X.
    assert!((at(0.0, Vec3::NEG_Z) - 8.5).abs() < 1e-4);
    let column_4 = Vec3::new(1.0, 0.0, 0.0);
    assert!((at(0.0, column_4) - 10.0).abs() < 1e-4);
    assert!((at(0.0, Vec3::NEG_X) - 7.0).abs() < 1e-4);
    // Row 0 is above; the poles are half a texel beyond its centre.
    assert!(at(0.0, Vec3::Y) < 6.0 && at(0.0, Vec3::NEG_Y) >= 12.0);
    // A quarter turn counter-clockwise, seen from above, takes what stood at −Z to −X and what stood at +X to −Z.
    assert!((at(90.0, Vec3::NEG_X) - 8.5).abs() < 1e-4);
    assert!((at(90.0, Vec3::NEG_Z) - 10.0).abs() < 1e-4);
}

#[test]
fn a_black_image_is_dark_and_an_overflowing_one_stays_finite() {
    let of = |texel: Vec3| EnvironmentImage::new(2, 2, vec![texel; 4]).unwrap();
    let black = environment(of(Vec3::ZERO));
    assert!(black.is_dark() && black.sample(P, [0.5; 2]).is_none());
    assert_eq!(black.pdf(P, Vec3::X), 0.0);
    let bright = EnvironmentLight::new(of(Vec3::splat(f32::MAX)), 1e9, 0.0);
    assert!(bright.fluence().is_finite() && bright.radiance(Vec3::X).is_finite());
}

#[test]
fn every_sample_of_a_grey_image_with_a_sun_is_worth_its_fluence() {
    let mut texels = vec![Vec3::splat(1e-3); 256 * 128];
    texels[60 * 256 + 100] = Vec3::splat(1e7);
    let light = environment(EnvironmentImage::new(256, 128, texels).unwrap());
    for u in pairs(14).take(1000) {
        let s = light.sample(P, u).unwrap();
        // Radiance over density is the fluence: white light, and a row of 1.4° whose sine changes by 1.5 %.
        let estimate = s.radiance.x / s.pdf;
        let fluence = light.power(1.0).x / PI;
        assert!(
            (estimate / fluence - 1.0).abs() < 0.02,
            "{estimate} {fluence}"
        );
    }
}

fn every_kind() -> Vec<Light> {
    let corners = [
        Vec3::new(0.0, 0.0, 2.0),
        Vec3::new(0.0, 1.0, 2.0),
        Vec3::new(1.0, 0.0, 2.0),
    ];
    vec![
        Light::Point(PointLight::new(Vec3::new(1.0, 0.5, 1.0), Vec3::ONE)),
        Light::Spot(SpotLight::new(
            Vec3::new(-1.0, 0.5, 1.0),
            Vec3::NEG_Z,
            Vec3::ONE,
            0.3,
            0.9,
        )),
        Light::Directional(DirectionalLight::new(Vec3::new(0.6, 0.0, -0.8), Vec3::ONE)),
        rectangle(false),
        rectangle(true),
        triangle(corners, false),
        triangle(corners, true),
        Light::Sky(SkyLight::new(Vec3::ONE)),
        environment(image(8, 4)),
    ]
}

#[test]
fn importance_is_positive_wherever_light_can_arrive_and_near_the_true_fluence() {
    for light in every_kind() {
        let (mut n_lit, mut n_near) = (0, 0);
        for index in 0..2000 {
            let key = Key {
                seed: 15,
                purpose: Purpose::Probe,
                index,
            };
            let mut random = Sampler::new(key, 0);
            let [x, y] = random.next_2d();
            let p = (Vec3::new(x, y, random.next_1d()) - 0.5) * 8.0;
            let normal = warp::uniform_sphere(random.next_2d());
            let samples: Vec<_> = pairs(index)
                .take(32)
                .filter_map(|u| light.sample(p, u))
                .collect();
            let fluence = samples
                .iter()
                .map(|s| mean(s.radiance) / s.pdf)
                .sum::<f32>()
                / 32.0;
            let importance = light.importance(p, None);
            assert!(importance.is_finite() && importance >= 0.0);
            if fluence > 0.0 {
                assert!(importance > 0.0, "{} {p}", light.kind());
                n_lit += 1;
                n_near += u32::from((0.25..4.0).contains(&(importance / fluence)));
            }
            if samples.iter().any(|s| s.w_i.dot(normal) > 1e-6) {
                assert!(
                    light.importance(p, Some(normal)) > 0.0,
                    "{} {p}",
                    light.kind()
                );
            }
        }
        // Grazing views of flat lights are overestimated on purpose.
        assert!(
            n_lit > 100 && n_near * 10 > n_lit * 7,
            "{}: {n_near} of {n_lit}",
            light.kind()
        );
    }
}

#[test]
fn importance_along_a_ray_is_positive_wherever_the_ray_is_lit_and_near_the_sum() {
    for light in every_kind() {
        let (mut n_lit, mut n_near) = (0, 0);
        for index in 0..2000 {
            let key = Key {
                seed: 16,
                purpose: Purpose::Probe,
                index,
            };
            let mut random = Sampler::new(key, 0);
            let [x, y] = random.next_2d();
            let origin = (Vec3::new(x, y, random.next_1d()) - 0.5) * 8.0;
            let ray = Ray::new(origin, warp::uniform_sphere(random.next_2d()));
            let t_max = 8.0 * random.next_1d();
            let sum = (0..200)
                .map(|i| light.importance(ray.at(t_max * (i as f32 + 0.5) / 200.0), None))
                .sum::<f32>()
                * (t_max / 200.0);
            let along = light.importance_along(&ray, t_max);
            assert!(along.is_finite() && along >= 0.0);
            if sum > 0.0 {
                assert!(along > 0.0, "{} {ray:?} {t_max}", light.kind());
                n_lit += 1;
                n_near += u32::from((0.2..5.0).contains(&(along / sum)));
            }
        }
        assert!(
            n_lit > 100 && n_near * 10 > n_lit * 7,
            "{}: {n_near} of {n_lit}",
            light.kind()
        );
    }
}

#[test]
fn a_set_drops_dark_lights_and_knows_its_environments_and_its_nearest_lamp() {
    let dark = Light::Point(PointLight::new(Vec3::ZERO, Vec3::ZERO));
    let lights = every_kind().into_iter().chain([dark]);
    let (set, _) = LightSet::new(lights, &Arc::default());
    assert_eq!(set.count(), 9);
    assert_eq!(set.environment(), [7, 8]);
    assert_eq!(set.environment_radiance(7, Vec3::X), Vec3::ONE);
    assert_eq!(set.distance_to_point_lights(Vec3::new(1.0, 0.5, 3.0)), 2.0);
    assert_eq!(set.distance_to_point_lights(Vec3::new(-1.0, 0.5, 0.5)), 0.5);
    let (none, _) = LightSet::new([], &Arc::default());
    assert_eq!(none.distance_to_point_lights(Vec3::ZERO), f32::INFINITY);
    for light in 0..set.count() {
        assert_eq!(
            set.pivot(light).is_some(),
            light < 2 || (3..7).contains(&light)
        );
        let through_everything = Ray::new(Vec3::new(1.0, 0.5, -5.0), Vec3::Z);
        assert!(
            set.importance_along(light, &through_everything, 10.0)
                .is_finite()
        );
        // On a lamp: huge, but it can be summed.
        assert!(set.importance(light, Vec3::new(1.0, 0.5, 1.0), None) <= 1e30);
    }
}
