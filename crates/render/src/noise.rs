//! How many samples the pixels of an image need, decided block by block from what each block has seen.
//!
//! A pilot of tiles spread over the frame tells how much noise is affordable where; every other block needs its own samples and that
//! [`Rule`] alone, so that a part of the frame gets the very samples it has in the whole.

use crate::error::RenderError;
use crate::film::Film;
use crate::layers::LayerSet;
use crate::options::Crop;
use crate::relative::{floor, median_5x5, weight, weighted};
use serde::{Deserialize, Serialize};
use tyndall_math::{Key, Sampler};

/// Blocks are this many pixels wide and high, counted from the frame's corner; those at its far borders may be smaller.
const SIDE: u32 = 4;
/// Pixels around a region that its weights look at: medians are over 5 × 5.
const MARGIN: u32 = 2;
/// Tiles of the pilot, at most, and the blocks along their sides.
const TILES: u64 = 256;
const TILE: u32 = 3 * SIDE;
/// By how much the samples of a pixel may grow at once: what few samples tell of noise may be far off.
const GROWTH: u32 = 4;
/// Samples per pixel at which a render ends even if its error is not met.
pub(crate) const MOST_SAMPLES: u32 = 1 << 20;

/// A part of the frame, made of whole blocks, that gets as many samples as its blocks need.
#[derive(Deserialize, Serialize)]
#[serde(try_from = "Kept")]
pub(crate) struct Region {
    pub(crate) film: Film,
    /// The 5 × 5 median of the first samples, per channel and pixel.
    smooth: [Vec<f32>; 3],
    /// The sum of the first samples' means over pixels and channels: lone lit pixels leave no trace in medians.
    light: f64,
}

/// A region as a file keeps it.
#[derive(Deserialize)]
struct Kept {
    film: Film,
    smooth: [Vec<f32>; 3],
    light: f64,
}

impl TryFrom<Kept> for Region {
    type Error = &'static str;

    fn try_from(kept: Kept) -> Result<Self, &'static str> {
        let Kept {
            film,
            smooth,
            light,
        } = kept;
        if smooth.iter().any(|channel| channel.len() != film.len()) {
            return Err("a region has not as many medians as pixels");
        }
        Ok(Self {
            film,
            smooth,
            light,
        })
    }
}

impl Region {
    /// The region in the middle of `first`, whose pixels have equally many samples.
    ///
    /// # Errors
    /// Those of [`Film::new`].
    pub(crate) fn new(
        part: Crop,
        frame: [u32; 2],
        layers: &LayerSet,
        first: &Film,
    ) -> Result<Self, RenderError> {
        let mut film = Film::new(frame, part, layers.clone())?;
        film.adopt(first);
        let whole = first.crop();
        let (width, height) = (whole.width as usize, whole.height as usize);
        let smooth = first.colour().map(|channel| {
            let median = median_5x5(&channel, width, height);
            let rows = (part.y..part.y + part.height).map(|y| [part.x, y]);
            let row = |place| {
                let start = whole.index(place).unwrap_or_default();
                &median[start..start + part.width as usize]
            };
            rows.flat_map(row).copied().collect()
        });
        let light = film.colour().iter().flatten().map(|&v| f64::from(v)).sum();
        Ok(Self {
            film,
            smooth,
            light,
        })
    }

    /// What the variance of one sample adds to the squared relative error: the mean over pixels and channels of a block, which is counted
    /// from the region's corner. `floor` is that of the weights.
    fn sample_variance(&self, block: Crop, floor: f64) -> f64 {
        let pixel = |i: usize| {
            let variance = self.film.sample_variance(i);
            let channel = |c: usize| weighted(variance[c], weight(self.smooth[c][i], floor));
            (0..3).map(channel).sum::<f64>() / 3.0
        };
        let n = f64::from(block.width * block.height);
        self.pixels(block).map(pixel).sum::<f64>() / n
    }

    /// The pixels of a block in reading order, by their numbers in the region.
    fn pixels(&self, block: Crop) -> impl Iterator<Item = usize> {
        let width = self.film.crop().width;
        let places = (0..block.height).flat_map(move |y| (0..block.width).map(move |x| [x, y]));
        places.map(move |[x, y]| ((block.y + y) * width + block.x + x) as usize)
    }

    /// The blocks, counted from the region's corner.
    fn blocks(&self) -> impl Iterator<Item = Crop> {
        let Crop { width, height, .. } = self.film.crop();
        let starts = |n: u32| (0..n).step_by(SIDE as usize);
        let block = move |x: u32, y: u32| Crop {
            x,
            y,
            width: SIDE.min(width - x),
            height: SIDE.min(height - y),
        };
        starts(height).flat_map(move |y| starts(width).map(move |x| block(x, y)))
    }

    /// Whether each pixel has as many samples as it should.
    pub(crate) fn meets(&self, goals: &[u32]) -> bool {
        let mut numbered = goals.iter().enumerate();
        numbered.all(|(i, &goal)| self.film.taken(i) >= goal)
    }
}

