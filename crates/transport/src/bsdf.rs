//! Reflection of opaque surfaces: glTF's metallic-roughness model, that is a Lambertian base under a GGX lobe.
//!
//! Both sides of a surface reflect; the normal is turned to the viewer before a [`Bsdf`] is made.

use crate::albedo::Albedo;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};
use tyndall_math::{Frame, warp};

/// Smallest GGX width used. Smoother surfaces are drawn this smooth: a lobe of 0.06° that the sampler still resolves in f32.
const MIN_ALPHA: f32 = 1e-3;

/// Chance with which samples of gloss follow the cosine: what Fresnel's factor changes of the diffuse part is spread over all directions.
const DIFFUSE_IN_GLOSS: f32 = 0.25;

/// Lobes narrower than this width make a surface shiny.
const SHINY_ALPHA: f32 = 0.3;

/// Reflection at one surface point.
///
/// f = (1 − F) diffuse/π + F D G / (4 cosθᵢ cosθₒ),  F = f0 + (f90 − f0)(1 − `w_o`·h)⁵
///
/// glTF 2.0 specification, appendix B.3.5; D and G are GGX with the height-correlated Smith term (Heitz 2014, equations 71 and 99).
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    normal: Vec3,
    diffuse: Vec3,
    f0: Vec3,
    f90: f32,
    alpha: f32,
}

/// A sampled direction of reflection.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction in which the path goes on.
    pub w_i: Vec3,
    /// f · |cosθᵢ|, per steradian.
    pub value: Vec3,
    /// Density of `w_i` per steradian.
    pub pdf: f32,
}

impl Bsdf {
    /// Reflection with Lambertian part `diffuse`, Fresnel reflectance `f0` at normal and `f90` at grazing incidence, GGX
    /// width `alpha` (roughness squared), around the unit `shading_normal` on the viewer's side.
    pub fn new(diffuse: Vec3, f0: Vec3, f90: f32, alpha: f32, shading_normal: Vec3) -> Self {
        Self {
            normal: shading_normal,
            diffuse,
            f0,
            f90,
            alpha: alpha.max(MIN_ALPHA),
        }
    }

    /// A purely Lambertian surface.
    pub fn lambert(reflectance: Vec3, shading_normal: Vec3) -> Self {
        Self::new(reflectance, Vec3::ZERO, 0.0, 1.0, shading_normal)
    }

    /// Unit shading normal.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Whether light is reflected alike in all directions.
    pub fn is_lambert(&self) -> bool {
        self.f90 == 0.0 && self.f0 == Vec3::ZERO
    }

    /// Whether what it reflects depends much on direction.
    pub fn is_shiny(&self) -> bool {
        self.alpha < SHINY_ALPHA && !self.is_lambert()
    }

    /// The same surface, rough enough not to be shiny.
    pub(crate) fn roughened(self) -> Self {
        Self {
            alpha: self.alpha.max(SHINY_ALPHA),
            ..self
        }
    }

    /// The share of even light that leaves along `w_o`, per colour channel; to about 0.003 where surfaces are not Lambertian.
    pub fn albedo(&self, w_o: Vec3) -> Vec3 {
        if self.is_lambert() {
            return self.diffuse;
        }
        let [at_0, at_90] = Albedo::of(self.normal.dot(w_o), self.alpha).lobe;
        self.diffuse_albedo(w_o) + self.f0 * at_0 + self.f90 * at_90
    }

    /// The part of [`Bsdf::albedo`] that the Lambertian base has; what is left is gloss, see [`Bsdf::sample_gloss`].
    pub fn diffuse_albedo(&self, w_o: Vec3) -> Vec3 {
        if self.is_lambert() {
            return self.diffuse;
        }
        let taken = Albedo::of(self.normal.dot(w_o), self.alpha).base;
        let fresnel = self.f0 + (Vec3::splat(self.f90) - self.f0) * taken;
        (Vec3::ONE - fresnel) * self.diffuse
    }

    fn fresnel(&self, cos: f32) -> Vec3 {
        self.f0 + (Vec3::splat(self.f90) - self.f0) * schlick(cos)
    }

    /// Probability of following the diffuse part.
    fn diffuse_share(&self, cos_o: f32) -> f32 {
        if self.is_lambert() {
            return 1.0;
        }
        let d = self.diffuse.element_sum();
        let s = self.fresnel(cos_o).element_sum();
        if d + s > 0.0 { d / (d + s) } else { 1.0 }
    }

    /// f · cosθᵢ for light from `w_i` leaving along `w_o`, per steradian; 0 where either is below the surface.
    pub fn eval(&self, w_o: Vec3, w_i: Vec3) -> Vec3 {
        let (cos_o, cos_i) = (self.normal.dot(w_o), self.normal.dot(w_i));
        if cos_o <= 0.0 || cos_i <= 0.0 {
            return Vec3::ZERO;
        }
        if self.is_lambert() {
            return self.diffuse * (FRAC_1_PI * cos_i);
        }
        let h = (w_o + w_i).normalize_or_zero();
        let fresnel = self.fresnel(w_o.dot(h));
        let specular = ggx_d(self.normal.dot(h), self.alpha) * smith_v(cos_o, cos_i, self.alpha);
        ((Vec3::ONE - fresnel) * self.diffuse * FRAC_1_PI + fresnel * specular) * cos_i
    }

