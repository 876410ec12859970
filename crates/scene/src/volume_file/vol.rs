//! Mitsuba's grid volumes, version 3: a header of 48 bytes and values, x fastest, channels interleaved.
//!
//! Values are samples at the centres of the cells of a box; beyond the outermost centres they are those of the nearest, outside the
//! box there is nothing. Voxel (i, j, k) of the file is stored at (i + 1, j + 1, k + 1), with copies of the outermost around them.

use super::error::VolumeError;
use super::half::half_to_f32;
use super::source::Source;
use super::tally::Tally;
use glam::{DAffine3, DMat3, DVec3, IVec3, Vec3};
use std::io::{Read, Seek};
use tyndall_media::grid::{BRICK_SIDE, Brick, BuiltVoxels, GridEdge, VoxelsBuilder, VoxelsError};

/// The first bytes of every file.
pub(super) const MAGIC: [u8; 3] = *b"VOL";

/// Largest number of cells on an axis and of channels: what a table of blocks can span.
const MAX_CELLS: i32 = 1 << 20;

/// A file whose header has been read.
#[derive(Debug)]
pub(super) struct Vol<R> {
    source: Source<R>,
    encoding: Encoding,
    size: IVec3,
    channels: usize,
    min: Vec3,
    max: Vec3,
}

#[derive(Clone, Copy, Debug)]
enum Encoding {
    Float32,
    Float16,
    UInt8,
}

/// A channel of the file.
#[derive(Debug)]
pub(super) struct VolGrid {
    pub(super) built: BuiltVoxels,
    pub(super) world_from_index: DAffine3,
    pub(super) edge: GridEdge,
    /// Of all values, with the number of those that are not zero.
    pub(super) tally: Tally,
    pub(super) non_zero: u64,
}

impl<R: Read + Seek> Vol<R> {
    pub(super) fn open(mut source: Source<R>) -> Result<Self, VolumeError> {
        const WHAT: &str = "the header";
        source.skip(MAGIC.len() as u64, WHAT)?;
        let version = source.u8(WHAT)?;
        if version != 3 {
            return Err(VolumeError::Unsupported {
                what: format!("the file has version {version} of Mitsuba's volume format"),
                mend: "version 3 is read".into(),
            });
        }
        let encoding = match source.i32(WHAT)? {
            1 => Encoding::Float32,
            2 => Encoding::Float16,
            3 => Encoding::UInt8,
            4 => {
                return Err(VolumeError::Unsupported {
                    what: "the file holds directions, not densities".into(),
                    mend: "floats of 32 or 16 bits and bytes are read".into(),
                });
            }
            other => {
                return Err(source.malformed(format!(
                    "values have the unknown encoding {other}; there are 1 to 4"
                )));
            }
        };
        let size = IVec3::new(source.i32(WHAT)?, source.i32(WHAT)?, source.i32(WHAT)?);
        let channels = source.i32(WHAT)?;
        let mut corners = [Vec3::ZERO; 2];
        for corner in &mut corners {
            *corner = Vec3::new(source.f32(WHAT)?, source.f32(WHAT)?, source.f32(WHAT)?);
        }
        let [min, max] = corners;
        let allowed = 1..=MAX_CELLS;
        if !(size.to_array().iter().all(|n| allowed.contains(n)) && allowed.contains(&channels)) {
            return Err(source.malformed(format!(
                "it has {} × {} × {} cells and {channels} channels; each must lie between 1 and {MAX_CELLS}",
                size.x, size.y, size.z
            )));
        }
        if !(min.is_finite() && max.is_finite() && min.cmplt(max).all()) {
            return Err(source.malformed(format!(
                "its box goes from {min} to {max}; the first must be below the second"
            )));
        }
        let vol = Self {
            source,
            encoding,
            size,
            channels: channels as usize,
            min,
            max,
        };
        // Up to 2⁸² bytes.
        let needed = vol
            .size
            .to_array()
            .map(|n| n as u128)
            .iter()
            .product::<u128>()
            * (vol.channels * vol.bytes_per_value()) as u128;
        vol.source.need(
            u64::try_from(needed).unwrap_or(u64::MAX),
            "the values of all cells",
        )?;
        Ok(vol)
    }

    /// What the channels are called: `density` if there is one, `r`, `g`, `b` for three, their numbers otherwise.
    pub(super) fn names(&self) -> Vec<String> {
        match self.channels {
            1 => vec!["density".into()],
            3 => ["r", "g", "b"].map(String::from).into(),
            n => (0..n.min(64)).map(|i| i.to_string()).collect(),
        }
    }

