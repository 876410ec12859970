//! Triangles as a file gives them, already placed in the world.
//!
//! A glTF file becomes one mesh; ray tracing, lights and bounds read it and nothing else.

use glam::{Vec2, Vec3, Vec4};

/// Triangles in world space with their attributes per vertex.
///
/// Front faces wind counter-clockwise. Every index lies within `positions`, every position is finite, and no triangle
/// has zero area.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex positions in metres.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per vertex; [`Vec3::ZERO`] asks for the geometric normal.
    pub normals: Vec<Vec3>,
    /// Two sets of texture coordinates; a set that no primitive has is empty, otherwise one per vertex.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA colours, one per vertex, or empty where no primitive has colours (all white).
    pub colors: Vec<Vec4>,
    /// Vertices of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// Material of each triangle.
    pub materials: Vec<u32>,
}

impl TriangleMesh {
    /// Corners of a triangle, in winding order.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.indices[triangle].map(|i| self.positions[i as usize])
    }

    /// Texture coordinates at barycentric coordinates `b` (weights of the three corners), zero where the set is missing.
    pub fn uv(&self, triangle: usize, b: Vec3) -> [Vec2; 2] {
        [0, 1].map(|set| interpolate(&self.uvs[set], self.indices[triangle], b, Vec2::ZERO))
    }

    /// Vertex colour at barycentric coordinates `b`, white where there are no colours.
    pub fn color(&self, triangle: usize, b: Vec3) -> Vec4 {
        interpolate(&self.colors, self.indices[triangle], b, Vec4::ONE)
    }
}

/// Barycentric mean of an attribute, or `missing` where the mesh has none.
fn interpolate<T>(values: &[T], corners: [u32; 3], b: Vec3, missing: T) -> T
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    if values.is_empty() {
        return missing;
    }
    let [v0, v1, v2] = corners.map(|i| values[i as usize]);
    v0 * b.x + v1 * b.y + v2 * b.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_interpolate_and_missing_ones_take_their_default() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::ZERO; 3],
            uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::Y], Vec::new()],
            colors: Vec::new(),
            indices: vec![[0, 1, 2]],
            materials: vec![0],
        };
        let b = Vec3::new(0.25, 0.5, 0.25);
        assert_eq!(mesh.corners(0), [Vec3::ZERO, Vec3::X, Vec3::Y]);
        assert_eq!(mesh.uv(0, b), [Vec2::new(0.5, 0.25), Vec2::ZERO]);
        assert_eq!(mesh.color(0, b), Vec4::ONE);
    }
}
