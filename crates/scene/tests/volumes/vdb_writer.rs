//! Writes small OpenVDB files, from the description of the format and not from the reader, with all that it lets one choose.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::IVec3;
use std::collections::BTreeMap;
use std::io::Write;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Codec {
    None,
    Zip,
    Blosc,
}

/// A grid to be written.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) name: &'static str,
    pub(crate) kind: &'static str,
    pub(crate) instance_of: &'static str,
    pub(crate) class: &'static str,
    pub(crate) codec: Codec,
    pub(crate) half: bool,
    /// Whether inactive values are left out.
    pub(crate) active_only: bool,
    /// Which inactive values there are, 0 to 6.
    pub(crate) inactive: u8,
    /// Added to the number of active voxels stated; none is stated where there is none.
    pub(crate) count_off_by: Option<i64>,
    pub(crate) map: (&'static str, Vec<f64>),
    pub(crate) background: f32,
    /// First voxel, value, active.
    pub(crate) root_tiles: Vec<(IVec3, f32, bool)>,
    /// First voxel, edge (8 or 128), value, active.
    pub(crate) tiles: Vec<(IVec3, i32, f32, bool)>,
    /// Active voxels.
    pub(crate) voxels: Vec<(IVec3, f32)>,
}

/// Scale 1, in the five forms that the file has it in.
pub(crate) fn scale_map(scale: [f64; 3]) -> Vec<f64> {
    let forms = [
        scale,
        scale.map(f64::abs),
        scale.map(f64::recip),
        scale.map(|s| 1.0 / (s * s)),
        scale.map(|s| 0.5 / s),
    ];
    forms.concat()
}

impl Default for Grid {
    fn default() -> Self {
        Self {
            name: "density",
            kind: "Tree_float_5_4_3",
            instance_of: "",
            class: "fog volume",
            codec: Codec::None,
            half: false,
            active_only: true,
            inactive: 0,
            count_off_by: Some(0),
            map: ("UniformScaleMap", scale_map([1.0; 3])),
            background: 0.0,
            root_tiles: Vec::new(),
            tiles: Vec::new(),
            voxels: Vec::new(),
        }
    }
}

pub(crate) fn string(bytes: &mut Vec<u8>, text: &str) {
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(text.as_bytes());
}

fn metadatum(bytes: &mut Vec<u8>, name: &str, kind: &str, value: &[u8]) {
    string(bytes, name);
    string(bytes, kind);
    bytes.extend((value.len() as u32).to_le_bytes());
    bytes.extend(value);
}

pub(crate) fn header(version: u32, has_offsets: bool, n_grids: i32) -> Vec<u8> {
    let mut bytes = vec![0x20, 0x42, 0x44, 0x56, 0, 0, 0, 0];
    for number in [version, 10, 0] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.push(has_offsets.into());
    bytes.extend([b'0'; 36]);
    bytes.extend(1_u32.to_le_bytes());
    metadatum(&mut bytes, "creator", "string", b"a test");
    bytes.extend(n_grids.to_le_bytes());
    bytes
}

/// A file with these grids.
pub(crate) fn file(grids: &[Grid]) -> Vec<u8> {
    let mut bytes = header(224, true, grids.len() as i32);
    for grid in grids {
        let (mut shape, mut voxels) = (Vec::new(), Vec::new());
        grid.body(&mut shape, &mut voxels);
        string(&mut bytes, grid.name);
        let half = if grid.half { "_HalfFloat" } else { "" };
        string(&mut bytes, &format!("{}{half}", grid.kind));
        string(&mut bytes, grid.instance_of);
        let position = bytes.len() + 24;
        for place in [0, shape.len(), shape.len() + voxels.len()] {
            bytes.extend(((position + place) as i64).to_le_bytes());
        }
        bytes.append(&mut shape);
        bytes.append(&mut voxels);
    }
    bytes
}

/// Sorted voxels of leaves, and leaves and tiles of nodes.
type Leaf = BTreeMap<usize, f32>;
#[derive(Default)]
struct Node {
    leaves: BTreeMap<usize, Leaf>,
    tiles: BTreeMap<usize, (f32, bool)>,
}
#[derive(Default)]
struct Block {
    nodes: BTreeMap<usize, Node>,
    tiles: BTreeMap<usize, (f32, bool)>,
}