/// What decides how many samples a block needs.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(crate) struct Rule {
    /// Samples over the root of what one sample's variance adds to the squared error.
    scale: f64,
    /// That of the weights.
    floor: f64,
}

impl Rule {
    /// The rule by which noise in `pilot` falls to `target` with the fewest samples, by what its regions have seen so far, and their noise.
    ///
    /// Samples in proportion to the root of what one sample's variance adds to the squared error need the fewest in all.
    pub(crate) fn new(pilot: &[Region], target: f64) -> (Self, f64) {
        let n: f64 = pilot.iter().map(|region| region.film.len() as f64).sum();
        let mean = pilot.iter().map(|region| region.light).sum::<f64>() / (3.0 * n);
        let floor = floor(mean);
        let (mut roots, mut squared) = (0.0, 0.0);
        for region in pilot {
            for block in region.blocks() {
                let variance = region.sample_variance(block, floor);
                let pixels = f64::from(block.width * block.height);
                let taken: u32 = region.pixels(block).map(|i| region.film.taken(i)).sum();
                roots += pixels * variance.sqrt();
                squared += pixels * variance * pixels / f64::from(taken.max(1));
            }
        }
        let scale = roots / n / (target * target);
        (Self { scale, floor }, (squared / n).sqrt())
    }

    /// How many samples each pixel of a region should have, row by row: no fewer than it has, nor more than [`GROWTH`] times that.
    pub(crate) fn goals(&self, region: &Region) -> Vec<u32> {
        let mut goals = vec![0; region.film.len()];
        for block in region.blocks() {
            let wanted = self.scale * region.sample_variance(block, self.floor).sqrt();
            for i in region.pixels(block) {
                let taken = region.film.taken(i);
                let most = f64::from(taken.saturating_mul(GROWTH).min(MOST_SAMPLES));
                // Where it is not a number there is nothing to aim at.
                let goal = if wanted.is_nan() {
                    0
                } else {
                    wanted.ceil().min(most) as u32
                };
                // Even, so that the film's halves stay alike.
                goals[i] = goal.saturating_add(goal & 1).max(taken);
            }
        }
        goals
    }
}

/// The smallest part of the frame that holds `crop` and is made of whole blocks.
pub(crate) fn whole_blocks(crop: Crop, frame: [u32; 2]) -> Crop {
    let [x, y] = [crop.x, crop.y].map(|first| first - first % SIDE);
    let end = |first: u32, n: u32, size: u32| (first + n).next_multiple_of(SIDE).min(size);
    Crop {
        x,
        y,
        width: end(crop.x, crop.width, frame[0]) - x,
        height: end(crop.y, crop.height, frame[1]) - y,
    }
}

/// A part of the frame with the pixels that its weights look at.
pub(crate) fn with_margin(part: Crop, frame: [u32; 2]) -> Crop {
    let grown = |first: u32, n: u32, size: u32| {
        let start = first.saturating_sub(MARGIN);
        (start, (first + n + MARGIN).min(size) - start)
    };
    let (x, width) = grown(part.x, part.width, frame[0]);
    let (y, height) = grown(part.y, part.height, frame[1]);
    Crop {
        x,
        y,
        width,
        height,
    }
}

