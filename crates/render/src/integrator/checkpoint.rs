//! Checkpoints: what there is of a render, kept now and then, so that it can go on where something ended it.
//!
//! A file holds what was computed ahead of the image and the sums of the samples taken so far. It names the scene, the options and the
//! cameras it belongs to: going on with others would give an image of neither.

use super::prepare::Prepared;
use super::stages::State;
use super::view::View;
use super::{Renderer, Run};
use crate::error::{CheckpointFault, RenderError};
use crate::image_file::replace_file_through;
use crate::sealed::Format;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tyndall_scene::Camera;

const FORMAT: Format = Format {
    magic: *b"TYNDALLr",
    version: 2,
};
/// Time between checkpoints over what it takes to write one, at least.
const SPARSE: u32 = 20;

/// What a checkpoint holds.
#[derive(Deserialize, Serialize)]
struct Contents<B, P, S> {
    belongs_to: B,
    prepared: P,
    /// The frame under way.
    number: u32,
    /// Where its sampling stands; `None` where it has not begun.
    state: Option<S>,
}

/// What a render that goes on must have in common with the one that was ended.
#[derive(Deserialize, Serialize)]
struct Identity {
    scene: u128,
    /// Names and values of all that shapes pixels.
    options: Vec<(String, String)>,
    /// Of all frames, in order.
    views: Vec<View>,
}

/// Keeps what there is of a render.
pub(super) struct Keeper {
    path: PathBuf,
    every: Duration,
    identity: Identity,
    /// When it was kept last, and how long writing took.
    last: Instant,
    took: Duration,
    /// Why it could not be kept.
    fault: Option<RenderError>,
    /// Whether there is a file that holds the render as far as it goes.
    is_kept: bool,
}

/// Keeps what there is of one frame.
pub(super) struct OfFrame<'k> {
    pub(super) keeper: Option<&'k mut Keeper>,
    pub(super) prepared: &'k Prepared,
    pub(super) number: u32,
}

impl OfFrame<'_> {
    /// Writes a checkpoint where it is time for one, or `at_once`.
    pub(super) fn keep(&mut self, state: Option<&State>, at_once: bool) {
        // Filling that was ended would go on in another way than filling that was not.
        let keeper = self
            .keeper
            .as_mut()
            .filter(|_| !self.prepared.is_cut_short());
        if let Some(keeper) = keeper.filter(|keeper| at_once || keeper.is_due()) {
            keeper.write(self.prepared, self.number, state);
        }
    }
}

impl Keeper {
    fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every.max(SPARSE * self.took)
    }

    fn write(&mut self, prepared: &Prepared, number: u32, state: Option<&State>) {
        let begun = Instant::now();
        let bytes = FORMAT.seal(&Contents {
            belongs_to: &self.identity,
            prepared,
            number,
            state,
        });
        let written = replace_file_through(&beside(&self.path), &self.path, |file| {
            let bytes = bytes?;
            file.write_all(&bytes).map_err(|error| error.to_string())
        });
        self.is_kept |= written.is_ok();
        self.fault = written.err();
        self.last = Instant::now();
        self.took = begun.elapsed();
    }
}

/// Where a checkpoint is written before it takes the place of the last one: always there, so that what a killed process leaves does not
/// pile up.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

