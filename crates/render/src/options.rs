//! What a render is asked to do, and whom it tells how far it is.
//!
//! The command line fills [`RenderOptions`]; a program that uses this crate starts from [`RenderOptions::default`].

use crate::error::RenderError;
use crate::layers::LayerSet;
use serde::{Deserialize, Serialize};
use std::str::FromStr;
use std::time::Duration;
use tyndall_scene::Scene;

/// How light is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Volumetric radiance caching.
    #[default]
    Cache,
    /// Unbiased volumetric path tracing.
    Path,
}

impl Integrator {
    /// All integrators, the default first.
    pub const ALL: &[Self] = &[Self::Cache, Self::Path];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cache => "cache",
            Self::Path => "path",
        }
    }

    /// What it is, in one line.
    pub fn about(self) -> &'static str {
        match self {
            Self::Cache => "radiance caching: multiple scattering from interpolated records",
            Self::Path => "unbiased volumetric path tracing, the ground truth",
        }
    }
}

/// Where camera rays find multiple scattering.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MultipleFrom {
    /// The coarse field itself where it is good enough, else records.
    #[default]
    Auto,
    /// Records.
    Records,
    /// The coarse field itself, however good it is.
    Field,
}

/// Where camera rays find single scattering of light from skies; that of all other light is always computed where it is needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SingleFrom {
    /// Records where there is enough of that light to be worth them.
    #[default]
    Auto,
    /// Samples of the lights.
    Direct,
    /// Records.
    Cache,
}

/// What kind of records radiance caching uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
pub enum Method {
    /// This project's: gather rays end in a coarse field, gradients and radii know of what stands around, single scattering is sampled.
    #[default]
    Tyndall,
    /// The algorithm as published by Jarosz, Donner, Zwicker and Jensen in 2008: a baseline to compare with.
    Jarosz08,
}

impl Method {
    /// As the command line spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tyndall => "tyndall",
            Self::Jarosz08 => "jarosz08",
        }
    }
}

/// How often light may scatter, in media or at surfaces, between light and eye.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// As often as it likes.
    #[default]
    Unlimited,
    /// At most so often; 0 shows emission alone, 1 adds direct light and single scattering.
    Limit(u32),
}

impl FromStr for Depth {
    type Err = RenderError;

    fn from_str(text: &str) -> Result<Self, RenderError> {
        if text == "none" {
            return Ok(Self::Unlimited);
        }
        text.parse()
            .map(Self::Limit)
            .map_err(|_| RenderError::Option {
                option: "--max-depth",
                found: format!("`{text}`"),
                allowed: "a whole number from 0, or none".to_owned(),
            })
    }
}

/// A part of the frame, in pixels; row 0 is the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Crop {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Number of columns, at least 1.
    pub width: u32,
    /// Number of rows, at least 1.
    pub height: u32,
}

impl Crop {
    /// The whole of a frame.
    pub fn whole(frame: [u32; 2]) -> Self {
        let [width, height] = frame;
        Self {
            x: 0,
            y: 0,
            width,
            height,
        }
    }

    /// The place of a pixel, column and row, among those of the crop in reading order.
    pub fn index(&self, [x, y]: [u32; 2]) -> Option<usize> {
        let (x, y) = (x.checked_sub(self.x)?, y.checked_sub(self.y)?);
        let is_inside = x < self.width && y < self.height;
        is_inside.then_some(y as usize * self.width as usize + x as usize)
    }

    /// This crop, if it lies within the frame.
    pub fn within(self, frame: [u32; 2]) -> Result<Self, RenderError> {
        let fits = |first: u32, n: u32, size: u32| {
            n > 0 && first.checked_add(n).is_some_and(|end| end <= size)
        };
        if fits(self.x, self.width, frame[0]) && fits(self.y, self.height, frame[1]) {
            return Ok(self);
        }
        Err(RenderError::Option {
            option: "--crop",
            found: format!("{},{},{},{}", self.x, self.y, self.width, self.height),
            allowed: format!(
                "X,Y,W,H with W, H > 0 inside the frame of {} × {} pixels",
                frame[0], frame[1]
            ),
        })
    }
}

impl FromStr for Crop {
    type Err = RenderError;

