//! What the format lets one write, written here and read back.

use crate::vdb_writer::{Codec, Grid, file, header, scale_map};
use glam::{DVec3, IVec3};
use std::io::Cursor;
use tyndall_scene::volume_file::{Volume, VolumeError, inspect_from, read_from};

const LIMIT: u64 = 1 << 28;

fn read(bytes: Vec<u8>, wanted: Option<&str>) -> Result<Volume, VolumeError> {
    read_from(Cursor::new(bytes), wanted, LIMIT)
}

fn read_one(grid: Grid) -> Volume {
    read(file(&[grid]), None).unwrap()
}

/// A grid with voxels in five leaves, two of them full, on both sides of zero, and tiles of all sizes.
fn everything() -> Grid {
    let mut voxels = vec![
        (IVec3::new(-1, -8, 7), 0.5),
        (IVec3::new(-1, -8, 6), 2.0),
        (IVec3::new(4095, 3, 130), 1.25),
    ];
    for i in 0..512 {
        let offset = IVec3::new(i >> 6, i >> 3 & 7, i & 7);
        voxels.push((IVec3::new(16, 8, 0) + offset, 0.125 * (i % 37 + 1) as f32));
        voxels.push((IVec3::new(-512, 0, 64) + offset, 0.125 * (i % 5 + 1) as f32));
    }
    Grid {
        voxels,
        tiles: vec![
            (IVec3::new(24, 8, 0), 8, 3.0, true),
            (IVec3::new(32, 8, 0), 8, 4.0, false),
            (IVec3::new(128, 128, -128), 128, 0.25, true),
            (IVec3::new(256, 128, -128), 128, 0.5, false),
        ],
        root_tiles: vec![
            (IVec3::new(4096, 0, 0), 0.75, true),
            (IVec3::new(8192, 0, 0), 5.0, false),
        ],
        ..Grid::default()
    }
}

fn check_everything(volume: &Volume, background: f32, what: &str) {
    let voxels = &volume.built.voxels;
    let grid = everything();
    for (at, value) in grid.voxels {
        assert_eq!(voxels.value(at), value, "{at} {what}");
    }
    for (at, value) in [
        ([24, 8, 0], 3.0),
        ([31, 15, 7], 3.0),
        ([32, 8, 0], background),
        ([128, 128, -128], 0.25),
        ([255, 255, -1], 0.25),
        ([256, 128, -128], background),
        ([4096, 0, 0], 0.75),
        ([8191, 4095, 4095], 0.75),
        ([8192, 0, 0], background),
        ([-1, -8, 5], background),
        ([0, 0, 0], background),
        ([1 << 20, 0, 0], background),
    ] {
        assert_eq!(voxels.value(at.into()), value, "{at:?} {what}");
    }
    assert_eq!(volume.built.n_negative, 0);
}

#[test]
fn every_codec_width_and_kind_of_inactive_values_gives_the_same_voxels() {
    for codec in [Codec::None, Codec::Zip, Codec::Blosc] {
        for half in [false, true] {
            for active_only in [false, true] {
                for inactive in 0..=6 {
                    let what = format!("{codec:?} half {half} mask {active_only} kind {inactive}");
                    let grid = Grid {
                        codec,
                        half,
                        active_only,
                        inactive,
                        ..everything()
                    };
                    check_everything(&read_one(grid), 0.0, &what);
                }
            }
        }
    }
    let grid = Grid {
        background: 0.25,
        ..everything()
    };
    check_everything(&read_one(grid), 0.25, "background");
}

#[test]
fn every_linear_map_places_voxels() {
    let shifted = |scale| [vec![10.0, 20.0, 30.0], scale_map(scale)].concat();
    let turn = (0.6_f64, 0.8_f64);
    let matrix = |a: f64| {
        vec![
            a * turn.0,
            a * turn.1,
            0.0,
            0.0, //
            -turn.1,
            turn.0,
            0.0,
            0.0, //
            0.5,
            0.0,
            -1.0,
            0.0, //
            10.0,
            20.0,
            30.0,
            1.0,
        ]
    };
    // Where index (1, 2, 3) goes.
    for (map, expected) in [
        (("UniformScaleMap", scale_map([0.5; 3])), [0.5, 1.0, 1.5]),
        (("ScaleMap", scale_map([0.5, -1.0, 2.0])), [0.5, -2.0, 6.0]),
        (
            ("UniformScaleTranslateMap", shifted([0.5; 3])),
            [10.5, 21.0, 31.5],
        ),
        (
            ("ScaleTranslateMap", shifted([0.5, -1.0, 2.0])),
            [10.5, 18.0, 36.0],
        ),
        (
            ("TranslationMap", vec![10.0, 20.0, 30.0]),
            [11.0, 22.0, 33.0],
        ),
        (
            ("AffineMap", matrix(2.0)),
            [1.2 - 1.6 + 1.5 + 10.0, 1.6 + 1.2 + 20.0, 27.0],
        ),
        (
            ("UnitaryMap", matrix(1.0)),
            [0.6 - 1.6 + 1.5 + 10.0, 0.8 + 1.2 + 20.0, 27.0],
        ),
    ] {
        let what = map.0;
        let volume = read_one(Grid {
            map,
            ..everything()
        });
        let found = volume
            .world_from_index
            .transform_point3(DVec3::new(1.0, 2.0, 3.0));
        assert!(
            (found - DVec3::from(expected)).length() < 1e-12,
            "{what}: {found}"
        );
    }
}

