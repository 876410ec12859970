//! Reading environment images: `OpenEXR` and Radiance HDR.
//!
//! A file is distrusted: sizes are checked before memory is asked for, and every texel before it is believed.

use super::environment::EnvironmentImage;
use glam::Vec3;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Texels of the largest image that is read: 16384 × 8192.
const MAX_TEXELS: u64 = 1 << 27;

/// Texels that a byte of a file may stand for, beyond what is harmless: no codec packs real images a hundredth as tightly.
const TEXELS_PER_BYTE: u64 = 4096;
/// Texels that any file may claim: 48 MiB in memory.
const HARMLESS_TEXELS: u64 = 1 << 22;

/// Why an environment image cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// The file could not be read.
    #[error("cannot read the environment image: {source} ({})", path.display())]
    Read {
        /// What the operating system said.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },

    /// The file is neither `OpenEXR` nor Radiance HDR.
    #[error(
        "an environment image is an OpenEXR (.exr) or Radiance (.hdr) file, and this is neither by its first bytes; convert it, \
         for example with oiiotool or ImageMagick ({})",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },

    /// The file's own structure is at fault, or uses what the reader cannot do.
    #[error("cannot decode the environment image: {problem} ({})", path.display())]
    Decode {
        /// What the decoder said.
        problem: String,
        /// The file.
        path: PathBuf,
    },

    /// The image is larger than any that is read.
    #[error(
        "the environment image has {width} x {height} texels, more than the {MAX_TEXELS} allowed (16384 x 8192); scale it down \
         ({})",
        path.display()
    )]
    TooLarge {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// The file.
        path: PathBuf,
    },

    /// The image claims a size that its bytes cannot fill.
    #[error(
        "the environment image claims {width} x {height} texels but the file has only {bytes} bytes; it is broken or cut off \
         ({})",
        path.display()
    )]
    Implausible {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Size of the file.
        bytes: u64,
        /// The file.
        path: PathBuf,
    },

    /// Some texels are not numbers, or infinite.
    #[error(
        "{count} texels of the environment image are infinite or not a number, the first in column {column}, row {row} (from \
         the top left, counted from 0); repair the image, for example with oiiotool --fixnan box3 ({})",
        path.display()
    )]
    NotFinite {
        /// How many texels.
        count: usize,
        /// Column of the first.
        column: usize,
        /// Row of the first.
        row: usize,
        /// The file.
        path: PathBuf,
    },
}

/// Reads an equirectangular image of radiance; also says how many texels were negative and became 0.
///
/// `OpenEXR`: the first part with channels R, G and B, placed in the display window, which lossy compression may have given
/// small negative values. Radiance HDR: as it stands, without its exposure.
///
/// # Errors
/// The file cannot be read, is of another format, broken, larger than 2²⁷ texels, or holds NaN or infinity.
pub fn read_environment(path: &Path) -> Result<(EnvironmentImage, usize), EnvironmentError> {
    let read_error = |source| EnvironmentError::Read {
        source,
        path: path.into(),
    };
    let mut file = BufReader::new(File::open(path).map_err(read_error)?);
    let mut magic = [0; 4];
    let n_bytes = read_up_to(&mut file, &mut magic).map_err(read_error)?;
    let bytes = file.seek(SeekFrom::End(0)).map_err(read_error)?;
    file.seek(SeekFrom::Start(0)).map_err(read_error)?;
    let (width, height, mut texels) = match &magic[..n_bytes] {
        [0x76, 0x2f, 0x31, 0x01] => read_exr(file, bytes, path)?,
        [b'#', b'?', ..] => read_hdr(file, bytes, path)?,
        _ => return Err(EnvironmentError::UnknownFormat { path: path.into() }),
    };
    let is_bad = |texel: &Vec3| !texel.is_finite();
    if let Some(first) = texels.iter().position(is_bad) {
        return Err(EnvironmentError::NotFinite {
            count: texels.iter().filter(|texel| is_bad(texel)).count(),
            column: first % width,
            row: first / width,
            path: path.into(),
        });
    }
    let mut n_negative = 0;
    for texel in &mut texels {
        if texel.min_element() < 0.0 {
            *texel = texel.max(Vec3::ZERO);
            n_negative += 1;
        }
    }
    let image =
        EnvironmentImage::new(width, height, texels).ok_or_else(|| EnvironmentError::Decode {
            problem: format!("its size is {width} x {height} texels"),
            path: path.into(),
        })?;
    Ok((image, n_negative))
}

