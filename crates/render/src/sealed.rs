//! Files of this program's own: a short header, contents in [postcard](https://docs.rs/postcard)'s format, and a checksum over all of it.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use xxhash_rust::xxh3::xxh3_128;

const MAGIC: usize = 8;
/// Where the contents' length stands, after magic and version.
const LENGTH: usize = MAGIC + 4;
/// Bytes of all three.
const HEADER: usize = LENGTH + 8;
/// Bytes of the checksum.
const CHECKSUM: usize = 16;

/// A kind of such files.
pub(crate) struct Format {
    /// What its files begin with.
    pub(crate) magic: [u8; MAGIC],
    /// Counts changes of the contents' form and of their meaning.
    pub(crate) version: u32,
}

/// Why a file's contents cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SealFault {
    /// The system does not give it.
    #[error("it cannot be read: {reason}")]
    Unreadable {
        /// What the system said.
        reason: String,
    },
    /// Something else.
    #[error("it is something else")]
    Foreign,
    /// Written by a program of another time.
    #[error("it has version {found}, and this program reads version {known}")]
    OtherVersion {
        /// The file's version.
        found: u64,
        /// The version that can be read.
        known: u32,
    },
    /// Its end is missing.
    #[error("it is cut short: {found} of {wanted} bytes are there")]
    Truncated {
        /// Bytes of the file.
        found: u64,
        /// Bytes it should have.
        wanted: u64,
    },
    /// Its checksum is not that of its bytes.
    #[error("it is damaged: its checksum does not fit")]
    Damaged,
    /// Whole, and yet not what this program writes.
    #[error("its contents are not what this program writes: {reason}")]
    Contents {
        /// What does not fit.
        reason: String,
    },
}

impl Format {
    /// The bytes of a file.
    pub(crate) fn seal(&self, contents: &impl Serialize) -> Result<Vec<u8>, String> {
        let mut header = self.magic.to_vec();
        header.extend(self.version.to_le_bytes());
        header.extend([0; HEADER - LENGTH]);
        // Behind the header: contents may be large, and are not to stand in memory twice.
        let mut bytes = postcard::to_extend(contents, header).map_err(|error| error.to_string())?;
        let length = (bytes.len() - HEADER) as u64;
        bytes[LENGTH..HEADER].copy_from_slice(&length.to_le_bytes());
        bytes.extend(xxh3_128(&bytes).to_le_bytes());
        Ok(bytes)
    }

    /// Reads a file; tells its bytes, too.
    pub(crate) fn read<T: DeserializeOwned>(&self, path: &Path) -> Result<(T, usize), SealFault> {
        let unreadable = |reason: String| SealFault::Unreadable { reason };
        // A device or pipe may never end.
        let metadata = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?;
        if !metadata.is_file() {
            return Err(unreadable("it is no file".to_owned()));
        }
        let bytes = std::fs::read(path).map_err(|error| unreadable(error.to_string()))?;
        Ok((self.open(&bytes)?, bytes.len()))
    }

    /// Whether a file begins as those of this kind do.
    pub(crate) fn is_of(&self, path: &Path) -> bool {
        let mut magic = [0; MAGIC];
        if !path.is_file() {
            return false;
        }
        let read = File::open(path).and_then(|mut file| file.read_exact(&mut magic));
        read.is_ok() && magic == self.magic
    }

    /// The contents of a file of these bytes.
    fn open<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, SealFault> {
        let magic = &bytes[..bytes.len().min(MAGIC)];
        if bytes.is_empty() || !self.magic.starts_with(magic) {
            return Err(SealFault::Foreign);
        }
        let truncated = |wanted: u64| SealFault::Truncated {
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
        let (version, length) = (number(MAGIC, 4), number(LENGTH, 8));
        if version != u64::from(self.version) {
            return Err(SealFault::OtherVersion {
                found: version,
                known: self.version,
            });
        }
        let wanted = length.saturating_add((HEADER + CHECKSUM) as u64);
        if wanted > bytes.len() as u64 {
            return Err(truncated(wanted));
        }
        let (body, checksum) = rest.split_at(rest.len() - CHECKSUM);
        let is_sound = xxh3_128(&bytes[..bytes.len() - CHECKSUM]).to_le_bytes() == checksum;
        if wanted < bytes.len() as u64 || !is_sound {
            return Err(SealFault::Damaged);
        }
        postcard::from_bytes(body).map_err(|error| SealFault::Contents {
            reason: error.to_string(),
        })
    }
}
