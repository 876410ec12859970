//! Where camera samples become pixels.
//!
//! The film keeps sums, not means, and the image's colour twice over, for all samples and for the even ones: the difference of the two
//! halves tells how noisy the image still is.

use crate::error::RenderError;
use crate::image::Image;
use crate::layers::{LAYERS, Layer, LayerSet, Source};
use crate::options::Crop;
use crate::relative::{mean, median_5x5, weighted, weights};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// What one camera sample sees, layer by layer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Light of the first surface, or of the environment, attenuated by the media.
    pub surface: Vec3,
    /// Light of emitters, scattered once, by the medium, towards the eye.
    pub single: Vec3,
    /// All other light that the medium scatters towards the eye.
    pub multiple: Vec3,
    /// Light emitted by media, seen directly.
    pub emission: Vec3,
    /// Share of the first surface's light that the media let through.
    pub transmittance: Vec3,
    /// Distance to the first surface in metres, 0 where there is none.
    pub depth: f32,
    /// Questions put to caches.
    pub lookups: f32,
}

/// Number of sums kept for the even samples' colour, after those of the layers.
const EVEN: usize = 3;

/// Sums of camera samples over a part of the frame.
///
/// The sums are f64: a f32 sum of n equal values drifts by up to n · 6·10⁻⁸ of itself, which 10⁴ samples make visible beside the exact
/// benchmarks; it also keeps one bright sample from swallowing the ones after it.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(try_from = "Kept")]
pub struct Film {
    frame: [u32; 2],
    crop: Crop,
    layers: LayerSet,
    #[serde(skip_serializing)]
    stored: Vec<Stored>,
    #[serde(skip_serializing)]
    stride: usize,
    sums: Vec<f64>,
    counts: Vec<[u32; 2]>,
}

/// A film as a file keeps it.
#[derive(Deserialize)]
struct Kept {
    frame: [u32; 2],
    crop: Crop,
    layers: LayerSet,
    sums: Vec<f64>,
    counts: Vec<[u32; 2]>,
}

impl TryFrom<Kept> for Film {
    type Error = RenderError;

    /// A film that could have been filled sample by sample.
    fn try_from(kept: Kept) -> Result<Self, RenderError> {
        const MOST: u32 = u32::MAX / 4;
        let crop = kept.crop.within(kept.frame)?;
        let broken = || RenderError::Option {
            option: "a film",
            found: "broken".to_owned(),
            allowed: "one that was written whole".to_owned(),
        };
        // Before memory is asked for.
        if u64::from(crop.width) * u64::from(crop.height) != kept.counts.len() as u64 {
            return Err(broken());
        }
        let film = Self::new(kept.frame, crop, kept.layers)?;
        let is_whole = film.sums.len() == kept.sums.len()
            && kept.sums.iter().all(|sum| sum.is_finite())
            && kept.counts.iter().flatten().all(|&n| n <= MOST);
        if !is_whole {
            return Err(broken());
        }
        Ok(Self {
            sums: kept.sums,
            counts: kept.counts,
            ..film
        })
    }
}

/// A layer that is summed, and where in a pixel's sums it stands.
#[derive(Clone, Copy, Debug)]
struct Stored {
    layer: &'static Layer,
    value: fn(&Pixel) -> Vec3,
    first: usize,
}

/// Which layers are summed, and how many numbers that takes a pixel.
fn stored(layers: &LayerSet) -> (Vec<Stored>, usize) {
    let mut stored = Vec::new();
    let mut stride = 0;
    for layer in LAYERS {
        let value = match layer.source {
            Source::PartOfBeauty(value) => value,
            Source::Mean(value) if layers.contains(layer.name) => value,
            _ => continue,
        };
        stored.push(Stored {
            layer,
            value,
            first: stride,
        });
        stride += layer.channels.len();
    }
    (stored, stride + EVEN)
}

