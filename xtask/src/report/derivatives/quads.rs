//! A square light behind a square occluder in a vacuum: its visible solid angle, with exact derivatives, and as the renderer's
//! gather sees it.

use glam::{DMat3, DVec3, Vec3};
use std::f32::consts::PI;
use tyndall_math::Ray;
use tyndall_math::spherical::{edge, solid_angle_gradient};
use tyndall_transport::{Bsdf, Geometry, LightSample, Lights, SurfaceHit};

/// A square across z.
#[derive(Clone, Copy)]
pub(super) struct Square {
    center: DVec3,
    half: f64,
}

impl Square {
    /// Counter-clockwise as seen from smaller z.
    fn corners(&self) -> [DVec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| self.center + self.half * DVec3::new(x, y, 0.0))
    }

    fn edges(&self) -> [[DVec3; 2]; 4] {
        let c = self.corners();
        std::array::from_fn(|i| [c[i], c[(i + 1) % 4]])
    }

    /// Distance at which the ray from `x` along the unit vector `w` meets it.
    fn intersect(&self, x: DVec3, w: DVec3) -> Option<f64> {
        let t = (self.center.z - x.z) / w.z;
        let off = (x + w * t - self.center).abs();
        (t > 0.0 && off.x <= self.half && off.y <= self.half).then_some(t)
    }
}

/// A black square between the gather point, close to the origin, and a light of radiance 1.
#[derive(Clone, Copy)]
pub(super) struct Quads {
    pub(super) light: Square,
    pub(super) occluder: Square,
}

/// What a ray meets.
pub(super) struct Met {
    pub(super) t: f64,
    pub(super) radiance: f64,
}

/// Normal of both squares on the side of the gather point.
pub(super) const NORMAL: DVec3 = DVec3::NEG_Z;

impl Quads {
    const LIGHT: Square = Square {
        center: DVec3::new(0.0, 0.0, 2.0),
        half: 0.8,
    };

    /// Two shadow edges cross the outline of the light.
    pub(super) const CROSSING: Self = Self {
        light: Self::LIGHT,
        occluder: Square {
            center: DVec3::new(0.22, 0.17, 1.0),
            half: 0.3,
        },
    };

    /// The shadow lies within the light.
    pub(super) const WITHIN: Self = Self {
        light: Self::LIGHT,
        occluder: Square {
            center: DVec3::new(0.03, -0.02, 1.0),
            half: 0.2,
        },
    };

    pub(super) fn cast(&self, x: DVec3, w: DVec3) -> Option<Met> {
        if let Some(t) = self.occluder.intersect(x, w) {
            return Some(Met { t, radiance: 0.0 });
        }
        let t = self.light.intersect(x, w)?;
        Some(Met { t, radiance: 1.0 })
    }

    /// ∇ of the visible solid angle: the whole light's, less what hides behind the occluder. The outline of that is made of the
    /// light's edges, as far as they lie behind the occluder, and of the occluder's, as far as they lie before the light: each moves
    /// with the points of what owns it.
    pub(super) fn gradient(&self, x: DVec3) -> DVec3 {
        let hidden = self.hidden_edges(x);
        solid_angle_gradient(x, &self.light.corners())
            - hidden.iter().map(|&[a, b]| edge(a, b)).sum::<DVec3>()
    }

    /// Hessian of the visible solid angle, by central differences of its gradient, to about 1e-7 of it.
    ///
    /// [`tyndall_math::spherical::edge_jacobian`] would miss that points where two edges cross slide along both.
    pub(super) fn hessian(&self, x: DVec3) -> DMat3 {
        let h = 1e-4;
        let column =
            |axis: DVec3| (self.gradient(x + axis * h) - self.gradient(x - axis * h)) / (2.0 * h);
        DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
    }

    /// The outline of what is hidden, from `x`.
    pub(super) fn hidden_edges(&self, x: DVec3) -> Vec<[DVec3; 2]> {
        let behind = |one: &Square, other: &Square| {
            let cone = other.edges().map(|[a, b]| (a - x).cross(b - x));
            let edges = one.edges().into_iter();
            edges
                .filter_map(|[a, b]| clip([a - x, b - x], &cone))
                .collect::<Vec<_>>()
        };
        [
            behind(&self.light, &self.occluder),
            behind(&self.occluder, &self.light),
        ]
        .concat()
    }
}

/// The part of a segment on the inner side of all planes through the origin.
fn clip([a, b]: [DVec3; 2], planes: &[DVec3]) -> Option<[DVec3; 2]> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for plane in planes {
        let (da, db) = (a.dot(*plane), b.dot(*plane));
        match (da >= 0.0, db >= 0.0) {
            (true, true) => {}
            (false, false) => return None,
            (true, false) => to = to.min(da / (da - db)),
            (false, true) => from = from.max(da / (da - db)),
        }
    }
    (from < to).then(|| [a + (b - a) * from, a + (b - a) * to])
}

