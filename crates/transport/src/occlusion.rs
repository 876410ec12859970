//! How light that is gathered at a point changes because silhouettes move when the point does.
//!
//! Each gather ray stands for its Voronoi cell of directions. Along the border of two cells the nearer surface hides what the farther
//! ray sees beyond it, and when the point moves that border shifts by one over its depth.

use crate::warp_translation::Arrivals;
use crate::world::{LightSample, SurfaceHit};
use glam::{Quat, Vec3};
use smallvec::smallvec;
use tyndall_math::spherical::{Border, edge};

/// Two planes count as one where they lie closer than this, relative to their distance.
const COPLANAR: f32 = 1e-3;
/// A small piece of surface hides what is farther than it by this factor, where the pieces that it may continue in are not known.
const APART: f32 = 1.5;

/// Planes seen at a smaller cosine are taken to be seen at this one.
const COS_MIN: f32 = 1e-3;

/// Just short of a surface.
const BARELY: f32 = 1.0 - 1e-5;

/// What a gather ray saw, or a ray towards a light.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// Unit direction of the ray.
    pub(crate) direction: Vec3,
    hit: Option<Hit>,
    arrivals: Arrivals,
}

/// Where a ray ended.
#[derive(Clone, Copy, Debug)]
struct Hit {
    t: f32,
    position: Vec3,
    normal: Vec3,
    /// Extent of the piece of surface, in metres.
    size: f32,
}

impl Seen {
    pub(crate) fn new(direction: Vec3, hit: Option<SurfaceHit>, arrivals: Arrivals) -> Self {
        Self {
            direction,
            hit: hit.map(|hit| Hit {
                t: hit.t,
                position: hit.position,
                normal: hit.normal,
                size: hit.size,
            }),
            arrivals,
        }
    }

    /// `light` with extent, seen freely from `x`, from where `radiance` arrives.
    pub(crate) fn light(x: Vec3, light: &LightSample, radiance: Vec3) -> Self {
        let t = light.distance;
        Self {
            direction: light.w_i,
            hit: t.is_finite().then(|| Hit {
                t,
                position: x + light.w_i * t,
                // An emitter without a surface ends the ray squarely.
                normal: light.normal.try_normalize().unwrap_or(-light.w_i),
                size: light.size,
            }),
            arrivals: smallvec![(t, radiance)],
        }
    }

    /// Whether light arrives along the ray.
    pub(crate) fn shines(&self) -> bool {
        !self.arrivals.is_empty()
    }

    /// Σ v (1/r − 1/t): light per metre of sideways motion that is hidden by a surface at r, over what arrives from t beyond.
    ///
    /// What the ray's own surface sends counts even where 1/r lies below 1/t: the direction in which the depth r is taken errs to
    /// either side of the silhouette, and the sum is right on average because it is linear in 1/r.
    fn hidden(&self, inverse_depth: f32) -> Vec3 {
        let surface = self
            .hit
            .as_ref()
            .map_or(f32::INFINITY, |hit| hit.t * BARELY);
        self.arrivals
            .iter()
            .filter(|&&(t, _)| t >= surface || t * inverse_depth > 1.0)
            .map(|&(t, value)| value * (inverse_depth - 1.0 / t))
            .sum()
    }
}

/// A silhouette between two rays: what it hides something from, and one over its distance.
struct Silhouette<'s> {
    far: &'s Seen,
    inverse_depth: f32,
}

/// One over the distance at which the plane of `hit` is seen from `x` in direction `w`: linear in `w`, not positive where it is not seen.
///
/// A plane that `x` lies in, or nearly, is taken to pass at [`COS_MIN`] of the hit's distance: seen edge on it has no depth.
fn inverse_depth(hit: &Hit, x: Vec3, w: Vec3) -> f32 {
    // Negative: normals stand on the side of `x`.
    let height = (hit.position - x)
        .dot(hit.normal)
        .min(-COS_MIN * hit.t)
        .min(-f32::MIN_POSITIVE);
    w.dot(hit.normal) / height
}

