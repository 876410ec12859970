//! One medium: where it is, how dense, and what it does to light.
//!
//! [`MediumParams`] is what a user writes; [`Medium::new`] checks it, after which no wrong value can exist.

use crate::line::Line;
use crate::{Density, PhaseFunction, Region};
use glam::{DVec3, Vec3};
use thiserror::Error;
use tyndall_math::Aabb;

/// Largest extinction coefficient, per metre: a mean free path of a nanometre, far under the wavelength of light, below
/// which radiative transfer means nothing and f32 distances vanish.
pub const MAX_SIGMA_T: f32 = 1e9;

/// Smallest scale height, in metres: a fog with a sharper top is one in a region.
pub const MIN_SCALE_HEIGHT: f32 = 1e-6;

/// How far above 1 an albedo may lie and still be taken as 1: what σs/σt makes of rounding in f32.
const ALBEDO_ROUNDING: f32 = 1e-6;

/// What a medium is made of, unchecked; all but extinction and albedo has a default.
#[derive(Clone, Debug, PartialEq)]
pub struct MediumParams {
    /// Names the medium in messages.
    pub name: String,
    /// Where it is; default everywhere.
    pub region: Region,
    /// Factor on all coefficients; default 1.
    pub density: Density,
    /// Extinction per metre at density 1: finite, in [0, [`MAX_SIGMA_T`]] also when multiplied by a constant density.
    pub sigma_t: Vec3,
    /// Single-scattering albedo σs/σt, each channel in [0, 1].
    pub albedo: Vec3,
    /// Where scattered light goes; default isotropic.
    pub phase: PhaseFunction,
    /// Emitted radiance per metre at density 1, W/(m³ sr): finite, not negative; default 0.
    pub emission: Vec3,
}

impl MediumParams {
    /// A medium with extinction `sigma_t` per metre and single-scattering albedo `albedo`, everywhere, isotropic.
    pub fn new(sigma_t: Vec3, albedo: Vec3) -> Self {
        Self {
            name: "medium".to_owned(),
            region: Region::Everywhere,
            density: Density::Constant(1.0),
            sigma_t,
            albedo,
            phase: PhaseFunction::Isotropic,
            emission: Vec3::ZERO,
        }
    }
}

/// A checked participating medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    params: MediumParams,
    sigma_s: Vec3,
    mean_sigma_s: f32,
    vacuum: bool,
}

/// Why a medium cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MediumError {
    /// Extinction out of range.
    #[error(
        "sigma_t = {found} of medium '{medium}' must be finite and in [0, {MAX_SIGMA_T:e}] per metre in every channel, \
         at the medium's density too"
    )]
    Extinction {
        /// Name of the medium.
        medium: String,
        /// Extinction at the medium's largest density.
        found: Vec3,
    },
    /// Albedo out of range.
    #[error(
        "albedo = {found} of medium '{medium}' must lie in [0, 1] in every channel: above 1 the medium would create energy \
         (use emission for a medium that glows)"
    )]
    Albedo {
        /// Name of the medium.
        medium: String,
        /// The albedo given.
        found: Vec3,
    },
    /// Emission out of range.
    #[error(
        "emission = {found} of medium '{medium}' must be finite and not negative in every channel"
    )]
    Emission {
        /// Name of the medium.
        medium: String,
        /// Emission at the medium's largest density.
        found: Vec3,
    },
    /// A constant density out of range.
    #[error("density {found} of medium '{medium}' must be finite and not negative")]
    Density {
        /// Name of the medium.
        medium: String,
        /// The density given.
        found: f32,
    },
    /// A height fog without a proper height.
    #[error(
        "height density of medium '{medium}': base = {base} must be finite, scale_height = {scale_height} finite and at least \
         {MIN_SCALE_HEIGHT:e} (fog of the same density at all heights is Constant)"
    )]
    Height {
        /// Name of the medium.
        medium: String,
        /// The base given.
        base: f32,
        /// The scale height given.
        scale_height: f32,
    },
    /// A box without inside.
    #[error(
        "box of medium '{medium}': min = {min} must be finite and below max = {max} in every coordinate"
    )]
    Box {
        /// Name of the medium.
        medium: String,
        /// The corner given as smallest.
        min: Vec3,
        /// The corner given as largest.
        max: Vec3,
    },
    /// A ball without inside.
    #[error(
        "sphere of medium '{medium}': center = {center} must be finite, radius = {radius} finite and above 0"
    )]
    Sphere {
        /// Name of the medium.
        medium: String,
        /// The centre given.
        center: Vec3,
        /// The radius given.
        radius: f32,
    },
}

