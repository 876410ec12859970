//! Materials of a glTF file, read when a triangle first uses them.

use super::error::{GltfError, get};
use super::images::Images;
use crate::error::Warning;
use crate::material::Material;
use crate::scene_file::numbers::MAX_POWER;
use crate::texture::{Filter, TextureRef, Wrap};
use ::gltf::json;
use ::gltf::json::material::AlphaMode;
use ::gltf::json::texture::{Info, MagFilter, Sampler, WrappingMode};
use ::gltf::json::validation::Checked;
use glam::{Mat2, Vec2, Vec3, Vec4};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Materials that triangles use, in the order of first use.
pub(super) struct Materials<'a> {
    json: &'a json::Root,
    images: Images<'a>,
    places: BTreeMap<Option<usize>, u32>,
    list: Vec<Material>,
    blended: Vec<String>,
    /// How many materials have textures that are not drawn, by field.
    undrawn: BTreeMap<&'static str, usize>,
}

/// `KHR_materials_specular`, which files may use without requiring it.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Specular {
    specular_factor: f32,
    specular_texture: Option<Info>,
    specular_color_factor: [f32; 3],
    specular_color_texture: Option<Info>,
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

impl<'a> Materials<'a> {
    pub(super) fn new(json: &'a json::Root, images: Images<'a>) -> Self {
        Self {
            json,
            images,
            places: BTreeMap::new(),
            list: Vec::new(),
            blended: Vec::new(),
            undrawn: BTreeMap::new(),
        }
    }

    /// What was read, and the warning that is given once for all materials.
    pub(super) fn finish(
        self,
        warnings: &mut Vec<Warning>,
    ) -> (Vec<Material>, Vec<crate::texture::Texture>) {
        if !self.blended.is_empty() {
            warnings.push(Warning::BlendDrawnOpaque {
                materials: self.blended,
            });
        }
        for (field, count) in self.undrawn {
            warnings.push(Warning::Gltf {
                problem: format!("{field} of {count} materials is not drawn"),
                pointer: "/materials".into(),
            });
        }
        (self.list, self.images.into_textures())
    }

    /// The material at `place`.
    pub(super) fn at(&self, place: u32) -> Option<&Material> {
        self.list.get(place as usize)
    }

    /// Place of material `index`, or of the default material, in the list.
    pub(super) fn place(
        &mut self,
        index: Option<usize>,
        pointer: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<u32, GltfError> {
        if let Some(&place) = self.places.get(&index) {
            return Ok(place);
        }
        let material = match index {
            Some(index) => {
                let material = get(&self.json.materials, index, "materials", || pointer.into())?;
                self.read(index, material, warnings)?
            }
            None => Material::default(),
        };
        let place = self.list.len() as u32;
        self.list.push(material);
        self.places.insert(index, place);
        Ok(place)
    }

    fn read(
        &mut self,
        index: usize,
        material: &json::Material,
        warnings: &mut Vec<Warning>,
    ) -> Result<Material, GltfError> {
        let at = format!("/materials/{index}");
        let name = material.name.clone();
        let name = name.unwrap_or_else(|| format!("materials/{index}"));
        let pbr = &material.pbr_metallic_roughness;
        let pbr_at = format!("{at}/pbrMetallicRoughness");
        let extensions = material.extensions.as_ref();
        let specular = match extensions.and_then(|e| e.others.get("KHR_materials_specular")) {
            Some(value) => Specular::deserialize(value).map_err(GltfError::Json)?,
            None => Specular::default(),
        };
        let specular_at = format!("{at}/extensions/KHR_materials_specular");
        let strength = extensions
            .and_then(|e| e.emissive_strength.as_ref())
            .map_or(1.0, |e| e.emissive_strength.0);
        let strength_at =
            format!("{at}/extensions/KHR_materials_emissive_strength/emissiveStrength");
        let [strength] = not_negative([strength], &strength_at)?;
        let emissive = not_negative(material.emissive_factor.0, &format!("{at}/emissiveFactor"))?;
        let emissive = emissive.map(|e| e * strength);
        if Vec3::from(emissive).max_element() > MAX_POWER {
            return Err(GltfError::value(
                strength_at,
                format!("{strength}"),
                "emissiveFactor times emissiveStrength must be at most 1e30",
            ));
        }
        let mut clamped = false;
        let mut unit = |value: f32, at: String| -> Result<f32, GltfError> {
            let [value] = not_negative([value], &at)?;
            clamped |= value > 1.0;
            Ok(value.min(1.0))
        };
        let [r, g, b, a] = pbr.base_color_factor.0;
        let base_at = || format!("{pbr_at}/baseColorFactor");
        let base_color = Vec4::new(
            unit(r, base_at())?,
            unit(g, base_at())?,
            unit(b, base_at())?,
            unit(a, base_at())?,
        );
        let metallic = unit(pbr.metallic_factor.0, format!("{pbr_at}/metallicFactor"))?;
        let roughness = unit(pbr.roughness_factor.0, format!("{pbr_at}/roughnessFactor"))?;
        let specular_factor = unit(
            specular.specular_factor,
            format!("{specular_at}/specularFactor"),
        )?;
        let specular_color = not_negative(
            specular.specular_color_factor,
            &format!("{specular_at}/specularColorFactor"),
        )?;
        if clamped {
            warnings.push(Warning::Gltf {
                problem: format!("material \"{name}\" has factors above 1, which are drawn as 1"),
                pointer: at.clone(),
            });
        }
        for (field, given) in [
            ("normalTexture", material.normal_texture.is_some()),
            ("occlusionTexture", material.occlusion_texture.is_some()),
        ] {
            if given {
                *self.undrawn.entry(field).or_default() += 1;
            }
        }
        let alpha_cutoff = self.alpha_cutoff(material, &name, &at)?;
        let mut map = |info: Option<&Info>| match info {
            Some(info) => self.texture(info, &name, &at, warnings),
            None => Ok(None),
        };
        let material = Material {
            base_color,
            base_color_texture: map(pbr.base_color_texture.as_ref())?,
            metallic,
            roughness,
            metallic_roughness_texture: map(pbr.metallic_roughness_texture.as_ref())?,
            emissive: emissive.into(),
            emissive_texture: match emissive {
                [0.0, 0.0, 0.0] => None,
                _ => map(material.emissive_texture.as_ref())?,
            },
            alpha_cutoff,
            double_sided: material.double_sided,
            specular_factor,
            specular_texture: map(specular.specular_texture.as_ref())?,
            specular_color: specular_color.into(),
            specular_color_texture: map(specular.specular_color_texture.as_ref())?,
            name,
        };
        Ok(material)
    }

    fn alpha_cutoff(
        &mut self,
        material: &json::Material,
        name: &str,
        at: &str,
    ) -> Result<Option<f32>, GltfError> {
        match material.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => Ok(None),
            Checked::Valid(AlphaMode::Blend) => {
                self.blended.push(name.into());
                Ok(None)
            }
            Checked::Valid(AlphaMode::Mask) => {
                let cutoff = material.alpha_cutoff.unwrap_or_default().0;
                let [cutoff] = not_negative([cutoff], &format!("{at}/alphaCutoff"))?;
                Ok(Some(cutoff))
            }
            Checked::Invalid => Err(GltfError::value(
                format!("{at}/alphaMode"),
                "an unknown name",
                "allowed are \"OPAQUE\", \"MASK\" and \"BLEND\"",
            )),
        }
    }

