//! What an emitting triangle sends out, point by point.

use crate::triangles::Surfaces;
use glam::{Vec2, Vec3};
use std::sync::Arc;
use tyndall_transport::importance::mean;

/// Emitted radiance over a triangle or rectangle.
#[derive(Clone, Debug)]
pub enum Emission {
    /// The same everywhere, W/(m² sr).
    Constant(Vec3),
    /// By the textures of a triangle of the mesh: what emits, and where there are holes.
    Textured {
        /// Mesh, materials and textures.
        surfaces: Arc<Surfaces>,
        /// Index of the triangle in the mesh.
        triangle: u32,
        /// Mean over the triangle, W/(m² sr).
        mean: Vec3,
    },
}

impl Emission {
    /// The emission of a triangle of the mesh; `None` where it emits nothing.
    pub fn of_triangle(surfaces: &Arc<Surfaces>, triangle: u32) -> Option<Self> {
        let material = surfaces.material(triangle);
        if !material.is_emissive() {
            return None;
        }
        if material.emissive_texture.is_none() && material.alpha_cutoff.is_none() {
            return Some(Self::Constant(material.emissive));
        }
        let n = lattice_size(surfaces, triangle);
        let mut sum = Vec3::ZERO;
        for b in lattice(n) {
            sum += radiance(surfaces, triangle, b);
        }
        let mean = sum / (n * n) as f32;
        // A lattice finer than the texels that sees nothing but black has seen everything.
        let seen_all = n < LARGEST_LATTICE;
        if seen_all && mean == Vec3::ZERO {
            return None;
        }
        Some(Self::Textured {
            surfaces: Arc::clone(surfaces),
            triangle,
            mean,
        })
    }

    /// Radiance at barycentric coordinates `b` of the triangle, W/(m² sr), on a side that emits.
    pub fn radiance(&self, b: Vec3) -> Vec3 {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Textured {
                surfaces, triangle, ..
            } => radiance(surfaces, *triangle, b),
        }
    }

    /// Mean radiance over the triangle, W/(m² sr).
    pub fn mean(&self) -> Vec3 {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Textured { mean, .. } => *mean,
        }
    }

    /// The number by which the light is chosen; positive even where a coarse look at the texture saw only black.
    pub(super) fn weight(&self) -> f32 {
        /// Share of the untextured radiance that an unseen speck may still hold.
        const SPECK: f32 = 1e-3;
        match self {
            Self::Constant(radiance) => mean(*radiance),
            Self::Textured {
                surfaces,
                triangle,
                mean: seen,
            } => {
                let whole = surfaces.material(*triangle).emissive;
                mean(*seen).max(SPECK * mean(whole))
            }
        }
    }
}

fn radiance(surfaces: &Surfaces, triangle: u32, b: Vec3) -> Vec3 {
    let Surfaces { mesh, textures, .. } = surfaces;
    let material = surfaces.material(triangle);
    let uv = mesh.uv(triangle as usize, b);
    if material.is_hole(textures, uv, mesh.color(triangle as usize, b)) {
        return Vec3::ZERO;
    }
    // Whether the other side emits too is the light's affair.
    material.emission(textures, uv, true)
}

/// Most sub-triangles along an edge at which a texture is looked at.
const LARGEST_LATTICE: usize = 64;

/// Sub-triangles along an edge such that two stand on every texel, within bounds.
fn lattice_size(surfaces: &Surfaces, triangle: u32) -> usize {
    let material = surfaces.material(triangle);
    let maps = [&material.emissive_texture, &material.base_color_texture];
    let longest = maps.into_iter().flatten().map(|map| {
        let (width, height) = surfaces.textures[map.texture as usize].size();
        let texels = Vec2::new(width as f32, height as f32);
        let [a, b, c] = [Vec3::X, Vec3::Y, Vec3::Z].map(|corner| {
            let uv = surfaces.mesh.uv(triangle as usize, corner);
            map.transform * uv[map.tex_coord] * texels
        });
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    });
    // A cast from a float saturates, and NaN becomes 0.
    ((2.0 * longest.fold(0.0, f32::max)).ceil() as usize).clamp(4, LARGEST_LATTICE)
}

/// Barycentric centres of the n² equal sub-triangles of a triangle.
fn lattice(n: usize) -> impl Iterator<Item = Vec3> {
    (0..n).flat_map(move |i| {
        (0..2 * (n - i) - 1).map(move |k| {
            // Even k: sub-triangles that stand upright; odd k: those upside down between them.
            let third = if k % 2 == 0 { 1.0 / 3.0 } else { 2.0 / 3.0 };
            let y = (i as f32 + third) / n as f32;
            let z = ((k / 2) as f32 + third) / n as f32;
            Vec3::new(1.0 - y - z, y, z)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattice_points_are_as_many_as_sub_triangles_lie_inside_and_average_to_the_centre() {
        for n in [1, 2, 5, 64] {
            let points: Vec<_> = lattice(n).collect();
            assert_eq!(points.len(), n * n);
            assert!(points.iter().all(|b| b.min_element() > 0.0));
            let mean = points.iter().sum::<Vec3>() / points.len() as f32;
            assert!(
                (mean - Vec3::splat(1.0 / 3.0)).length() < 1e-5,
                "rounding only"
            );
        }
    }
}
