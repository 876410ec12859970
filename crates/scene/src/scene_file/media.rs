//! The media of a scene file: region, density, coefficients and phase function.

use super::numbers::{
    Albedo, Asymmetry, Coordinate, ExtinctionRgb, Factor, Fraction, Length, Position, Radiant,
};
use glam::{Mat4, Vec3};
use serde::Deserialize;

/// `Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9), …)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Medium {
    /// What messages call it; `medium1`, `medium2`, … by its place in the list where left out.
    #[serde(default)]
    pub name: Option<String>,
    /// Where it is.
    #[serde(default)]
    pub region: Region,
    /// How its amount varies; multiplies `sigma_t` and `emission`.
    #[serde(default)]
    pub density: Density,
    /// Extinction per metre at density 1.
    pub sigma_t: ExtinctionRgb,
    /// Single-scattering albedo σs/σt.
    pub albedo: Albedo,
    /// Into which directions it scatters.
    #[serde(default)]
    pub phase: PhaseFunction,
    /// Emitted radiance per metre at density 1, W/(m³ sr).
    #[serde(default = "dark")]
    pub emission: Radiant,
}

fn dark() -> Radiant {
    Radiant(Vec3::ZERO)
}

/// Where a medium is.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub enum Region {
    /// Without bounds.
    #[default]
    Everywhere,
    /// An axis-aligned box.
    Box(BoxRegion),
    /// A ball.
    Sphere(Sphere),
}

impl Region {
    /// The same region placed in the world.
    pub fn placed(&self) -> tyndall_media::Region {
        match self {
            Self::Everywhere => tyndall_media::Region::Everywhere,
            Self::Box(BoxRegion(fields)) => tyndall_media::Region::Box {
                min: fields.min.0,
                max: fields.max.0,
            },
            Self::Sphere(sphere) => tyndall_media::Region::Sphere {
                center: sphere.center.0,
                radius: sphere.radius.get(),
            },
        }
    }
}

/// A [`BoxFields`] that has a volume.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "BoxFields")]
pub struct BoxRegion(pub BoxFields);

/// `Box(min: (-1, 0, -1), max: (1, 2, 1))`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Box", deny_unknown_fields)]
pub struct BoxFields {
    /// Smallest coordinates.
    pub min: Position,
    /// Largest coordinates.
    pub max: Position,
}

impl TryFrom<BoxFields> for BoxRegion {
    type Error = String;

    fn try_from(fields: BoxFields) -> Result<Self, Self::Error> {
        let (min, max) = (fields.min.0, fields.max.0);
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            if min[axis] >= max[axis] {
                return Err(format!(
                    "min {name} = {} is not below max {name} = {}; a box needs min below max on every axis",
                    min[axis], max[axis]
                ));
            }
        }
        Ok(Self(fields))
    }
}

/// `Sphere(center: (0, 1, 0), radius: 0.5)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Its middle.
    pub center: Position,
    /// Its radius in metres.
    pub radius: Length,
}

/// How the amount of a medium varies in space.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub enum Density {
    /// The same everywhere in the region.
    Constant(Factor),
    /// Falls off exponentially with height.
    Height(Height),
    /// From a volume file.
    Grid(Grid),
}

impl Default for Density {
    fn default() -> Self {
        Self::Constant(Factor::default())
    }
}

impl Density {
    /// The same density placed in the world; `grid` does so for one that needs another file.
    ///
    /// # Errors
    /// Those of `grid`.
    pub fn placed<E>(
        &self,
        grid: impl FnOnce(&Grid) -> Result<tyndall_media::Density, E>,
    ) -> Result<tyndall_media::Density, E> {
        match self {
            Self::Constant(density) => Ok(tyndall_media::Density::Constant(density.get())),
            Self::Height(height) => Ok(tyndall_media::Density::Height {
                base: height.base.get(),
                scale_height: height.scale_height.get(),
            }),
            Self::Grid(written) => grid(written),
        }
    }
}

/// `Height(base: 0.0, scale_height: 2.0)`: exp(−(y − base) / `scale_height`), clamped to 1 below `base`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Height {
    /// Height at and below which the density is 1, in metres.
    #[serde(default)]
    pub base: Coordinate,
    /// Climb over which the density falls to 1/e, in metres.
    #[serde(default = "two_metres")]
    pub scale_height: Length,
}

fn two_metres() -> Length {
    Length::TWO_METRES
}

