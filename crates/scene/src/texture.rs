//! Eight-bit images on surfaces: storage, filtering and what happens beyond the edges.
//!
//! Texels stay as the file holds them; colour maps become linear at lookup, through a table, before they are filtered.

use glam::{Mat2, Vec2, Vec4};
use std::sync::LazyLock;

/// An image as RGBA texels of 8 bits, row 0 on top.
#[derive(Clone, Debug)]
pub struct Texture {
    width: u32,
    height: u32,
    texels: Vec<[u8; 4]>,
}

/// What a texture coordinate outside [0, 1] means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, every second time mirrored.
    Mirror,
    /// The edge texels extend.
    Clamp,
}

/// How texels become a continuous function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Bilinear interpolation between texel centres.
    #[default]
    Linear,
    /// The texel that holds the point.
    Nearest,
}

/// How a material reads a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the scene's textures.
    pub texture: u32,
    /// Which of the mesh's two sets of texture coordinates is used.
    pub tex_coord: usize,
    /// Scale and rotation of the texture coordinates (`KHR_texture_transform`).
    pub transform: Mat2,
    /// Offset added after `transform`.
    pub offset: Vec2,
    /// What lies beyond the image, in u and in v.
    pub wrap: [Wrap; 2],
    /// Interpolation between texels.
    pub filter: Filter,
}

impl TextureRef {
    /// The whole of `texture` on the first set of coordinates, repeating.
    pub fn new(texture: u32) -> Self {
        Self {
            texture,
            tex_coord: 0,
            transform: Mat2::IDENTITY,
            offset: Vec2::ZERO,
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Linear,
        }
    }

    /// The filtered value of a colour map: RGB turned from sRGB to linear, alpha as it stands.
    pub fn color(&self, textures: &[Texture], uv: &[Vec2; 2]) -> Vec4 {
        self.sample(textures, uv, linear_from_srgb_texel)
    }

    /// The filtered value of a map of numbers (metallic, roughness): texel / 255.
    pub fn data(&self, textures: &[Texture], uv: &[Vec2; 2]) -> Vec4 {
        self.sample(textures, uv, |texel| {
            Vec4::from_array(texel.map(f32::from)) / 255.0
        })
    }

    fn sample(&self, textures: &[Texture], uv: &[Vec2; 2], decode: fn([u8; 4]) -> Vec4) -> Vec4 {
        let image = &textures[self.texture as usize];
        let uv = self.transform * uv[self.tex_coord] + self.offset;
        let texel = |x: f32, y: f32| decode(image.texel(self.wrap, x, y));
        let p = uv * Vec2::new(image.width as f32, image.height as f32);
        // An overflow must not become a NaN in the image.
        let p = if p.is_finite() { p } else { Vec2::ZERO };
        match self.filter {
            Filter::Nearest => {
                let corner = p.floor();
                texel(corner.x, corner.y)
            }
            Filter::Linear => {
                let p = p - 0.5;
                let corner = p.floor();
                let f = p - corner;
                let row = |y: f32| texel(corner.x, y).lerp(texel(corner.x + 1.0, y), f.x);
                row(corner.y).lerp(row(corner.y + 1.0), f.y)
            }
        }
    }
}

impl Texture {
    /// An image of `width` × `height` texels in rows from the top; `None` where the sizes disagree or are zero.
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Option<Self> {
        let n_texels = u64::from(width) * u64::from(height);
        (n_texels > 0 && n_texels == texels.len() as u64).then_some(Self {
            width,
            height,
            texels,
        })
    }

    /// One white texel: what stands in for an image that cannot be read.
    pub fn white() -> Self {
        Self {
            width: 1,
            height: 1,
            texels: vec![[255; 4]],
        }
    }

    /// Width and height in texels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Memory held by the texels, in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.texels.as_slice())
    }

    /// The texel in column `x` and row `y`, both whole numbers.
    fn texel(&self, wrap: [Wrap; 2], x: f32, y: f32) -> [u8; 4] {
        let column = wrap[0].apply(x, self.width);
        let row = wrap[1].apply(y, self.height);
        self.texels[row * self.width as usize + column]
    }
}

impl Wrap {
    /// The texel that stands at the whole number `i` along an edge of `n` texels.
    fn apply(self, i: f32, n: u32) -> usize {
        // Casts from floats saturate, so any coordinate gives a texel.
        let i = i as i64;
        let n = i64::from(n);
        let wrapped = match self {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Mirror => {
                let j = i.rem_euclid(2 * n);
                j.min(2 * n - 1 - j)
            }
            Wrap::Clamp => i.clamp(0, n - 1),
        };
        wrapped as usize
    }
}

