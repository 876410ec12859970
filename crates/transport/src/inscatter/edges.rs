//! What the edges of boxes of medium add to the Hessian.

use super::point::{Inscatter, Sample};
use crate::world::{Geometry, Lights};
use tyndall_math::{Key, Sampler};
use tyndall_media::Edges;

/// Adds the share of ∇∇ ∫ p L e^−τ dω that sits on `edges`: sample number `i` of `key` chooses a point on them. For light that comes past it,
///
/// −p L e^−τ (1 − r/R)² Hτ
///
/// * r, R – distances in metres to the edge and to the emitter, which may be infinitely far away; nothing where R < r.
/// * Hτ – [`EdgePoint::hessian`](tyndall_media::EdgePoint::hessian), when the direction stays. When instead the emitter's point stays, what passes the edge moves by 1 − r/R of
///   the point's motion, in either derivative.
///
/// Lamps without extent do not see edges. Checked against central differences of quadrature.
pub(super) fn add<G: Geometry, L: Lights>(
    point: &Inscatter<'_, '_, G, L>,
    edges: &Edges<'_>,
    (key, i): (Key, u64),
    sum: &mut Sample,
) {
    let mut sampler = Sampler::new(key, i);
    sampler.start_set(2);
    let Some(edge) = edges.sample(sampler.next_2d()) else {
        return;
    };
    point.shining(edge.direction.as_vec3(), |way, _| {
        let past = 1.0 - edge.distance / f64::from(way.distance);
        if past <= 0.0 {
            return;
        }
        if let Some(arrives) = point.arrives(&way) {
            let light = (way.radiance * arrives * point.phase(way.w_i).value).as_dvec3();
            for (c, sum) in sum.hessian.iter_mut().enumerate() {
                let hessian = edge.hessian[c] * (-light[c] * past * past);
                if hessian.is_finite() {
                    *sum += hessian;
                }
            }
        }
    });
}
