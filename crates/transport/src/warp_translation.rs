//! The gradient of path-traced light with respect to where it is gathered, by warped translation.
//!
//! When the gather point moves by δ, a vertex y of the path moves by α(y) δ with α = 1 at the gather point, falling to 0
//! before the nearest surface, light or boundary of a medium. No term is singular, so the variance is finite.
//!
//! ∇∫f = ∫ f [ Σ over segments ∂ ln(T G) + Σ over vertices (α ∂ ln σs + ∂α) ],  α(y) = (1 − ρ²/D²)² for ρ = |y − x| < D, else 0.
//!
//! Where scattering is not isotropic the directions at a vertex turn when its neighbours move otherwise than itself, and
//! ∂ ln p(μ) joins the sum; towards the eye the direction stays, or turns about the eye.
//!
//! Left out, so that gradients miss them: moving shadows (visibility is taken as constant; what hides from
//! the gather point itself is added by [`crate::occlusion`]), boundaries of media nearer than the
//! ball's least radius, the turning lobes of surfaces that are not Lambertian and of spot lights, and, for light that media
//! emit, density profiles of an emission unlike the scattering's.
//!
//! Derivation: change of variables y → y + α(y) δ in every medium vertex and the divergence theorem; where f is smooth within
//! the ball there is no boundary term, because α vanishes at its rim. With the vertices moving alike, the 1/r terms of neighbouring vertices cancel
//! (|α(y) − α(y')| ≤ Lip(α) |y − y'|).

use crate::path::{Source, Vertex, Visitor};
use glam::Vec3;
use smallvec::SmallVec;
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

/// The direction in which light leaves a vertex, towards the start of the path, and how fast it turns.
#[derive(Clone, Copy)]
struct Leaving {
    w_o: Vec3,
    /// (α of the vertex before − α) over the distance: `∂w_o = (1 − w_o w_oᵀ) rate`.
    rate: f32,
}

/// Accumulates value and gradient of the light that arrives at a point along one path, light straight from emitters left out unless told
/// otherwise.
pub(crate) struct WarpVisitor<'m> {
    media: &'m Media,
    center: Vec3,
    radius: f32,
    last: End,
    /// Where scattering at `last` depends on directions.
    leaving: Option<Leaving>,
    /// Whether any medium scatters otherwise than isotropically.
    lobes: bool,
    /// Whether light straight from emitters counts.
    straight: bool,
    /// Distance of the first vertex.
    first: Option<f32>,
    /// ∂ ln f of the path so far, per colour channel.
    log_gradient: [Vec3; 3],
    pub(crate) value: Vec3,
    pub(crate) gradient: [Vec3; 3],
    /// Distances along the first stretch from which light arrives, and how much from each.
    pub(crate) arrivals: Arrivals,
}

/// Distance in metres and radiance: what a path met first, and what was scattered into it on the way there.
pub(crate) type Arrivals = SmallVec<[(f32, Vec3); 3]>;

impl<'m> WarpVisitor<'m> {
    /// For paths that start at `center`; `radius` is the D of the displacement field. The light is `leaving` in a direction that turns
    /// at a rate, `∂w_o = (1 − w_o w_oᵀ) rate`, or is weighted alike for all directions.
    pub(crate) fn new(
        media: &'m Media,
        center: Vec3,
        radius: f32,
        leaving: Option<(Vec3, f32)>,
    ) -> Self {
        Self {
            media,
            center,
            radius,
            last: End {
                position: center,
                alpha: 1.0,
                normal: None,
            },
            leaving: leaving.map(|(w_o, rate)| Leaving { w_o, rate }),
            lobes: !media.is_isotropic(),
            straight: false,
            first: None,
            log_gradient: [Vec3::ZERO; 3],
            value: Vec3::ZERO,
            gradient: [Vec3::ZERO; 3],
            arrivals: SmallVec::new(),
        }
    }

    /// As [`WarpVisitor::new`] on a surface with the unit `normal`: light is weighted by the cosine, and the point moves in the
    /// surface's plane.
    pub(crate) fn on_surface(media: &'m Media, center: Vec3, radius: f32, normal: Vec3) -> Self {
        let mut visitor = Self::new(media, center, radius, None);
        visitor.last.normal = Some(normal);
        visitor
    }

    /// Counts light straight from emitters, too.
    pub(crate) fn straight(&mut self) -> &mut Self {
        self.straight = true;
        self
    }

