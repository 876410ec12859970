//! Light from all directions by an equirectangular image.
//!
//! Sampling follows the image: texels in proportion to the light they send, and between them as the light varies.

use super::sky::surface_share;
use glam::{DVec3, Vec3};
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use tyndall_math::{Distribution2D, Ray};
use tyndall_transport::LightSample;
use tyndall_transport::importance::mean;

/// Largest radiance of a texel, W/(m² sr); the sun's disc has 2·10⁷.
const BRIGHTEST: f32 = 1e30;

/// Radiance of the brightest texel over the mean, up to which an image is even.
const EVEN: f32 = 10.0;

/// An equirectangular image of radiance, W/(m² sr), row 0 towards +Y.
#[derive(Clone, Debug)]
pub struct EnvironmentImage {
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
}

impl EnvironmentImage {
    /// An image of `width` × `height` texels in rows from the top; `None` where the sizes disagree or are zero.
    ///
    /// Every texel must be finite and not negative; [`read_environment`](super::read_environment) sees to it for files.
    pub fn new(width: usize, height: usize, texels: Vec<Vec3>) -> Option<Self> {
        debug_assert!(
            texels
                .iter()
                .all(|t| t.is_finite() && t.min_element() >= 0.0)
        );
        (width > 0 && width.checked_mul(height) == Some(texels.len()) && height > 0).then_some(
            Self {
                width,
                height,
                texels,
            },
        )
    }

    /// Width and height in texels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The four texels around (u, v) in [0, 1]²; columns wrap around, rows end at the poles.
    fn around(&self, u: f32, v: f32) -> Around {
        let x = u * self.width as f32 - 0.5;
        let y = v * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let column = |x: f32| (x as i64).rem_euclid(self.width as i64) as usize;
        let row = |y: f32| (y as i64).clamp(0, self.height as i64 - 1) as usize;
        let columns = [column(x0), column(x0 + 1.0)];
        let rows = [row(y0), row(y0 + 1.0)];
        Around {
            rows,
            texels: rows.map(|row| columns.map(|x| self.texels[row * self.width + x])),
            within: [x - x0, y - y0],
        }
    }
}

/// Four texels around a point, and the point's place between them.
struct Around {
    rows: [usize; 2],
    texels: [[Vec3; 2]; 2],
    within: [f32; 2],
}

impl Around {
    /// Bilinear interpolation of the texels, each row multiplied by a factor of its own.
    fn interpolate(&self, row_factor: impl Fn(usize) -> f32) -> Vec3 {
        let [x, y] = self.within;
        let [top, bottom] =
            [0, 1].map(|i| self.texels[i][0].lerp(self.texels[i][1], x) * row_factor(self.rows[i]));
        top.lerp(bottom, y)
    }
}

/// An environment image placed around the scene.
///
/// The centre of the image lies towards −Z, u grows towards +X, and `rotation` turns the image counter-clockwise as seen
/// from above: with φ the azimuth from −Z towards +X and θ the angle from +Y,
///
/// u = 1/2 + (φ + rotation)/2π,  v = θ/π.
///
/// Radiance is bilinear between texel centres, that is, a sum of tents over the texels. So is the density in (u, v): a
/// texel is picked in proportion to its sum of channels × the solid angle of its row, then a point under its tent.
/// Radiance over density is then the same everywhere, but for colour and the change of sinθ within a row.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    image: EnvironmentImage,
    /// Radians, counter-clockwise seen from above.
    rotation: f32,
    /// `None` where the image is black.
    texels: Option<Distribution2D>,
    /// Density over (u, v) of a texel with channels that sum to 1, for each row.
    row_densities: Vec<f32>,
    fluence: Vec3,
    /// Greatest radiance of a texel, mean of the channels.
    brightest: f32,
}

