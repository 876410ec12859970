//! The cells of a set of directions: which directions are neighbours, and the border between them.
//!
//! A set of gather directions stands for the whole sphere by its Voronoi cells. When the gather point moves, what the cells see
//! shifts along their borders, which is all that a derivative of visibility needs.

use glam::{DVec3, Vec3};
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// The arc between the Voronoi cells of two neighbouring directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// Indices of the two directions ω₀ and ω₁.
    pub cells: [u32; 2],
    /// Unit vectors to its ends, c₀ and c₁, in such order that (c₀ × c₁) · (ω₀ − ω₁) ≥ 0: cell 0 lies on the left of the way from c₀
    /// to c₁, seen from the origin.
    pub ends: [Vec3; 2],
}

/// The Voronoi diagram of directions on the unit sphere.
///
/// Dual to the spherical Delaunay triangulation, which is the planar one of the stereographic projection from one of the directions,
/// with a fan from that direction to the hull: circles stay circles (Brown 1979, "Voronoi diagrams from convex hulls"). Built in f64
/// with the exact predicates of `spade`.
#[derive(Clone, Debug, Default)]
pub struct SphericalVoronoi {
    borders: Vec<Border>,
}

impl SphericalVoronoi {
    /// The diagram of unit `directions`. Without borders where they are fewer than four, coincide, or are not finite.
    pub fn new(directions: &[Vec3]) -> Self {
        Self {
            borders: borders(directions).unwrap_or_default(),
        }
    }

    /// All borders, each once.
    pub fn borders(&self) -> &[Border] {
        &self.borders
    }
}

fn borders(directions: &[Vec3]) -> Option<Vec<Border>> {
    let (pole, rest) = directions.split_first()?;
    if rest.len() < 3 {
        return None;
    }
    let d: Vec<DVec3> = directions
        .iter()
        .map(|d| d.as_dvec3().normalize())
        .collect();
    let frame = Frame::new(pole.as_dvec3().normalize());
    let points: Option<Vec<Point2<f64>>> = d[1..].iter().map(|&d| frame.project(d)).collect();
    let plane = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points?).ok()?;
    if plane.num_vertices() != rest.len() || plane.num_inner_faces() == 0 {
        return None;
    }
    // The projection looks at the sphere from inside: what winds counter-clockwise in the plane does so seen from the centre.
    let center = |[a, b, c]: [usize; 3]| (d[c] - d[a]).cross(d[b] - d[a]).try_normalize();
    let border = |i: usize, j: usize, a: DVec3, b: DVec3| {
        let left = a.cross(b).dot(d[i] - d[j]) >= 0.0;
        Border {
            cells: [i as u32, j as u32],
            ends: if left { [a, b] } else { [b, a] }.map(|end| end.as_vec3()),
        }
    };
    let inner: Option<Vec<DVec3>> = plane
        .inner_faces()
        .map(|face| center(face.vertices().map(|v| v.index() + 1)))
        .collect();
    let inner = inner?;
    // Faces by index; the outer one is number 0.
    let of_edge = |edge: spade::handles::DirectedEdgeHandle<'_, Point2<f64>, (), (), ()>| {
        if edge.is_outer_edge() {
            center([edge.from().index() + 1, edge.to().index() + 1, 0])
        } else {
            edge.face().as_inner().map(|face| inner[face.index() - 1])
        }
    };
    let mut borders = Vec::with_capacity(3 * d.len());
    for edge in plane.undirected_edges() {
        let [one, other] = [edge.as_directed(), edge.as_directed().rev()];
        borders.push(border(
            one.from().index() + 1,
            one.to().index() + 1,
            of_edge(one)?,
            of_edge(other)?,
        ));
        for outer in [one, other].into_iter().filter(|e| e.is_outer_edge()) {
            let corner = outer.to().index() + 1;
            borders.push(border(0, corner, of_edge(outer)?, of_edge(outer.next())?));
        }
    }
    Some(borders)
}

/// A pole and two axes across it.
struct Frame {
    pole: DVec3,
    across: [DVec3; 2],
}

