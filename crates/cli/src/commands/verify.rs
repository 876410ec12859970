//! `tyndall verify`: the exact benchmarks, as a table.

use crate::args::VerifyArgs;
use crate::error::CliError;
use crate::output;
use tyndall_render::verify::{MAX_Z, Row, verify};

/// Always the same random numbers: two machines can be told apart by their rows.
const SEED: u64 = 1;

pub(super) fn run(args: &VerifyArgs) -> Result<(), CliError> {
    let rows = verify(args.quick, SEED);
    if args.json {
        output::print_json(&rows)?;
    } else {
        output::print(&table(&rows))?;
    }
    match rows.iter().filter(|row| !row.pass).count() {
        0 => Ok(()),
        failed => Err(CliError::Verify {
            failed,
            rows: rows.len(),
        }),
    }
}

/// Name, value, exact value, standard error and z of every row; `tol` is the tolerance of what is not random.
fn table(rows: &[Row]) -> String {
    let width = rows
        .iter()
        .map(|row| row.name.chars().count())
        .max()
        .unwrap_or(0);
    let mut lines = vec![format!(
        "{:<5} {:<width$} {:>14} {:>14} {:>10} {:>6}",
        "", "name", "value", "exact", "std. error", "z"
    )];
    lines.extend(rows.iter().map(|row| {
        let (error, z) = match (row.stderr, row.z, row.tolerance) {
            (Some(stderr), Some(z), _) => (format!("{stderr:.1e}"), format!("{z:.2}")),
            (_, _, Some(tolerance)) => (format!("tol {tolerance:.0e}"), "-".to_owned()),
            _ => (String::new(), String::new()),
        };
        let verdict = if row.pass { "" } else { "  FAILED" };
        format!(
            "{:<5} {:<width$} {:>14.7e} {:>14.7e} {error:>10} {z:>6}{verdict}",
            row.family, row.name, row.value, row.exact
        )
    }));
    let failed = rows.iter().filter(|row| !row.pass).count();
    let largest = rows
        .iter()
        .filter_map(|row| row.z)
        .map(f64::abs)
        .fold(0.0, f64::max);
    lines.push(format!(
        "{} rows, {failed} failed; largest |z| {largest:.2}, allowed {MAX_Z} (by chance beyond: about 2e-5 a row)",
        rows.len()
    ));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_shows_its_numbers_and_a_failure_is_named() {
        let row = Row {
            family: "E2a",
            name: "airlight".to_owned(),
            value: 0.5,
            exact: 0.25,
            stderr: Some(0.01),
            z: Some(25.0),
            tolerance: None,
            pass: false,
        };
        let table = table(&[row]);
        for part in [
            "airlight",
            "5.0000000e-1",
            "2.5000000e-1",
            "1.0e-2",
            "25.00  FAILED",
            "1 rows, 1 failed",
        ] {
            assert!(table.contains(part), "{part}: {table}");
        }
    }
}