/// `Grid(file: "smoke.vdb", grid: "density", scale: 1.0, transform: [16 numbers, column-major])`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Volume file, relative to the scene file.
    pub file: String,
    /// Name of the grid; left out: the file's only one, or `density`.
    #[serde(default)]
    pub grid: Option<String>,
    /// Multiplies the grid's values.
    #[serde(default)]
    pub scale: Factor,
    /// Where the grid is placed, after the file's own transform; left out: where the file says.
    #[serde(default)]
    pub transform: Option<Transform>,
}

/// A matrix of finite numbers that maps positions to positions and can be undone.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<Coordinate>")]
pub struct Transform(pub Mat4);

impl TryFrom<Vec<Coordinate>> for Transform {
    type Error = String;

    fn try_from(numbers: Vec<Coordinate>) -> Result<Self, Self::Error> {
        let columns: [f32; 16] = numbers
            .iter()
            .map(|number| number.get())
            .collect::<Vec<_>>()
            .try_into()
            .map_err(|_| {
                format!(
                    "{} numbers do not make a transform; it has exactly 16, column by column",
                    numbers.len()
                )
            })?;
        let matrix = Mat4::from_cols_array(&columns);
        // f64: a grid of millimetre voxels has a determinant of 1e-9, whose f32 products may vanish.
        let determinant = matrix.as_dmat4().determinant();
        if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
            Err(format!(
                "the last row of the transform is {}; it must be (0, 0, 0, 1), and numbers run column by column",
                matrix.row(3)
            ))
        } else if determinant == 0.0 {
            Err("the transform flattens space (its determinant is 0); it must be invertible".into())
        } else {
            Ok(Self(matrix))
        }
    }
}

/// Into which directions a medium scatters.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub enum PhaseFunction {
    /// Equally into all.
    #[default]
    Isotropic,
    /// Mostly forward or mostly backward.
    HenyeyGreenstein(HenyeyGreenstein),
    /// As by particles much smaller than the wavelength.
    Rayleigh,
    /// Several at once.
    Mixture(Mixture),
}

impl PhaseFunction {
    /// The same phase function as light transport knows it; what keeps it from being one is the error.
    pub fn placed(&self) -> Result<tyndall_media::PhaseFunction, String> {
        match self {
            Self::Isotropic => Ok(tyndall_media::PhaseFunction::Isotropic),
            Self::HenyeyGreenstein(lobe) => {
                tyndall_media::PhaseFunction::henyey_greenstein(lobe.g.get())
                    .map_err(|error| error.to_string())
            }
            Self::Rayleigh => Ok(tyndall_media::PhaseFunction::Rayleigh),
            Self::Mixture(mixture) => mix(&mixture.0),
        }
    }
}

/// `HenyeyGreenstein(g: 0.7)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HenyeyGreenstein {
    /// Mean cosine.
    #[serde(default = "forward")]
    pub g: Asymmetry,
}

fn forward() -> Asymmetry {
    Asymmetry::FORWARD
}

/// `Mixture([(0.8, HenyeyGreenstein(g: 0.8)), (0.2, Isotropic)])`, with weights that add up to 1 and no more different parts
/// than [`tyndall_media::phase::MAX_LOBES`].
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<(Fraction, PhaseFunction)>")]
pub struct Mixture(pub Vec<(Fraction, PhaseFunction)>);

/// How far the weights of a mixture may add up beside 1: three decimals written by hand, as in 0.333 three times.
const WEIGHT_ROUNDING: f32 = 2e-3;

impl TryFrom<Vec<(Fraction, PhaseFunction)>> for Mixture {
    type Error = String;

    fn try_from(parts: Vec<(Fraction, PhaseFunction)>) -> Result<Self, Self::Error> {
        let sum: f32 = parts.iter().map(|(weight, _)| weight.get()).sum();
        if parts.is_empty() {
            Err("an empty mixture; it needs parts with weights that add up to 1".into())
        } else if (sum - 1.0).abs() <= WEIGHT_ROUNDING {
            mix(&parts).map(|_| Self(parts))
        } else {
            Err(format!(
                "the weights of the mixture add up to {sum}; they must add up to 1"
            ))
        }
    }
}

fn mix(parts: &[(Fraction, PhaseFunction)]) -> Result<tyndall_media::PhaseFunction, String> {
    let parts: Vec<_> = parts
        .iter()
        .map(|(weight, phase)| Ok((weight.get(), phase.placed()?)))
        .collect::<Result<_, String>>()?;
    tyndall_media::PhaseFunction::mixture(&parts).map_err(|error| error.to_string())
}
