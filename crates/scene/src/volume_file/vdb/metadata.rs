//! Names with values, of a file or a grid. Only the few that the reader asks for are understood.

use crate::volume_file::error::VolumeError;
use crate::volume_file::source::Source;
use std::collections::HashMap;
use std::io::{Read, Seek};

/// Longest value that is kept, in bytes; longer ones (thumbnails, tables for delayed loading) are passed over.
const MAX_KEPT: u64 = 4096;

#[derive(Clone, Debug, Default)]
pub(super) struct Metadata {
    /// Type and bytes by name.
    values: HashMap<String, (String, Vec<u8>)>,
}

impl Metadata {
    fn bytes(&self, name: &str, kind: &str) -> Option<&[u8]> {
        let (found, bytes) = self.values.get(name)?;
        (found == kind).then_some(bytes)
    }

    pub(super) fn text(&self, name: &str) -> Option<&str> {
        std::str::from_utf8(self.bytes(name, "string")?).ok()
    }

    pub(super) fn flag(&self, name: &str) -> bool {
        self.bytes(name, "bool")
            .is_some_and(|bytes| bytes.iter().any(|&byte| byte != 0))
    }

    pub(super) fn long(&self, name: &str) -> Option<i64> {
        let bytes = self.bytes(name, "int64")?;
        Some(i64::from_le_bytes(bytes.try_into().ok()?))
    }
}

pub(super) fn read<R: Read + Seek>(source: &mut Source<R>) -> Result<Metadata, VolumeError> {
    let count = source.u32("the number of metadata")?;
    // Name, type and value, each with its length.
    source.need(u64::from(count) * 12, "metadata")?;
    let mut metadata = Metadata::default();
    for _ in 0..count {
        let name = source.string("the name of a metadatum")?;
        let kind = source.string("the type of a metadatum")?;
        let length = source.u32("the length of a metadatum")?.into();
        if length > MAX_KEPT {
            source.skip(length, "a metadatum")?;
            continue;
        }
        let mut bytes = Vec::new();
        source.take(length, &mut bytes, "a metadatum")?;
        metadata.values.insert(name, (kind, bytes));
    }
    Ok(metadata)
}
