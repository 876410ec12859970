//! Comparing a small render with the golden image of its name.
//!
//! On one machine a render repeats bit by bit. Between processors the last digit of f64 library functions differs, and
//! rarely such a digit turns a decision around, so that a path goes elsewhere and one pixel changes by more than rounding.
//! Hence two bounds: nearly every pixel must agree to [`PIXEL_BOUND`], and the mean of every tile to [`TILE_BOUND`],
//! which a tile that is 3 % brighter breaks and one turned path does not.

use crate::image::Image;
use anyhow::{Context, Result, bail};
use glam::Vec3;
use std::fs;
use std::path::PathBuf;

/// Relative difference up to which two pixels agree: far above rounding (1e-6), far below anything one can see.
pub const PIXEL_BOUND: f32 = 1e-3;
/// Share of the pixels that may disagree, for turned paths.
pub const STRAY_SHARE: f32 = 0.02;
/// Relative difference that the mean of a tile may have.
pub const TILE_BOUND: f32 = 0.01;
/// Side of a tile in pixels.
const TILE: usize = 8;

/// Where goldens are, where failures are explained, and whether to replace goldens.
pub struct Goldens {
    /// Folder of the golden images, `<name>.exr`.
    pub references: PathBuf,
    /// Folder that gets a folder of its own for each failure.
    pub failures: PathBuf,
    /// Whether to replace golden images instead of comparing.
    pub bless: bool,
}

/// How far two images are apart.
#[derive(Debug)]
pub struct Difference {
    /// Largest relative difference of a pixel's channel.
    pub worst_pixel: f32,
    /// Share of pixels beyond [`PIXEL_BOUND`].
    pub stray_share: f32,
    /// Largest relative difference of a tile's mean.
    pub worst_tile: f32,
    /// Column and row of that tile.
    pub worst_tile_at: [usize; 2],
}

impl Difference {
    /// Compares images of one size. Differences are relative to the reference plus 1 % of its mean, so that black
    /// pixels do not count more than dim ones.
    pub fn between(result: &Image, reference: &Image) -> Self {
        let floor = 0.01 * reference.mean();
        let relative = |a: Vec3, b: Vec3| {
            let difference = (a - b).abs() / (b.abs() + floor).max(Vec3::splat(f32::MIN_POSITIVE));
            // A NaN anywhere must count as a difference, and `max_element` may drop it.
            if difference.is_finite() {
                difference.max_element()
            } else {
                f32::INFINITY
            }
        };
        let pairs = || result.pixels.iter().zip(&reference.pixels);
        let pixels: Vec<f32> = pairs().map(|(&a, &b)| relative(a, b)).collect();
        let n_stray = pixels.iter().filter(|&&d| d > PIXEL_BOUND).count();

        let [width, height] = reference.size;
        let (mut worst_tile, mut worst_tile_at) = (0.0, [0, 0]);
        for row in 0..height.div_ceil(TILE) {
            for column in 0..width.div_ceil(TILE) {
                let sum = |image: &Image| -> Vec3 {
                    let rows = row * TILE..(row * TILE + TILE).min(height);
                    let columns = column * TILE..(column * TILE + TILE).min(width);
                    rows.flat_map(|y| &image.pixels[y * width..(y + 1) * width][columns.clone()])
                        .sum()
                };
                let n = TILE.min(height - row * TILE) * TILE.min(width - column * TILE);
                let difference = relative(sum(result) / n as f32, sum(reference) / n as f32);
                if difference > worst_tile {
                    (worst_tile, worst_tile_at) = (difference, [column, row]);
                }
            }
        }
        Self {
            worst_pixel: pixels.iter().copied().fold(0.0, f32::max),
            stray_share: n_stray as f32 / pixels.len().max(1) as f32,
            worst_tile,
            worst_tile_at,
        }
    }

    /// Whether the images agree within the bounds of this module.
    pub fn is_small(&self) -> bool {
        self.stray_share <= STRAY_SHARE && self.worst_tile <= TILE_BOUND
    }
}

impl Goldens {
    /// Compares `result` with the golden image `name`, or replaces that image when blessing. A failure leaves result,
    /// reference, difference and numbers in the failure folder and says where.
    pub fn check(&self, name: &str, result: &Image) -> Result<()> {
        let path = self.references.join(format!("{name}.exr"));
        if self.bless {
            fs::create_dir_all(&self.references)?;
            return result.write_exr(&path);
        }
        let hint =
            "if the new image is right, `cargo xtask golden --bless` makes it the golden one";
        if !path.exists() {
            let folder = self.explain(name, result, None, "no golden image")?;
            bail!("there is no golden image {name}; look at {folder}; {hint}");
        }
        let reference = Image::read(&path)?;
        if result.size != reference.size {
            let sizes = format!("size {:?}, golden {:?}", result.size, reference.size);
            let folder = self.explain(name, result, Some(&reference), &sizes)?;
            bail!("{sizes}; look at {folder}; {hint}");
        }
        let difference = Difference::between(result, &reference);
        if !difference.is_small() {
            let numbers = format!(
                "{difference:#?}\nbounds: stray_share {STRAY_SHARE} beyond {PIXEL_BOUND}, worst_tile {TILE_BOUND}"
            );
            let folder = self.explain(name, result, Some(&reference), &numbers)?;
            bail!("{numbers}\nlook at {folder}; {hint}");
        }
        Ok(())
    }

