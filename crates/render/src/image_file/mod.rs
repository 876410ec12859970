//! Image files: EXR and PNG out, those and Radiance HDR and JPEG in.
//!
//! A file is written beside its place and renamed, so that it appears whole or not at all.

mod exr_file;
mod png_file;
mod replace;

pub(crate) use replace::replace_file_through;
pub use replace::{check_place, replace_file};

use crate::error::RenderError;
use crate::image::Image;
use std::path::Path;

/// The formats that images are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// 32-bit float, linear, every layer.
    Exr,
    /// 8 bits, exposed, sRGB, one layer.
    Png,
}

impl ImageFormat {
    /// The format that a file's name ends in.
    pub fn of(path: &Path) -> Result<Self, RenderError> {
        let ending = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(RenderError::OutputEnding {
                path: path.to_owned(),
            }),
        }
    }
}

/// How an image is written.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Stops by which a PNG is brightened; EXR files hold radiances and ignore it.
    pub exposure: f32,
    /// How the image came about, as RON; EXR files keep it in the attribute `tyndall`.
    pub metadata: Option<String>,
}

/// Finds out whether `path` names a known format and its folder can be written to, before anyone waits for an image.
pub fn check_writable(path: &Path) -> Result<(), RenderError> {
    ImageFormat::of(path)?;
    check_place(path)
}

/// Writes `image` in the format that `path` ends in; the file appears whole or not at all.
pub fn write_image(path: &Path, image: &Image, options: &WriteOptions) -> Result<(), RenderError> {
    image.check_finite()?;
    match ImageFormat::of(path)? {
        ImageFormat::Exr => replace_file(path, |file| exr_file::write(file, image, options)),
        ImageFormat::Png => {
            replace_file(path, |file| png_file::write(file, image, options.exposure))
        }
    }
}

/// Reads an image of linear values: any flat EXR file as it stands, the formats of 8 or 16 bits through the sRGB curve.
pub fn read_image(path: &Path) -> Result<Image, RenderError> {
    let error = |reason: String| RenderError::Read {
        path: path.to_owned(),
        reason,
    };
    let bytes = std::fs::read(path).map_err(|e| error(e.to_string()))?;
    if exr_file::is_exr(&bytes) {
        exr_file::read(&bytes).map_err(error)
    } else {
        png_file::read(&bytes).map_err(error)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn gradient(width: usize, height: usize, names: &[&str]) -> Image {
        let mut image = Image::new(width, height);
        for (c, name) in names.iter().enumerate() {
            let values = (0..width * height)
                .map(|i| i as f32 * 0.01 + c as f32 * 0.1)
                .collect();
            image.channels.insert((*name).to_owned(), values);
        }
        image
    }

    #[test]
    fn an_exr_file_gives_back_every_bit_and_its_place_in_the_frame() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a b ü.exr");
        let mut image = gradient(
            5,
            3,
            &[
                "R",
                "G",
                "B",
                "surface.R",
                "surface.G",
                "surface.B",
                "Z",
                "samples",
            ],
        );
        image.origin = [7, 2];
        image.frame = [40, 30];
        let options = WriteOptions {
            metadata: Some("(seed: 1)".to_owned()),
            ..WriteOptions::default()
        };
        check_writable(&path).unwrap();
        write_image(&path, &image, &options).unwrap();
        assert_eq!(read_image(&path).unwrap(), image);
        let left: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|f| f.unwrap().file_name())
            .collect();
        assert_eq!(left, ["a b ü.exr"], "only the finished file stays");
    }

    #[test]
    fn two_writes_of_one_image_give_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let image = gradient(70, 40, &["R", "G", "B", "single.R", "single.G", "single.B"]);
        let options = WriteOptions {
            metadata: Some("(seed: 1)".to_owned()),
            ..WriteOptions::default()
        };
        let bytes = ["one.exr", "two.exr"].map(|name| {
            write_image(&folder.path().join(name), &image, &options).unwrap();
            std::fs::read(folder.path().join(name)).unwrap()
        });
        assert!(bytes[0] == bytes[1]);
    }

    #[test]
    fn a_png_file_holds_the_exposed_srgb_codes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.PNG");
        let mut image = Image::new(3, 1);
        for name in ["R", "G", "B"] {
            image
                .channels
                .insert(name.to_owned(), vec![0.0, 0.107_023, 4.0]);
        }
        // 2 × 0.107023 is the linear value of sRGB code 128 (0.215861) to within a quarter of a code.
        write_image(
            &path,
            &image,
            &WriteOptions {
                exposure: 1.0,
                metadata: None,
            },
        )
        .unwrap();
        let codes = image::open(&path).unwrap().to_rgb8();
        let codes: Vec<u8> = codes.pixels().map(|p| p.0[1]).collect();
        assert!(
            codes[0] == 0 && codes[1].abs_diff(127) <= 1 && codes[2] == 255,
            "{codes:?}"
        );
        let read = read_image(&path).unwrap();
        assert_eq!(read.layer("beauty").unwrap()[0][2], 1.0);
    }

    #[test]
    fn a_grey_layer_becomes_a_grey_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("z.png");
        write_image(&path, &gradient(4, 4, &["Z"]), &WriteOptions::default()).unwrap();
        assert_eq!(image::open(&path).unwrap().width(), 4);
    }

    #[test]
    fn an_image_with_nan_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.exr");
        let mut image = gradient(4, 4, &["R", "G", "B"]);
        image.channels.get_mut("G").unwrap()[6] = f32::NAN;
        let error = write_image(&path, &image, &WriteOptions::default()).unwrap_err();
        assert!(error.to_string().contains("`G` at pixel (2, 1)"), "{error}");
        assert!(!error.is_input() && !path.exists());
    }

    #[test]
    fn a_place_that_cannot_be_written_to_is_found_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no such folder").join("x.exr");
        assert!(
            check_writable(&missing)
                .unwrap_err()
                .to_string()
                .contains("no such folder")
        );
        std::fs::create_dir(folder.path().join("folder.exr")).unwrap();
        assert!(check_writable(&folder.path().join("folder.exr")).is_err());
        for name in ["x", "x.jpg", "x.exr.txt", ".exr"] {
            let message = check_writable(&folder.path().join(name))
                .unwrap_err()
                .to_string();
            assert!(message.contains(".exr or .png"), "{message}");
        }
    }

    #[test]
    fn broken_files_give_a_message() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.exr");
        write_image(
            &path,
            &gradient(40, 40, &["R", "G", "B"]),
            &WriteOptions::default(),
        )
        .unwrap();
        let whole = std::fs::read(&path).unwrap();
        for n in [0, 3, 4, 40, 200, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..n]).unwrap();
            assert!(read_image(&path).is_err(), "cut after {n} bytes");
        }
        std::fs::remove_file(&path).unwrap();
        assert!(read_image(&path).unwrap_err().is_input());
    }
}