impl Frame {
    fn new(pole: DVec3) -> Self {
        let (u, v) = pole.any_orthonormal_pair();
        Self {
            pole,
            across: [u, v],
        }
    }

    /// Stereographic projection from the pole onto the plane through the centre; `None` at the pole itself.
    fn project(&self, d: DVec3) -> Option<Point2<f64>> {
        // 1 − d·pole without cancellation.
        let below = 0.5 * (d - self.pole).length_squared();
        let [x, y] = self.across.map(|axis| d.dot(axis) / below);
        (below > 0.0 && x.is_finite() && y.is_finite()).then(|| Point2::new(x, y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spherical::solid_angle;
    use crate::{Key, Purpose, Sampler, SphericalFibonacci, warp};

    fn random(n: u64, seed: u64, share: f32) -> Vec<Vec3> {
        let key = Key {
            seed,
            purpose: Purpose::Probe,
            index: 0,
        };
        (0..n)
            .map(|i| {
                let [u, v] = Sampler::new(key, i).next_2d();
                warp::uniform_sphere([u * share, v])
            })
            .collect()
    }

    fn areas(directions: &[Vec3]) -> Vec<f64> {
        let mut areas = vec![0.0; directions.len()];
        for Border { cells, ends } in SphericalVoronoi::new(directions).borders() {
            let [a, b] = ends.map(|e| e.as_dvec3());
            areas[cells[0] as usize] +=
                solid_angle([directions[cells[0] as usize].as_dvec3(), a, b]);
            areas[cells[1] as usize] +=
                solid_angle([directions[cells[1] as usize].as_dvec3(), b, a]);
        }
        areas
    }

    #[test]
    fn cells_tile_the_sphere() {
        let sphere = 4.0 * std::f64::consts::PI;
        for directions in [
            random(4, 1, 1.0),
            random(200, 2, 1.0),
            random(200, 3, 0.02),
            SphericalFibonacci::new(1000, [0.1, 0.7, 0.4])
                .iter()
                .collect(),
        ] {
            let areas = areas(&directions);
            let sum: f64 = areas.iter().sum();
            assert!((sum / sphere - 1.0).abs() < 1e-5, "{sum}");
        }
        let even: Vec<Vec3> = SphericalFibonacci::new(500, [0.6, 0.2, 0.9])
            .iter()
            .collect();
        for area in areas(&even) {
            // Swinbank and Purser 2006: cells of the spiral are equal but at the poles.
            assert!((area * 500.0 / sphere - 1.0).abs() < 0.15, "{area}");
        }
        assert_eq!(SphericalVoronoi::new(&even).borders().len(), 3 * 500 - 6);
    }

    #[test]
    fn ends_of_a_border_are_as_far_from_both_cells_and_no_other_direction_is_nearer() {
        let directions = random(60, 5, 1.0);
        for Border { cells, ends } in SphericalVoronoi::new(&directions).borders() {
            let [i, j] = cells.map(|c| directions[c as usize]);
            for end in ends {
                let nearest = directions
                    .iter()
                    .map(|d| d.distance(*end))
                    .fold(4.0, f32::min);
                assert!((i.distance(*end) - nearest).abs() < 1e-5);
                assert!((j.distance(*end) - nearest).abs() < 1e-5);
            }
            assert!(ends[0].cross(ends[1]).dot(i - j) >= 0.0);
        }
    }

    #[test]
    fn the_axes_have_the_edges_of_a_cube_between_them() {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|a| [a, -a]).concat();
        let diagram = SphericalVoronoi::new(&axes);
        let long = diagram
            .borders()
            .iter()
            .filter(|b| b.ends[0].distance(b.ends[1]) > 1.0);
        assert_eq!(long.count(), 12);
    }

    #[test]
    fn what_is_no_set_of_directions_has_no_borders() {
        let three = random(3, 7, 1.0);
        let mut twice = random(20, 8, 1.0);
        twice.push(twice[4]);
        let mut broken = random(20, 9, 1.0);
        broken[3].x = f32::NAN;
        for directions in [Vec::new(), three, twice, broken] {
            assert!(SphericalVoronoi::new(&directions).borders().is_empty());
        }
    }
}
