//! All meshes of a file as one, every instance placed in the world.

use super::accessor::Accessors;
use super::error::{GltfError, get};
use super::materials::Materials;
use super::nodes::Placed;
use super::primitives::{self, Vertices};
use super::tally::Tally;
use crate::error::Warning;
use crate::material::Material;
use crate::mesh::TriangleMesh;
use crate::texture::Texture;
use ::gltf::json::Root;
use glam::{Vec2, Vec3, Vec4};
use std::collections::BTreeMap;

/// Most vertices, and most triangles, that a scene may have after instancing: some 20 GiB of them.
const MAX_ELEMENTS: u64 = 1 << 28;

/// Largest coordinate in metres. Beyond it the squared area of a triangle no longer fits into f32: (√3 · 2·10⁹ · 2·10⁹)² ≈ 10³⁸.
const MAX_COORDINATE: f32 = 1e9;

/// Gathers the triangles of nodes.
pub(super) struct MeshBuilder<'a> {
    json: &'a Root,
    accessors: Accessors<'a>,
    materials: Materials<'a>,
    /// Meshes that were read, for the next node that shows them.
    meshes: BTreeMap<usize, ReadMesh>,
    mesh: TriangleMesh,
    tally: Tally,
}

/// A mesh in its own space, and what was wrong with it so far.
struct ReadMesh {
    name: String,
    primitives: Vec<Vertices>,
    n_bad_normals: usize,
    n_degenerate: usize,
}

impl<'a> MeshBuilder<'a> {
    pub(super) fn new(json: &'a Root, accessors: Accessors<'a>, materials: Materials<'a>) -> Self {
        Self {
            json,
            accessors,
            materials,
            meshes: BTreeMap::new(),
            mesh: TriangleMesh::default(),
            tally: Tally::default(),
        }
    }

    /// Adds the mesh of a node, if it has one.
    pub(super) fn add_node(
        &mut self,
        placed: &Placed<'_>,
        warnings: &mut Vec<Warning>,
    ) -> Result<(), GltfError> {
        let Some(index) = placed.node.mesh else {
            return Ok(());
        };
        let index = index.value();
        let pointer = format!("{}/mesh", placed.pointer());
        placed.check_invertible()?;
        let mut read = match self.meshes.remove(&index) {
            Some(read) => read,
            None => self.read_mesh(index, &pointer, warnings)?,
        };
        let weights = placed.node.weights.as_ref();
        let weights = weights.or_else(|| self.json.meshes.get(index)?.weights.as_ref());
        let morphed = weights.is_some_and(|weights| weights.iter().any(|w| *w != 0.0));
        if morphed || placed.node.skin.is_some() {
            let what = "nodes with skins or morph weights are drawn in their rest shape";
            self.tally.note(what, &placed.pointer());
        }
        for vertices in &read.primitives {
            read.n_degenerate += append(&mut self.mesh, vertices, placed)?;
        }
        self.meshes.insert(index, read);
        Ok(())
    }

    fn read_mesh(
        &mut self,
        index: usize,
        pointer: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<ReadMesh, GltfError> {
        let mesh = get(&self.json.meshes, index, "meshes", || pointer.into())?;
        let mut found = Vec::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            found.extend(primitives::read(
                self.json,
                self.accessors,
                &mut self.materials,
                primitive,
                &format!("/meshes/{index}/primitives/{i}"),
                &mut self.tally,
                warnings,
            )?);
        }
        Ok(ReadMesh {
            name: mesh.name.clone().unwrap_or_else(|| index.to_string()),
            n_bad_normals: found.iter().map(|vertices| vertices.n_bad_normals).sum(),
            primitives: found,
            n_degenerate: 0,
        })
    }