/// Empty rooms for the sums and counts of a film.
fn reserve(crop: Crop, stride: usize) -> Result<(Vec<f64>, Vec<[u32; 2]>), RenderError> {
    let n = crop.width as usize * crop.height as usize;
    let (mut sums, mut counts) = (Vec::new(), Vec::new());
    let reserved = sums
        .try_reserve_exact(n * stride)
        .and_then(|()| counts.try_reserve_exact(n));
    if reserved.is_err() {
        return Err(RenderError::Memory {
            size: [crop.width, crop.height],
            mib: (n * (stride * size_of::<f64>() + size_of::<[u32; 2]>())) >> 20,
        });
    }
    Ok((sums, counts))
}

impl Film {
    /// An empty film for `crop`, a part of a frame of the given width and height, that can give the `layers`.
    ///
    /// # Errors
    /// Where the system refuses the memory.
    pub fn new(frame: [u32; 2], crop: Crop, layers: LayerSet) -> Result<Self, RenderError> {
        let (stored, stride) = stored(&layers);
        let (mut sums, mut counts) = reserve(crop, stride)?;
        let n = crop.width as usize * crop.height as usize;
        sums.resize(n * stride, 0.0);
        counts.resize(n, [0; 2]);
        Ok(Self {
            frame,
            crop,
            layers,
            stored,
            stride,
            sums,
            counts,
        })
    }

    /// Whether there is memory for a film, before anything is computed for one.
    ///
    /// # Errors
    /// As [`Film::new`].
    pub(crate) fn check_memory(crop: Crop, layers: &LayerSet) -> Result<(), RenderError> {
        reserve(crop, stored(layers).1).map(drop)
    }

    /// The part of the frame that is filmed.
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// Whether it is of this part of a frame, and can give these layers.
    pub(crate) fn is_of(&self, frame: [u32; 2], crop: Crop, layers: &LayerSet) -> bool {
        let names = |layers: &LayerSet| String::from(layers.clone());
        self.frame == frame && self.crop == crop && names(&self.layers) == names(layers)
    }

