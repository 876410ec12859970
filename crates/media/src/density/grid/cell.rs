//! A line through one cell of a grid, where values are interpolated between eight voxels.
//!
//! Along the line the value is a cubic: the two-point rule of Gauss and Legendre integrates it exactly, and also its gradient
//! times the distance and its second derivatives times the square of the distance.

use crate::newton;
use glam::{DMat3, DVec2, DVec3};

/// Distance of the two nodes of the rule from the middle, over the length: 1/√12 (Abramowitz and Stegun 25.4.29).
const NODE: f64 = 0.288_675_134_594_812_9;

/// The stretch of a line inside a cell, and the cell's corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Values at the corners; the bits of the index are the offsets in x, y and z.
    pub(super) corners: [f32; 8],
    /// Where the stretch begins, in [0, 1]³ but for rounding.
    pub(super) start: DVec3,
    /// Direction per metre.
    pub(super) direction: DVec3,
    /// Length in metres.
    pub(super) length: f64,
}

impl Cell {
    /// The point at distance `s` from the start.
    #[inline]
    fn at(&self, s: f64) -> DVec3 {
        self.start + self.direction * s
    }

    /// The distances at which a stretch from the start of this length is sampled, each with half its length for a weight.
    #[inline]
    pub(super) fn nodes(length: f64) -> [f64; 2] {
        let (middle, offset) = (0.5 * length, NODE * length);
        [middle - offset, middle + offset]
    }

    /// ∫ value ds over the first `length` metres.
    ///
    /// Both nodes at once: rays through smoke spend most of their time here.
    #[inline]
    fn partial_column(&self, length: f64) -> f64 {
        let nodes = DVec2::from(Self::nodes(length));
        let [x, y, z] = [
            self.start.x + self.direction.x * nodes,
            self.start.y + self.direction.y * nodes,
            self.start.z + self.direction.z * nodes,
        ];
        let c = &self.corners;
        let on_edge = |i: usize| {
            let (low, high) = (f64::from(c[i]), f64::from(c[i + 1]));
            low + (high - low) * x
        };
        let (low, high) = (
            mix2(on_edge(0), on_edge(2), y),
            mix2(on_edge(4), on_edge(6), y),
        );
        0.5 * length * mix2(low, high, z).element_sum()
    }

    /// ∫ value ds over the stretch.
    #[inline]
    pub(super) fn column(&self) -> f64 {
        self.partial_column(self.length)
    }

    /// The distance at which the column is `column`, in [0, length].
    ///
    /// The value is the slope of the column, and not negative.
    pub(super) fn invert(&self, column: f64) -> f64 {
        let guess = (self.length * column / self.column()).clamp(0.0, self.length);
        let excess = |s| [self.partial_column(s) - column, self.value(s)];
        // As many halvings as f64 has digits; Newton takes about five steps.
        newton::root(
            [0.0, self.length],
            guess,
            60,
            |_| 1e-12 * self.length,
            excess,
        )
    }

    /// The value at distance `s`.
    #[inline]
    pub(super) fn value(&self, s: f64) -> f64 {
        trilinear(&self.corners, self.at(s))
    }

    /// The gradient at distance `s`, per voxel.
    #[inline]
    pub(super) fn gradient(&self, s: f64) -> DVec3 {
        trilinear_gradient(&self.corners, self.at(s))
    }

    /// The second derivatives at distance `s`, per voxel².
    #[inline]
    pub(super) fn hessian(&self, s: f64) -> DMat3 {
        trilinear_hessian(&self.corners, self.at(s))
    }
}

#[inline]
fn mix2(a: DVec2, b: DVec2, t: DVec2) -> DVec2 {
    a + (b - a) * t
}

#[inline]
fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Σ vᵢ Π wᵢ over the corners, w being p or 1 − p on each axis.
#[inline]
pub(super) fn trilinear(corners: &[f32; 8], p: DVec3) -> f64 {
    let v = corners.map(f64::from);
    let x = [0, 2, 4, 6].map(|i| mix(v[i], v[i + 1], p.x));
    mix(mix(x[0], x[1], p.y), mix(x[2], x[3], p.y), p.z)
}

