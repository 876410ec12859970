//! A stage for tests: lamps of several shapes, and rectangles that stand in their light.

use glam::{DVec3, Vec3};
use std::f32::consts::PI;
use tyndall_math::warp::uniform_sphere;
use tyndall_math::{Frame, Ray, SphericalRectangle};
use tyndall_transport::{Bsdf, Geometry, LightSample, Lights, SurfaceHit};

/// A rectangle of perpendicular edges; shines on both sides where it is a lamp.
#[derive(Clone, Copy)]
pub(crate) struct Card {
    pub(crate) corner: Vec3,
    pub(crate) edges: [Vec3; 2],
}

impl Card {
    fn normal(&self) -> DVec3 {
        let [a, b] = self.edges.map(|e| e.as_dvec3());
        a.cross(b).normalize()
    }

    fn intersect(&self, ray: &Ray) -> Option<f64> {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let corner = self.corner.as_dvec3();
        let t = (corner - o).dot(self.normal()) / d.dot(self.normal());
        let off = o + d * t - corner;
        let inside = |e: Vec3| {
            let e = e.as_dvec3();
            (0.0..=1.0).contains(&(off.dot(e) / e.length_squared()))
        };
        (t > 0.0 && self.edges.into_iter().all(inside)).then_some(t)
    }
}

#[derive(Clone, Copy)]
pub(crate) enum Lamp {
    /// W/sr.
    Point { position: Vec3, intensity: f32 },
    /// Radiance.
    Card { card: Card, radiance: f32 },
    /// Radiance.
    Ball {
        center: Vec3,
        radius: f32,
        radiance: f32,
    },
    /// Radiance from everywhere; the only lamp of its stage.
    Sky { radiance: f32 },
}

/// Lamps and what stands in their light; lamps themselves hide nothing.
#[derive(Clone, Default)]
pub(crate) struct Stage {
    pub(crate) lamps: Vec<Lamp>,
    pub(crate) cards: Vec<Card>,
}

impl Stage {
    pub(crate) fn lamp(lamp: Lamp) -> Self {
        Self {
            lamps: vec![lamp],
            ..Self::default()
        }
    }

    fn emitters(&self, ray: &Ray) -> impl Iterator<Item = SurfaceHit> {
        let lamps = self.lamps.iter().enumerate();
        lamps.filter_map(|(light, lamp)| {
            let (t, n, size, radiance) = match *lamp {
                Lamp::Point { .. } | Lamp::Sky { .. } => return None,
                Lamp::Card { card, radiance } => {
                    (card.intersect(ray)?, card.normal(), 2.0, radiance)
                }
                Lamp::Ball {
                    center,
                    radius,
                    radiance,
                } => {
                    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
                    let o = o - center.as_dvec3();
                    let b = o.dot(d);
                    let c = o.length_squared() - f64::from(radius).powi(2);
                    let t = c / ((b * b - c).max(0.0).sqrt() - b);
                    if b > 0.0 || b * b < c * (1.0 - 1e-6) {
                        return None;
                    }
                    (t, (o + d * t).normalize(), 2.0 * radius, radiance)
                }
            };
            Some(hit(ray, t, n, size, (radiance, Some(light))))
        })
    }
}

fn hit(
    ray: &Ray,
    t: f64,
    n: DVec3,
    size: f32,
    (radiance, light): (f32, Option<usize>),
) -> SurfaceHit {
    let n = n.as_vec3();
    let normal = if n.dot(ray.direction) > 0.0 { -n } else { n };
    SurfaceHit {
        t: t as f32,
        position: ray.at(t as f32),
        normal,
        bsdf: Bsdf::lambert(Vec3::ZERO, normal),
        emission: Vec3::splat(radiance),
        light,
        size,
    }
}

impl Geometry for Stage {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        let cards = self.cards.iter().filter_map(|card| {
            let t = card.intersect(ray)?;
            Some(hit(ray, t, card.normal(), 2.0, (0.0, None)))
        });
        let all = cards.chain(self.emitters(ray));
        all.filter(|hit| hit.t < t_max)
            .min_by(|a, b| a.t.total_cmp(&b.t))
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.cards
            .iter()
            .any(|card| card.intersect(ray).is_some_and(|t| t < t_max.into()))
    }
}