    /// The type of the values, for people.
    pub(super) fn value_type(&self) -> &'static str {
        match self.encoding {
            Encoding::Float32 => "float",
            Encoding::Float16 => "half",
            Encoding::UInt8 => "byte",
        }
    }

    fn bytes_per_value(&self) -> usize {
        match self.encoding {
            Encoding::Float32 => 4,
            Encoding::Float16 => 2,
            Encoding::UInt8 => 1,
        }
    }

    /// The voxels of a channel, in no more than `limit` bytes.
    pub(super) fn grid(&mut self, channel: usize, limit: u64) -> Result<VolGrid, VolumeError> {
        let name = self.names().get(channel).cloned().unwrap_or_default();
        let voxels = |error| VolumeError::Voxels {
            grid: name.clone(),
            error,
        };
        let last = self.size + 1;
        let blocks = last / BRICK_SIDE + 1;
        let n_bricks = blocks.to_array().map(|n| n as usize).iter().product();
        let mut builder =
            VoxelsBuilder::new(0.0, [IVec3::ZERO, last], n_bricks, limit).map_err(voxels)?;
        let mut slices = Slices::new(self, channel)?;
        // Eight slices of the padded volume at a time.
        let mut slab: [Vec<f32>; BRICK_SIDE as usize] = Default::default();
        for z in 0..=last.z | 7 {
            slices.advance_to(self, (z - 1).clamp(0, self.size.z - 1))?;
            slab[(z & 7) as usize].clone_from(&slices.current);
            if z & 7 == 7 {
                self.bricks(&slab, z, &mut builder);
            }
        }
        let cell = (self.max.as_dvec3() - self.min.as_dvec3()) / self.size.as_dvec3();
        let faces = [DVec3::splat(0.5), self.size.as_dvec3() + 0.5];
        if let Some((count, first)) = slices.non_finite {
            return Err(voxels(VoxelsError::NonFinite { count, first }));
        }
        let built = builder.finish().map_err(voxels)?;
        Ok(VolGrid {
            built: BuiltVoxels {
                // Without the copies around.
                n_negative: slices.negative,
                ..built
            },
            world_from_index: DAffine3 {
                matrix3: DMat3::from_diagonal(cell),
                translation: self.min.as_dvec3() - 0.5 * cell,
            },
            edge: GridEdge::Box(faces),
            tally: slices.tally,
            non_zero: slices.non_zero,
        })
    }

    /// Adds the bricks whose last slice is `z`. Copies go on to the ends of bricks, so that those of constant volumes become tiles.
    fn bricks(&self, slab: &[Vec<f32>; 8], z: i32, builder: &mut VoxelsBuilder) {
        let last = self.size + 1;
        for bx in 0..=last.x >> 3 {
            for by in 0..=last.y >> 3 {
                let min = IVec3::new(bx, by, z >> 3) * BRICK_SIDE;
                let brick: Brick = std::array::from_fn(|i| {
                    let i = i as i32;
                    let voxel = min + (IVec3::new(i >> 6, i >> 3, i) & 7);
                    let from = (voxel - 1).clamp(IVec3::ZERO, self.size - 1);
                    let values = &slab[(voxel.z & 7) as usize];
                    let place = from.y as usize * self.size.x as usize + from.x as usize;
                    values.get(place).copied().unwrap_or_default()
                });
                builder.set_brick(min, &brick);
            }
        }
    }
}

/// The slices of one channel, read one after the other.
struct Slices {
    channel: usize,
    /// How many have been read.
    read: i32,
    current: Vec<f32>,
    bytes: Vec<u8>,
    tally: Tally,
    non_zero: u64,
    negative: u64,
    /// How many are not finite, and the first of them.
    non_finite: Option<(u64, IVec3)>,
}

impl Slices {
    fn new<R: Read + Seek>(vol: &mut Vol<R>, channel: usize) -> Result<Self, VolumeError> {
        vol.source.seek(48, "the values")?;
        Ok(Self {
            channel,
            read: 0,
            current: Vec::new(),
            bytes: Vec::new(),
            tally: Tally::new(),
            non_zero: 0,
            negative: 0,
            non_finite: None,
        })
    }

    /// Makes slice `z` the current one; slices come in order.
    fn advance_to<R: Read + Seek>(&mut self, vol: &mut Vol<R>, z: i32) -> Result<(), VolumeError> {
        while self.read <= z {
            self.next(vol)?;
        }
        Ok(())
    }

    fn next<R: Read + Seek>(&mut self, vol: &mut Vol<R>) -> Result<(), VolumeError> {
        let (nx, ny) = (vol.size.x as usize, vol.size.y as usize);
        let step = vol.bytes_per_value();
        let length = nx as u64 * ny as u64 * (vol.channels * step) as u64;
        vol.source
            .take(length, &mut self.bytes, "a slice of values")?;
        let values = self.bytes.chunks_exact(step).skip(self.channel);
        self.current.clear();
        self.current
            .extend(values.step_by(vol.channels).map(|bytes| match bytes {
                &[a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
                &[a, b] => half_to_f32(u16::from_le_bytes([a, b])),
                bytes => f32::from(bytes.first().copied().unwrap_or_default()) / 255.0,
            }));
        for (i, &value) in self.current.iter().enumerate() {
            let voxel = IVec3::new((i % nx) as i32, (i / nx) as i32, self.read);
            self.tally.voxel(voxel, value);
            self.non_zero += u64::from(value != 0.0);
            self.negative += u64::from(value < 0.0);
            if !value.is_finite() {
                let (count, first) = self.non_finite.unwrap_or((0, voxel));
                self.non_finite = Some((count + 1, first));
            }
        }
        self.read += 1;
        Ok(())
    }
}
