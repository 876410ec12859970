//! A scene in a few lines, for tests: point lamps, a uniform sky, a spherical room.

use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_media::{Media, Medium, MediumParams, PhaseFunction, Region};
use tyndall_transport::layers::{LayerVisitor, Layers};
use tyndall_transport::light_tree::{Cone, LightBounds, LightTree};
use tyndall_transport::path::{FirstEvent, Reach, Start, trace};
use tyndall_transport::{Bsdf, Geometry, LightSample, Lights, SurfaceHit, World};

/// Nothing, or the inside of a Lambertian sphere around the origin.
pub(crate) struct Room {
    pub(crate) radius: f32,
    pub(crate) reflectance: f32,
    pub(crate) emission: f32,
}

pub(crate) const OPEN: Room = Room {
    radius: f32::INFINITY,
    reflectance: 0.0,
    emission: 0.0,
};

impl Geometry for Room {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        if self.radius.is_infinite() {
            return None;
        }
        let b = ray.origin.dot(ray.direction);
        let c = ray.origin.length_squared() - self.radius * self.radius;
        let t = -b + (b * b - c).max(0.0).sqrt();
        let position = ray.at(t).normalize() * self.radius;
        let normal = -position / self.radius;
        (t > 1e-4 * self.radius && t < t_max).then(|| SurfaceHit {
            t,
            position,
            normal,
            bsdf: Bsdf::lambert(Vec3::splat(self.reflectance), normal),
            emission: Vec3::splat(self.emission),
            light: None,
            size: self.radius,
        })
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.intersect(ray, t_max).is_some()
    }
}

/// Lamps of a radiant intensity each, and a sky of one radiance; the sky is the last light where it shines.
#[derive(Default)]
pub(crate) struct Lamps {
    pub(crate) points: Vec<(Vec3, f32)>,
    pub(crate) sky: f32,
    sky_index: Vec<usize>,
    tree: Option<LightTree>,
}

impl Lamps {
    pub(crate) fn points(points: &[(Vec3, f32)]) -> Self {
        Self {
            points: points.to_vec(),
            ..Self::default()
        }
    }

    pub(crate) fn with_sky(self, sky: f32) -> Self {
        Self {
            sky,
            sky_index: vec![self.points.len()],
            ..self
        }
    }

    /// The same lights, to be chosen from by a tree.
    pub(crate) fn in_a_tree(self) -> Self {
        let lamp = |&(center, intensity): &(Vec3, f32)| LightBounds {
            center,
            radius: 0.0,
            cone: Cone::SPHERE,
            intensity,
        };
        let mut bounds: Vec<_> = self.points.iter().map(|point| Some(lamp(point))).collect();
        bounds.resize(self.count(), None);
        Self {
            tree: Some(LightTree::new(&bounds)),
            ..self
        }
    }

    pub(crate) fn sky(sky: f32) -> Self {
        Self {
            points: Vec::new(),
            sky,
            sky_index: vec![0],
            tree: None,
        }
    }
}

impl Lights for Lamps {
    fn count(&self) -> usize {
        self.points.len() + self.sky_index.len()
    }

    fn importance(&self, light: usize, p: Vec3, _normal: Option<Vec3>) -> f32 {
        self.points
            .get(light)
            .map_or(4.0 * PI * self.sky, |(q, i)| i / q.distance_squared(p))
    }

    fn importance_along(&self, light: usize, ray: &Ray, t_max: f32) -> f32 {
        self.points
            .get(light)
            .map_or(4.0 * PI * self.sky * t_max, |(q, i)| {
                i * warp::Equiangular::new(ray, *q, 0.0, t_max).angle_over_distance()
            })
    }

    fn tree(&self) -> Option<&LightTree> {
        self.tree.as_ref()
    }

    fn pivot(&self, light: usize) -> Option<Vec3> {
        self.points.get(light).map(|(q, _)| *q)
    }

    fn has_extent(&self, light: usize) -> bool {
        light >= self.points.len()
    }

