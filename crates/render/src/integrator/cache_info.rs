//! What a cache file holds, as numbers for `tyndall info`.

use super::fill::Filled;
use super::kept;
use crate::error::RenderError;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use tyndall_cache::Record;

/// What a cache file holds.
#[derive(Clone, Debug, Serialize)]
pub struct CacheInfo {
    /// The error that images made with it were to have.
    pub error: f32,
    /// Most scattering events between light and eye; null for no limit.
    pub max_depth: Option<u32>,
    /// What kind of records there are.
    pub method: &'static str,
    /// Views that have all the records they need.
    pub views: usize,
    /// Whether multiple scattering is read from the coarse field.
    pub reads_field: bool,
    /// Cells of the coarse field in which paths end; 0 without one.
    pub field_cells: usize,
    /// The records, by kind.
    pub records: BTreeMap<&'static str, RecordsInfo>,
    /// Size of the file, MiB.
    pub mib: f64,
}

/// Records of one kind.
#[derive(Clone, Debug, Serialize)]
pub struct RecordsInfo {
    /// How many.
    pub count: usize,
    /// Smallest, median and largest radius, m; null where there are none.
    pub radius_m: Option<[f32; 3]>,
    /// Median of the noise over the value; null where all is black.
    pub relative_noise: Option<f32>,
    /// What they add to the error of images, relative; null where it is not known.
    pub error: Option<f64>,
}

impl CacheInfo {
    /// Whether a file begins as cache files do.
    pub fn is_cache(path: &Path) -> bool {
        kept::is_cache(path)
    }

    /// Reads a cache file.
    ///
    /// # Errors
    /// A file that cannot be read, is damaged or of another version.
    pub fn of(path: &Path) -> Result<Self, RenderError> {
        let (contents, bytes) = kept::read(path)?;
        let prepared = &contents.prepared;
        let shares: BTreeMap<&str, f64> = prepared.known_shares().collect();
        let mut records = BTreeMap::new();
        let mut add = |kind: &'static str, info: Option<RecordsInfo>| {
            records.extend(info.map(|info| {
                let error = shares.get(kind).copied();
                (kind, RecordsInfo { error, ..info })
            }));
        };
        let single = prepared.single.as_ref().or(prepared.sky.as_ref());
        add("multiple", prepared.multiple.as_ref().map(of_records));
        add("single", single.map(of_records));
        add("surface", prepared.surface.as_ref().map(of_records));
        Ok(Self {
            error: contents.error,
            max_depth: contents.max_depth,
            method: contents.method.name(),
            views: prepared.views.len(),
            reads_field: prepared.reads_field,
            field_cells: prepared.field.as_ref().map_or(0, |f| f.field.len()),
            records,
            mib: bytes as f64 / f64::from(1 << 20),
        })
    }
}

fn of_records<T: Clone>(filled: &Filled<T>) -> RecordsInfo {
    let records = filled.cache.records();
    let mut radii: Vec<f32> = records.iter().map(|r| r.radius).collect();
    radii.sort_unstable_by(f32::total_cmp);
    let mut noise: Vec<f32> = records.iter().filter_map(relative_noise).collect();
    noise.sort_unstable_by(f32::total_cmp);
    let radius_m = match radii.as_slice() {
        [] => None,
        all => Some([all[0], all[all.len() / 2], all[all.len() - 1]]),
    };
    RecordsInfo {
        count: records.len(),
        radius_m,
        relative_noise: noise.get(noise.len() / 2).copied(),
        error: None,
    }
}

/// The standard error of a record's value over the value, channels added; `None` where that is black.
fn relative_noise(record: &Record<3>) -> Option<f32> {
    let value: f32 = record.value.iter().sum();
    let noise: f32 = record.variance.iter().map(|v| v.sqrt()).sum();
    (value > 0.0).then_some(noise / value)
}
