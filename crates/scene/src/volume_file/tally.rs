//! What is counted while voxels are read.

use glam::IVec3;

/// Count, range and mean of active voxels, and the box around them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tally {
    pub(super) count: u64,
    pub(super) min: f32,
    pub(super) max: f32,
    sum: f64,
    pub(super) bounds: [IVec3; 2],
}

impl Tally {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            min: f32::INFINITY,
            max: f32::NEG_INFINITY,
            sum: 0.0,
            bounds: [IVec3::MAX, IVec3::MIN],
        }
    }

    /// Counts a voxel; one that is not a number has no part in the range.
    #[inline]
    pub(super) fn voxel(&mut self, voxel: IVec3, value: f32) {
        self.cube(voxel, 1, value);
    }

    /// Counts the voxels of a cube.
    #[inline]
    pub(super) fn cube(&mut self, min: IVec3, side: i32, value: f32) {
        let n = i64::from(side).pow(3) as u64;
        self.count = self.count.saturating_add(n);
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.sum += f64::from(value) * n as f64;
        let [low, high] = self.bounds;
        self.bounds = [low.min(min), high.max(min + (side - 1))];
    }

    /// Mean of the values.
    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }

    /// Edges of the box around the voxels, in voxels.
    pub(super) fn size(&self) -> [u64; 3] {
        let [low, high] = self.bounds;
        (high.as_i64vec3() - low.as_i64vec3())
            .to_array()
            .map(|n| u64::try_from(n + 1).unwrap_or(0))
    }
}
