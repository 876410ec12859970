//! Cells of space, small near the eye and larger by powers of two farther away, and what each has of light.
//!
//! A point lies in a cell of each size; cells in media are one for all directions, cells on surfaces one for each side that surfaces
//! face.

use super::bands::Bands;
use glam::{DVec3, IVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Cells of neighbouring sizes in which a point's light counts: the smallest, and larger ones where little has been seen.
pub(super) const SIZES: i32 = 5;
/// Sides of one cell that are told apart; light on further ones is not counted.
pub(super) const MOST_SIDES: usize = 4;
/// By how many sizes cells in media are larger than those on surfaces: light changes slowly there.
const MEDIUM_LARGER: i32 = 1;

/// Widths of cells: a share of the distance to the nearest eye, rounded down to a power of two.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CellWidths {
    eyes: Vec<Vec3>,
    per_metre: f32,
    least: f32,
}

impl CellWidths {
    /// Widths of `share` of the distance to the nearest of `eyes`, and of `least` metres at least.
    pub fn around(eyes: &[Vec3], share: f32, least: f32) -> Self {
        Self {
            eyes: eyes.into(),
            per_metre: share,
            least,
        }
    }

    /// Cells of one width everywhere, in metres.
    pub fn even(width: f32) -> Self {
        Self::around(&[], 0.0, width)
    }

    /// Width of the smallest cells at `p`, as an exponent of two.
    pub(super) fn exponent(&self, p: Vec3, kind: Kind) -> i32 {
        let distances = self.eyes.iter().map(|eye| p.distance(*eye));
        let width = (self.per_metre * distances.fold(f32::MAX, f32::min)).max(self.least);
        let larger = match kind {
            Kind::Medium => MEDIUM_LARGER,
            Kind::Surface(_) => 0,
        };
        width.clamp(1e-18, 1e18).log2().floor() as i32 + larger
    }
}

/// Exponents of widths that are normal numbers.
const EXPONENTS: std::ops::Range<i32> = -126..128;

/// Width of cells, in metres.
pub(super) fn width(exponent: i32) -> f32 {
    f32::from_bits(((127 + exponent) as u32) << 23)
}

/// What a cell is a cell of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Kind {
    Medium,
    /// The side surfaces face: twice the axis nearest to the normal, plus one where the normal points down it.
    Surface(u8),
}

impl Kind {
    pub(super) fn facing(normal: Vec3) -> Self {
        let axis = normal.abs().max_position();
        Self::Surface(2 * axis as u8 + u8::from(normal[axis] < 0.0))
    }
}

/// Which cell: its size, its place in the lattice of that size, and what it is a cell of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Place {
    pub(super) exponent: i32,
    pub(super) lattice: IVec3,
    pub(super) kind: Kind,
}

impl Place {
    pub(super) fn of(p: Vec3, exponent: i32, kind: Kind) -> Self {
        Self {
            exponent,
            lattice: (p / width(exponent)).floor().as_ivec3(),
            kind,
        }
    }

    /// The cell of the next size that holds this one.
    pub(super) fn larger(self) -> Self {
        Self {
            exponent: self.exponent + 1,
            lattice: self.lattice >> IVec3::ONE,
            kind: self.kind,
        }
    }

    /// A number for each place.
    pub(super) fn key(self) -> u128 {
        let [x, y, z] = self.lattice.to_array().map(|c| u128::from(c as u32));
        let kind = match self.kind {
            Kind::Medium => u128::from(u8::MAX),
            Kind::Surface(side) => u128::from(side),
        };
        let size = (self.exponent + 128) as u128;
        ((((size << 8 | kind) << 32 | x) << 32) | y) << 32 | z
    }
}

/// Light at a place: all of it, and what does not come straight from lights.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Light {
    pub(super) all: Vec3,
    pub(super) indirect: Vec3,
}

impl Light {
    pub(super) fn direct(light: Vec3) -> Self {
        Self {
            all: light,
            indirect: Vec3::ZERO,
        }
    }

    /// Adds indirect light.
    pub(super) fn add(&mut self, indirect: Vec3) {
        self.all += indirect;
        self.indirect += indirect;
    }
}

/// Light found in a cell, all and indirect.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Sum {
    pub(super) n: u32,
    /// f64 because millions of terms may be added.
    all: DVec3,
    indirect: DVec3,
}

impl From<Light> for Sum {
    fn from(light: Light) -> Self {
        Self {
            n: 1,
            all: light.all.as_dvec3(),
            indirect: light.indirect.as_dvec3(),
        }
    }
}

impl Sum {
    pub(super) fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.all += other.all;
        self.indirect += other.indirect;
    }

    /// Whether it is what light can add up to.
    fn is_light(&self) -> bool {
        let is_light = |v: DVec3| v.is_finite() && v.min_element() >= 0.0;
        is_light(self.all) && is_light(self.indirect)
    }

    pub(super) fn mean(&self) -> Light {
        let n = f64::from(self.n.max(1));
        Light {
            all: (self.all / n).as_vec3(),
            indirect: (self.indirect / n).as_vec3(),
        }
    }
}

