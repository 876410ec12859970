//! Numbers about a render, as `--stats` writes them.
//!
//! The field names are part of the outward contract; times are in seconds.

use crate::error::RenderError;
use crate::image_file::replace_file;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// What a render cost and how good its image is believed to be.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Stats {
    /// The whole of it, loading included, s.
    pub wall_s: f64,
    /// Reading the scene and building its search trees, s.
    pub load_s: f64,
    /// Computing cache records, s.
    pub fill_s: f64,
    /// Computing pixels, s.
    pub render_s: f64,
    /// Measuring the finished image's error, s.
    pub estimate_s: f64,
    /// Number of cache records of each kind.
    pub records: BTreeMap<String, u64>,
    /// Questions put to the cache.
    pub lookups: u64,
    /// Questions that no valid record could answer.
    pub lookups_missed: u64,
    /// Rays traced, shadow rays included.
    pub rays: u64,
    /// Mean number of samples per pixel.
    pub spp: f64,
    /// The most memory held at one time, MiB; null where the system does not tell.
    pub peak_rss_mib: Option<f64>,
    /// Number of threads used.
    pub threads: usize,
    /// What each part of the work is believed to add to the image's error, in squares: the noise of samples, and by layer what was
    /// computed ahead of them.
    pub error_shares: BTreeMap<&'static str, f64>,
    /// The image's error; null where it was not measured.
    pub estimated_error: Option<ErrorEstimate>,
}

/// The error of an image, measured on pixels evaluated afresh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorEstimate {
    /// Square root of the relative mean squared error.
    pub value: f64,
    /// Its 95 % confidence interval.
    pub ci95: [f64; 2],
    /// Mean difference over mean value.
    pub bias: f64,
    /// The bias' 95 % confidence interval.
    pub bias_ci95: [f64; 2],
    /// Number of pixels evaluated.
    pub samples: u64,
}

impl Stats {
    /// Writes the numbers as JSON; the file appears whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), RenderError> {
        replace_file(path, |file| {
            serde_json::to_writer_pretty(&mut *file, self).map_err(|e| e.to_string())?;
            file.write_all(b"\n").map_err(|e| e.to_string())
        })
    }
}

/// The most memory this process has held so far, MiB, on systems with `/proc`.
pub fn peak_rss_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn the_json_holds_the_fields_of_the_contract() {
        let stats = Stats {
            estimated_error: Some(ErrorEstimate {
                value: 0.03,
                ci95: [0.028, 0.032],
                bias: -0.001,
                bias_ci95: [-0.004, 0.002],
                samples: 512,
            }),
            records: BTreeMap::from([("multiple".to_owned(), 3120)]),
            ..Stats::default()
        };
        let json: serde_json::Value = serde_json::to_value(&stats).unwrap();
        for field in [
            "wall_s",
            "load_s",
            "fill_s",
            "render_s",
            "estimate_s",
            "records",
            "lookups",
            "lookups_missed",
            "rays",
            "spp",
            "peak_rss_mib",
            "threads",
            "estimated_error",
        ] {
            assert!(json.get(field).is_some(), "{field}");
        }
        assert_eq!(json["records"]["multiple"], 3120);
        assert_eq!(json["estimated_error"]["ci95"][1], 0.032);
    }

    #[test]
    fn peak_memory_is_positive_where_the_system_tells_it() {
        if Path::new("/proc/self/status").exists() {
            assert!(peak_rss_mib().unwrap() > 0.5);
        }
    }
}