impl EnvironmentLight {
    /// Puts `image` around the scene, its radiance multiplied by `scale` and turned by `rotation` radians.
    pub fn new(mut image: EnvironmentImage, scale: f32, rotation: f32) -> Self {
        for texel in &mut image.texels {
            // Bounded, so that sums over the image stay finite.
            *texel = (*texel * scale).min(Vec3::splat(BRIGHTEST));
        }
        let brightest = image
            .texels
            .iter()
            .map(|&texel| mean(texel))
            .fold(0.0, f32::max);
        let (width, height) = image.size();
        // ΔφΔcosθ, in which the difference of cosines is 2 sin θ sin(Δθ/2) at the middle of the row.
        let row_angle = std::f64::consts::PI / height as f64;
        let solid_angle = |row: usize| {
            let theta = row_angle * (row as f64 + 0.5);
            std::f64::consts::TAU / width as f64 * 2.0 * theta.sin() * (0.5 * row_angle).sin()
        };
        let mut fluence = DVec3::ZERO;
        let mut weights = Vec::with_capacity(image.texels.len());
        for (y, row) in image.texels.chunks(width).enumerate() {
            for texel in row {
                let light = texel.as_dvec3() * solid_angle(y);
                fluence += light;
                weights.push(light.element_sum() as f32);
            }
        }
        let n_texels = image.texels.len() as f64;
        let total = fluence.element_sum();
        Self {
            texels: Distribution2D::new(&weights, width),
            row_densities: (0..height)
                .map(|row| (n_texels * solid_angle(row) / total) as f32)
                .collect(),
            image,
            rotation,
            fluence: fluence.as_vec3(),
            brightest,
        }
    }

    /// The image, already scaled.
    pub fn image(&self) -> &EnvironmentImage {
        &self.image
    }

    /// Integral of the radiance over all directions, W/m².
    pub fn fluence(&self) -> Vec3 {
        self.fluence
    }

    /// Whether no part of the image is much brighter than the mean, as a sun would be: directions drawn evenly then meet its light as well
    /// as any.
    pub fn is_even(&self) -> bool {
        self.brightest <= EVEN * mean(self.fluence) / (4.0 * PI)
    }

    /// Radiance from direction `w_i`, W/(m² sr).
    pub fn radiance(&self, w_i: Vec3) -> Vec3 {
        let [u, v] = self.image_from_direction(w_i);
        self.image.around(u, v).interpolate(|_| 1.0)
    }

    pub(super) fn importance(&self, _p: Vec3, normal: Option<Vec3>) -> f32 {
        mean(self.fluence) * surface_share(normal)
    }

    pub(super) fn importance_along(&self, _ray: &Ray, t_max: f32) -> f32 {
        mean(self.fluence) * t_max
    }

    pub(super) fn sample(&self, _p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let ([x, y], _) = self.texels.as_ref()?.sample(u);
        let u = under_tent(x, self.image.width);
        // A tent that reaches beyond a pole is folded back, as rows beyond it repeat the last.
        let v = under_tent(y, self.image.height).abs();
        let v = 1.0 - (1.0 - v).abs();
        let w_i = self.direction_from_image(u, v);
        let pdf = self.pdf(w_i);
        (pdf > 0.0 && pdf.is_finite()).then(|| LightSample {
            w_i,
            distance: f32::INFINITY,
            radiance: self.radiance(w_i),
            pdf,
            delta: false,
            normal: Vec3::ZERO,
            size: 0.0,
        })
    }

    pub(super) fn pdf(&self, w_i: Vec3) -> f32 {
        if self.texels.is_none() {
            return 0.0;
        }
        let [u, v] = self.image_from_direction(w_i);
        let density = self
            .image
            .around(u, v)
            .interpolate(|row| self.row_densities[row])
            .element_sum();
        // dω = 2π² sinθ du dv.
        density / (2.0 * PI * PI * w_i.x.hypot(w_i.z))
    }

    fn image_from_direction(&self, w: Vec3) -> [f32; 2] {
        let phi = w.x.atan2(-w.z);
        let theta = w.x.hypot(w.z).atan2(w.y);
        let u = (0.5 + (phi + self.rotation) / TAU).rem_euclid(1.0);
        // rem_euclid of a tiny negative number rounds to 1.
        [if u < 1.0 { u } else { 0.0 }, theta * FRAC_1_PI]
    }

    fn direction_from_image(&self, u: f32, v: f32) -> Vec3 {
        let (sin_phi, cos_phi) = ((u - 0.5) * TAU - self.rotation).sin_cos();
        let (sin_theta, cos_theta) = (v * PI).sin_cos();
        Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
    }
}

/// Moves `x` in [0, 1), even over one of `n` cells, to a point under the tent that reaches one cell to either side of the
/// cell's centre.
fn under_tent(x: f32, n: usize) -> f32 {
    let x = f64::from(x) * n as f64;
    let cell = x.floor();
    let within = x - cell;
    let offset = if within < 0.5 {
        (2.0 * within).sqrt() - 1.0
    } else {
        1.0 - (2.0 * (1.0 - within)).sqrt()
    };
    ((cell + 0.5 + offset) / n as f64) as f32
}
