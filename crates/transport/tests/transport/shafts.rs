//! Shafts of light against closed forms, and against samples of single scattering.

use crate::rig::{Estimate, Lamps, fog};
use crate::stage::{Card, Stage};
use glam::Vec3;
use std::f64::consts::PI;
use tyndall_math::Ray;
use tyndall_math::testing::sampler;
use tyndall_media::{Media, Medium, MediumParams, PhaseFunction, Region};
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::shafts::Shafts;
use tyndall_transport::single::SegmentLight;
use tyndall_transport::{Geometry, LightSample, Lights, World};

const SIGMA_T: f32 = 0.3;
const ALBEDO: f32 = 0.9;
const LENGTH: f32 = 10.0;
/// Rays are tested between these heights; fog ends at the upper one.
const TOP: f32 = 4.0;

/// Sunlight of 1 W/m² straight down.
struct Sun;

impl Lights for Sun {
    fn count(&self) -> usize {
        1
    }

    fn importance(&self, _light: usize, _p: Vec3, _normal: Option<Vec3>) -> f32 {
        1.0
    }

    fn importance_along(&self, _light: usize, _ray: &Ray, t_max: f32) -> f32 {
        t_max
    }

    fn pivot(&self, _light: usize) -> Option<Vec3> {
        None
    }

    fn has_extent(&self, _light: usize) -> bool {
        false
    }

    fn sample(&self, _light: usize, _p: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        Some(LightSample {
            w_i: Vec3::Y,
            distance: f32::INFINITY,
            radiance: Vec3::ONE,
            pdf: 1.0,
            delta: true,
            normal: Vec3::ZERO,
            size: 0.0,
        })
    }

    fn pdf(&self, _light: usize, _p: Vec3, _w_i: Vec3) -> f32 {
        0.0
    }

    fn distance_to_point_lights(&self, _p: Vec3) -> f32 {
        f32::INFINITY
    }
}

/// Fog below [`TOP`] as far as any ray goes.
fn haze() -> Media {
    let region = Region::Box {
        min: Vec3::splat(-100.0),
        max: Vec3::new(100.0, TOP, 100.0),
    };
    fog(SIGMA_T, ALBEDO, region, PhaseFunction::Isotropic)
}

/// A roof just above the fog that is open over the given stretches of x, ascending.
fn roof(open: &[(f32, f32)]) -> Stage {
    let starts = std::iter::once(-200.0).chain(open.iter().map(|o| o.1));
    let ends = open.iter().map(|o| o.0).chain([200.0]);
    let cards = starts.zip(ends).map(|(a, b)| Card {
        corner: Vec3::new(a, TOP + 0.1, -50.0),
        edges: [Vec3::X * (b - a), Vec3::Z * 100.0],
    });
    Stage {
        lamps: Vec::new(),
        cards: cards.collect(),
    }
}

/// The sun's light scattered on the stretch of a ray from x = 0 along (cos, sin, 0), between `t` and `end`.
///
/// ∫ σs e^(−σt t) e^(−σt (H − t sin)) / 4π dt with H the depth of the ray's origin below the top of the fog.
fn exact((t, end): (f64, f64), sin: f64) -> f64 {
    let sigma = f64::from(SIGMA_T);
    let slope = sigma * (1.0 - sin);
    let depth = (-sigma * f64::from(TOP)).exp();
    f64::from(ALBEDO) * sigma / (4.0 * PI) * depth * ((-slope * t).exp() - (-slope * end).exp())
        / slope
}

/// Mean over random offsets of `n` probes along a ray of [`LENGTH`] from the origin.
fn shafts<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    ray: &Ray,
    n: u32,
    offsets: u64,
) -> Estimate {
    let flight = FreeFlight::new(world.media.segment(ray, LENGTH), Vec3::ONE);
    let shafts = Shafts::new(world, ray, &flight, 0);
    let mut estimate = Estimate::default();
    for i in 0..offsets {
        estimate.add(shafts.radiance(n, sampler(n.into(), i).next_1d()));
    }
    estimate
}

#[test]
fn sunlight_in_homogeneous_fog_is_exact_on_a_level_ray_with_any_probe() {
    let (media, open) = (haze(), roof(&[(-200.0, 200.0)]));
    let world = World {
        geometry: &open,
        lights: &Sun,
        media: &media,
    };
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    for n in [1, 2, 7] {
        // Nothing but rounding is left.
        let found = shafts(&world, &ray, n, 20);
        found.check("level", exact((0.0, LENGTH.into()), 0.0), 1e-6, 3e-7);
    }
}

#[test]
fn shafts_behind_slits_match_the_closed_form() {
    let media = haze();
    let (sin, cos) = (0.3_f32, (1.0_f32 - 0.09).sqrt());
    let ray = Ray::new(Vec3::ZERO, Vec3::new(cos, sin, 0.0));
    // Openings, probes, largest relative error of a single ray.
    for (name, open, n, worst) in [
        ("half a ray", vec![(2.0, 200.0)], 8, 0.03),
        ("a wide slit", vec![(1.0, 3.0)], 24, 0.03),
        ("two slits", vec![(0.5, 1.5), (3.0, 5.0)], 24, 0.03),
        (
            "a slit over the end",
            vec![(-1.0, 1.0), (4.0, 30.0)],
            24,
            0.03,
        ),
        // Shorter than two steps: samples.
        ("a narrow slit", vec![(3.0, 3.3)], 8, 3.0),
        ("a bar", vec![(-200.0, 3.0), (3.4, 200.0)], 8, 0.1),
    ] {
        let roof = roof(&open);
        let world = World {
            geometry: &roof,
            lights: &Sun,
            media: &media,
        };
        let light: f64 = open
            .iter()
            .map(|&(a, b)| {
                let t = |x: f32| f64::from((x / cos).clamp(0.0, LENGTH));
                exact((t(a), t(b)), sin.into())
            })
            .sum();
        let offsets = 4096;
        let found = shafts(&world, &ray, n, offsets);
        found.check(name, light, worst / (offsets as f64).sqrt(), 1e-5);
    }
}