fn place(voxel: IVec3, log2_side: u32, log2_places: u32) -> usize {
    let p = (voxel >> log2_side) & ((1 << log2_places) - 1);
    (p.x << (2 * log2_places) | p.y << log2_places | p.z) as usize
}

impl Grid {
    fn active_count(&self) -> i64 {
        let roots = self.root_tiles.iter().filter(|tile| tile.2);
        let tiles = self.tiles.iter().filter(|tile| tile.3);
        roots.count() as i64 * 4096_i64.pow(3)
            + tiles.map(|tile| i64::from(tile.1).pow(3)).sum::<i64>()
            + self.voxels.len() as i64
    }

    fn body(&self, shape: &mut Vec<u8>, voxels: &mut Vec<u8>) {
        let codec: u32 = match self.codec {
            Codec::None => 0,
            Codec::Zip => 1,
            Codec::Blosc => 4,
        };
        let flags = codec | if self.active_only { 2 } else { 0 };
        shape.extend(flags.to_le_bytes());
        let n = 2 + u32::from(self.count_off_by.is_some());
        shape.extend(n.to_le_bytes());
        metadatum(shape, "class", "string", self.class.as_bytes());
        metadatum(shape, "is_saved_as_half_float", "bool", &[self.half.into()]);
        if let Some(off) = self.count_off_by {
            let count = self.active_count() + off;
            metadatum(shape, "file_voxel_count", "int64", &count.to_le_bytes());
        }
        string(shape, self.map.0);
        for number in &self.map.1 {
            shape.extend(number.to_le_bytes());
        }
        shape.extend(1_u32.to_le_bytes());
        shape.extend(self.background.to_le_bytes());

        let mut blocks: BTreeMap<[i32; 3], Block> = BTreeMap::new();
        let block_of = |voxel: IVec3| voxel.to_array().map(|i| i >> 12 << 12);
        for &(voxel, value) in &self.voxels {
            let node = blocks.entry(block_of(voxel)).or_default();
            let node = node.nodes.entry(place(voxel, 7, 5)).or_default();
            let leaf = node.leaves.entry(place(voxel, 3, 4)).or_default();
            leaf.insert(place(voxel, 0, 3), value);
        }
        for &(voxel, side, value, active) in &self.tiles {
            let block = blocks.entry(block_of(voxel)).or_default();
            if side == 128 {
                block.tiles.insert(place(voxel, 7, 5), (value, active));
            } else {
                let node = block.nodes.entry(place(voxel, 7, 5)).or_default();
                node.tiles.insert(place(voxel, 3, 4), (value, active));
            }
        }
        shape.extend((self.root_tiles.len() as u32).to_le_bytes());
        shape.extend((blocks.len() as u32).to_le_bytes());
        for &(voxel, value, active) in &self.root_tiles {
            shape.extend(voxel.to_array().map(i32::to_le_bytes).concat());
            shape.extend(value.to_le_bytes());
            shape.push(active.into());
        }
        for (origin, block) in &blocks {
            shape.extend(origin.map(i32::to_le_bytes).concat());
            self.node(shape, 32_768, block.nodes.keys(), &block.tiles);
            for node in block.nodes.values() {
                self.node(shape, 4096, node.leaves.keys(), &node.tiles);
                for leaf in node.leaves.values() {
                    let mask = mask(512, leaf.keys().copied());
                    shape.extend(&mask);
                    voxels.extend(&mask);
                    self.values(voxels, 512, leaf);
                }
            }
        }
    }