    /// Reads `X,Y,W,H`.
    fn from_str(text: &str) -> Result<Self, RenderError> {
        let numbers: Result<Vec<u32>, _> =
            text.split(',').map(|part| part.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, width, height]) => Ok(Self {
                x,
                y,
                width,
                height,
            }),
            _ => Err(RenderError::Option {
                option: "--crop",
                found: format!("`{text}`"),
                allowed: "four whole numbers X,Y,W,H in pixels".to_owned(),
            }),
        }
    }
}

/// What a render is asked to do; `None` leaves the choice to the scene file or the renderer.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// How light is computed.
    pub integrator: Integrator,
    /// Where camera rays find multiple scattering; records where there is no field, as where depth is limited.
    pub multiple: MultipleFrom,
    /// Where camera rays find single scattering of light from skies; samples where records hold none (see the README's limits).
    pub single: SingleFrom,
    /// What kind of records to use; only with [`Integrator::Cache`].
    pub method: Option<Method>,
    /// Target error of the image, the square root of its relMSE.
    pub error: Option<f32>,
    /// Samples per pixel, instead of a target error.
    pub spp: Option<u32>,
    /// Width of the frame in pixels; see [`RenderOptions::frame`].
    pub width: Option<u32>,
    /// Height of the frame in pixels; see [`RenderOptions::frame`].
    pub height: Option<u32>,
    /// The part of the frame to render.
    pub crop: Option<Crop>,
    /// How often light may scatter.
    pub max_depth: Option<Depth>,
    /// Chooses the random numbers; equal seeds give equal images.
    pub seed: u64,
    /// Number of threads; all processors where none is given. The image does not depend on it.
    pub threads: Option<usize>,
    /// When to stop early with the best image so far, counted from the call.
    pub time_limit: Option<Duration>,
    /// The layers to make.
    pub layers: Option<LayerSet>,
}

impl RenderOptions {
    /// The largest side of a frame, in pixels.
    pub const MAX_SIZE: u32 = 65_536;

    /// Checks every value that can be wrong by itself.
    pub fn check(&self) -> Result<(), RenderError> {
        let range = |option, ok: bool, found: String, allowed: &str| {
            let allowed = allowed.to_owned();
            if ok {
                Ok(())
            } else {
                Err(RenderError::Option {
                    option,
                    found,
                    allowed,
                })
            }
        };
        if let Some(error) = self.error {
            range(
                "--error",
                error > 0.0 && error.is_finite(),
                error.to_string(),
                "a finite number above 0, such as 0.03",
            )?;
        }
        range(
            "--method",
            self.method.is_none() || self.integrator == Integrator::Cache,
            "given".to_owned(),
            "left out with --integrator path, which has no records",
        )?;
        let is_ours = self.integrator == Integrator::Cache
            && self.method.unwrap_or_default() == Method::Tyndall;
        for (option, is_auto) in [
            ("--multiple", self.multiple == MultipleFrom::Auto),
            ("--single", self.single == SingleFrom::Auto),
        ] {
            range(
                option,
                is_auto || is_ours,
                "given".to_owned(),
                "left out with --integrator path and --method jarosz08, which leave no choice",
            )?;
        }
        if let Some(spp) = self.spp {
            range("--spp", spp > 0, spp.to_string(), "at least 1")?;
        }
        if let Some(threads) = self.threads {
            range(
                "--threads",
                (1..=4096).contains(&threads),
                threads.to_string(),
                "from 1 to 4096",
            )?;
        }
        for (option, size) in [("--width", self.width), ("--height", self.height)] {
            if let Some(n) = size {
                range(
                    option,
                    (1..=Self::MAX_SIZE).contains(&n),
                    n.to_string(),
                    "from 1 to 65536 pixels",
                )?;
            }
        }
        Ok(())
    }

    /// The layers of the image, where nobody chooses those that show what there is in the scene.
    pub(crate) fn layers_of(&self, scene: &Scene) -> LayerSet {
        let usual = || LayerSet::usual(scene.media.emits());
        self.layers.clone().unwrap_or_else(usual)
    }

