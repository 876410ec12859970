//! Worlds of a few exact shapes: spheres, cards and rectangles; point lamps, balls, and skies on one side or all around.

use glam::{DVec3, Vec3};
use std::f32::consts::PI;
use tyndall_math::{Equiangular, Frame, Ray, SphericalRectangle, warp};
use tyndall_media::{Media, Medium, MediumError, MediumParams, PhaseFunction, Region};
use tyndall_transport::{Bsdf, Geometry, LightSample, Lights, SurfaceHit};

/// A shape of a solid.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// A sphere, seen from inside or outside.
    Sphere { center: Vec3, radius: f32 },
    /// A flat disk.
    Disk {
        center: Vec3,
        normal: Vec3,
        radius: f32,
    },
    /// A rectangle of perpendicular edges.
    Rectangle { corner: Vec3, edges: [Vec3; 2] },
}

impl Shape {
    /// Distance to the nearest point on `ray` and the normal there, on either side. In f64: a wall must be tight.
    fn intersect(&self, ray: &Ray) -> Option<(f64, DVec3)> {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        match *self {
            Shape::Sphere { center, radius } => {
                let radius = f64::from(radius);
                let o = o - center.as_dvec3();
                let (b, c) = (o.dot(d), o.length_squared() - radius * radius);
                let root = (b * b - c).max(0.0).sqrt();
                let t = if c < 0.0 && b > 0.0 {
                    -c / (b + root)
                } else if c < 0.0 {
                    root - b
                } else if b < 0.0 && b * b > c {
                    c / (root - b)
                } else {
                    return None;
                };
                Some((t, (o + d * t) / radius))
            }
            Shape::Disk {
                center,
                normal,
                radius,
            } => {
                let n = normal.as_dvec3();
                let t = (center.as_dvec3() - o).dot(n) / d.dot(n);
                let off = o + d * t - center.as_dvec3();
                (off.length_squared() <= f64::from(radius * radius)).then_some((t, n))
            }
            Shape::Rectangle { corner, edges } => {
                let [a, b] = edges.map(|e| e.as_dvec3());
                let n = a.cross(b).normalize();
                let t = (corner.as_dvec3() - o).dot(n) / d.dot(n);
                let off = o + d * t - corner.as_dvec3();
                let inside = |e: DVec3| (0.0..=1.0).contains(&(off.dot(e) / e.length_squared()));
                (inside(a) && inside(b)).then_some((t, n))
            }
        }
    }

    /// A bound on the distance of two of its points, in metres.
    fn size(&self) -> f32 {
        match *self {
            Shape::Sphere { radius, .. } | Shape::Disk { radius, .. } => 2.0 * radius,
            Shape::Rectangle { edges: [a, b], .. } => a.length() + b.length(),
        }
    }
}

/// An opaque Lambertian thing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    pub(super) shape: Shape,
    pub(super) reflectance: f32,
    pub(super) emission: f32,
    /// The lamp that it is.
    pub(super) lamp: Option<usize>,
}

impl Solid {
    /// What only stands in the way.
    pub(super) fn black(shape: Shape) -> Self {
        Self {
            shape,
            reflectance: 0.0,
            emission: 0.0,
            lamp: None,
        }
    }

    /// A spherical wall around the origin.
    pub(super) fn room(radius: f32, reflectance: f32, emission: f32) -> Self {
        Self {
            reflectance,
            emission,
            ..Self::black(Shape::Sphere {
                center: Vec3::ZERO,
                radius,
            })
        }
    }
}

/// All surfaces.
#[derive(Clone, Debug, Default)]
pub(super) struct Solids(pub(super) Vec<Solid>);

