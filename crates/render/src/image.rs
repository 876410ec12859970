//! An image in memory: named channels of linear f32 values.
//!
//! It knows which part of a larger frame it shows, so that crops can be written and put together again.

use crate::error::RenderError;
use crate::layers::LAYERS;
use std::collections::BTreeMap;

/// Channels of one size; pixel (x, y) is value `y * width + x`, row 0 is the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Column and row of the frame at which pixel (0, 0) lies.
    pub origin: [usize; 2],
    /// Width and height of the frame of which this image is a part.
    pub frame: [usize; 2],
    /// Values by channel name, as EXR files name them: `R`, `surface.G`, `Z`.
    pub channels: BTreeMap<String, Vec<f32>>,
}

impl Image {
    /// An image without channels that is its own frame.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            origin: [0, 0],
            frame: [width, height],
            channels: BTreeMap::new(),
        }
    }

    /// The channels of a layer: three for colours, one for numbers such as depth.
    ///
    /// `name` is a layer of the table, the part before the dot of any other `name.R`, `name.G`, `name.B`, or the name of one
    /// channel. `beauty` falls back to a grey channel `Y`.
    pub fn layer(&self, name: &str) -> Option<Vec<&[f32]>> {
        let known = LAYERS.iter().find(|layer| layer.name == name);
        let rgb = ["R", "G", "B"].map(|c| format!("{name}.{c}"));
        let all = |names: &mut dyn Iterator<Item = &str>| {
            names
                .map(|c| self.channels.get(c).map(Vec::as_slice))
                .collect::<Option<Vec<_>>>()
        };
        known
            .and_then(|layer| all(&mut layer.channels.iter().copied()))
            .or_else(|| all(&mut rgb.iter().map(String::as_str)))
            .or_else(|| all(&mut std::iter::once(name)))
            .or_else(|| {
                (name == "beauty")
                    .then(|| all(&mut std::iter::once("Y")))
                    .flatten()
            })
    }

    /// The layer that is shown as a picture, brightened by `exposure` stops: sRGB codes of red, green and blue, pixel by pixel; `None` where
    /// there are no channels.
    pub fn srgb(&self, exposure: f32) -> Option<Vec<u8>> {
        let layer = self.shown_layer()?;
        let grey = *layer.first()?;
        let [red, green, blue] = [0, 1, 2].map(|c| *layer.get(c).unwrap_or(&grey));
        let scale = exposure.exp2();
        let code = |linear: &f32| (srgb_from_linear(linear * scale) * 255.0).round() as u8;
        let pixels = red.iter().zip(green).zip(blue);
        Some(pixels.flat_map(|((r, g), b)| [r, g, b].map(code)).collect())
    }

    /// The layer a picture of this image shows: the first of the table that it holds, else its first channel.
    pub fn shown_layer(&self) -> Option<Vec<&[f32]>> {
        LAYERS
            .iter()
            .find_map(|layer| self.layer(layer.name))
            .or_else(|| {
                self.channels
                    .values()
                    .next()
                    .map(|channel| vec![channel.as_slice()])
            })
    }

    /// Fails at the first value that is not finite.
    pub fn check_finite(&self) -> Result<(), RenderError> {
        for (name, values) in &self.channels {
            if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                let width = self.width.max(1);
                return Err(RenderError::NotFinite {
                    channel: name.clone(),
                    x: self.origin[0] + i % width,
                    y: self.origin[1] + i / width,
                    value: values.get(i).copied().unwrap_or(f32::NAN),
                });
            }
        }
        Ok(())
    }
}

/// The sRGB encoding of a linear value, clamped to [0, 1] (IEC 61966-2-1).
pub fn srgb_from_linear(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    if c <= 0.003_130_8 {
        12.92 * c
    } else {
        1.055 * c.powf(1.0 / 2.4) - 0.055
    }
}

/// The linear value of an sRGB-encoded one in [0, 1] (IEC 61966-2-1).
pub fn linear_from_srgb(srgb: f32) -> f32 {
    if srgb <= 0.040_45 {
        srgb / 12.92
    } else {
        ((srgb + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn image(channels: &[&str]) -> Image {
        let mut image = Image::new(2, 1);
        for (i, name) in channels.iter().enumerate() {
            image.channels.insert((*name).to_owned(), vec![i as f32; 2]);
        }
        image
    }

    #[test]
    fn layers_are_found_by_table_by_prefix_and_by_channel() {
        let image = image(&["R", "G", "B", "Z", "old.R", "old.G", "old.B", "mask"]);
        let first = |name| {
            image
                .layer(name)
                .map(|c| c.iter().map(|v| v[0]).collect::<Vec<_>>())
        };
        assert_eq!(first("beauty").unwrap(), [0.0, 1.0, 2.0]);
        assert_eq!(first("depth").unwrap(), [3.0]);
        assert_eq!(first("old").unwrap(), [4.0, 5.0, 6.0]);
        assert_eq!(first("mask").unwrap(), [7.0]);
        assert_eq!(first("single"), None);
    }

    #[test]
    fn a_picture_shows_the_first_layer_of_the_table() {
        assert_eq!(
            image(&["Z", "multiple.R", "multiple.G", "multiple.B"])
                .shown_layer()
                .unwrap()
                .len(),
            3
        );
        assert_eq!(image(&["Y"]).shown_layer().unwrap().len(), 1);
        assert!(image(&[]).shown_layer().is_none());
    }

    #[test]
    fn a_value_that_is_not_finite_is_reported_at_its_place_in_the_frame() {
        let mut image = image(&["R", "single.G"]);
        image.origin = [10, 20];
        image.channels.get_mut("single.G").unwrap()[1] = f32::INFINITY;
        let message = image.check_finite().unwrap_err().to_string();
        assert!(
            message.contains("single.G") && message.contains("(11, 20)"),
            "{message}"
        );
    }

    #[test]
    fn srgb_codes_survive_the_way_to_linear_and_back() {
        for code in 0..=255u8 {
            let linear = linear_from_srgb(f32::from(code) / 255.0);
            assert_eq!((srgb_from_linear(linear) * 255.0).round() as u8, code);
        }
        assert_eq!(srgb_from_linear(-1.0), 0.0);
        assert_eq!(srgb_from_linear(9.0), srgb_from_linear(1.0));
    }
}
