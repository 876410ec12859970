//! Materials: glTF's metallic-roughness model and what it makes of a point on a surface.
//!
//! A material turns texture coordinates and vertex colour into a [`Bsdf`], into emitted radiance and into holes.

use crate::texture::{Texture, TextureRef};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use tyndall_transport::Bsdf;

/// Reflectance of a dielectric with index of refraction 1.5 at normal incidence (glTF 2.0, appendix B.3).
const DIELECTRIC_F0: f32 = 0.04;

/// A glTF material. Colours are linear RGB; a texture multiplies its factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The file's name for it, or one made up from its index.
    pub name: String,
    /// Base colour and alpha, each in [0, 1].
    pub base_color: Vec4,
    /// Colour map for `base_color`.
    pub base_color_texture: Option<TextureRef>,
    /// 1 for metals, 0 for dielectrics.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1]; its square is the microfacet width.
    pub roughness: f32,
    /// Data map: green is roughness, blue metallic.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Emitted radiance, W/(m² sr): emissive factor × strength.
    pub emissive: Vec3,
    /// Colour map for `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// Points with less alpha than this are holes; `None` for a surface without holes.
    pub alpha_cutoff: Option<f32>,
    /// Whether the surface emits on both sides. It always reflects on both.
    pub double_sided: bool,
    /// Strength of the dielectric reflection in [0, 1] (`KHR_materials_specular`).
    pub specular_factor: f32,
    /// Data map whose alpha multiplies `specular_factor`.
    pub specular_texture: Option<TextureRef>,
    /// Colour of the dielectric reflection at normal incidence.
    pub specular_color: Vec3,
    /// Colour map for `specular_color`.
    pub specular_color_texture: Option<TextureRef>,
}

impl Default for Material {
    /// The material of a primitive without one: glTF's default values, under which everything is white and metallic.
    fn default() -> Self {
        Self {
            name: "default".into(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha_cutoff: None,
            double_sided: false,
            specular_factor: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
        }
    }
}

impl Material {
    /// Reflection at a point with texture coordinates `uv` and vertex colour `color`.
    ///
    /// * diffuse = (1 − metallic) base
    /// * f0 = lerp(min(0.04 specular colour, 1) · specular factor, base, metallic)
    /// * f90 = lerp(specular factor, 1, metallic)
    /// * α = roughness²
    ///
    /// glTF 2.0, appendix B.3.5, with `KHR_materials_specular`. Metallic 0 and specular factor 0 give f0 = f90 = 0, a
    /// Lambertian surface of reflectance base.
    pub fn bsdf(
        &self,
        textures: &[Texture],
        uv: [Vec2; 2],
        color: Vec4,
        shading_normal: Vec3,
    ) -> Bsdf {
        let base = self.base(textures, &uv, color).xyz();
        let (mut metallic, mut roughness) = (self.metallic, self.roughness);
        if let Some(map) = &self.metallic_roughness_texture {
            let texel = map.data(textures, &uv);
            roughness *= texel.y;
            metallic *= texel.z;
        }
        let mut specular = self.specular_factor;
        if let Some(map) = &self.specular_texture {
            specular *= map.data(textures, &uv).w;
        }
        let mut specular_color = self.specular_color;
        if let Some(map) = &self.specular_color_texture {
            specular_color *= map.color(textures, &uv).xyz();
        }
        let dielectric = (DIELECTRIC_F0 * specular_color).min(Vec3::ONE) * specular;
        let diffuse = base * (1.0 - metallic);
        let f0 = dielectric * (1.0 - metallic) + base * metallic;
        let f90 = specular * (1.0 - metallic) + metallic;
        Bsdf::new(diffuse, f0, f90, roughness * roughness, shading_normal)
    }

    /// Whether any texture of the material reads set `set` of the texture coordinates.
    pub fn reads_uv(&self, set: usize) -> bool {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.emissive_texture,
            &self.specular_texture,
            &self.specular_color_texture,
        ]
        .into_iter()
        .flatten()
        .any(|texture| texture.tex_coord == set)
    }

    /// Whether the material emits at all.
    pub fn is_emissive(&self) -> bool {
        self.emissive != Vec3::ZERO
    }

    /// Radiance emitted at `uv` on the front side, or on the back where `front` is false; W/(m² sr).
    pub fn emission(&self, textures: &[Texture], uv: [Vec2; 2], front: bool) -> Vec3 {
        if !front && !self.double_sided {
            return Vec3::ZERO;
        }
        match &self.emissive_texture {
            Some(map) if self.is_emissive() => self.emissive * map.color(textures, &uv).xyz(),
            _ => self.emissive,
        }
    }

    /// Coverage at a point, in [0, 1]: base alpha times texture times vertex colour.
    pub fn alpha(&self, textures: &[Texture], uv: [Vec2; 2], color: Vec4) -> f32 {
        self.base(textures, &uv, color).w
    }

    /// Whether the surface has a hole at a point: alpha is below the cutoff.
    pub fn is_hole(&self, textures: &[Texture], uv: [Vec2; 2], color: Vec4) -> bool {
        self.alpha_cutoff
            .is_some_and(|cutoff| self.alpha(textures, uv, color) < cutoff)
    }