impl Solids {
    fn nearest(&self, ray: &Ray, t_max: f32) -> Option<(f64, DVec3, &Solid)> {
        let met = self.0.iter().filter_map(|solid| {
            let (t, n) = solid.shape.intersect(ray)?;
            (t > 0.0 && t < f64::from(t_max)).then_some((t, n, solid))
        });
        met.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

impl Geometry for Solids {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        let (t, n, solid) = self.nearest(ray, t_max)?;
        let n = n.as_vec3();
        let normal = if n.dot(ray.direction) > 0.0 { -n } else { n };
        Some(SurfaceHit {
            t: t as f32,
            position: (ray.origin.as_dvec3() + ray.direction.as_dvec3() * t).as_vec3(),
            normal,
            bsdf: Bsdf::lambert(Vec3::splat(solid.reflectance), normal),
            emission: Vec3::splat(solid.emission),
            light: solid.lamp,
            size: solid.shape.size(),
        })
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.nearest(ray, t_max).is_some()
    }
}

/// A light.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lamp {
    /// A lamp without extent, W/sr.
    Point { position: Vec3, intensity: f32 },
    /// A sky of one radiance, all around or only where the unit vector `side` points.
    Sky { radiance: f32, side: Option<Vec3> },
    /// An emitting solid, which the surfaces must hold too.
    Solid { shape: Shape, radiance: f32 },
}

/// The lights of a world.
#[derive(Clone, Debug)]
pub(super) struct Lamps {
    list: Vec<Lamp>,
    skies: Vec<usize>,
}

impl Lamps {
    /// No light.
    pub(super) fn none() -> Self {
        Self {
            list: Vec::new(),
            skies: Vec::new(),
        }
    }

    /// One light.
    pub(super) fn one(lamp: Lamp) -> Self {
        Self {
            list: vec![lamp],
            skies: if matches!(lamp, Lamp::Sky { .. }) {
                vec![0]
            } else {
                Vec::new()
            },
        }
    }

    /// A lamp at the origin, where f32 resolves how close a ray passes.
    pub(super) fn at_origin(intensity: f32) -> Self {
        Self::one(Lamp::Point {
            position: Vec3::ZERO,
            intensity,
        })
    }

    /// Radiance 1 all around.
    pub(super) fn sky() -> Self {
        Self::one(Lamp::Sky {
            radiance: 1.0,
            side: None,
        })
    }
}

/// Uniform directions in the cone under which a ball is seen, and their density.
struct Cone {
    frame: Frame,
    /// 1 − cosine of the half-angle.
    versine: f64,
}

impl Cone {
    fn new(p: Vec3, center: Vec3, radius: f32) -> Self {
        let axis = center - p;
        let s2 = (f64::from(radius) / f64::from(axis.length()))
            .powi(2)
            .min(1.0);
        Self {
            frame: Frame::from_normal(axis.normalize()),
            versine: s2 / (1.0 + (1.0 - s2).sqrt()),
        }
    }

    fn pdf(&self) -> f32 {
        (0.5 / (std::f64::consts::PI * self.versine)) as f32
    }

    fn sample(&self, u: [f32; 2]) -> Vec3 {
        let v = f64::from(u[0]) * self.versine;
        let (sin, cos) = ((v * (2.0 - v)).sqrt() as f32, (1.0 - v) as f32);
        let (y, x) = (2.0 * PI * u[1]).sin_cos();
        self.frame
            .to_world(Vec3::new(sin * x, sin * y, cos))
            .normalize()
    }
}

impl Lights for Lamps {
    fn count(&self) -> usize {
        self.list.len()
    }

    fn importance(&self, _light: usize, _p: Vec3, _normal: Option<Vec3>) -> f32 {
        1.0
    }

    fn importance_along(&self, light: usize, ray: &Ray, t_max: f32) -> f32 {
        self.pivot(light).map_or(1.0, |pivot| {
            Equiangular::new(ray, pivot, 0.0, t_max).angle_over_distance()
        })
    }

    fn pivot(&self, light: usize) -> Option<Vec3> {
        match self.list.get(light)? {
            Lamp::Point { position, .. } => Some(*position),
            Lamp::Sky { .. } => None,
            Lamp::Solid { shape, .. } => Some(match *shape {
                Shape::Sphere { center, .. } | Shape::Disk { center, .. } => center,
                Shape::Rectangle { corner, edges } => corner + 0.5 * (edges[0] + edges[1]),
            }),
        }
    }

