//! A black disc in fog with a smooth source: how much of the fog's light arrives at a point, to ten digits or so.
//!
//! What would arrive without the disc, less what comes from behind it; both are integrals of smooth functions. The disc throws no
//! shadow into the fog, so that its silhouette is all there is to know.

use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use tyndall_math::quadrature::gauss_legendre;
use tyndall_math::{Equiangular, Ray};
use tyndall_media::{Density, Media, Medium, MediumError, MediumParams};
use tyndall_transport::{Bsdf, Geometry, LightSample, Lights, SurfaceHit};

/// Extinction at the origin, per metre.
const SIGMA_T: f64 = 0.4;
/// Albedo of the fog.
const ALBEDO: f64 = 0.8;
/// Height over which glowing fog thins out to 1/e, in metres.
const SCALE_HEIGHT: f64 = 4.0;
/// Scale heights from the bottom of glowing fog to the origin: rays never see through so much of it.
const ABOVE_BASE: f64 = 5.0;

/// Nodes along a radius of the disc, half as many as around it, and along a ray.
const NODES: usize = 32;

/// A black disc.
pub(super) struct Disc {
    center: DVec3,
    normal: DVec3,
    radius: f64,
}

impl Disc {
    pub(super) fn new() -> Self {
        Self {
            center: DVec3::new(0.0, 0.2, 1.0),
            normal: DVec3::new(0.2, 0.1, -1.0).normalize(),
            radius: 0.6,
        }
    }

    /// ∫ f(ω, r) dω over the directions ω in which it is seen from `x`, at distance r.
    fn integrate(&self, x: DVec3, f: impl Fn(DVec3, f64) -> f64) -> f64 {
        let (u, v) = self.normal.any_orthonormal_pair();
        let around = 2 * NODES;
        let mut sum = 0.0;
        for (node, weight) in gauss_legendre(NODES) {
            let rho = 0.5 * self.radius * (1.0 + node);
            let area = 0.5 * self.radius * weight * rho * TAU / around as f64;
            for i in 0..around {
                let (sin, cos) = (i as f64 * TAU / around as f64).sin_cos();
                let r = self.center + (u * cos + v * sin) * rho - x;
                let (w, distance) = (r.normalize(), r.length());
                let cosine = w.dot(self.normal).abs();
                sum += f(w, distance) * cosine / (distance * distance) * area;
            }
        }
        sum
    }
}

impl Geometry for Disc {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let t = (self.center - o).dot(self.normal) / d.dot(self.normal);
        let position = o + d * t;
        let met = t > 0.0 && t < f64::from(t_max) && position.distance(self.center) <= self.radius;
        let normal = self.normal * -self.normal.dot(d).signum();
        met.then(|| SurfaceHit {
            t: t as f32,
            position: position.as_vec3(),
            normal: normal.as_vec3(),
            bsdf: Bsdf::lambert(Vec3::ZERO, normal.as_vec3()),
            emission: Vec3::ZERO,
            light: None,
            size: 2.0 * self.radius as f32,
        })
    }

    fn occluded(&self, _ray: &Ray, _t_max: f32) -> bool {
        false
    }
}

/// Where the fog's light comes from.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Source {
    /// Fog that thins out upwards glows as a black body of radiance 1.
    Glow,
    /// Even fog scatters the light of a lamp once; it stands here.
    Lamp(DVec3),
}

/// Strength of a lamp, W/sr.
const INTENSITY: f64 = 100.0;

impl Source {
    /// A lamp well away from the disc, as the gather point sees it: some 30° from its rim.
    pub(super) const LAMP: Self = Self::Lamp(DVec3::new(3.6, 1.0, 2.0));
    /// A lamp 5° to 10° from the rim, whose glow is brightest there.
    pub(super) const LAMP_BESIDE: Self = Self::Lamp(DVec3::new(3.0, 1.0, 4.0));

    fn lamp(self) -> Option<DVec3> {
        match self {
            Self::Glow => None,
            Self::Lamp(position) => Some(position),
        }
    }

