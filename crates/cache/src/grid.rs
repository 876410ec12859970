//! The geometry of one octree level: a regular grid whose cells have a power of two as their side.
//! It says which cell a point is in, and which cells a ball of valid radius touches.

use glam::{DVec3, Vec3};

/// A ball in which a record is valid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub(crate) centre: Vec3,
    pub(crate) radius: f32,
}

/// Widens a ball by more than rounding can, so that a cell list never misses a record whose computed |p−x|/R is below 1.
///
/// That quotient is off by at most five roundings of 2⁻²⁴ each, 3·10⁻⁷ in all.
const ROUNDING: f64 = 1.0 + 1e-6;

/// Bits of a cell coordinate; three of them fill a key of 63 bits.
const BITS: u32 = 21;

/// The cell coordinate of the world's origin, so that coordinates are positive.
const ORIGIN: f64 = (1_u32 << (BITS - 1)) as f64;

/// The largest cell coordinate.
const LAST: i64 = (1 << BITS) - 1;

/// Cells are at least this part of the largest coordinate of any record in them, so that cell coordinates fit in a key.
///
/// It is 2⁻¹⁹, larger than the spacing of `f32` numbers by a factor of 16: no precision of a position is lost by it.
const SMALLEST_CELL: f64 = 1.0 / (1_u32 << (BITS - 2)) as f64;

/// Size of a level's cells as the exponent of two: side = 2^exponent.
pub(crate) type SideExponent = i16;

/// The level of a ball: cells at least as wide as its radius (the smallest such power of two, if the ball is not
/// very far from the origin), so that a ball touches at most 3 cells along each axis.
pub(crate) fn side_exponent(ball: &Ball) -> SideExponent {
    let far = f64::from(ball.centre.abs().max_element()) * SMALLEST_CELL;
    let side = (f64::from(ball.radius) * ROUNDING).max(far);
    // log2 rounded upwards, from the bits: exact, and `side` is never subnormal as f64.
    let exponent = (side.to_bits() >> 52) as SideExponent - 1023;
    let is_power_of_two = side.to_bits() << 12 == 0;
    exponent + SideExponent::from(!is_power_of_two)
}

/// A box of cells, both corners included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellBox {
    pub(crate) low: [i64; 3],
    pub(crate) high: [i64; 3],
}

/// The cells of one level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    side: f64,
    inv_side: f64,
}

impl Grid {
    pub(crate) fn new(exponent: SideExponent) -> Self {
        // 2^exponent, from its bits: exact on every machine.
        let side = f64::from_bits(((1023 + exponent) as u64) << 52);
        Self {
            side,
            inv_side: 1.0 / side,
        }
    }

    /// Width of a cell.
    pub(crate) fn side(&self) -> f64 {
        self.side
    }

    /// The key of the cell that holds `p`; `None` outside the grid, where no record of this level can reach.
    #[inline]
    pub(crate) fn key(&self, p: Vec3) -> Option<u64> {
        let [x, y, z] = [p.x, p.y, p.z].map(|a| self.coordinate(f64::from(a)));
        // A negative coordinate has its upper bits set, too.
        ((x | y | z) as u64 <= LAST as u64).then(|| key([x, y, z]))
    }

    /// The cells within `reach` of `p` along each axis, clipped to the grid.
    pub(crate) fn cells_within(&self, p: Vec3, reach: f64) -> CellBox {
        let corner = |offset: f64| {
            p.to_array()
                .map(|a| self.coordinate(f64::from(a) + offset).clamp(0, LAST))
        };
        CellBox {
            low: corner(-reach),
            high: corner(reach),
        }
    }

    /// Calls `visit` with the key of each cell that the ball touches, in ascending order of keys.
    pub(crate) fn for_each_touched(&self, ball: &Ball, mut visit: impl FnMut(u64)) {
        let reach = f64::from(ball.radius) * ROUNDING;
        let CellBox { low, high } = self.cells_within(ball.centre, reach);
        // Adding `ORIGIN` rounds a coordinate to 2⁻³², so a cell's faces are uncertain by that much of its side.
        let limit = (reach + self.side * 1e-9).powi(2);
        // Squared distance of the centre to the slab of cells with this coordinate.
        let to_slab = |axis: usize, coordinate: i64| {
            let face = (coordinate as f64 - ORIGIN) * self.side;
            let centre = f64::from(ball.centre[axis]);
            (centre - centre.clamp(face, face + self.side)).powi(2)
        };
        for x in low[0]..=high[0] {
            let to_x = to_slab(0, x);
            for y in low[1]..=high[1] {
                let to_xy = to_x + to_slab(1, y);
                for z in low[2]..=high[2] {
                    if to_xy + to_slab(2, z) <= limit {
                        visit(key([x, y, z]));
                    }
                }
            }
        }
    }

