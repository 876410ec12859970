//! Light from all directions by an equirectangular image.
//!
//! Sampling follows the image: cells of the sphere, one per texel, in proportion to the light they send.

use super::mean;
use super::sky::surface_share;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};
use tyndall_math::{Distribution2D, Ray};
use tyndall_transport::LightSample;

/// Largest radiance of a texel, W/(m² sr); the sun's disc has 2·10⁷.
const BRIGHTEST: f32 = 1e30;

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

    fn texel(&self, x: usize, y: usize) -> Vec3 {
        self.texels[y * self.width + x]
    }

    /// Radiance at (u, v) in [0, 1]², bilinear between texel centres; u wraps around, v ends at the poles.
    fn lookup(&self, u: f32, v: f32) -> Vec3 {
        let x = u * self.width as f32 - 0.5;
        let y = v * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let column = |x: f32| (x as i64).rem_euclid(self.width as i64) as usize;
        let row = |y: f32| (y as i64).clamp(0, self.height as i64 - 1) as usize;
        let (left, right) = (column(x0), column(x0 + 1.0));
        let along = |y: usize| self.texel(left, y).lerp(self.texel(right, y), x - x0);
        along(row(y0)).lerp(along(row(y0 + 1.0)), y - y0)
    }

    /// Mean of the bilinear function over the cell of a texel.
    ///
    /// A cell reaches half a texel to either side of its texel's centre, so the neighbours on either side weigh 1/8 and the
    /// texel itself 6/8, in both directions. It is 0 only where the whole cell is black.
    fn cell(&self, x: usize, y: usize) -> Vec3 {
        let columns = [(x + self.width - 1) % self.width, x, (x + 1) % self.width];
        let rows = [y.saturating_sub(1), y, (y + 1).min(self.height - 1)];
        let weights = [0.125, 0.75, 0.125];
        let mut sum = Vec3::ZERO;
        for (row, row_weight) in rows.into_iter().zip(weights) {
            for (column, weight) in columns.into_iter().zip(weights) {
                sum += self.texel(column, row) * (weight * row_weight);
            }
        }
        sum
    }
}

/// An environment image placed around the scene.
///
/// The centre of the image lies towards −Z, u grows towards +X, and `rotation` turns the image counter-clockwise as seen
/// from above: with φ the azimuth from −Z towards +X and θ the angle from +Y,
///
/// u = 1/2 + (φ + rotation)/2π,  v = θ/π.
///
/// Directions are sampled by cell, one per texel: a cell with probability ∝ its mean radiance × its solid angle
/// ΔφΔcosθ, and within it uniformly in φ and cosθ. The density on the sphere is then constant over each cell, without
/// poles.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    image: EnvironmentImage,
    /// Radians, counter-clockwise seen from above.
    rotation: f32,
    /// `None` where the image is black.
    cells: Option<Distribution2D>,
    /// cosθ of the edges between rows; in f64, because close to the poles neighbours differ by 1/height² and less.
    row_cosines: Vec<f64>,
    /// 1 / solid angle of a cell in each row.
    row_densities: Vec<f32>,
    fluence: Vec3,
}

impl EnvironmentLight {
    /// Puts `image` around the scene, its radiance multiplied by `scale` and turned by `rotation` radians.
    pub fn new(mut image: EnvironmentImage, scale: f32, rotation: f32) -> Self {
        for texel in &mut image.texels {
            // Bounded, so that sums over the image stay finite.
            *texel = (*texel * scale).min(Vec3::splat(BRIGHTEST));
        }
        let (width, height) = image.size();
        let cosine = |row: usize| (std::f64::consts::PI * row as f64 / height as f64).cos();
        let solid_angle =
            |row: usize| std::f64::consts::TAU / width as f64 * (cosine(row) - cosine(row + 1));
        let mut fluence = glam::DVec3::ZERO;
        let mut weights = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let light = image.cell(x, y).as_dvec3() * solid_angle(y);
                fluence += light;
                weights.push(light.element_sum() as f32);
            }
        }
        Self {
            cells: Distribution2D::new(&weights, width),
            row_cosines: (0..=height).map(cosine).collect(),
            row_densities: (0..height)
                .map(|row| (1.0 / solid_angle(row)) as f32)
                .collect(),
            image,
            rotation,
            fluence: fluence.as_vec3(),
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

    /// Radiance from direction `w_i`, W/(m² sr).
    pub fn radiance(&self, w_i: Vec3) -> Vec3 {
        let [u, v] = self.image_from_direction(w_i);
        self.image.lookup(u, v)
    }

    pub(super) fn importance(&self, _p: Vec3, normal: Option<Vec3>) -> f32 {
        mean(self.fluence) * surface_share(normal)
    }

    pub(super) fn importance_along(&self, _ray: &Ray, t_max: f32) -> f32 {
        mean(self.fluence) * t_max
    }

    pub(super) fn sample(&self, _p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let ([u, v], _) = self.cells.as_ref()?.sample(u);
        let row = self.row(v);
        let within = f64::from(v) * self.image.height as f64 - row as f64;
        let (above, below) = (self.row_cosines[row], self.row_cosines[row + 1]);
        let cos_theta = above + (below - above) * within;
        let w_i = self.direction_from_image(u, cos_theta);
        let pdf = self.pdf(w_i);
        (pdf > 0.0).then(|| LightSample {
            w_i,
            distance: f32::INFINITY,
            radiance: self.radiance(w_i),
            pdf,
            delta: false,
            normal: Vec3::ZERO,
        })
    }

    pub(super) fn pdf(&self, w_i: Vec3) -> f32 {
        let Some(cells) = &self.cells else {
            return 0.0;
        };
        let [u, v] = self.image_from_direction(w_i);
        // The distribution's density is over the unit square, in which a cell covers 1 / (width height).
        let n_cells = (self.image.width * self.image.height) as f32;
        cells.pdf([u, v]) / n_cells * self.row_densities[self.row(v)]
    }

    fn row(&self, v: f32) -> usize {
        ((v * self.image.height as f32) as usize).min(self.image.height - 1)
    }

    fn image_from_direction(&self, w: Vec3) -> [f32; 2] {
        let phi = w.x.atan2(-w.z);
        let theta = w.x.hypot(w.z).atan2(w.y);
        let u = (0.5 + (phi + self.rotation) / TAU).rem_euclid(1.0);
        // rem_euclid of a tiny negative number rounds to 1.
        [if u < 1.0 { u } else { 0.0 }, theta * FRAC_1_PI]
    }

    fn direction_from_image(&self, u: f32, cos_theta: f64) -> Vec3 {
        let phi = (u - 0.5) * TAU - self.rotation;
        let sin_theta = ((1.0 - cos_theta) * (1.0 + cos_theta)).max(0.0).sqrt() as f32;
        let (sin_phi, cos_phi) = phi.sin_cos();
        Vec3::new(sin_theta * sin_phi, cos_theta as f32, -sin_theta * cos_phi)
    }
}
