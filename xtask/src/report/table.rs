//! Numbers in columns, as CSV. Six significant digits are written, fewer than the libraries of machines differ in.

/// A table; every row is as long as `columns`.
pub(crate) struct Table {
    /// Names without commas, ending with the unit: `radius_m`.
    pub(crate) columns: Vec<&'static str>,
    pub(crate) rows: Vec<Vec<f64>>,
}

impl Table {
    /// A line of names, then one a row; what is infinite is written `inf`.
    pub(crate) fn csv(&self) -> String {
        let mut csv = self.columns.join(",") + "\n";
        for row in &self.rows {
            let row: Vec<_> = row.iter().map(|&x| rounded(x, 6).to_string()).collect();
            csv += &(row.join(",") + "\n");
        }
        csv
    }
}

/// `x` to so many significant decimal digits, at least one.
pub(crate) fn rounded(x: f64, digits: usize) -> f64 {
    // The text of a number is always one.
    format!("{x:.*e}", digits - 1).parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_written_line_by_line() {
        let table = Table {
            columns: vec!["x_m", "radius_m"],
            rows: vec![vec![-0.1 - 0.2, 1.0 / 3.0], vec![2.0, f64::INFINITY]],
        };
        assert_eq!(table.csv(), "x_m,radius_m\n-0.3,0.333333\n2,inf\n");
    }
}
