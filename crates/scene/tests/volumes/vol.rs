//! Mitsuba's grid volumes, written here and read back.

use glam::{DVec3, IVec3};
use std::io::Cursor;
use tyndall_media::grid::GridEdge;
use tyndall_scene::volume_file::{Volume, inspect_from, read_from};

const LIMIT: u64 = 1 << 24;

pub(crate) fn header(encoding: i32, [x, y, z, channels]: [i32; 4], bounds: [f32; 6]) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for number in [encoding, x, y, z, channels] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(bounds.map(f32::to_le_bytes).concat());
    bytes
}

const BOUNDS: [f32; 6] = [-1.0, 0.0, 2.0, 1.0, 1.0, 5.0];

fn read(bytes: Vec<u8>, wanted: Option<&str>) -> Result<Volume, String> {
    read_from(Cursor::new(bytes), wanted, LIMIT).map_err(|error| error.to_string())
}

/// The value of a cell.
fn value(p: IVec3) -> f32 {
    (p.x + 10 * p.y + 100 * p.z) as f32
}

#[test]
fn cells_are_stored_one_farther_with_copies_around() {
    for size in [[1, 1, 1], [3, 4, 5], [8, 7, 6], [20, 9, 17]] {
        let [x, y, z] = size;
        let mut bytes = header(1, [x, y, z, 1], BOUNDS);
        for k in 0..z {
            for j in 0..y {
                for i in 0..x {
                    bytes.extend(value(IVec3::new(i, j, k)).to_le_bytes());
                }
            }
        }
        let volume = read(bytes, None).unwrap();
        let size = IVec3::from(size);
        for i in -1..=x {
            for j in -1..=y {
                for k in -1..=z {
                    let p = IVec3::new(i, j, k);
                    let expected = value(p.clamp(IVec3::ZERO, size - 1));
                    assert_eq!(volume.built.voxels.value(p + 1), expected, "{p} of {size}");
                }
            }
        }
        let n = size.as_dvec3();
        let faces = [DVec3::splat(0.5), n + 0.5];
        assert_eq!(volume.edge, GridEdge::Box(faces));
        let corners = faces.map(|face| volume.world_from_index.transform_point3(face));
        let expected = [DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 1.0, 5.0)];
        for (found, expected) in corners.into_iter().zip(expected) {
            assert!((found - expected).length() < 1e-12, "{found}");
        }
    }
}

#[test]
fn a_constant_volume_takes_no_bricks() {
    let mut bytes = header(1, [50, 9, 33, 1], BOUNDS);
    bytes.extend([0.5_f32; 50 * 9 * 33].map(f32::to_le_bytes).concat());
    let volume = read(bytes, None).unwrap();
    // Two nodes of 4 KiB and a table instead of 290 KiB.
    assert!(
        volume.built.voxels.bytes() < 16_000,
        "{}",
        volume.built.voxels.bytes()
    );
    assert_eq!(volume.built.voxels.max(), 0.5);
}

#[test]
fn halves_bytes_and_channels_are_read() {
    let mut halves = header(2, [2, 1, 1, 1], BOUNDS);
    halves.extend([0x3c00_u16, 0x4200].map(u16::to_le_bytes).concat());
    let volume = read(halves, None).unwrap();
    assert_eq!(volume.built.voxels.value(IVec3::new(2, 1, 1)), 3.0);
    let mut bytes = header(3, [2, 1, 1, 3], BOUNDS);
    bytes.extend([0, 51, 102, 153, 204, 255]);
    for (name, expected) in [("r", 0.6), ("g", 0.8), ("b", 1.0)] {
        let volume = read(bytes.clone(), Some(name)).unwrap();
        assert_eq!(volume.built.voxels.value(IVec3::new(2, 1, 1)), expected);
    }
    let unnamed = read(bytes.clone(), None).unwrap_err();
    assert!(unnamed.contains("\"r\", \"g\", \"b\""), "{unnamed}");
    let summaries = inspect_from(Cursor::new(bytes), LIMIT).unwrap();
    let red = summaries[0].voxels.as_ref().unwrap();
    assert_eq!((red.size, red.active, red.max), ([2, 1, 1], 1, 0.6));
}

#[test]
fn what_is_wrong_is_named() {
    let wrong = |bytes: Vec<u8>| read(bytes, None).map(|_| ()).unwrap_err();
    let with = |encoding, size, bounds| wrong(header(encoding, size, bounds));
    let mut version = header(1, [1; 4], BOUNDS);
    version[3] = 4;
    let nan = [f32::NAN, 0.0, 2.0, 1.0, 1.0, 5.0];
    let mut of_nan = header(1, [1; 4], BOUNDS);
    of_nan.extend(f32::NAN.to_le_bytes());
    for (found, says) in [
        (wrong(version), "version 4"),
        (with(4, [1; 4], BOUNDS), "directions"),
        (with(9, [1; 4], BOUNDS), "unknown encoding 9"),
        (with(1, [0, 1, 1, 1], BOUNDS), "0 × 1 × 1 cells"),
        (with(1, [1, 1, 1, 0], BOUNDS), "0 channels"),
        (with(1, [-3, 1, 1, 1], BOUNDS), "-3 × 1 × 1"),
        (with(1, [1; 4], [0.0; 6]), "its box goes from"),
        (with(1, [1; 4], nan), "its box goes from"),
        (with(1, [1; 4], BOUNDS), "cut off"),
        // A header alone that claims 10¹⁵ bytes.
        (
            with(1, [65536, 65536, 65536, 1], BOUNDS),
            "needs 1125899906842624 bytes",
        ),
        (
            with(1, [1 << 20, 1 << 20, 1 << 20, 1 << 20], BOUNDS),
            "cut off",
        ),
        (wrong(of_nan), "1 non-finite voxels, the first at (0, 0, 0)"),
    ] {
        assert!(found.contains(says), "{found}");
    }
}
