//! Opaque triangles under rays: the nearest hit, occlusion, and what the surface is like where it is hit.
//!
//! [`Triangles`] joins a [`Hierarchy`] to materials: holes, shading normals, reflection and emission.

use crate::hierarchy::{Hierarchy, Met};
use crate::material::Material;
use crate::mesh::TriangleMesh;
use crate::texture::Texture;
use crate::watertight::TriangleHit;
use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;
use tyndall_math::{Aabb, Ray};
use tyndall_transport::{Geometry, SurfaceHit};

/// Triangles with the materials and textures they name; read by ray tracing and by lights alike.
#[derive(Debug, Default)]
pub struct Surfaces {
    /// The triangles.
    pub mesh: TriangleMesh,
    /// Materials; every index in the mesh lies within.
    pub materials: Vec<Material>,
    /// Textures; every reference in the materials lies within.
    pub textures: Vec<Texture>,
}

impl Surfaces {
    /// The material of a triangle.
    pub fn material(&self, triangle: u32) -> &Material {
        &self.materials[self.mesh.materials[triangle as usize] as usize]
    }
}

/// Surfaces ready for rays.
#[derive(Debug)]
pub struct Triangles {
    surfaces: Arc<Surfaces>,
    hierarchy: Hierarchy,
    /// Light of each emitting triangle.
    light_of_triangle: HashMap<u32, usize>,
    has_holes: bool,
}

impl Triangles {
    /// Makes `surfaces` ready for rays; `light_of_triangle` names the light of each emitting triangle, by its index in the
    /// mesh (see [`LightSet`](crate::lights::LightSet)).
    pub fn new(surfaces: Arc<Surfaces>, light_of_triangle: HashMap<u32, usize>) -> Self {
        let mesh = &surfaces.mesh;
        Self {
            hierarchy: Hierarchy::new(mesh.indices.len(), |triangle| mesh.corners(triangle)),
            has_holes: mesh
                .materials
                .iter()
                .any(|&m| surfaces.materials[m as usize].alpha_cutoff.is_some()),
            surfaces,
            light_of_triangle,
        }
    }

    /// The triangles, materials and textures.
    pub fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// The box around all triangles; empty where there are none.
    pub fn bounds(&self) -> Aabb {
        self.hierarchy.bounds()
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.hierarchy.len()
    }

    /// Whether there is no triangle at all.
    pub fn is_empty(&self) -> bool {
        self.hierarchy.is_empty()
    }

    /// Memory of the hierarchy in bytes; the mesh and its textures come on top.
    pub fn bytes(&self) -> usize {
        self.hierarchy.bytes()
    }

    /// Whether there is surface, not a hole, where a triangle is hit.
    fn is_solid(&self, triangle: u32, hit: &TriangleHit) -> bool {
        if !self.has_holes {
            return true;
        }
        let material = self.surfaces.material(triangle);
        if material.alpha_cutoff.is_none() {
            return true;
        }
        let Surfaces { mesh, textures, .. } = &*self.surfaces;
        let uv = mesh.uv(triangle as usize, hit.barycentric);
        let color = mesh.color(triangle as usize, hit.barycentric);
        !material.is_hole(textures, uv, color)
    }
}

impl Geometry for Triangles {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        let Met {
            triangle,
            hit,
            position,
            front_normal,
            size,
        } = self
            .hierarchy
            .nearest(ray, t_max, |triangle, hit| self.is_solid(triangle, hit))?;
        let Surfaces { mesh, textures, .. } = &*self.surfaces;
        let material = self.surfaces.material(triangle);
        let index = triangle as usize;

        let front = front_normal.dot(ray.direction) < 0.0;
        let normal = if front { front_normal } else { -front_normal };
        let [n0, n1, n2] = mesh.indices[index].map(|i| mesh.normals[i as usize]);
        let b = hit.barycentric;
        let interpolated = n0 * b.x + n1 * b.y + n2 * b.z;
        let uv = mesh.uv(index, b);
        let emission = material.emission(textures, uv, front);
        Some(SurfaceHit {
            t: hit.t,
            position,
            normal,
            bsdf: material.bsdf(
                textures,
                uv,
                mesh.color(index, b),
                shading_normal(interpolated, normal, -ray.direction),
            ),
            emission,
            light: if emission == Vec3::ZERO {
                None
            } else {
                self.light_of_triangle.get(&triangle).copied()
            },
            size,
        })
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.hierarchy
            .any(ray, t_max, |triangle, hit| self.is_solid(triangle, hit))
    }
}

/// The interpolated normal on the viewer's side of the surface, never pointing away from the viewer.
///
/// * `normal` – geometric normal on the viewer's side.
/// * `w_o` – towards the viewer.
///
/// A normal that leans away from the viewer is bent towards `w_o` just so far that a little of its front is seen; that
/// can only raise its cosine with `normal`, which stays positive. Without a usable normal it is the geometric one.
fn shading_normal(interpolated: Vec3, normal: Vec3, w_o: Vec3) -> Vec3 {
    /// Least cosine towards the viewer of a bent normal.
    const LEAST_COSINE: f32 = 1e-3;
    let Some(n) = interpolated.try_normalize() else {
        return normal;
    };
    let side = n.dot(normal);
    if side == 0.0 {
        return normal;
    }
    let n = n * side.signum();
    let cosine = n.dot(w_o);
    if cosine >= LEAST_COSINE {
        return n;
    }
    (n + w_o * (LEAST_COSINE - cosine)).normalize_or(normal)
}