    /// Base colour and alpha at a point, within [0, 1].
    fn base(&self, textures: &[Texture], uv: &[Vec2; 2], color: Vec4) -> Vec4 {
        let mut base = self.base_color * color;
        if let Some(map) = &self.base_color_texture {
            base *= map.color(textures, uv);
        }
        base.clamp(Vec4::ZERO, Vec4::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_1_PI;

    const UV: [Vec2; 2] = [Vec2::ZERO; 2];

    /// One texel with these code values.
    fn texel(rgba: [u8; 4]) -> Vec<Texture> {
        Texture::new(1, 1, vec![rgba]).into_iter().collect()
    }

    /// f cosθ for light from 60° seen at normal incidence.
    fn reflected(material: &Material, textures: &[Texture], color: Vec4) -> Vec3 {
        let w_i = Vec3::new(0.75_f32.sqrt(), 0.0, 0.5);
        material
            .bsdf(textures, UV, color, Vec3::Z)
            .eval(Vec3::Z, w_i)
    }

    #[test]
    fn a_dielectric_without_specular_is_exactly_lambertian() {
        let base = Vec3::new(0.2, 0.5, 0.8);
        let material = Material {
            base_color: base.extend(1.0),
            metallic: 0.0,
            specular_factor: 0.0,
            ..Material::default()
        };
        // Lambert's law with the rounding of one product.
        let error = reflected(&material, &[], Vec4::ONE) - base * FRAC_1_PI * 0.5;
        assert!(error.abs().max_element() < 1e-7, "{error}");
    }

    #[test]
    fn metals_and_dielectrics_have_the_standards_parameters() {
        let base = Vec3::new(0.2, 0.5, 0.8);
        let (n, roughness, specular) = (Vec3::Z, 0.5, 0.5);
        let color = Vec3::new(2.0, 1.0, 30.0);
        for (metallic, diffuse, f0, f90) in [
            (1.0, Vec3::ZERO, base, 1.0),
            (0.0, base, Vec3::new(0.04, 0.02, 0.5), 0.5),
            (
                0.5,
                base / 2.0,
                (Vec3::new(0.04, 0.02, 0.5) + base) / 2.0,
                0.75,
            ),
        ] {
            let material = Material {
                base_color: base.extend(1.0),
                metallic,
                roughness,
                specular_factor: specular,
                specular_color: color,
                ..Material::default()
            };
            let w_i = Vec3::new(0.75_f32.sqrt(), 0.0, 0.5);
            let expected = Bsdf::new(diffuse, f0, f90, roughness * roughness, n).eval(n, w_i);
            let error = reflected(&material, &[], Vec4::ONE) - expected;
            assert!(error.abs().max_element() < 1e-6, "{metallic}: {error}");
        }
    }

    #[test]
    fn textures_and_vertex_colours_multiply_factors() {
        let plain = Material {
            base_color: Vec4::new(0.25, 0.1, 0.0, 1.0),
            metallic: 0.4,
            roughness: 0.6,
            ..Material::default()
        };
        let textured = Material {
            base_color: Vec4::new(0.5, 0.4, 0.0, 1.0),
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: Some(TextureRef::new(0)),
            ..plain.clone()
        };
        // Green 153/255 = 0.6 is roughness, blue 102/255 = 0.4 metallic; red means nothing.
        let textures = texel([77, 153, 102, 255]);
        let color = Vec4::new(0.5, 0.25, 0.7, 1.0);
        let error = reflected(&textured, &textures, color) - reflected(&plain, &[], Vec4::ONE);
        assert!(error.abs().max_element() < 1e-6, "{error}");
    }

    #[test]
    fn base_colours_never_exceed_one() {
        let material = Material {
            metallic: 0.0,
            specular_factor: 0.0,
            ..Material::default()
        };
        let white = reflected(&material, &[], Vec4::ONE);
        assert_eq!(reflected(&material, &[], Vec4::splat(5.0)), white);
    }

    #[test]
    fn surfaces_emit_on_the_front_and_on_both_sides_where_double_sided() {
        let mut material = Material {
            emissive: Vec3::splat(10.0),
            emissive_texture: Some(TextureRef::new(0)),
            ..Material::default()
        };
        let textures = texel([255, 0, 255, 255]);
        let glow = Vec3::new(10.0, 0.0, 10.0);
        assert_eq!(material.emission(&textures, UV, true), glow);
        assert_eq!(material.emission(&textures, UV, false), Vec3::ZERO);
        material.double_sided = true;
        assert_eq!(material.emission(&textures, UV, false), glow);
    }

    #[test]
    fn alpha_below_the_cutoff_is_a_hole() {
        let material = Material {
            base_color_texture: Some(TextureRef::new(0)),
            alpha_cutoff: Some(0.5),
            ..Material::default()
        };
        let color = |alpha| Vec4::new(1.0, 1.0, 1.0, alpha);
        let textures = texel([255, 255, 255, 204]);
        assert!((material.alpha(&textures, UV, color(0.5)) - 0.4).abs() < 1e-6);
        assert!(material.is_hole(&textures, UV, color(0.5)));
        assert!(!material.is_hole(&textures, UV, color(1.0)));
    }
}
