//! Pictures for people: PNG out; PNG, JPEG and Radiance HDR in.
//!
//! Files of 8 or 16 bits are taken as sRGB, whatever profile they name; HDR files are linear.

use crate::image::{Image, linear_from_srgb};
use image::{DynamicImage, ImageBuffer, ImageFormat, ImageReader, Rgb};
use std::io::{Cursor, Seek, Write};

/// Writes the layer that `image` shows, brightened by `exposure` stops.
pub(super) fn write(
    mut file: impl Write + Seek,
    image: &Image,
    exposure: f32,
) -> Result<(), String> {
    let codes = image.srgb(exposure).ok_or("the image has no channels")?;
    let size =
        |n: usize| u32::try_from(n).map_err(|_| "the image is too large for a PNG file".to_owned());
    ImageBuffer::<Rgb<u8>, Vec<u8>>::from_raw(size(image.width)?, size(image.height)?, codes)
        .ok_or("the image's channels do not fit its size")?
        .write_to(&mut file, ImageFormat::Png)
        .map_err(|e| e.to_string())
}

/// Reads the colours of any picture format that this build knows.
pub(super) fn read(bytes: &[u8]) -> Result<Image, String> {
    let reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let Some(format) = reader.format() else {
        return Err("it is no EXR, PNG, JPEG or HDR file".to_owned());
    };
    let picture = reader.decode().map_err(|e| e.to_string())?;
    let linear = matches!(
        picture,
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)
    ) || format == ImageFormat::Hdr;
    let pixels = picture.into_rgb32f();
    let mut image = Image::new(pixels.width() as usize, pixels.height() as usize);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let decode = |p: &Rgb<f32>| {
            if linear {
                p.0[c]
            } else {
                linear_from_srgb(p.0[c])
            }
        };
        image
            .channels
            .insert(name.to_owned(), pixels.pixels().map(decode).collect());
    }
    Ok(image)
}