impl Medium {
    /// Checks a medium.
    ///
    /// An albedo above 1 by no more than f32 rounding is taken as 1.
    ///
    /// # Errors
    /// The first value out of its range, with the medium's name.
    pub fn new(params: MediumParams) -> Result<Self, MediumError> {
        check_region(&params)?;
        let peak_density = check_density(&params)?;
        check_coefficients(&params, peak_density)?;
        let params = MediumParams {
            albedo: params.albedo.min(Vec3::ONE),
            ..params
        };
        let sigma_s = params.sigma_t * params.albedo;
        let inert = params.sigma_t == Vec3::ZERO && params.emission == Vec3::ZERO;
        Ok(Self {
            sigma_s,
            mean_sigma_s: sigma_s.element_sum() / 3.0,
            vacuum: inert || peak_density == 0.0,
            params,
        })
    }

    /// Names the medium in messages.
    pub fn name(&self) -> &str {
        &self.params.name
    }

    /// Where it is.
    #[inline]
    pub fn region(&self) -> &Region {
        &self.params.region
    }

    /// Factor on all coefficients.
    #[inline]
    pub fn density(&self) -> &Density {
        &self.params.density
    }

    /// Extinction per metre at density 1.
    #[inline]
    pub fn sigma_t(&self) -> Vec3 {
        self.params.sigma_t
    }

    /// Scattering per metre at density 1: albedo times extinction.
    #[inline]
    pub fn sigma_s(&self) -> Vec3 {
        self.sigma_s
    }

    /// Single-scattering albedo, each channel in [0, 1].
    pub fn albedo(&self) -> Vec3 {
        self.params.albedo
    }

    /// Where scattered light goes.
    #[inline]
    pub fn phase(&self) -> &PhaseFunction {
        &self.params.phase
    }

    /// Emitted radiance per metre at density 1, W/(m³ sr).
    pub fn emission(&self) -> Vec3 {
        self.params.emission
    }

    /// Whether light passes as through empty space: no extinction and no emission, or no density.
    #[inline]
    pub fn is_vacuum(&self) -> bool {
        self.vacuum
    }

    /// A column whose optical depth exceeds `depth` in all channels, rounding included; infinite where a channel has no extinction.
    #[inline]
    pub(crate) fn column_of_depth(&self, depth: f32) -> f64 {
        const ROUNDING: f64 = 1e-5;
        f64::from(depth) / f64::from(self.sigma_t().min_element()) * (1.0 + ROUNDING)
    }

    /// A box around all of it, empty where there is nothing; `None` where it has no bounds.
    pub fn bounds(&self) -> Option<Aabb> {
        let of_grid = match self.density() {
            Density::Grid(grid) => grid.bounds(),
            Density::Constant(_) | Density::Height { .. } => None,
        };
        match (self.region().bounds(), of_grid) {
            (Some(a), Some(b)) => {
                let (min, max) = (a.min.max(b.min), a.max.min(b.max));
                let meet = min.cmple(max).all();
                Some(if meet { Aabb { min, max } } else { Aabb::EMPTY })
            }
            (a, b) => a.or(b),
        }
    }

