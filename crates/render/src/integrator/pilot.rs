//! A few camera samples ahead of the image, with what the coarse field knows: what the image is made of, and how bright it is where.
//!
//! From them follows how far each part of the light may be off ([`Plan`]): what adds little to a pixel may be known less well.

use super::camera::{Camera, Known};
use super::has_passed;
use super::view::View;
use crate::film::Pixel;
use crate::options::SingleFrom;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use tyndall_math::{Key, Purpose, Sampler};

/// Blocks across and down the frame.
const BLOCKS: [u32; 2] = [16, 12];
/// Camera samples of each block.
const SAMPLES: u32 = 16;
/// Errors of a part over that of the image, at least and most.
const RANGE: [f32; 2] = [0.6, 3.0];
/// No part may be less well known than this, whatever it adds.
const COARSEST: f32 = 0.2;
/// Light from skies is left to samples where its share is less than this part of the error asked for.
const NEGLIGIBLE: f32 = 0.25;

/// What camera samples in one block of the frame found, in the mean.
#[derive(Clone, Copy, Default)]
struct Block {
    pixel: Pixel,
    /// The part of single scattering that is light from skies.
    sky: Vec3,
}

/// Camera samples in blocks of the frame.
pub(super) struct Pilot {
    blocks: Vec<Block>,
    /// What keeps weights of dark blocks finite: 0.01 of the squared mean.
    floor: f32,
    /// Rays it took.
    pub(super) rays: u64,
}

/// Relative errors that parts of the light may have.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(super) struct Plan {
    /// Multiple scattering.
    pub(super) multiple: f32,
    /// Single scattering of light from skies.
    pub(super) sky: f32,
    /// Whether there is so much of that in the image that samples do less well.
    sky_matters: bool,
    /// Light on surfaces.
    pub(super) surface: f32,
}

impl Plan {
    /// What scattered light of one kind may add to the image's error, over the error asked for.
    pub(super) const SCATTERED: f32 = 0.5;
    /// As [`Plan::SCATTERED`] for light on surfaces, whose records err more than they are told to.
    const SURFACE: f32 = 0.35;

    /// How far off records of single-scattered light from skies may be; `None` where samples are taken instead.
    pub(super) fn sky_from(&self, from: SingleFrom) -> Option<f32> {
        let is_held = match from {
            SingleFrom::Auto => self.sky_matters,
            SingleFrom::Direct => false,
            SingleFrom::Cache => true,
        };
        is_held.then_some(self.sky)
    }
}

impl Pilot {
    /// Takes samples with what is `known` so far by the cameras of `views`; blocks not begun before the `deadline` stay black.
    pub(super) fn new<'s>(
        camera: impl Fn(View) -> Camera<'s> + Sync,
        views: &[View],
        known: &Known<'_>,
        seed: u64,
        deadline: Option<Instant>,
    ) -> Self {
        let found: Vec<(Block, u64)> = (0..BLOCKS[0] * BLOCKS[1])
            .into_par_iter()
            .map(|block| {
                if has_passed(deadline) {
                    return (Block::default(), 0);
                }
                let view = view(views, block as usize);
                let camera = camera(view);
                let mean = mean_of_block(&camera, view.frame(), known, seed, block);
                (mean, camera.tally().rays)
            })
            .collect();
        let sum: Vec3 = found.iter().map(|(b, _)| beauty(&b.pixel)).sum();
        let mean = sum.element_sum() / (3 * found.len()) as f32;
        Self {
            floor: 0.01 * mean * mean,
            rays: found.iter().map(|(_, rays)| rays).sum(),
            blocks: found.into_iter().map(|(block, _)| block).collect(),
        }
    }

    /// Number of blocks.
    pub(super) fn len(&self) -> usize {
        self.blocks.len()
    }

    /// The weight of a squared difference in a block, in the relative error of the image; 0 where all is black.
    pub(super) fn weight(&self, block: usize) -> DVec3 {
        let whole = beauty(&self.blocks[block].pixel).as_dvec3();
        let weight = 1.0 / (whole * whole + f64::from(self.floor));
        if weight.is_finite() {
            weight
        } else {
            DVec3::ZERO
        }
    }

    /// How far parts may be off where the image may have an `error`.
    pub(super) fn plan(&self, error: f32) -> Plan {
        // Root mean square of a part over the whole.
        let share = |part: fn(&Block) -> Vec3| {
            let squared = |b: &Block| {
                let (part, whole) = (part(b), beauty(&b.pixel));
                (part * part / (whole * whole + self.floor)).element_sum() / 3.0
            };
            let sum: f32 = self.blocks.iter().map(squared).sum();
            (sum / self.blocks.len() as f32).sqrt()
        };
        let [least, most] = RANGE.map(|factor| factor * error);
        // Where the image is black a share is not a number, and the most is allowed.
        let allowed =
            |gain: f32, share: f32| (error * gain / share).min(most).max(least).min(COARSEST);
        let sky = share(|b| b.sky);
        Plan {
            multiple: allowed(Plan::SCATTERED, share(|b| b.pixel.multiple)),
            sky: allowed(Plan::SCATTERED, sky),
            sky_matters: sky > NEGLIGIBLE * error,
            surface: allowed(Plan::SURFACE, share(|b| b.pixel.surface)),
        }
    }
}