#[test]
fn gratings_as_fine_as_the_probes_are_biased_by_little() {
    let media = haze();
    // Periods about that of 24 probes in distance, and finer ones; the bound is what is promised of `Shafts`.
    for period in [0.6, 0.5, 0.23, 0.15] {
        for share in [0.33, 0.6] {
            let n = (LENGTH / period) as usize;
            let open: Vec<(f32, f32)> = (0..n)
                .map(|i| period * (i as f32 + 0.1))
                .map(|x| (x, x + share * period))
                .collect();
            let roof = roof(&open);
            let world = World {
                geometry: &roof,
                lights: &Sun,
                media: &media,
            };
            let light: f64 = open
                .iter()
                .map(|&(a, b)| exact((a.into(), b.into()), 0.0))
                .sum();
            let found = shafts(&world, &Ray::new(Vec3::ZERO, Vec3::X), 24, 4096);
            let (bias, error) = (found.mean() / light - 1.0, found.error() / light);
            println!("period {period}, share {share}: bias {bias:.4} ± {error:.4}");
            assert!(bias.abs() < 0.05, "{bias} ± {error}");
        }
    }
}

#[test]
fn a_lamp_behind_bars_in_coloured_fog_is_as_bright_as_by_samples() {
    let medium = Medium::new(MediumParams::new(
        Vec3::new(0.1, 0.3, 1.2),
        Vec3::splat(ALBEDO),
    ));
    let media = Media::new(vec![medium.unwrap()]);
    let lights = Lamps::points(&[(Vec3::new(4.0, 3.0, 0.5), 1.0)]);
    let bars = Stage {
        lamps: Vec::new(),
        cards: [0.5, 3.0, 5.5]
            .map(|x| Card {
                corner: Vec3::new(x, 1.5, -5.0),
                edges: [Vec3::X * 1.2, Vec3::Z * 10.0],
            })
            .into(),
    };
    let world = World {
        geometry: &bars,
        lights: &lights,
        media: &media,
    };
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let flight = FreeFlight::new(media.segment(&ray, LENGTH), Vec3::ONE);
    let segment = SegmentLight::new(&world, &ray, &flight).unwrap();
    let mut samples = Estimate::default();
    for i in 0..200_000 {
        let mut sampler = sampler(5, i);
        let ([u, v], w) = (sampler.next_2d(), sampler.next_2d());
        let value = segment.sample(&world, u, v, w).map(|s| s.value);
        samples.add(value.unwrap_or_default());
    }
    let found = shafts(&world, &ray, 16, 4096);
    let error = samples.error().hypot(found.error());
    let z = (found.mean() - samples.mean()) / error;
    println!("{} {} z {z}", found.mean(), samples.mean());
    // False alarm 7e-6, were the seeds not fixed.
    assert!(z.abs() < 4.5, "z = {z}");
    // One ray of 16 probes against one of as many samples.
    assert!(found.error() * 64.0 < 0.2 * samples.error() * (200_000.0_f64 / 16.0).sqrt());
}

#[test]
fn lights_taken_by_shafts_and_those_sampled_are_all_lights() {
    let media = fog(
        SIGMA_T,
        ALBEDO,
        crate::rig::sphere(5.0),
        PhaseFunction::Isotropic,
    );
    let lights = Lamps::points(&[
        (Vec3::new(1.0, 1.0, 0.0), 2.0),
        (Vec3::new(2.0, -1.5, 0.0), 2.0),
        // Too weak for probes.
        (Vec3::new(-3.0, 0.0, 2.0), 0.05),
    ])
    .with_sky(0.01);
    let bars = Stage {
        lamps: Vec::new(),
        cards: vec![Card {
            corner: Vec3::new(0.3, 0.5, -1.0),
            edges: [Vec3::X, Vec3::Z * 2.0],
        }],
    };
    let world = World {
        geometry: &bars,
        lights: &lights,
        media: &media,
    };
    let ray = Ray::new(Vec3::new(-4.0, 0.0, 0.0), Vec3::X);
    let flight = FreeFlight::new(media.segment(&ray, LENGTH), Vec3::ONE);
    let all = SegmentLight::new(&world, &ray, &flight).unwrap();
    let mut rest = all.clone();
    let taken = rest.take_shafts(&lights, 24);
    println!("{taken:?}");
    assert_eq!(taken.iter().map(|t| t.0).collect::<Vec<_>>(), [0, 1]);
    assert!(rest.has_lights(&lights));
    let (mut sampled, mut split) = (Estimate::default(), Estimate::default());
    for i in 0..100_000 {
        let mut sampler = sampler(9, i);
        let ([u, v], w) = (sampler.next_2d(), sampler.next_2d());
        let [whole, left] = [&all, &rest]
            .map(|lights| lights.sample(&world, u, v, w))
            .map(|sample| sample.map_or(Vec3::ZERO, |s| s.value));
        sampled.add(whole);
        let offset = sampler.next_2d()[0];
        let shafts: Vec3 = taken
            .iter()
            .map(|&(light, n)| Shafts::new(&world, &ray, &flight, light).radiance(n, offset))
            .sum();
        split.add(left + shafts);
    }
    let z = (split.mean() - sampled.mean()) / split.error().hypot(sampled.error());
    assert!(z.abs() < 4.5, "z = {z}");
    assert!(split.error() < sampled.error());
}
