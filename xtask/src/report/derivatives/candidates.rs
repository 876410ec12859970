//! Derivatives of light gathered along many directions in a vacuum, in ways that have been published or tried.

use super::quads::{NORMAL, Quads};
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use tyndall_math::spherical::{SphericalVoronoi, edge, edge_jacobian};
use tyndall_math::{Sampler, SphericalFibonacci};

/// Where rays that meet nothing are taken to end, metres: black walls, far beyond all else.
const FAR: f64 = 8.0;

/// What a gather ray saw.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    w: DVec3,
    /// Distance to a surface, if one was met.
    hit: Option<f64>,
    radiance: f64,
}

impl Sample {
    fn new(quads: &Quads, x: DVec3, w: DVec3) -> Self {
        let met = quads.cast(x, w);
        Self {
            w,
            hit: met.as_ref().map(|met| met.t),
            radiance: met.map_or(0.0, |met| met.radiance),
        }
    }

    fn t(&self) -> f64 {
        self.hit.unwrap_or(FAR)
    }

    /// Depth in direction `w` of the plane that was met, as `tyndall_transport`'s `occlusion` has it.
    fn depth(&self, w: DVec3) -> f64 {
        let Some(t) = self.hit else {
            return f64::INFINITY;
        };
        let along = t * self.w.dot(NORMAL) / w.dot(NORMAL);
        if along > 0.0 {
            along.clamp(0.5 * t, 2.0 * t)
        } else {
            2.0 * t
        }
    }
}

/// Directions with borders between them, made once and turned.
pub(super) struct Pattern {
    directions: Vec<DVec3>,
    borders: Vec<Border>,
}

struct Border {
    cells: [usize; 2],
    ends: [DVec3; 2],
    /// At each end the cells that meet there: a Delaunay triangle.
    triangles: [Vec<usize>; 2],
}

impl Pattern {
    pub(super) fn new(n: u32) -> Self {
        let directions: Vec<_> = SphericalFibonacci::new(n, [0.0; 3]).iter().collect();
        let cells = SphericalVoronoi::new(&directions);
        // Borders that end at one point share its bits.
        let mut corners: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
        let bits = |end: glam::Vec3| end.to_array().map(f32::to_bits);
        for border in cells.borders() {
            for end in border.ends {
                let corner = corners.entry(bits(end)).or_default();
                for cell in border.cells.map(|c| c as usize) {
                    if !corner.contains(&cell) {
                        corner.push(cell);
                    }
                }
            }
        }
        let borders = cells.borders().iter().map(|border| Border {
            cells: border.cells.map(|c| c as usize),
            ends: border.ends.map(|e| e.as_dvec3()),
            triangles: border.ends.map(|e| corners[&bits(e)].clone()),
        });
        Self {
            borders: borders.collect(),
            directions: directions.iter().map(|d| d.as_dvec3()).collect(),
        }
    }

    pub(super) fn see(&self, quads: &Quads, x: DVec3, turn: DQuat) -> Vec<Sample> {
        let directions = self.directions.iter();
        directions
            .map(|&d| Sample::new(quads, x, (turn * d).normalize()))
            .collect()
    }

    /// The area form: points of the light keep their places, and what is visible stays visible.
    pub(super) fn blind(&self, seen: &[Sample]) -> DVec3 {
        let lit = seen.iter().filter(|s| s.radiance > 0.0);
        let sum: DVec3 = lit
            .map(|s| (3.0 * s.w - NORMAL / NORMAL.dot(s.w)) * (s.radiance / s.t()))
            .sum();
        sum * (4.0 * PI / seen.len() as f64)
    }

    /// The area form and silhouettes with κ, as the renderer has them, of one set of directions.
    pub(super) fn kept(&self, seen: &[Sample], turn: DQuat) -> DVec3 {
        let mut sum = self.blind(seen);
        for Border { cells, ends, .. } in &self.borders {
            let ends = ends.map(|end| turn * end);
            let w = (ends[0] + ends[1]).normalize();
            let [i, j] = cells.map(|c| &seen[c]);
            let (di, dj) = (i.depth(w), j.depth(w));
            let (near, far_depth, far, side) = if di < dj {
                (di, dj, j, -1.0)
            } else {
                (dj, di, i, 1.0)
            };
            if far.radiance > 0.0 {
                let kappa = (1.0 - near / far_depth).max(0.0);
                sum += edge(ends[0] * near, ends[1] * near) * (side * far.radiance * kappa);
            }
        }
        sum
    }