    /// Distance in metres from `p` to the nearest point where the medium begins or ends abruptly; infinite where it nowhere does. From
    /// outside the box of a grid, a lower bound of it.
    pub fn distance_to_boundary(&self, p: Vec3) -> f32 {
        let of_region = self.region().distance_to_boundary(p);
        match self.density() {
            Density::Grid(grid) => of_region.min(grid.distance_to_jump(p)),
            Density::Constant(_) | Density::Height { .. } => of_region,
        }
    }

    /// The distances at which `line` enters and leaves the medium, cut to [0, `t_max`]; `None` where no length is left.
    #[inline]
    pub(crate) fn clip(&self, line: &Line, t_max: f64) -> Option<(f64, f64)> {
        let (t0, t1) = self.region().clip_line(line, t_max)?;
        self.density().clip(line, t0, t1)
    }

    /// The boundary near a point of it: its outward unit normal, and how fast that turns along it, in radians per metre.
    pub(crate) fn boundary(&self, p: DVec3) -> (DVec3, f64) {
        let region = self.region();
        if let Density::Grid(grid) = self.density()
            && let Some((distance, normal)) = grid.nearest_face(p)
            && distance <= region.distance_to_boundary(p.as_vec3()).into()
        {
            return (normal, 0.0);
        }
        (region.normal(p), region.curvature())
    }

    /// Scattering per metre at density 1, averaged over the channels: the weight of this medium among others.
    pub(crate) fn mean_sigma_s(&self) -> f32 {
        self.mean_sigma_s
    }
}

fn check_region(params: &MediumParams) -> Result<(), MediumError> {
    let medium = || params.name.clone();
    match params.region {
        Region::Box { min, max }
            if !(min.is_finite() && max.is_finite() && min.cmplt(max).all()) =>
        {
            Err(MediumError::Box {
                medium: medium(),
                min,
                max,
            })
        }
        Region::Sphere { center, radius }
            if !(center.is_finite() && radius.is_finite() && radius > 0.0) =>
        {
            Err(MediumError::Sphere {
                medium: medium(),
                center,
                radius,
            })
        }
        Region::Everywhere | Region::Box { .. } | Region::Sphere { .. } => Ok(()),
    }
}

/// Checks the density and gives its largest value.
fn check_density(params: &MediumParams) -> Result<f32, MediumError> {
    let medium = || params.name.clone();
    match params.density {
        Density::Constant(found) if !(found.is_finite() && found >= 0.0) => {
            Err(MediumError::Density {
                medium: medium(),
                found,
            })
        }
        Density::Constant(density) => Ok(density),
        Density::Height { base, scale_height }
            if !(base.is_finite()
                && scale_height.is_finite()
                && scale_height >= MIN_SCALE_HEIGHT) =>
        {
            Err(MediumError::Height {
                medium: medium(),
                base,
                scale_height,
            })
        }
        Density::Height { .. } | Density::Grid(_) => Ok(params.density.max()),
    }
}

