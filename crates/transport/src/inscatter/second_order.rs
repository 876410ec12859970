//! The second derivatives of one sample: its formula, written in jets.

use super::GRAZING;
use super::point::Inscatter;
use crate::world::{Geometry, LightSample, Lights};
use glam::DMat3;
use std::f64::consts::PI;
use tyndall_math::Jet;

/// The Hessian of a sample when its point moves, for each colour channel; zero where it does not fit into f64.
///
/// f(x) = c p(x, μ) e^−τ(x, x′) H(x),  H = cosθ′/r² = n′·v/r³,  v = x − x′,  r = |v|,  μ = ω·v/r
///
/// * c – radiance of the sample over its density, and over H where it stands: H is 1 at the point itself.
/// * x′ – the emitter's point, which stays; n′ – its normal.
///
/// H = I(v/r)/r² for lamps without extent; light from far away keeps its direction, with H = 1, while τ is that of a ray
/// that moves with x. Product rule as in Jarosz, Donner, Zwicker and Jensen 2008, carried to second order by [`Jet`]s in f64.
/// At grazing incidence, cosθ′ below [`GRAZING`], the derivatives of n′·v are bounded. Checked against the closed forms of E2b.
pub(super) fn hessian<G: Geometry, L: Lights>(
    point: &Inscatter<'_, '_, G, L>,
    way: &LightSample,
    light: Option<usize>,
) -> [DMat3; 3] {
    let (x, w_o) = (point.x.as_dvec3(), point.w_o.as_dvec3());
    let w_i = way.w_i.as_dvec3().normalize();
    let media = point.world.media;
    let (mu, tau, h) = if way.distance.is_infinite() {
        let tau = media.optical_depth_jet_rigid(x, w_i, f64::INFINITY);
        (Jet::from(-w_o.dot(w_i)), tau, Jet::from(1.0))
    } else {
        let r0 = f64::from(way.distance);
        let emitter = x + r0 * w_i;
        // Not x − x′: that has lost digits beside a lamp.
        let v = Jet::point(-r0 * w_i);
        let r = v.length();
        let closer = r.recip() * r0;
        let h = if way.delta {
            let ln_intensity = light.map_or(Jet::ZERO, |l| point.world.lights.ln_intensity(l, x));
            closer * closer * (ln_intensity - ln_intensity.value).exp()
        } else {
            let normal = way.normal.as_dvec3();
            let cosine = (-normal.dot(w_i)).max(GRAZING.into());
            closer * closer * closer * Jet::linear(1.0, normal / (r0 * cosine))
        };
        let tau = media.optical_depth_jet(emitter, x);
        ((v / r).dot_fixed(w_o), tau, h)
    };
    let p = if point.alike {
        [Jet::from(0.25 / PI); 3]
    } else {
        point.medium.phase_jet(point.w_o, way.w_i, mu)
    };
    std::array::from_fn(|c| {
        let f = p[c] * (-tau[c]).exp() * h;
        let hessian = f.hessian * f64::from(way.radiance[c]);
        if hessian.is_finite() {
            hessian
        } else {
            DMat3::ZERO
        }
    })
}