    /// The rows from top to bottom, to be filled in parallel.
    pub fn rows(&mut self) -> Vec<FilmRow<'_>> {
        let width = self.crop.width as usize;
        let sums = self.sums.chunks_mut(width * self.stride);
        let rows = sums.zip(self.counts.chunks_mut(width)).zip(self.crop.y..);
        rows.map(|((sums, counts), y)| FilmRow {
            y,
            x: self.crop.x,
            stored: &self.stored,
            stride: self.stride,
            sums,
            counts,
        })
        .collect()
    }

    /// Number of pixels.
    pub(crate) fn len(&self) -> usize {
        self.counts.len()
    }

    /// Whether some pixels have no samples.
    pub(crate) fn has_gaps(&self) -> bool {
        self.counts.contains(&[0, 0])
    }

    /// Mean number of samples per pixel.
    pub fn mean_samples(&self) -> f64 {
        let total: u64 = self.counts.iter().flatten().map(|&n| u64::from(n)).sum();
        total as f64 / self.counts.len() as f64
    }

    /// The image so far: means over samples; a pixel without samples is black. The film knows no records: their layers are left at 0. `beauty` is the sum of the layers it is made of, as
    /// the image holds them, so that it equals them to rounding.
    pub fn image(&self) -> Image {
        let mut image = Image {
            origin: [self.crop.x as usize, self.crop.y as usize],
            frame: self.frame.map(|n| n as usize),
            ..Image::new(self.crop.width as usize, self.crop.height as usize)
        };
        for layer in self.layers.iter() {
            for (c, name) in layer.channels.iter().enumerate() {
                let values = match layer.source {
                    Source::Records => vec![0.0; self.counts.len()],
                    Source::Beauty => self.beauty(c),
                    Source::PartOfBeauty(_) | Source::Mean(_) => self.stored_mean(layer, c),
                    Source::SampleCount => {
                        self.counts.iter().map(|n| (n[0] + n[1]) as f32).collect()
                    }
                };
                image.channels.insert((*name).to_owned(), values);
            }
        }
        image
    }

    /// Takes over the samples of another film of the same frame and layers, where it shows pixels of this one.
    pub(crate) fn adopt(&mut self, other: &Self) {
        let (mine, theirs) = (self.crop, other.crop);
        for i in 0..other.counts.len() {
            let (x, y) = (i as u32 % theirs.width, i as u32 / theirs.width);
            if let Some(to) = mine.index([theirs.x + x, theirs.y + y]) {
                self.counts[to] = other.counts[i];
                let sums = &other.sums[i * other.stride..(i + 1) * other.stride];
                self.sums[to * self.stride..(to + 1) * self.stride].copy_from_slice(sums);
            }
        }
    }

    /// Gives rows with gaps the sums of the nearest row without, as where time ran out in the first pass.
    pub fn fill_gaps(&mut self) {
        let width = self.crop.width as usize;
        let sampled: Vec<usize> = (0..self.crop.height as usize)
            .filter(|row| !self.counts[row * width..][..width].contains(&[0, 0]))
            .collect();
        for row in 0..self.crop.height as usize {
            let nearest = sampled
                .iter()
                .copied()
                .min_by_key(|other| other.abs_diff(row));
            if let Some(from) = nearest.filter(|&from| from != row) {
                self.counts
                    .copy_within(from * width..(from + 1) * width, row * width);
                let stride = width * self.stride;
                self.sums
                    .copy_within(from * stride..(from + 1) * stride, row * stride);
            }
        }
    }

    /// The colour alone, whatever layers were asked for: red, green and blue of every pixel.
    pub fn colour(&self) -> [Vec<f32>; 3] {
        std::array::from_fn(|c| self.beauty(c))
    }

    /// Samples of pixel number `i` in reading order.
    pub(crate) fn taken(&self, i: usize) -> u32 {
        self.counts[i].iter().sum()
    }

    /// What the two halves tell of the image's noise: the root of the mean over pixels of V w, where
    /// V = (a − b)² n m / (n + m)² estimates the variance of a pixel's value from the means a, b of its n even and m odd samples
    /// (((a − b)/2)² for halves of one size), and w is the weight of the relative error at the image's 5 × 5 median.
    ///
    /// `None` until every pixel has two samples. Unbiased, before the root, where the samples of the two halves are independent.
    pub fn relative_error(&self) -> Option<f64> {
        if self.counts.iter().any(|n| n[0] == 0 || n[1] == 0) {
            return None;
        }
        let (width, height) = (self.crop.width as usize, self.crop.height as usize);
        let colour = self.colour();
        let smooth = colour.each_ref().map(|c| median_5x5(c, width, height));
        let weights = weights(&smooth, mean(&colour));
        let pixels = self.sums.chunks(self.stride).zip(&self.counts).enumerate();
        let squared = pixels.map(|(i, (sums, n))| {
            let variance = self.variance(sums, *n);
            (0..3)
                .map(|c| weighted(variance[c], weights[c][i]))
                .sum::<f64>()
                / 3.0
        });
        Some((squared.sum::<f64>() / self.counts.len() as f64).sqrt())
    }

    /// Estimated variance of one sample of pixel number `i` in reading order, per channel; 0 where the pixel lacks samples in either half.
    pub(crate) fn sample_variance(&self, i: usize) -> DVec3 {
        let n = self.counts[i];
        if n[0] == 0 || n[1] == 0 {
            return DVec3::ZERO;
        }
        let sums = &self.sums[i * self.stride..(i + 1) * self.stride];
        self.variance(sums, n) * f64::from(n[0] + n[1])
    }

    /// Estimated variance of a pixel's colour from its two halves.
    fn variance(&self, sums: &[f64], n: [u32; 2]) -> DVec3 {
        let parts = self
            .stored
            .iter()
            .filter(|s| matches!(s.layer.source, Source::PartOfBeauty(_)));
        let all: DVec3 = parts.map(|s| DVec3::from_slice(&sums[s.first..])).sum();
        let even = DVec3::from_slice(&sums[self.stride - EVEN..]);
        let [n_a, n_b] = n.map(f64::from);
        let difference = even / n_a - (all - even) / n_b;
        difference * difference * (n_a * n_b / (n_a + n_b).powi(2))
    }

    /// One channel of the image's colour.
    fn beauty(&self, c: usize) -> Vec<f32> {
        (0..self.counts.len())
            .map(|i| self.beauty_at(i, c))
            .collect()
    }

    /// One channel of a pixel's colour: the f32 sum of its layers' f32 values.
    fn beauty_at(&self, i: usize, c: usize) -> f32 {
        let sums = &self.sums[i * self.stride..];
        let n = f64::from(self.taken(i).max(1));
        let parts = self
            .stored
            .iter()
            .filter(|s| matches!(s.layer.source, Source::PartOfBeauty(_)));
        parts.map(|s| (sums[s.first + c] / n) as f32).sum()
    }

    fn stored_mean(&self, layer: &Layer, c: usize) -> Vec<f32> {
        let stored = self.stored.iter().find(|s| s.layer.name == layer.name);
        stored.map_or_else(Vec::new, |s| self.mean(s.first + c).collect())
    }

    /// Means of the sums at one place of every pixel.
    fn mean(&self, at: usize) -> impl Iterator<Item = f32> {
        let pixels = self.sums.chunks(self.stride).zip(&self.counts);
        pixels.map(move |(sums, n)| (sums[at] / f64::from((n[0] + n[1]).max(1))) as f32)
    }
}

