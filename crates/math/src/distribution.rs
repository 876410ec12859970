//! Piecewise constant densities on a line and on a square, for what is given as a table: environment images above all.
//!
//! Only cumulative sums are kept, and densities are read from them: what is drawn and what is stated agree to the bit.

/// Densities on [0, 1) that are constant on equal cells.
#[derive(Clone, Debug)]
pub struct Distribution1D {
    cdf: Vec<f32>,
}

impl Distribution1D {
    /// Cells in proportion to `weights`; `None` where none is positive or one is negative or not finite.
    pub fn new(weights: &[f32]) -> Option<Self> {
        let mut cdf = vec![0.0; weights.len() + 1];
        let total = accumulate(weights, &mut cdf)?;
        (total > 0.0).then_some(Self { cdf })
    }

    /// A number in [0, 1) and its density.
    pub fn sample(&self, u: f32) -> (f32, f32) {
        sample_cdf(&self.cdf, u)
    }

    /// Density at `x`; 0 outside [0, 1).
    pub fn pdf(&self, x: f32) -> f32 {
        pdf_cdf(&self.cdf, x)
    }
}

/// Densities on [0, 1)² that are constant on a grid of equal cells.
///
/// The row is drawn from the sums of rows, the column from the row: neighbouring random numbers stay neighbours.
#[derive(Clone, Debug)]
pub struct Distribution2D {
    rows: Distribution1D,
    /// One cumulative sum of `width` + 1 numbers a row.
    columns: Vec<f32>,
    width: usize,
}

impl Distribution2D {
    /// Cells in proportion to `weights`, `width` to a row; `None` where they do not fill whole rows, none is positive, or one is
    /// negative or not finite.
    pub fn new(weights: &[f32], width: usize) -> Option<Self> {
        if width == 0 || !weights.len().is_multiple_of(width) {
            return None;
        }
        let mut columns = vec![0.0; weights.len() / width * (width + 1)];
        let mut totals = Vec::with_capacity(weights.len() / width);
        for (row, cdf) in weights.chunks(width).zip(columns.chunks_mut(width + 1)) {
            totals.push(accumulate(row, cdf)?);
        }
        // Scaled by the largest, so that no sum overflows f32.
        let largest = totals.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let rows: Vec<f32> = totals.iter().map(|t| (t / largest) as f32).collect();
        Some(Self {
            rows: Distribution1D::new(&rows)?,
            columns,
            width,
        })
    }

    /// A point (x along a row, y across rows) and its density.
    pub fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        let (y, pdf_y) = self.rows.sample(u[1]);
        let (x, pdf_x) = sample_cdf(self.row(y), u[0]);
        ([x, y], pdf_x * pdf_y)
    }

    /// Density at (x, y); 0 outside the unit square.
    pub fn pdf(&self, [x, y]: [f32; 2]) -> f32 {
        let pdf_y = self.rows.pdf(y);
        if pdf_y > 0.0 {
            pdf_y * pdf_cdf(self.row(y), x)
        } else {
            0.0
        }
    }

    fn row(&self, y: f32) -> &[f32] {
        let start = cell(y, self.rows.cdf.len() - 1) * (self.width + 1);
        &self.columns[start..start + self.width + 1]
    }
}

/// Writes the cumulative sums of `weights`, scaled to end at 1 unless all are 0, and returns their sum.
fn accumulate(weights: &[f32], cdf: &mut [f32]) -> Option<f64> {
    // f64: an image row has thousands of terms, and its dark cells must not vanish beside the sun.
    let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
    if weights.iter().any(|w| !w.is_finite() || *w < 0.0) {
        return None;
    }
    let scale = if total > 0.0 { total.recip() } else { 0.0 };
    let mut sum = 0.0;
    cdf[0] = 0.0;
    for (c, &w) in cdf[1..].iter_mut().zip(weights) {
        sum += f64::from(w);
        *c = (sum * scale).min(1.0) as f32;
    }
    Some(total)
}

/// The cell of `x` in [0, 1) among `n`. In f64 the product is exact: no point is counted to its neighbour's cell.
fn cell(x: f32, n: usize) -> usize {
    ((f64::from(x) * n as f64) as usize).min(n - 1)
}

fn sample_cdf(cdf: &[f32], u: f32) -> (f32, f32) {
    let n = cdf.len() - 1;
    // The last cell that starts at or below u; the next edge is above u, so the cell has mass.
    let u = u.min(cdf[n].next_down());
    let i = cdf.partition_point(|&c| c <= u).clamp(1, n) - 1;
    let mass = cdf[i + 1] - cdf[i];
    let x = ((i as f64 + f64::from((u - cdf[i]) / mass)) / n as f64) as f32;
    // Rounding to f32 must not leave the cell.
    let x = match cell(x, n) {
        above if above > i || x >= 1.0 => x.next_down(),
        below if below < i => x.next_up(),
        _ => x,
    };
    (x, mass * n as f32)
}

fn pdf_cdf(cdf: &[f32], x: f32) -> f32 {
    if !(0.0..1.0).contains(&x) {
        return 0.0;
    }
    let n = cdf.len() - 1;
    let i = cell(x, n);
    (cdf[i + 1] - cdf[i]) * n as f32
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::testing::{Distances, UnitSquare, assert_conforms};
    use proptest::prelude::*;

    #[test]
    fn draws_on_a_line_follow_the_table() {
        let d = Distribution1D::new(&[1.0, 0.0, 5.0, 0.01, 0.0, 2.0, 0.0]).unwrap();
        let domain = Distances::even(0.0, 1.0, 70);
        assert_conforms(&domain, 41, |u| Some(d.sample(u[0])), |x| d.pdf(x));
    }

    #[test]
    fn draws_on_a_square_follow_a_table_with_black_rows_and_a_sun() {
        let mut weights = vec![0.0; 16 * 9];
        for (i, w) in weights.iter_mut().enumerate() {
            if i / 16 != 4 {
                *w = (i % 7) as f32;
            }
        }
        weights[100] = 1000.0;
        let d = Distribution2D::new(&weights, 16).unwrap();
        let domain = UnitSquare { n: [16, 9] };
        assert_conforms(&domain, 42, |u| Some(d.sample(u)), |x| d.pdf(x));
    }

    #[test]
    fn tables_without_a_density_are_refused() {
        assert!(Distribution1D::new(&[]).is_none());
        assert!(Distribution1D::new(&[0.0, 0.0]).is_none());
        assert!(Distribution1D::new(&[1.0, -1.0]).is_none());
        assert!(Distribution1D::new(&[1.0, f32::NAN]).is_none());
        assert!(Distribution1D::new(&[1.0, f32::INFINITY]).is_none());
        assert!(Distribution2D::new(&[1.0; 6], 4).is_none());
        assert!(Distribution2D::new(&[1.0; 6], 0).is_none());
        assert!(Distribution2D::new(&[f32::MAX; 6], 3).is_some());
    }

    proptest! {
        #[test]
        fn the_density_drawn_is_the_density_stated_for_any_table(
            weights in prop::collection::vec(0.0f32..1.0, 1..300), u in 0.0f32..1.0
        ) {
            prop_assume!(weights.iter().any(|&w| w > 0.0));
            let d = Distribution1D::new(&weights).unwrap();
            for u in [u, 0.0, 1.0_f32.next_down()] {
                let (x, pdf) = d.sample(u);
                prop_assert!((0.0..1.0).contains(&x));
                prop_assert!(pdf > 0.0);
                prop_assert_eq!(pdf, d.pdf(x));
            }
        }
    }
}
