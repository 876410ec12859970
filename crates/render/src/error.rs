//! What can go wrong between a scene and an image file.
//!
//! [`RenderError::is_input`] tells mistakes in the command or its files from failures of the machine, which is what exit statuses need.

use crate::layers::known_layers;
use crate::sealed::SealFault;
use std::path::PathBuf;
use tyndall_scene::{FilmSizeError, SceneError};

/// Errors of this crate; the text says what, where, what is allowed and what would mend it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A value of [`RenderOptions`](crate::options::RenderOptions) lies outside its range.
    #[error("{option} is {found}, but it must be {allowed}")]
    Option {
        /// The option as the command line spells it.
        option: &'static str,
        /// What was given.
        found: String,
        /// What may be given.
        allowed: String,
    },
    /// A frame larger than any image can be.
    #[error("{source}; choose another --width or --height")]
    Frame {
        /// What the sizes may be.
        #[from]
        source: FilmSizeError,
    },
    /// Not enough memory for the film.
    #[error("the film of {} × {} pixels needs {mib} MiB of memory, which the system does not give; render parts of the frame with --crop", size[0], size[1])]
    Memory {
        /// Width and height of the crop in pixels.
        size: [u32; 2],
        /// What the film needs.
        mib: usize,
    },
    /// A part of the contract that this version does not hold yet.
    #[error("{what} is not built yet in this version; {instead}")]
    NotBuilt {
        /// What was asked for.
        what: String,
        /// What can be done meanwhile.
        instead: String,
    },
    /// A layer name that is not in the table of layers.
    #[error("there is no image layer `{name}`; the layers are {}", known_layers())]
    UnknownLayer {
        /// The name given.
        name: String,
    },
    /// The threads could not be started.
    #[error("cannot start {threads} threads: {reason}; try fewer with --threads")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        reason: String,
    },
    /// An output name whose ending names no image format.
    #[error("cannot tell the image format of an output file: its name must end in .exr or .png: {}", path.display())]
    OutputEnding {
        /// The output file.
        path: PathBuf,
    },
    /// A place that cannot be written to, found before the render starts.
    #[error("cannot write the output there ({source}); choose a folder that exists and may be written to: {}", path.display())]
    OutputPlace {
        /// The output file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Writing a file failed.
    #[error("writing failed ({reason}); any file that stood there before is untouched: {}", path.display())]
    Write {
        /// The output file.
        path: PathBuf,
        /// What went wrong.
        reason: String,
    },
    /// A value that no image may hold.
    #[error(
        "the image holds {value} in channel `{channel}` at pixel ({x}, {y}) and was not written: this is a bug of the renderer, please report it with the scene"
    )]
    NotFinite {
        /// The channel's name in the file.
        channel: String,
        /// Column, counted from the left of the full frame.
        x: usize,
        /// Row, counted from the top of the full frame.
        y: usize,
        /// The value found.
        value: f32,
    },
    /// A file that could not be read as an image.
    #[error("cannot read an image ({reason}): {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        reason: String,
    },
    /// A cache file that cannot be used.
    #[error("{fault}: {}", path.display())]
    Cache {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: CacheFault,
    },
    /// A checkpoint that a render cannot go on from.
    #[error("{fault}: {}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: CheckpointFault,
    },
    /// A file of the scene that could be read when the scene was loaded, and no longer can.
    #[error(transparent)]
    Scene {
        /// What the scene says.
        source: Box<SceneError>,
    },
    /// An image without the layer that a comparison asks for.
    #[error("image {image} has no layer `{layer}`; its channels are {found}")]
    MissingLayer {
        /// Which image: A, B or B2.
        image: &'static str,
        /// The layer asked for.
        layer: String,
        /// The channels it has.
        found: String,
    },
    /// Images that cannot be compared pixel by pixel.
    #[error("image A has {} × {} pixels with {} channels and image {image} has {} × {} with {}; only images of one size can be compared", a[0], a[1], a[2], b[0], b[1], b[2])]
    Size {
        /// Which image differs from A: B or B2.
        image: &'static str,
        /// Width, height and number of channels of A.
        a: [usize; 3],
        /// Width, height and number of channels of the other.
        b: [usize; 3],
    },
}

