//! How the solid angle of a polygon changes when the point it is seen from moves: a sum over its edges.
//!
//! Each edge acts as a current does in the law of Biot and Savart, so what hides behind a straight silhouette has a gradient and a
//! Hessian in closed form.

use glam::{DMat3, DVec3};

/// ∂Ω/∂x of an edge that runs from `a` to `b` as seen from the point x (metres), with what it bounds on its left.
///
/// E = (a × b) (A + B) / (A B (A B + a·b)),  A = |a|, B = |b|
///
/// The field of a current that flows along the edge (Biot and Savart); for a solid angle: Holzschuch and Sillion 1995 from the
/// boundary integral, here as in Arvo 1994, "The irradiance Jacobian for partially occluded polyhedral sources". Zero where the edge
/// points at x; where x lies on the edge the derivative does not exist, and zero is returned.
pub fn edge(a: DVec3, b: DVec3) -> DVec3 {
    let (la, lb) = (a.length(), b.length());
    let d = la * lb * (la * lb + a.dot(b));
    let e = a.cross(b) * ((la + lb) / d);
    if e.is_finite() { e } else { DVec3::ZERO }
}

/// ∂E/∂x of [`edge`]: what the edge adds to the Hessian of a solid angle. Symmetric and free of trace in the sum over a closed polygon.
///
/// With n = a × b, s = (A + B)/D, D = A B (A B + a·b): J = n ∇sᵀ + s [b − a]×, where x moving by δ moves a and b by −δ.
/// Differentiated from [`edge`]. Zero where x lies on the line of the edge between its ends.
pub fn edge_jacobian(a: DVec3, b: DVec3) -> DMat3 {
    let (la, lb) = (a.length(), b.length());
    let (ab, dot) = (la * lb, a.dot(b));
    let d = ab * (ab + dot);
    let s = (la + lb) / d;
    let (grad_la, grad_lb) = (-a / la, -b / lb);
    let grad_ab = grad_la * lb + grad_lb * la;
    let grad_d = grad_ab * (ab + dot) + ab * (grad_ab - (a + b));
    let grad_s = (grad_la + grad_lb) / d - grad_d * (s / d);
    let c = b - a;
    let cross = DMat3::from_cols(
        DVec3::new(0.0, c.z, -c.y),
        DVec3::new(-c.z, 0.0, c.x),
        DVec3::new(c.y, -c.x, 0.0),
    );
    let j = outer(a.cross(b), grad_s) + cross * s;
    if j.is_finite() { j } else { DMat3::ZERO }
}

/// u vᵀ.
fn outer(u: DVec3, v: DVec3) -> DMat3 {
    DMat3::from_cols(u * v.x, u * v.y, u * v.z)
}

/// Solid angle of the spherical triangle of three unit vectors, positive where they wind counter-clockwise from outside.
///
/// Van Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle", equation 8.
pub fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    2.0 * a
        .dot(b.cross(c))
        .atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Gradient at `x` of the solid angle of a flat polygon with `corners` (metres), counter-clockwise as seen from `x`.
pub fn solid_angle_gradient(x: DVec3, corners: &[DVec3]) -> DVec3 {
    edges(x, corners).map(|(a, b)| edge(a, b)).sum()
}

/// Hessian at `x` of the solid angle of a flat polygon with `corners` (metres), counter-clockwise as seen from `x`.
pub fn solid_angle_hessian(x: DVec3, corners: &[DVec3]) -> DMat3 {
    edges(x, corners)
        .map(|(a, b)| edge_jacobian(a, b))
        .fold(DMat3::ZERO, |sum, j| sum + j)
}

fn edges(x: DVec3, corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(move |(a, b)| (a - x, b - x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// |x| < 1, |y| < 0.5 at z = 2, seen from (0.3, 0.2, 0.1): `exact-benchmarks.md` E2b.
    const RECTANGLE: [DVec3; 4] = [
        DVec3::new(-1.0, -0.5, 2.0),
        DVec3::new(1.0, -0.5, 2.0),
        DVec3::new(1.0, 0.5, 2.0),
        DVec3::new(-1.0, 0.5, 2.0),
    ];
    const X: DVec3 = DVec3::new(0.3, 0.2, 0.1);

    #[test]
    fn a_rectangle_has_the_gradient_of_its_solid_angle() {
        let exact = DVec3::new(
            -0.068_717_896_548_711_24,
            -0.061_371_630_653_361_826,
            0.405_008_554_859_706_1,
        );
        let found = solid_angle_gradient(X, &RECTANGLE);
        assert!((found - exact).length() < 1e-14, "{found}");
    }

    fn corner() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0f64..1.0).prop_map(DVec3::from)
    }

    proptest! {
        #[test]
        fn the_hessian_is_symmetric_harmonic_and_the_slope_of_the_gradient(
            corners in prop::array::uniform3(corner()), away in 1.5f64..4.0
        ) {
            let x = DVec3::new(0.1, -0.2, away);
            let hessian = solid_angle_hessian(x, &corners);
            let size = hessian.to_cols_array().iter().fold(0.0_f64, |m, h| m.max(h.abs()));
            let trace = hessian.x_axis.x + hessian.y_axis.y + hessian.z_axis.z;
            prop_assert!(trace.abs() <= 1e-13 + 1e-10 * size);
            let skew = hessian - hessian.transpose();
            prop_assert!(skew.to_cols_array().iter().all(|s| s.abs() <= 1e-13 + 1e-10 * size));
            let h = 1e-5;
            for (axis, column) in [hessian.x_axis, hessian.y_axis, hessian.z_axis].into_iter().enumerate() {
                let step = DVec3::AXES[axis] * h;
                let slope = (solid_angle_gradient(x + step, &corners)
                    - solid_angle_gradient(x - step, &corners)) / (2.0 * h);
                prop_assert!((slope - column).length() < 1e-8);
            }
        }

        #[test]
        fn edges_are_finite_wherever_the_point_is(
            a in corner(), b in corner(), log_scale in -6.0f64..6.0, along in -1.0f64..2.0
        ) {
            let scale = 10f64.powf(log_scale);
            // In general position, on the edge and its line, at an end of it, and on an edge without length.
            let on = a + (b - a) * along;
            for (a, b) in [(a, b), (a - on, b - on), (DVec3::ZERO, b), (a, a)] {
                prop_assert!(edge(a * scale, b * scale).is_finite());
                prop_assert!(edge_jacobian(a * scale, b * scale).is_finite());
            }
        }
    }
}