    /// Density with which [`Bsdf::sample`] picks `w_i`, per steradian.
    pub fn pdf(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        self.pdf_with(self.diffuse_share(self.normal.dot(w_o)), w_o, w_i)
    }

    /// As [`Bsdf::pdf`] where directions follow the diffuse part with a chance of `share`.
    fn pdf_with(&self, share: f32, w_o: Vec3, w_i: Vec3) -> f32 {
        let (cos_o, cos_i) = (self.normal.dot(w_o), self.normal.dot(w_i));
        if cos_o <= 0.0 || cos_i <= 0.0 {
            return 0.0;
        }
        let mut pdf = share * cos_i * FRAC_1_PI;
        if share < 1.0 {
            let h = (w_o + w_i).normalize_or_zero();
            // Density of visible normals over 4 w_o·h: G1 D / (4 cosθₒ) (Heitz 2018, equation 17).
            let g1 = 2.0 * cos_o / (cos_o + smith_root(cos_o, self.alpha));
            pdf += (1.0 - share) * g1 * ggx_d(self.normal.dot(h), self.alpha) / (4.0 * cos_o);
        }
        pdf
    }

    /// Samples a direction; `None` where nothing is reflected.
    pub fn sample(&self, w_o: Vec3, lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let share = self.diffuse_share(self.normal.dot(w_o));
        let w_i = self.direction(share, w_o, lobe, u)?;
        let pdf = self.pdf(w_o, w_i);
        let value = self.eval(w_o, w_i);
        (pdf > 0.0 && value.max_element() > 0.0).then_some(BsdfSample { w_i, value, pdf })
    }

    /// Samples what is reflected beside [`Bsdf::diffuse_albedo`]; its value may be a little below 0, where Fresnel's factor takes more
    /// than in the mean. `None` for Lambertian surfaces.
    pub fn sample_gloss(&self, w_o: Vec3, lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        if self.is_lambert() {
            return None;
        }
        let w_i = self.direction(DIFFUSE_IN_GLOSS, w_o, lobe, u)?;
        let pdf = self.pdf_with(DIFFUSE_IN_GLOSS, w_o, w_i);
        let even = self.diffuse_albedo(w_o) * (FRAC_1_PI * self.normal.dot(w_i).max(0.0));
        let value = self.eval(w_o, w_i) - even;
        (pdf > 0.0).then_some(BsdfSample { w_i, value, pdf })
    }

    /// A direction that follows the diffuse part with a chance of `share`, else the visible normals.
    fn direction(&self, share: f32, w_o: Vec3, lobe: f32, u: [f32; 2]) -> Option<Vec3> {
        if self.normal.dot(w_o) <= 0.0 {
            return None;
        }
        let frame = Frame::from_normal(self.normal);
        let w_i = if lobe < share {
            frame.to_world(warp::cosine_hemisphere(u))
        } else {
            let h = frame.to_world(visible_normal(frame.to_local(w_o), self.alpha, u));
            h * (2.0 * w_o.dot(h)) - w_o
        };
        Some(w_i.normalize_or_zero())
    }
}