fn check_coefficients(params: &MediumParams, peak_density: f32) -> Result<(), MediumError> {
    let medium = || params.name.clone();
    let within = |v: Vec3, max: f32| v.cmpge(Vec3::ZERO).all() && v.cmple(Vec3::splat(max)).all();
    for scale in [1.0, peak_density] {
        let found = params.sigma_t * scale;
        if !within(found, MAX_SIGMA_T) {
            return Err(MediumError::Extinction {
                medium: medium(),
                found,
            });
        }
        let found = params.emission * scale;
        if !within(found, f32::MAX) {
            return Err(MediumError::Emission {
                medium: medium(),
                found,
            });
        }
    }
    if within(params.albedo, 1.0 + ALBEDO_ROUNDING) {
        Ok(())
    } else {
        Err(MediumError::Albedo {
            medium: medium(),
            found: params.albedo,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn params() -> MediumParams {
        MediumParams::new(Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.5, 0.0, 1.0))
    }

    #[test]
    fn coefficients_follow_from_extinction_and_albedo() {
        let fog = Medium::new(params()).unwrap();
        assert_eq!(fog.sigma_s(), Vec3::new(0.05, 0.0, 0.3));
        assert_eq!(fog.region(), &Region::Everywhere);
        assert_eq!(fog.density(), &Density::Constant(1.0));
        assert!(fog.phase().is_isotropic() && !fog.is_vacuum());
    }

    #[test]
    fn an_albedo_one_rounding_above_one_is_one() {
        let albedo = Vec3::splat(1.0 + 1e-7);
        let fog = Medium::new(MediumParams { albedo, ..params() }).unwrap();
        assert_eq!(fog.albedo(), Vec3::ONE);
        assert_eq!(fog.sigma_s(), fog.sigma_t());
    }

    #[test]
    fn vacuum_is_what_neither_weakens_nor_emits() {
        let vacuum = |params| Medium::new(params).unwrap().is_vacuum();
        let sigma_t = Vec3::ZERO;
        assert!(vacuum(MediumParams {
            sigma_t,
            ..params()
        }));
        assert!(vacuum(MediumParams {
            density: Density::Constant(0.0),
            ..params()
        }));
        assert!(!vacuum(MediumParams {
            sigma_t,
            emission: Vec3::X,
            ..params()
        }));
    }

    #[test]
    fn wrong_values_are_refused_with_the_name_the_value_and_what_is_allowed() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let sigma_t = |x| MediumParams {
            sigma_t: Vec3::new(0.1, x, 0.1),
            ..params()
        };
        let albedo = |x| MediumParams {
            albedo: Vec3::new(0.1, x, 0.1),
            ..params()
        };
        let emission = |x| MediumParams {
            emission: Vec3::new(0.1, 0.1, x),
            ..params()
        };
        let density = |density| MediumParams {
            density,
            ..params()
        };
        let height = |base, scale_height| density(Density::Height { base, scale_height });
        let region = |region| MediumParams { region, ..params() };
        let sphere = |radius| {
            region(Region::Sphere {
                center: Vec3::ZERO,
                radius,
            })
        };
        let cube = |max| {
            region(Region::Box {
                min: Vec3::ZERO,
                max,
            })
        };
        let mut n_refused = 0;
        for (wrong, says) in [
            (
                vec![sigma_t(-1.0), sigma_t(nan), sigma_t(inf), sigma_t(1e30)],
                "sigma_t",
            ),
            (
                vec![albedo(1.2), albedo(-0.1), albedo(nan)],
                "create energy",
            ),
            (
                vec![emission(-1.0), emission(inf), emission(nan)],
                "emission",
            ),
            (
                vec![
                    density(Density::Constant(-1.0)),
                    density(Density::Constant(nan)),
                ],
                "density",
            ),
            (
                vec![density(Density::Constant(1e30))],
                "at the medium's density too",
            ),
            (
                vec![
                    height(0.0, 0.0),
                    height(0.0, -2.0),
                    height(nan, 1.0),
                    height(0.0, inf),
                ],
                "scale_height",
            ),
            (
                vec![sphere(0.0), sphere(-1.0), sphere(nan), sphere(inf)],
                "radius",
            ),
            (
                vec![
                    cube(Vec3::new(1.0, 0.0, 1.0)),
                    cube(Vec3::new(1.0, nan, 1.0)),
                    cube(Vec3::INFINITY),
                ],
                "below max",
            ),
        ] {
            for params in wrong {
                let message = Medium::new(MediumParams {
                    name: "haze".to_owned(),
                    ..params.clone()
                })
                .map(|_| ())
                .unwrap_err()
                .to_string();
                assert!(
                    message.contains("'haze'") && message.contains(says),
                    "{message} for {params:?}"
                );
                n_refused += 1;
            }
        }
        assert_eq!(n_refused, 24);
    }
}
