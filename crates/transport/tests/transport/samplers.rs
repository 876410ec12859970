//! Every sampler of light transport draws what its density says: Pearson's χ² over cells, at a false-alarm rate of 1e-6
//! each were the seeds not fixed ([`tyndall_math::testing`]).

use crate::rig::{Lamps, OPEN, Room, fog, sphere};
use glam::Vec3;
use tyndall_math::stats::{Welford, chi_square_test, z_test};
use tyndall_math::testing::{Directions, Distances, FALSE_ALARM_RATE, assert_conforms};
use tyndall_math::{Key, Purpose, Ray, Sampler};
use tyndall_media::{
    Asymmetry, HenyeyGreenstein, Media, Medium, MediumParams, PhaseFunction, Region,
};
use tyndall_transport::bsdf::Bsdf;
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::gather::GatherDirections;
use tyndall_transport::lamp_directions::LampDirections;
use tyndall_transport::light_choice::LightChoice;
use tyndall_transport::single::SegmentLight;
use tyndall_transport::world::World;

/// Independent random numbers, one pair for each `index`.
fn pair(seed: u64, index: u64) -> [f32; 2] {
    let key = Key {
        seed,
        purpose: Purpose::Probe,
        index,
    };
    Sampler::new(key, 0).next_2d()
}

#[test]
fn reflected_directions_follow_their_density() {
    let bsdfs = [
        Bsdf::lambert(Vec3::splat(0.8), Vec3::Z),
        Bsdf::new(Vec3::splat(0.5), Vec3::splat(0.04), 1.0, 0.25, Vec3::Z),
        Bsdf::new(Vec3::ZERO, Vec3::new(1.0, 0.8, 0.3), 1.0, 0.3, Vec3::Z),
        Bsdf::new(Vec3::ONE, Vec3::splat(0.04), 1.0, 1.0, Vec3::Z),
    ];
    for (i, bsdf) in bsdfs.iter().enumerate() {
        for (j, cos_o) in [0.1_f32, 0.7, 1.0].into_iter().enumerate() {
            let w_o = Vec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
            let seed = 100 + 10 * i as u64 + j as u64;
            let mut drawn = 0;
            assert_conforms(
                &Directions::sphere(),
                seed,
                |u| {
                    drawn += 1;
                    let [lobe, _] = pair(seed, drawn);
                    bsdf.sample(w_o, lobe, u).map(|s| (s.w_i, s.pdf))
                },
                |w_i| bsdf.pdf(w_o, w_i),
            );
        }
    }
}

/// Overlapping coloured media along +x from the origin: a ball, and a slab that one channel does not see.
fn coloured() -> Media {
    let medium = |region, sigma_t| {
        Medium::new(MediumParams {
            region,
            ..MediumParams::new(sigma_t, Vec3::splat(0.5))
        })
        .unwrap()
    };
    let slab = Region::Box {
        min: Vec3::new(1.5, -9.0, -9.0),
        max: Vec3::new(3.0, 9.0, 9.0),
    };
    let ball = Region::Sphere {
        center: Vec3::X,
        radius: 0.8,
    };
    Media::new(vec![
        medium(ball, Vec3::new(0.2, 1.0, 3.0)),
        medium(slab, Vec3::new(0.7, 0.0, 0.1)),
    ])
}