/// (1 − cos)⁵ (Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering").
pub(crate) fn schlick(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// GGX distribution of normals D(h), per steradian.
fn ggx_d(cos_h: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    // 1 − cos²(1 − α²) written as sin² + α² cos², which keeps its digits for small α.
    let c2 = (cos_h * cos_h).min(1.0);
    let d = (1.0 - c2) + a2 * c2;
    a2 / (PI * d * d).max(f32::MIN_POSITIVE)
}

/// √(α² + (1 − α²) cos²θ), the root in Smith's Λ times cosθ.
pub(crate) fn smith_root(cos: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    (a2 + (1.0 - a2) * cos * cos).sqrt()
}

/// G / (4 cosθᵢ cosθₒ) with the height-correlated Smith term.
pub(crate) fn smith_v(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    0.5 / (cos_i * smith_root(cos_o, alpha) + cos_o * smith_root(cos_i, alpha))
        .max(f32::MIN_POSITIVE)
}

/// Samples the GGX normals visible from local direction `w_o`.
///
/// Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps", listing 3.
pub(crate) fn visible_normal(w_o: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let std = Vec3::new(w_o.x * alpha, w_o.y * alpha, w_o.z).normalize();
    let phi = 2.0 * PI * u[0];
    let z = (1.0 - u[1]) * (1.0 + std.z) - std.z;
    let sin = (1.0 - z * z).max(0.0).sqrt();
    let h = Vec3::new(sin * phi.cos(), sin * phi.sin(), z) + std;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use tyndall_math::{Key, Purpose, Sampler};

    fn samples(n: u64) -> impl Iterator<Item = Sampler> {
        let key = Key {
            seed: 1,
            purpose: Purpose::Probe,
            index: 0,
        };
        (0..n).map(move |i| Sampler::new(key, i))
    }

    fn bsdfs() -> Vec<Bsdf> {
        vec![
            Bsdf::lambert(Vec3::splat(0.8), Vec3::Z),
            Bsdf::new(Vec3::splat(0.5), Vec3::splat(0.04), 1.0, 0.25, Vec3::Z),
            Bsdf::new(Vec3::ZERO, Vec3::new(1.0, 0.8, 0.3), 1.0, 0.05, Vec3::Z),
            Bsdf::new(Vec3::splat(1.0), Vec3::splat(0.04), 1.0, 1.0, Vec3::Z),
        ]
    }

    #[test]
    fn no_surface_reflects_more_than_it_receives() {
        for bsdf in bsdfs() {
            for cos_o in [0.05f32, 0.3, 0.9] {
                let w_o = Vec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
                let n = 4096;
                let sum: Vec3 = samples(n)
                    .filter_map(|mut s| bsdf.sample(w_o, s.next_1d(), s.next_2d()))
                    .map(|s| s.value / s.pdf)
                    .sum();
                let albedo = sum / n as f32;
                assert!(albedo.max_element() < 1.02, "{bsdf:?} {cos_o}: {albedo}");
                assert!(albedo.max_element() > 0.3, "{bsdf:?} {cos_o}: {albedo}");
            }
        }
    }

    #[test]
    fn a_lambertian_surface_reflects_its_reflectance() {
        let bsdf = Bsdf::lambert(Vec3::new(0.2, 0.5, 0.9), Vec3::Z);
        for mut s in samples(64) {
            let sample = bsdf.sample(Vec3::Z, s.next_1d(), s.next_2d()).unwrap();
            assert!((sample.value / sample.pdf - Vec3::new(0.2, 0.5, 0.9)).length() < 1e-6);
        }
    }

    #[test]
    fn densities_integrate_to_the_chance_of_a_direction_above_the_surface() {
        for bsdf in bsdfs() {
            let w_o = Vec3::new(0.6, 0.0, 0.8);
            let n = 200_000;
            // Uniform hemisphere; standard error below 1 % except for the narrow metal lobe, which gets 5 %.
            let sum: f64 = samples(n)
                .map(|mut s| {
                    let [u, v] = s.next_2d();
                    let r = (1.0 - u * u).sqrt();
                    let phi = 2.0 * PI * v;
                    f64::from(bsdf.pdf(w_o, Vec3::new(r * phi.cos(), r * phi.sin(), u)))
                })
                .sum();
            let integral = sum / n as f64 * 2.0 * std::f64::consts::PI;
            let above = samples(20_000)
                .filter(|s| {
                    let mut s = s.clone();
                    bsdf.sample(w_o, s.next_1d(), s.next_2d()).is_some()
                })
                .count() as f64
                / 20_000.0;
            assert!(
                (integral - above).abs() < 0.02,
                "{bsdf:?}: {integral} against {above}"
            );
        }
    }

    #[test]
    fn gloss_and_the_diffuse_part_are_all_that_is_reflected() {
        for bsdf in bsdfs() {
            let w_o = Vec3::new(0.6, 0.0, 0.8);
            let n = 20_000;
            // Even light, so that the diffuse part is known; standard errors are below 0.5 %.
            let mean = |sample: &dyn Fn(&mut Sampler) -> Option<BsdfSample>| {
                let found = samples(n).filter_map(|mut s| sample(&mut s));
                found.map(|s| s.value / s.pdf).sum::<Vec3>() / n as f32
            };
            let all = mean(&|s| bsdf.sample(w_o, s.next_1d(), s.next_2d()));
            let gloss = mean(&|s| bsdf.sample_gloss(w_o, s.next_1d(), s.next_2d()));
            let sum = gloss + bsdf.diffuse_albedo(w_o);
            assert!(
                (all - sum).abs().max_element() < 0.015,
                "{bsdf:?}: {all} {sum}"
            );
            let albedo = bsdf.albedo(w_o);
            assert!(
                (all - albedo).abs().max_element() < 0.015,
                "{bsdf:?}: {all} {albedo}"
            );
        }
    }

    #[test]
    fn reflection_is_reciprocal() {
        for bsdf in bsdfs() {
            let a = Vec3::new(0.6, 0.0, 0.8);
            let b = Vec3::new(-0.3, 0.5, 0.4).normalize();
            let ab = bsdf.eval(a, b) / b.z;
            let ba = bsdf.eval(b, a) / a.z;
            assert!((ab - ba).length() <= 1e-5 * ab.length());
        }
    }
}