/// Index of a neighbour that is not there, or not to be seen.
pub(super) const NO_LINK: u32 = u32::MAX;

/// One side of a cell: the part of it that is seen from one place.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Side {
    pub(super) place: Place,
    /// Where light was first found on it, a little off a surface.
    pub(super) anchor: Vec3,
    /// The surface's unit normal there; zero in media.
    pub(super) normal: Vec3,
    /// Light counted here, and in the smaller cells within once these are added.
    pub(super) sum: Sum,
    /// The next side of the same cell.
    next: Option<u32>,
    /// Which of [`Cells::bands`] tell from where its light comes, in media that do not scatter alike in all directions.
    pub(super) bands: Option<u32>,
}

/// Cells by their keys. Most have one side; those that surfaces part have more.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells {
    pub(super) sides: Vec<Side>,
    pub(super) bands: Vec<Bands>,
    /// Whether sides in media have bands.
    has_bands: bool,
    first_sides: HashMap<u128, u32, BuildHasherDefault<KeyHasher>>,
}

impl Cells {
    /// No cells yet; those in media tell from where their light comes if `has_bands`.
    pub(super) fn new(has_bands: bool) -> Self {
        Self {
            has_bands,
            ..Self::default()
        }
    }

    /// Whether cells in media tell from where their light comes.
    pub(super) fn has_bands(&self) -> bool {
        self.has_bands
    }

    /// The cells that these sides and their bands make up; `None` where their numbers do not fit together.
    pub(super) fn from_sides(sides: Vec<Side>, bands: Vec<Bands>, has_bands: bool) -> Option<Self> {
        if !bands.iter().all(Bands::is_finite) {
            return None;
        }
        let mut is_first = vec![true; sides.len()];
        for (i, side) in sides.iter().enumerate() {
            let wants_bands = has_bands && side.place.kind == Kind::Medium;
            let has_them = side.bands.map(|index| (index as usize) < bands.len());
            if has_them != wants_bands.then_some(true) {
                return None;
            }
            if !EXPONENTS.contains(&side.place.exponent) || !side.sum.is_light() {
                return None;
            }
            if let Some(next) = side.next {
                // Later sides stand behind earlier ones, so that there is an end to them.
                let is_later = next as usize > i;
                let is_same = sides.get(next as usize)?.place == side.place;
                *is_first
                    .get_mut(next as usize)
                    .filter(|_| is_later && is_same)? = false;
            }
        }
        let numbered = (0..).zip(&sides).zip(is_first);
        let firsts = numbered.filter(|(_, is_first)| *is_first);
        let mut first_sides = HashMap::default();
        for ((i, side), _) in firsts {
            if first_sides.insert(side.place.key(), i).is_some() {
                return None;
            }
        }
        Some(Self {
            sides,
            bands,
            has_bands,
            first_sides,
        })
    }

    /// The first side of the cell at `place`.
    pub(super) fn find(&self, place: Place) -> Option<u32> {
        self.first_sides.get(&place.key()).copied()
    }

    /// The first side of the cell at `place`, with `anchor` if it is new.
    pub(super) fn find_or_add(&mut self, place: Place, anchor: Vec3, normal: Vec3) -> u32 {
        let next = self.sides.len() as u32;
        let first = *self.first_sides.entry(place.key()).or_insert(next);
        if first == next {
            self.push(place, anchor, normal);
        }
        first
    }

    fn push(&mut self, place: Place, anchor: Vec3, normal: Vec3) {
        let bands = (self.has_bands && place.kind == Kind::Medium).then(|| {
            self.bands.push(Bands::default());
            self.bands.len() as u32 - 1
        });
        self.sides.push(Side {
            bands,
            place,
            anchor,
            normal,
            sum: Sum::default(),
            next: None,
        });
    }

    /// The mean light of each side.
    pub(super) fn means(&self) -> Vec<Light> {
        self.sides.iter().map(|side| side.sum.mean()).collect()
    }

    /// The sides of a cell, from its first.
    pub(super) fn sides_from(&self, first: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(first), |&side| self.sides[side as usize].next)
    }

    /// One more side for the cell whose first is `first`.
    pub(super) fn add_side(&mut self, first: u32, anchor: Vec3, normal: Vec3) -> u32 {
        let last = self.sides_from(first).last().unwrap_or(first);
        let added = self.sides.len() as u32;
        self.push(self.sides[first as usize].place, anchor, normal);
        self.sides[last as usize].next = Some(added);
        added
    }
}

/// Hashes one number the same way in every run (Fibonacci hashing, Knuth, TAOCP 3, §6.4).
#[derive(Clone, Copy, Debug, Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(self.0 ^ u64::from(byte));
        }
    }

    fn write_u64(&mut self, key: u64) {
        let product = key.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = product ^ (product >> 32);
    }

    fn write_u128(&mut self, key: u128) {
        self.write_u64((key >> 64) as u64);
        self.write_u64(self.0 ^ key as u64);
    }
}
