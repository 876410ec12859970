//! Choices among many lights of all kinds: judged in clusters, they are chosen nearly as if each were looked at.
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::Vec3;
use std::sync::Arc;
use tyndall_math::testing::sampler;
use tyndall_math::{Ray, Sampler, warp};
use tyndall_scene::lights::{
    DirectionalLight, Light, LightSet, PointLight, QuadLight, SkyLight, SpotLight,
};
use tyndall_transport::Lights;
use tyndall_transport::light_choice::LightChoice;

fn in_the_box(random: &mut Sampler) -> Vec3 {
    let [x, z] = random.next_2d();
    Vec3::new(x - 0.5, 0.2 * random.next_1d(), z - 0.5) * 60.0
}

/// Lamps, spots that shine down and panels that face anywhere in a flat box of 60 m, a sun and a sky.
fn town() -> LightSet {
    let lamps = (0..300).map(|i| {
        let mut random = sampler(1, i);
        let p = in_the_box(&mut random);
        let direction = warp::uniform_sphere(random.next_2d());
        match i % 3 {
            0 => Light::Point(PointLight::new(p, Vec3::splat(5.0))),
            1 => {
                let down = (Vec3::NEG_Y + 0.3 * direction).normalize();
                Light::Spot(SpotLight::new(p, down, Vec3::splat(20.0), 0.5, 0.8))
            }
            _ => {
                let edge = direction.any_orthonormal_vector();
                let edges = [edge, 0.5 * direction.cross(edge)];
                Light::Quad(QuadLight::new(p, edges, Vec3::splat(20.0), false))
            }
        }
    });
    let far = [
        Light::Directional(DirectionalLight::new(Vec3::NEG_Y, Vec3::splat(0.01))),
        Light::Sky(SkyLight::new(Vec3::splat(0.001))),
    ];
    LightSet::new(lamps.chain(far), &Arc::default()).0
}

/// Mean over places of the second moment Σ q²/p of choices with chances p where the importance of each light would give q: 1
/// were they the same.
fn second_moment(importance: impl Fn(usize, u64) -> f32, choice: impl Fn(u64) -> Vec<f32>) -> f32 {
    let n_places = 200;
    let moments = (0..n_places).map(|place| {
        let chances = choice(place);
        let exact = (0..chances.len()).map(|light| importance(light, place));
        let total: f32 = exact.clone().sum();
        let terms = exact
            .zip(chances)
            .map(|(exact, p)| (exact / total).powi(2) / p);
        terms.sum::<f32>()
    });
    moments.sum::<f32>() / n_places as f32
}

#[test]
fn choices_in_clusters_are_nearly_those_one_by_one() {
    let town = town();
    assert!(town.tree().is_some());
    let p = |place| in_the_box(&mut sampler(2, place));
    let chances = |choice: LightChoice<'_>| {
        let chances: Vec<f32> = (0..town.count()).map(|light| choice.pdf(light)).collect();
        // Running sums in f32, some hundred lights long.
        assert!((chances.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        chances
    };
    // On surfaces, half of a distant cluster may stand behind: it is chosen in vain.
    for (normal, most) in [(None, 2.0), (Some(Vec3::Y), 4.0)] {
        let found = second_moment(
            |light, place| town.importance(light, p(place), normal),
            |place| chances(LightChoice::at(&town, p(place), normal, 0.0)),
        );
        assert!(found < most, "{normal:?} {found}");
    }
    let ray = |place| Ray::new(p(place), warp::uniform_sphere(sampler(3, place).next_2d()));
    let found = second_moment(
        |light, place| town.importance_along(light, &ray(place), 20.0),
        |place| chances(LightChoice::along(&town, &ray(place), 20.0, 0.0)),
    );
    assert!(found < 2.0, "{found}");
}
