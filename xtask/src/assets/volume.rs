//! Density for volume files: procedural noise on a lattice, written as Mitsuba's grid volumes (`.vol`, version 3).

use glam::{IVec3, Vec3};

/// A density in a box, as a function of the place in it, at the centres of `cells`.
///
/// Only arithmetic that every processor does alike goes into the values, so that the file is the same everywhere.
pub(super) fn vol(
    cells: [i32; 3],
    [min, max]: [Vec3; 2],
    density: impl Fn(Vec3) -> f32,
) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for number in [1, cells[0], cells[1], cells[2], 1] {
        bytes.extend(number.to_le_bytes());
    }
    for number in [min.to_array(), max.to_array()].concat() {
        bytes.extend(number.to_le_bytes());
    }
    let size = (max - min) / IVec3::from(cells).as_vec3();
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let place = IVec3::new(x, y, z).as_vec3() + 0.5;
                bytes.extend(density(min + size * place).to_le_bytes());
            }
        }
    }
    bytes
}

/// Octaves of noise, each half as strong and twice as fine as the one before.
const OCTAVES: u32 = 4;

/// Noise in [0, 1] with detail at all scales below 1: value noise (Ebert et al., Texturing and Modeling, 2003, §2) in octaves.
pub(super) fn noise(p: Vec3) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for octave in 0..OCTAVES {
        let scale = (1 << octave) as f32;
        // Shifted, so that the lattices of octaves do not line up.
        sum += weight * value(p * scale + 17.0 * octave as f32);
        total += weight;
        weight *= 0.5;
    }
    sum / total
}

/// Random values at whole coordinates, smoothly interpolated.
fn value(p: Vec3) -> f32 {
    let base = p.floor();
    let t = (p - base).map(smooth);
    let cell = base.as_ivec3();
    let along = |axis: usize, a: f32, b: f32| a + (b - a) * t[axis];
    let edge = |y, z| {
        let corner = |x| random(cell + IVec3::new(x, y, z));
        along(0, corner(0), corner(1))
    };
    let face = |z| along(1, edge(0, z), edge(1, z));
    along(2, face(0), face(1))
}

/// A number in [0, 1) for each place: integer hashing by multiplication and shifts (murmur3's finaliser).
fn random(p: IVec3) -> f32 {
    let [x, y, z] = p.to_array().map(|c| c as u32);
    let mut h =
        x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ z.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ h >> 16).wrapping_mul(0x85eb_ca6b);
    h = (h ^ h >> 13).wrapping_mul(0xc2b2_ae35);
    ((h ^ h >> 16) >> 8) as f32 / (1 << 24) as f32
}

/// From 0 to 1 without kinks.
pub(super) fn smooth(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