/// Fills `buffer` as far as the file reaches; returns how far.
fn read_up_to(file: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match file.read(&mut buffer[filled..])? {
            0 => break,
            n => filled += n,
        }
    }
    Ok(filled)
}

type Texels = (usize, usize, Vec<Vec3>);

/// Refuses sizes beyond [`MAX_TEXELS`], and those that a file of so many `bytes` cannot fill.
fn check_size(width: u64, height: u64, bytes: u64, path: &Path) -> Result<(), EnvironmentError> {
    let n_texels = width.saturating_mul(height);
    if n_texels > MAX_TEXELS {
        return Err(EnvironmentError::TooLarge {
            width,
            height,
            path: path.into(),
        });
    }
    if n_texels > HARMLESS_TEXELS + bytes.saturating_mul(TEXELS_PER_BYTE) {
        return Err(EnvironmentError::Implausible {
            width,
            height,
            bytes,
            path: path.into(),
        });
    }
    Ok(())
}

/// An image under construction: where the data window lies in the display window.
struct Canvas {
    width: usize,
    height: usize,
    offset: (i64, i64),
    texels: Vec<Vec3>,
}

fn read_exr(
    mut file: BufReader<File>,
    bytes: u64,
    path: &Path,
) -> Result<Texels, EnvironmentError> {
    use exr::prelude::{ReadChannels, ReadLayers, Vec2, read};
    let decode_error = |error: exr::error::Error| EnvironmentError::Decode {
        problem: error.to_string(),
        path: path.into(),
    };
    // Headers first: the pixel reader allocates before one can object.
    let meta = exr::meta::MetaData::read_from_buffered(&mut file, false).map_err(decode_error)?;
    for header in &meta.headers {
        let display = header.shared_attributes.display_window.size;
        for size in [display, header.layer_size] {
            check_size(size.0 as u64, size.1 as u64, bytes, path)?;
        }
    }
    let rgb = meta.headers.iter().find(|header| {
        ["R", "G", "B"].iter().all(|name| {
            let mut channels = header.channels.list.iter();
            channels.any(|channel| channel.name.eq(name))
        })
    });
    let Some(header) = rgb else {
        return Err(EnvironmentError::Decode {
            problem: "no part of it has channels R, G and B".into(),
            path: path.into(),
        });
    };
    let display = header.shared_attributes.display_window;
    let corner = header.own_attributes.layer_position;
    let offset = (
        i64::from(corner.0) - i64::from(display.position.0),
        i64::from(corner.1) - i64::from(display.position.1),
    );
    let (width, height) = (display.size.0, display.size.1);

    file.seek(SeekFrom::Start(0))
        .map_err(|source| EnvironmentError::Read {
            source,
            path: path.into(),
        })?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |_, _| Canvas {
                width,
                height,
                offset,
                texels: vec![Vec3::ZERO; width * height],
            },
            |canvas: &mut Canvas, Vec2(x, y): Vec2<usize>, (r, g, b): (f32, f32, f32)| {
                let column = usize::try_from(x as i64 + canvas.offset.0);
                let row = usize::try_from(y as i64 + canvas.offset.1);
                if let (Ok(column), Ok(row)) = (column, row)
                    && column < canvas.width
                    && row < canvas.height
                {
                    canvas.texels[row * canvas.width + column] = Vec3::new(r, g, b);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)
        .map_err(decode_error)?;
    Ok((width, height, image.layer_data.channel_data.pixels.texels))
}

fn read_hdr(file: BufReader<File>, bytes: u64, path: &Path) -> Result<Texels, EnvironmentError> {
    use image::ImageDecoder;
    let decode_error = |error: image::ImageError| EnvironmentError::Decode {
        problem: error.to_string(),
        path: path.into(),
    };
    let decoder = image::codecs::hdr::HdrDecoder::new(file).map_err(decode_error)?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into(), bytes, path)?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(decode_error)?;
    let texels = image
        .to_rgb32f()
        .pixels()
        .map(|p| Vec3::from(p.0))
        .collect();
    Ok((width as usize, height as usize, texels))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn shared(file: &str) -> Option<PathBuf> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../../shared/assets/envmaps")
            .join(file);
        path.exists().then_some(path)
    }

    fn write(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    fn exr_bytes(
        width: usize,
        height: usize,
        texel: impl Sync + Fn(usize, usize) -> Vec3,
    ) -> Vec<u8> {
        use exr::prelude::*;
        let mut bytes = std::io::Cursor::new(Vec::new());
        Image::from_channels(
            (width, height),
            SpecificChannels::rgb(|p: Vec2<usize>| {
                let t = texel(p.0, p.1);
                (t.x, t.y, t.z)
            }),
        )
        .write()
        .to_buffered(&mut bytes)
        .unwrap();
        bytes.into_inner()
    }

    #[test]
    fn an_exr_comes_back_texel_by_texel_with_negative_ones_counted_and_cleared() {
        let bytes = exr_bytes(3, 2, |x, y| {
            Vec3::new(x as f32, y as f32, -((x * y) as f32))
        });
        let (_folder, path) = write("sky.exr", &bytes);
        let (image, n_negative) = read_environment(&path).unwrap();
        assert_eq!(image.size(), (3, 2));
        // x y > 0 for two texels.
        assert_eq!(n_negative, 2);
        let light = super::super::EnvironmentLight::new(image, 1.0, 0.0);
        assert!(light.fluence().is_finite() && light.fluence().z == 0.0);
    }

    #[test]
    fn a_texel_that_is_not_finite_is_an_error_with_its_place() {
        let bytes = exr_bytes(4, 3, |x, y| {
            if (x, y) == (1, 2) {
                Vec3::new(0.0, f32::NAN, 0.0)
            } else {
                Vec3::ONE
            }
        });
        let (_folder, path) = write("sky.exr", &bytes);
        let error = read_environment(&path).unwrap_err().to_string();
        assert!(error.starts_with("1 texels of the environment image are infinite or not a number, the first in column 1, row 2"), "{error}");
    }

    #[test]
    fn other_files_and_missing_ones_are_clean_errors() {
        for bytes in [&b""[..], b"#", b"\x89PNG\r\n\x1a\n", b"hello world"] {
            let (_folder, path) = write("sky.exr", bytes);
            let error = read_environment(&path).unwrap_err();
            assert!(
                matches!(error, EnvironmentError::UnknownFormat { .. }),
                "{error}"
            );
        }
        let (folder, _) = write("sky.exr", b"");
        let error = read_environment(&folder.path().join("none.exr")).unwrap_err();
        assert!(error.to_string().contains("none.exr"), "{error}");
    }

    #[test]
    fn cut_and_altered_files_never_panic() {
        let whole = exr_bytes(8, 4, |x, y| Vec3::new(x as f32, y as f32, 1.0));
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x81\x80\x80\x80\x81\x80\x80\x80\x81";
        for original in [&whole[..], hdr] {
            for length in 0..original.len() {
                let (_folder, path) = write("cut", &original[..length]);
                // Whatever it says, it says it: a cut file may still hold all texels.
                let _ = read_environment(&path).map_err(|error| error.to_string());
            }
            for place in 0..original.len().min(600) {
                let mut bytes = original.to_vec();
                bytes[place] ^= 0xff;
                let (_folder, path) = write("altered", &bytes);
                let _ = read_environment(&path).map_err(|error| error.to_string());
            }
        }
        let (_folder, path) = write("sky.hdr", hdr);
        let (image, n_negative) = read_environment(&path).unwrap();
        assert_eq!((image.size(), n_negative), ((2, 2), 0));
    }

    #[test]
    fn an_absurd_size_is_refused_before_memory_is_asked_for() {
        let (_folder, path) = write(
            "sky.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n\x02\x02",
        );
        let error = read_environment(&path).unwrap_err();
        assert!(
            matches!(error, EnvironmentError::TooLarge { .. }),
            "{error}"
        );
    }

    #[test]
    fn shared_images_load_or_say_why_not() {
        for (file, says) in [
            ("spiaggia_di_mondello_1k.hdr", None),
            ("blender_studiolights/sunset.exr", None),
            ("pmndrs_dwab/city.exr", None),
            ("exr_edge_cases/carPark.exr", None),
            ("exr_edge_cases/incomplete.exr", Some("cannot decode")),
            (
                "exr_edge_cases/tiledDeepComplete.exr",
                Some("cannot decode"),
            ),
            (
                "exr_edge_cases/AllHalfValues.exr",
                Some("infinite or not a number"),
            ),
        ] {
            let Some(path) = shared(file) else { continue };
            match (read_environment(&path), says) {
                (Ok((image, _)), None) => {
                    let (width, height) = image.size();
                    let light = super::super::EnvironmentLight::new(image, 1.0, 0.0);
                    assert!(light.fluence().min_element() > 0.0, "{file}");
                    assert!(width >= height, "{file}");
                }
                (Err(error), Some(says)) => assert!(error.to_string().contains(says), "{error}"),
                (result, _) => panic!("{file}: {:?}", result.map(|(image, _)| image.size())),
            }
        }
    }
}