impl Renderer<'_> {
    /// From now on what there is of the frames that `cameras` see goes to a file, `every` so often and when the render is cancelled. The
    /// file appears whole or not at all, and stays until [`Renderer::remove_checkpoint`]. Filling that is not done is not kept.
    ///
    /// # Errors
    /// A scene whose files cannot be read again.
    pub fn keep_checkpoints(
        &mut self,
        path: &Path,
        every: Duration,
        cameras: &[Camera],
    ) -> Result<(), RenderError> {
        self.keeper = Some(Keeper {
            path: path.to_owned(),
            every,
            identity: self.run.identity(cameras)?,
            last: Instant::now(),
            took: Duration::ZERO,
            fault: None,
            is_kept: false,
        });
        Ok(())
    }

    /// Goes on from the checkpoint that an earlier render left where this one keeps its own; tells the frame that was under way, whose
    /// image then has the pixels that it would have had without a break. `None` where there is no checkpoint, or none are kept.
    ///
    /// # Errors
    /// A checkpoint that cannot be read, is damaged, or belongs to another scene or version, or to other options or cameras.
    pub fn resume(&mut self) -> Result<Option<u32>, RenderError> {
        let Some(keeper) = self.keeper.as_mut().filter(|keeper| keeper.path.exists()) else {
            return Ok(None);
        };
        let wrong = |fault| RenderError::Checkpoint {
            path: keeper.path.clone(),
            fault,
        };
        let (contents, _) = FORMAT
            .read::<Contents<Identity, Prepared, State>>(&keeper.path)
            .map_err(|fault| wrong(fault.into()))?;
        (keeper.identity.is_met_by(&contents.belongs_to)).map_err(wrong)?;
        keeper.is_kept = true;
        self.begun = contents.belongs_to.views;
        self.prepared = contents.prepared;
        self.resumed = contents.state.map(|state| (contents.number, state));
        Ok(Some(contents.number))
    }

    /// Keeps that all frames before one are done, as where the render ends between two of them.
    pub fn keep_checkpoint_before(&mut self, number: u32) {
        let mut of_frame = OfFrame {
            keeper: self.keeper.as_mut(),
            prepared: &self.prepared,
            number,
        };
        of_frame.keep(None, true);
    }

    /// What to tell the user where the last checkpoint could not be written; once.
    pub(super) fn checkpoint_fault(&mut self) -> Option<String> {
        let fault = self.keeper.as_mut()?.fault.take()?;
        Some(format!("no checkpoint can be kept: {fault}"))
    }

    /// Whether there is a checkpoint of this render.
    pub fn has_checkpoint(&self) -> bool {
        self.keeper.as_ref().is_some_and(|keeper| keeper.is_kept)
    }

    /// Removes the checkpoint, as when all images are written.
    ///
    /// # Errors
    /// Where the system does not let it.
    pub fn remove_checkpoint(&mut self) -> Result<(), RenderError> {
        let Some(keeper) = &mut self.keeper else {
            return Ok(());
        };
        // What a process left that was killed while it wrote; nobody needs it, whether it can be removed or not.
        let _ = std::fs::remove_file(beside(&keeper.path));
        keeper.is_kept = false;
        match std::fs::remove_file(&keeper.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(RenderError::Checkpoint {
                    path: keeper.path.clone(),
                    fault: CheckpointFault::Stays {
                        reason: error.to_string(),
                    },
                })
            }
            _ => Ok(()),
        }
    }
}

impl Identity {
    /// Whether a checkpoint of `other` belongs to this render; the first difference where not.
    fn is_met_by(&self, other: &Self) -> Result<(), CheckpointFault> {
        let mut pairs = self.options.iter().zip(&other.options);
        if let Some(((name, wanted), (_, found))) = pairs.find(|(a, b)| a != b) {
            return Err(CheckpointFault::OtherOption {
                name: name.clone(),
                found: found.clone(),
                wanted: wanted.clone(),
            });
        }
        if self.scene != other.scene {
            return Err(CheckpointFault::OtherScene);
        }
        if self.views != other.views {
            return Err(CheckpointFault::OtherCameras);
        }
        Ok(())
    }
}

impl Run<'_> {
    fn identity(&self, cameras: &[Camera]) -> Result<Identity, RenderError> {
        let options = self.options;
        let [width, height] = self.frame;
        let crop = self.crop;
        let layers = options.layers.clone().map(String::from);
        let or_none = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
        let pairs = [
            ("program version", env!("CARGO_PKG_VERSION").to_owned()),
            ("--integrator", options.integrator.name().to_owned()),
            (
                "--method",
                options.method.unwrap_or_default().name().to_owned(),
            ),
            (
                "--multiple",
                format!("{:?}", options.multiple).to_lowercase(),
            ),
            ("--single", format!("{:?}", options.single).to_lowercase()),
            ("--error", self.error.to_string()),
            ("--spp", or_none(options.spp.map(|n| n.to_string()))),
            ("frame", format!("{width} × {height}")),
            (
                "--crop",
                format!("{},{},{},{}", crop.x, crop.y, crop.width, crop.height),
            ),
            (
                "--max-depth",
                or_none(self.max_depth.map(|n| n.to_string())),
            ),
            ("--seed", options.seed.to_string()),
            ("--layers", or_none(layers)),
        ];
        let pairs = pairs.into_iter();
        Ok(Identity {
            scene: self.digest()?,
            options: pairs
                .map(|(name, value)| (name.to_owned(), value))
                .collect(),
            views: (cameras.iter())
                .map(|&camera| View::new(camera, self.frame))
                .collect(),
        })
    }
}