    /// Scattering events between the light and the eye: the last is at the gather point.
    pub(super) fn depth(self) -> u32 {
        match self {
            Self::Glow => 1,
            Self::Lamp(_) => 2,
        }
    }

    pub(super) fn media(self) -> Result<Media, MediumError> {
        let params = match self {
            Self::Glow => {
                let sigma_t = Vec3::splat((SIGMA_T * ABOVE_BASE.exp()) as f32);
                MediumParams {
                    density: Density::Height {
                        base: -(ABOVE_BASE * SCALE_HEIGHT) as f32,
                        scale_height: SCALE_HEIGHT as f32,
                    },
                    emission: sigma_t,
                    ..MediumParams::new(sigma_t, Vec3::splat(ALBEDO as f32))
                }
            }
            Self::Lamp(_) => {
                MediumParams::new(Vec3::splat(SIGMA_T as f32), Vec3::splat(ALBEDO as f32))
            }
        };
        Ok(Media::new(vec![Medium::new(params)?]))
    }

    /// (1/4π) ∫ L dω at `x`.
    pub(super) fn value(self, disc: &Disc, x: DVec3) -> f64 {
        let hidden = disc.integrate(x, |w, r| self.beyond(x, w, r));
        self.unhidden(x) - hidden / (4.0 * PI)
    }

    /// ∇ of [`Source::value`] by central differences, good to about 1e-6 of it.
    pub(super) fn gradient(self, disc: &Disc, x: DVec3) -> DVec3 {
        let h = 1e-3;
        let slope = |axis: DVec3| {
            (self.value(disc, x + axis * h) - self.value(disc, x - axis * h)) / (2.0 * h)
        };
        DVec3::from(DVec3::AXES.map(slope))
    }

    /// [`Source::value`] without the disc.
    fn unhidden(self, x: DVec3) -> f64 {
        match self {
            // All of the sky below is as bright as a black body; above, L = 1 − exp(−σ H/μ) at cosine μ.
            Self::Glow => {
                let up = SCALE_HEIGHT * extinction(x);
                let nodes = gauss_legendre(4 * NODES).into_iter();
                let above: f64 = nodes
                    .map(|(node, weight)| 0.5 * weight * -(-up / (0.5 + 0.5 * node)).exp_m1())
                    .sum();
                0.5 + 0.5 * above
            }
            // ∫ exp(−σ(a + b))/(a² b²) d³y, a and b the distances from y to both points, in prolate spheroidal coordinates
            // a + b = R ξ, ξ = coth s: (4π/R) ∫₀^∞ exp(−σ R coth s) 2 s tanh s / sinh² s ds.
            Self::Lamp(lamp) => {
                let distance = x.distance(lamp);
                let end = 20.0;
                let nodes = gauss_legendre(8 * NODES).into_iter();
                let sum: f64 = nodes
                    .map(|(node, weight)| {
                        let s = 0.5 * end * (1.0 + node);
                        let decay = (-SIGMA_T * distance / s.tanh()).exp();
                        0.5 * end * weight * decay * 2.0 * s * s.tanh() / s.sinh().powi(2)
                    })
                    .sum();
                lamp_scale() * sum / distance
            }
        }
    }

