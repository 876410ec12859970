//! Where optical depth has kinks: the edges of boxes of medium, as seen from a point.
//!
//! Beside the direction of an edge, rays enter or leave the box by another face, or miss it: there the gradient of optical depth jumps.
//! When the point moves, so does the direction at which it jumps, and the second derivatives of an integral over directions have a share
//! that sits on the edges alone.

use crate::gradient::GRAZING;
use crate::line::Line;
use crate::{Density, Medium, Region};
use glam::{DMat3, DVec3};

/// The edges of all boxes of medium, as seen from one point.
#[derive(Clone, Debug)]
pub struct Edges<'a> {
    x: DVec3,
    list: Vec<Edge<'a>>,
    /// Of all weights.
    total: f64,
}

/// A point of an edge, chosen at random.
#[derive(Clone, Copy, Debug)]
pub struct EdgePoint {
    /// Unit vector to it.
    pub direction: DVec3,
    /// Its distance, in metres.
    pub distance: f64,
    /// The Hessian on the edge over the density of the choice, sr/m², for each colour channel; see [`Edges::sample`].
    pub hessian: [DMat3; 3],
}

#[derive(Clone, Copy, Debug)]
struct Edge<'a> {
    medium: &'a Medium,
    /// From x straight to the line of the edge.
    across: DVec3,
    /// Along the edge.
    along: DVec3,
    /// Between `across` and the direction of either end.
    angles: [f64; 2],
    /// −m̃ m̃ᵀ/(d₁ d₂ d).
    hessian: DMat3,
    /// In the choice among edges.
    weight: f64,
}

impl<'a> Edges<'a> {
    /// Those of `media`, as seen from `x`.
    pub(crate) fn new(media: impl Iterator<Item = &'a Medium>, x: DVec3) -> Self {
        let mut list = Vec::new();
        for medium in media {
            if let Region::Box { min, max } = *medium.region() {
                let corners = [min, max].map(|corner| corner.as_dvec3() - x);
                for axis in 0..3 {
                    for sides in [[0, 0], [0, 1], [1, 0], [1, 1]] {
                        list.extend(Edge::new(medium, x, corners, axis, sides));
                    }
                }
            }
        }
        let total = list.iter().map(|edge| edge.weight).sum();
        Self { x, list, total }
    }

    /// Chooses a point of an edge by two numbers in [0, 1); `None` where there is no edge.
    ///
    /// For any f(ω, r) of direction and distance, the mean of f times [`EdgePoint::hessian`] is the share of ∫ f Hτ dω that sits on the
    /// edges, τ being the optical depth beyond them when the point moves and the direction stays. On an edge between faces with outward
    /// normals N₁ and N₂, seen from x at the angle φ,
    ///
    /// Hτ dω = −σt ρ m̃ m̃ᵀ/(d₁ d₂ d) dφ,  m̃ = d₂ N₁ − d₁ N₂,  d = √(d₁² + d₂²)
    ///
    /// * dᵢ – distance in metres from x to the plane of face i, along Nᵢ;
    /// * σt ρ – extinction on the edge.
    ///
    /// For the distances tᵢ = dᵢ/(Nᵢ · ω) to both planes have ∇tᵢ = −Nᵢ/(Nᵢ · ω). With u = t₁ − t₂ the column is ρ min(t₁, t₂) where the
    /// ray leaves by both faces, −ρ max(t₁, t₂) where it enters, ρ max(0, ±u) where one face is behind the other; so its Hessian is
    /// ∓ρ δ(u) ∇u ∇uᵀ, and ∫ δ(u) dω = ∫ dφ/(r |∇u|), since a direction turned by dα moves the ray at distance r by r dα. At r,
    /// |∇u| = r d/|d₁ d₂|. Where x is within a milliradian of the plane of a face, bounded instead of exact. Tested against the Hessian of
    /// ∫ |p − x|⁻² dV over a box, which is that of its columns and sits on its edges alone.
    pub fn sample(&self, [u, v]: [f32; 2]) -> Option<EdgePoint> {
        let mut rest = f64::from(u) * self.total;
        let chosen = self.list.iter().find(|edge| {
            rest -= edge.weight;
            rest < 0.0
        });
        let edge = chosen.or(self.list.last())?;
        let [begin, end] = edge.angles;
        let (sin, cos) = (begin + f64::from(v) * (end - begin)).sin_cos();
        let d = edge.across.length();
        let direction = edge.across / d * cos + edge.along * sin;
        let distance = d / cos;
        let p = self.x + direction * distance;
        let density = edge.medium.density().jet(p).value;
        let over_pdf = self.total / edge.weight * (end - begin);
        let sigma_t = edge.medium.sigma_t().as_dvec3() * (density * over_pdf);
        Some(EdgePoint {
            direction,
            distance,
            hessian: sigma_t.to_array().map(|sigma_t| edge.hessian * sigma_t),
        })
    }
}

impl<'a> Edge<'a> {
    /// The edge along an `axis` on two `sides` (0 where coordinates are least) of a box whose `corners` are given from `x`; `None` where
    /// it has no weight, or no direction across.
    fn new(
        medium: &'a Medium,
        x: DVec3,
        corners: [DVec3; 2],
        axis: usize,
        sides: [usize; 2],
    ) -> Option<Self> {
        let axes = [(axis + 1) % 3, (axis + 2) % 3];
        let [(n1, d1), (n2, d2)] = [0, 1].map(|i| {
            let sign = if sides[i] == 0 { -1.0 } else { 1.0 };
            (
                sign * DVec3::AXES[axes[i]],
                sign * corners[sides[i]][axes[i]],
            )
        });
        let across = d1 * n1 + d2 * n2;
        let d = across.length();
        if d == 0.0 {
            return None;
        }
        let [a1, a2] = [d1, d2].map(|a| a.abs().max(GRAZING * d).copysign(a));
        let m = d2 * n1 - d1 * n2;
        let angles = corners.map(|corner| corner[axis].atan2(d));
        let densest = match medium.density() {
            Density::Grid(grid) => grid.max().into(),
            // Of a fog the density of the lower end, the larger.
            density @ (Density::Constant(_) | Density::Height { .. }) => {
                let lower = Line {
                    origin: x + across,
                    direction: corners[0][axis] * DVec3::AXES[axis],
                };
                density.along(&lower).value(1.0)
            }
        };
        let extinction = f64::from(medium.sigma_t().element_sum()) * densest;
        let weight = extinction * (d / (a1 * a2)).abs() * (angles[1] - angles[0]);
        (weight > 0.0).then(|| Self {
            medium,
            across,
            along: DVec3::AXES[axis],
            angles,
            hessian: DMat3::from_cols(m * m.x, m * m.y, m * m.z) * (-1.0 / (a1 * a2 * d)),
            weight,
        })
    }
}
