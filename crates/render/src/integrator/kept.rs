//! Cache files: what was computed ahead of an image, kept for further frames, further parts of a frame and further machines.
//!
//! A file names the scene it was computed for by a digest.

use super::Run;
use super::prepare::Prepared;
use crate::error::{CacheFault, RenderError};
use crate::image_file::replace_file;
use crate::options::{Integrator, Method, MultipleFrom, SingleFrom};
use crate::sealed::Format;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

const FORMAT: Format = Format {
    magic: *b"TYNDALLc",
    version: 3,
};

/// What a cache file holds.
#[derive(Deserialize, Serialize)]
pub(super) struct Contents<'p> {
    scene: u128,
    pub(super) max_depth: Option<u32>,
    pub(super) method: Method,
    /// The error that the image was to have.
    pub(super) error: f32,
    pub(super) prepared: Cow<'p, Prepared>,
}

impl Run<'_> {
    /// The options that only records as made anew can follow.
    fn check_options(&self, option: &'static str) -> Result<(), RenderError> {
        let wrong = |allowed: &str| {
            Err(RenderError::Option {
                option,
                found: "given".to_owned(),
                allowed: allowed.to_owned(),
            })
        };
        if self.options.integrator == Integrator::Path {
            return wrong("left out with --integrator path, which has no records");
        }
        let is_free =
            self.options.multiple == MultipleFrom::Auto && self.options.single == SingleFrom::Auto;
        if option == "--cache-in" && !is_free {
            return wrong(
                "left out with --multiple and --single: the file says which records there are",
            );
        }
        Ok(())
    }

    pub(super) fn digest(&self) -> Result<u128, RenderError> {
        let digest = self.scene.digest();
        digest.map_err(|source| RenderError::Scene {
            source: Box::new(source),
        })
    }

    pub(super) fn read_cache(&self, path: &Path) -> Result<Prepared, RenderError> {
        self.check_options("--cache-in")?;
        let fault = |fault| RenderError::Cache {
            path: path.to_owned(),
            fault,
        };
        let (contents, _) = read(path)?;
        if contents.scene != self.digest()? {
            return Err(fault(CacheFault::OtherScene));
        }
        if contents.max_depth != self.max_depth {
            let name = |depth: Option<u32>| depth.map_or("none".to_owned(), |n| n.to_string());
            return Err(fault(CacheFault::OtherDepth {
                found: name(contents.max_depth),
                wanted: name(self.max_depth),
            }));
        }
        let method = self.options.method.unwrap_or_default();
        if contents.method != method {
            return Err(fault(CacheFault::OtherMethod {
                found: contents.method.name(),
                wanted: method.name(),
            }));
        }
        Ok(contents.prepared.into_owned())
    }

    pub(super) fn write_cache(&self, path: &Path, prepared: &Prepared) -> Result<(), RenderError> {
        self.check_options("--cache-out")?;
        let contents = Contents {
            scene: self.digest()?,
            max_depth: self.max_depth,
            method: self.options.method.unwrap_or_default(),
            error: prepared.error.unwrap_or(self.error),
            prepared: Cow::Borrowed(prepared),
        };
        let failed = |reason: String| RenderError::Write {
            path: path.to_owned(),
            reason,
        };
        let bytes = FORMAT.seal(&contents).map_err(failed)?;
        replace_file(path, |file| {
            file.write_all(&bytes).map_err(|error| error.to_string())
        })
    }
}

/// Whether a file begins as cache files do.
pub(super) fn is_cache(path: &Path) -> bool {
    FORMAT.is_of(path)
}

/// Reads a cache file, whatever scene it is for; tells its bytes, too.
pub(super) fn read(path: &Path) -> Result<(Contents<'static>, usize), RenderError> {
    FORMAT.read(path).map_err(|fault| RenderError::Cache {
        path: path.to_owned(),
        fault: fault.into(),
    })
}
