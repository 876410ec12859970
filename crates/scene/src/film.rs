//! How many pixels an image has.

use std::fmt;

/// Most pixels along one side.
pub const MAX_SIDE: u32 = 1 << 16;

/// Most pixels in one image: 16384 × 16384.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Width and height of an image in pixels, each from 1 to [`MAX_SIDE`] and together at most [`MAX_PIXELS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmSize {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
}

impl FilmSize {
    /// A film of `width` × `height` pixels.
    ///
    /// # Errors
    /// Says what is allowed where a side or the whole is too small or too large.
    pub fn new(width: u32, height: u32) -> Result<Self, FilmSizeError> {
        let sides = 1..=MAX_SIDE;
        if sides.contains(&width)
            && sides.contains(&height)
            && u64::from(width) * u64::from(height) <= MAX_PIXELS
        {
            Ok(Self { width, height })
        } else {
            Err(FilmSizeError { width, height })
        }
    }
}

impl Default for FilmSize {
    /// 1024 × 768.
    fn default() -> Self {
        Self {
            width: 1024,
            height: 768,
        }
    }
}

impl fmt::Display for FilmSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {}", self.width, self.height)
    }
}

/// A size that no film can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a film of {width} × {height} pixels cannot be: each side has 1 to {MAX_SIDE} pixels, and width × height is at most \
     {MAX_PIXELS} (16384 × 16384)"
)]
pub struct FilmSizeError {
    /// The width asked for.
    pub width: u32,
    /// The height asked for.
    pub height: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked_by_side_and_by_area() {
        for (width, height, fits) in [
            (1, 1, true),
            (1024, 768, true),
            (16384, 16384, true),
            (65536, 4096, true),
            (1, 65536, true),
            (0, 10, false),
            (10, 0, false),
            (65537, 1, false),
            (16384, 16385, false),
            (u32::MAX, u32::MAX, false),
        ] {
            assert_eq!(
                FilmSize::new(width, height).is_ok(),
                fits,
                "{width} {height}"
            );
        }
    }
}
