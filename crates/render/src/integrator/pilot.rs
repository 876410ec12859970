//! A few camera samples ahead of the image, with what the coarse field knows: what the image is made of, and how bright it is where.
//!
//! From them follows how far each part of the light may be off ([`Plan`]): what adds little to a pixel may be known less well.

use super::camera::{Camera, Known};
use crate::film::Pixel;
use glam::Vec3;
use rayon::prelude::*;
use tyndall_math::{Key, Purpose, Sampler};

/// Blocks across and down the frame.
const BLOCKS: [u32; 2] = [16, 12];
/// Camera samples of each block.
const SAMPLES: u32 = 16;
/// What a part may add to the image's error, over the error asked for. With the share of noise they come to it in squares, but for
/// some margin: parts err less than they are allowed to.
const SCATTERED: f32 = 0.5;
const SURFACE: f32 = 0.35;
/// Errors of a part over that of the image, at least and most.
const RANGE: [f32; 2] = [0.6, 3.0];
/// A part may not be less well known than this, whatever it adds.
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
}

/// Relative errors that parts of the light may have.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// Multiple scattering.
    pub(super) multiple: f32,
    /// Single scattering of light from skies; `None` where so little of it is in the image that samples do as well.
    pub(super) sky: Option<f32>,
    /// Light on surfaces.
    pub(super) surface: f32,
}

impl Pilot {
    /// Takes samples with what is `known` so far by cameras of one scene.
    pub(super) fn new<'s>(
        camera: impl Fn() -> Camera<'s> + Sync,
        frame: [u32; 2],
        known: &Known<'_>,
        seed: u64,
    ) -> Self {
        let blocks = (0..BLOCKS[0] * BLOCKS[1]).into_par_iter();
        let mean = |block| mean_of_block(&camera(), frame, known, seed, block);
        Self {
            blocks: blocks.map(mean).collect(),
        }
    }

    /// How far parts may be off where the image may have an `error`.
    pub(super) fn plan(&self, error: f32) -> Plan {
        let mean: Vec3 = self.blocks.iter().map(|b| beauty(&b.pixel)).sum();
        let mean = mean.element_sum() / (3 * self.blocks.len()) as f32;
        let floor = 0.01 * mean * mean;
        // Root mean square of a part over the whole.
        let share = |part: fn(&Block) -> Vec3| {
            let squared = |b: &Block| {
                let (part, whole) = (part(b), beauty(&b.pixel));
                (part * part / (whole * whole + floor)).element_sum() / 3.0
            };
            let sum: f32 = self.blocks.iter().map(squared).sum();
            (sum / self.blocks.len() as f32).sqrt()
        };
        let [least, most] = RANGE.map(|factor| factor * error);
        // Where the image is black a share is not a number, and the most is allowed.
        let allowed =
            |gain: f32, share: f32| (error * gain / share).min(most).min(COARSEST).max(least);
        let sky = share(|b| b.sky);
        Plan {
            multiple: allowed(SCATTERED, share(|b| b.pixel.multiple)),
            sky: (sky > NEGLIGIBLE * error).then_some(allowed(SCATTERED, sky)),
            surface: allowed(SURFACE, share(|b| b.pixel.surface)),
        }
    }
}

fn beauty(p: &Pixel) -> Vec3 {
    p.surface + p.single + p.multiple + p.emission
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
    let at = [block % BLOCKS[0], block / BLOCKS[0]];
    let share = 1.0 / SAMPLES as f32;
    let mut mean = Block::default();
    for i in 0..SAMPLES {
        let mut sampler = Sampler::new(key, u64::from(i));
        let place = sampler.next_2d();
        let [x, y] = [(0, w), (1, h)].map(|(k, size)| {
            let along = (at[k] as f32 + place[k]) / BLOCKS[k] as f32;
            ((along * size as f32) as u32).min(size - 1)
        });
        let found = camera.cached(x, y, &mut sampler.branch(0), known);
        mean.pixel.surface += found.surface * share;
        mean.pixel.single += found.single * share;
        mean.pixel.multiple += found.multiple * share;
        mean.pixel.emission += found.emission * share;
        mean.sky += camera.sky(x, y, &mut sampler.branch(0)) * share;
    }
    mean
}
