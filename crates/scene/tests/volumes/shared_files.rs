//! Real files, where they are at hand: what is read of them is what OpenVDB 10.0.1 says they hold.

use std::path::Path;
use tyndall_scene::volume_file::{DEFAULT_MEMORY, VoxelSummary, inspect};

/// Grid, size, active voxels, and smallest, largest and mean value as printed by OpenVDB.
type Row = (
    &'static str,
    [u64; 3],
    u64,
    &'static str,
    &'static str,
    &'static str,
);

const SMOKE: Row = (
    "density",
    [111, 222, 112],
    1_049_275,
    "1.0014e-5",
    "5.714844",
    "0.16345",
);
const BUNNY: Row = ("density", [50, 63, 64], 53_970, "1", "1", "1");

const SOUND: &[(&str, Row)] = &[
    ("openvdb/smoke.vdb", SMOKE),
    ("openvdb_derived/smoke_f32_resaved.vdb", SMOKE),
    ("openvdb_derived/smoke_half_blosc.vdb", SMOKE),
    ("openvdb_derived/smoke_half_zip.vdb", SMOKE),
    (
        "openvdb_derived/smoke_vol_uniform.vdb",
        ("density", [104, 111, 50], 312_306, "", "1", ""),
    ),
    ("openvdb_derived/bunny64_uniform.vdb", BUNNY),
    ("openvdb_derived/bunny64_none.vdb", BUNNY),
    ("openvdb_derived/bunny64_zip.vdb", BUNNY),
    ("openvdb_derived/bunny64_nonuniform_scalemap.vdb", BUNNY),
    ("openvdb_derived/bunny64_rotated_affinemap.vdb", BUNNY),
    ("openvdb_derived/bunny64_density_temperature_vel.vdb", BUNNY),
    (
        "openvdb_derived/bunny64_density_temperature_vel.vdb",
        ("temperature", [50, 63, 64], 53_970, "1500", "1500", "1500"),
    ),
    (
        "openvdb_derived/box_active_tiles.vdb",
        ("density", [256, 128, 128], 4_194_304, "0.5", "0.5", "0.5"),
    ),
    (
        "openvdb_derived/background_quarter.vdb",
        ("density", [0; 3], 20, "", "", ""),
    ),
    (
        "openvdb_derived/duplicate_names.vdb",
        ("density[1]", [50, 63, 64], 53_970, "1", "1", "1"),
    ),
    (
        "mitsuba_vol/smoke.vol",
        ("density", [128, 128, 50], 312_306, "0", "1", "0.01156"),
    ),
    (
        "mitsuba_vol/albedo.vol",
        ("g", [80, 80, 40], 256_000, "0.9", "0.9", "0.9"),
    ),
    (
        "mitsuba_vol/colored_density.vol",
        ("b", [80, 80, 40], 0, "", "1.5", ""),
    ),
];

/// File, grid and a part of the message.
const REFUSED: &[(&str, &str, &str)] = &[
    ("openvdb/sphere.vdb", "ls_sphere", "is a level set"),
    ("openvdb/points.vdb", "points", "holds points"),
    (
        "openvdb_derived/bunny64_double.vdb",
        "density",
        "values of type double",
    ),
    (
        "openvdb_derived/bunny64_density_temperature_vel.vdb",
        "vel",
        "holds vectors (vec3s)",
    ),
];

/// Files of which nothing is read.
const UNKNOWN: &[(&str, &str)] = &[
    ("nanovdb/rocks.nvdb", "NanoVDB"),
    ("nanovdb/test_grid.nvdb", "NanoVDB"),
    ("ktx2/bunny.ktx2", "no volume file"),
];

/// Equal to all digits that are printed.
fn is_printed(value: f64, printed: &str) -> bool {
    let (digits, exponent) = printed.split_once('e').unwrap_or((printed, "0"));
    let unit = 10_f64.powi(exponent.parse().unwrap());
    let places = digits.split_once('.').map_or(0, |(_, places)| places.len());
    let half = 0.5 * unit * 10_f64.powi(-(places as i32));
    printed.is_empty() || (value - digits.parse::<f64>().unwrap() * unit).abs() <= half * 1.000_01
}

#[test]
fn shared_files_hold_what_openvdb_says() {
    let volumes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets/volumes");
    if !volumes.exists() {
        return;
    }
    let summaries = |file: &str| inspect(&volumes.join(file), DEFAULT_MEMORY).unwrap();
    for (file, (grid, size, active, min, max, mean)) in SOUND {
        let summaries = summaries(file);
        let summary = summaries.iter().find(|s| s.name == *grid).unwrap();
        let found: &VoxelSummary = summary.voxels.as_ref().unwrap();
        let what = format!("{file}: {found:?}");
        assert!(*active == 0 || found.active == *active, "{what}");
        assert!(*size == [0; 3] || found.size == *size, "{what}");
        assert!(is_printed(found.min.into(), min), "{what}");
        assert!(is_printed(found.max.into(), max), "{what}");
        assert!(is_printed(found.mean, mean), "{what}");
    }
    let background = summaries("openvdb_derived/background_quarter.vdb");
    assert_eq!(background[0].voxels.as_ref().unwrap().background, 0.25);
    // All three channels together.
    let coloured = summaries("mitsuba_vol/colored_density.vol");
    let channels: Vec<_> = coloured
        .iter()
        .map(|s| s.voxels.as_ref().unwrap())
        .collect();
    let least = channels.iter().map(|c| c.min).fold(0.0, f32::min);
    let mean = channels.iter().map(|c| c.mean).sum::<f64>() / 3.0;
    let negative: u64 = channels.iter().map(|c| c.negative).sum();
    assert!(
        is_printed(least.into(), "-0.004005") && is_printed(mean, "0.01696"),
        "{least} {mean}"
    );
    assert_eq!(negative, 4395);

    for (file, grid, says) in REFUSED {
        let summaries = summaries(file);
        let summary = summaries.iter().find(|s| s.name == *grid).unwrap();
        let message = summary.voxels.as_ref().unwrap_err().to_string();
        assert!(message.contains(says), "{file}: {message}");
    }
    for (file, says) in UNKNOWN {
        let message = inspect(&volumes.join(file), DEFAULT_MEMORY)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains(says) && message.contains(file),
            "{message}"
        );
    }
}
