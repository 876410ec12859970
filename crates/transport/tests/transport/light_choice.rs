//! Choices among lights, few and many: the chances told are those of the samples, and no light is out of reach.

use crate::rig::Lamps;
use glam::Vec3;
use tyndall_math::stats::chi_square_test;
use tyndall_math::testing::{FALSE_ALARM_RATE, sampler};
use tyndall_math::{Ray, warp};
use tyndall_transport::Lights;
use tyndall_transport::light_choice::LightChoice;

/// Lamps in heaps: some at one place, some dark, and of very different intensity.
fn heaps(n: usize, seed: u64) -> Lamps {
    let mut points: Vec<(Vec3, f32)> = Vec::new();
    for i in 0..n {
        let mut random = sampler(seed, i as u64);
        let [kind, intensity] = random.next_2d();
        let place = match points.last() {
            Some(&(last, _)) if kind < 0.3 => last,
            Some(&(last, _)) if kind < 0.6 => last + 0.1 * warp::uniform_sphere(random.next_2d()),
            _ => 20.0 * warp::uniform_sphere(random.next_2d()) * random.next_1d(),
        };
        let intensity = if intensity < 0.1 {
            0.0
        } else {
            10_f32.powf(6.0 * intensity - 3.0)
        };
        points.push((place, intensity));
    }
    Lamps::points(&points)
}

/// Choices at and along places among `lights`, one of them at a lamp.
fn choices(lights: &Lamps, seed: u64) -> Vec<LightChoice<'_>> {
    let mut random = sampler(seed, 0);
    let p = 10.0 * warp::uniform_sphere(random.next_2d());
    let ray = Ray::new(p, warp::uniform_sphere(random.next_2d()));
    let lamp = lights.pivot(0).unwrap_or(p);
    let through = Ray::new(lamp - 3.0 * ray.direction, ray.direction);
    vec![
        LightChoice::at(lights, p, None, 0.1),
        LightChoice::at(lights, lamp, None, 0.1),
        LightChoice::at(lights, p * 1e6, None, 0.1),
        LightChoice::along(lights, &ray, 30.0, 0.1),
        LightChoice::along(lights, &through, 6.0, 0.0),
    ]
}

/// Chances are positive and sum to one, and whatever is sampled has the chance that is told.
fn check(choice: &LightChoice<'_>, n: usize) {
    let chances: Vec<f32> = (0..n).map(|light| choice.pdf(light)).collect();
    let sum: f64 = chances.iter().map(|&chance| f64::from(chance)).sum();
    // Running sums in f32, some hundred lights long.
    assert!((sum - 1.0).abs() < 1e-4, "{sum} of {n}");
    assert!(chances.iter().all(|&chance| chance > 0.0));
    for i in 0..1000 {
        let (light, chance) = choice.sample(i as f32 / 1000.0).unwrap();
        assert_eq!(chance, chances[light]);
    }
    for (light, chance) in choice.singles() {
        assert_eq!(chance, chances[light]);
    }
}

#[test]
fn chances_of_any_lights_anywhere_are_positive_and_sum_to_one() {
    for n in [1, 2, 3, 9, 40, 300] {
        for seed in 0..10 {
            let bare = [heaps(n, seed), heaps(n, seed).in_a_tree()];
            let with_sky = [
                heaps(n, seed).with_sky(0.01),
                heaps(n, seed).with_sky(0.01).in_a_tree(),
            ];
            for lights in bare.iter().chain(&with_sky) {
                let on_surface = LightChoice::at(lights, Vec3::ZERO, Some(Vec3::Y), 0.1);
                for choice in choices(lights, seed).into_iter().chain([on_surface]) {
                    check(&choice, lights.count());
                    let likely = choice.singles().max_by(|a, b| a.1.total_cmp(&b.1));
                    if let Some((taken, _)) = likely.filter(|_| lights.count() > 1) {
                        let rest = choice.without(&[taken]);
                        check(&rest, lights.count());
                    }
                }
            }
        }
    }
}

#[test]
fn thousands_of_lamps_at_one_place_share_their_chance() {
    let lights = Lamps::points(&[(Vec3::ONE, 2.0); 3000]).in_a_tree();
    for choice in choices(&lights, 1) {
        // Sums of thousands in f32.
        assert!((0..3000).all(|light| (choice.pdf(light) * 3000.0 - 1.0).abs() < 1e-2));
    }
}

#[test]
fn lights_are_chosen_with_the_chance_that_is_told() {
    let few = Lamps::points(&[
        (Vec3::new(1.0, 0.0, 0.0), 1.0),
        (Vec3::new(0.0, 3.0, 0.0), 20.0),
        (Vec3::new(0.0, 0.0, 9.0), 0.01),
    ])
    .with_sky(0.05);
    for lights in [few, heaps(60, 3).with_sky(0.1).in_a_tree()] {
        for (i, choice) in choices(&lights, 4).iter().enumerate() {
            let n = 200_000;
            let mut counts = vec![0_u64; lights.count()];
            for sample in 0..n {
                let u = sampler(400 + i as u64, sample).next_1d();
                counts[choice.sample(u).unwrap().0] += 1;
            }
            let expected: Vec<f64> = (0..lights.count())
                .map(|light| f64::from(choice.pdf(light)) * n as f64)
                .collect();
            let result = chi_square_test(&counts, &expected);
            assert!(result.p_value >= FALSE_ALARM_RATE, "{i} {result:?}");
        }
    }
}

#[test]
fn a_tree_chooses_nearly_as_one_by_one() {
    for seed in 0..20 {
        let (one_by_one, by_tree) = (heaps(300, seed), heaps(300, seed).in_a_tree());
        let pairs = choices(&one_by_one, seed)
            .into_iter()
            .zip(choices(&by_tree, seed));
        for (i, (one_by_one, by_tree)) in pairs.enumerate() {
            // Second moment of what the exact choice finds, by the other: 1 were they the same.
            let moment: f32 = (0..300)
                .map(|light| one_by_one.pdf(light).powi(2) / by_tree.pdf(light))
                .sum();
            println!("{seed} {i}: {moment}");
            assert!(moment < 2.0, "{seed} {i}: {moment}");
        }
    }
}
