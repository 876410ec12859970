//! From emissive triangles to lights.
//!
//! Two triangles that make up a rectangle of one colour become one light, which is sampled better than its halves.

use super::{Emission, Light, QuadLight, TriangleLight};
use crate::hierarchy::geometric_normal;
use crate::triangles::Surfaces;
use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;

/// A light and the triangles of the mesh that it is.
pub(super) struct Emitter {
    pub(super) light: Light,
    pub(super) triangles: Vec<u32>,
}

/// The emitters among the triangles of `surfaces`, in their order.
pub(super) fn find(surfaces: &Arc<Surfaces>) -> Vec<Emitter> {
    let n_triangles = surfaces.mesh.indices.len() as u32;
    let emitting: Vec<(u32, Emission)> = (0..n_triangles)
        .filter_map(|t| Some((t, Emission::of_triangle(surfaces, t)?)))
        .collect();
    let pairs = pair_rectangles(surfaces, &emitting);
    let mut emitters = Vec::new();
    for (triangle, emission) in emitting {
        let double_sided = surfaces.material(triangle).double_sided;
        match pairs.get(&triangle) {
            // The later half of a pair was taken along with the first.
            Some(rectangle) if rectangle.other < triangle => {}
            Some(rectangle) => emitters.push(Emitter {
                light: Light::Quad(QuadLight::new(
                    rectangle.corner,
                    rectangle.edges,
                    emission.mean(),
                    double_sided,
                )),
                triangles: vec![triangle, rectangle.other],
            }),
            None => emitters.push(Emitter {
                light: Light::Triangle(TriangleLight::new(
                    surfaces.mesh.corners(triangle as usize),
                    emission,
                    double_sided,
                )),
                triangles: vec![triangle],
            }),
        }
    }
    emitters
}

/// A rectangle, as one of its two triangles sees it.
struct Rectangle {
    other: u32,
    corner: Vec3,
    edges: [Vec3; 2],
}

/// An edge between two points, whatever its direction: the bits of their coordinates, the smaller first.
type EdgeKey = [[u32; 3]; 2];

fn edge_key(a: Vec3, b: Vec3) -> EdgeKey {
    // Adding 0 turns −0 into 0: they are one place.
    let mut key = [a, b].map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
    key.sort_unstable();
    key
}

/// Partners among triangles of constant emission that share their longest edge and form a rectangle.
fn pair_rectangles(surfaces: &Surfaces, emitting: &[(u32, Emission)]) -> HashMap<u32, Rectangle> {
    let mut waiting: HashMap<EdgeKey, Vec<u32>> = HashMap::new();
    let mut pairs = HashMap::new();
    for &(triangle, ref emission) in emitting {
        if !matches!(emission, Emission::Constant(_)) {
            continue;
        }
        let [_, b, c] = from_right_angle(surfaces.mesh.corners(triangle as usize));
        let candidates = waiting.entry(edge_key(b, c)).or_default();
        let partner = candidates
            .iter()
            .position(|&other| same_rectangle(surfaces, triangle, other));
        match partner {
            Some(place) => {
                let other = candidates.swap_remove(place);
                pairs.insert(triangle, rectangle(surfaces, triangle, other));
                pairs.insert(other, rectangle(surfaces, other, triangle));
            }
            None => candidates.push(triangle),
        }
    }
    pairs
}