/// The view in which a block is looked at: each has its turn.
pub(super) fn view(views: &[View], block: usize) -> View {
    views[block % views.len()]
}

fn beauty(p: &Pixel) -> Vec3 {
    p.surface + p.single + p.multiple + p.emission
}

/// A place in a block, in shares of the frame from its upper left corner, for two numbers in [0, 1).
pub(super) fn place(block: u32, [u, v]: [f32; 2]) -> [f32; 2] {
    let [columns, rows] = BLOCKS.map(|n| n as f32);
    let column = (block % BLOCKS[0]) as f32 + u;
    let row = (block / BLOCKS[0]) as f32 + v;
    [column / columns, row / rows]
}

fn mean_of_block(
    camera: &Camera<'_>,
    [w, h]: [u32; 2],
    known: &Known<'_>,
    seed: u64,
    block: u32,
) -> Block {
    let key = Key {
        seed,
        purpose: Purpose::Pilot,
        index: u64::from(block),
    };
    let share = 1.0 / SAMPLES as f32;
    let mut mean = Block::default();
    for i in 0..SAMPLES {
        let mut sampler = Sampler::new(key, u64::from(i));
        let [x, y] = place(block, sampler.next_2d());
        let [x, y] = [(x, w), (y, h)].map(|(share, n)| ((share * n as f32) as u32).min(n - 1));
        let found = camera.cached(x, y, &mut sampler.branch(0), known);
        let sky = camera.sky(x, y, &mut sampler.branch(0));
        // One that is not finite would hide all others.
        if !(beauty(&found) + sky).is_finite() {
            continue;
        }
        mean.pixel.surface += found.surface * share;
        mean.pixel.single += found.single * share;
        mean.pixel.multiple += found.multiple * share;
        mean.pixel.emission += found.emission * share;
        mean.sky += sky * share;
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the frame holds multiple scattering alone, half light on surfaces with a little of single scattering from skies.
    fn pilot(sky: f32) -> Pilot {
        let fog = Block {
            pixel: Pixel {
                multiple: Vec3::ONE,
                ..Pixel::default()
            },
            sky: Vec3::ZERO,
        };
        let wall = Block {
            pixel: Pixel {
                surface: Vec3::splat(1.0 - sky),
                single: Vec3::splat(sky),
                ..Pixel::default()
            },
            sky: Vec3::splat(sky),
        };
        Pilot {
            blocks: vec![fog, wall],
            floor: 0.0,
            rays: 0,
        }
    }

    #[test]
    fn parts_may_err_the_more_the_less_of_the_image_they_are() {
        let plan = pilot(0.1).plan(0.02);
        // Half the image is 0.71 of its root mean square, and 0.1 of the other half 0.07.
        assert!((plan.multiple / (0.5 * 0.02 / 0.5_f32.sqrt()) - 1.0).abs() < 1e-5);
        assert_eq!(plan.sky_from(SingleFrom::Auto), Some(0.06));
        assert!((plan.surface / 0.012 - 1.0).abs() < 1e-5, "{plan:?}");
    }

    #[test]
    fn light_from_skies_that_does_not_show_is_sampled() {
        let plan = pilot(1e-3).plan(0.02);
        assert_eq!(plan.sky_from(SingleFrom::Auto), None);
        assert!(plan.sky_from(SingleFrom::Cache).is_some());
        assert_eq!(pilot(0.1).plan(0.02).sky_from(SingleFrom::Direct), None);
    }

    #[test]
    fn a_black_image_still_has_a_plan() {
        let mut black = pilot(0.0);
        black.blocks.fill(Block::default());
        let plan = black.plan(0.02);
        assert!(plan.multiple.is_finite() && plan.surface.is_finite());
        assert_eq!(plan.sky_from(SingleFrom::Auto), None);
        assert_eq!(black.weight(0), DVec3::ZERO);
    }
}
