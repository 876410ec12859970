//! Bytes of a file whose lengths are not believed: whatever is read is first compared with what is left.

use super::error::VolumeError;
use std::io::{Read, Seek, SeekFrom};

/// Longest name or word in a volume file, in bytes.
const MAX_STRING: u32 = 1 << 16;

/// Little-endian numbers from a file.
#[derive(Debug)]
pub(super) struct Source<R> {
    inner: R,
    position: u64,
    length: u64,
}

impl<R: Read + Seek> Source<R> {
    pub(super) fn new(mut inner: R) -> Result<Self, VolumeError> {
        let length = inner.seek(SeekFrom::End(0))?;
        inner.seek(SeekFrom::Start(0))?;
        Ok(Self {
            inner,
            position: 0,
            length,
        })
    }

    pub(super) fn position(&self) -> u64 {
        self.position
    }

    pub(super) fn left(&self) -> u64 {
        self.length - self.position
    }

    /// Goes on at `position`, which is that of `what`.
    pub(super) fn seek(&mut self, position: i64, what: &'static str) -> Result<(), VolumeError> {
        match u64::try_from(position) {
            Ok(position) if position <= self.length => {
                self.position = position;
                self.inner.seek(SeekFrom::Start(position))?;
                Ok(())
            }
            _ => Err(self.malformed(format!(
                "{what} is said to begin at byte {position} of {}",
                self.length
            ))),
        }
    }

    /// Refuses to go on unless `needed` bytes for `what` are left.
    pub(super) fn need(&self, needed: u64, what: &'static str) -> Result<(), VolumeError> {
        if needed <= self.left() {
            return Ok(());
        }
        Err(VolumeError::Truncated {
            what,
            at: self.position,
            needed,
            left: self.left(),
        })
    }

    pub(super) fn fill(&mut self, bytes: &mut [u8], what: &'static str) -> Result<(), VolumeError> {
        self.need(bytes.len() as u64, what)?;
        self.inner.read_exact(bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Puts the next `length` bytes into `bytes`, in place of what is there.
    pub(super) fn take(
        &mut self,
        length: u64,
        bytes: &mut Vec<u8>,
        what: &'static str,
    ) -> Result<(), VolumeError> {
        self.need(length, what)?;
        bytes.clear();
        bytes.resize(length as usize, 0);
        self.fill(bytes, what)
    }

    pub(super) fn skip(&mut self, length: u64, what: &'static str) -> Result<(), VolumeError> {
        self.need(length, what)?;
        self.seek((self.position + length) as i64, what)
    }

    pub(super) fn array<const N: usize>(
        &mut self,
        what: &'static str,
    ) -> Result<[u8; N], VolumeError> {
        let mut bytes = [0; N];
        self.fill(&mut bytes, what)?;
        Ok(bytes)
    }

    pub(super) fn u8(&mut self, what: &'static str) -> Result<u8, VolumeError> {
        Ok(self.array::<1>(what)?[0])
    }

    pub(super) fn u32(&mut self, what: &'static str) -> Result<u32, VolumeError> {
        Ok(u32::from_le_bytes(self.array(what)?))
    }

    pub(super) fn i32(&mut self, what: &'static str) -> Result<i32, VolumeError> {
        Ok(i32::from_le_bytes(self.array(what)?))
    }

    pub(super) fn i64(&mut self, what: &'static str) -> Result<i64, VolumeError> {
        Ok(i64::from_le_bytes(self.array(what)?))
    }

    pub(super) fn f32(&mut self, what: &'static str) -> Result<f32, VolumeError> {
        Ok(f32::from_le_bytes(self.array(what)?))
    }

    pub(super) fn f64(&mut self, what: &'static str) -> Result<f64, VolumeError> {
        Ok(f64::from_le_bytes(self.array(what)?))
    }

    /// A string with its length before it; what is not UTF-8 is replaced.
    pub(super) fn string(&mut self, what: &'static str) -> Result<String, VolumeError> {
        let length = self.u32(what)?;
        self.need(length.into(), what)?;
        if length > MAX_STRING {
            return Err(self.malformed(format!("{what} is {length} bytes long")));
        }
        let mut bytes = Vec::new();
        self.take(length.into(), &mut bytes, what)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    pub(super) fn malformed(&self, problem: String) -> VolumeError {
        VolumeError::Malformed {
            problem,
            at: self.position,
        }
    }
}