    fn sample(&self, light: usize, p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        Some(match self.points.get(light) {
            Some((q, intensity)) => {
                let distance = q.distance(p);
                LightSample {
                    w_i: (*q - p).normalize(),
                    distance,
                    radiance: Vec3::splat(intensity / (distance * distance)),
                    pdf: 1.0,
                    delta: true,
                    normal: Vec3::ZERO,
                    size: 0.0,
                }
            }
            None => LightSample {
                w_i: warp::uniform_sphere(u),
                distance: f32::INFINITY,
                radiance: Vec3::splat(self.sky),
                pdf: 0.25 / PI,
                delta: false,
                normal: Vec3::ZERO,
                size: 0.0,
            },
        })
    }

    fn pdf(&self, _light: usize, _p: Vec3, _w_i: Vec3) -> f32 {
        0.25 / PI
    }

    fn environment(&self) -> &[usize] {
        &self.sky_index
    }

    fn environment_radiance(&self, _light: usize, _w_i: Vec3) -> Vec3 {
        Vec3::splat(self.sky)
    }

    fn distance_to_point_lights(&self, p: Vec3) -> f32 {
        self.points
            .iter()
            .map(|(q, _)| q.distance(p))
            .fold(f32::INFINITY, f32::min)
    }
}

/// A homogeneous medium, grey.
pub(crate) fn fog(sigma_t: f32, albedo: f32, region: Region, phase: PhaseFunction) -> Media {
    Media::new(vec![
        Medium::new(MediumParams {
            region,
            phase,
            ..MediumParams::new(Vec3::splat(sigma_t), Vec3::splat(albedo))
        })
        .unwrap(),
    ])
}

pub(crate) fn sphere(radius: f32) -> Region {
    Region::Sphere {
        center: Vec3::ZERO,
        radius,
    }
}

/// Mean over the sample index of the layers seen along `ray`, and the standard error of the beauty.
pub(crate) fn pixel(
    world: &World<'_, Room, Lamps>,
    ray: Ray,
    max_depth: Option<u32>,
    n: u64,
) -> (Layers, Estimate) {
    let mut sum = Layers::default();
    let mut estimate = Estimate::default();
    // Independent keys: the standard error then needs no batches.
    for i in 0..n {
        let key = Key {
            seed: 11,
            purpose: Purpose::Probe,
            index: i,
        };
        let mut visitor = LayerVisitor::default();
        let start = Start {
            ray,
            hit: None,
            first: FirstEvent::Any,
            reach: Reach::depth(max_depth),
        };
        trace(world, &start, &mut Sampler::new(key, 0), &mut visitor);
        sum.surface += visitor.layers.surface / n as f32;
        sum.single += visitor.layers.single / n as f32;
        sum.multiple += visitor.layers.multiple / n as f32;
        sum.emission += visitor.layers.emission / n as f32;
        estimate.add(visitor.layers.beauty());
    }
    (sum, estimate)
}

/// Mean and standard error of a number sampled independently; f64 sums.
#[derive(Default, Debug, Clone, Copy)]
pub(crate) struct Estimate {
    n: f64,
    sum: f64,
    squares: f64,
}

impl Estimate {
    pub(crate) fn add(&mut self, value: Vec3) {
        let v = f64::from(value.element_sum()) / 3.0;
        self.n += 1.0;
        self.sum += v;
        self.squares += v * v;
    }

    pub(crate) fn mean(&self) -> f64 {
        self.sum / self.n
    }

    pub(crate) fn error(&self) -> f64 {
        ((self.squares / self.n - self.mean() * self.mean()).max(0.0) / self.n).sqrt()
    }

    /// Asserts |mean − exact| ≤ 4.5 standard errors (false alarm 7e-6 a number) and a relative standard error below `worst`.
    /// `rounding` is the relative error of f32 sums and closed forms.
    pub(crate) fn check(&self, name: &str, exact: f64, worst: f64, rounding: f64) {
        let (mean, error) = (self.mean(), self.error());
        let z = (mean - exact) / (error + rounding * exact.abs());
        println!(
            "{name}: {mean:.6e} exact {exact:.6e} relative error {:.4} z {z:.2}",
            error / exact
        );
        assert!(z.abs() < 4.5, "{name}: {mean} against {exact}, z = {z}");
        assert!(
            error <= worst * exact.abs(),
            "{name}: standard error {error} of {exact}"
        );
    }
}