/// The corners turned, in winding order, so that the longest edge is the one opposite to the first.
fn from_right_angle([a, b, c]: [Vec3; 3]) -> [Vec3; 3] {
    let lengths = [
        b.distance_squared(c),
        c.distance_squared(a),
        a.distance_squared(b),
    ];
    if lengths[0] >= lengths[1] && lengths[0] >= lengths[2] {
        [a, b, c]
    } else if lengths[1] >= lengths[2] {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

fn rectangle(surfaces: &Surfaces, triangle: u32, other: u32) -> Rectangle {
    let [a, b, c] = from_right_angle(surfaces.mesh.corners(triangle as usize));
    Rectangle {
        other,
        corner: a,
        edges: [b - a, c - a],
    }
}

/// Whether two triangles that share their longest edge look alike and fill a rectangle, to rounding.
fn same_rectangle(surfaces: &Surfaces, first: u32, second: u32) -> bool {
    /// How far corners and cosines may be off, relative to the diagonal: the rounding of a transformed mesh some ten
    /// times its size away from the origin.
    const TOLERANCE: f32 = 1e-5;
    let mesh = &surfaces.mesh;
    if mesh.materials[first as usize] != mesh.materials[second as usize] {
        return false;
    }
    let [first, second] = [first, second].map(|t| from_right_angle(mesh.corners(t as usize)));
    let [a, b, c] = first;
    let [opposite, ..] = second;
    let diagonal = b.distance(c);
    let right_angle = (b - a).normalize_or_zero().dot((c - a).normalize_or_zero());
    right_angle.abs() <= TOLERANCE
        && (b + (c - a)).distance(opposite) <= TOLERANCE * diagonal
        && geometric_normal(first).dot(geometric_normal(second)) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::mesh::TriangleMesh;

    /// Emitting triangles with the given corners, all of one material.
    fn surfaces(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Arc<Surfaces> {
        let positions: Vec<Vec3> = positions.iter().map(|&p| p.into()).collect();
        let mesh = TriangleMesh {
            normals: vec![Vec3::ZERO; positions.len()],
            materials: vec![0; indices.len()],
            indices: indices.to_vec(),
            positions,
            ..TriangleMesh::default()
        };
        let material = Material {
            emissive: Vec3::ONE,
            ..Material::default()
        };
        Arc::new(Surfaces {
            mesh,
            materials: vec![material],
            textures: Vec::new(),
        })
    }

    fn kinds(surfaces: &Arc<Surfaces>) -> (usize, usize) {
        let emitters = find(surfaces);
        let n_quads = emitters
            .iter()
            .filter(|e| matches!(e.light, Light::Quad(_)))
            .count();
        (n_quads, emitters.len() - n_quads)
    }

    const RECTANGLE: [[f32; 3]; 4] = [
        [0.0, 0.0, 1.0],
        [2.0, 0.0, 1.0],
        [2.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
    ];

    #[test]
    fn two_halves_of_a_rectangle_are_one_light_however_their_corners_are_listed() {
        for indices in [
            [[0, 1, 2], [0, 2, 3]],
            [[2, 0, 1], [3, 0, 2]],
            [[1, 2, 3], [3, 0, 1]],
        ] {
            let surfaces = surfaces(&RECTANGLE, &indices);
            let emitters = find(&surfaces);
            assert_eq!(emitters.len(), 1);
            assert_eq!(emitters[0].triangles, [0, 1]);
            let Light::Quad(quad) = &emitters[0].light else {
                panic!("not a quad: {:?}", emitters[0].light);
            };
            assert_eq!(quad.flat().area(), 2.0);
            assert_eq!(quad.flat().normal(), Vec3::Z);
            assert_eq!(quad.flat().center(), Vec3::new(1.0, 0.5, 1.0));
        }
    }

    #[test]
    fn vertices_need_not_be_shared_but_places_must() {
        let mut positions = RECTANGLE.to_vec();
        positions.extend([RECTANGLE[0], RECTANGLE[2]]);
        assert_eq!(
            kinds(&surfaces(&positions, &[[0, 1, 2], [4, 5, 3]])),
            (1, 0)
        );
        positions[4][0] = 0.1;
        assert_eq!(
            kinds(&surfaces(&positions, &[[0, 1, 2], [4, 5, 3]])),
            (0, 2)
        );
    }

    #[test]
    fn what_is_no_flat_rectangle_of_one_facing_stays_two_triangles() {
        // Opposite winding.
        assert_eq!(
            kinds(&surfaces(&RECTANGLE, &[[0, 1, 2], [0, 3, 2]])),
            (0, 2)
        );
        // Folded along the diagonal, and sheared.
        for moved in [[0.0, 1.0, 1.1], [0.3, 1.0, 1.0]] {
            let mut positions = RECTANGLE;
            positions[3] = moved;
            assert_eq!(
                kinds(&surfaces(&positions, &[[0, 1, 2], [0, 2, 3]])),
                (0, 2)
            );
        }
        let mut sheared = RECTANGLE;
        sheared[2][0] += 0.3;
        sheared[3][0] += 0.3;
        assert_eq!(kinds(&surfaces(&sheared, &[[0, 1, 2], [0, 2, 3]])), (0, 2));
    }

    #[test]
    fn a_strip_of_squares_pairs_square_by_square() {
        let positions: Vec<[f32; 3]> = (0..=5)
            .flat_map(|i| [[i as f32, 0.0, 0.0], [i as f32, 1.0, 0.0]])
            .collect();
        let indices: Vec<[u32; 3]> = (0..5)
            .flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]])
            .collect();
        assert_eq!(kinds(&surfaces(&positions, &indices)), (5, 0));
    }
}
