//! Writing glTF 2.0: a JSON document and its binary buffer, with lights, emissive strength and Lambertian materials.

use super::mesh::Mesh;
use anyhow::Result;
use glam::{Quat, Vec3};
use serde_json::{Map, Value, json};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// A glTF document that grows by materials, meshes, lights and nodes; each call returns the new thing's index.
#[derive(Default)]
pub(super) struct Document {
    materials: Vec<Value>,
    meshes: Vec<Value>,
    lights: Vec<Value>,
    nodes: Vec<Value>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    buffer: Vec<u8>,
}

/// What a node holds besides its place.
#[derive(Clone, Copy, Default)]
pub(super) struct Content {
    pub(super) mesh: Option<usize>,
    pub(super) light: Option<usize>,
}

impl Document {
    /// An exactly Lambertian material.
    pub(super) fn lambertian(&mut self, name: &str, reflectance: [f64; 3]) -> usize {
        self.material(json!({
            "name": name,
            "pbrMetallicRoughness": surface(reflectance, 0.0, 1.0),
            "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } },
        }))
    }

    /// A material with a GGX lobe.
    pub(super) fn glossy(
        &mut self,
        name: &str,
        base_color: [f64; 3],
        metallic: f64,
        roughness: f64,
    ) -> usize {
        self.material(json!({ "name": name, "pbrMetallicRoughness": surface(base_color, metallic, roughness) }))
    }

    /// A black surface that emits radiance `color` × `strength`, W/(m² sr), on its front; `color` lies in [0, 1].
    pub(super) fn emitter(&mut self, name: &str, color: [f64; 3], strength: f64) -> usize {
        self.material(json!({
            "name": name,
            "pbrMetallicRoughness": surface([0.0; 3], 0.0, 1.0),
            "emissiveFactor": color,
            "extensions": {
                "KHR_materials_specular": { "specularFactor": 0.0 },
                "KHR_materials_emissive_strength": { "emissiveStrength": strength },
            },
        }))
    }

    /// A mesh of one or more parts, each with its material.
    pub(super) fn mesh(&mut self, name: &str, parts: &[(&Mesh, usize)]) -> usize {
        let primitive = |(mesh, material): &(&Mesh, usize)| {
            let floats = |v: &[Vec3]| {
                v.iter()
                    .flat_map(|p| p.to_array())
                    .flat_map(f32::to_le_bytes)
                    .collect()
            };
            let indices: Vec<u8> = mesh.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
            let position =
                self.accessor(FLOAT, "VEC3", mesh.positions.len(), floats(&mesh.positions));
            let normal = self.accessor(FLOAT, "VEC3", mesh.normals.len(), floats(&mesh.normals));
            let least = mesh
                .positions
                .iter()
                .copied()
                .fold(Vec3::INFINITY, Vec3::min);
            let most = mesh
                .positions
                .iter()
                .copied()
                .fold(Vec3::NEG_INFINITY, Vec3::max);
            self.accessors[position]["min"] = json!(least.to_array().map(decimal));
            self.accessors[position]["max"] = json!(most.to_array().map(decimal));
            json!({
                "attributes": { "POSITION": position, "NORMAL": normal },
                "indices": self.accessor(UNSIGNED_INT, "SCALAR", mesh.indices.len(), indices),
                "material": material,
            })
        };
        let primitives: Vec<Value> = parts.iter().map(primitive).collect();
        push(
            &mut self.meshes,
            json!({ "name": name, "primitives": primitives }),
        )
    }

    /// A point light of `intensity` in W/sr.
    pub(super) fn point_light(&mut self, name: &str, intensity: f64, color: [f64; 3]) -> usize {
        let light =
            json!({ "name": name, "type": "point", "intensity": intensity, "color": color });
        push(&mut self.lights, light)
    }

    /// A spot light of `intensity` in W/sr along −Z, with half-angles of its cones in radians.
    pub(super) fn spot_light(
        &mut self,
        name: &str,
        intensity: f64,
        color: [f64; 3],
        cones: [f64; 2],
    ) -> usize {
        let spot = json!({ "innerConeAngle": cones[0], "outerConeAngle": cones[1] });
        let light = json!({ "name": name, "type": "spot", "intensity": intensity, "color": color, "spot": spot });
        push(&mut self.lights, light)
    }

    /// A node at `translation`, turned by `rotation`.
    pub(super) fn node(
        &mut self,
        name: &str,
        content: Content,
        translation: Vec3,
        rotation: Quat,
    ) -> usize {
        let mut node = Map::new();
        node.insert("name".into(), json!(name));
        if translation != Vec3::ZERO {
            node.insert(
                "translation".into(),
                json!(translation.to_array().map(decimal)),
            );
        }
        if rotation != Quat::IDENTITY {
            node.insert("rotation".into(), json!(rotation.to_array().map(decimal)));
        }
        if let Some(mesh) = content.mesh {
            node.insert("mesh".into(), json!(mesh));
        }
        if let Some(light) = content.light {
            node.insert(
                "extensions".into(),
                json!({ "KHR_lights_punctual": { "light": light } }),
            );
        }
        push(&mut self.nodes, node.into())
    }

    /// A node that stands where its one-part mesh was built.
    pub(super) fn part(&mut self, name: &str, mesh: &Mesh, material: usize) -> usize {
        let mesh = Some(self.mesh(name, &[(mesh, material)]));
        self.node(
            name,
            Content { mesh, light: None },
            Vec3::ZERO,
            Quat::IDENTITY,
        )
    }

    /// The JSON text of a document whose buffer is stored in file `bin`.
    pub(super) fn json(&self, bin: &str) -> Result<Vec<u8>> {
        let mut document = json!({
            "asset": { "version": "2.0", "generator": "cargo xtask assets" },
            "extensionsUsed": ["KHR_materials_specular", "KHR_materials_emissive_strength"],
            "scene": 0,
            "scenes": [{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "uri": bin, "byteLength": self.buffer.len() }],
        });
        if !self.lights.is_empty() {
            document["extensionsUsed"] = json!([
                "KHR_materials_specular",
                "KHR_materials_emissive_strength",
                "KHR_lights_punctual"
            ]);
            document["extensions"] = json!({ "KHR_lights_punctual": { "lights": self.lights } });
        }
        let mut text = serde_json::to_vec_pretty(&document)?;
        text.push(b'\n');
        Ok(text)
    }

    /// The bytes of the file that [`Document::json`] names.
    pub(super) fn into_buffer(self) -> Vec<u8> {
        self.buffer
    }

    fn material(&mut self, material: Value) -> usize {
        push(&mut self.materials, material)
    }

    fn accessor(&mut self, component: u32, shape: &str, count: usize, bytes: Vec<u8>) -> usize {
        let view =
            json!({ "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len() });
        self.buffer.extend(bytes);
        let view = push(&mut self.views, view);
        let accessor = json!({ "bufferView": view, "componentType": component, "type": shape, "count": count });
        push(&mut self.accessors, accessor)
    }
}

fn surface([r, g, b]: [f64; 3], metallic: f64, roughness: f64) -> Value {
    json!({ "baseColorFactor": [r, g, b, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness })
}

fn push(list: &mut Vec<Value>, item: Value) -> usize {
    list.push(item);
    list.len() - 1
}

/// The shortest decimal that reads back as `x`; a plain cast would print the binary value's every digit.
fn decimal(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}
