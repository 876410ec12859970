//! Triangle meshes built from flat polygons, prisms and round shafts. Faces turn counter-clockwise seen from outside.

use glam::Vec3;
use std::f32::consts::TAU;

/// Triangles with a normal at each vertex, in metres.
#[derive(Default)]
pub(super) struct Mesh {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) indices: Vec<u32>,
}

impl Mesh {
    /// A flat convex polygon, counter-clockwise seen from its lit side.
    pub(super) fn polygon(&mut self, corners: &[Vec3]) -> &mut Self {
        let normal = (corners[1] - corners[0])
            .cross(corners[2] - corners[0])
            .normalize();
        self.fan(corners, |_| normal)
    }

    /// A closed solid: a flat convex polygon, counter-clockwise seen from where `along` points to, and its copy shifted
    /// by `along`.
    pub(super) fn prism(&mut self, profile: &[Vec3], along: Vec3) -> &mut Self {
        let shifted: Vec<Vec3> = profile.iter().map(|p| p + along).collect();
        let reversed: Vec<Vec3> = profile.iter().rev().copied().collect();
        self.polygon(&shifted).polygon(&reversed);
        for (a, b) in edges(profile) {
            self.polygon(&[a, b, b + along, a + along]);
        }
        self
    }

    /// A box between two corners.
    pub(super) fn cuboid(&mut self, min: impl Into<Vec3>, max: impl Into<Vec3>) -> &mut Self {
        let (min, max) = (min.into(), max.into());
        let corner = |x, z| Vec3::new(x, min.y, z);
        let floor = [
            corner(min.x, max.z),
            corner(max.x, max.z),
            corner(max.x, min.z),
            corner(min.x, min.z),
        ];
        self.prism(&floor, Vec3::Y * (max.y - min.y))
    }

    /// The upright side of a round column, smooth over its facets and open at both ends.
    pub(super) fn shaft(
        &mut self,
        foot: Vec3,
        radius: f32,
        height: f32,
        facets: usize,
    ) -> &mut Self {
        let up = Vec3::Y * height;
        for (a, b) in edges(&ring(foot, Vec3::X * radius, Vec3::NEG_Z * radius, facets)) {
            self.fan(&[a, b, b + up, a + up], |p| {
                ((p - foot) * Vec3::new(1.0, 0.0, 1.0)).normalize()
            });
        }
        self
    }

    fn fan(&mut self, corners: &[Vec3], normal: impl Fn(Vec3) -> Vec3) -> &mut Self {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.normals.extend(corners.iter().map(|&p| normal(p)));
        for i in 2..corners.len() as u32 {
            self.indices.extend([first, first + i - 1, first + i]);
        }
        self
    }
}

/// Corners of a regular polygon around `center`, from `axis_u` towards `axis_v`; the axes are as long as its radius.
pub(super) fn ring(center: Vec3, axis_u: Vec3, axis_v: Vec3, corners: usize) -> Vec<Vec3> {
    let angle = |i| TAU * i as f32 / corners as f32;
    let corner = |i| center + axis_u * f32::cos(angle(i)) + axis_v * f32::sin(angle(i));
    (0..corners).map(corner).collect()
}

fn edges(polygon: &[Vec3]) -> impl Iterator<Item = (Vec3, Vec3)> {
    polygon
        .iter()
        .copied()
        .zip(polygon.iter().copied().cycle().skip(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six times the volume enclosed, positive where faces look outwards.
    fn volume(mesh: &Mesh) -> f32 {
        let p = |i: u32| mesh.positions[i as usize];
        mesh.indices
            .chunks(3)
            .map(|t| p(t[0]).dot(p(t[1]).cross(p(t[2]))))
            .sum::<f32>()
            / 6.0
    }

    #[test]
    fn a_cuboid_is_closed_and_looks_outwards() {
        let mut mesh = Mesh::default();
        mesh.cuboid([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]);
        assert_eq!(volume(&mesh), 6.0);
    }

    #[test]
    fn a_shaft_looks_outwards() {
        let mut mesh = Mesh::default();
        mesh.shaft(Vec3::ZERO, 1.0, 1.0, 24);
        for triangle in mesh.indices.chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|i| mesh.positions[triangle[i] as usize]);
            assert!((b - a).cross(c - a).dot(mesh.normals[triangle[0] as usize]) > 0.0);
        }
    }
}