/// One row of a [`Film`].
#[derive(Debug)]
pub struct FilmRow<'a> {
    /// Its row in the frame, counted from the top.
    pub y: u32,
    x: u32,
    stored: &'a [Stored],
    stride: usize,
    sums: &'a mut [f64],
    counts: &'a mut [[u32; 2]],
}

impl FilmRow<'_> {
    /// The columns of the frame that the row covers.
    pub fn columns(&self) -> std::ops::Range<u32> {
        self.x..self.x + self.counts.len() as u32
    }

    /// Samples that column `x` of the frame has.
    pub fn taken(&self, x: u32) -> u32 {
        self.counts[(x - self.x) as usize].iter().sum()
    }

    /// Adds sample number `sample` of column `x` of the frame; columns outside the row are a bug of the caller.
    pub fn add(&mut self, x: u32, sample: u32, pixel: &Pixel) {
        debug_assert!(
            self.columns().contains(&x),
            "column {x} is not in {:?}",
            self.columns()
        );
        let i = (x - self.x) as usize;
        let sums = &mut self.sums[i * self.stride..(i + 1) * self.stride];
        let mut beauty = DVec3::ZERO;
        for s in self.stored {
            let value = (s.value)(pixel).as_dvec3();
            if matches!(s.layer.source, Source::PartOfBeauty(_)) {
                beauty += value;
            }
            for (sum, value) in sums[s.first..s.first + s.layer.channels.len()]
                .iter_mut()
                .zip(value.to_array())
            {
                *sum += value;
            }
        }
        let odd = (sample & 1) as usize;
        if odd == 0 {
            let even = self.stride - EVEN;
            for (sum, value) in sums[even..].iter_mut().zip(beauty.to_array()) {
                *sum += value;
            }
        }
        self.counts[i][odd] += 1;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use tyndall_math::{Key, Purpose, Sampler};

    const CROP: Crop = Crop {
        x: 3,
        y: 5,
        width: 4,
        height: 2,
    };

    fn film(layers: &str) -> Film {
        Film::new([10, 10], CROP, layers.parse().unwrap()).unwrap()
    }

    #[test]
    fn lone_lit_pixels_on_black_have_a_finite_error() {
        // All medians are 0: the floor of the weights must come from the image itself.
        let mut film = film("beauty");
        fill(&mut film, 2, |x, y, s| Pixel {
            surface: Vec3::splat(if (x, y) == (CROP.x, CROP.y) {
                1.0 + s as f32
            } else {
                0.0
            }),
            ..Pixel::default()
        });
        let error = film.relative_error().unwrap();
        assert!(error > 0.0 && error.is_finite(), "{error}");
    }

    fn fill(film: &mut Film, samples: u32, pixel: impl Fn(u32, u32, u32) -> Pixel) {
        for mut row in film.rows() {
            for x in row.columns() {
                let before = row.taken(x);
                for s in 0..samples {
                    row.add(x, s, &pixel(x, row.y, s));
                }
                assert_eq!(row.taken(x), before + samples);
            }
        }
    }

    #[test]
    fn the_image_holds_the_means_of_the_layers_asked_for() {
        let mut film = film("surface,depth,samples,transmittance");
        fill(&mut film, 4, |x, y, s| Pixel {
            surface: Vec3::new(x as f32, y as f32, s as f32),
            transmittance: Vec3::splat(0.5),
            depth: s as f32,
            ..Pixel::default()
        });
        let image = film.image();
        assert_eq!(image.channels.len(), 3 + 1 + 1 + 3);
        assert_eq!((image.origin, image.frame), ([3, 5], [10, 10]));
        assert_eq!(
            image.channels["surface.R"],
            [3.0, 4.0, 5.0, 6.0, 3.0, 4.0, 5.0, 6.0]
        );
        assert_eq!(
            image.channels["surface.G"],
            [5.0, 5.0, 5.0, 5.0, 6.0, 6.0, 6.0, 6.0]
        );
        assert_eq!(image.channels["Z"], [1.5; 8]);
        assert_eq!(image.channels["samples"], [4.0; 8]);
        assert_eq!(image.channels["transmittance.B"], [0.5; 8]);
        assert_eq!(film.mean_samples(), 4.0);
    }

    #[test]
    fn beauty_is_the_sum_of_its_layers_bit_for_bit() {
        let mut film = film("beauty,surface,single,multiple,emission");
        fill(&mut film, 3, |x, y, s| Pixel {
            surface: Vec3::splat(0.1 * x as f32),
            single: Vec3::splat(0.3 * y as f32),
            multiple: Vec3::splat(1.7 * s as f32),
            emission: Vec3::splat(1e-3),
            ..Pixel::default()
        });
        let image = film.image();
        for c in ["R", "G", "B"] {
            for (i, beauty) in image.channels[c].iter().enumerate() {
                let part = |name: &str| image.channels[&format!("{name}.{c}")][i];
                assert_eq!(
                    *beauty,
                    part("surface") + part("single") + part("multiple") + part("emission")
                );
            }
        }
    }

    #[test]
    fn pixels_without_samples_are_black_and_have_no_error_yet() {
        let mut film = film("beauty");
        assert_eq!(film.image().channels["R"], [0.0; 8]);
        assert_eq!(film.relative_error(), None);
        fill(&mut film, 1, |_, _, _| Pixel::default());
        assert_eq!(film.relative_error(), None);
        fill(&mut film, 2, |_, _, _| Pixel::default());
        assert_eq!(film.relative_error(), Some(0.0), "black without noise");
    }

    #[test]
    fn sums_of_many_equal_values_do_not_drift() {
        let mut film = film("beauty,surface");
        let pixel = Pixel {
            surface: Vec3::splat(0.1),
            ..Pixel::default()
        };
        fill(&mut film, 100_000, |_, _, _| pixel);
        assert_eq!(film.image().channels["R"], [0.1; 8]);
    }

    #[test]
    fn the_error_from_halves_is_the_noise_over_the_weight() {
        // Uniform noise of variance a²/3 around 1, n = 5 samples (halves of 3 and 2): error² = a²/(3n) / 1.01 but for the median's own
        // noise. 128² × 3 values give V a relative standard error of √(2/49152) = 0.64 %, so the root 0.32 %; the weight's noise adds
        // less than 0.5 % (second order in a). Five standard errors: false alarms below 10⁻⁶.
        let (a, n) = (0.2f32, 5);
        let crop = Crop::whole([128, 128]);
        let mut film = Film::new([128, 128], crop, "beauty".parse().unwrap()).unwrap();
        fill(&mut film, n, |x, y, s| {
            // One key per sample: independent, where samples of one key would be stratified against each other.
            let index = u64::from((y * 128 + x) * n + s);
            let mut sampler = Sampler::new(
                Key {
                    seed: 7,
                    purpose: Purpose::Pixel,
                    index,
                },
                0,
            );
            let mut noise = || 1.0 + a * (2.0 * sampler.next_1d() - 1.0);
            Pixel {
                surface: Vec3::new(noise(), noise(), noise()),
                ..Pixel::default()
            }
        });
        let expected = f64::from(a) / (3.0 * f64::from(n) * 1.01).sqrt();
        let ratio = film.relative_error().unwrap() / expected;
        assert!((ratio - 1.0).abs() < 5.0 * 0.0032 + 0.005, "{ratio}");
    }
}