#[test]
fn the_grid_meant_is_the_one_named_the_only_one_or_density() {
    let grid = |name, value| Grid {
        name,
        voxels: vec![(IVec3::ZERO, value)],
        ..Grid::default()
    };
    let value = |grids: &[Grid], wanted: Option<&str>| {
        read(file(grids), wanted)
            .map(|volume| volume.built.voxels.value(IVec3::ZERO))
            .map_err(|error| error.to_string())
    };
    let two = [grid("heat", 1.0), grid("density", 2.0)];
    assert_eq!(value(&two, None), Ok(2.0));
    assert_eq!(value(&two, Some("heat")), Ok(1.0));
    assert_eq!(value(&two[..1], None), Ok(1.0));
    let wrong = value(&two, Some("smoke")).unwrap_err();
    assert!(
        wrong.contains("\"smoke\"") && wrong.contains("\"heat\", \"density\""),
        "{wrong}"
    );
    let alike = [grid("density\u{1e}0", 1.0), grid("density\u{1e}1", 2.0)];
    assert_eq!(value(&alike, Some("density[1]")), Ok(2.0));
    let wrong = value(&alike, None).unwrap_err();
    assert!(wrong.contains("\"density[0]\", \"density[1]\""), "{wrong}");
    assert!(value(&[], None).unwrap_err().contains("holds none"));
}

#[test]
fn grids_tell_count_range_mean_and_size() {
    let grid = Grid {
        voxels: vec![(IVec3::new(-3, 5, 7), 1.0), (IVec3::new(4, 5, 9), 3.5)],
        tiles: vec![(IVec3::new(8, 8, 8), 8, 0.5, true)],
        root_tiles: Vec::new(),
        ..Grid::default()
    };
    let summaries = inspect_from(Cursor::new(file(&[grid, Grid::default()])), LIMIT).unwrap();
    let voxels = summaries[0].voxels.as_ref().unwrap();
    assert_eq!((voxels.active, voxels.min, voxels.max), (514, 0.5, 3.5));
    assert!((voxels.mean - 260.5 / 514.0).abs() < 1e-12);
    assert_eq!((voxels.first, voxels.size), ([-3, 5, 7], [19, 11, 9]));
    assert_eq!(summaries[0].class, "fog volume");
    // Nothing at all.
    assert!(matches!(
        summaries[1].voxels,
        Err(VolumeError::Empty { .. })
    ));
}

