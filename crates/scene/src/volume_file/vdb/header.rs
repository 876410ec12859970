//! The header of a file and the descriptors of its grids.

use super::MAGIC;
use super::metadata;
use crate::volume_file::error::VolumeError;
use crate::volume_file::source::Source;
use std::collections::HashMap;
use std::io::{Read, Seek};

/// Versions of the format that are read.
const VERSIONS: std::ops::RangeInclusive<u32> = 222..=224;

/// What separates a name from the number that tells grids of one name apart.
const NUMBER: char = '\u{1e}';

/// Ends the type of grids whose floats are stored in 16 bits.
const HALF: &str = "_HalfFloat";

/// The one type of tree that is read.
const FLOAT_TREE: &str = "Tree_float_5_4_3";

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) grids: Vec<Descriptor>,
}

/// Where a grid lies and what it is.
#[derive(Clone, Debug)]
pub(super) struct Descriptor {
    /// Its name, as the user would write it.
    pub(super) name: String,
    /// Its type without the ending for 16 bits.
    kind: String,
    /// Whether its floats are stored in 16 bits.
    pub(super) half: bool,
    /// The grid whose voxels it shares; empty for those with voxels of their own.
    instance_of: String,
    /// Where its compression and metadata begin.
    pub(super) position: i64,
}

impl Descriptor {
    /// The type of its values, for people.
    pub(super) fn value_type(&self) -> String {
        let kind = self.kind.strip_prefix("Tree_").unwrap_or(&self.kind);
        let kind = kind.strip_suffix("_5_4_3").unwrap_or(kind);
        if self.half {
            format!("{kind} stored as half")
        } else {
            kind.into()
        }
    }

    /// Refuses all but trees of floats with voxels of their own.
    pub(super) fn check_readable(&self) -> Result<(), VolumeError> {
        let name = &self.name;
        if !self.instance_of.is_empty() {
            return Err(VolumeError::Unsupported {
                what: format!("grid \"{name}\" is an instance of \"{}\"", self.instance_of),
                mend: "name that grid, or save the file without instances".into(),
            });
        }
        if self.kind == FLOAT_TREE {
            return Ok(());
        }
        let what = match self.value_type().as_str() {
            kind if kind.contains("ptdataidx") || kind.contains("ptidx") => {
                format!("grid \"{name}\" holds points, not densities")
            }
            kind if kind.contains("vec") => format!("grid \"{name}\" holds vectors ({kind})"),
            kind => format!("grid \"{name}\" holds values of type {kind}"),
        };
        Err(VolumeError::Unsupported {
            what,
            mend: "a density is a grid of floats (32-bit, or 32-bit stored as half)".into(),
        })
    }
}

pub(super) fn read<R: Read + Seek>(source: &mut Source<R>) -> Result<Header, VolumeError> {
    if source.array("the first bytes")? != MAGIC {
        return Err(VolumeError::UnknownKind(
            "the file does not begin as an OpenVDB file does".into(),
        ));
    }
    let version = source.u32("the version")?;
    if !VERSIONS.contains(&version) {
        return Err(VolumeError::Unsupported {
            what: format!("the file has version {version} of the OpenVDB format"),
            mend: format!(
                "versions {} to {} are read; save it again with a current program",
                VERSIONS.start(),
                VERSIONS.end()
            ),
        });
    }
    // Of the library that wrote the file.
    source.skip(8, "the library's version")?;
    let has_offsets = source.u8("the header")? != 0;
    source.skip(36, "the file's identifier")?;
    metadata::read(source)?;
    let count = source.i32("the number of grids")?;
    if !has_offsets {
        return Err(VolumeError::Unsupported {
            what: "the file was written as a stream, without the places of its grids".into(),
            mend: "save it as a file".into(),
        });
    }
    // Two names, a type and three places, all empty.
    const SMALLEST: u64 = 3 * 4 + 3 * 8;
    let count = u64::try_from(count)
        .map_err(|_| source.malformed(format!("the file is said to hold {count} grids")))?;
    source.need(count.saturating_mul(SMALLEST), "the list of grids")?;
    let mut grids = Vec::new();
    for _ in 0..count {
        grids.push(descriptor(source)?);
    }
    number(&mut grids);
    Ok(Header { grids })
}

/// Reads a descriptor and goes on at the next.
fn descriptor<R: Read + Seek>(source: &mut Source<R>) -> Result<Descriptor, VolumeError> {
    let name = source.string("the name of a grid")?;
    let kind = source.string("the type of a grid")?;
    let instance_of = source.string("the original of a grid")?;
    let position = source.i64("the place of a grid")?;
    let voxels = source.i64("the place of a grid's voxels")?;
    let end = source.i64("the end of a grid")?;
    let here = source.position() as i64;
    if position < here || voxels < position || end < voxels {
        return Err(source.malformed(format!(
            "a grid is said to lie from byte {position} over {voxels} to {end}, and its descriptor ends at {here}"
        )));
    }
    source.seek(end, "the next grid")?;
    let (kind, half) = match kind.strip_suffix(HALF) {
        Some(kind) => (kind.to_owned(), true),
        None => (kind, false),
    };
    Ok(Descriptor {
        name,
        kind,
        half,
        instance_of,
        position,
    })
}

/// Replaces the numbers behind names: `density[0]` and `density[1]` where there are two, plain `density` where there is one.
fn number(grids: &mut [Descriptor]) {
    let plain = |name: &str| name.split(NUMBER).next().unwrap_or_default().to_owned();
    let mut counts: HashMap<String, usize> = HashMap::new();
    for grid in grids.iter() {
        *counts.entry(plain(&grid.name)).or_default() += 1;
    }
    let mut seen: HashMap<String, usize> = HashMap::new();
    for grid in grids {
        let name = plain(&grid.name);
        let index = seen.entry(name.clone()).or_default();
        grid.name = if counts.get(&name) > Some(&1) {
            format!("{name}[{index}]")
        } else {
            name
        };
        *index += 1;
    }
}