    /// How a material reads a texture; `None`, after a warning, where the texture cannot be used.
    fn texture(
        &mut self,
        info: &Info,
        material: &str,
        at: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<TextureRef>, GltfError> {
        let index = info.index.value();
        let mut missing = |problem: &str| {
            warnings.push(Warning::TextureMissing {
                texture: format!("textures/{index}"),
                problem: format!("{problem} (used by material \"{material}\")"),
            });
            Ok(None)
        };
        let Some(texture) = self.json.textures.get(index) else {
            return missing("the file has no such texture");
        };
        let transform = info
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.texture_transform.as_ref());
        let tex_coord = transform
            .and_then(|t| t.tex_coord)
            .unwrap_or(info.tex_coord);
        if tex_coord > 1 {
            return missing("it uses texture coordinates beyond TEXCOORD_1");
        }
        // The parser stands u32::MAX for a missing source, as extensions for other formats leave it.
        if texture.source.value() == u32::MAX as usize {
            return missing("it has no PNG or JPEG image");
        }
        let sampler = texture.sampler.map(|sampler| sampler.value());
        let default = Sampler::default();
        let sampler = match sampler {
            Some(sampler) => get(&self.json.samplers, sampler, "samplers", || {
                format!("/textures/{index}/sampler")
            })?,
            None => &default,
        };
        let Some(place) = self.images.texture(texture.source.value(), warnings)? else {
            return Ok(None);
        };
        let mut reference = TextureRef {
            tex_coord: tex_coord as usize,
            wrap: [wrap(sampler.wrap_s), wrap(sampler.wrap_t)],
            filter: match sampler.mag_filter {
                Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
                _ => Filter::Linear,
            },
            ..TextureRef::new(place)
        };
        if let Some(transform) = transform {
            // Counter-clockwise with v downwards, as the extension's text, its test model and the known viewers have it; the
            // GLSL in its README turns the other way.
            let (sin, cos) = transform.rotation.0.sin_cos();
            let rotation = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
            reference.transform = rotation * Mat2::from_diagonal(transform.scale.0.into());
            reference.offset = transform.offset.0.into();
            if !reference.transform.is_finite() || !reference.offset.is_finite() {
                return Err(GltfError::value(
                    at,
                    "a KHR_texture_transform that is not finite",
                    "offset, rotation and scale must be finite",
                ));
            }
        }
        Ok(Some(reference))
    }
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// `values`, if all are finite and none is negative.
fn not_negative<const N: usize>(values: [f32; N], pointer: &str) -> Result<[f32; N], GltfError> {
    if values.iter().all(|v| v.is_finite() && *v >= 0.0) {
        return Ok(values);
    }
    Err(GltfError::value(
        pointer,
        format!("{values:?}"),
        "each number must be finite and not negative",
    ))
}
