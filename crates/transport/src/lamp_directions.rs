//! Directions that pass close to lamps, for paths that go on through fog.
//!
//! Light scattered along a ray that passes a lamp at angle θ grows as 1/sinθ: following the phase function alone, its
//! variance has no bound. Directions with density 1/(2π² sinθ) around the lamps, mixed in, bound it (Georgiev, Křivánek,
//! Hachisuka, Nowrouzezahrai and Jarosz 2013, "Joint importance sampling of low-order volumetric scattering").

use crate::light_choice::{LightChoice, damping};
use crate::world::Lights;
use glam::Vec3;
use smallvec::SmallVec;
use std::f32::consts::PI;
use tyndall_math::Frame;

/// Lamps that would get a smaller share are left to chance: each lamp costs time in every density.
const LEAST_CHANCE: f32 = 0.01;

/// Lamps at finite distance as seen from one point, to be mixed with another way of sampling directions.
#[derive(Clone, Debug, Default)]
pub struct LampDirections {
    /// Unit direction to each lamp and its share of all directions sampled.
    lamps: SmallVec<[(Vec3, f32); 8]>,
    share: f32,
}

impl LampDirections {
    /// The lamps as seen from `p`, with chances `choice` there; together they get at most `share` of the directions, the
    /// less the more fog of extinction `sigma` per metre lies between: what is deep in fog has no bright lamp to pass.
    pub fn new<L: Lights>(
        lights: &L,
        p: Vec3,
        choice: &LightChoice<'_>,
        share: f32,
        sigma: f32,
    ) -> Self {
        let mut lamps = SmallVec::new();
        let mut total = 0.0;
        for (light, chance) in choice.singles() {
            let chance = share * chance;
            if chance < LEAST_CHANCE {
                continue;
            }
            let Some(offset) = lights.pivot(light).map(|pivot| pivot - p) else {
                continue;
            };
            let distance = offset.length();
            if distance > 0.0 {
                let chance = chance * damping(sigma * distance);
                lamps.push((offset / distance, chance));
                total += chance;
            }
        }
        Self {
            lamps,
            share: total,
        }
    }

    /// The share of directions that lamps get, in [0, 1); the rest is left to the other way of sampling.
    pub fn share(&self) -> f32 {
        self.share
    }

    /// Samples a direction around a lamp; `u[0]` must be uniform in [0, [`LampDirections::share`]).
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        let mut rest = u[0];
        let mut picked = (Vec3::Z, 0.0);
        for &(direction, chance) in &self.lamps {
            picked = (direction, (rest / chance).min(1.0));
            if rest < chance {
                break;
            }
            rest -= chance;
        }
        let (direction, angle) = picked;
        let (sin, cos) = (PI * angle).sin_cos();
        let (sin_phi, cos_phi) = (2.0 * PI * u[1]).sin_cos();
        Frame::from_normal(direction)
            .to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos))
            .normalize()
    }

    /// Density per steradian of picking `w` around a lamp: Σ share/(2π² sinθ).
    pub fn pdf(&self, w: Vec3) -> f32 {
        self.lamps
            .iter()
            .map(|(direction, chance)| chance / (2.0 * PI * PI * direction.cross(w).length()))
            .sum()
    }
}