    fn sample(&self, light: usize, p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        match *self.list.get(light)? {
            Lamp::Point {
                position,
                intensity,
            } => {
                let distance = position.distance(p);
                Some(LightSample {
                    w_i: (position - p).normalize(),
                    distance,
                    radiance: Vec3::splat(intensity / (distance * distance)),
                    pdf: 1.0,
                    delta: true,
                    normal: Vec3::ZERO,
                    size: 0.0,
                })
            }
            Lamp::Sky { radiance, side } => {
                let w = warp::uniform_sphere(u);
                // The other half is turned over.
                let w_i = side.map_or(w, |side| w * w.dot(side).signum());
                Some(LightSample {
                    w_i,
                    distance: f32::INFINITY,
                    radiance: Vec3::splat(radiance),
                    pdf: self.pdf(light, p, w_i),
                    delta: false,
                    normal: Vec3::ZERO,
                    size: 0.0,
                })
            }
            Lamp::Solid { shape, radiance } => {
                let w_i = match shape {
                    Shape::Sphere { center, radius } => Cone::new(p, center, radius).sample(u),
                    Shape::Rectangle { corner, edges } => {
                        SphericalRectangle::new(p, corner, edges)?
                            .sample(u)
                            .direction
                    }
                    Shape::Disk { .. } => return None,
                };
                let (t, n) = shape.intersect(&Ray::new(p, w_i))?;
                let n = n.as_vec3();
                Some(LightSample {
                    w_i,
                    distance: t as f32,
                    radiance: Vec3::splat(radiance),
                    pdf: self.pdf(light, p, w_i),
                    delta: false,
                    normal: if n.dot(w_i) > 0.0 { -n } else { n },
                    size: shape.size(),
                })
            }
        }
    }

    fn pdf(&self, light: usize, p: Vec3, _w_i: Vec3) -> f32 {
        match self.list.get(light) {
            Some(Lamp::Sky { side, .. }) => 0.25 / PI * if side.is_some() { 2.0 } else { 1.0 },
            Some(Lamp::Solid { shape, .. }) => match *shape {
                Shape::Sphere { center, radius } => Cone::new(p, center, radius).pdf(),
                Shape::Rectangle { corner, edges } => SphericalRectangle::new(p, corner, edges)
                    .map_or(0.0, |seen| 1.0 / seen.solid_angle()),
                Shape::Disk { .. } => 0.0,
            },
            Some(Lamp::Point { .. }) | None => 0.0,
        }
    }

    fn environment(&self) -> &[usize] {
        &self.skies
    }

    fn environment_radiance(&self, light: usize, w_i: Vec3) -> Vec3 {
        match self.list.get(light) {
            Some(Lamp::Sky { radiance, side }) if side.is_none_or(|s| w_i.dot(s) > 0.0) => {
                Vec3::splat(*radiance)
            }
            _ => Vec3::ZERO,
        }
    }

    fn distance_to_point_lights(&self, p: Vec3) -> f32 {
        let distance = |lamp: &Lamp| match lamp {
            Lamp::Point { position, .. } => position.distance(p),
            _ => f32::INFINITY,
        };
        self.list.iter().map(distance).fold(f32::INFINITY, f32::min)
    }
}

/// Media of one medium; none where a number of a table is out of range, which the rows then show.
pub(super) fn media(params: MediumParams) -> Media {
    let medium: Result<Medium, MediumError> = Medium::new(params);
    debug_assert!(medium.is_ok(), "{medium:?}");
    Media::new(medium.into_iter().collect())
}

/// A homogeneous medium, alike in all channels.
pub(super) fn fog(sigma_t: f32, albedo: f32, region: Region, phase: PhaseFunction) -> Media {
    media(MediumParams {
        region,
        phase,
        ..MediumParams::new(Vec3::splat(sigma_t), Vec3::splat(albedo))
    })
}

/// Henyey–Greenstein, or isotropic for g = 0.
pub(super) fn phase(g: f32) -> PhaseFunction {
    if g == 0.0 {
        return PhaseFunction::Isotropic;
    }
    PhaseFunction::henyey_greenstein(g).unwrap_or_default()
}

/// The ball of `radius` around the origin.
pub(super) fn ball(radius: f32) -> Region {
    Region::Sphere {
        center: Vec3::ZERO,
        radius,
    }
}
