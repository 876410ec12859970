//! Buffers compressed by Blosc 1: blocks, each of one or several streams, shuffled by bytes.

use crate::volume_file::error::VolumeError;
use flate2::{Decompress, FlushDecompress, Status};

const HEADER: usize = 16;

/// Bits of the header's flags.
const SHUFFLED: u8 = 0x01;
const PLAIN: u8 = 0x02;
const BIT_SHUFFLED: u8 = 0x04;
const NOT_SPLIT: u8 = 0x10;

/// A block is split into one stream for each byte of an element where elements are at most so large,
const MAX_SPLITS: usize = 16;
/// and where it holds at least so many of them.
const MIN_ELEMENTS: usize = 128;

/// Fills `out` with the contents of `buffer`.
pub(super) fn decompress(buffer: &[u8], out: &mut [u8]) -> Result<(), VolumeError> {
    let header = Header::parse(buffer).ok_or(Broken("its header is cut off or has no sense"))?;
    if header.length != out.len() {
        return Err(broken(format!(
            "it holds {} bytes instead of {}",
            header.length,
            out.len()
        )));
    }
    if header.flags & BIT_SHUFFLED != 0 {
        return Err(unsupported("bit shuffling"));
    }
    if header.flags & PLAIN != 0 {
        let plain = buffer.get(HEADER..HEADER + out.len());
        out.copy_from_slice(plain.ok_or(Broken("it is cut off"))?);
        return Ok(());
    }
    let mut shuffled = Vec::new();
    for (i, block) in out.chunks_mut(header.block).enumerate() {
        let start = word(buffer, HEADER + 4 * i).ok_or(Broken("its list of blocks is cut off"))?;
        let mut streams = buffer
            .get(start..)
            .ok_or(Broken("a block lies behind its end"))?;
        let whole = block.len() == header.block;
        let split = whole
            && header.flags & NOT_SPLIT == 0
            && header.element <= MAX_SPLITS
            && header.block / header.element >= MIN_ELEMENTS;
        let n = if split { header.element } else { 1 };
        let target = if header.flags & SHUFFLED != 0 && header.element > 1 {
            shuffled.clear();
            shuffled.resize(block.len(), 0);
            shuffled.as_mut_slice()
        } else {
            &mut *block
        };
        if !target.len().is_multiple_of(n) {
            return Err(broken("a block cannot be split evenly".into()));
        }
        for part in target.chunks_mut(target.len() / n) {
            let length = word(streams, 0).ok_or(Broken("a stream is cut off"))?;
            let stream = streams
                .get(4..)
                .and_then(|rest| rest.get(..length))
                .ok_or(Broken("a stream is cut off"))?;
            if length == part.len() {
                part.copy_from_slice(stream);
            } else {
                header.codec.decompress(stream, part)?;
            }
            streams = streams.get(4 + length..).unwrap_or_default();
        }
        if header.flags & SHUFFLED != 0 && header.element > 1 {
            unshuffle(&shuffled, block, header.element);
        }
    }
    Ok(())
}

/// Fills `out` with what a zlib stream holds.
pub(super) fn inflate(stream: &[u8], out: &mut [u8]) -> Result<(), VolumeError> {
    let mut state = Decompress::new(true);
    match state.decompress(stream, out, FlushDecompress::Finish) {
        Ok(Status::StreamEnd) if state.total_out() == out.len() as u64 => Ok(()),
        _ => Err(VolumeError::Malformed {
            problem: format!("a zlib stream does not hold {} bytes", out.len()),
            at: 0,
        }),
    }
}

#[derive(Clone, Copy, Debug)]
enum Codec {
    Lz4,
    Zlib,
    Other(u8),
}

impl Codec {
    fn decompress(self, stream: &[u8], out: &mut [u8]) -> Result<(), VolumeError> {
        match self {
            Self::Lz4 => match lz4_flex::block::decompress_into(stream, out) {
                Ok(length) if length == out.len() => Ok(()),
                _ => Err(broken(format!(
                    "an LZ4 stream does not hold {} bytes",
                    out.len()
                ))),
            },
            Self::Zlib => inflate(stream, out),
            Self::Other(code) => Err(unsupported(match code {
                0 => "BloscLZ",
                2 => "Snappy",
                4 => "Zstandard",
                _ => "an unknown codec",
            })),
        }
    }
}

struct Header {
    flags: u8,
    codec: Codec,
    /// Bytes of an element, at least 1.
    element: usize,
    /// Bytes that the buffer holds.
    length: usize,
    /// Bytes of a block, at least 1.
    block: usize,
}

impl Header {
    fn parse(buffer: &[u8]) -> Option<Self> {
        let [_, _, flags, element, ..] = *buffer.get(..HEADER)? else {
            return None;
        };
        Some(Self {
            flags,
            codec: match flags >> 5 {
                1 => Codec::Lz4,
                3 => Codec::Zlib,
                code => Codec::Other(code),
            },
            element: usize::from(element).max(1),
            length: word(buffer, 4)?,
            block: word(buffer, 8).filter(|&block| block > 0)?,
        })
    }
}

/// The unsigned number of 32 bits at `at`.
fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..)?.get(..4)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?) as usize)
}

/// Puts the bytes of elements together again: all first bytes come first, then all second ones. Bytes behind the last whole element stay.
fn unshuffle(shuffled: &[u8], out: &mut [u8], element: usize) {
    let n = out.len() / element;
    let (elements, rest) = out.split_at_mut(n * element);
    for (j, plane) in shuffled.chunks(n.max(1)).take(element).enumerate() {
        for (out, byte) in elements.iter_mut().skip(j).step_by(element).zip(plane) {
            *out = *byte;
        }
    }
    rest.copy_from_slice(&shuffled[n * element..]);
}

/// A fault that needs no number.
struct Broken(&'static str);

impl From<Broken> for VolumeError {
    fn from(Broken(problem): Broken) -> Self {
        broken(problem.into())
    }
}

fn broken(problem: String) -> VolumeError {
    VolumeError::Malformed {
        problem: format!("a Blosc buffer cannot be read: {problem}"),
        at: 0,
    }
}

fn unsupported(what: &str) -> VolumeError {
    VolumeError::Unsupported {
        what: format!("the voxels are compressed by Blosc with {what}"),
        mend: "Blosc is read with LZ4 and zlib, as OpenVDB writes it".into(),
    }
}
