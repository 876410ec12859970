//! The gradient of path-traced light with respect to where it is gathered, by warped translation.
//!
//! When the gather point moves by δ, a vertex y of the path moves by α(y) δ with α = 1 at the gather point, falling to 0
//! before the nearest surface, light or boundary of a medium. No term is singular, so the variance is finite.
//!
//! ∇∫f = ∫ f [ Σ over segments ∂ ln(T G) + Σ over vertices (α ∂ ln σs + ∂α) ],  α(y) = (1 − ρ²/D²)² for ρ = |y − x| < D, else 0.
//!
//! Derivation: change of variables y → y + α(y) δ in every medium vertex and the divergence theorem; there is no boundary
//! term because α f vanishes where f jumps. With the vertices moving alike, the 1/r terms of neighbouring vertices cancel
//! (|α(y) − α(y')| ≤ Lip(α) |y − y'|).

use crate::path::{Source, Vertex, Visitor};
use glam::Vec3;
use tyndall_math::Ray;
use tyndall_media::Media;

/// Cosines on surfaces are kept above this in ∂ ln cosθ, which diverges at grazing incidence.
const COS_MIN: f32 = 1e-3;

/// An end of a path segment: where it is, how it moves, and the normal where it lies on a surface.
#[derive(Clone, Copy)]
struct End {
    position: Vec3,
    alpha: f32,
    normal: Option<Vec3>,
}

/// Accumulates value and gradient of the light that arrives at a point along one path, light straight from emitters left out.
pub(crate) struct WarpVisitor<'m> {
    media: &'m Media,
    center: Vec3,
    radius: f32,
    last: End,
    started: bool,
    /// ∂ ln f of the path so far, per colour channel.
    log_gradient: [Vec3; 3],
    pub(crate) value: Vec3,
    pub(crate) gradient: [Vec3; 3],
}

impl<'m> WarpVisitor<'m> {
    /// For paths that start at `center`; `radius` is the D of the displacement field.
    pub(crate) fn new(media: &'m Media, center: Vec3, radius: f32) -> Self {
        Self {
            media,
            center,
            radius,
            last: End {
                position: center,
                alpha: 1.0,
                normal: None,
            },
            started: false,
            log_gradient: [Vec3::ZERO; 3],
            value: Vec3::ZERO,
            gradient: [Vec3::ZERO; 3],
        }
    }

    /// α(y) and its gradient.
    fn alpha(&self, y: Vec3) -> (f32, Vec3) {
        let offset = y - self.center;
        let d2 = self.radius * self.radius;
        let s = 1.0 - offset.length_squared() / d2;
        if s > 0.0 {
            (s * s, offset * (-4.0 * s / d2))
        } else {
            (0.0, Vec3::ZERO)
        }
    }

    /// Adds what the segment from `a` to `b` and the vertex `b` do to ∂ ln f.
    fn extend(&self, log_gradient: &mut [Vec3; 3], a: End, b: End) {
        if a.alpha == 0.0 && b.alpha == 0.0 {
            return;
        }
        let tau = self.media.optical_depth_gradient(a.position, b.position);
        let geometry = geometry_log_gradient(a, b);
        for (sum, (d_a, d_b)) in log_gradient.iter_mut().zip(tau.d_a.iter().zip(&tau.d_b)) {
            *sum += geometry - *d_a * a.alpha - *d_b * b.alpha;
        }
    }

    fn extend_to_vertex(&self, log_gradient: &mut [Vec3; 3], vertex: Vertex<'_, '_>) -> End {
        match vertex {
            Vertex::Surface(position, normal) => {
                let end = End {
                    position,
                    alpha: 0.0,
                    normal: Some(normal),
                };
                self.extend(log_gradient, self.last, end);
                end
            }
            Vertex::Medium(position, medium) => {
                let (alpha, d_alpha) = self.alpha(position);
                let end = End {
                    position,
                    alpha,
                    normal: None,
                };
                self.extend(log_gradient, self.last, end);
                if alpha > 0.0 {
                    let density = medium.grad_ln_sigma_s();
                    for c in 0..3 {
                        log_gradient[c] += density[c] * alpha + d_alpha;
                    }
                }
                end
            }
        }
    }
}

/// ∂ ln of cosθₐ cosθᵦ / r² when the ends move by their α: with d the unit vector from a to b,
/// (αᵦ − αₐ) [ −2d + (nₐ/cosθₐ − d) + (−nᵦ/cosθᵦ − d) ] / r, the brackets in use only where an end lies on a surface.
fn geometry_log_gradient(a: End, b: End) -> Vec3 {
    let offset = b.position - a.position;
    let r = offset.length();
    let moves = b.alpha - a.alpha;
    if r <= 0.0 || moves == 0.0 {
        return Vec3::ZERO;
    }
    let d = offset / r;
    let mut sum = -2.0 * d;
    if let Some(n) = a.normal {
        sum += n / n.dot(d).max(COS_MIN) - d;
    }
    if let Some(n) = b.normal {
        sum -= n / (-n.dot(d)).max(COS_MIN) + d;
    }
    sum * (moves / r)
}

impl Visitor for WarpVisitor<'_> {
    fn vertex(&mut self, vertex: Vertex<'_, '_>) {
        let mut log_gradient = self.log_gradient;
        self.last = self.extend_to_vertex(&mut log_gradient, vertex);
        self.log_gradient = log_gradient;
        self.started = true;
    }

    fn light(&mut self, value: Vec3, last: Option<Vertex<'_, '_>>, source: Source) {
        if !self.started && last.is_none() {
            // Straight from an emitter: single scattering at the gather point, not ours.
            return;
        }
        let mut log_gradient = self.log_gradient;
        let from = match last {
            Some(vertex) => self.extend_to_vertex(&mut log_gradient, vertex),
            None => self.last,
        };
        match source {
            Source::Medium => {}
            Source::Point(position, normal) => {
                let light = End {
                    position,
                    alpha: 0.0,
                    normal: (normal != Vec3::ZERO).then_some(normal),
                };
                self.extend(&mut log_gradient, from, light);
            }
            Source::Far(w_i) if from.alpha > 0.0 => {
                let ray = Ray::new(from.position, w_i);
                let (_, tau) = self.media.optical_depth_gradient_rigid(&ray, f32::INFINITY);
                for c in 0..3 {
                    log_gradient[c] -= tau[c] * from.alpha;
                }
            }
            Source::Far(_) => {}
        }
        self.value += value;
        for c in 0..3 {
            self.gradient[c] += log_gradient[c] * value[c];
        }
    }
}