/// For the gather, which leaves out light straight from lamps, the light is a white wall lit from a distance through all.
impl Geometry for Quads {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        let met = self.cast(ray.origin.as_dvec3(), ray.direction.as_dvec3())?;
        let t = met.t as f32;
        let normal = NORMAL.as_vec3();
        (t < t_max).then(|| SurfaceHit {
            t,
            position: ray.at(t),
            normal,
            bsdf: Bsdf::lambert(Vec3::splat(met.radiance as f32), normal),
            emission: Vec3::ZERO,
            light: None,
            size: 1.0,
        })
    }

    fn occluded(&self, _ray: &Ray, _t_max: f32) -> bool {
        false
    }
}

/// Far light square onto the wall, so strong that ∫ L/4π dω over the wall is its solid angle.
pub(super) struct Floodlight;

impl Lights for Floodlight {
    fn count(&self) -> usize {
        1
    }

    fn importance(&self, _light: usize, _p: Vec3, _normal: Option<Vec3>) -> f32 {
        1.0
    }

    fn importance_along(&self, _light: usize, _ray: &Ray, t_max: f32) -> f32 {
        t_max
    }

    fn pivot(&self, _light: usize) -> Option<Vec3> {
        None
    }

    fn sample(&self, _light: usize, _p: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        Some(LightSample {
            w_i: NORMAL.as_vec3(),
            distance: f32::INFINITY,
            radiance: Vec3::splat(4.0 * PI * PI),
            pdf: 1.0,
            delta: true,
            normal: Vec3::ZERO,
            size: 0.0,
        })
    }

    fn pdf(&self, _light: usize, _p: Vec3, _w_i: Vec3) -> f32 {
        0.0
    }

    fn distance_to_point_lights(&self, _p: Vec3) -> f32 {
        f32::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall_math::spherical::{edge_jacobian, solid_angle_hessian};

    const X: DVec3 = DVec3::new(0.05, -0.03, 0.02);

    /// Visible solid angle. Seen from `x`, the shadow on the light's plane is a square as well, so what it hides is a rectangle.
    fn solid_angle(quads: &Quads, x: DVec3) -> f64 {
        let Quads { light, occluder } = quads;
        let zoom = (light.center.z - x.z) / (occluder.center.z - x.z);
        let shadow =
            [-1.0, 1.0].map(|side| x + (occluder.center + side * occluder.half - x) * zoom);
        let [least, most] = [-1.0, 1.0].map(|side| light.center + side * light.half);
        let hidden = shadow.map(|corner| corner.clamp(least, most));
        rectangle(x, [least, most]) - rectangle(x, hidden)
    }

    /// Solid angle of a rectangle at the light's distance, from two opposite corners.
    fn rectangle(x: DVec3, [least, most]: [DVec3; 2]) -> f64 {
        let z = Quads::LIGHT.center.z - x.z;
        let corner = |x: f64, y: f64| (x * y / (z * (x * x + y * y + z * z).sqrt())).atan();
        let (a, b) = (least - x, most - x);
        corner(b.x, b.y) - corner(a.x, b.y) - corner(b.x, a.y) + corner(a.x, a.y)
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_visible_solid_angle() {
        for quads in [Quads::CROSSING, Quads::WITHIN] {
            let exact = quads.gradient(X);
            let h = 1e-4;
            let slope = DVec3::AXES.map(|axis| {
                (solid_angle(&quads, X + axis * h) - solid_angle(&quads, X - axis * h)) / (2.0 * h)
            });
            let off = (DVec3::from(slope) - exact).length() / exact.length();
            // Central differences err by some h².
            assert!(off < 1e-6, "{exact} {slope:?}");
        }
    }

    #[test]
    fn edges_with_fixed_ends_make_the_hessian_where_no_edges_cross() {
        let by_edges = |quads: &Quads| {
            let hidden = quads
                .hidden_edges(X)
                .iter()
                .fold(DMat3::ZERO, |sum, [a, b]| sum + edge_jacobian(*a, *b));
            let h = solid_angle_hessian(X, &quads.light.corners()) - hidden;
            0.5 * (h + h.transpose())
        };
        let off = |quads: &Quads| {
            let exact = quads.hessian(X);
            norm(by_edges(quads) - exact) / norm(exact)
        };
        assert!(off(&Quads::WITHIN) < 1e-6);
        // Not so where a shadow edge crosses an edge of the light.
        assert!(off(&Quads::CROSSING) > 0.01);
    }

    fn norm(m: DMat3) -> f64 {
        m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}