/// Whether the surface that `near` met ends before `far`, as seen from `x`; `w` is the direction of their border.
///
/// Where a plane, followed to the direction of the other ray, lies in front of what that ray met, its surface has ended on the way. Where
/// each plane lies behind the other's hit they meet in a corner that opens towards `x`, where each lies in front in a ridge: nothing is
/// hidden at either. Pieces of surface smaller than the way to such a corner are taken to end where they are much nearer.
fn silhouette<'s>(x: Vec3, w: Vec3, near: &'s Seen, far: &'s Seen) -> Option<Silhouette<'s>> {
    let here = near.hit.as_ref()?;
    let followed = inverse_depth(here, x, far.direction);
    let found = Some(Silhouette {
        far,
        inverse_depth: inverse_depth(here, x, w),
    });
    let Some(there) = &far.hit else {
        return found;
    };
    let in_front = |a: &Hit, w: Vec3, b: &Hit| inverse_depth(a, x, w) * b.t > 1.0 + COPLANAR;
    match (
        in_front(here, far.direction, there),
        in_front(there, near.direction, here),
    ) {
        (true, false) => found,
        (false, false) if here.t * APART < there.t => {
            let ends = followed <= 0.0
                || (x + far.direction / followed).distance(here.position) > here.size;
            found.filter(|_| ends)
        }
        _ => None,
    }
}

/// The share of ∇∫ p L dω that silhouettes bring, per colour channel, for points that stay where they are while `x` moves; told to `add`
/// border by border, with the index of the ray that sees what is hidden there.
///
/// ∇ = Σ over borders of −(Σₜ L κ(t)) p E,  κ(t) = 1 − r/t for t > r,  E = [`edge`] of the border at the nearer depth r
///
/// * `borders` – of the cells of `seen`, before they were `turn`ed.
/// * `phase` – p for light from a direction, per steradian.
///
/// κ is the speed at which the shadow's rim passes the hidden points over the speed of the silhouette: points on surfaces, and points
/// in media outside the displacement field of [`crate::warp_translation`], stay in place. The nearer surface keeps its own points, so
/// its light does not count. Derived from the motion of borders as in Ward and Heckbert 1992, with media behind as in Jarosz, Zwicker
/// and Jensen 2008, "Irradiance gradients in the presence of participating media and occlusions"; the border at the nearer depth
/// between Voronoi cells needs two to three times fewer rays than triangles through the hit points (Schwarzhaupt, Jensen and Jarosz 2012;
/// measured in docs/derivatives.md).
pub(crate) fn gradient(
    borders: &[Border],
    turn: Quat,
    x: Vec3,
    seen: &[Seen],
    phase: impl Fn(Vec3) -> Vec3,
    mut add: impl FnMut(usize, [Vec3; 3]),
) {
    for Border { cells, ends } in borders {
        let [i, j] = cells.map(|c| &seen[c as usize]);
        let ends = ends.map(|end| turn * end);
        let Some(w) = (ends[0] + ends[1]).try_normalize() else {
            continue;
        };
        let (found, far, side) = match silhouette(x, w, i, j) {
            Some(found) => (found, cells[1], -1.0),
            None => match silhouette(x, w, j, i) {
                Some(found) => (found, cells[0], 1.0),
                None => continue,
            },
        };
        let hidden = found.far.hidden(found.inverse_depth);
        // A hit at no distance hides and shows nothing that could be told apart.
        if hidden == Vec3::ZERO || !hidden.is_finite() {
            continue;
        }
        // The field of an edge falls as one over its scale.
        let [a, b] = ends.map(|end| end.as_dvec3());
        let motion = edge(a, b).as_vec3() * side;
        let change = hidden * phase(w);
        add(
            far as usize,
            change.to_array().map(|change| motion * change),
        );
    }
}