#[test]
fn free_flights_follow_their_density_in_all_channels_at_once() {
    let media = coloured();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    // Cells end where media do: inside one the density is smooth.
    let edges = vec![
        0.0, 0.2, 0.4, 0.7, 1.0, 1.3, 1.5, 1.7, 1.8, 2.2, 2.6, 3.0, 4.0,
    ];
    let cells = Distances::between(edges);
    for (i, throughput) in [
        Vec3::ONE,
        Vec3::new(0.1, 1.0, 0.4),
        Vec3::new(0.0, 0.5, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        let flight = FreeFlight::new(media.segment(&ray, 4.0), throughput);
        let seed = 200 + 10 * i as u64;
        assert_conforms(
            &cells,
            seed,
            |u| {
                flight
                    .sample(u[0])
                    .map(|t| (t, flight.pdf(&flight.stop(t))))
            },
            |t| flight.pdf(&flight.stop(t)),
        );
        assert_conforms(
            &cells,
            seed + 1,
            |u| {
                flight
                    .sample_inside(u[0])
                    .map(|t| (t, flight.pdf_inside(&flight.stop(t))))
            },
            |t| flight.pdf_inside(&flight.stop(t)),
        );
    }
}

fn world<'w>(lights: &'w Lamps, media: &'w Media) -> World<'w, Room, Lamps> {
    World {
        geometry: &OPEN,
        lights,
        media,
    }
}

#[test]
fn distances_of_single_scattering_follow_their_density() {
    let lights = Lamps::points(&[(Vec3::new(0.9, 0.3, 0.0), 1.0)]);
    let media = coloured();
    let world = world(&lights, &media);
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let flight = FreeFlight::new(world.media.segment(&ray, 4.0), Vec3::ONE);
    let single = SegmentLight::new(&world, &ray, &flight).unwrap();
    let edges = vec![
        0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 1.7, 1.8, 2.2, 3.0,
    ];
    assert_conforms(
        &Distances::between(edges),
        300,
        // Samples of lights are of density 1 here. Where nothing scatters there is no sample, and no density is asked for:
        // the ray's media have no gap.
        |[u, v]| {
            single
                .sample(&world, v, u, [0.5, 0.5])
                .map(|s| (s.stop.t, s.pdf))
        },
        |t| single.clone().density_at(&flight.stop(t)).of(&lights, 0),
    );
}

#[test]
fn directions_around_lamps_follow_their_density() {
    let lights = Lamps::points(&[
        (Vec3::new(0.3, 0.4, 1.0), 1.0),
        (Vec3::new(-2.0, 0.0, 0.5), 5.0),
    ]);
    let choice = LightChoice::at(&lights, Vec3::ZERO, None, 0.2);
    let lamps = LampDirections::new(&lights, Vec3::ZERO, &choice, 0.5, 0.2);
    let share = lamps.share();
    // Cells would cut the density's poles at the lamps: two integrals are checked instead.
    let cosine = |w: Vec3| w.dot(Vec3::new(0.3, 0.4, 1.0).normalize());
    let mut inverse = Welford::new();
    for i in 0..200_000 {
        let [u, v] = pair(500, i);
        let w = lamps.sample([u * share, v]);
        inverse.push(f64::from(share / lamps.pdf(w)));
    }
    // ∫ dω = 4π by importance sampling: the density is that of the samples.
    let p_value = z_test(
        inverse.mean(),
        inverse.standard_error(),
        4.0 * std::f64::consts::PI,
    );
    assert!(p_value >= FALSE_ALARM_RATE, "{p_value}: {}", inverse.mean());
    // Around one lamp alone the angle from it is uniform.
    let alone = Lamps::points(&[(Vec3::new(0.3, 0.4, 1.0), 1.0)]);
    let choice = LightChoice::at(&alone, Vec3::ZERO, None, 0.2);
    let lamps = LampDirections::new(&alone, Vec3::ZERO, &choice, 0.5, 0.2);
    let mut counts = [0_u64; 32];
    for i in 0..200_000 {
        let [u, v] = pair(501, i);
        let theta = cosine(lamps.sample([u * lamps.share(), v]))
            .clamp(-1.0, 1.0)
            .acos();
        counts[((theta / std::f32::consts::PI * 32.0) as usize).min(31)] += 1;
    }
    let result = chi_square_test(&counts, &[200_000.0 / 32.0; 32]);
    assert!(result.p_value >= FALSE_ALARM_RATE, "{result:?}");
}

#[test]
fn gathered_directions_weigh_one_in_the_mean() {
    // E[p/pdf] = ∫ p dω = 1 for every mixture of phase function and lamps, per colour channel.
    let lights = Lamps::points(&[(Vec3::new(0.3, 0.4, 1.0), 1.0)]);
    let hg = HenyeyGreenstein::new(Asymmetry::new(0.7).unwrap());
    for (i, phase) in [
        PhaseFunction::Isotropic,
        PhaseFunction::HenyeyGreenstein(hg),
    ]
    .into_iter()
    .enumerate()
    {
        let media = fog(0.5, 0.9, sphere(5.0), phase);
        let world = world(&lights, &media);
        let directions = GatherDirections::new(&world, Vec3::ZERO, Some(Vec3::X));
        let mut weights = Welford::new();
        for sample in 0..200_000 {
            let u = pair(600 + i as u64, sample);
            let direction = directions.sample(u);
            weights.push(f64::from(direction.weight.y));
        }
        let p_value = z_test(weights.mean(), weights.standard_error(), 1.0);
        assert!(p_value >= FALSE_ALARM_RATE, "{p_value}: {}", weights.mean());
    }
}