    /// All triangles, and the materials and textures they use.
    pub(super) fn finish(
        self,
        warnings: &mut Vec<Warning>,
    ) -> (TriangleMesh, Vec<Material>, Vec<Texture>) {
        let total = |n: fn(&ReadMesh) -> usize| {
            let faulty = self.meshes.values().filter(|read| n(read) > 0);
            let meshes: Vec<_> = faulty.map(|read| read.name.clone()).collect();
            let count: usize = self.meshes.values().map(n).sum();
            (count > 0).then_some((meshes, count))
        };
        if let Some((meshes, count)) = total(|read| read.n_degenerate) {
            warnings.push(Warning::DegenerateTriangles { meshes, count });
        }
        if let Some((meshes, count)) = total(|read| read.n_bad_normals) {
            warnings.push(Warning::UnusableNormals { meshes, count });
        }
        warnings.extend(self.tally.into_warnings());
        let (materials, textures) = self.materials.finish(warnings);
        (self.mesh, materials, textures)
    }
}

/// Appends a primitive as the node places it; returns the number of degenerate triangles that were left out.
fn append(
    mesh: &mut TriangleMesh,
    vertices: &Vertices,
    placed: &Placed<'_>,
) -> Result<usize, GltfError> {
    let first = mesh.positions.len();
    check_size(first + vertices.positions.len(), "vertices", placed)?;
    check_size(
        mesh.indices.len() + vertices.triangles.len(),
        "triangles",
        placed,
    )?;
    for p in &vertices.positions {
        let p_world = placed.world.transform_point3(p.as_dvec3()).as_vec3();
        if !p_world.is_finite() || p_world.abs().max_element() > MAX_COORDINATE {
            return Err(placed.fault(
                "places vertices further than 1e9 metres from the origin; scale the scene down",
            ));
        }
        mesh.positions.push(p_world);
    }
    // Normals are covectors: with the inverse transpose they stay perpendicular, and outside stays outside under mirroring.
    let normal_matrix = placed.world.matrix3.inverse().transpose();
    mesh.normals.extend(vertices.normals.iter().map(|n| {
        let n_world = (normal_matrix * n.as_dvec3()).normalize_or_zero();
        n_world.as_vec3()
    }));
    let n = mesh.positions.len();
    for (all, new) in mesh.uvs.iter_mut().zip(&vertices.uvs) {
        extend(all, new, first, n, Vec2::ZERO);
    }
    extend(&mut mesh.colors, &vertices.colors, first, n, Vec4::ONE);
    let mirrored = placed.world.matrix3.determinant() < 0.0;
    let before = mesh.indices.len();
    for &[a, b, c] in &vertices.triangles {
        let corners = if mirrored { [a, c, b] } else { [a, b, c] };
        let corners = corners.map(|i| i + first as u32);
        if has_normal(corners.map(|i| mesh.positions[i as usize])) {
            mesh.indices.push(corners);
        }
    }
    let n_kept = mesh.indices.len() - before;
    mesh.materials
        .extend(std::iter::repeat_n(vertices.material, n_kept));
    Ok(vertices.triangles.len() - n_kept)
}

/// Appends an attribute for vertices `first..n`, filling up with `missing` where one of both sides has none.
fn extend<T: Copy>(all: &mut Vec<T>, new: &[T], first: usize, n: usize, missing: T) {
    if new.is_empty() && all.is_empty() {
        return;
    }
    all.resize(first, missing);
    all.extend(new);
    all.resize(n, missing);
}

fn check_size(n: usize, what: &'static str, placed: &Placed<'_>) -> Result<(), GltfError> {
    if n as u64 <= MAX_ELEMENTS {
        return Ok(());
    }
    Err(GltfError::TooMany {
        pointer: placed.pointer(),
        found: n as u64,
        what,
        limit: MAX_ELEMENTS,
    })
}

/// Whether the triangle's geometric normal can be computed, in f32 as rendering will.
fn has_normal([a, b, c]: [Vec3; 3]) -> bool {
    (b - a).cross(c - a).try_normalize().is_some()
}