impl Lights for Stage {
    fn count(&self) -> usize {
        self.lamps.len()
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

    fn sample(&self, light: usize, p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let w_i = match *self.lamps.get(light)? {
            Lamp::Point {
                position,
                intensity,
            } => {
                let distance = position.distance(p);
                return Some(LightSample {
                    w_i: (position - p) / distance,
                    distance,
                    radiance: Vec3::splat(intensity / (distance * distance)),
                    pdf: 1.0,
                    delta: true,
                    normal: Vec3::ZERO,
                    size: 0.0,
                });
            }
            Lamp::Sky { radiance } => {
                return Some(LightSample {
                    w_i: uniform_sphere(u),
                    distance: f32::INFINITY,
                    radiance: Vec3::splat(radiance),
                    pdf: 0.25 / PI,
                    delta: false,
                    normal: Vec3::ZERO,
                    size: 0.0,
                });
            }
            Lamp::Card { card, .. } => {
                SphericalRectangle::new(p, card.corner, card.edges)?
                    .sample(u)
                    .direction
            }
            Lamp::Ball { center, radius, .. } => {
                let v = f64::from(u[0]) * (2.0 - f64::from(u[0])) * versine(p, center, radius);
                let (sin, cos) = ((v * (2.0 - v)).sqrt() as f32, (1.0 - v) as f32);
                let (y, x) = (2.0 * PI * u[1]).sin_cos();
                let frame = Frame::from_normal((center - p).normalize());
                frame.to_world(Vec3::new(sin * x, sin * y, cos)).normalize()
            }
        };
        let hit = self
            .emitters(&Ray::new(p, w_i))
            .find(|hit| hit.light == Some(light))?;
        Some(LightSample {
            w_i,
            distance: hit.t,
            radiance: hit.emission,
            pdf: self.pdf(light, p, w_i),
            delta: false,
            normal: hit.normal,
            size: hit.size,
        })
    }

    fn pdf(&self, light: usize, p: Vec3, w_i: Vec3) -> f32 {
        match self.lamps[light] {
            Lamp::Point { .. } => 0.0,
            Lamp::Sky { .. } => 0.25 / PI,
            Lamp::Card { card, .. } => SphericalRectangle::new(p, card.corner, card.edges)
                .map_or(0.0, |seen| 1.0 / seen.solid_angle()),
            Lamp::Ball { center, radius, .. } => {
                // Denser towards the limb, where derivatives are large.
                let axis = (center - p).as_dvec3().normalize();
                let all = versine(p, center, radius);
                let rest = 1.0 - 0.5 * (w_i.as_dvec3() - axis).length_squared() / all;
                (0.25 / (std::f64::consts::PI * all * rest.max(1e-12).sqrt())) as f32
            }
        }
    }

    fn environment(&self) -> &[usize] {
        match self.lamps.as_slice() {
            [Lamp::Sky { .. }] => &[0],
            _ => &[],
        }
    }

    fn environment_radiance(&self, light: usize, _w_i: Vec3) -> Vec3 {
        match self.lamps[light] {
            Lamp::Sky { radiance } => Vec3::splat(radiance),
            _ => Vec3::ZERO,
        }
    }

    fn distance_to_point_lights(&self, p: Vec3) -> f32 {
        let distance = |lamp: &Lamp| match lamp {
            Lamp::Point { position, .. } => position.distance(p),
            _ => f32::INFINITY,
        };
        self.lamps
            .iter()
            .map(distance)
            .fold(f32::INFINITY, f32::min)
    }
}

/// 1 − cosine of the half-angle under which a ball is seen.
fn versine(p: Vec3, center: Vec3, radius: f32) -> f64 {
    let s2 = (f64::from(radius) / f64::from(center.distance(p))).powi(2);
    let s2 = s2.min(1.0);
    s2 / (1.0 + (1.0 - s2).sqrt())
}
