//! Small sound files, cut off and changed in all places: the reader answers, with an error or without, and never panics.

use crate::vdb_writer::{Codec, Grid, file};
use crate::vol;
use glam::IVec3;
use std::io::Cursor;
use tyndall_scene::volume_file::{inspect_from, read_from};

/// What a changed length may make the reader take, in bytes.
const LIMIT: u64 = 1 << 24;

/// Whether a file is read.
fn is_read(bytes: &[u8]) -> bool {
    read_from(Cursor::new(bytes), None, LIMIT).is_ok()
}

fn files() -> Vec<Vec<u8>> {
    let codecs = [
        (Codec::None, true, 0),
        (Codec::Zip, true, 5),
        (Codec::Blosc, true, 3),
        (Codec::Blosc, false, 6),
    ];
    let mut files: Vec<_> = codecs
        .into_iter()
        .map(|(codec, active_only, inactive)| {
            let voxels = (0..600).map(|i| (IVec3::new(i % 10, i / 10 % 10, i / 100), 1.5));
            file(&[Grid {
                codec,
                active_only,
                inactive,
                half: inactive == 3,
                voxels: voxels.collect(),
                root_tiles: vec![(IVec3::new(4096, 0, 0), 0.75, true)],
                ..Grid::default()
            }])
        })
        .collect();
    let mut volume = vol::header(1, [3, 2, 2, 1], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    volume.extend([0.5_f32; 12].map(f32::to_le_bytes).concat());
    files.push(volume);
    files
}

/// A number that looks random, from its predecessor (Knuth's multiplicative congruence for 64 bits).
fn next(state: &mut u64) -> usize {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize
}

#[test]
fn files_cut_off_anywhere_are_refused() {
    for bytes in files() {
        assert!(is_read(&bytes));
        // All of the header and what follows it, then every few bytes of the masks.
        let ends = (0..bytes.len().min(700)).chain((700..bytes.len()).step_by(37));
        for end in ends {
            assert!(
                !is_read(&bytes[..end]),
                "cut off at {end} of {}",
                bytes.len()
            );
        }
    }
}

#[test]
fn changed_bytes_never_make_the_reader_panic() {
    let mut state = 7;
    for bytes in files() {
        for round in 0..1500 {
            let mut changed = bytes.clone();
            // Lengths, counts and places stand in front; masks with few bits fill most of the rest.
            let range = if round % 2 == 0 {
                bytes.len().min(500)
            } else {
                bytes.len()
            };
            for _ in 0..=next(&mut state) % 3 {
                let place = next(&mut state) % range;
                changed[place] = match next(&mut state) % 4 {
                    0 => 0xff,
                    1 => 0,
                    2 => 0x80,
                    _ => next(&mut state) as u8,
                };
            }
            let _: bool = is_read(&changed);
            if round % 8 == 0 {
                let _: bool = inspect_from(Cursor::new(changed), LIMIT).is_ok();
            }
        }
    }
}