/// Its gradient: the differences along each axis, mixed along the others.
#[inline]
pub(super) fn trilinear_gradient(corners: &[f32; 8], p: DVec3) -> DVec3 {
    let v = corners.map(f64::from);
    let [dx, x] = [
        [0, 2, 4, 6].map(|i| v[i + 1] - v[i]),
        [0, 2, 4, 6].map(|i| mix(v[i], v[i + 1], p.x)),
    ];
    DVec3::new(
        mix(mix(dx[0], dx[1], p.y), mix(dx[2], dx[3], p.y), p.z),
        mix(x[1] - x[0], x[3] - x[2], p.z),
        mix(x[2], x[3], p.y) - mix(x[0], x[1], p.y),
    )
}

/// Its second derivatives, zero on the diagonal.
#[inline]
pub(super) fn trilinear_hessian(corners: &[f32; 8], p: DVec3) -> DMat3 {
    let v = corners.map(f64::from);
    let dx = [0, 2, 4, 6].map(|i| v[i + 1] - v[i]);
    let x = [0, 2, 4, 6].map(|i| mix(v[i], v[i + 1], p.x));
    let xy = mix(dx[1] - dx[0], dx[3] - dx[2], p.z);
    let xz = mix(dx[2] - dx[0], dx[3] - dx[1], p.y);
    let yz = x[3] - x[2] - x[1] + x[0];
    DMat3::from_cols(
        DVec3::new(0.0, xy, xz),
        DVec3::new(xy, 0.0, yz),
        DVec3::new(xz, yz, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: Cell = Cell {
        corners: [0.5, 2.0, 0.0, 1.0, 3.0, 0.25, 1.5, 4.0],
        start: DVec3::new(0.1, 0.9, 0.2),
        direction: DVec3::new(0.3, -0.35, 0.25),
        length: 2.0,
    };

    #[test]
    fn the_rule_is_exact_along_the_line() {
        let n = 20_000;
        let h = CELL.length / f64::from(n);
        let midpoints: f64 = (0..n)
            .map(|i| h * CELL.value((f64::from(i) + 0.5) * h))
            .sum();
        // h² L/24 of second derivatives below 5.
        assert!((CELL.column() - midpoints).abs() < 5.0 * h * h);
    }

    #[test]
    fn inverting_gives_back_the_column() {
        for share in [0.0, 1e-9, 0.1, 0.5, 0.9, 1.0] {
            let column = share * CELL.column();
            let s = CELL.invert(column);
            assert!((CELL.partial_column(s) - column).abs() < 1e-11, "{share}");
        }
        // From and to an empty corner, where the value is 0.
        for corners in [
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ] {
            let cell = Cell {
                corners,
                start: DVec3::ZERO,
                direction: DVec3::ONE,
                length: 1.0,
            };
            for share in [0.0, 1e-12, 0.3, 1.0 - 1e-12, 1.0] {
                let column = share * cell.column();
                let s = cell.invert(column);
                assert!((cell.partial_column(s) - column).abs() < 1e-12, "{share}");
            }
        }
    }

    #[test]
    fn derivatives_are_differences() {
        let h = 1e-5;
        for p in [DVec3::new(0.2, 0.7, 0.4), DVec3::new(0.9, 0.1, 0.5)] {
            for (i, axis) in DVec3::AXES.into_iter().enumerate() {
                let [after, before] = [p + h * axis, p - h * axis];
                let value = |p| trilinear(&CELL.corners, p);
                let gradient = |p| trilinear_gradient(&CELL.corners, p);
                let slope = (value(after) - value(before)) / (2.0 * h);
                assert!((gradient(p)[i] - slope).abs() < 1e-9);
                let column = (gradient(after) - gradient(before)) / (2.0 * h);
                let hessian = trilinear_hessian(&CELL.corners, p);
                assert!((hessian.col(i) - column).length() < 1e-9);
            }
        }
    }
}