    /// Leaves everything one needs to judge a failure; returns the folder for people.
    fn explain(
        &self,
        name: &str,
        result: &Image,
        reference: Option<&Image>,
        numbers: &str,
    ) -> Result<String> {
        let folder = self.failures.join(name);
        fs::create_dir_all(&folder)
            .with_context(|| format!("could not make {}", folder.display()))?;
        let white = 4.0 * reference.unwrap_or(result).mean().max(f32::MIN_POSITIVE);
        let save = |kind: &str, image: &Image, white: f32| -> Result<()> {
            image.write_exr(&folder.join(format!("{kind}.exr")))?;
            image.write_png(&folder.join(format!("{kind}.png")), white)
        };
        save("result", result, white)?;
        if let Some(reference) = reference {
            save("reference", reference, white)?;
            if result.size == reference.size {
                let pairs = result.pixels.iter().zip(&reference.pixels);
                let pixels: Vec<Vec3> = pairs.map(|(&a, &b)| (a - b).abs()).collect();
                let most = pixels
                    .iter()
                    .map(|p| p.max_element())
                    .fold(f32::MIN_POSITIVE, f32::max);
                save(
                    "difference",
                    &Image {
                        size: result.size,
                        pixels,
                    },
                    most,
                )?;
            }
        }
        fs::write(folder.join("numbers.txt"), format!("{numbers}\n"))?;
        Ok(folder.display().to_string())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use tempfile::TempDir;

    /// A smooth colourful image of 24 × 16 pixels.
    fn image() -> Image {
        let size = [24, 16];
        let pixel = |i: usize| {
            let (x, y) = ((i % size[0]) as f32, (i / size[0]) as f32);
            Vec3::new(0.2 + 0.1 * x, 1.0 + 0.05 * y, 0.5)
        };
        Image {
            size,
            pixels: (0..size[0] * size[1]).map(pixel).collect(),
        }
    }

    /// Goldens in a new folder that holds `image` as "one".
    fn goldens(image: &Image) -> (TempDir, Goldens) {
        let folder = TempDir::new().unwrap();
        let at = |name| folder.path().join(name);
        let mut goldens = Goldens {
            references: at("golden"),
            failures: at("failures"),
            bless: true,
        };
        goldens.check("one", image).unwrap();
        goldens.bless = false;
        (folder, goldens)
    }

    #[test]
    fn an_image_equals_its_own_golden() {
        let (_folder, goldens) = goldens(&image());
        goldens.check("one", &image()).unwrap();
        assert!(!goldens.failures.exists());
    }

    #[test]
    fn a_golden_with_one_tile_3_percent_brighter_fails_and_leaves_the_evidence() {
        let mut brighter = image();
        for y in 8..16 {
            for x in 8..16 {
                brighter.pixels[y * 24 + x] *= 1.03;
            }
        }
        let (_folder, goldens) = goldens(&brighter);
        let message = goldens.check("one", &image()).unwrap_err().to_string();
        assert!(
            message.contains("worst_tile_at") && message.contains("--bless"),
            "{message}"
        );
        for file in [
            "result.exr",
            "reference.exr",
            "difference.exr",
            "difference.png",
            "numbers.txt",
        ] {
            assert!(goldens.failures.join("one").join(file).exists(), "{file}");
        }
    }

    #[test]
    fn a_missing_golden_fails_and_says_how_to_bless_it() {
        let (_folder, goldens) = goldens(&image());
        let message = goldens.check("two", &image()).unwrap_err().to_string();
        assert!(
            message.contains("no golden image two")
                && message.contains("cargo xtask golden --bless")
        );
        assert!(goldens.failures.join("two/result.exr").exists());
    }

    #[test]
    fn rounding_and_one_turned_path_pass_but_a_tint_and_a_nan_do_not() {
        let (_folder, goldens) = goldens(&image());
        let mut rounded = image();
        rounded.pixels.iter_mut().for_each(|p| *p *= 1.0 + 1e-6);
        rounded.pixels[40] *= 1.2;
        goldens.check("one", &rounded).unwrap();

        let mut tinted = image();
        tinted.pixels.iter_mut().for_each(|p| p.x *= 1.003);
        assert!(goldens.check("one", &tinted).is_err());

        let mut broken = image();
        broken.pixels[40].y = f32::NAN;
        assert!(goldens.check("one", &broken).is_err());
    }
}