/// The parts of a frame that make up the pilot: tiles chosen by the random numbers of `key`, or the frame itself where it is small.
pub(crate) fn pilot(frame: [u32; 2], key: Key) -> Vec<Crop> {
    let [columns, rows] = frame.map(|n| n.div_ceil(TILE));
    if u64::from(columns) * u64::from(rows) <= TILES {
        return vec![Crop::whole(frame)];
    }
    let place = |i: u64| {
        let [u, v] = Sampler::new(key, i).next_2d();
        let number = |u: f32, n: u32| ((u * n as f32) as u32).min(n - 1);
        (number(v, rows), number(u, columns))
    };
    let chosen: std::collections::BTreeSet<(u32, u32)> = (0..TILES).map(place).collect();
    let tile = |(row, column): (u32, u32)| {
        let (x, y) = (column * TILE, row * TILE);
        Crop {
            x,
            y,
            width: TILE.min(frame[0] - x),
            height: TILE.min(frame[1] - y),
        }
    };
    chosen.into_iter().map(tile).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::film::Pixel;
    use glam::Vec3;
    use tyndall_math::Purpose;

    const FRAME: [u32; 2] = [10, 6];

    /// A region of the whole frame after eight samples of 1 with a step of ± `noise` between even and odd ones.
    fn region(noise: impl Fn(u32, u32) -> f32) -> Region {
        let layers: LayerSet = "beauty".parse().unwrap();
        let mut film = Film::new(FRAME, Crop::whole(FRAME), layers.clone()).unwrap();
        for mut row in film.rows() {
            for x in row.columns() {
                for sample in 0..8 {
                    let sign = if sample & 1 == 0 { 1.0 } else { -1.0 };
                    let value = 1.0 + sign * noise(x, row.y);
                    let pixel = Pixel {
                        surface: Vec3::splat(value),
                        ..Pixel::default()
                    };
                    row.add(x, sample, &pixel);
                }
            }
        }
        Region::new(Crop::whole(FRAME), FRAME, &layers, &film).unwrap()
    }

    #[test]
    fn blocks_cover_a_region_once() {
        let region = region(|_, _| 0.0);
        let mut seen: Vec<usize> = region.blocks().flat_map(|b| region.pixels(b)).collect();
        assert_eq!(region.blocks().count(), 6);
        seen.sort_unstable();
        assert_eq!(seen, (0..60).collect::<Vec<_>>());
    }

    #[test]
    fn a_crop_grows_to_whole_blocks_and_a_margin_within_the_frame() {
        let crop = |[x, y, width, height]: [u32; 4]| Crop {
            x,
            y,
            width,
            height,
        };
        let blocks = whole_blocks(crop([5, 3, 4, 2]), FRAME);
        assert_eq!(blocks, crop([4, 0, 6, 6]));
        assert_eq!(with_margin(blocks, FRAME), crop([2, 0, 8, 6]));
    }

    #[test]
    fn even_noise_asks_for_as_many_samples_everywhere() {
        let region = region(|_, _| 0.1);
        // Halves of four samples each at 1 ± 0.1: a pixel has the variance 0.01, a sample 0.08.
        let rule = |target| Rule::new(std::slice::from_ref(&region), target);
        let (moderate, noise) = rule(0.05);
        assert!((noise - (0.01_f64 / 1.01).sqrt()).abs() < 1e-6, "{noise}");
        // 0.08/1.01/0.05² = 31.7 samples.
        assert_eq!(moderate.goals(&region), [32; 60]);
        let most = rule(0.001).0.goals(&region);
        assert_eq!(most, [32; 60], "no more than fourfold at once");
        let least = rule(1.0).0.goals(&region);
        assert_eq!(least, [8; 60], "no fewer than there are");
        assert!(region.meets(&least) && !region.meets(&most));
    }

    #[test]
    fn samples_go_where_noise_is() {
        let region = region(|x, y| if (x, y) == (5, 1) { 0.5 } else { 1e-4 });
        let rule = Rule {
            scale: 100.0,
            floor: 0.01,
        };
        // The whole block of the noisy pixel, and no other.
        for (i, goal) in rule.goals(&region).iter().enumerate() {
            let (x, y) = (i % 10, i / 10);
            let is_noisy = (4..8).contains(&x) && y < 4;
            assert_eq!(*goal > 8, is_noisy, "{x} {y}");
        }
    }

    #[test]
    fn a_lone_lit_pixel_on_black_has_an_end() {
        let layers: LayerSet = "beauty".parse().unwrap();
        let mut film = Film::new(FRAME, Crop::whole(FRAME), layers.clone()).unwrap();
        for mut row in film.rows() {
            for x in row.columns() {
                for sample in 0..8 {
                    let is_lit = (x, row.y) == (5, 1);
                    let surface = if is_lit {
                        1.0 + 0.1 * sample as f32
                    } else {
                        0.0
                    };
                    let pixel = Pixel {
                        surface: Vec3::splat(surface),
                        ..Pixel::default()
                    };
                    row.add(x, sample, &pixel);
                }
            }
        }
        let region = Region::new(Crop::whole(FRAME), FRAME, &layers, &film).unwrap();
        // All medians are 0; the mean is not.
        let (rule, noise) = Rule::new(std::slice::from_ref(&region), 0.5);
        assert!(noise > 0.0 && noise.is_finite(), "{noise}");
        let goals = rule.goals(&region);
        assert!(goals[15] > 8 && goals[0] == 8, "{goals:?}");
    }

    #[test]
    fn a_black_frame_needs_no_more_samples() {
        let layers: LayerSet = "beauty".parse().unwrap();
        let mut film = Film::new(FRAME, Crop::whole(FRAME), layers.clone()).unwrap();
        for mut row in film.rows() {
            for x in row.columns() {
                row.add(x, 0, &Pixel::default());
                row.add(x, 1, &Pixel::default());
            }
        }
        let black = Region::new(Crop::whole(FRAME), FRAME, &layers, &film).unwrap();
        let (rule, noise) = Rule::new(std::slice::from_ref(&black), 0.05);
        assert_eq!(noise, 0.0);
        assert_eq!(rule.goals(&black), [2; 60]);
    }

    #[test]
    fn pilots_are_small_frames_or_tiles_of_large_ones() {
        let key = Key {
            seed: 1,
            purpose: Purpose::Pilot,
            index: 0,
        };
        assert_eq!(pilot([150, 100], key), [Crop::whole([150, 100])]);
        let tiles = pilot([1025, 770], key);
        // Places that fall on one tile twice count once.
        assert!((230..=256).contains(&tiles.len()), "{}", tiles.len());
        for tile in tiles {
            assert_eq!(whole_blocks(tile, [1025, 770]), tile);
        }
    }
}