/// What the reader says of a file.
fn complaint(bytes: Vec<u8>) -> String {
    read(bytes, None).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn what_is_no_fog_volume_is_named() {
    let grid = everything;
    for (grid, says) in [
        (
            Grid {
                class: "level set",
                ..grid()
            },
            "is a level set",
        ),
        (
            Grid {
                kind: "Tree_vec3s_5_4_3",
                ..grid()
            },
            "holds vectors (vec3s)",
        ),
        (
            Grid {
                kind: "Tree_ptdataidx32_5_4_3",
                ..grid()
            },
            "holds points",
        ),
        (
            Grid {
                kind: "Tree_int32_5_4_3",
                ..grid()
            },
            "values of type int32",
        ),
        (
            Grid {
                kind: "Tree_bool_5_4_3",
                ..grid()
            },
            "values of type bool",
        ),
        (
            Grid {
                kind: "Tree_double_5_4_3",
                ..grid()
            },
            "values of type double",
        ),
        (
            Grid {
                instance_of: "smoke",
                ..grid()
            },
            "is an instance of \"smoke\"",
        ),
        (
            Grid {
                map: ("NonlinearFrustumMap", vec![]),
                ..grid()
            },
            "the frustum of a camera",
        ),
        (
            Grid {
                map: ("CurvedMap", vec![]),
                ..grid()
            },
            "of the kind \"CurvedMap\"",
        ),
        (
            Grid {
                count_off_by: Some(-1),
                ..grid()
            },
            "it is damaged",
        ),
        (
            Grid {
                inactive: 7,
                ..grid()
            },
            "unknown kind 7",
        ),
    ] {
        let found = complaint(file(std::slice::from_ref(&grid)));
        assert!(found.contains(says), "{found}");
    }
}

#[test]
fn files_of_other_kinds_and_versions_are_named() {
    for (bytes, says) in [
        (vec![], "the file is empty"),
        (b"OpenVDB".to_vec(), "no volume file"),
        (b"NanoVDB0 and more".to_vec(), "NanoVDB"),
        (header(225, true, 0), "version 225"),
        (header(221, true, 0), "version 221"),
        (header(224, false, 1), "as a stream"),
        (header(224, true, -1), "hold -1 grids"),
        (header(224, true, i32::MAX), "cut off"),
    ] {
        let found = complaint(bytes);
        assert!(found.contains(says), "{found}");
    }
}

#[test]
fn values_that_are_no_density_are_counted_and_placed() {
    let with = |value| Grid {
        voxels: vec![
            (IVec3::new(3, 4, 5), value),
            (IVec3::new(3, 4, 6), value),
            (IVec3::new(3, 4, 7), 1.0),
        ],
        ..Grid::default()
    };
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let found = complaint(file(&[with(value)]));
        let says = "grid \"density\": 2 non-finite voxels, the first at (3, 4, 5)";
        assert!(found.contains(says), "{found}");
    }
    let negative = read_one(with(-0.5));
    assert_eq!(negative.built.n_negative, 2);
    assert_eq!(negative.built.voxels.value(IVec3::new(3, 4, 5)), 0.0);
}

#[test]
fn trees_with_two_blocks_in_one_place_or_blocks_beside_the_lattice_are_refused() {
    let root = |at: [i32; 3]| (IVec3::from(at), 1.0, true);
    for tiles in [
        vec![root([0; 3]), root([0; 3])],
        vec![root([0, 8, 0])],
        vec![root([1 << 30, 0, 0])],
        vec![root([i32::MIN, 0, 0])],
    ] {
        let grid = Grid {
            root_tiles: tiles,
            ..Grid::default()
        };
        assert!(complaint(file(&[grid])).contains("the tree's root"));
    }
}

#[test]
fn sparse_voxels_take_little_more_memory_than_active_ones_hold() {
    // In each corner of 512³ voxels a cube of 32³ different ones.
    let mut voxels = Vec::new();
    for corner in 0..8 {
        let corner = IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2) * 448;
        for i in 0..32 * 32 * 32 {
            let voxel = corner + IVec3::new(i >> 10, i >> 5 & 31, i & 31);
            voxels.push((voxel, 0.5 + (i % 7) as f32));
        }
    }
    let active = size_of::<f32>() * voxels.len();
    let volume = read_one(Grid {
        voxels,
        ..Grid::default()
    });
    let bytes = volume.built.voxels.bytes();
    assert!(10 * bytes <= 13 * active, "{bytes} for {active}");
}

#[test]
fn small_files_that_claim_huge_grids_are_cheap_or_refused() {
    // 65536³ voxels in 4096 tiles take a table of 16 MiB.
    let tiles: Vec<_> = (0..4096)
        .map(|i| (IVec3::new(i >> 8, i >> 4 & 15, i & 15) * 4096, 0.5, true))
        .collect();
    let grid = Grid {
        root_tiles: tiles,
        ..Grid::default()
    };
    let volume = read_one(grid);
    assert!(volume.built.voxels.bytes() < 40 << 20);
    // Two tiles a million blocks apart.
    let far = 1 << 29;
    let grid = Grid {
        root_tiles: vec![
            (IVec3::splat(-far), 1.0, true),
            (IVec3::splat(far), 1.0, true),
        ],
        ..Grid::default()
    };
    assert!(complaint(file(&[grid])).contains("blocks of 512³"));
    let many = Grid {
        voxels: (0..64).map(|i| (IVec3::X * 8 * i, 1.0)).collect(),
        ..Grid::default()
    };
    let found = read_from(Cursor::new(file(&[many])), None, 100_000).unwrap_err();
    let found = found.to_string();
    assert!(
        found.contains("more than the limit") && found.contains("--max-grid-memory"),
        "{found}"
    );
}