    /// The size of the frame in pixels, where the scene itself asks for `scene`; one side given alone keeps the scene's proportions.
    pub fn frame(&self, scene: [u32; 2]) -> [u32; 2] {
        let scaled = |n: u32, from: u32, to: u32| {
            let size = (f64::from(n) * f64::from(to) / f64::from(from.max(1))).round();
            size.clamp(1.0, f64::from(Self::MAX_SIZE)) as u32
        };
        let [width, height] = scene;
        match (self.width, self.height) {
            (Some(w), Some(h)) => [w, h],
            (Some(w), None) => [w, scaled(w, width, height)],
            (None, Some(h)) => [scaled(h, height, width), h],
            (None, None) => scene,
        }
    }
}

/// The parts of a render, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Computing cache records.
    Fill,
    /// Computing pixels.
    Render,
    /// Measuring the error of the finished image.
    Estimate,
}

impl Phase {
    /// A word for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fill => "filling the cache",
            Self::Render => "rendering",
            Self::Estimate => "estimating the error",
        }
    }
}

/// Hears how far a render is, and may end it. Called from many threads, often: it must be quick.
pub trait Progress: Sync {
    /// The render is in `phase`, of which `fraction` (0 to 1) is done, and holds `records` cache records.
    fn update(&self, phase: Phase, fraction: f32, records: usize);

    /// Whether the render is to end with what there is, as when its time is up. Once true, it stays so.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Silence.
impl Progress for () {
    fn update(&self, _phase: Phase, _fraction: f32, _records: usize) {}
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn a_crop_is_four_whole_numbers_inside_the_frame() {
        let crop: Crop = "8, 0,56,48".parse().unwrap();
        assert_eq!(
            crop,
            Crop {
                x: 8,
                y: 0,
                width: 56,
                height: 48
            }
        );
        assert!(crop.within([64, 48]).is_ok());
        assert!(crop.within([63, 48]).is_err());
        for bad in ["", "1,2,3", "1,2,3,4,5", "-1,0,2,2", "a,b,c,d", "1.5,0,2,2"] {
            assert!(bad.parse::<Crop>().is_err(), "{bad}");
        }
        for outside in ["0,0,0,1", "0,0,1,0", "64,0,1,1", "4294967295,0,1,1"] {
            let message = outside
                .parse::<Crop>()
                .unwrap()
                .within([64, 48])
                .unwrap_err()
                .to_string();
            assert!(message.contains("64 × 48"), "{message}");
        }
    }

    #[test]
    fn a_depth_is_a_number_or_none() {
        assert_eq!("none".parse::<Depth>().unwrap(), Depth::Unlimited);
        assert_eq!("0".parse::<Depth>().unwrap(), Depth::Limit(0));
        assert!("-1".parse::<Depth>().is_err() && "None".parse::<Depth>().is_err());
    }

    #[test]
    fn one_side_given_alone_keeps_the_proportions() {
        let options = |width, height| RenderOptions {
            width,
            height,
            ..RenderOptions::default()
        };
        assert_eq!(options(None, None).frame([1024, 768]), [1024, 768]);
        assert_eq!(options(Some(256), None).frame([1024, 768]), [256, 192]);
        assert_eq!(options(None, Some(96)).frame([1024, 768]), [128, 96]);
        assert_eq!(options(Some(10), Some(20)).frame([1024, 768]), [10, 20]);
        assert_eq!(options(Some(1), None).frame([1024, 2]), [1, 1]);
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let bad = [
            RenderOptions {
                error: Some(0.0),
                ..RenderOptions::default()
            },
            RenderOptions {
                error: Some(f32::NAN),
                ..RenderOptions::default()
            },
            RenderOptions {
                spp: Some(0),
                ..RenderOptions::default()
            },
            RenderOptions {
                integrator: Integrator::Path,
                method: Some(Method::Jarosz08),
                ..RenderOptions::default()
            },
            RenderOptions {
                threads: Some(0),
                ..RenderOptions::default()
            },
            RenderOptions {
                width: Some(0),
                ..RenderOptions::default()
            },
            RenderOptions {
                height: Some(u32::MAX),
                ..RenderOptions::default()
            },
        ];
        for (options, name) in bad.iter().zip([
            "--error",
            "--error",
            "--spp",
            "--method",
            "--threads",
            "--width",
            "--height",
        ]) {
            let message = options.check().unwrap_err().to_string();
            assert!(message.starts_with(name), "{message}");
        }
        assert!(RenderOptions::default().check().is_ok());
    }
}
