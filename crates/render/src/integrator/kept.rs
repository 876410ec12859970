//! Cache files: what was computed ahead of an image, kept for further frames, further parts of a frame and further machines.
//!
//! A file is a short header, the contents in [postcard](https://docs.rs/postcard)'s format, and a checksum over all of it. It names the
//! scene it was computed for by a digest.

use super::Run;
use super::prepare::Prepared;
use crate::error::{CacheFault, RenderError};
use crate::image_file::replace_file;
use crate::options::{Integrator, Method, MultipleFrom, SingleFrom};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use xxhash_rust::xxh3::xxh3_128;

/// What a cache file begins with.
const MAGIC: [u8; 8] = *b"TYNDALLc";
/// Counts changes of the contents' form and of their meaning.
const VERSION: u32 = 1;
/// Bytes of magic, version and the contents' length.
const HEADER: usize = 20;
/// Bytes of the checksum.
const CHECKSUM: usize = 16;

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

    fn digest(&self) -> Result<u128, RenderError> {
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
        let body = postcard::to_allocvec(&contents).map_err(|error| failed(error.to_string()))?;
        let mut bytes = Vec::with_capacity(HEADER + body.len() + CHECKSUM);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(body);
        bytes.extend(xxh3_128(&bytes).to_le_bytes());
        replace_file(path, |file| {
            file.write_all(&bytes).map_err(|error| error.to_string())
        })
    }
}

/// Whether a file begins as cache files do.
pub(super) fn is_cache(path: &Path) -> bool {
    let mut magic = [0; MAGIC.len()];
    if !path.is_file() {
        return false;
    }
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut magic));
    read.is_ok() && magic == MAGIC
}

/// Reads a cache file, whatever scene it is for; tells its bytes, too.
pub(super) fn read(path: &Path) -> Result<(Contents<'static>, usize), RenderError> {
    let unreadable = |reason: String| RenderError::Cache {
        path: path.to_owned(),
        fault: CacheFault::Unreadable { reason },
    };
    // A device or pipe may never end.
    let metadata = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?;
    if !metadata.is_file() {
        return Err(unreadable("it is no file".to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|error| unreadable(error.to_string()))?;
    let contents = parse(&bytes).map_err(|fault| RenderError::Cache {
        path: path.to_owned(),
        fault,
    })?;
    Ok((contents, bytes.len()))
}

fn parse(bytes: &[u8]) -> Result<Contents<'static>, CacheFault> {
    let magic = &bytes[..bytes.len().min(MAGIC.len())];
    if bytes.is_empty() || !MAGIC.starts_with(magic) {
        return Err(CacheFault::NotACache);
    }
    let truncated = |wanted: u64| CacheFault::Truncated {
        found: bytes.len() as u64,
        wanted,
    };
    let Some((header, rest)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(truncated((HEADER + CHECKSUM) as u64));
    };
    let number = |at: usize, n: usize| {
        let bytes = header[at..at + n].iter().rev();
        bytes.fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte))
    };
    let (version, length) = (number(8, 4), number(12, 8));
    if version != u64::from(VERSION) {
        return Err(CacheFault::OtherVersion {
            found: version,
            known: VERSION,
        });
    }
    let wanted = length.saturating_add((HEADER + CHECKSUM) as u64);
    if wanted > bytes.len() as u64 {
        return Err(truncated(wanted));
    }
    let (body, checksum) = rest.split_at(rest.len() - CHECKSUM);
    let is_sound = xxh3_128(&bytes[..bytes.len() - CHECKSUM]).to_le_bytes() == checksum;
    if wanted < bytes.len() as u64 || !is_sound {
        return Err(CacheFault::Damaged);
    }
    postcard::from_bytes(body).map_err(|error| CacheFault::Contents {
        reason: error.to_string(),
    })
}
