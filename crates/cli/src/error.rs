//! What ends the command, and with which exit status.

use crate::signals::Signal;
use tyndall_render::error::RenderError;
use tyndall_render::probe::ProbeError;
use tyndall_scene::volume_file::VolumeFileError;
use tyndall_scene::{FrameError, SceneError};

/// Why the command could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// A scene could not be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A volume file could not be looked into.
    #[error(transparent)]
    Volume(#[from] VolumeFileError),
    /// A render, a comparison or an image file failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A camera has no view at a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A probe was asked what has no answer.
    #[error(transparent)]
    Probe(#[from] ProbeError),
    /// Exact benchmarks that this build on this machine does not meet.
    #[error(
        "{failed} of {rows} exact benchmarks failed, which by chance happens once in hundreds of runs; please report it with the table above and the machine"
    )]
    Verify {
        /// Rows that failed.
        failed: usize,
        /// All rows.
        rows: usize,
    },
    /// An output that would replace a file of the scene or another output.
    #[error(
        "the output would replace a file that the scene is read from, or another output of this command; choose another name: {}", path.display()
    )]
    Overwrites {
        /// The output.
        path: std::path::PathBuf,
    },
    /// Frames that would all go to one file.
    #[error(
        "{path} would hold every frame in turn: put #### into its name, where the frame's number is to stand, as in out.####.exr", path = path.display()
    )]
    OneFileForFrames {
        /// The output.
        path: std::path::PathBuf,
    },
    /// Records for frames whose densities differ.
    #[error(
        "--cache-in, --cache-out and --resume keep the records of one density, and the volume files of this scene are a sequence with one for each \
         frame; leave them out, or ask for one frame, as in --frames 7..8"
    )]
    CacheOfSequence,
    /// `tyndall info` was given a file of a kind it does not know.
    #[error(
        "cannot tell what {path} is: its name must end in .ron, .glb or .gltf (scenes), in .vdb or .vol (volumes), or in .exr, .png, .hdr or .jpg (images), unless it is a cache file"
    )]
    UnknownKind {
        /// The file.
        path: String,
    },
    /// A signal ended the command, which has said what it leaves.
    #[error("interrupted by {}", .0.name())]
    Interrupted(Signal),
    /// Standard output is closed or full.
    #[error("cannot write to standard output: {0}")]
    Output(std::io::Error),
    /// A bug of ours.
    #[error("internal error, please report it with the command and the scene: {0}")]
    Internal(String),
}

impl CliError {
    /// 2 where the command or an input file is wrong, 1 for anything else.
    pub(crate) fn status(&self) -> u8 {
        match self {
            Self::Scene(_)
            | Self::Frame(_)
            | Self::Volume(_)
            | Self::Probe(_)
            | Self::OneFileForFrames { .. }
            | Self::CacheOfSequence
            | Self::UnknownKind { .. }
            | Self::Overwrites { .. } => 2,
            Self::Interrupted(signal) => signal.status(),
            Self::Render(error) if error.is_input() => 2,
            Self::Render(_) | Self::Verify { .. } | Self::Output(_) | Self::Internal(_) => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_input_is_2_and_everything_else_is_1() {
        let layer = RenderError::UnknownLayer {
            name: "x".to_owned(),
        };
        let write = RenderError::Write {
            path: "x.exr".into(),
            reason: "disk full".to_owned(),
        };
        assert_eq!(CliError::from(layer).status(), 2);
        assert_eq!(CliError::from(write).status(), 1);
        assert_eq!(CliError::Internal(String::new()).status(), 1);
        assert_eq!(
            CliError::UnknownKind {
                path: "x".to_owned()
            }
            .status(),
            2
        );
    }
}