    /// Calls `visit` with the key of each cell within `margin` of the straight way between two points, and of some beside it.
    pub(crate) fn for_each_along(
        &self,
        [from, to]: [DVec3; 2],
        margin: f64,
        mut visit: impl FnMut(u64),
    ) {
        let way = to - from;
        let cells = |axis: usize, a: f64, b: f64| {
            let coordinate = |a| self.coordinate(a).clamp(0, LAST);
            let from = from[axis];
            coordinate(from + a.min(b) - margin)..=coordinate(from + a.max(b) + margin)
        };
        // Slab by slab along the axis of the longest way.
        let main = way.abs().max_position();
        let [v, w] = [(main + 1) % 3, (main + 2) % 3];
        for slab in cells(main, 0.0, way[main]) {
            let face = (slab as f64 - ORIGIN) * self.side - from[main];
            // Parts of the way at which the slab begins and ends. A way without length is in the slab from start to end.
            let part = |face: f64| (face / way[main]).clamp(0.0, 1.0);
            let (a, b) = (part(face - margin), part(face + self.side + margin));
            let (a, b) = if way[main] == 0.0 { (0.0, 1.0) } else { (a, b) };
            for row in cells(v, a * way[v], b * way[v]) {
                for cell in cells(w, a * way[w], b * way[w]) {
                    let mut coordinates = [slab; 3];
                    coordinates[v] = row;
                    coordinates[w] = cell;
                    visit(key(coordinates));
                }
            }
        }
    }

    /// In f64, where neither a far point overflows nor a near one underflows; monotone, which is what makes
    /// [`Grid::cells_within`] safe against rounding.
    #[inline]
    fn coordinate(&self, a: f64) -> i64 {
        (a * self.inv_side + ORIGIN) as i64
    }
}

/// One number for a cell; cells that follow each other along z have keys that follow each other.
#[inline]
pub(crate) fn key([x, y, z]: [i64; 3]) -> u64 {
    ((x << (2 * BITS)) | (y << BITS) | z) as u64
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn grid_of(ball: &Ball) -> Grid {
        Grid::new(side_exponent(ball))
    }

    #[test]
    fn cells_are_the_next_power_of_two_above_the_radius() {
        for (radius, exponent) in [(1.0, 1), (0.99, 0), (0.5, 0), (0.4, -1), (3.0, 2)] {
            let ball = Ball {
                centre: Vec3::ONE,
                radius,
            };
            assert_eq!(side_exponent(&ball), exponent, "radius {radius}");
        }
    }

    #[test]
    fn a_ball_touches_at_least_one_and_at_most_27_cells_at_any_scale() {
        for radius in [1e-38, 1e-6, 0.37, 0.5, 1.0, 1e5, 8e37] {
            for far in [0.0, -0.3, 1.0, 1e-20, -4e8, 3.4e38] {
                let ball = Ball {
                    centre: Vec3::new(far, -far, 0.1),
                    radius,
                };
                let mut n = 0;
                grid_of(&ball).for_each_touched(&ball, |_| n += 1);
                assert!((1..=27).contains(&n), "{n} cells for {ball:?}");
            }
        }
    }

    #[test]
    fn the_cell_of_any_point_in_a_ball_is_touched_by_the_ball() {
        let directions = [
            Vec3::X,
            Vec3::NEG_Y,
            Vec3::Z,
            Vec3::new(-0.6, 0.64, 0.48),
            Vec3::splat(-0.577_350_2),
        ];
        for radius in [1e-30, 0.37, 0.5, 1.0, 1e5] {
            for far in [0.0, -0.3, 1e-20, -4e8] {
                let ball = Ball {
                    centre: Vec3::new(far, 0.0, 1.0),
                    radius,
                };
                let grid = grid_of(&ball);
                let mut touched = Vec::new();
                grid.for_each_touched(&ball, |key| touched.push(key));
                for direction in directions {
                    for part in [0.0, 0.5, 1.0 - f32::EPSILON] {
                        let p = ball.centre + direction * radius * part;
                        if p.distance(ball.centre) < radius {
                            assert!(touched.contains(&grid.key(p).unwrap()), "{p} of {ball:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn far_points_and_points_that_are_not_numbers_find_no_records() {
        let grid = Grid::new(0);
        assert_eq!(grid.key(Vec3::splat(1e30)), None);
        assert_eq!(grid.key(Vec3::splat(-1e30)), None);
        assert_eq!(grid.key(Vec3::NAN), Some(0), "a cell no record is in");
    }
}