    /// Notes light that set out at `distance` along the first stretch.
    fn arrive(&mut self, distance: f32, value: Vec3) {
        match self.arrivals.last_mut() {
            Some((at, sum)) if *at == distance => *sum += value,
            _ => self.arrivals.push((distance, value)),
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

    /// Adds what turning directions do to the phase function at `at`, where light comes from the unit direction `w_i` that
    /// turns at `rate`: `∂μ = −(w_o − (w_o·w_i) w_i) rate − (w_i − (w_o·w_i) w_o) rateₒ`.
    fn turn(
        &self,
        log_gradient: &mut [Vec3; 3],
        at: End,
        leaving: Option<Leaving>,
        w_i: Vec3,
        rate: f32,
    ) {
        let Some(Leaving { w_o, rate: leaving }) = leaving else {
            return;
        };
        if at.alpha == 0.0 && rate == 0.0 && leaving == 0.0 {
            return;
        }
        let cosine = w_o.dot(w_i);
        let d_mu = -(w_o - cosine * w_i) * rate - (w_i - cosine * w_o) * leaving;
        let phase = self.media.at(at.position).phase(w_o, w_i);
        for (c, sum) in log_gradient.iter_mut().enumerate() {
            if phase.value[c] > 0.0 {
                *sum += (d_mu * phase.slope[c] + phase.gradient[c] * at.alpha) / phase.value[c];
            }
        }
    }

    /// [`WarpVisitor::turn`] at `a` for light that comes from `b`; returns how it leaves `b`.
    fn turn_towards(
        &self,
        log_gradient: &mut [Vec3; 3],
        (a, leaving): (End, Option<Leaving>),
        b: End,
    ) -> Option<Leaving> {
        let offset = b.position - a.position;
        let r = offset.length();
        if !self.lobes || r <= 0.0 {
            return None;
        }
        let (w_i, rate) = (offset / r, (b.alpha - a.alpha) / r);
        self.turn(log_gradient, a, leaving, w_i, rate);
        (b.normal.is_none()).then_some(Leaving {
            w_o: -w_i,
            rate: -rate,
        })
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
        let end = self.extend_to_vertex(&mut log_gradient, vertex);
        self.leaving = self.turn_towards(&mut log_gradient, (self.last, self.leaving), end);
        self.last = end;
        self.log_gradient = log_gradient;
        self.first.get_or_insert(end.position.distance(self.center));
    }

    fn light(&mut self, value: Vec3, last: Option<Vertex<'_, '_>>, source: Source) {
        let is_straight = self.first.is_none() && last.is_none();
        if is_straight && !self.straight {
            // Single scattering at the gather point is not ours.
            return;
        }
        let mut log_gradient = self.log_gradient;
        let (from, leaving) = match last {
            Some(vertex) => {
                let end = self.extend_to_vertex(&mut log_gradient, vertex);
                let before = (self.last, self.leaving);
                (end, self.turn_towards(&mut log_gradient, before, end))
            }
            None => (self.last, self.leaving),
        };
        match source {
            Source::Medium => {}
            Source::Scattered(log_light) => {
                for (sum, light) in log_gradient.iter_mut().zip(log_light) {
                    *sum += light * from.alpha;
                }
            }
            Source::Point(position, normal) => {
                let light = End {
                    position,
                    alpha: 0.0,
                    normal: (normal != Vec3::ZERO).then_some(normal),
                };
                self.extend(&mut log_gradient, from, light);
                self.turn_towards(&mut log_gradient, (from, leaving), light);
            }
            Source::Far(w_i) => {
                self.turn(&mut log_gradient, from, leaving, w_i, 0.0);
                if from.alpha > 0.0 {
                    let ray = Ray::new(from.position, w_i);
                    let (_, tau) = self.media.optical_depth_gradient_rigid(&ray, f32::INFINITY);
                    for c in 0..3 {
                        log_gradient[c] -= tau[c] * from.alpha;
                    }
                }
            }
        }
        let set_out = match (self.first, source) {
            (Some(first), _) => first,
            (None, Source::Far(_)) if is_straight => f32::INFINITY,
            (None, _) => from.position.distance(self.center),
        };
        self.arrive(set_out, value);
        self.value += value;
        for c in 0..3 {
            self.gradient[c] += log_gradient[c] * value[c];
        }
    }
}
