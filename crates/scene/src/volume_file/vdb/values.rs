//! The values of a node: compressed by a codec, by leaving out inactive ones, or both.

use super::blosc;
use crate::volume_file::error::VolumeError;
use crate::volume_file::half::half_to_f32;
use crate::volume_file::source::Source;
use std::io::{Read, Seek};

const WHAT: &str = "the values of a node";

/// How the values of a grid are compressed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compression {
    codec: Codec,
    /// Whether inactive values are left out.
    active_only: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Codec {
    None,
    Zip,
    Blosc,
}

impl Compression {
    pub(super) fn from_flags(flags: u32) -> Result<Self, VolumeError> {
        let codec = match flags & !2 {
            0 => Codec::None,
            1 => Codec::Zip,
            4 => Codec::Blosc,
            _ => {
                return Err(VolumeError::Unsupported {
                    what: format!("a grid is compressed in an unknown way (flags {flags:#x})"),
                    mend: "none, ZIP and Blosc are read".into(),
                });
            }
        };
        Ok(Self {
            codec,
            active_only: flags & 2 != 0,
        })
    }
}

/// How the values of a grid are stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Format {
    pub(super) compression: Compression,
    /// Whether floats take 16 bits.
    pub(super) half: bool,
    /// The value of voxels that no node holds.
    pub(super) background: f32,
}

/// One bit for each place in a node.
#[derive(Clone, Debug)]
pub(super) struct Mask(Vec<u8>);

impl Mask {
    /// Reads a mask of `n` bits, a multiple of 8.
    pub(super) fn read<R: Read + Seek>(
        source: &mut Source<R>,
        n: usize,
    ) -> Result<Self, VolumeError> {
        let mut bytes = Vec::new();
        source.take(n as u64 / 8, &mut bytes, "the mask of a node")?;
        Ok(Self(bytes))
    }

    /// Whether the bit is set; those that the mask does not have are not.
    #[inline]
    pub(super) fn is_on(&self, i: usize) -> bool {
        self.0
            .get(i >> 3)
            .is_some_and(|byte| byte >> (i & 7) & 1 == 1)
    }

    pub(super) fn count(&self) -> usize {
        self.0.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    /// The places whose bits are set, in order.
    pub(super) fn on(&self) -> impl Iterator<Item = usize> {
        let bytes = self.0.iter().enumerate().filter(|(_, byte)| **byte != 0);
        bytes.flat_map(|(i, &byte)| {
            (0..8)
                .filter(move |bit| byte >> bit & 1 == 1)
                .map(move |bit| 8 * i + bit)
        })
    }
}

/// Reads nodes' values, with buffers that are used again.
#[derive(Debug)]
pub(super) struct Values {
    format: Format,
    packed: Vec<u8>,
    plain: Vec<u8>,
    /// Those of the last node read.
    list: Vec<f32>,
}

impl Values {
    pub(super) fn new(format: Format) -> Self {
        Self {
            format,
            packed: Vec::new(),
            plain: Vec::new(),
            list: Vec::new(),
        }
    }

    /// Reads the `n` values of a node, of which those with their bit in `active` are active. Inactive ones may be anything.
    ///
    /// A byte says which inactive values there are: 0 the background, 1 its negative, 2 another one; 3 background and its negative, 4
    /// background and another, 5 two others, told apart by a mask; 6 more than two. Up to 5 they are left out where the compression
    /// says so. Inactive voxels count as background here, so which they are matters only for finding the active ones.
    pub(super) fn read<R: Read + Seek>(
        &mut self,
        source: &mut Source<R>,
        n: usize,
        active: &Mask,
    ) -> Result<&[f32], VolumeError> {
        let kinds = source.u8(WHAT)?;
        let (values, mask) = match kinds {
            0 | 1 | 6 => (0, false),
            2 => (1, false),
            3 => (0, true),
            4 => (1, true),
            5 => (2, true),
            _ => {
                return Err(source.malformed(format!(
                    "the values of a node are of the unknown kind {kinds}; there are 0 to 6"
                )));
            }
        };
        source.skip(4 * values, WHAT)?;
        if mask {
            source.skip(n as u64 / 8, WHAT)?;
        }
        let left_out = self.format.compression.active_only && kinds != 6;
        let stored = if left_out { active.count() } else { n };
        self.chunk(source, stored)?;
        self.list.clear();
        let plain = self.plain.as_slice();
        let half = |b: &[u8; 2]| half_to_f32(u16::from_le_bytes(*b));
        let single = |b: &[u8; 4]| f32::from_le_bytes(*b);
        let value = |i: usize| {
            if self.format.half {
                plain.get(2 * i..).and_then(<[u8]>::first_chunk).map(half)
            } else {
                plain.get(4 * i..).and_then(<[u8]>::first_chunk).map(single)
            }
        };
        if left_out {
            self.list.resize(n, self.format.background);
            for (i, place) in active.on().take(stored).enumerate() {
                if let (Some(out), Some(value)) = (self.list.get_mut(place), value(i)) {
                    *out = value;
                }
            }
        } else {
            self.list.extend((0..n).map_while(value));
        }
        Ok(&self.list)
    }

    /// Reads `n` values into `plain`.
    fn chunk<R: Read + Seek>(
        &mut self,
        source: &mut Source<R>,
        n: usize,
    ) -> Result<(), VolumeError> {
        let length = n * if self.format.half { 2 } else { 4 };
        let codec = self.format.compression.codec;
        if codec == Codec::None {
            return source.take(length as u64, &mut self.plain, WHAT);
        }
        self.plain.clear();
        // Nothing is written for no halves; for no floats there is at least their length, 0.
        if n == 0 && self.format.half {
            return Ok(());
        }
        let packed = source.i64(WHAT)?;
        if packed <= 0 {
            // What compression would have made longer is stored as it is, with its length negative.
            if packed.unsigned_abs() != length as u64 {
                return Err(source.malformed(format!(
                    "a node has {} bytes of values instead of {length}",
                    packed.unsigned_abs()
                )));
            }
            return source.take(length as u64, &mut self.plain, WHAT);
        }
        source.take(packed.unsigned_abs(), &mut self.packed, WHAT)?;
        self.plain.resize(length, 0);
        let unpacked = match codec {
            Codec::Blosc => blosc::decompress(&self.packed, &mut self.plain),
            Codec::Zip | Codec::None => blosc::inflate(&self.packed, &mut self.plain),
        };
        unpacked.map_err(|error| match error {
            VolumeError::Malformed { problem, .. } => source.malformed(problem),
            other => other,
        })
    }
}