    /// Light that arrives at `x` from direction `w`, from beyond the distance `r`.
    fn beyond(self, x: DVec3, w: DVec3, r: f64) -> f64 {
        match self {
            Self::Glow => {
                let climb = w.y / SCALE_HEIGHT;
                let passed = |t: f64| {
                    let column = if climb == 0.0 {
                        t
                    } else {
                        -(-climb * t).exp_m1() / climb
                    };
                    (-extinction(x) * column).exp()
                };
                passed(r)
                    - if climb > 0.0 {
                        passed(f64::INFINITY)
                    } else {
                        0.0
                    }
            }
            // ∫ exp(−σ(t + d))/d² dt, d the distance to the lamp, over the angle at which it sees the ray.
            Self::Lamp(lamp) => {
                let nearest = (lamp - x).dot(w);
                let aside = (lamp - x - w * nearest).length();
                let (start, end) = (((r - nearest) / aside).atan(), FRAC_PI_2);
                let nodes = gauss_legendre(NODES).into_iter();
                let sum: f64 = nodes
                    .map(|(node, weight)| {
                        let angle = start + 0.5 * (end - start) * (1.0 + node);
                        let (t, d) = (nearest + aside * angle.tan(), aside / angle.cos());
                        0.5 * (end - start) * weight * (-SIGMA_T * (t + d)).exp()
                    })
                    .sum();
                lamp_scale() * sum / aside
            }
        }
    }
}

/// σs I/4π.
fn lamp_scale() -> f64 {
    ALBEDO * SIGMA_T * INTENSITY / (4.0 * PI)
}

/// Extinction of the glowing fog, per metre.
fn extinction(x: DVec3) -> f64 {
    SIGMA_T * (-x.y / SCALE_HEIGHT).exp()
}

impl Lights for Source {
    fn count(&self) -> usize {
        self.lamp().into_iter().count()
    }

    fn importance(&self, _light: usize, p: Vec3, _normal: Option<Vec3>) -> f32 {
        self.distance_to_point_lights(p).powi(-2)
    }

    fn importance_along(&self, light: usize, ray: &Ray, t_max: f32) -> f32 {
        self.pivot(light).map_or(0.0, |lamp| {
            Equiangular::new(ray, lamp, 0.0, t_max).angle_over_distance()
        })
    }

    fn pivot(&self, _light: usize) -> Option<Vec3> {
        Some(self.lamp()?.as_vec3())
    }

    fn sample(&self, light: usize, p: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        let offset = self.pivot(light)? - p;
        Some(LightSample {
            w_i: offset.try_normalize()?,
            distance: offset.length(),
            radiance: Vec3::splat(INTENSITY as f32 / offset.length_squared()),
            pdf: 1.0,
            delta: true,
            normal: Vec3::ZERO,
            size: 0.0,
        })
    }

    fn pdf(&self, _light: usize, _p: Vec3, _w_i: Vec3) -> f32 {
        0.0
    }

    fn distance_to_point_lights(&self, p: Vec3) -> f32 {
        self.pivot(0).map_or(f32::INFINITY, |lamp| lamp.distance(p))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use tyndall_math::{Key, Purpose};
    use tyndall_transport::World;
    use tyndall_transport::gather::{GatherPattern, multiple};
    use tyndall_transport::path::Reach;

    #[test]
    fn the_reference_is_what_a_long_gather_finds() {
        let disc = Disc::new();
        let pattern = GatherPattern::new(1 << 16);
        let key = Key {
            seed: 3,
            purpose: Purpose::Probe,
            index: 0,
        };
        for source in [Source::Glow, Source::LAMP] {
            let media = source.media().unwrap();
            let world = World {
                geometry: &disc,
                lights: &source,
                media: &media,
            };
            for x in [DVec3::ZERO, DVec3::new(-0.1, 0.2, 0.1)] {
                let found = multiple(
                    &world,
                    x.as_vec3(),
                    &pattern,
                    Reach::depth(Some(source.depth())),
                    key,
                );
                let value = source.value(&disc, x);
                // Five standard errors of 16 batches each: wrong alarms are rare, and the seed is fixed.
                let off = (f64::from(found.value.x) - value).abs();
                assert!(
                    off < 5.0 * f64::from(found.value_error.x),
                    "{found:?} {value}"
                );
                let off = found.gradient[0].as_dvec3() - source.gradient(&disc, x);
                let bound = 5.0 * found.gradient_error[0].as_dvec3()
                    + 3e-3 * found.gradient[0].length() as f64;
                assert!(off.abs().cmple(bound).all(), "{found:?} {off}");
            }
        }
    }
}
