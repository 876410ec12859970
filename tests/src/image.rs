//! Small float images: read from and written to EXR by the `exr` crate alone, so that the renderer's own reader and
//! writer are checked too.

use anyhow::{Context, Result, anyhow, ensure};
use exr::prelude as exr;
use glam::Vec3;
use std::collections::BTreeMap;
use std::path::Path;

/// An RGB image, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Linear colours, row by row.
    pub pixels: Vec<Vec3>,
}

/// Mean of the three colour channels together of a rendered `layer`, or of the beauty where it is empty.
pub fn mean(image: &tyndall_render::image::Image, layer: &str) -> f64 {
    let prefix = if layer.is_empty() {
        String::new()
    } else {
        format!("{layer}.")
    };
    let channels = ["R", "G", "B"].map(|c| &image.channels[&format!("{prefix}{c}")]);
    let sum: f64 = channels
        .iter()
        .flat_map(|c| c.iter())
        .map(|&x| f64::from(x))
        .sum();
    sum / (3 * channels[0].len()) as f64
}

/// The channels of an EXR file by name, and its width and height.
#[derive(Debug, PartialEq)]
pub struct Channels {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Samples of each channel, row by row from the top.
    pub samples: BTreeMap<String, Vec<f32>>,
}

impl Channels {
    /// Reads a one-part EXR file.
    pub fn read(path: &Path) -> Result<Self> {
        let image = exr::read_first_flat_layer_from_file(path)
            .with_context(|| format!("could not read {}", path.display()))?;
        let layer = image.layer_data;
        let channels = layer.channel_data.list.into_iter();
        Ok(Self {
            size: [layer.size.width(), layer.size.height()],
            samples: channels
                .map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect()))
                .collect(),
        })
    }

    /// The colours of a layer: prefix `""` for the image itself, or `"single."` and the like.
    pub fn rgb(&self, prefix: &str) -> Result<Image> {
        let channel = |letter: &str| {
            let name = format!("{prefix}{letter}");
            self.samples
                .get(&name)
                .ok_or_else(|| anyhow!("no channel `{name}`"))
        };
        let (r, g, b) = (channel("R")?, channel("G")?, channel("B")?);
        let pixels = r
            .iter()
            .zip(g)
            .zip(b)
            .map(|((&r, &g), &b)| Vec3::new(r, g, b));
        Ok(Image {
            size: self.size,
            pixels: pixels.collect(),
        })
    }
}

impl Image {
    /// Reads the colours of an EXR file.
    pub fn read(path: &Path) -> Result<Self> {
        Channels::read(path)?.rgb("")
    }

    /// Writes 32-bit floats, losslessly compressed.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        let [width, height] = self.size;
        ensure!(
            self.pixels.len() == width * height,
            "image of the wrong length"
        );
        let pixel =
            |p: exr::Vec2<usize>| -> (f32, f32, f32) { self.pixels[p.y() * width + p.x()].into() };
        let channels = exr::SpecificChannels::rgb(pixel);
        let encoding = exr::Encoding::SMALL_LOSSLESS;
        let layer = exr::Layer::new(
            (width, height),
            exr::LayerAttributes::default(),
            encoding,
            channels,
        );
        exr::WritableImage::write(&exr::Image::from_layer(layer))
            .to_file(path)
            .with_context(|| format!("could not write {}", path.display()))
    }

    /// Writes an sRGB picture for people, scaled so that `white` comes out white.
    pub fn write_png(&self, path: &Path, white: f32) -> Result<()> {
        let byte = |linear: f32| {
            let x = (linear / white).clamp(0.0, 1.0);
            let srgb = if x <= 0.003_130_8 {
                12.92 * x
            } else {
                1.055 * x.powf(1.0 / 2.4) - 0.055
            };
            (srgb * 255.0).round() as u8
        };
        let bytes: Vec<u8> = self
            .pixels
            .iter()
            .flat_map(|p| p.to_array().map(byte))
            .collect();
        let [width, height] = self.size.map(|n| n as u32);
        ::image::save_buffer(path, &bytes, width, height, ::image::ColorType::Rgb8)
            .with_context(|| format!("could not write {}", path.display()))
    }

    /// The mean of all colours and channels.
    pub fn mean(&self) -> f32 {
        let sum: f64 = self.pixels.iter().map(|p| f64::from(p.element_sum())).sum();
        (sum / (3 * self.pixels.len()) as f64) as f32
    }
}