    fn node<'a>(
        &self,
        out: &mut Vec<u8>,
        n: usize,
        children: impl Iterator<Item = &'a usize>,
        tiles: &BTreeMap<usize, (f32, bool)>,
    ) {
        out.extend(mask(n, children.copied()));
        let active = tiles.iter().filter(|(_, tile)| tile.1);
        let values: Leaf = active.map(|(&i, tile)| (i, tile.0)).collect();
        out.extend(mask(n, values.keys().copied()));
        self.values(out, n, &values);
    }

    /// The `n` values of a node, of which `active` ones are given. Inactive ones are what `inactive` says: here all are different.
    fn values(&self, out: &mut Vec<u8>, n: usize, active: &Leaf) {
        out.push(self.inactive);
        let others: &[f32] = match self.inactive {
            2 | 4 => &[-7.0],
            5 => &[-7.0, 9.0],
            _ => &[],
        };
        for other in others {
            out.extend(other.to_le_bytes());
        }
        if matches!(self.inactive, 3..=5) {
            out.extend(mask(n, (0..n).step_by(3)));
        }
        let values: Vec<f32> = if self.active_only && self.inactive != 6 {
            active.values().copied().collect()
        } else {
            (0..n)
                .map(|i| active.get(&i).copied().unwrap_or(-7.0))
                .collect()
        };
        if self.half && values.is_empty() {
            return;
        }
        let bytes: Vec<u8> = if self.half {
            values.iter().flat_map(|v| half(*v).to_le_bytes()).collect()
        } else {
            values.iter().flat_map(|v| v.to_le_bytes()).collect()
        };
        let element = if self.half { 2 } else { 4 };
        let packed = match self.codec {
            Codec::None => return out.extend(bytes),
            _ if bytes.is_empty() => Vec::new(),
            Codec::Zip => zip(&bytes),
            Codec::Blosc => blosc(&bytes, element),
        };
        // What cannot be made shorter is stored as it is.
        if packed.len() < bytes.len() || self.codec == Codec::Blosc && !packed.is_empty() {
            out.extend((packed.len() as i64).to_le_bytes());
            out.extend(packed);
        } else {
            out.extend((-(bytes.len() as i64)).to_le_bytes());
            out.extend(bytes);
        }
    }
}

fn mask(n: usize, on: impl Iterator<Item = usize>) -> Vec<u8> {
    let mut bytes = vec![0; n / 8];
    for i in on {
        bytes[i / 8] |= 1 << (i % 8);
    }
    bytes
}

/// Halves of the numbers in the tests, which are small multiples of 1/8.
fn half(value: f32) -> u16 {
    if value == 0.0 {
        return 0;
    }
    if !value.is_finite() {
        return 0x7e00;
    }
    let exponent = value.abs().log2().floor() as i32;
    let fraction = value.abs() / 2_f32.powi(exponent) * 1024.0 - 1024.0;
    let sign = if value < 0.0 { 0x8000 } else { 0 };
    sign | ((exponent + 15) as u16) << 10 | fraction as u16
}

fn zip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A Blosc buffer of two blocks where there are enough bytes, with LZ4 streams of literals only.
fn blosc(bytes: &[u8], element: usize) -> Vec<u8> {
    let block = if bytes.len() > 1024 {
        1024
    } else {
        bytes.len()
    };
    let n_blocks = bytes.len().div_ceil(block);
    let mut out = vec![2, 1, 1 << 5 | 1, element as u8];
    for number in [bytes.len(), block, 0] {
        out.extend((number as u32).to_le_bytes());
    }
    let starts = out.len();
    out.resize(starts + 4 * n_blocks, 0);
    for (i, chunk) in bytes.chunks(block).enumerate() {
        let start = (out.len() as u32).to_le_bytes();
        out[starts + 4 * i..][..4].copy_from_slice(&start);
        let whole = chunk.len() == block;
        let n = if whole && block / element >= 128 {
            element
        } else {
            1
        };
        let elements = chunk.len() / element;
        let mut shuffled: Vec<u8> = (0..elements * element)
            .map(|k| chunk[k % elements * element + k / elements])
            .collect();
        shuffled.extend(&chunk[elements * element..]);
        for stream in shuffled.chunks(chunk.len() / n) {
            let mut packed = Vec::new();
            if stream.len() >= 15 {
                packed.push(0xf0);
                let mut rest = stream.len() - 15;
                while rest >= 255 {
                    packed.push(255);
                    rest -= 255;
                }
                packed.push(rest as u8);
            } else {
                packed.push((stream.len() as u8) << 4);
            }
            packed.extend(stream);
            out.extend((packed.len() as u32).to_le_bytes());
            out.extend(packed);
        }
    }
    let length = (out.len() as u32).to_le_bytes();
    out[12..16].copy_from_slice(&length);
    out
}