/// Linear value of an 8-bit sRGB code value: the decoding function of IEC 61966-2-1.
pub fn linear_from_srgb(code: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> = LazyLock::new(|| {
        std::array::from_fn(|code| {
            let s = code as f64 / 255.0;
            let linear = if s <= 0.04045 {
                s / 12.92
            } else {
                ((s + 0.055) / 1.055).powf(2.4)
            };
            linear as f32
        })
    });
    TABLE[usize::from(code)]
}

fn linear_from_srgb_texel([r, g, b, a]: [u8; 4]) -> Vec4 {
    Vec4::new(
        linear_from_srgb(r),
        linear_from_srgb(g),
        linear_from_srgb(b),
        f32::from(a) / 255.0,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two by two texels: black, red / green, blue.
    fn image() -> Vec<Texture> {
        let texels = vec![
            [0, 0, 0, 255],
            [255, 0, 0, 255],
            [0, 255, 0, 255],
            [0, 0, 255, 128],
        ];
        Texture::new(2, 2, texels).into_iter().collect()
    }

    fn color(wrap: Wrap, filter: Filter, u: f32, v: f32) -> Vec4 {
        let reference = TextureRef {
            wrap: [wrap; 2],
            filter,
            ..TextureRef::new(0)
        };
        reference.color(&image(), &[Vec2::new(u, v), Vec2::ZERO])
    }

    #[test]
    fn srgb_codes_decode_to_the_standards_values() {
        // IEC 61966-2-1: ends, the last code of the linear piece, and 188 (half of full scale to within a code).
        for (code, linear) in [
            (0, 0.0),
            (255, 1.0),
            (10, 10.0 / 255.0 / 12.92),
            (188, 0.502_886_5),
        ] {
            assert!((linear_from_srgb(code) - linear).abs() < 1e-6, "{code}");
        }
    }

    #[test]
    fn texel_centres_give_texels_and_row_zero_is_the_top() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Linear, Filter::Nearest] {
                assert_eq!(color(wrap, filter, 0.75, 0.25), Vec4::new(1., 0., 0., 1.));
                assert_eq!(color(wrap, filter, 0.25, 0.75), Vec4::new(0., 1., 0., 1.));
            }
        }
    }

    #[test]
    fn the_middle_of_four_texels_is_their_mean() {
        let mean = Vec4::new(0.25, 0.25, 0.25, (3.0 + 128.0 / 255.0) / 4.0);
        assert!((color(Wrap::Repeat, Filter::Linear, 0.5, 0.5) - mean).length() < 1e-6);
    }

    #[test]
    fn coordinates_outside_the_image_repeat_mirror_or_clamp() {
        let red = Vec4::new(1.0, 0.0, 0.0, 1.0);
        let black = Vec4::new(0.0, 0.0, 0.0, 1.0);
        for (wrap, u, expected) in [
            (Wrap::Repeat, 1.75, red),
            (Wrap::Repeat, -0.25, red),
            (Wrap::Repeat, 1.25, black),
            (Wrap::Mirror, 1.25, red),
            (Wrap::Mirror, -0.25, black),
            (Wrap::Mirror, 2.25, black),
            (Wrap::Clamp, 7.0, red),
            (Wrap::Clamp, -7.0, black),
        ] {
            let found = color(wrap, Filter::Nearest, u, 0.25);
            assert_eq!(found, expected, "{wrap:?} {u}");
        }
    }

    #[test]
    fn any_coordinate_gives_a_finite_colour() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -3e38] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                assert!(color(wrap, Filter::Nearest, bad, bad).is_finite());
                assert!(color(wrap, Filter::Linear, bad, bad).is_finite());
            }
        }
    }

    #[test]
    fn transforms_scale_then_rotate_then_move_the_coordinates() {
        let quarter_turn = Mat2::from_cols(Vec2::new(0.0, -1.0), Vec2::new(1.0, 0.0));
        let reference = TextureRef {
            transform: quarter_turn * Mat2::from_diagonal(Vec2::new(0.5, 1.0)),
            offset: Vec2::new(0.0, 1.0),
            filter: Filter::Nearest,
            ..TextureRef::new(0)
        };
        // (0.5, 0.75) scaled is (0.25, 0.75), turned (0.75, -0.25), moved (0.75, 0.75): the blue texel.
        let found = reference.data(&image(), &[Vec2::new(0.5, 0.75), Vec2::ZERO]);
        assert_eq!(found, Vec4::new(0.0, 0.0, 1.0, 128.0 / 255.0));
    }

    #[test]
    fn sizes_that_disagree_with_the_texels_are_refused() {
        assert!(Texture::new(0, 0, Vec::new()).is_none());
        assert!(Texture::new(2, 1, vec![[0; 4]]).is_none());
        assert!(Texture::new(u32::MAX, u32::MAX, vec![[0; 4]]).is_none());
    }
}