    /// Voronoi cells of constant radiance whose borders lie at the nearer of both depths.
    pub(super) fn voronoi(&self, seen: &[Sample], turn: DQuat) -> (DVec3, DMat3) {
        let (mut gradient, mut hessian) = (DVec3::ZERO, DMat3::ZERO);
        for Border { cells, ends, .. } in &self.borders {
            let [i, j] = cells.map(|c| &seen[c]);
            let jump = i.radiance - j.radiance;
            if jump != 0.0 {
                let [a, b] = ends.map(|end| turn * end * i.t().min(j.t()));
                gradient += jump * edge(a, b);
                hessian += edge_jacobian(a, b) * jump;
            }
        }
        (gradient, symmetric(hessian))
    }

    /// Triangles through the points hit, each of the radiance of its vertex farthest from the gather point.
    pub(super) fn far_vertex(&self, seen: &[Sample]) -> (DVec3, DMat3) {
        let radiance = |triangle: &[usize]| {
            let corners = triangle.iter().map(|&c| &seen[c]);
            let farthest = corners.max_by(|a, b| a.t().total_cmp(&b.t()));
            farthest.map_or(0.0, |s| s.radiance)
        };
        let (mut gradient, mut hessian) = (DVec3::ZERO, DMat3::ZERO);
        for Border {
            cells, triangles, ..
        } in &self.borders
        {
            // The way from cell 0 to cell 1 has the border's second end on its left.
            let [right, left] = [&triangles[0], &triangles[1]].map(|t| radiance(t));
            if left != right {
                let [a, b] = cells.map(|c| seen[c].w * seen[c].t());
                gradient += edge(a, b) * (left - right);
                hessian += edge_jacobian(a, b) * (left - right);
            }
        }
        (gradient, symmetric(hessian))
    }
}

fn symmetric(m: DMat3) -> DMat3 {
    0.5 * (m + m.transpose())
}

/// Cells of equal size between parallels and meridians, one random direction in each, and walls at the nearer depth: Ward and
/// Heckbert 1992 for the whole sphere, without the cosine.
pub(super) fn strata(
    quads: &Quads,
    x: DVec3,
    n: usize,
    turn: DQuat,
    sampler: &mut Sampler,
) -> DVec3 {
    // From twice to four times as many meridians as parallels.
    let rows = 1 << ((n / 2).ilog2() / 2);
    let columns = n / rows;
    let step = TAU / columns as f64;
    let theta = |row: usize| {
        (1.0 - 2.0 * row as f64 / rows as f64)
            .clamp(-1.0, 1.0)
            .acos()
    };
    let seen: Vec<Vec<Sample>> = (0..rows)
        .map(|row| {
            let mut cell = |column: usize| {
                let [u, v] = sampler.next_2d().map(f64::from);
                let z = 1.0 - 2.0 * (row as f64 + u) / rows as f64;
                let r = (1.0 - z * z).max(0.0).sqrt();
                let (sin, cos) = ((column as f64 + v) * step).sin_cos();
                Sample::new(
                    quads,
                    x,
                    (turn * DVec3::new(r * cos, r * sin, z)).normalize(),
                )
            };
            (0..columns).map(&mut cell).collect()
        })
        .collect();
    let mut sum = DVec3::ZERO;
    let mut wall = |one: &Sample, other: &Sample, outward: DVec3, length: f64| {
        sum -= outward * ((one.radiance - other.radiance) * length / one.t().min(other.t()));
    };
    for row in 0..rows {
        for column in 0..columns {
            let here = &seen[row][column];
            let (sin, cos) = (column as f64 * step).sin_cos();
            let before = &seen[row][(column + columns - 1) % columns];
            wall(
                before,
                here,
                DVec3::new(-sin, cos, 0.0),
                theta(row + 1) - theta(row),
            );
            if row > 0 {
                let (sin, cos) = ((column as f64 + 0.5) * step).sin_cos();
                let (sin_theta, cos_theta) = theta(row).sin_cos();
                let south = DVec3::new(cos_theta * cos, cos_theta * sin, -sin_theta);
                wall(&seen[row - 1][column], here, south, sin_theta * step);
            }
        }
    }
    turn * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_cells_meet_at_the_ends_of_borders() {
        for n in [256, 2048] {
            let pattern = Pattern::new(n);
            let all = pattern.borders.iter().flat_map(|b| &b.triangles);
            assert!(all.into_iter().all(|corner| corner.len() == 3));
        }
    }
}