/// Why a cache file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CacheFault {
    /// The system does not give it.
    #[error("cannot read the cache file ({reason})")]
    Unreadable {
        /// What the system said.
        reason: String,
    },
    /// Something else.
    #[error("this is not a cache file that `tyndall render --cache-out` wrote")]
    NotACache,
    /// Written by a program of another time.
    #[error(
        "the cache file has version {found}, and this program reads version {known}; make it anew with --cache-out"
    )]
    OtherVersion {
        /// The file's version.
        found: u64,
        /// The version that can be read.
        known: u32,
    },
    /// Its end is missing.
    #[error(
        "the cache file is cut short: {found} of {wanted} bytes are there; copy it again or make it anew with --cache-out"
    )]
    Truncated {
        /// Bytes of the file.
        found: u64,
        /// Bytes it should have.
        wanted: u64,
    },
    /// Its checksum is not that of its bytes.
    #[error(
        "the cache file is damaged: its checksum does not fit; copy it again or make it anew with --cache-out"
    )]
    Damaged,
    /// Whole, and yet not what this program writes.
    #[error("the cache file holds no cache ({reason}); make it anew with --cache-out")]
    Contents {
        /// What does not fit.
        reason: String,
    },
    /// Light of another scene.
    #[error(
        "the cache file was made for another scene: geometry, materials, lights or media differ; make it anew with --cache-out"
    )]
    OtherScene,
    /// Light that scatters more or less often.
    #[error(
        "the cache file was made with --max-depth {found}, and {wanted} is asked for now; make it anew with --cache-out"
    )]
    OtherDepth {
        /// The file's.
        found: String,
        /// The render's.
        wanted: String,
    },
    /// Records of another kind.
    #[error(
        "the cache file was made with --method {found}, and {wanted} is asked for now; make it anew with --cache-out"
    )]
    OtherMethod {
        /// The file's.
        found: &'static str,
        /// The render's.
        wanted: &'static str,
    },
}

impl From<SealFault> for CacheFault {
    fn from(fault: SealFault) -> Self {
        match fault {
            SealFault::Unreadable { reason } => Self::Unreadable { reason },
            SealFault::Foreign => Self::NotACache,
            SealFault::OtherVersion { found, known } => Self::OtherVersion { found, known },
            SealFault::Truncated { found, wanted } => Self::Truncated { found, wanted },
            SealFault::Damaged => Self::Damaged,
            SealFault::Contents { reason } => Self::Contents { reason },
        }
    }
}

/// Why a render cannot go on from a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointFault {
    /// Its contents cannot be had.
    #[error(
        "the checkpoint is of no use, {0}; without --resume the render starts from the beginning"
    )]
    File(#[from] SealFault),
    /// Other options shape other pixels.
    #[error(
        "the checkpoint was made with {name} {found}, and {wanted} is asked for now; give the same, or start from the beginning without --resume"
    )]
    OtherOption {
        /// As the command line spells it, where it is an option.
        name: String,
        /// The checkpoint's.
        found: String,
        /// The render's.
        wanted: String,
    },
    /// Samples of another scene.
    #[error(
        "the checkpoint was made for another scene: geometry, materials, lights or media differ; without --resume the render starts from the beginning"
    )]
    OtherScene,
    /// Samples of other views.
    #[error(
        "the checkpoint was made for other cameras or frames; without --resume the render starts from the beginning"
    )]
    OtherCameras,
    /// The images are done, and it cannot be removed.
    #[error("the checkpoint is no longer needed and cannot be removed ({reason})")]
    Stays {
        /// What the system said.
        reason: String,
    },
}

impl RenderError {
    /// Whether the command or an input file is at fault, and not the machine or the renderer.
    pub fn is_input(&self) -> bool {
        !matches!(
            self,
            Self::Threads { .. }
                | Self::Memory { .. }
                | Self::Write { .. }
                | Self::NotFinite { .. }
        )
    }
}
